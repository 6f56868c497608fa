//! Real heads that synthetic heads are made from, and their anatomy, measured once.

use anyhow::{Context, Result};
use glam::DVec3;
use std::ops::{Add, Mul};
use std::path::{Path, PathBuf};
use trepan_fixtures::case_head;
use trepan_volume::{AIR_HU, DistanceField, Grid, Interpolation, VoxelVolume, hounsfield, read, resample};

/// FreeSurfer labels of the two lateral ventricles.
const VENTRICLES: [u16; 2] = [4, 43];
/// Voxel edge of the distance fields, mm.
const WORK_MM: f64 = 2.0;
/// Lowest CT value of bone, HU.
const BONE_HU: i16 = 250;
/// Minimum radius of the cavity's wide part, mm: larger than the foramen magnum's.
const WIDE_MM: f32 = 15.0;
/// Lowest CT value of enamel, HU.
const TEETH_HU: i16 = 1400;
/// Minimum distance of teeth in front of and below the brain's centre, mm.
const TEETH_OFF_MM: [f64; 2] = [40.0, 50.0];

/// Real head: CT, MRI and masks in one space.
pub struct BaseHead {
    /// Short name without spaces.
    pub name: &'static str,
    /// CT image, HU.
    pub ct: VoxelVolume<i16>,
    /// T1-weighted MRI image.
    pub mri: VoxelVolume<f32>,
    /// Brain mask, 0 or 1.
    pub brain: VoxelVolume<u8>,
    /// FreeSurfer labels of its tissues.
    pub labels: VoxelVolume<u16>,
    pub(super) anatomy: Anatomy,
}

/// Distance fields and values that every head of a base needs.
pub struct Anatomy {
    /// Distance to the unsmoothed brain mask, mm.
    pub truth: DistanceField,
    /// Distance to the brain's smoothed surface, mm.
    pub brain: DistanceField,
    /// Distance to the cavity of the skull, mm.
    pub cavity: DistanceField,
    /// Distance to the ventricles' smoothed surface, mm.
    pub ventricles: DistanceField,
    /// Centre of the brain's bounding box.
    pub middle: DVec3,
    /// Half the brain's height, mm.
    half_height_mm: f64,
    /// Points of the head, about 4 mm apart.
    pub head: Vec<DVec3>,
    /// Points on teeth, or else on the lowest bone in front.
    pub teeth: Vec<DVec3>,
    /// MRI grey value of the ventricles.
    pub fluid: f32,
    /// Median MRI grey value of the brain.
    pub tissue: f32,
}

/// Reads the built-in head, and the second one if the folder of shared data holds it.
///
/// That folder is `data` in the folder named by the environment variable `TREPAN_SHARED`, else in
/// `../shared` beside the workspace.
pub fn base_heads() -> Result<Vec<BaseHead>> {
    let mut heads = vec![BaseHead::built_in()?];
    let beside = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../../shared");
    let second = std::env::var_os("TREPAN_SHARED").map_or(beside, PathBuf::from).join("data/head-second");
    if !second.is_dir() {
        eprintln!("population: {} is not there: all heads are made from one", second.display());
        return Ok(heads);
    }
    let mri = |name: &str| second.join("mri").join(name);
    heads.push(BaseHead::read(
        "head-second",
        &second.join("ct/ct_head_hu.nii.gz"),
        &mri("mri_t1_in_ct_grid.nii.gz"),
        &mri("brainmask_in_ct_grid.nii.gz"),
        &mri("tissue_labels_in_ct_grid.nii.gz"),
    )?);
    Ok(heads)
}

impl BaseHead {
    /// Reads the built-in head.
    pub fn built_in() -> Result<Self> {
        let case = case_head();
        Self::read(case.name, &case.ct, &case.mri, &case.labels, &case.aseg)
    }

    fn read(name: &'static str, ct: &Path, mri: &Path, brain: &Path, aseg: &Path) -> Result<Self> {
        let image = |path: &Path| read(path).with_context(|| format!("head {name}"));
        let ct = hounsfield(&image(ct)?).with_context(|| format!("the CT of head {name}"))?;
        let brain = image(brain)?.map(|v| u8::from(v != 0.0));
        Ok(Self::new(name, ct, image(mri)?, brain, image(aseg)?.map(|v| v as u16)))
    }

    /// Creates a head from images in one space; brain and labels lie on the MRI's grid, and the
    /// labels hold lateral ventricles.
    pub fn new(
        name: &'static str,
        ct: VoxelVolume<i16>,
        mri: VoxelVolume<f32>,
        brain: VoxelVolume<u8>,
        labels: VoxelVolume<u16>,
    ) -> Self {
        let ventricles = labels.map(|label| u8::from(VENTRICLES.contains(&label)));
        let anatomy = Anatomy::of(&ct, &mri, &brain, &ventricles);
        Self { name, ct, mri, brain, labels, anatomy }
    }
}

impl Anatomy {
    fn of(
        ct: &VoxelVolume<i16>,
        mri: &VoxelVolume<f32>,
        brain: &VoxelVolume<u8>,
        ventricles: &VoxelVolume<u8>,
    ) -> Self {
        let grid = Grid::isotropic_over(ct, WORK_MM as f32);
        let soft = smoothed(&grid, brain, 3);
        let (low, high) = span(&soft);
        let middle = 0.5 * (low + high);
        Self {
            truth: DistanceField::of_mask(brain),
            brain: DistanceField::of_level(&soft, 0.5),
            cavity: cavity(ct, &soft),
            ventricles: DistanceField::of_level(&smoothed(&grid, ventricles, 1), 0.4),
            middle,
            half_height_mm: 0.5 * (high.z - low.z),
            head: points(ct, |hu| hu > -300, 4.0),
            teeth: teeth(ct, middle),
            fluid: quantile(mri, ventricles, 0.25),
            tissue: quantile(mri, brain, 0.5),
        }
    }

    /// Membership of a point in the vault, 0 to 1: above the ears, where the skull is a single
    /// shell.
    pub fn vault(&self, point: DVec3) -> f64 {
        let height = (point.z - self.middle.z) / self.half_height_mm;
        let share = ((height + 0.4) / 0.5).clamp(0.0, 1.0);
        share * share * (3.0 - 2.0 * share)
    }
}

/// Distance to the cavity of the skull: the brain, and the space that a ball too large for the
/// skull's holes reaches from it.
fn cavity(ct: &VoxelVolume<i16>, brain: &VoxelVolume<f32>) -> DistanceField {
    let bone = resample(ct, &Grid::of(brain), Interpolation::Trilinear, AIR_HU).map(|hu| u8::from(hu >= BONE_HU));
    let wide = DistanceField::of_mask(&bone);
    let mut core = bone.clone();
    for (at, core) in core.data.iter_mut().enumerate() {
        *core = u8::from(wide.values().data[at] > WIDE_MM && brain.data[at] >= 0.5);
    }
    let near = DistanceField::of_mask(&core);
    let mut space = brain.clone();
    for (at, value) in space.data.iter_mut().enumerate() {
        *value = if near.values().data[at] < WIDE_MM && bone.data[at] == 0 { 1.0 } else { *value };
    }
    smooth(&mut space);
    DistanceField::of_level(&space, 0.5)
}

/// Mask resampled to another grid as shares of 1, smoothed `times` times.
fn smoothed(grid: &Grid, mask: &VoxelVolume<u8>, times: usize) -> VoxelVolume<f32> {
    let mut soft = resample(&mask.map(f32::from), grid, Interpolation::Trilinear, 0.0);
    (0..times).for_each(|_| smooth(&mut soft));
    soft
}

/// Smooths with weights 1 2 1 along each axis.
pub fn smooth<T: Copy + Add<Output = T> + Mul<f32, Output = T>>(volume: &mut VoxelVolume<T>) {
    let [nx, ny, nz] = volume.dims;
    for (stride, count) in [(1, nx), (nx, ny), (nx * ny, nz)] {
        let before = volume.data.clone();
        for (at, value) in volume.data.iter_mut().enumerate() {
            let place = at / stride % count;
            let left = before[if place > 0 { at - stride } else { at }];
            let right = before[if place + 1 < count { at + stride } else { at }];
            *value = (left + before[at] * 2.0 + right) * 0.25;
        }
    }
}

/// Lowest and highest centre of voxels of at least 0.5, along right, front and head.
fn span(volume: &VoxelVolume<f32>) -> (DVec3, DVec3) {
    let inside = points(volume, |v| v >= 0.5, 0.0);
    inside.iter().fold((DVec3::MAX, DVec3::MIN), |(low, high), p| (low.min(*p), high.max(*p)))
}

/// Voxel centres of a kind, thinned to about one per `apart_mm` along each axis.
fn points<T: Copy>(volume: &VoxelVolume<T>, kind: impl Fn(T) -> bool, apart_mm: f64) -> Vec<DVec3> {
    let skip = (apart_mm / volume.spacing_mm()).floor().max(DVec3::ONE).as_uvec3().to_array().map(|n| n as usize);
    let [nx, ny, nz] = volume.dims;
    let mut found = Vec::new();
    for k in (0..nz).step_by(skip[2]) {
        for j in (0..ny).step_by(skip[1]) {
            for i in (0..nx).step_by(skip[0]) {
                if kind(volume.data[volume.index([i, j, k])]) {
                    found.push(volume.centre_of([i, j, k]));
                }
            }
        }
    }
    found
}

fn teeth(ct: &VoxelVolume<i16>, middle: DVec3) -> Vec<DVec3> {
    let [before, below] = TEETH_OFF_MM;
    let front_below = |p: &DVec3| p.y > middle.y + before && p.z < middle.z - below;
    let of = |least: i16| -> Vec<DVec3> { points(ct, |hu| hu >= least, 0.0).into_iter().filter(front_below).collect() };
    let teeth = of(TEETH_HU);
    if teeth.is_empty() { of(BONE_HU) } else { teeth }
}

fn quantile(mri: &VoxelVolume<f32>, mask: &VoxelVolume<u8>, share: f64) -> f32 {
    let mut values: Vec<f32> = mri.data.iter().zip(&mask.data).filter(|(_, m)| **m != 0).map(|(v, _)| *v).collect();
    values.sort_by(f32::total_cmp);
    values.get((share * values.len() as f64) as usize).copied().unwrap_or(0.0)
}
