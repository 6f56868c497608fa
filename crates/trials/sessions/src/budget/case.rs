//! The heads that scenes are drawn from: the built-in one, made-up ones in closed form, and open
//! ones where they are at hand.

use glam::DVec3;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use trepan_bone::BoneVolume;
use trepan_geometry::Vec3;
use trepan_models::measure::bone::Skull;
use trepan_models::measure::tissue::Shape;
use trepan_soft::Material;
use trepan_volume::{
    AIR_HU, DistanceField, Grid, Interpolation, VoxelVolume, bone_isovalue, hounsfield, largest_component, read,
    resample, skull_only,
};

/// Edge of the voxels that openings are looked for in and pictures are drawn of, mm.
const LOOK_MM: f32 = 1.0;
/// Edge of the voxels of brain masks, mm.
const MASK_MM: f32 = 2.0;
/// Where made-up bone begins, HU.
const ISO: i16 = 400;

/// Where a case comes from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Source {
    /// The built-in head.
    BuiltIn,
    /// A ball of bone in closed form around an ellipsoid of brain.
    MadeUp,
    /// Heads under `TREPAN_DATA`; without them a made-up one.
    Open,
}

/// A head.
pub struct Case {
    /// Its name.
    pub name: &'static str,
    /// The CT with nothing but the skull, on its own grid.
    pub skull: Skull,
    /// The skull in voxels of 1 mm.
    pub bone: Arc<BoneVolume>,
    /// The brain.
    pub brain: Shape,
    /// Middle and radius of the bone's outer surface, mm, where it is a ball.
    pub ball: Option<(DVec3, f64)>,
}

impl Case {
    /// Loads or makes a case.
    pub fn of(source: Source, random: &mut fastrand::Rng) -> Self {
        let young_mpa = 0.002 * 3.0f32.powf(random.f32());
        let case = match source {
            Source::BuiltIn => {
                let case = trepan_fixtures::case_head();
                Self::loaded("built-in head", &case.ct, &case.labels)
            }
            Source::Open => match open_files() {
                Some((ct, labels)) => Self::loaded("open heads", &ct, &labels),
                None => Self::made_up(random),
            },
            Source::MadeUp => Self::made_up(random),
        };
        let material = Material::NeoHookean { young_mpa, poisson: 0.45, density_g_mm3: 1.0e-3 };
        Self { brain: Shape { material, ..case.brain }, ..case }
    }

    fn loaded(name: &'static str, ct: &Path, labels: &Path) -> Self {
        let read = |path: &Path| read(path).unwrap_or_else(|fault| panic!("{fault}"));
        let mut ct = hounsfield(&read(ct)).expect("the CT is in HU");
        let isovalue = bone_isovalue(&ct);
        skull_only(&mut ct, isovalue);
        let mask = largest_component(&read(labels).map(|label| u8::from(label > 0.5)));
        let mask = resample(&mask, &Grid::isotropic_over(&mask, MASK_MM), Interpolation::Majority, 0);
        Self::with(name, ct, isovalue, mask, None)
    }

    /// A ball of bone, blurred as a scanner does, and an ellipsoid of brain.
    fn made_up(random: &mut fastrand::Rng) -> Self {
        let within = |low: f64, high: f64, share: f64| low + (high - low) * share;
        let radius = within(65.0, 90.0, random.f64());
        let (thick, voxel) = (within(4.0, 8.0, random.f64()), within(0.6, 1.4, random.f64()));
        let middle = DVec3::new(random.f64(), random.f64(), random.f64());
        let edge = (2.0 * (radius + 3.0) / voxel) as usize;
        let corner = (-0.5 * voxel * edge as f64) as f32;
        let mut ct = VoxelVolume::isotropic([edge; 3], Vec3::splat(corner), voxel as f32, AIR_HU);
        for at in 0..ct.data.len() {
            let from = ct.centre_of([at % edge, at / edge % edge, at / (edge * edge)]).distance(middle);
            let outside = (from - radius).max(radius - thick - from);
            ct.data[at] = (f64::from(ISO) - 1200.0 * (outside / voxel).tanh()) as i16;
        }
        let size = DVec3::new(random.f64(), random.f64(), random.f64()) * 8.0 + DVec3::new(60.0, 74.0, 54.0);
        let cells = ((2.0 * size + 12.0) / f64::from(MASK_MM)).ceil().as_u64vec3();
        let dims = [cells.x as usize, cells.y as usize, cells.z as usize];
        let origin = -0.5 * f64::from(MASK_MM) * DVec3::from_array(dims.map(|n| n as f64 - 1.0));
        let mut mask = VoxelVolume::isotropic(dims, origin.as_vec3(), MASK_MM, 0u8);
        for at in 0..mask.data.len() {
            let place = mask.centre_of([at % dims[0], at / dims[0] % dims[1], at / (dims[0] * dims[1])]);
            mask.data[at] = u8::from((place / size).length() < 1.0);
        }
        Self::with("made-up head", ct, ISO, mask, Some((middle, radius)))
    }

    fn with(
        name: &'static str,
        ct: VoxelVolume<i16>,
        isovalue: i16,
        mask: VoxelVolume<u8>,
        ball: Option<(DVec3, f64)>,
    ) -> Self {
        let look = resample(&ct, &Grid::isotropic_over(&ct, LOOK_MM), Interpolation::Cubic, AIR_HU);
        let bone = Arc::new(BoneVolume::new(&look, isovalue).expect("the case has bone"));
        let brain = Shape { field: DistanceField::of_mask(&mask), mask, material: Material::BRAIN };
        Self { name, skull: Skull { ct, isovalue }, bone, brain, ball }
    }

    /// Mean edge of the CT's own voxels, mm.
    pub fn finest_mm(&self) -> f64 {
        self.skull.ct.spacing_mm().element_sum() / 3.0
    }

    /// Volume of the brain, mm³.
    pub fn brain_mm3(&self) -> f64 {
        self.brain.mask.data.iter().filter(|&&v| v != 0).count() as f64 * self.brain.mask.voxel_mm3()
    }

    /// Outermost place of bone from the middle of its box in a direction, if there is any.
    pub fn outer_bone(&self, direction: Vec3) -> Option<Vec3> {
        let bounds = self.bone.bounds();
        let (middle, reach) = (bounds.centre(), 0.5 * bounds.size().length());
        let places = (0..(2.0 * reach) as usize).map(|n| middle + (reach - 0.5 * n as f32) * direction);
        places.take_while(|p| (*p - middle).dot(direction) > 0.0).find(|p| self.bone.is_bone(self.bone.voxel_of(*p)))
    }

    /// Outermost place of the brain from its middle in a direction.
    pub fn outer_brain(&self, direction: Vec3) -> Vec3 {
        let bounds = self.brain.mask.world_box();
        let (middle, reach) = (bounds.centre(), 0.5 * bounds.size().length());
        let places = (0..(4.0 * reach) as usize).map(|n| middle + (reach - 0.25 * n as f32) * direction);
        places.into_iter().find(|p| bounds.contains(*p) && self.brain.field.sample(*p) <= 0.0).unwrap_or(middle)
    }
}

/// A CT and a brain mask, of two people, under `TREPAN_DATA`.
fn open_files() -> Option<(PathBuf, PathBuf)> {
    let home = PathBuf::from(std::env::var_os("TREPAN_DATA")?);
    let files = ["ct-mri-pair-thick/ct_hu.nii.gz", "mri-head-labelled/mri_t1_brain.nii.gz"].map(|file| home.join(file));
    let [ct, labels] = files;
    (ct.is_file() && labels.is_file()).then_some((ct, labels))
}
