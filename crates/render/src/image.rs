//! A finished picture and its PNG file.

use std::ops::Range;
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
        let mut rgba = vec![0; 4 * width as usize * height as usize];
        let enlarge = Enlarge::of(bytemuck::cast_slice(&self.rgba), [self.width, self.height], [width, height]);
        let rows = rgba.chunks_exact_mut(4 * width.max(1) as usize).enumerate();
        rows.for_each(|(y, row)| enlarge.row(y, 0..width as usize, bytemuck::cast_slice_mut(row)));
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

/// Enlarges a grid of colours row by row, with bilinear interpolation.
pub(crate) struct Enlarge<'a> {
    from: &'a [[u8; 4]],
    width: usize,
    columns: Vec<Between>,
    rows: Vec<Between>,
}

/// Where a pixel lies in the smaller picture.
#[derive(Clone, Copy)]
struct Between {
    /// The pixel at or before its centre.
    first: usize,
    /// The one after, within the picture.
    second: usize,
    /// Weight of the second, of 256.
    share: u16,
}

impl<'a> Enlarge<'a> {
    /// From a size to another, width and height in pixels.
    pub fn of(from: &'a [[u8; 4]], size: [u32; 2], to: [u32; 2]) -> Self {
        let [columns, rows] = [0, 1].map(|n| Between::all(size[n], to[n]));
        Self { from, width: size[0] as usize, columns, rows }
    }

    /// Fills columns of row `y` of the larger picture.
    pub fn row(&self, y: usize, columns: Range<usize>, to: &mut [[u8; 4]]) {
        let Between { first, second, share } = self.rows[y];
        let [upper, lower] = [first, second].map(|y| &self.from[self.width * y..self.width * (y + 1)]);
        if share == 0 && self.width == self.columns.len() {
            return to.copy_from_slice(&upper[columns]);
        }
        let columns = &self.columns[columns];
        let [Some(left), Some(right)] = [columns.first(), columns.last()] else { return };
        let (start, end) = (left.first, right.second + 1);
        // The two rows are mixed first: they have fewer pixels. All numbers fit 16 bits.
        let mixed = upper[start..end].iter().zip(&lower[start..end]);
        let (from, by) = (256 - share, share);
        let down: Vec<[u16; 4]> =
            mixed.map(|(a, b)| [0, 1, 2, 3].map(|c| u16::from(a[c]) * from + u16::from(b[c]) * by)).collect();
        let part = |colour: u16, share: u16| ((u32::from(colour) * u32::from(share)) >> 16) as u16;
        for (pixel, at) in to.iter_mut().zip(columns) {
            let (a, b) = (down[at.first - start], down[at.second - start]);
            let (from, by) = (u16::MAX - (at.share << 8), at.share << 8);
            *pixel = [0, 1, 2, 3].map(|c| ((part(a[c], from) + part(b[c], by) + 129) >> 8) as u8);
        }
    }

    /// The rows of the smaller picture between which row `y` of the larger one lies.
    pub fn between(&self, y: usize) -> [usize; 2] {
        [self.rows[y].first, self.rows[y].second]
    }

    /// The columns of the larger picture that columns of the smaller one reach.
    pub fn reached(&self, columns: Range<usize>) -> Range<usize> {
        let first = self.columns.partition_point(|at| at.second < columns.start);
        first..self.columns.partition_point(|at| at.first < columns.end)
    }
}

impl Between {
    /// For each of `to` pixels in a row of `from`.
    fn all(from: u32, to: u32) -> Vec<Self> {
        let (scale, last) = (from as f32 / to.max(1) as f32, from.saturating_sub(1));
        let at = |n: u32| ((n as f32 + 0.5) * scale - 0.5).clamp(0.0, last as f32);
        let between = |at: f32| Self {
            first: at as usize,
            second: (at as usize + 1).min(last as usize),
            share: (256.0 * at.fract()).round().min(255.0) as u16,
        };
        (0..to).map(at).map(between).collect()
    }
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
