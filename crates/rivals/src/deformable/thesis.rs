//! The thesis's search: first colliding tetrahedron from the last one found, then its neighbours
//! and theirs.
//!
//! # Theory
//! Chapter 4.2.2 in its improved form (4.4.1). Points go into the uniform grid, the boxes of all
//! tetrahedra are updated, the colliding box of tool and tissue is formed; when it is empty the
//! step ends. Else tetrahedra are tried from the last one found onwards until one holds a point:
//! box test, then barycentric coordinates. After that only its face neighbours and theirs are
//! tried.
//!
//! ```text
//!      . . 2 . .        1  first found
//!      . 2 1 2 .        2  neighbours and neighbours of neighbours
//!      . . 2 . .        .  never looked at
//! ```
//!
//! # When not to use it
//! With a tool larger than two rings of tetrahedra: points beyond them are missed. For meshes over
//! 22 thousand tetrahedra: all boxes are updated at every step, and a lost contact costs a search
//! over all of them.

use trepan_deformable::Search;
use trepan_deformable::kit::Extent;
use trepan_deformable::kit::MovingSurface;
use trepan_deformable::kit::Scene;
use trepan_deformable::kit::{Hits, NONE};
use trepan_deformable::kit::{PointIndex, box_of};
use trepan_deformable::search::UniformGrid;
use trepan_deformable::{Descriptor, Response};
use trepan_geometry::Aabb;

/// Grid, boxes, and the tetrahedron found last.
struct Thesis {
    cells: UniformGrid,
    boxes: Vec<Extent>,
    last: u32,
    rings: Vec<u32>,
}

/// A tetrahedron has at most 4 neighbours, and those 3 more each.
const TWO_RINGS: usize = 1 + 4 + 12;

/// The thesis's search with its response.
pub const METHOD: Descriptor = Descriptor {
    response: Response::Printed,
    is_complete: false,
    ..Descriptor::of("thesis", "thesis, chapter 4", |inputs| {
        Box::new(Thesis::new(inputs.cell_mm, inputs.points, inputs.mesh.tets.len()))
    })
};

impl Search for Thesis {
    fn reset(&mut self) {
        self.last = 0;
    }

    fn find(&mut self, scene: &Scene, _: &mut MovingSurface, hits: &mut Hits) {
        self.cells.place(scene.points);
        let tissue = self.update_boxes(scene);
        let colliding = Aabb::from(tissue).intersection(scene.ball_box());
        if colliding.is_empty() {
            return;
        }
        if let Some(first) = self.first_colliding(scene, &colliding.into(), hits) {
            self.last = first;
            self.two_rings(scene.neighbours, first);
            for k in 1..self.rings.len() {
                self.test(scene, self.rings[k], hits);
            }
        }
    }
}

impl Thesis {
    fn new(cell_mm: f32, points: usize, tets: usize) -> Self {
        Self {
            cells: UniformGrid::new(cell_mm, points),
            boxes: Vec::with_capacity(tets),
            last: 0,
            rings: Vec::with_capacity(TWO_RINGS),
        }
    }

    /// Boxes of all tetrahedra; returns the box of the tissue.
    fn update_boxes(&mut self, scene: &Scene) -> Extent {
        self.boxes.clear();
        let mut tissue = Extent::EMPTY;
        for tet in scene.tets {
            let fitted = box_of(scene.positions, tet);
            tissue.merge(&fitted);
            self.boxes.push(fitted);
        }
        tissue
    }

    /// The last one and its rings first, then all others onwards from it.
    fn first_colliding(&mut self, scene: &Scene, colliding: &Extent, hits: &mut Hits) -> Option<u32> {
        self.two_rings(scene.neighbours, self.last);
        let count = self.boxes.len() as u32;
        let near = (0..self.rings.len()).map(|k| self.rings[k]);
        let onwards = (self.last..count).chain(0..self.last);
        near.chain(onwards).find(|&tet| self.boxes[tet as usize].overlaps(colliding) && self.test(scene, tet, hits))
    }

    /// Tests the points in the cells of a tetrahedron's box; says whether one lies inside.
    fn test(&self, scene: &Scene, tet: u32, hits: &mut Hits) -> bool {
        let mut any = false;
        self.cells.visit(scene.points, &self.boxes[tet as usize], |point| {
            let i = point as usize;
            if hits.tet[i] == NONE {
                hits.test(scene, i, tet);
            }
            any |= hits.tet[i] == tet;
        });
        any
    }

    fn two_rings(&mut self, neighbours: &[[u32; 4]], tet: u32) {
        self.rings.clear();
        self.rings.push(tet);
        let mut ring = 0;
        for _ in 0..2 {
            let end = self.rings.len();
            for k in ring..end {
                for next in neighbours[self.rings[k] as usize] {
                    if next != NONE && !self.rings.contains(&next) {
                        self.rings.push(next);
                    }
                }
            }
            ring = end;
        }
    }
}
