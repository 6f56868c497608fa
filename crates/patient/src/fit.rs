//! Draws the overlay of CT and MRI: the bone's contour over the MRI, as read above, as registered
//! below.

use trepan_render::Image;
use trepan_render::{RgbPicture, overlap_pictures};
use trepan_volume::VoxelVolume;

/// Overlay pictures: a row of three planes for each pose of the MRI.
pub struct Fit {
    rows: Vec<[RgbPicture; 3]>,
}

impl Fit {
    /// Makes an overlay without rows.
    pub fn new() -> Self {
        Self { rows: Vec::new() }
    }

    /// Adds a row with the MRI in its current pose.
    pub fn add(&mut self, ct: &VoxelVolume<i16>, mri: &VoxelVolume<f32>, isovalue_hu: i16) {
        self.rows.push(overlap_pictures(ct, mri, isovalue_hu));
    }

    /// All rows as the bytes of a PNG file; `None` without rows.
    pub fn png(&self) -> Option<Vec<u8>> {
        let width: usize = self.rows.first()?.iter().map(|picture| picture.width).sum();
        let height = self.rows[0].iter().map(|picture| picture.height).max()?;
        let mut rgba = [0, 0, 0, 255].repeat(width * height * self.rows.len());
        for (n, planes) in self.rows.iter().enumerate() {
            let mut left = 0;
            for picture in planes {
                for (y, row) in picture.rgb.chunks_exact(3 * picture.width).enumerate() {
                    let at = left + width * (y + n * height);
                    for (pixel, rgb) in rgba[4 * at..].chunks_exact_mut(4).zip(row.chunks_exact(3)) {
                        pixel[..3].copy_from_slice(rgb);
                    }
                }
                left += picture.width;
            }
        }
        let image = Image { width: width as u32, height: (height * self.rows.len()) as u32, rgba };
        image.png().ok()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use trepan_geometry::Vec3;

    #[test]
    fn each_pose_is_a_row_and_without_rows_there_is_no_picture() {
        let mut ct = VoxelVolume::isotropic([12, 10, 8], Vec3::ZERO, 1.0, -1000i16);
        ct.data[500..700].fill(900);
        let mut fit = Fit::new();
        assert!(fit.png().is_none());
        fit.add(&ct, &ct.map(f32::from), 300);
        let one = fit.png().unwrap();
        fit.add(&ct, &ct.map(f32::from), 300);
        let two = fit.png().unwrap();
        // Width and height follow the signature and the header of the first chunk.
        let size = |png: &[u8]| [16, 20].map(|at| u32::from_be_bytes(png[at..at + 4].try_into().unwrap()));
        assert_eq!((size(&one), size(&two)), ([34, 10], [34, 20]));
    }
}
