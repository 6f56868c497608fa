//! Overlay of CT and MRI for inspection: the bone's contour on the MRI in three planes.
//!
//! # Practice
//! Sagittal, coronal and axial slices through the middle of the bone, in pixels of 1 mm over the
//! CT's box; rows from head to foot (axial: from front to back). Radiological convention: the
//! patient's right is on the left; the sagittal picture has the face on the left. The bone's
//! contour is orange. Returns raw RGB bytes; the caller writes the file.

use glam::{DVec3, Vec3};
use trepan_volume::{VoxelVolume, corners};

/// The contour's colour.
const BONE: [u8; 3] = [255, 140, 0];

/// Most pixels along an edge.
const LONGEST: f64 = 2048.0;

/// A picture: rows from the top, RGB bytes.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct RgbPicture {
    /// Pixels in a row.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// Red, green and blue of each pixel.
    pub rgb: Vec<u8>,
}

/// Draws the contour of voxels over `isovalue` HU in the CT on the MRI, sagittal, coronal and
/// axial.
///
/// To compare before and after registration, call it with the MRI's original and transformed
/// `world_from_voxel`.
pub fn overlap_pictures(ct: &VoxelVolume<i16>, mri: &VoxelVolume<f32>, isovalue: i16) -> [RgbPicture; 3] {
    let (low, high) = ct.world_corners();
    let middle = bone_middle(ct, isovalue).unwrap_or(0.5 * (low + high));
    let (ct, mri) = (Sampler::new(ct), Sampler::new(mri));
    let grey = window(mri.volume);
    // Horizontal and vertical axis of each picture.
    [[1, 2], [0, 2], [0, 1]].map(|[across, down]| {
        let size = (high - low).ceil().clamp(DVec3::ONE, DVec3::splat(LONGEST));
        let (width, height) = (size[across] as usize, size[down] as usize);
        let at = |x: usize, y: usize| {
            let mut p = middle;
            p[across] = high[across] - x as f64 - 0.5;
            p[down] = high[down] - y as f64 - 0.5;
            p
        };
        let hu = |x: usize, y: usize| ct.at(at(x, y), f32::from).is_some_and(|v| v >= f32::from(isovalue));
        let bone: Vec<bool> = (0..width * height).map(|n| hu(n % width, n / width)).collect();
        let border = |n: usize| {
            let (x, y) = (n % width, n / width);
            let free = |inside: bool, n: usize| inside && !bone[n];
            bone[n]
                && (free(x > 0, n.wrapping_sub(1))
                    || free(x + 1 < width, n + 1)
                    || free(y > 0, n.wrapping_sub(width))
                    || free(y + 1 < height, n + width))
        };
        let colour = |n: usize| match border(n) {
            true => BONE,
            false => [mri.at(at(n % width, n / width), |v| v).map_or(0, |v| grey.of(v)); 3],
        };
        RgbPicture { width, height, rgb: (0..width * height).flat_map(colour).collect() }
    })
}

/// The middle of the box around bone, world mm.
fn bone_middle(ct: &VoxelVolume<i16>, isovalue: i16) -> Option<DVec3> {
    let [nx, ny, _] = ct.dims;
    let (mut low, mut high) = (DVec3::MAX, DVec3::MIN);
    for (at, _) in ct.data.iter().enumerate().filter(|(_, v)| **v >= isovalue) {
        let voxel = DVec3::new((at % nx) as f64, (at / nx % ny) as f64, (at / (nx * ny)) as f64);
        (low, high) = (low.min(voxel), high.max(voxel));
    }
    (low.x <= high.x).then(|| ct.world_from_voxel.transform_point3(0.5 * (low + high)))
}

/// The values shown as black and white.
struct Window {
    black: f32,
    white: f32,
}

impl Window {
    fn of(&self, value: f32) -> u8 {
        (255.0 * (value - self.black) / (self.white - self.black)) as u8
    }
}

/// From the 1st to the 99.5th percentile.
fn window(mri: &VoxelVolume<f32>) -> Window {
    let stride = mri.data.len().div_ceil(200_000).max(1);
    let mut values: Vec<f32> = mri.data.iter().step_by(stride).copied().filter(|v| v.is_finite()).collect();
    values.sort_unstable_by(f32::total_cmp);
    let at = |share: f64| values.get((share * values.len() as f64) as usize).copied().unwrap_or(0.0);
    let black = at(0.01);
    Window { black, white: at(0.995).max(black + f32::MIN_POSITIVE) }
}

struct Sampler<'a, T> {
    volume: &'a VoxelVolume<T>,
    voxel_from_world: glam::DAffine3,
    last: Vec3,
}

impl<'a, T: Copy> Sampler<'a, T> {
    fn new(volume: &'a VoxelVolume<T>) -> Self {
        let last = Vec3::from_array(volume.dims.map(|n| n.saturating_sub(1) as f32));
        Self { volume, voxel_from_world: volume.world_from_voxel.inverse(), last }
    }

    /// The value at a world point, trilinear; `None` beyond the voxels' outer faces.
    fn at(&self, world: DVec3, number: impl Fn(T) -> f32) -> Option<f32> {
        let p = self.voxel_from_world.transform_point3(world).as_vec3();
        let inside = p.cmpge(Vec3::splat(-0.5)).all() && p.cmple(self.last + 0.5).all();
        let sum =
            || corners(self.volume.dims, self.last, p).iter().map(|&(at, w)| w * number(self.volume.data[at])).sum();
        (inside && !self.volume.data.is_empty()).then(sum)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_contour_lies_where_the_bone_is_and_the_grey_where_the_mri_is() {
        let mut ct = VoxelVolume::isotropic([30, 40, 20], Vec3::new(-15.0, 5.0, 0.0), 1.0, -1000i16);
        let mut mri = VoxelVolume::isotropic([30, 40, 20], Vec3::new(-15.0, 5.0, 0.0), 1.0, 0f32);
        for at in 0..ct.data.len() {
            let p = [at % 30, at / 30 % 40, at / 1200];
            // A box of bone, and grey that rises towards the head.
            if (10..20).contains(&p[0]) && (4..30).contains(&p[1]) && (6..15).contains(&p[2]) {
                ct.data[at] = 1000;
            }
            mri.data[at] = p[2] as f32;
        }
        let [sagittal, coronal, axial] = overlap_pictures(&ct, &mri, 0);
        assert_eq!([sagittal.width, sagittal.height], [40, 20]);
        assert_eq!([coronal.width, coronal.height], [30, 20]);
        assert_eq!([axial.width, axial.height, axial.rgb.len()], [30, 40, 3600]);
        let pixel =
            |p: &RgbPicture, x: usize, y: usize| <[u8; 3]>::try_from(&p.rgb[3 * (x + y * p.width)..][..3]).unwrap();
        // Row 0 is the head's end, voxel 19; x runs from front to back or from right to left.
        assert_eq!(pixel(&sagittal, 39 - 4, 19 - 10), BONE);
        assert_eq!(pixel(&coronal, 29 - 10, 19 - 14), BONE);
        assert_eq!(pixel(&axial, 29 - 10, 39 - 4), BONE);
        assert_ne!(pixel(&axial, 29 - 15, 39 - 15), BONE, "the inside of bone is not drawn");
        assert!(pixel(&sagittal, 1, 0)[0] > pixel(&sagittal, 1, 18)[0], "the head is up");
        mri.world_from_voxel.translation.x += 500.0;
        assert_eq!(pixel(&overlap_pictures(&ct, &mri, 0)[2], 1, 1), [0; 3]);
    }
}
