//! Registers an MRI to a CT and draws the bone's contour over it: `overlap CT MRI OUT.png`. The
//! upper row is as read, the lower as registered.

use std::path::Path;
use trepan_render::{RgbPicture, overlap_pictures};
use trepan_volume::{RegistrationConfig, RegistrationError, bone_isovalue, hounsfield, read, register};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let paths: Vec<String> = std::env::args().skip(1).collect();
    let [ct, mri, out] = paths.as_slice() else { return Err("usage: overlap CT MRI OUT.png".into()) };
    let (ct, mut mri) = (hounsfield(&read(Path::new(ct))?)?, read(Path::new(mri))?);
    let isovalue = bone_isovalue(&ct);
    let before = overlap_pictures(&ct, &mri, isovalue);
    let found = match register(&ct, &mri, &RegistrationConfig::default()) {
        Err(RegistrationError::Doubtful { found, least }) => {
            println!("refused: under the least confidence of {least}");
            *found
        }
        other => other?,
    };
    println!("{found:#.3?}");
    mri.world_from_voxel = found.fixed_from_moving * mri.world_from_voxel;
    let after = overlap_pictures(&ct, &mri, isovalue);
    write(Path::new(out), &[before, after])
}

/// The pictures side by side, one row before and one after registration.
fn write(path: &Path, looks: &[[RgbPicture; 3]]) -> Result<(), Box<dyn std::error::Error>> {
    let width: usize = looks[0].iter().map(|p| p.width).sum();
    let height = looks[0].iter().map(|p| p.height).max().unwrap_or(0);
    let mut rgb = vec![0; 3 * width * height * looks.len()];
    for (n, look) in looks.iter().enumerate() {
        let mut left = 0;
        for picture in look {
            for (y, row) in picture.rgb.chunks_exact(3 * picture.width).enumerate() {
                rgb[3 * (left + width * (y + n * height))..][..row.len()].copy_from_slice(row);
            }
            left += picture.width;
        }
    }
    let file = std::io::BufWriter::new(std::fs::File::create(path)?);
    let mut encoder = png::Encoder::new(file, width as u32, (height * looks.len()) as u32);
    encoder.set_color(png::ColorType::Rgb);
    Ok(encoder.write_header()?.write_image_data(&rgb)?)
}
