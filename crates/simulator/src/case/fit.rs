//! The picture that shows whether CT and MRI fit: the bone's contour over the MRI, as it was read
//! above, as it is used below.

use trepan_render::Image;
use trepan_volume::{Picture, VoxelVolume, overlap_pictures};

/// Three planes in a row for each place of the MRI that is given.
pub struct Fit {
    looks: Vec<[Picture; 3]>,
}

impl Fit {
    /// Nothing looked at yet.
    pub fn new() -> Self {
        Self { looks: Vec::new() }
    }

    /// The MRI where it lies now.
    pub fn look(&mut self, ct: &VoxelVolume<i16>, mri: &VoxelVolume<f32>, isovalue_hu: i16) {
        self.looks.push(overlap_pictures(ct, mri, isovalue_hu));
    }

    /// All looks in one PNG file's bytes; `None` when nothing was looked at.
    pub fn png(&self) -> Option<Vec<u8>> {
        let width: usize = self.looks.first()?.iter().map(|picture| picture.width).sum();
        let height = self.looks[0].iter().map(|picture| picture.height).max()?;
        let mut rgba = [0, 0, 0, 255].repeat(width * height * self.looks.len());
        for (n, look) in self.looks.iter().enumerate() {
            let mut left = 0;
            for picture in look {
                for (y, row) in picture.rgb.chunks_exact(3 * picture.width).enumerate() {
                    let at = left + width * (y + n * height);
                    for (pixel, rgb) in rgba[4 * at..].chunks_exact_mut(4).zip(row.chunks_exact(3)) {
                        pixel[..3].copy_from_slice(rgb);
                    }
                }
                left += picture.width;
            }
        }
        let image = Image { width: width as u32, height: (height * self.looks.len()) as u32, rgba };
        image.png().ok()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use trepan_geometry::Vec3;

    #[test]
    fn each_look_is_a_row_and_no_look_is_no_picture() {
        let mut ct = VoxelVolume::isotropic([12, 10, 8], Vec3::ZERO, 1.0, -1000i16);
        ct.data[500..700].fill(900);
        let mut fit = Fit::new();
        assert!(fit.png().is_none());
        fit.look(&ct, &ct.map(f32::from), 300);
        let one = fit.png().unwrap();
        fit.look(&ct, &ct.map(f32::from), 300);
        let two = fit.png().unwrap();
        // Width and height lie behind the signature and the first chunk's head.
        let size = |png: &[u8]| [16, 20].map(|at| u32::from_be_bytes(png[at..at + 4].try_into().unwrap()));
        assert_eq!((size(&one), size(&two)), ([34, 10], [34, 20]));
    }
}
