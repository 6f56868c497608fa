//! Extracts the skull from a CT: HU values, bone threshold, largest connected piece.
//!
//! # Theory
//! The threshold is Otsu's (1979) on the histogram from 100 to 2000 HU: the t that maximises
//! `w₀(t) · w₁(t) · (μ₀(t) - μ₁(t))²`, clamped to the 300 to 500 HU used to segment cortical bone.
//! The skull is the largest connected piece at or over it; table, head rest and loose teeth are
//! removed.
//!
//! # Sources
//! N. Otsu, "A threshold selection method from gray-level histograms", IEEE SMC 9, 1979.

use crate::component::Components;
use crate::{ReadError, Sample, VoxelVolume};
use std::path::Path;

/// Density of air, HU, by definition: outside a grid and for removed bone.
pub const AIR_HU: i16 = -1000;

/// Lowest isovalue that [`bone_isovalue`] returns, HU.
pub const LEAST_ISOVALUE: i16 = 300;

/// Highest isovalue that [`bone_isovalue`] returns, HU.
pub const GREATEST_ISOVALUE: i16 = 500;

/// Why a volume is not a CT in HU.
#[derive(Debug, thiserror::Error, PartialEq)]
pub enum HounsfieldError {
    /// Voxels that are NaN or infinite.
    #[error(
        "{count} voxels of the CT hold no number (NaN or infinite); write them as air (-1000 HU) or give another file"
    )]
    NotANumber {
        /// Their count.
        count: usize,
    },
    /// Values that are not HU.
    #[error(
        "the values go from {low} to {high}, which is not a CT in HU (air -1000, water 0, bone over 300); is this the MRI, or is the rescale intercept lost? Give the CT with --ct and the MRI with --mri, or export the CT again in HU"
    )]
    Range {
        /// Lowest value.
        low: f32,
        /// Highest value.
        high: f32,
    },
}

/// Converts a CT's values to integer HU. Rejects NaN (with the count) and values that cannot be HU.
pub fn hounsfield(ct: &VoxelVolume<f32>) -> Result<VoxelVolume<i16>, HounsfieldError> {
    let count = ct.data.iter().filter(|v| !v.is_finite()).count();
    if count > 0 {
        return Err(HounsfieldError::NotANumber { count });
    }
    let (low, high) = ct.data.iter().fold((f32::MAX, f32::MIN), |(l, h), &v| (l.min(v), h.max(v)));
    match low < -500.0 && high > 200.0 && low >= -32768.0 && high < 65536.0 {
        true => Ok(ct.map(i16::from_f32)),
        false => Err(HounsfieldError::Range { low, high }),
    }
}

/// A numerical parameter: values at or under this are air in a CT, HU.
const AIR_AT_MOST_HU: f32 = -900.0;

/// Smallest fraction of a CT's voxels that is air.
const LEAST_AIR: f64 = 0.05;

/// Whether an image's values are those of a CT: HU with air around the head, unlike any MRI.
pub fn is_ct(image: &VoxelVolume<f32>) -> bool {
    let air = image.data.iter().filter(|&&v| v <= AIR_AT_MOST_HU).count();
    hounsfield(image).is_ok() && air as f64 >= LEAST_AIR * image.data.len() as f64
}

/// A bone threshold from the histogram, HU, within [`LEAST_ISOVALUE`] and [`GREATEST_ISOVALUE`].
pub fn bone_isovalue(ct: &VoxelVolume<i16>) -> i16 {
    const LOW: i16 = 100;
    let mut histogram = [0u64; 1901];
    for &hu in &ct.data {
        if (LOW..=2000).contains(&hu) {
            histogram[(hu - LOW) as usize] += 1;
        }
    }
    let total: u64 = histogram.iter().sum();
    let sum: f64 = histogram.iter().enumerate().map(|(bin, &n)| bin as f64 * n as f64).sum();
    let (mut below, mut below_sum, mut best) = (0u64, 0.0, (0.0, usize::from(LEAST_ISOVALUE.unsigned_abs())));
    for (bin, &n) in histogram.iter().enumerate() {
        below += n;
        below_sum += bin as f64 * n as f64;
        let above = total - below;
        if below > 0 && above > 0 {
            let apart = below_sum / below as f64 - (sum - below_sum) / above as f64;
            let between = below as f64 * above as f64 * apart * apart;
            if between > best.0 {
                best = (between, bin + LOW as usize + 1);
            }
        }
    }
    (best.1 as i16).clamp(LEAST_ISOVALUE, GREATEST_ISOVALUE)
}

/// Loose bone that was removed.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Islands {
    /// Pieces.
    pub pieces: usize,
    /// Their volume, mm³.
    pub mm3: f64,
    /// Volume of the skull that stays, mm³.
    pub skull_mm3: f64,
}

impl Islands {
    /// A remark for the user; `None` if nothing was loose.
    pub fn note(&self) -> Option<String> {
        let Self { pieces, mm3, skull_mm3 } = *self;
        let of = if pieces == 1 { "piece" } else { "pieces" };
        (pieces > 0).then(|| {
            format!(
                "{pieces} loose {of} of bone left out, {:.2} cm³ beside a skull of {:.0} cm³ (table, head rest, fragments, bone thinner than a voxel); if a part of the skull is missing, give a lower --isovalue-hu",
                1e-3 * mm3,
                1e-3 * skull_mm3
            )
        })
    }
}

/// Keeps only the skull: voxels at or over the isovalue outside the largest piece are set to one HU
/// under it. Returns what was removed.
pub fn skull_only(ct: &mut VoxelVolume<i16>, isovalue: i16) -> Islands {
    let pieces = Components::of(ct.dims, |at| ct.data[at] >= isovalue);
    let Some(skull) = pieces.largest() else { return Islands::default() };
    let [largest, _] = pieces.two_largest();
    let voxel_mm3 = ct.spacing_mm().element_product();
    let mut loose = 0;
    let under = isovalue.saturating_sub(1);
    let data = &mut ct.data;
    pieces.every_run(|piece, run| {
        if piece != skull {
            loose += run.len();
            data[run].fill(under);
        }
    });
    let mm3 = |voxels: usize| voxels as f64 * voxel_mm3;
    Islands { pieces: pieces.count() - 1, mm3: mm3(loose), skull_mm3: mm3(largest) }
}

/// Converts a label volume's values to integers. Rejects NaN, negative and fractional values and
/// those over 65535.
pub fn labels(file: &Path, volume: &VoxelVolume<f32>) -> Result<VoxelVolume<u16>, ReadError> {
    let wrong = volume.data.iter().find(|&&v| v.round() != v || !(0.0..=65535.0).contains(&v));
    match wrong {
        None => Ok(volume.map(u16::from_f32)),
        Some(found) => Err(ReadError::Field {
            file: file.into(),
            field: "a voxel",
            found: found.to_string(),
            remedy: "labels are whole numbers from 0 to 65535; is this an image instead of a label volume?",
        }),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use trepan_geometry::Vec3;

    #[test]
    fn a_table_that_does_not_touch_the_skull_goes() {
        let mut ct = VoxelVolume::isotropic([10, 3, 1], Vec3::ZERO, 1.0, -1000i16);
        ct.data[0..6].fill(900);
        ct.data[20..24].fill(1200);
        ct.data[12] = 40;
        let removed = skull_only(&mut ct, 300);
        assert_eq!(removed, Islands { pieces: 1, mm3: 4.0, skull_mm3: 6.0 });
        assert!(removed.note().unwrap().starts_with("1 loose piece of"), "{:?}", removed.note());
        assert_eq!(skull_only(&mut ct, 300).note(), None);
        assert!(ct.data[0..6].iter().all(|&v| v == 900) && ct.data[20..24].iter().all(|&v| v == 299));
        assert_eq!(ct.data[12], 40);
    }

    #[test]
    fn the_isovalue_lies_between_the_modes_within_its_limits() {
        let of = |soft: i16, bone: i16| {
            let mut ct = VoxelVolume::isotropic([40, 40, 40], Vec3::ZERO, 1.0, soft);
            ct.data
                .iter_mut()
                .enumerate()
                .filter(|(at, _)| at % 5 == 0)
                .for_each(|(at, v)| *v = bone + (at % 64) as i16);
            bone_isovalue(&ct)
        };
        assert!((300..=500).contains(&of(120, 700)));
        assert_eq!(of(-1000, -1000), 300);
        assert_eq!(of(900, 1900), 500);
    }

    #[test]
    fn only_hounsfield_units_pass_as_ct() {
        let ct = |values: [f32; 3]| VoxelVolume {
            data: values.into(),
            ..VoxelVolume::isotropic([3, 1, 1], Vec3::ZERO, 1.0, 0.0)
        };
        assert_eq!(hounsfield(&ct([-1000.4, 40.0, 1200.6])).unwrap().data, [-1000, 40, 1201]);
        assert_eq!(hounsfield(&ct([f32::NAN, f32::INFINITY, 0.0])), Err(HounsfieldError::NotANumber { count: 2 }));
        assert_eq!(hounsfield(&ct([0.0, 40.0, 255.0])), Err(HounsfieldError::Range { low: 0.0, high: 255.0 }));
    }

    #[test]
    fn a_ct_is_known_by_its_air_and_an_mri_by_none() {
        let of = |air: f32| {
            let mut image = VoxelVolume::isotropic([10, 10, 10], Vec3::ZERO, 1.0, 40.0f32);
            image.data[..100].fill(air);
            image.data[100..200].fill(1200.0);
            image
        };
        assert!(is_ct(&of(-1000.0)) && is_ct(&of(-3024.0)));
        assert!(!is_ct(&of(0.0)) && !is_ct(&of(-300.0)));
        let mut speck = of(0.0);
        speck.data[..10].fill(-1000.0);
        assert!(!is_ct(&speck), "a few odd voxels make no CT");
    }

    #[test]
    fn labels_are_whole_numbers() {
        let volume = |values: [f32; 2]| VoxelVolume {
            data: values.into(),
            ..VoxelVolume::isotropic([2, 1, 1], Vec3::ZERO, 1.0, 0.0)
        };
        assert_eq!(labels(Path::new("a.nii"), &volume([0.0, 2035.0])).unwrap().data, [0, 2035]);
        for wrong in [0.5, -1.0, f32::NAN, 70000.0] {
            assert!(labels(Path::new("a.nii"), &volume([0.0, wrong])).unwrap_err().to_string().contains("a.nii"));
        }
    }
}
