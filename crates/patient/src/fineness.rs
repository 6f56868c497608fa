//! Resolution of a brain mesh, finer around its opening.

use trepan_geometry::Vec3;
use trepan_mesh::lattice;

/// Radius on the surface and depth of the refined region in a session's mesh, mm. A burr hole has
/// 5 mm and a probe 2; further away it strains too little to need small elements.
const OPENING_MM: [f32; 2] = [7.0, 4.0];
/// The same in a ground truth.
const TRUTH_MM: [f32; 2] = [8.0, 5.0];

/// Most halvings in a tumour, and how far around it, mm.
const TUMOUR_HALVINGS: u32 = 3;
const TUMOUR_MARGIN_MM: f32 = 2.0;

/// Resolution of a mesh: tetrahedra of the whole brain, and the refinement around a place.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Fineness {
    /// Tetrahedra of the whole brain.
    pub tets: usize,
    /// Halvings of the edge length.
    pub halvings: u32,
    /// Refined region: a ball of this radius, mm, with its centre so far above the surface.
    pub radius_mm: f32,
    /// See above.
    pub above_mm: f32,
}

impl Fineness {
    /// Ground truth for validation.
    pub const JUDGE: Self = Self::at_opening(100_000, 4, TRUTH_MM);
    /// Ground truth that a session computes at its start.
    pub const QUICK: Self = Self::at_opening(40_000, 4, TRUTH_MM);

    /// Resolution of a mesh that a session can step.
    pub const fn stepped(tets: usize, halvings: u32) -> Self {
        Self::at_opening(tets, halvings, OPENING_MM)
    }

    /// Small elements around an opening, to a radius on the surface and a depth, mm.
    const fn at_opening(tets: usize, halvings: u32, [wide, deep]: [f32; 2]) -> Self {
        let radius_mm = (wide * wide + deep * deep) / (2.0 * deep);
        Self { tets, halvings, radius_mm, above_mm: radius_mm - deep }
    }

    /// The refined region around a tumour, mm: fine enough to resect it.
    pub fn around(centre: Vec3, tumour_mm: f32, halvings: u32) -> Option<lattice::Fine> {
        let halvings = halvings.min(TUMOUR_HALVINGS);
        let fine = lattice::Fine { centre, radius_mm: tumour_mm + TUMOUR_MARGIN_MM, halvings };
        Some(fine).filter(|_| halvings > 0)
    }

    /// The refined region at a place of the surface.
    pub fn fine(&self, place: Vec3, outward: Vec3) -> Option<lattice::Fine> {
        let Self { halvings, radius_mm, above_mm, .. } = *self;
        let fine = lattice::Fine { centre: place + above_mm * outward, radius_mm, halvings };
        Some(fine).filter(|_| halvings > 0)
    }
}
