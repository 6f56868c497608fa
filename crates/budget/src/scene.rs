//! What a scene asks for, and what of it decides how far each choice is off.

use trepan_soft::Material;

/// What the scene asks for and what is in it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Scene {
    /// Error of the force on bone, as a vector, that 95 of 100 ticks must stay within, N. A hand
    /// notices about 0.1 N.
    pub force_error_n: f64,
    /// Error of the displacement that 95 of 100 places near the tool must stay within, mm.
    pub displacement_mm: f64,
    /// Error of the picture, root mean square of all colours, percent of white.
    pub picture_error_percent: f64,
    /// Whether there is bone to touch.
    pub has_bone: bool,
    /// Whether there is tissue to move.
    pub has_tissue: bool,
    /// Stiffness of the contact with bone, N/mm: an error in depth becomes one in force.
    pub stiffness: f64,
    /// Radius of the tool on bone, mm.
    pub tool_radius_mm: f64,
    /// How deep the hand presses that tool into bone, mm: force over stiffness; at most its radius.
    /// Deeper, its centre is under the surface, and more than one way out is right.
    pub press_mm: f64,
    /// Edge of the CT's own voxels, the mean of the three, mm: bone is as rough as that.
    pub finest_mm: f64,
    /// How far a tool pushes the tissue, mm; at most its radius. Deeper, tissue would close around
    /// the shaft, and finer and finer meshes do not agree on how it moves.
    pub tissue_motion_mm: f64,
    /// Radius of that tool, mm.
    pub probe_radius_mm: f64,
    /// Volume of the brain, mm³.
    pub brain_mm3: f64,
    /// What it is made of; the softest of several parts decides least, the stiffest shortens the
    /// step.
    pub material: Material,
    /// Rate of the haptic device, Hz.
    pub device_rate_hz: f64,
    /// Wanted speed of the tissue over real time, at least 1: what is left over absorbs other load.
    pub headroom: f64,
    /// Pixels of the 3-D view, width and height.
    pub picture_pixels: [u32; 2],
    /// Height of what the 3-D view shows at its target, mm.
    pub view_mm: f64,
    /// Pictures a second.
    pub pictures_per_s: f64,
}

impl Default for Scene {
    /// Tolerances of force and tissue that about the usual setup keeps in an adult's head, and of a
    /// picture whose edges are still sharp.
    fn default() -> Self {
        Self {
            force_error_n: 0.4,
            displacement_mm: 0.4,
            picture_error_percent: 1.0,
            has_bone: true,
            has_tissue: true,
            stiffness: 1.0,
            tool_radius_mm: 3.0,
            press_mm: 1.0,
            finest_mm: 1.2,
            tissue_motion_mm: 2.0,
            probe_radius_mm: 2.0,
            brain_mm3: 1.2e6,
            material: Material::BRAIN,
            device_rate_hz: 1000.0,
            headroom: 1.5,
            picture_pixels: [960, 720],
            view_mm: 200.0,
            pictures_per_s: 10.0,
        }
    }
}

impl Scene {
    /// All that must be above 0, by name.
    pub(crate) fn numbers(&self) -> [(&'static str, f64); 16] {
        [
            ("scene.force_error_n", self.force_error_n),
            ("scene.displacement_mm", self.displacement_mm),
            ("scene.picture_error_percent", self.picture_error_percent),
            ("scene.stiffness", self.stiffness),
            ("scene.tool_radius_mm", self.tool_radius_mm),
            ("scene.press_mm", self.press_mm),
            ("scene.finest_mm", self.finest_mm),
            ("scene.tissue_motion_mm", self.tissue_motion_mm),
            ("scene.probe_radius_mm", self.probe_radius_mm),
            ("scene.brain_mm3", self.brain_mm3),
            ("scene.device_rate_hz", self.device_rate_hz),
            ("scene.headroom", self.headroom),
            ("scene.picture_pixels[0]", self.picture_pixels[0].into()),
            ("scene.picture_pixels[1]", self.picture_pixels[1].into()),
            ("scene.view_mm", self.view_mm),
            ("scene.pictures_per_s", self.pictures_per_s),
        ]
    }

    /// What the error on bone depends on: the logarithms of radius, depth and the CT's voxels, mm.
    pub fn bone_features(&self) -> [f64; 3] {
        [self.tool_radius_mm, self.press_mm, self.finest_mm].map(f64::ln)
    }

    /// What the error of tissue depends on: the logarithms of motion and radius, mm, and of the
    /// volume over 1.2 l.
    pub fn tissue_features(&self) -> [f64; 3] {
        [self.tissue_motion_mm, self.probe_radius_mm, self.brain_mm3 / 1.2e6].map(f64::ln)
    }

    /// What the error of the picture depends on: the logarithms of the mm that a pixel shows, of
    /// the mm that the view shows and of the CT's voxels, mm.
    pub fn picture_features(&self) -> [f64; 3] {
        [self.view_mm / f64::from(self.picture_pixels[1]), self.view_mm, self.finest_mm].map(f64::ln)
    }
}
