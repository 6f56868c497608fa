//! Parses one DICOM file; only the few elements that place and scale voxels are stored.

use super::element::{Element, Pixels, Syntax, Walk};
use crate::ReadError;
use crate::sample::ByteOrder;
use glam::DVec3;
use std::io::Read;
use std::path::{Path, PathBuf};

/// A file with a picture. Holds no name, number, date or free text of a patient.
#[derive(Clone, Debug, Default)]
pub(super) struct Slice {
    pub file: PathBuf,
    /// Identifier of the series; compared, never shown.
    pub series: String,
    /// Identifier of the picture; compared, never shown.
    pub instance: String,
    pub modality: String,
    pub number: Option<i64>,
    pub syntax: String,
    pub rows: usize,
    pub columns: usize,
    pub frames: usize,
    pub samples: u16,
    pub bits_allocated: u16,
    pub bits_stored: u16,
    pub high_bit: u16,
    pub signed: bool,
    /// Row direction and column direction, LPS.
    pub orientation: Option<[DVec3; 2]>,
    /// Centre of the first voxel, LPS mm: one, or one per frame.
    pub positions: Vec<DVec3>,
    /// Between rows and between columns, mm.
    pub spacing: Option<[f64; 2]>,
    /// Slope and intercept: one, or one per frame.
    pub rescale: Vec<[f64; 2]>,
    /// Whether the file gives a slope and an intercept.
    pub scaled: [bool; 2],
    /// Stored values without a picture, as written; the two ends of a range.
    pub padding: [Option<u16>; 2],
    /// Decimals of the positions as written.
    pub decimals: usize,
    /// What tells repeats of a place apart: acquisition, echo, kind of image, phase. Compared,
    /// never shown.
    pub part: [String; 4],
    /// Echo time and repetition time, ms.
    pub echo_ms: Option<f64>,
    pub repetition_ms: Option<f64>,
    /// Technical words of the descriptions of series and protocol.
    pub description: String,
    /// Element whose value does not place a picture, and the value as written.
    pub wrong: Vec<(&'static str, String)>,
    /// Element that differs between frames.
    pub varies: Option<&'static str>,
    /// Number and label of each segment, of a segmentation.
    pub segments: Vec<(u16, String)>,
    /// Segment of each frame.
    pub segment_of_frame: Vec<u16>,
    /// Value of a fractional segmentation that means all of a voxel.
    pub fraction: u16,
    pub pixels: Option<Pixels>,
}

impl Slice {
    /// Parses a whole file; `None` if it is not DICOM or has no picture.
    pub fn parse(file: &Path, bytes: &[u8]) -> Result<Option<Self>, ReadError> {
        let Some(start) = Start::of(bytes) else { return Ok(None) };
        let mut walk = Walk { bytes, at: start.at, syntax: start.syntax, pixels: None };
        let mut slice = Self { file: file.into(), syntax: start.name, frames: 1, samples: 1, ..Self::default() };
        let mut slopes: Vec<(usize, f64)> = Vec::new();
        let mut intercepts: Vec<(usize, f64)> = Vec::new();
        let ended = walk.run(&mut |found| slice.keep(&found, &mut slopes, &mut intercepts));
        slice.pixels = walk.pixels.take();
        let picture = slice.rows > 0 && slice.columns > 0;
        if let Err(broken) = ended {
            if !picture {
                return Ok(None);
            }
            let what = "data elements";
            return Err(ReadError::Truncated {
                file: file.into(),
                what,
                expected: broken.at as u64 + 8,
                found: bytes.len() as u64,
            });
        }
        slice.rescale = (0..slopes.len().max(intercepts.len()))
            .map(|n| [slopes.get(n).map_or(1.0, |s| s.1), intercepts.get(n).map_or(0.0, |i| i.1)])
            .collect();
        slice.scaled = [!slopes.is_empty(), !intercepts.is_empty()];
        Ok(picture.then_some(slice))
    }

    fn keep(&mut self, found: &Element, slopes: &mut Vec<(usize, f64)>, intercepts: &mut Vec<(usize, f64)>) {
        let frame = match found.within {
            None => 0,
            Some((0x5200_9229, _)) => 0,
            Some((0x5200_9230, frame)) => frame,
            Some((0x0062_0002, _)) => return self.keep_segment(found),
            Some(_) => return,
        };
        let first = || found.numbers().first().copied().filter(|v| v.is_finite());
        match found.tag {
            0x0008_0018 => self.instance = found.text(),
            0x0008_0060 => self.modality = code(&found.text(), 2),
            0x0020_000e => self.series = found.text(),
            0x0020_0011 => self.number = first().map(|n| n as i64),
            0x0008_0008 => self.part[2] = found.text(),
            0x0008_103e | 0x0018_1030 => self.describe(&found.text()),
            0x0018_0080 => self.repetition_ms = first(),
            0x0018_0081 => {
                self.echo_ms = first();
                self.part[1] = found.written();
            }
            0x0020_0012 => self.part[0] = found.written(),
            0x0020_0100 => self.part[3] = found.written(),
            0x0020_0032 => match vector(&found.numbers()) {
                Some(position) => {
                    self.decimals = self.decimals.max(found.decimals());
                    self.positions.push(position);
                }
                None => self.wrong.push(("ImagePositionPatient (for every frame)", found.written())),
            },
            0x0020_0037 => match (directions(&found.numbers()), self.orientation) {
                (None, _) => self.wrong.push(("ImageOrientationPatient", found.written())),
                (new, None) => self.orientation = new,
                (Some(new), Some(old)) if !alike(new, old) => self.varies = Some("ImageOrientationPatient"),
                _ => {}
            },
            0x0028_0002 => self.samples = found.u16().unwrap_or(0),
            0x0028_0008 => self.frames = first().map_or(0, |n| n.clamp(0.0, 1e6) as usize),
            0x0028_0010 => self.rows = found.u16().unwrap_or(0).into(),
            0x0028_0011 => self.columns = found.u16().unwrap_or(0).into(),
            0x0028_0030 => match (edges(&found.numbers()), self.spacing) {
                (None, _) => self.wrong.push(("PixelSpacing", found.written())),
                (new, None) => self.spacing = new,
                (Some(new), Some(old)) if !near(new, old) => self.varies = Some("PixelSpacing"),
                _ => {}
            },
            0x0028_0100 => self.bits_allocated = found.u16().unwrap_or(0),
            0x0028_0101 => self.bits_stored = found.u16().unwrap_or(0),
            0x0028_0102 => self.high_bit = found.u16().unwrap_or(0),
            0x0028_0103 => self.signed = found.u16() == Some(1),
            0x0028_0120 => self.padding[0] = found.u16(),
            0x0028_0121 => self.padding[1] = found.u16(),
            0x0062_000b => self.segment_of_frame.extend(found.u16()),
            0x0062_000e => self.fraction = found.u16().unwrap_or(0),
            0x0028_1052 => intercepts.extend(first().map(|v| (frame, v))),
            0x0028_1053 => slopes.extend(first().map(|v| (frame, v))),
            _ => {}
        }
    }
}

impl Slice {
    fn keep_segment(&mut self, found: &Element) {
        match found.tag {
            0x0062_0004 => self.segments.push((found.u16().unwrap_or(0), String::new())),
            0x0062_0005 => {
                if let Some(segment) = self.segments.last_mut() {
                    segment.1 = found.text();
                }
            }
            _ => {}
        }
    }

    /// Adds the technical words of a description, which may hold a name otherwise.
    fn describe(&mut self, text: &str) {
        for word in text.split(|c: char| !c.is_ascii_alphanumeric()).map(str::to_ascii_lowercase) {
            if WORDS.contains(&word.as_str()) && !self.description.split(' ').any(|known| known == word) {
                self.description += if self.description.is_empty() { "" } else { " " };
                self.description += &word;
            }
        }
    }
}

/// Words of descriptions that are shown.
const WORDS: &[&str] = &[
    "t1",
    "t1w",
    "t2",
    "t2w",
    "pd",
    "flair",
    "mprage",
    "mp2rage",
    "spgr",
    "bravo",
    "fspgr",
    "tfe",
    "tse",
    "fse",
    "se",
    "gre",
    "vibe",
    "space",
    "cube",
    "3d",
    "2d",
    "dwi",
    "dti",
    "adc",
    "trace",
    "fa",
    "diffusion",
    "ep2d",
    "epi",
    "bold",
    "fmri",
    "swi",
    "swan",
    "asl",
    "perf",
    "perfusion",
    "tof",
    "mra",
    "cta",
    "ct",
    "mr",
    "pet",
    "gd",
    "contrast",
    "post",
    "pre",
    "plain",
    "native",
    "ax",
    "axial",
    "tra",
    "cor",
    "coronal",
    "sag",
    "sagittal",
    "obl",
    "oblique",
    "mpr",
    "mip",
    "bone",
    "brain",
    "soft",
    "tissue",
    "head",
    "skull",
    "neck",
    "sinus",
    "orbit",
    "stereo",
    "frame",
    "thin",
    "thick",
    "helical",
    "volume",
    "localizer",
    "localiser",
    "scout",
    "topogram",
    "survey",
    "loc",
    "b0",
    "b1000",
    "iso",
    "sharp",
    "smooth",
    "kernel",
    "recon",
    "h30s",
    "h60s",
    "fc",
    "seg",
    "segmentation",
    "tumor",
    "tumour",
    "phase",
    "magnitude",
];

/// Whether two pairs of directions agree.
pub(super) fn alike(a: [DVec3; 2], b: [DVec3; 2]) -> bool {
    (0..2).all(|n| a[n].abs_diff_eq(b[n], 1e-3))
}

/// Whether two pairs of edges agree to a thousandth, as numbers of few digits do.
pub(super) fn near(a: [f64; 2], b: [f64; 2]) -> bool {
    (0..2).all(|n| (a[n] - b[n]).abs() <= 1e-3 * a[n].abs().max(b[n].abs()))
}

/// Offset and encoding of the first element.
struct Start {
    at: usize,
    syntax: Syntax,
    name: String,
}

const EXPLICIT: Syntax = Syntax { explicit: true, order: ByteOrder::Little };

impl Start {
    /// With a preamble, the meta group gives the syntax; without, the first element must be
    /// plausible.
    fn of(bytes: &[u8]) -> Option<Self> {
        let meta = if bytes.get(128..132) == Some(b"DICM") { 132 } else { 0 };
        let mut name = String::new();
        let mut walk = Walk { bytes, at: meta, syntax: EXPLICIT, pixels: None };
        while bytes.get(walk.at..walk.at + 2) == Some(&[2, 0]) {
            let found = walk.plain_element().ok()?;
            if found.tag == 0x0002_0010 {
                name = uid(&found.text());
            }
        }
        if walk.at == 0 && bytes.get(0..2) != Some(&[8, 0]) {
            return None;
        }
        let syntax = match name.as_str() {
            "1.2.840.10008.1.2" => Syntax { explicit: false, ..EXPLICIT },
            "1.2.840.10008.1.2.2" => Syntax { order: ByteOrder::Big, ..EXPLICIT },
            "" => guessed(bytes.get(walk.at..)?),
            _ => EXPLICIT,
        };
        Some(Self { at: walk.at, syntax, name })
    }
}

/// Guesses explicit VR if two capital letters follow the first tag, big-endian if the group's zero
/// byte comes first.
fn guessed(bytes: &[u8]) -> Syntax {
    let letters = bytes.get(4..6).is_some_and(|vr| vr.iter().all(u8::is_ascii_uppercase));
    let order = if bytes.first() == Some(&0) { ByteOrder::Big } else { ByteOrder::Little };
    Syntax { explicit: letters, order }
}

/// Largest unpacked size of a deflated file: over 1000 frames of 512 x 512.
const MOST_INFLATED: u64 = 1 << 30;

/// Unpacks the deflated syntax's elements after the meta group; other files are unchanged.
pub(super) fn inflated(file: &Path, bytes: Vec<u8>) -> Result<Vec<u8>, ReadError> {
    let deflated = Start::of(&bytes).filter(|start| start.name == "1.2.840.10008.1.2.1.99");
    let Some(start) = deflated else { return Ok(bytes) };
    let mut out = bytes[..start.at].to_vec();
    let stream = flate2::read::DeflateDecoder::new(&bytes[start.at..]);
    stream
        .take(MOST_INFLATED)
        .read_to_end(&mut out)
        .map_err(|source| ReadError::Compression { file: file.into(), source })?;
    match out.len() as u64 {
        ..MOST_INFLATED => Ok(out),
        _ => Err(ReadError::Field {
            file: file.into(),
            field: "the deflated data set",
            found: format!("over {} MiB long", MOST_INFLATED >> 20),
            remedy: "a picture is smaller; fetch the file again, or convert it to Explicit VR Little Endian",
        }),
    }
}

fn vector(numbers: &[f64]) -> Option<DVec3> {
    <[f64; 3]>::try_from(numbers).ok().map(DVec3::from_array).filter(|v| v.is_finite())
}

/// Largest difference of a direction's length from 1, and cosine of two: numbers of two digits.
const ROUNDED: f64 = 0.03;

/// Two directions, made of length 1 and upright to each other.
fn directions(numbers: &[f64]) -> Option<[DVec3; 2]> {
    let [a, b] = [vector(numbers.get(..3)?)?, vector(numbers.get(3..6)?)?];
    let sound = a.dot(b).abs() < ROUNDED && [a, b].iter().all(|v| (v.length() - 1.0).abs() < ROUNDED);
    let exact = a.dot(b).abs() < 1e-9 && [a, b].iter().all(|v| (v.length() - 1.0).abs() < 1e-9);
    let row = a.normalize();
    sound.then(|| if exact { [a, b] } else { [row, (b - b.dot(row) * row).normalize()] })
}

/// Edges between rows and between columns; one number is both.
fn edges(numbers: &[f64]) -> Option<[f64; 2]> {
    match *numbers {
        [one] => Some([one; 2]),
        [rows, columns] => Some([rows, columns]),
        _ => None,
    }
}

/// Keeps capital letters only, so that no patient data can pass.
fn code(text: &str, most: usize) -> String {
    text.chars().filter(char::is_ascii_uppercase).take(most).collect()
}

/// Keeps digits and points only, so that no patient data can pass.
fn uid(text: &str) -> String {
    text.chars().filter(|c| c.is_ascii_digit() || *c == '.').take(64).collect()
}
