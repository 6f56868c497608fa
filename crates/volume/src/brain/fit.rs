//! Checks whether a brain lies inside a skull, that is, whether MRI and CT share one space.

use super::cavity::cavity;
use super::{BrainConfig, in_head, millilitres};
use crate::{DistanceField, Grid, Interpolation, TooLarge, VoxelVolume, resample, room_for_voxels};
use glam::DVec3;

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
}

/// Compares a brain mask with the space inside the skull where both images overlap; `None` if the
/// CT's bone encloses nothing.
pub fn brain_fit(brain: &VoxelVolume<u8>, ct: &VoxelVolume<i16>, isovalue: i16) -> Result<Option<BrainFit>, TooLarge> {
    let grid = Grid::isotropic_over(ct, WORK_MM);
    room_for_voxels(grid.voxels() as u64, 32)?;
    let Some(room) = cavity(ct, isovalue, &grid) else { return Ok(None) };
    // 2 outside the MRI.
    let brain = resample(brain, &grid, Interpolation::Nearest, 2);
    let to_room = DistanceField::of_mask(&room);
    let (mut inside, mut outside, mut space) = (0, 0, 0);
    let mut middles = [Middle::default(), Middle::default()];
    let [nx, ny, _] = grid.dims;
    for at in 0..brain.data.len() {
        let place = || grid.world_from_voxel.transform_point3(voxel(at, nx, ny));
        if brain.data[at] != 2 && room.data[at] != 0 {
            space += 1;
            middles[0].add(place());
        }
        if brain.data[at] == 1 {
            middles[1].add(place());
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
    Ok(Some(BrainFit {
        outside_share: f64::from(outside) / middles[1].count.max(1.0),
        filled_share: f64::from(inside) / f64::from(space),
        middles_mm: middles[0].place().distance(middles[1].place()),
    }))
}

/// A coarse, unchecked brain mask from the MRI alone, independent of a misaligned CT. `None` if
/// nothing of a brain's size is found.
pub fn brain_by_mri(mri: &VoxelVolume<f32>) -> Result<Option<VoxelVolume<u8>>, TooLarge> {
    let grid = Grid::isotropic_over(mri, WORK_MM);
    room_for_voxels(grid.voxels() as u64, 32)?;
    let coarse = resample(mri, &grid, Interpolation::Trilinear, 0.0);
    let brain = in_head(&coarse, &BrainConfig::default()).map(|(brain, _)| brain);
    Ok(brain.filter(|brain| CREDIBLE_ML.contains(&millilitres(brain))))
}

fn voxel(at: usize, nx: usize, ny: usize) -> DVec3 {
    DVec3::new((at % nx) as f64, (at / nx % ny) as f64, (at / (nx * ny)) as f64)
}

/// Mean of a set of points.
#[derive(Clone, Copy, Default)]
struct Middle {
    sum: DVec3,
    count: f64,
}

impl Middle {
    fn add(&mut self, place: DVec3) {
        self.sum += place;
        self.count += 1.0;
    }

    fn place(&self) -> DVec3 {
        self.sum / self.count.max(1.0)
    }
}
