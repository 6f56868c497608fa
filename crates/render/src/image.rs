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

    /// The bytes of a PNG file.
    pub fn png(&self) -> std::io::Result<Vec<u8>> {
        let mut bytes = Vec::new();
        let mut encoder = png::Encoder::new(&mut bytes, self.width, self.height);
        encoder.set_color(png::ColorType::Rgba);
        encoder.set_depth(png::BitDepth::Eight);
        encoder.set_source_srgb(png::SrgbRenderingIntent::Perceptual);
        let written = encoder.write_header().and_then(|mut writer| writer.write_image_data(&self.rgba));
        written.map(|()| bytes).map_err(std::io::Error::other)
    }

    /// Writes a PNG file: first beside it, then renamed, so that no half file is ever seen.
    pub fn write_png(&self, path: &Path) -> std::io::Result<()> {
        let part = path.with_extension("png.part");
        std::fs::write(&part, self.png()?)?;
        std::fs::rename(part, path)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

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
