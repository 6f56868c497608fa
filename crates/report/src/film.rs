//! `recording film`: the pictures of a film as one animated PNG.
//!
//! # Theory
//! Every picture after the first holds only the rectangle that differs from the one before, so that
//! a window whose panels stand still costs little.
//!
//! # Sources
//! W3C, Portable Network Graphics (PNG) Specification, third edition (2025): animation.

use crate::ReportError;
use crate::printable::{count, printable};
use std::fs;
use std::io::{BufWriter, Write};
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use trepan_render::Image;

/// The list of a film's pictures and their times, beside them.
pub const LIST: &str = "film.ffconcat";

/// Makes an animated PNG of the film in a folder, or in the folder `window` of a session.
pub fn make(folder: &Path, out: &Path) -> Result<ExitCode, ReportError> {
    if out.exists() {
        return Err(ReportError::Usage(format!("{} exists already: name a file that does not", out.display())));
    }
    let list = [folder.join(LIST), folder.join("window").join(LIST)].into_iter().find(|list| list.is_file());
    let none = || format!("no film lies in {}: give the folder that holds {LIST}", folder.display());
    let list = list.ok_or_else(|| ReportError::Usage(none()))?;
    let read = |fault: std::io::Error| ReportError::Usage(format!("{}: {fault}", list.display()));
    let pictures = pictures(&fs::read_to_string(&list).map_err(read)?, list.parent().unwrap_or(folder));
    if pictures.is_empty() {
        return Err(ReportError::Usage(none()));
    }
    let failed = ReportError::output(out);
    let beside = out.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let mut file = BufWriter::new(tempfile::NamedTempFile::new_in(beside).map_err(failed)?);
    animate(&pictures, &mut file)?;
    let file = file.into_inner().map_err(|fault| failed(fault.into_error()))?;
    file.persist(out).map_err(|fault| failed(fault.error))?;
    println!("{}", printable(&format!("{}: {}; browsers play it", out.display(), count(pictures.len(), "picture"))));
    println!("{}", printable(&format!("a smaller file: ffmpeg -i {} film.mp4", list.display())));
    Ok(ExitCode::SUCCESS)
}

/// A picture of the film and how long it is shown, ms.
type FilmPicture = (PathBuf, u16);

/// Reads a list: the name of each picture, then its duration in seconds.
fn pictures(list: &str, folder: &Path) -> Vec<FilmPicture> {
    let mut pictures: Vec<FilmPicture> = Vec::new();
    for line in list.lines() {
        if let Some(name) = line.strip_prefix("file ") {
            pictures.push((folder.join(name.trim()), 33));
        }
        let duration = line.strip_prefix("duration ").and_then(|text| text.trim().parse::<f64>().ok());
        if let Some((seconds, (_, ms))) = duration.zip(pictures.last_mut()) {
            *ms = (1e3 * seconds).round() as u16;
        }
    }
    pictures
}

fn animate(pictures: &[FilmPicture], out: &mut impl Write) -> Result<(), ReportError> {
    let failed = |fault: png::EncodingError| ReportError::Internal(format!("the film: {fault}"));
    let read = |path: &Path| {
        let image = fs::read(path).and_then(|bytes| Image::read_png(&bytes));
        image.map_err(|fault| ReportError::Usage(format!("{}: {fault}", path.display())))
    };
    let mut before = read(&pictures[0].0)?;
    let mut encoder = png::Encoder::new(out, before.width, before.height);
    encoder.set_color(png::ColorType::Rgba);
    encoder.set_depth(png::BitDepth::Eight);
    encoder.set_source_srgb(png::SrgbRenderingIntent::Perceptual);
    encoder.set_animated(pictures.len() as u32, 0).map_err(failed)?;
    let mut writer = encoder.write_header().map_err(failed)?;
    writer.set_frame_delay(pictures[0].1, 1000).map_err(failed)?;
    writer.write_image_data(&before.rgba).map_err(failed)?;
    for (path, ms) in &pictures[1..] {
        let image = read(path)?.enlarged([before.width, before.height]);
        let [x, y, width, height] = changed(&before, &image);
        writer.reset_frame_position().map_err(failed)?;
        writer.set_frame_dimension(width, height).map_err(failed)?;
        writer.set_frame_position(x, y).map_err(failed)?;
        writer.set_frame_delay(*ms, 1000).map_err(failed)?;
        writer.write_image_data(&part(&image, [x, y, width, height])).map_err(failed)?;
        before = image;
    }
    writer.finish().map_err(failed)
}

/// The rectangle in which two pictures of one size differ: corner, width, height; a pixel if they
/// are alike.
fn changed(before: &Image, now: &Image) -> [u32; 4] {
    let row = 4 * now.width as usize;
    let (mut low, mut high) = ([usize::MAX; 2], [0; 2]);
    for (y, (was, is)) in before.rgba.chunks_exact(row).zip(now.rgba.chunks_exact(row)).enumerate() {
        let differs = |(was, is): (&[u8], &[u8])| was != is;
        let pixels = || was.chunks_exact(4).zip(is.chunks_exact(4));
        let Some(first) = pixels().position(differs) else { continue };
        let last = pixels().rposition(differs).unwrap_or(first);
        (low, high) = ([low[0].min(first), low[1].min(y)], [high[0].max(last), y]);
    }
    match low[0] {
        usize::MAX => [0, 0, 1, 1],
        _ => [low[0], low[1], high[0] - low[0] + 1, high[1] - low[1] + 1].map(|n| n as u32),
    }
}

/// The pixels of a rectangle.
fn part(image: &Image, [x, y, width, height]: [u32; 4]) -> Vec<u8> {
    let row = |y: u32| {
        let from = 4 * (x + image.width * y) as usize;
        &image.rgba[from..from + 4 * width as usize]
    };
    (y..y + height).flat_map(row).copied().collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_film_is_one_file_with_its_times_and_only_what_changed() {
        let folder = tempfile::tempdir().unwrap();
        let window = folder.path().join("window");
        fs::create_dir(&window).unwrap();
        let mut image = Image { width: 8, height: 6, rgba: [10, 20, 30, 255].repeat(48) };
        for name in ["a.png", "b.png", "c.png"] {
            image.write_png(&window.join(name)).unwrap();
            if name == "a.png" {
                // Pixels (2, 1) and (4, 3).
                for at in [2 + 8, 4 + 3 * 8] {
                    image.rgba[4 * at] = 200;
                }
            }
        }
        let list = "ffconcat version 1.0\nfile a.png\nduration 0.050\nfile b.png\nduration 0.100\nfile c.png\nduration 0.033\n";
        fs::write(window.join(LIST), list).unwrap();
        let out = folder.path().join("film.png");
        make(folder.path(), &out).unwrap();
        let decoder = png::Decoder::new(std::io::Cursor::new(fs::read(&out).unwrap()));
        let mut reader = decoder.read_info().unwrap();
        assert_eq!(reader.info().animation_control().unwrap().num_frames, 3);
        let mut frames = Vec::new();
        for _ in 0..3 {
            let mut pixels = vec![0; 4 * 48];
            reader.next_frame(&mut pixels).unwrap();
            let frame = *reader.info().frame_control().unwrap();
            frames.push(([frame.x_offset, frame.y_offset, frame.width, frame.height], frame.delay_num, pixels[0]));
        }
        assert_eq!(frames, [([0, 0, 8, 6], 50, 10), ([2, 1, 3, 3], 100, 200), ([0, 0, 1, 1], 33, 10)]);
        assert!(make(folder.path(), &out).unwrap_err().to_string().contains("exists already"));
        assert!(
            make(&out.with_extension("none"), &folder.path().join("x")).unwrap_err().to_string().contains("no film")
        );
    }
}
