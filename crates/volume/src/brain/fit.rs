//! Checks whether a brain lies inside a skull, that is, whether MRI and CT share one space.

use super::cavity::cavity;
use super::given::{Given, stripped};
use super::morphology::{SPARE_MM, closed, core, within};
use super::{BrainConfig, in_head, millilitres};
use crate::padding::Padding;
use crate::{DistanceField, Grid, Interpolation, TooLarge, VoxelVolume, resample, room_for_voxels};
use glam::{DMat3, DVec3};

/// Edge of the compared voxels, mm; at 2 mm the fractions change by at most 0.06, at four times the
/// cost.
const WORK_MM: f32 = 3.0;

/// Distance beyond the inner table that counts as outside, mm: over a voxel and the mask's rim.
const SLACK_MM: f32 = 4.0;

/// Plausible volume of an adult brain in a coarse mask, ml.
const CREDIBLE_ML: std::ops::RangeInclusive<f64> = 600.0..=2200.0;

/// The fit of a brain in the space inside a skull.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BrainFit {
    /// Fraction of the brain in the CT's view that lies over 4 mm outside the inner table.
    pub outside_share: f64,
    /// Fraction of the space inside the skull that the brain fills.
    pub filled_share: f64,
    /// Distance between the centres of the brain and of the space, mm.
    pub middles_mm: f64,
    /// Angle between the longest axes of the brain and of the space, degrees; 0 if
    /// one is round. A turn about that axis does not show in it.
    pub axes_degrees: f64,
    /// What the images do not show.
    pub hidden: Hidden,
}

/// Parts of a head that an MRI or a CT does not show: they lie outside the image or in its padding.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Hidden {
    /// Space inside the skull that the MRI does not show, ml.
    pub space_ml: f64,
    /// Its share of the space inside the skull.
    pub space_share: f64,
    /// Brain of the MRI that the CT does not show, ml.
    pub brain_ml: f64,
    /// Its share of the brain.
    pub brain_share: f64,
    /// Bone at the height of the brain on the edge of what the CT shows, cm².
    pub cut_bone_cm2: f64,
}

/// Radius of the ball that fits into what an MRI does not show, mm: thinner gaps are dark tissue.
const GAP_MM: f32 = 8.0;

/// Share of the brain's height above its lowest point in which a skull should be whole; below, the
/// scan ends.
const BASE: f64 = 0.3;

/// Area of cut bone from which a CT does not show the whole skull, cm².
const CUT_CM2: f64 = 5.0;

impl Hidden {
    /// Whether the CT ends within the skull.
    pub fn cuts_skull(&self) -> bool {
        self.cut_bone_cm2 > CUT_CM2
    }
}

/// Compares the brain mask of an MRI with the space inside the skull where both images overlap;
/// `None` if the CT's bone encloses nothing.
pub fn brain_fit(
    brain: &VoxelVolume<u8>,
    mri: &VoxelVolume<f32>,
    ct: &VoxelVolume<i16>,
    isovalue: i16,
) -> Result<Option<BrainFit>, TooLarge> {
    let grid = Grid::isotropic_over(ct, WORK_MM);
    room_for_voxels(grid.voxels() as u64, 32)?;
    let Some(room) = cavity(ct, isovalue, &grid) else { return Ok(None) };
    let cut_bone_cm2 = cut_bone_cm2(brain, ct, isovalue);
    let beyond_mri = (Grid::of(mri), if stripped(mri).is_some() { Padding::none() } else { Padding::of(mri) });
    let cut = cut_bone_cm2 > CUT_CM2;
    let beyond_ct = (Grid::of(ct), if cut { Padding::of(ct) } else { Padding::none() });
    let hidden = VoxelVolume {
        data: (0..grid.voxels()).map(|at| u8::from(is_hidden(&beyond_mri, grid.place(at)))).collect(),
        dims: grid.dims,
        world_from_voxel: grid.world_from_voxel,
    };
    let hidden = core(&hidden, GAP_MM).map(|core| within(&core, GAP_MM + 1.0, |at| hidden.data[at] != 0));
    // 2 outside the MRI.
    let on_ct = resample(brain, &grid, Interpolation::Nearest, 2);
    let to_room = DistanceField::of_mask_within(&room, SLACK_MM + SPARE_MM);
    let (mut inside, mut outside, mut space, mut space_hidden) = (0, 0, 0, 0);
    let mut middles = [Middle::default(), Middle::default()];
    for at in 0..on_ct.data.len() {
        let is_shown = hidden.as_ref().is_none_or(|hidden| hidden.data[at] == 0);
        if room.data[at] != 0 {
            space_hidden += usize::from(!is_shown);
        }
        if on_ct.data[at] != 2 && is_shown && room.data[at] != 0 {
            space += 1;
            middles[0].add(grid.place(at));
        }
        if on_ct.data[at] == 1 && !(cut && is_hidden(&beyond_ct, grid.place(at))) {
            middles[1].add(grid.place(at));
            match to_room.values().data[at] {
                ..=0.0 => inside += 1,
                ..=SLACK_MM => {}
                _ => outside += 1,
            }
        }
    }
    if space == 0 {
        return Ok(None);
    }
    let of_mri = Grid::of(brain);
    let in_brain = (0..brain.data.len()).filter(|&at| brain.data[at] == 1);
    let brain_hidden = in_brain.filter(|&at| is_hidden(&beyond_ct, of_mri.place(at))).count() as f64;
    let brain_ml = brain_hidden * brain.voxel_mm3() * 1e-3;
    let room_ml = millilitres(&room);
    let space_ml = space_hidden as f64 * room.voxel_mm3() * 1e-3;
    Ok(Some(BrainFit {
        outside_share: f64::from(outside) / middles[1].count.max(1.0),
        filled_share: f64::from(inside) / f64::from(space),
        middles_mm: middles[0].place().distance(middles[1].place()),
        axes_degrees: match (middles[0].axis(), middles[1].axis()) {
            (Some(of_space), Some(of_brain)) => of_space.dot(of_brain).abs().min(1.0).acos().to_degrees(),
            _ => 0.0,
        },
        hidden: Hidden {
            space_ml,
            space_share: space_ml / room_ml,
            brain_ml,
            brain_share: brain_ml / millilitres(brain).max(1e-9),
            cut_bone_cm2,
        },
    }))
}

/// Whether a point in RAS mm lies outside an image or in its padding.
fn is_hidden((grid, padding): &(Grid, Padding), place: DVec3) -> bool {
    grid.nearest(place).is_none_or(|at| padding.holds(at))
}

/// Area of the bone on the CT's border or against its padding, at the height of a brain.
fn cut_bone_cm2(brain: &VoxelVolume<u8>, ct: &VoxelVolume<i16>, isovalue: i16) -> f64 {
    let of_brain = Grid::of(brain);
    let heights = (0..brain.data.len()).filter(|&at| brain.data[at] == 1).map(|at| of_brain.place(at).z);
    let (low, high) = heights.fold((f64::MAX, f64::MIN), |(low, high), z| (low.min(z), high.max(z)));
    let (low, padding, grid) = (low + BASE * (high - low), Padding::of(ct), Grid::of(ct));
    let [nx, ny, nz] = ct.dims;
    let edges = ct.spacing_mm();
    let face_mm2 = edges.element_product() / edges;
    let mut mm2 = 0.0;
    for at in (0..ct.data.len()).filter(|&at| ct.data[at] >= isovalue) {
        let sides = [(at % nx, nx, 1), (at / nx % ny, ny, nx), (at / (nx * ny), nz, nx * ny)];
        let cut = |axis: usize| {
            let (n, count, step) = sides[axis];
            let before = n == 0 || padding.holds(at - step);
            let after = n + 1 == count || padding.holds(at + step);
            face_mm2[axis] * f64::from(u8::from(before) + u8::from(after))
        };
        let area: f64 = (0..3).map(cut).sum();
        if area > 0.0 && (low..=high).contains(&grid.place(at).z) {
            mm2 += area;
        }
    }
    mm2 * 1e-2
}

/// Voxels of bone that lie where no bone can be, ml.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct StrayBone {
    /// Over 10 mm inside the brain: metal, contrast agent, calcified tissue.
    pub inside_ml: f64,
    /// Of it, denser than bone: metal.
    pub metal_ml: f64,
    /// Denser than bone, at the height of the brain, outside the head: a frame.
    pub frame_ml: f64,
}

/// Counts a CT's bone deep inside a brain mask, and metal far outside it.
pub fn stray_bone(brain: &VoxelVolume<u8>, ct: &VoxelVolume<i16>, isovalue: i16) -> Result<StrayBone, TooLarge> {
    let grid = Grid::isotropic_over(brain, WORK_MM);
    room_for_voxels(grid.voxels() as u64, 32)?;
    let whole = closed(&resample(brain, &grid, Interpolation::Nearest, 0), CLOSING_MM);
    // A sample lies between voxels that differ by no more than their diagonal.
    let diagonal_mm = 2.0 * WORK_MM;
    let field = DistanceField::of_mask_within(&whole, FRAME_MM.max(STRAY_MM) + diagonal_mm);
    let heights = (0..whole.data.len()).filter(|&at| whole.data[at] != 0).map(|at| grid.place(at).z);
    let (low, high) = heights.fold((f64::MAX, f64::MIN), |(low, high), z| (low.min(z), high.max(z)));
    let of_ct = Grid::of(ct);
    let ml = ct.voxel_mm3() * 1e-3;
    let mut stray = StrayBone::default();
    for (at, &hu) in ct.data.iter().enumerate().filter(|(_, hu)| **hu >= isovalue) {
        let place = of_ct.place(at);
        let depth_mm = -field.sample(place.as_vec3());
        let metal = if hu > METAL_HU { ml } else { 0.0 };
        if depth_mm > STRAY_MM && grid.nearest(place).is_some() {
            stray.inside_ml += ml;
            stray.metal_ml += metal;
        } else if depth_mm < -FRAME_MM && (low..=high).contains(&place.z) {
            stray.frame_ml += metal;
        }
    }
    Ok(stray)
}

/// A numerical parameter: largest density of bone, HU: enamel is under it, metal over it.
const METAL_HU: i16 = 2500;
/// Depth in a brain from which bone is not the skull's, mm.
const STRAY_MM: f32 = 10.0;
/// Distance from a brain beyond skull and scalp, mm.
const FRAME_MM: f32 = 30.0;
/// Radius of the ball that closes the holes which bone leaves in a brain mask, mm.
const CLOSING_MM: f32 = 8.0;

/// Whether a brain does not lie as its image says.
///
/// Its longest axis is not from back to front, or it is more alike when mirrored along another axis
/// than from left to right.
pub fn leans(brain: &VoxelVolume<u8>) -> bool {
    let grid = Grid::of(brain);
    let places = || (0..brain.data.len()).filter(|&at| brain.data[at] == 1).step_by(7).map(|at| grid.place(at));
    let (sum, count) = places().fold((DVec3::ZERO, 0.0), |(sum, count), place| (sum + place, count + 1.0));
    let middle = sum / f64::max(count, 1.0);
    let spread = places().fold(DVec3::ZERO, |sum, place| sum + (place - middle).powf(2.0)).to_array();
    let mirrored = |axis: usize| {
        let mut sides = DVec3::ONE;
        sides[axis] = -1.0;
        let held =
            |place: &DVec3| grid.nearest(middle + sides * (place - middle)).is_some_and(|at| brain.data[at] == 1);
        places().filter(held).count()
    };
    let alike = [0, 1, 2].map(mirrored);
    let slack = alike[0] + alike[0] / 50;
    spread[0].max(spread[2]) > 1.05 * spread[1] || alike[1].max(alike[2]) > slack
}

/// A coarse, unchecked brain mask from the MRI alone, independent of a misaligned CT. `None` if
/// nothing of a brain's size is found.
pub fn brain_by_mri(mri: &VoxelVolume<f32>) -> Result<Option<VoxelVolume<u8>>, TooLarge> {
    let grid = Grid::isotropic_over(mri, WORK_MM);
    room_for_voxels(grid.voxels() as u64, 32)?;
    let Given { coarse, stripped } = Given::of(mri, &grid);
    let brain = stripped.or_else(|| in_head(&coarse, &BrainConfig::default()).map(|(brain, _)| brain));
    Ok(brain.filter(|brain| CREDIBLE_ML.contains(&millilitres(brain))))
}

/// Mean and spread of a set of points.
#[derive(Clone, Copy, Default)]
struct Middle {
    sum: DVec3,
    squares: DMat3,
    count: f64,
}

impl Middle {
    fn add(&mut self, place: DVec3) {
        self.sum += place;
        self.squares += DMat3::from_cols(place * place.x, place * place.y, place * place.z);
        self.count += 1.0;
    }

    fn place(&self) -> DVec3 {
        self.sum / self.count.max(1.0)
    }

    /// The direction in which the points spread most, by powers of their covariance; `None` if they
    /// spread in all directions alike.
    fn axis(&self) -> Option<DVec3> {
        let m = self.place();
        let mean = DMat3::from_cols(m * m.x, m * m.y, m * m.z);
        let spread = self.squares * (1.0 / self.count.max(1.0)) - mean;
        let mut power = spread;
        for _ in 0..8 {
            let most = power.to_cols_array().iter().fold(1e-12, |most: f64, v| most.max(v.abs()));
            power = power * power * most.powi(-2);
        }
        let columns = [power.x_axis, power.y_axis, power.z_axis];
        let axis = columns.into_iter().max_by(|a, b| a.length().total_cmp(&b.length()))?.normalize_or_zero();
        let along = axis.dot(spread * axis);
        let across = 0.5 * (spread.x_axis.x + spread.y_axis.y + spread.z_axis.z - along);
        (along > ELONGATED * across).then_some(axis)
    }
}

/// Ratio of variances from which points have a longest axis; a head's is 1.4 to 1.8.
const ELONGATED: f64 = 1.15;
