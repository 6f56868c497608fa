//! The scene's tolerances and contents, and the features that determine each choice's error.

use trepan_soft::Material;

/// The scene's tolerances and contents.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Scene {
    /// Tolerance of the force error on bone, as a vector, N, met by 95 of 100 ticks. A hand notices
    /// about 0.1 N.
    pub force_error_n: f64,
    /// Tolerance of the displacement error, mm, met by 95 of 100 points near the tool.
    pub displacement_mm: f64,
    /// Tolerances of the force error on tissue, N and share of the force: the greater one counts.
    pub tissue_force_n: f64,
    /// See [`tissue_force_n`](Self::tissue_force_n).
    pub tissue_force_share: f64,
    /// Tolerance of the picture error, root mean square of all colours, percent of white.
    pub picture_error_percent: f64,
    /// Whether the scene contains bone.
    pub has_bone: bool,
    /// Whether the scene contains soft tissue.
    pub has_tissue: bool,
    /// Stiffness of the bone contact, N/mm; converts a depth error to a force error.
    pub stiffness: f64,
    /// Radius of the tool that touches bone, mm.
    pub tool_radius_mm: f64,
    /// Penetration depth of that tool in bone, mm: force over stiffness; at most its radius.
    /// Deeper, its centre is under the surface and the contact normal is ambiguous.
    pub press_mm: f64,
    /// Mean voxel edge of the CT, mm: it sets the roughness of the bone.
    pub finest_mm: f64,
    /// Displacement of the tissue by a tool, mm; at most three of its radii. Errors are measured up
    /// to one radius, where an elastic brain has a solution; beyond, the power law's slope holds.
    pub tissue_motion_mm: f64,
    /// Radius of that tool, mm.
    pub probe_radius_mm: f64,
    /// Volume of the brain, mm³.
    pub brain_mm3: f64,
    /// Material of the tissue. With several parts, the softest sets the error and the stiffest the
    /// time step.
    pub material: Material,
    /// Rate of the haptic device, Hz.
    pub device_rate_hz: f64,
    /// Required speed of the tissue over real time on all threads that it may have, at least 1; the
    /// excess absorbs other load.
    pub headroom: f64,
    /// Pixels of the 3-D view, width and height.
    pub picture_pixels: [u32; 2],
    /// Height of the 3-D view at its target, mm.
    pub view_mm: f64,
    /// Frame rate, Hz.
    pub pictures_per_s: f64,
    /// Whether the pictures are shown in a window.
    pub has_window: bool,
}

impl Default for Scene {
    /// Tolerances that a hand or an eye just notices.
    ///
    /// Force error: 0.1 N on bone; a tenth on tissue, but not under 0.02 N. Displacement: what the
    /// usual setup just meets in an adult head. Picture: its edges are still sharp.
    /// All are numerical tolerances, not constants of nature.
    fn default() -> Self {
        Self {
            force_error_n: 0.1,
            displacement_mm: 0.4,
            tissue_force_n: 0.02,
            tissue_force_share: 0.1,
            picture_error_percent: 1.0,
            has_bone: true,
            has_tissue: true,
            stiffness: 1.0,
            tool_radius_mm: 3.0,
            press_mm: 1.0,
            finest_mm: 1.2,
            tissue_motion_mm: 5.0,
            probe_radius_mm: 2.0,
            brain_mm3: 1.2e6,
            material: Material::BRAIN,
            device_rate_hz: 1000.0, // numerical
            headroom: 1.5,
            picture_pixels: [960, 720],
            view_mm: 200.0,
            pictures_per_s: 10.0,
            has_window: false,
        }
    }
}

impl Scene {
    /// All fields that must be above 0, by name.
    pub(crate) fn numbers(&self) -> [(&'static str, f64); 18] {
        [
            ("scene.force_error_n", self.force_error_n),
            ("scene.displacement_mm", self.displacement_mm),
            ("scene.tissue_force_n", self.tissue_force_n),
            ("scene.tissue_force_share", self.tissue_force_share),
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

    /// Pixels of the 3-D view.
    pub(crate) fn pixels(&self) -> f64 {
        self.picture_pixels.map(f64::from).iter().product()
    }

    /// Features of the bone error: the logarithms of radius, depth and CT voxel, mm.
    pub fn bone_features(&self) -> [f64; 3] {
        [self.tool_radius_mm, self.press_mm, self.finest_mm].map(f64::ln)
    }

    /// Features of the tissue error: the logarithms of motion and radius, mm, and of the volume
    /// over 1.2 l.
    pub fn tissue_features(&self) -> [f64; 3] {
        [self.tissue_motion_mm, self.probe_radius_mm, self.brain_mm3 / 1.2e6].map(f64::ln)
    }

    /// Features of the picture error, as logarithms: size of a pixel, height of the view and CT
    /// voxel, mm.
    pub fn picture_features(&self) -> [f64; 3] {
        [self.view_mm / f64::from(self.picture_pixels[1]), self.view_mm, self.finest_mm].map(f64::ln)
    }
}
