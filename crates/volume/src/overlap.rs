//! Checks whether two images overlap.

use crate::VoxelVolume;
use glam::DVec3;

/// A numerical parameter: smallest fraction of the smaller image's box that the other must cover.
pub const LEAST_SHARE: f64 = 0.25;

/// Two images that do not overlap.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error(
    "the CT and the MRI do not overlap: only {:.0} % of the smaller one lies in the other. The CT spans {}, the MRI {} (RAS mm). \
     Give images of one patient, in one space or with --register",
    100.0 * share, span(ct), span(mri)
)]
pub struct OverlapError {
    /// Fraction of the smaller box that lies in the other, 0 to 1.
    pub share: f64,
    /// Lowest and highest corner of the CT, RAS mm.
    pub ct: (DVec3, DVec3),
    /// Lowest and highest corner of the MRI, RAS mm.
    pub mri: (DVec3, DVec3),
}

/// Rejects a CT and an MRI whose world boxes share less than [`LEAST_SHARE`] of the smaller;
/// returns the fraction.
pub fn overlap<A: Copy, B: Copy>(ct: &VoxelVolume<A>, mri: &VoxelVolume<B>) -> Result<f64, OverlapError> {
    let (ct, mri) = (ct.world_corners(), mri.world_corners());
    let size = |(low, high): (DVec3, DVec3)| (high - low).max(DVec3::ZERO).element_product();
    let shared = size((ct.0.max(mri.0), ct.1.min(mri.1)));
    let share = shared / size(ct).min(size(mri)).max(f64::MIN_POSITIVE);
    if share >= LEAST_SHARE { Ok(share) } else { Err(OverlapError { share, ct, mri }) }
}

fn span((low, high): &(DVec3, DVec3)) -> String {
    format!("({:.0}, {:.0}, {:.0}) to ({:.0}, {:.0}, {:.0})", low.x, low.y, low.z, high.x, high.y, high.z)
}

#[cfg(test)]
mod tests {
    use super::*;
    use trepan_geometry::Vec3;

    #[test]
    fn non_overlapping_images_are_rejected_with_both_boxes() {
        let ct = VoxelVolume::isotropic([10, 10, 10], Vec3::ZERO, 2.0, 0i16);
        let near = VoxelVolume::isotropic([10, 10, 10], Vec3::splat(3.0), 1.0, 0f32);
        let far = VoxelVolume::isotropic([10, 10, 10], Vec3::splat(300.0), 1.0, 0f32);
        assert_eq!(overlap(&ct, &near), Ok(1.0));
        let error = overlap(&ct, &far).unwrap_err().to_string();
        assert!(
            error.contains("(-1, -1, -1) to (19, 19, 19)") && error.contains("(300, 300, 300) to (310, 310, 310)"),
            "{error}"
        );
    }
}
