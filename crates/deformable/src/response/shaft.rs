//! The tool's shaft against the moving surface: a row of balls along its axis.
//!
//! # Theory
//! The axis behind the tip is sampled every half shaft radius r, so that the row lies within 0.04 r
//! of the cylinder. Each sample is a ball: outside, its depth is `r - |c - q|` with q the closest
//! surface point; inside, `r + |c - q|`. The contact is the depth-weighted mean of the directions
//! out of the tissue, its depth that of the deepest sample, its load lies on the nodes under the
//! samples by their depths.
//!
//! # Practice
//! Samples far from the tissue cost a comparison of boxes for every eight of them. Which samples
//! are inside is found by a walk of their own.
//!
//! # When not to use it
//! For a shaft that has pierced the tissue: it is pushed back the way it came.

use crate::{
    extent::Extent,
    narrow::{Hits, NONE},
    response::{Answer, Spring},
    scene::Scene,
    seam::Search,
    search::Walk,
    surface::{Foot, MovingSurface},
};
use trepan_contact::{Contact, NodalContact};
use trepan_geometry::{Tool, ToolState, Vec3};

/// Samples on the axis, and what was found at each.
pub(crate) struct Shaft {
    spring: Spring,
    radius_mm: f32,
    along_mm: Vec<f32>,
    points: Vec<Vec3>,
    near: Vec<u32>,
    walk: Walk,
    hits: Hits,
}

/// Most samples on one shaft.
const MAX_SAMPLES: usize = 256;
/// Samples that ask for triangles together.
const PIECE: usize = 8;
/// Most triangles near one piece.
const MAX_NEAR: usize = 1024;

impl Shaft {
    /// For a tool and a mesh of so many tetrahedra; `None` for a tool without a shaft.
    pub(crate) fn new(tool: &Tool, tets: usize, spring: Spring) -> Option<Self> {
        let length_mm = tool.shaft_length_mm - tool.tip_radius_mm;
        if !(tool.shaft_radius_mm > 0.0 && length_mm > 0.0 && length_mm.is_finite()) {
            return None;
        }
        let wanted = (length_mm / (0.5 * tool.shaft_radius_mm)) as usize + 2;
        let count = wanted.min(MAX_SAMPLES);
        let at = |k: usize| tool.tip_radius_mm + length_mm * k as f32 / (count - 1) as f32;
        Some(Self {
            spring,
            radius_mm: tool.shaft_radius_mm,
            along_mm: (0..count).map(at).collect(),
            points: vec![Vec3::ZERO; count],
            near: Vec::with_capacity(MAX_NEAR),
            walk: Walk::new(count, tets),
            hits: Hits::with_points(count),
        })
    }

    pub(crate) fn reset(&mut self) {
        self.walk.reset();
    }

    /// The contact of the whole shaft and its nodal spring; nothing when it is free. `overflow`
    /// counts what did not fit.
    pub(crate) fn respond(
        &mut self,
        scene: &Scene,
        surface: &mut MovingSurface,
        overflow: &mut u32,
    ) -> Option<(Contact, NodalContact)> {
        self.place(scene.tool);
        let reach = Extent::of(&self.points).widened(self.radius_mm);
        if !reach.overlaps(&surface.bounds) {
            return None;
        }
        self.hits.clear();
        self.walk.find(&Scene { points: &self.points, ..*scene }, surface, &mut self.hits);
        *overflow += self.hits.overflow;
        let (mut force, mut deepest, mut nodal) = (Vec3::ZERO, 0.0f32, NodalContact::none());
        for first in (0..self.points.len()).step_by(PIECE) {
            let piece = first..(first + PIECE).min(self.points.len());
            let region = Extent::of(&self.points[piece.clone()]).widened(self.radius_mm);
            *overflow += surface.gather(scene.positions, &region, &mut self.near);
            for k in piece {
                let Some((foot, normal, depth_mm)) = self.sample(k, scene, surface) else { continue };
                force += normal * depth_mm;
                deepest = deepest.max(depth_mm);
                for (node, weight) in surface.weights_at(&foot) {
                    nodal.add(node, weight * depth_mm);
                }
            }
        }
        let (normal, depth_mm) = (force.try_normalize()?, deepest);
        let point = self.spring.load(scene, &Answer { normal, depth_mm }, &mut nodal)?;
        Some((Contact { point, normal, depth_mm }, nodal))
    }

    fn place(&mut self, tool: &ToolState) {
        for (world, &along) in self.points.iter_mut().zip(&self.along_mm) {
            *world = tool.world_from_tool * (Vec3::Z * along);
        }
    }

    /// Closest surface point, direction out of the tissue, and depth of one sample; `None` when it
    /// is free.
    fn sample(&self, k: usize, scene: &Scene, surface: &mut MovingSurface) -> Option<(Foot, Vec3, f32)> {
        let c = self.points[k];
        let inside = self.hits.tet[k] != NONE;
        let mut foot = surface.closest_among(scene.positions, self.near.iter().copied(), c, None);
        if inside && foot.is_none_or(|f| f.distance2 > self.radius_mm * self.radius_mm) {
            foot = surface.closest(scene.positions, c);
        }
        let foot = foot?;
        let outwards = if inside { foot.point - c } else { c - foot.point };
        let depth_mm = self.radius_mm + if inside { outwards.length() } else { -outwards.length() };
        let flat = surface.flat_normal(scene.positions, foot.triangle);
        let normal = if outwards.length() > 1e-3 * self.radius_mm { outwards.normalize() } else { flat };
        (depth_mm > 0.0).then_some((foot, normal, depth_mm))
    }
}
