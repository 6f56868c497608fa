//! The ways to find which tool points lie in which tetrahedra, as one closed list.

use crate::Response;

/// How the points inside the tissue are found. The list feeds tests, charts and command line.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Method {
    /// Every point against every tetrahedron in f64: the oracle, slow and obvious.
    Brute,
    /// Every tetrahedron's box against the tool's box, then the exact test: the plain baseline.
    Scan,
    /// Points in a uniform grid, every tetrahedron's box against its cells (Teschner et al. 2003,
    /// as an array).
    UniformGrid,
    /// The same with a hash table and time stamps (Teschner et al. 2003).
    HashedGrid,
    /// Points in an octree, made anew at every step (Meagher 1982).
    Octree,
    /// Points in a k-d tree, made anew at every step (Bentley 1975).
    KdTree,
    /// A tree of boxes, refitted bottom-up (van den Bergen 1997).
    AabbTree,
    /// The same of balls (Hubbard 1996).
    SphereTree,
    /// The same of polytopes with 18 sides (Klosowski et al. 1998).
    KDopTree,
    /// The same of boxes turned as at rest (Gottschalk et al. 1996).
    ObbTree,
    /// A tree of boxes, refitted bottom-up above and only where it is looked at below (Larsson and
    /// Akenine-Möller 2001).
    HybridTree,
    /// The ready-made tree: parry's.
    #[cfg(feature = "parry")]
    ParryTree,
    /// The thesis's chapter 4: grid, first tetrahedron from the last one found, two rings of
    /// neighbours.
    Thesis,
    /// Each point keeps its tetrahedron and walks on through neighbours; only what lies near the
    /// tool is looked at.
    Walk,
}

const METHODS: usize = if cfg!(feature = "parry") { 14 } else { 13 };

impl Method {
    /// The charted choice.
    pub const RECOMMENDED: Self = Self::Walk;

    /// All methods, the oracle first.
    pub fn all() -> [Self; METHODS] {
        use Method::*;
        [
            Brute,
            Scan,
            UniformGrid,
            HashedGrid,
            Octree,
            KdTree,
            AabbTree,
            SphereTree,
            KDopTree,
            ObbTree,
            HybridTree,
            #[cfg(feature = "parry")]
            ParryTree,
            Thesis,
            Walk,
        ]
    }

    /// The name used in files and on command lines.
    pub fn name(&self) -> &'static str {
        match self {
            Self::Brute => "brute",
            Self::Scan => "scan",
            Self::UniformGrid => "uniform-grid",
            Self::HashedGrid => "hashed-grid",
            Self::Octree => "octree",
            Self::KdTree => "kd-tree",
            Self::AabbTree => "aabb-tree",
            Self::SphereTree => "sphere-tree",
            Self::KDopTree => "k-dop-tree",
            Self::ObbTree => "obb-tree",
            Self::HybridTree => "hybrid-tree",
            #[cfg(feature = "parry")]
            Self::ParryTree => "parry-tree",
            Self::Thesis => "thesis",
            Self::Walk => "walk",
        }
    }

    /// The method of that name.
    pub fn named(name: &str) -> Option<Self> {
        Self::all().into_iter().find(|method| method.name() == name)
    }

    /// The response that belongs to the method: the thesis's own to the thesis, the recommended one
    /// to all others.
    pub fn response(&self) -> Response {
        match self {
            Self::Thesis => Response::Printed,
            _ => Response::RECOMMENDED,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_name_leads_back_to_its_method() {
        for method in Method::all() {
            assert_eq!(Method::named(method.name()), Some(method));
        }
        assert_eq!(Method::named("octree of dreams"), None);
    }
}
