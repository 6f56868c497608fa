//! The inputs of a picture: the constant scene and the changing frame.

use crate::{Camera, Cut, Overlay, Paint, Stereo};
use glam::{IVec3, Vec3, Vec4};
use std::sync::Arc;
use trepan_bone::BoneVolume;
use trepan_geometry::{Aabb, Pose, Tool};
use trepan_mesh::{Split, TetMesh, TriMesh};
use trepan_volume::VoxelVolume;

/// The scene data that stays constant during a session.
#[derive(Clone, Debug, Default)]
pub struct SceneData<'a> {
    /// The skull, if there was a CT; its changes are rendered.
    pub bone: Option<Arc<BoneVolume>>,
    /// The brain at rest.
    pub brain: Option<&'a TetMesh>,
    /// What is seen of it, in place of the tetrahedra's boundary.
    pub cortex: Option<Cortex<'a>>,
    /// The MRI in patient space, any range.
    pub mri: Option<&'a VoxelVolume<f32>>,
    /// A colour over each voxel of the MRI; black for none.
    pub tint: Option<&'a [[u8; 3]]>,
}

/// A fine surface that the tetrahedra move.
#[derive(Clone, Copy, Debug)]
pub struct Cortex<'a> {
    /// Triangles at rest, world mm, counterclockwise from outside.
    pub surface: &'a TriMesh,
    /// How deep in a sulcus each vertex lies, mm: it is darker there. Vertices beyond lie in none.
    pub depth_mm: &'a [f32],
}

/// Box that the slices show, world mm: the voxel centres of the CT, else of the MRI, else the
/// brain.
pub(crate) fn bounds(data: &SceneData) -> Aabb {
    let by_bone = data.bone.as_ref().map(|bone| {
        let last = IVec3::from(bone.dims().map(|n| n as i32 - 1));
        Aabb { min: bone.origin(), max: bone.centre_of(last) }
    });
    let by_mri = || data.mri.map(|mri| Aabb::of_points(&corners(mri)));
    let by_brain = || data.brain.map(|brain| brain.bounds());
    by_bone.or_else(by_mri).or_else(by_brain).unwrap_or(Aabb { min: Vec3::splat(-100.0), max: Vec3::splat(100.0) })
}

/// World centres of a volume's eight outermost voxels.
fn corners(volume: &VoxelVolume<f32>) -> [Vec3; 8] {
    let last = volume.dims.map(|n| n.saturating_sub(1));
    [0, 1, 2, 3, 4, 5, 6, 7]
        .map(|n| volume.centre_of([0, 1, 2].map(|a| if n >> a & 1 == 1 { last[a] } else { 0 })).as_vec3())
}

/// The contents of one picture.
#[derive(Clone, Copy, Debug)]
pub struct Frame<'a> {
    /// The camera.
    pub camera: Camera,
    /// The tool, if one is shown.
    pub tool: Option<Tool>,
    /// The tool's pose. Slices pass through its tip unless [`SliceLook::through`] says otherwise,
    /// or through the camera's target if the tip is outside the scanned box.
    pub world_from_tool: Pose,
    /// The tool in the other hand, and its pose.
    pub second: Option<(Tool, Pose)>,
    /// Rotation of the burr around its shaft, rad.
    pub turn_rad: f32,
    /// Whether the burr cuts.
    pub drilling: bool,
    /// Current nodes of the brain, world mm, in the order of the mesh; `None` shows it at rest.
    pub brain_positions: Option<&'a [Vec3]>,
    /// Whether each tetrahedron of the brain was resected; `None` for none of them. The walls of
    /// the hole are drawn with the MRI on them.
    pub brain_gone: Option<&'a [bool]>,
    /// Splits of the brain's nodes where it was cut, in their order; then `brain_positions` has the
    /// copies too.
    pub brain_splits: &'a [Split],
    /// Stain of each node of the brain: blood of 0 to 2 mm as 0 to 200, 255 for a burn; `None` for
    /// none.
    pub brain_stains: Option<&'a [u8]>,
    /// The dura over the brain; `None` where it is away.
    pub dura: Option<Leaves<'a>>,
    /// Whether the skull is shown in the 3-D view.
    pub show_bone: bool,
    /// Whether the brain is shown in the 3-D view.
    pub show_brain: bool,
    /// Colours over the bone, by world position.
    pub bone_paint: Option<&'a Paint>,
    /// Colours over the brain, by rest position: they move with the tissue.
    pub brain_paint: Option<&'a Paint>,
    /// The overlay.
    pub overlay: Overlay<'a>,
    /// The plane that cuts the brain.
    pub cut: Option<Cut>,
    /// Stereo parameters; `None` for one eye.
    pub stereo: Option<Stereo>,
    /// Grey values of the slices.
    pub slices: SliceLook,
}

/// A sheet over the brain, such as the dura with its leaves.
#[derive(Clone, Copy, Debug)]
pub struct Leaves<'a> {
    /// Where each node was at rest, world mm: its pattern moves with it.
    pub rest: &'a [Vec3],
    /// Where each node is, world mm, as many.
    pub places: &'a [Vec3],
    /// Triangles over the nodes.
    pub triangles: &'a [[u32; 3]],
}

/// Appearance of the slices.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SliceLook {
    /// Whether there are slices beside the 3-D view.
    pub shown: bool,
    /// Density at the middle of the grey scale, HU.
    pub level_hu: f32,
    /// Density range from black to white, HU.
    pub width_hu: f32,
    /// Weight of the MRI outside bone: 0 is CT only, 1 is MRI only.
    pub mri_share: f32,
    /// MRI signal at the middle of its grey scale, 0 to 1, on slices, section and brain.
    pub mri_level: f32,
    /// Range of the MRI's signal from black to white; 1 shows all of it.
    pub mri_width: f32,
    /// Half the height of the visible area, mm; `None` shows the whole volume.
    pub half_height_mm: Option<f32>,
    /// Point through which the slices pass, world mm; `None` follows the tool.
    pub through: Option<Vec3>,
}

impl Default for SliceLook {
    /// A bone window, with the MRI inside the skull.
    fn default() -> Self {
        let (level_hu, width_hu, mri_share) = (500.0, 2000.0, 0.85);
        let (mri_level, mri_width, half_height_mm) = (0.5, 1.0, None);
        Self { shown: true, level_hu, width_hu, mri_share, mri_level, mri_width, half_height_mm, through: None }
    }
}

impl SliceLook {
    /// The MRI's signal shown as black, and one over its range to white.
    pub(crate) fn mri_window(self) -> Vec4 {
        let width = self.mri_width.max(0.01);
        Vec4::new(self.mri_level - 0.5 * width, 1.0 / width, 0.0, 0.0)
    }

    /// The same for a scene without CT: MRI only.
    pub(crate) fn with_bone(self, bone: bool) -> Self {
        if bone { self } else { Self { mri_share: 1.0, ..self } }
    }
}

impl Frame<'_> {
    /// The tips of the tools: middle, world mm, and radius, mm.
    pub(crate) fn balls(&self) -> Vec<(Vec3, f32)> {
        let first = self.tool.map(|tool| (tool, self.world_from_tool));
        let balls = first.into_iter().chain(self.second);
        balls.map(|(tool, pose)| (pose.translation, tool.tip_radius_mm)).collect()
    }

    /// Intersection of the slices: the chosen point, else the tool's tip, or the camera's target if
    /// the tip is outside the volumes' box.
    pub fn focus(&self, bounds: Aabb) -> Vec3 {
        let tip = self.world_from_tool.translation;
        if let Some(chosen) = self.slices.through {
            return chosen.clamp(bounds.min, bounds.max);
        }
        if bounds.contains(tip) { tip } else { self.camera.target.clamp(bounds.min, bounds.max) }
    }

    /// A picture without a tool, with everything else shown.
    pub fn of(camera: Camera) -> Self {
        Self {
            camera,
            tool: None,
            world_from_tool: Pose::from_translation(camera.target),
            second: None,
            turn_rad: 0.0,
            drilling: false,
            brain_positions: None,
            brain_gone: None,
            brain_splits: &[],
            brain_stains: None,
            dura: None,
            show_bone: true,
            show_brain: true,
            bone_paint: None,
            brain_paint: None,
            overlay: Overlay::default(),
            cut: None,
            stereo: None,
            slices: SliceLook::default(),
        }
    }
}
