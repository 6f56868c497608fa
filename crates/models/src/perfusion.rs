//! How the tissue of a patient's brain bleeds once it is cut.

use trepan_bleeding::Perfusion;
use trepan_measurements::bleeding;
use trepan_mesh::{FACES, NONE, Topology};
use trepan_patient::{RestBrain, TissueClass};

/// Perfusion of each tetrahedron, `times` the usual.
///
/// A vessel by its class is cut where it comes to light. Of the tetrahedra around a tumour some
/// have one, as many as its border has area for.
pub fn perfusion(brain: &RestBrain, times: f32) -> Vec<Perfusion> {
    let class = |tet: usize| usize::from(brain.class_of_tet.get(tet).map_or(0, |code| code.saturating_sub(1)));
    let is = |tet: usize, of: TissueClass| class(tet) == of as usize;
    let is_tumour = |tet: usize| is(tet, TissueClass::Tumour) || is(tet, TissueClass::SoftTumour);
    let neighbours = Topology::of(&brain.mesh).neighbours;
    let mut border_cm2 = 0.0;
    let of = |tet: usize| {
        let corners = brain.mesh.corners(tet);
        let to_tumour = |face: usize| Some(neighbours[tet][face]).is_some_and(|n| n != NONE && is_tumour(n as usize));
        let mm2 = |face: usize| {
            let [a, b, c] = FACES[face].map(|corner| corners[corner]);
            0.5 * (b - a).cross(c - a).length()
        };
        let vessels = |cm2: f32| (cm2 * bleeding::VESSEL_DENSITY.f32()).floor();
        let before = vessels(border_cm2);
        if !is_tumour(tet) {
            border_cm2 += 1e-2 * (0..4).filter(|&face| to_tumour(face)).map(mm2).sum::<f32>();
        }
        let capillaries = match (is(tet, TissueClass::Ventricle), is_tumour(tet)) {
            (true, _) => 0.0,
            (_, true) => bleeding::TUMOUR_RATE.f32(),
            _ => 1.0,
        };
        let has_vessel = is(tet, TissueClass::Vessel) || vessels(border_cm2) > before;
        Perfusion { capillaries: times * capillaries, vessel: times * f32::from(has_vessel) }
    };
    (0..brain.mesh.tets.len()).map(of).collect()
}
