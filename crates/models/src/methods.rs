//! The methods that a session may name: with the feature `rivals` all of `trepan-rivals`, else each
//! family's own.

use trepan_deformable::Method as Search;
use trepan_rigid::Method as BoneContact;
use trepan_soft::Method as Solver;

/// Every method of contact with bone, in the order of charts.
pub fn bone_contacts() -> Vec<BoneContact> {
    #[cfg(feature = "rivals")]
    return trepan_rivals::rigid::METHODS.into();
    #[cfg(not(feature = "rivals"))]
    BoneContact::OWN.into()
}

/// The method of contact with bone of this name.
pub fn bone_contact(name: &str) -> Option<BoneContact> {
    bone_contacts().into_iter().find(|method| method.name() == name)
}

/// Every search for the tissue at a tool.
pub fn searches() -> Vec<Search> {
    #[cfg(feature = "rivals")]
    return trepan_rivals::deformable::METHODS.into();
    #[cfg(not(feature = "rivals"))]
    Search::OWN.into()
}

/// Every solver of tissue but `tled`.
pub fn solvers() -> Vec<Solver> {
    #[cfg(feature = "rivals")]
    return trepan_rivals::soft::METHODS.into();
    #[cfg(not(feature = "rivals"))]
    Solver::OWN.into()
}

/// The solver of this name; `tled` is none of them.
pub fn solver(name: &str) -> Option<Solver> {
    solvers().into_iter().find(|method| method.name() == name)
}
