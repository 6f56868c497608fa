//! How the brain is held in its skull: by its stem, arachnoid and fluid, falx and bridging veins.
//!
//! # Theory
//! The lowest end of the brain, at the foramen magnum, is fixed. Every border node within reach of
//! bone hangs on the layer of arachnoid and fluid between it and the skull, of thickness g at rest,
//! for its share A of the border:
//! ```text
//! k_along = E A / g     k_across = k_along / 3     as far as the node is in fluid
//! ```
//! so that brain and skull cannot part while no air gets in. Above the level of the fluid only the
//! contact of [`SkullWall`] is left, which slides and separates. The falx holds the midline against
//! motion to the side, bridging veins hold the cortex beside the sagittal sinus; both stay when the
//! fluid has drained. The cortex under the planned opening hangs on nothing, and the pressure in
//! the skull pushes it out.
//!
//! # Practice
//! Places come from the patient's axes (RAS): the midline is the plane through the middle of the
//! brain, whatever pushes it aside; a head that was scanned tilted has its falx tilted by as much.
//!
//! # Sources
//! Layer: N. J. Bennion et al., PMC9748497. Every constant is a row of `support.csv` in
//! `fixtures/measurements`.

use crate::plan::Plan;
use crate::scene::{RestBrain, below};
use std::sync::Arc;
use trepan_bone::BoneVolume;
use trepan_deformable::{BorderNode, ConfigError};
use trepan_geometry::{Vec3, units::mpa_from_kpa};
use trepan_measurements::support;
use trepan_mesh::{Surface, TetMesh};
use trepan_soft::Anchor;
use trepan_stages::skull_wall::SkullWall;

/// Thickness of the layer from which it holds nothing, a cistern or the spinal canal, and below
/// which it counts as that thick, mm; numerical.
const LAYER_MM: [f32; 2] = [1.0, 8.0];
/// Smallest number of nodes that holds the stem, numerical.
const MIN_FIXED: usize = 12;

/// What holds a brain.
pub struct BrainSupport {
    /// Nodes that do not move.
    pub fixed: Vec<u32>,
    /// Springs to places at rest.
    pub anchors: Vec<Anchor>,
    /// The skull around it; `None` without one.
    pub wall: Option<SkullWall>,
}

impl RestBrain {
    /// Holds the brain by the surface of its base, with the skull around it if there is one.
    ///
    /// # Errors
    /// When the mesh names a node that is not there, or has one that is nowhere.
    pub fn held_by_base(&self, bone: Option<Arc<BoneVolume>>) -> Result<BrainSupport, ConfigError> {
        let wall = bone.map(|bone| SkullWall::new(bone, &self.mesh, &self.fixed)).transpose()?;
        Ok(BrainSupport { fixed: self.fixed.clone(), anchors: Vec::new(), wall })
    }

    /// Holds the brain in its skull by stem, arachnoid, falx and bridging veins, but not under the
    /// planned opening.
    ///
    /// # Errors
    /// When the mesh names a node that is not there, or has one that is nowhere.
    pub fn held_in_skull(&self, bone: Arc<BoneVolume>, plan: &Plan) -> Result<BrainSupport, ConfigError> {
        let fixed = stem(&self.mesh);
        let wall = SkullWall::new(bone, &self.mesh, &fixed)?;
        let place = |node: u32| self.mesh.positions[node as usize];
        let bounds = self.mesh.bounds();
        let (middle, top) = (bounds.centre().x, bounds.max.z);
        let is_by_sinus = |border: &BorderNode| {
            let at = place(border.node);
            (at.x - middle).abs() < support::VEIN_REACH.f32() && border.normal.z > 0.5
        };
        let on_border = |border: &BorderNode| {
            let BorderNode { node, area_mm2, normal, .. } = *border;
            if plan.bares(place(node), normal) {
                return Anchor { node, normal, open_mm2: area_mm2, ..Anchor::default() };
            }
            let gap_mm = wall.gap_mm(place(node)).max(LAYER_MM[0]);
            let layer = mpa_from_kpa(support::LAYER_MODULUS.f32()) * area_mm2 / gap_mm;
            let layer = if gap_mm < LAYER_MM[1] { layer } else { 0.0 };
            let vein = mpa_from_kpa(support::VEIN_STIFFNESS.f32()) * area_mm2;
            let vein = if is_by_sinus(border) { vein } else { 0.0 };
            Anchor {
                node,
                normal,
                along: layer + vein,
                across: layer * support::LAYER_SHEAR.f32() + vein,
                in_fluid: if layer > 0.0 { layer / (layer + vein) } else { 0.0 },
                open_mm2: 0.0,
            }
        };
        let mut anchors: Vec<Anchor> = wall.border().iter().map(on_border).collect();
        anchors.extend(falx(&self.mesh, middle, top, &fixed));
        Ok(BrainSupport { fixed, anchors, wall: Some(wall) })
    }
}

/// The lowest nodes of the brain.
fn stem(mesh: &TetMesh) -> Vec<u32> {
    let low = below(mesh, support::STEM_HEIGHT.f32());
    if low.len() >= MIN_FIXED {
        return low;
    }
    let mut all: Vec<u32> = (0..mesh.positions.len() as u32).collect();
    all.sort_by(|a, b| mesh.positions[*a as usize].z.total_cmp(&mesh.positions[*b as usize].z));
    all.truncate(MIN_FIXED);
    all
}

/// Anchors to the side for the inner nodes of the midline plane, each for its share of the plane.
fn falx(mesh: &TetMesh, middle: f32, top: f32, fixed: &[u32]) -> Vec<Anchor> {
    let mut is_inner = vec![true; mesh.positions.len()];
    Surface::of(mesh).triangles.iter().flatten().chain(fixed).for_each(|&node| is_inner[node as usize] = false);
    let volume: f64 = (0..mesh.tets.len()).map(|tet| mesh.volume_mm3(tet)).sum();
    let spacing_mm = (volume / mesh.positions.len().max(1) as f64).cbrt() as f32;
    let in_falx = |node: &u32| {
        let at = mesh.positions[*node as usize];
        let is_deep = top - at.z < support::FALX_DEPTH.f32();
        is_inner[*node as usize] && (at.x - middle).abs() < 0.5 * spacing_mm && is_deep
    };
    let along = mpa_from_kpa(support::FALX_STIFFNESS.f32()) * spacing_mm * spacing_mm;
    let anchor = |node| Anchor { node, normal: Vec3::X, along, ..Anchor::default() };
    (0..mesh.positions.len() as u32).filter(in_falx).map(anchor).collect()
}
