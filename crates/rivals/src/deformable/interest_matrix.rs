//! A matrix of flags that says which pairs of objects can touch at all: the tool and groups of
//! tetrahedra.
//!
//! # Theory
//! Garcia-Alonso, Serrano and Flaquer 1994: a pair without interest is not looked at. Here the gap
//! between the boxes of a pair is kept; until tool and tissue together have moved that far, the
//! pair has no interest.
//!
//! # Practice
//! One pass over the coordinates, 2 ns for each group of 64 tetrahedra, and the groups near the
//! tool.
//!
//! # Sources
//! Garcia-Alonso et al. 1994, collision interest matrix; thesis 2.1.1. Liberties: one row, since
//! there is one tool; flags lapse by motion, where theirs are set by the application.

use super::motion::{Fitted, Motion};
use super::volume_tree::halved;
use trepan_deformable::Descriptor;
use trepan_deformable::SearchInputs;
use trepan_deformable::kit::Extent;
use trepan_deformable::kit::distinct_rows;
use trepan_deformable::kit::{BroadPhase, Indexed, Phased, box_of};
use trepan_deformable::search::UniformGrid;
use trepan_geometry::{Aabb, Vec3};
use trepan_mesh::Csr;

/// Groups of tetrahedra and their flags.
#[derive(Debug)]
pub struct InterestMatrix {
    order: Vec<u32>,
    nodes: Csr,
    flags: Vec<Flag>,
    tissue: Motion,
    /// The two corners of the tool's box.
    tool: Motion,
    near: Indexed<UniformGrid>,
}

/// Without interest until both have moved over the gap since it was measured, mm.
#[derive(Clone, Copy, Debug)]
struct Flag {
    gap_mm: f32,
    tissue: Fitted,
    tool: Fitted,
}

/// Tetrahedra in a group.
const GROUP: usize = 64;

impl InterestMatrix {
    /// Groups over a mesh at rest.
    pub fn new(inputs: &SearchInputs) -> Self {
        let (positions, tets) = (&inputs.mesh.positions, &inputs.mesh.tets);
        let (_, order) = halved(positions, tets);
        let nodes = distinct_rows(order.chunks(GROUP).map(|group| group.iter().flat_map(|&t| tets[t as usize])));
        let ((tissue, of_tissue), (tool, of_tool)) = (Motion::of(positions), Motion::of(&[Vec3::ZERO; 2]));
        Self {
            flags: vec![Flag { gap_mm: 0.0, tissue: of_tissue, tool: of_tool }; nodes.len()],
            near: Indexed::new(UniformGrid::new(inputs.cell_mm, inputs.points), tets.len()),
            order,
            nodes,
            tissue,
            tool,
        }
    }
}

/// Largest distance of two boxes along an axis, mm; 0 when they meet.
fn gap_mm(a: &Extent, b: &Extent) -> f32 {
    (a.low - b.high).max(b.low - a.high).max_element().max(0.0)
}

impl BroadPhase for InterestMatrix {
    fn update(&mut self, positions: &[Vec3], tets: &[[u32; 4]], region: &Aabb) {
        self.tissue.follow(positions);
        self.tool.follow(&[region.min, region.max]);
        self.near.clear();
        let region = Extent::from(*region);
        for (group, flag) in self.flags.iter_mut().enumerate() {
            if self.tissue.since(flag.tissue) + self.tool.since(flag.tool) < flag.gap_mm {
                continue;
            }
            let bounds = Extent::of(self.nodes.row(group).iter().map(|&n| &self.tissue.places[n as usize]));
            *flag = Flag { gap_mm: gap_mm(&bounds, &region), tissue: self.tissue.now(), tool: self.tool.now() };
            if flag.gap_mm == 0.0 {
                let last = self.order.len().min((group + 1) * GROUP);
                for &t in &self.order[group * GROUP..last] {
                    self.near.offer(t, box_of(positions, &tets[t as usize]), &region);
                }
            }
        }
        self.near.sort();
    }

    fn pairs(&mut self, points: &[Vec3], out: &mut Vec<[u32; 2]>) -> u32 {
        self.near.pairs(points, out)
    }
}

/// The matrix of flags.
pub const METHOD: Descriptor = Descriptor::of("interest-matrix", "Garcia-Alonso et al. 1994", |inputs| {
    Box::new(Phased::new(InterestMatrix::new(inputs), inputs.points))
});
