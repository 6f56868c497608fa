//! A finished picture and its PNG file.

use std::path::Path;

/// Pixels from the upper left, row by row, sRGB with alpha.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Image {
    /// Pixels in a row.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// Four bytes a pixel.
    pub rgba: Vec<u8>,
}

impl Image {
    /// The colour of a pixel; black outside.
    pub fn pixel(&self, x: u32, y: u32) -> [u8; 4] {
        let at = 4 * (x as usize + self.width as usize * y as usize);
        let inside = x < self.width && y < self.height;
        if inside { [0, 1, 2, 3].map(|c| self.rgba[at + c]) } else { [0; 4] }
    }

    /// Enlarges the picture with bilinear interpolation; unchanged if it has the size.
    pub fn enlarged(&self, [width, height]: [u32; 2]) -> Self {
        if (self.width, self.height) == (width, height) {
            return self.clone();
        }
        let [columns, rows] = [(self.width, width), (self.height, height)].map(|(from, to)| between(from, to));
        let mut rgba = Vec::with_capacity(4 * width as usize * height as usize);
        for &(y, below) in &rows {
            for &(x, right) in &columns {
                let corner = |i: u32, j: u32| {
                    self.pixel((x + i).min(self.width - 1), (y + j).min(self.height - 1)).map(f32::from)
                };
                let (a, b, c, d) = (corner(0, 0), corner(1, 0), corner(0, 1), corner(1, 1));
                let mix = |k: usize| {
                    let (upper, lower) = (a[k] + right * (b[k] - a[k]), c[k] + right * (d[k] - c[k]));
                    (upper + below * (lower - upper)).round() as u8
                };
                rgba.extend([0, 1, 2, 3].map(mix));
            }
        }
        Self { width, height, rgba }
    }

    /// Root mean square difference of all colours from another picture of the same size, percent of
    /// white.
    pub fn error_percent(&self, other: &Self) -> f64 {
        let squares = self.rgba.iter().zip(&other.rgba).map(|(&a, &b)| (f64::from(a) - f64::from(b)).powi(2));
        // The alpha byte never differs.
        (squares.sum::<f64>() / (0.75 * self.rgba.len() as f64)).sqrt() / 2.55
    }

    /// Encodes a PNG file.
    pub fn png(&self) -> std::io::Result<Vec<u8>> {
        let mut bytes = Vec::new();
        let mut encoder = png::Encoder::new(&mut bytes, self.width, self.height);
        encoder.set_compression(png::Compression::Fast);
        encoder.set_color(png::ColorType::Rgba);
        encoder.set_depth(png::BitDepth::Eight);
        encoder.set_source_srgb(png::SrgbRenderingIntent::Perceptual);
        let written = encoder.write_header().and_then(|mut writer| writer.write_image_data(&self.rgba));
        written.map(|()| bytes).map_err(std::io::Error::other)
    }

    /// Decodes a PNG file.
    pub fn read_png(bytes: &[u8]) -> std::io::Result<Self> {
        let mut decoder = png::Decoder::new(std::io::Cursor::new(bytes));
        decoder.set_transformations(png::Transformations::normalize_to_color8() | png::Transformations::ALPHA);
        let mut reader = decoder.read_info().map_err(std::io::Error::other)?;
        let size = reader.output_buffer_size().ok_or_else(|| std::io::Error::other("the picture is too large"))?;
        let mut rgba = vec![0; size];
        let info = reader.next_frame(&mut rgba).map_err(std::io::Error::other)?;
        match info.color_type {
            png::ColorType::Rgba => Ok(Self { width: info.width, height: info.height, rgba }),
            other => Err(std::io::Error::other(format!("the picture is not in colours but {other:?}"))),
        }
    }

    /// Writes a PNG file atomically, by renaming a temporary file.
    pub fn write_png(&self, path: &Path) -> std::io::Result<()> {
        let part = path.with_extension("png.part");
        std::fs::write(&part, self.png()?)?;
        std::fs::rename(part, path)
    }
}

/// For each of `to` pixels in a row, the pixel of `from` at or before its centre, and the weight of
/// the next.
fn between(from: u32, to: u32) -> Vec<(u32, f32)> {
    let share = from as f32 / to.max(1) as f32;
    let at = |n: u32| ((n as f32 + 0.5) * share - 0.5).clamp(0.0, from.saturating_sub(1) as f32);
    (0..to).map(at).map(|at| (at as u32, at.fract())).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_picture_comes_back_from_its_file() {
        let image = Image { width: 3, height: 2, rgba: (0..24).collect() };
        assert_eq!(Image::read_png(&image.png().unwrap()).unwrap(), image);
        assert!(Image::read_png(b"no picture").is_err());
    }

    #[test]
    fn an_enlarged_ramp_is_a_finer_ramp() {
        let ramp = |n: u32| Image {
            width: n,
            height: 2,
            rgba: (0..2 * n).flat_map(|i| [(i % n * 240 / n) as u8; 4]).collect(),
        };
        let large = ramp(8).enlarged([32, 6]);
        assert_eq!((large.width, large.height, large.rgba.len()), (32, 6, 32 * 6 * 4));
        for x in 2..30 {
            let expected = ((x as f32 + 0.5) / 4.0 - 0.5) * 30.0;
            assert!((f32::from(large.pixel(x, 3)[1]) - expected).abs() <= 0.51, "{x}: {:?}", large.pixel(x, 3));
        }
        assert_eq!(ramp(8).enlarged([8, 2]), ramp(8));
    }

    #[test]
    fn a_written_picture_reads_back() {
        let image = Image { width: 3, height: 2, rgba: (0..24).collect() };
        let folder = std::env::temp_dir().join(format!("trepan-image-{}", std::process::id()));
        std::fs::create_dir_all(&folder).unwrap();
        let path = folder.join("picture.png");
        image.write_png(&path).unwrap();
        let file = std::io::BufReader::new(std::fs::File::open(&path).unwrap());
        let mut reader = png::Decoder::new(file).read_info().unwrap();
        let mut rgba = vec![0; reader.output_buffer_size().unwrap()];
        reader.next_frame(&mut rgba).unwrap();
        assert_eq!(rgba, image.rgba);
        assert_eq!((image.pixel(1, 1), image.pixel(3, 0)), ([16, 17, 18, 19], [0; 4]));
        assert!(!path.with_extension("png.part").exists());
        std::fs::remove_dir_all(folder).unwrap();
    }
}
