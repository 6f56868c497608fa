//! Mixtures of tissue classes, for tetrahedra that hold several.
//!
//! # Practice
//! A tetrahedron's code is that of its class, or a larger one for a mixture. So a code minus one is
//! the number of a material: the classes' first, then the mixtures'. There are at most 255, so
//! shares are rounded up to the finest steps that leave no more; a mixture has its tetrahedra's
//! mean shares, and each class keeps its volume.

use crate::tissue_class::TissueClass;
use std::collections::BTreeMap;
use trepan_mesh::lattice::LabelledMesh;
use trepan_soft::{Body, Bound, Material, Membrane};

/// Shares of a volume by class, in the order of [`TissueClass::ALL`].
pub type Shares = [f32; TissueClass::ALL.len()];

/// Most mixtures beside the classes: codes are bytes, and 0 is no code.
const MOST: usize = 255 - TissueClass::ALL.len();
/// Steps to which shares are rounded, from fine to coarse. If even one leaves too many mixtures,
/// all tetrahedra have the mean of all.
const STEPS: [f32; 9] = [32.0, 16.0, 12.0, 8.0, 6.0, 4.0, 3.0, 2.0, 1.0];
/// How the moduli of classes make those of a mixture in a session.
pub const BOUND: Bound = Bound::HashinShtrikman;

/// The code of each tetrahedron of a mesh whose labels are class codes, and the mixtures.
pub fn codes(labelled: &LabelledMesh) -> (Vec<u8>, Vec<Shares>) {
    let mut codes: Vec<u8> = labelled.label_of_tet.iter().map(|label| *label as u8).collect();
    let mut of_tets: Vec<(usize, Shares)> = Vec::new();
    for of_tet in labelled.shares.chunk_by(|a, b| a.tet == b.tet) {
        let mut shares = Shares::default();
        of_tet.iter().for_each(|share| shares[usize::from(share.label) - 1] = share.share);
        of_tets.push((of_tet[0].tet as usize, shares));
    }
    let rounded = |steps: f32| {
        let mut bins: BTreeMap<[u8; TissueClass::ALL.len()], Vec<usize>> = BTreeMap::new();
        for (at, (_, shares)) in of_tets.iter().enumerate() {
            // Up: a trace of fluid softens a mean by stress, so none at all is a step of its own.
            bins.entry(shares.map(|share| (share * steps).ceil() as u8)).or_default().push(at);
        }
        bins
    };
    let one = || BTreeMap::from([(Default::default(), (0..of_tets.len()).collect())]);
    let bins = STEPS.into_iter().map(rounded).find(|bins| bins.len() <= MOST).unwrap_or_else(one);
    let mut mixtures = Vec::new();
    for members in bins.into_values() {
        let mut sum = [0.0f64; TissueClass::ALL.len()];
        for &(tet, shares) in members.iter().map(|at| &of_tets[*at]) {
            let mm3 = labelled.mesh.volume_mm3(tet);
            sum.iter_mut().zip(shares).for_each(|(sum, share)| *sum += mm3 * f64::from(share));
            codes[tet] = (TissueClass::ALL.len() + 1 + mixtures.len()) as u8;
        }
        let all: f64 = sum.iter().sum();
        mixtures.push(sum.map(|mm3| (mm3 / all) as f32));
    }
    (codes, mixtures)
}

/// A body of a mesh whose labels are class codes, made of materials by class in their order and of
/// mixtures by a bound.
pub fn body_of(labelled: &LabelledMesh, of_classes: Vec<Material>, bound: Bound, fixed: Vec<u32>) -> Body {
    let (codes, mixtures) = codes(labelled);
    Body {
        mesh: labelled.mesh.clone(),
        fixed,
        materials: materials(of_classes, &mixtures, bound),
        material_of_tet: codes.into_iter().map(|code| code - 1).collect(),
        anchors: Vec::new(),
        membrane: Membrane::default(),
    }
}

/// The materials of the classes, then those of the mixtures.
pub fn materials(mut of_classes: Vec<Material>, mixtures: &[Shares], bound: Bound) -> Vec<Material> {
    for shares in mixtures {
        let parts = shares.iter().zip(&of_classes).filter(|(share, _)| **share > 0.0);
        let parts: Vec<(f64, Material)> = parts.map(|(share, material)| (f64::from(*share), *material)).collect();
        let mixed = Material::mixture(&parts, bound, &of_classes[TissueClass::Brain as usize]);
        of_classes.push(mixed.unwrap_or(of_classes[TissueClass::Brain as usize]));
    }
    of_classes
}

#[cfg(test)]
mod tests {
    use super::*;
    use trepan_geometry::Vec3;
    use trepan_mesh::materials::Share;
    use trepan_soft::boxes;

    #[test]
    fn thousands_of_mixtures_become_as_many_as_fit_and_every_class_keeps_its_volume() {
        let mesh = boxes::split_box([12, 11, 10], Vec3::new(60.0, 55.0, 50.0));
        let mut labelled = LabelledMesh { label_of_tet: vec![1; mesh.tets.len()], mesh, shares: Vec::new() };
        for tet in (0..labelled.mesh.tets.len()).step_by(2) {
            let parts = [(1, 5 + tet % 31), (2, 1 + tet % 17), (3, 1 + tet % 7), (5, 1 + tet % 3)];
            let all: usize = parts.iter().map(|(_, part)| part).sum();
            labelled.shares.extend(parts.map(|(label, part)| Share {
                tet: tet as u32,
                label,
                share: part as f32 / all as f32,
            }));
        }
        let (codes, mixtures) = codes(&labelled);
        assert!((100..=MOST).contains(&mixtures.len()), "{}", mixtures.len());
        assert!(codes.iter().all(|code| (1..=TissueClass::ALL.len() + mixtures.len()).contains(&usize::from(*code))));
        let mm3 = |tet: usize| labelled.mesh.volume_mm3(tet);
        let before = |class: u16| -> f64 {
            let of_class = labelled.shares.iter().filter(|share| share.label == class);
            of_class.map(|share| mm3(share.tet as usize) * f64::from(share.share)).sum()
        };
        let after = |class: u16| -> f64 {
            let share =
                |code: u8| code.checked_sub(10).map_or(0.0, |at| mixtures[usize::from(at)][usize::from(class) - 1]);
            codes.iter().enumerate().map(|(tet, code)| mm3(tet) * f64::from(share(*code))).sum()
        };
        for class in [1, 2, 3, 5] {
            assert!((after(class) / before(class) - 1.0).abs() < 1e-5, "{class}");
        }
        assert!(codes.iter().enumerate().all(|(tet, code)| (*code == 1) == (tet % 2 == 1)));
        let plain = TissueClass::ALL.map(|class| class.stiffening(0.003)).to_vec();
        let all = materials(plain.clone(), &mixtures, BOUND);
        assert_eq!((all.len(), &all[..9]), (9 + mixtures.len(), &plain[..]));
        all.iter().for_each(|material| assert_eq!(material.check(), Ok(())));
    }
}
