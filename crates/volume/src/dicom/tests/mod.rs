use super::codec::{CodecError, rle};
use super::element::Pixels;
use super::*;
use crate::mutation::survives_mutations;
use glam::{DMat3, DVec3};
use std::io::Write;

mod kinds;

/// Builds a DICOM file element by element.
struct Maker {
    bytes: Vec<u8>,
    explicit: bool,
    big: bool,
}

const PLAIN: [(&str, bool, bool); 3] =
    [("1.2.840.10008.1.2.1", true, false), ("1.2.840.10008.1.2", false, false), ("1.2.840.10008.1.2.2", true, true)];

impl Maker {
    fn new(syntax: &str, explicit: bool, big: bool) -> Self {
        let mut maker = Self { bytes: [vec![0; 128], b"DICM".to_vec()].concat(), explicit: true, big: false };
        maker.text(0x0002_0010, b"UI", syntax);
        Self { explicit, big, ..maker }
    }

    fn u16(&mut self, value: u16) -> &mut Self {
        self.bytes.extend(if self.big { value.to_be_bytes() } else { value.to_le_bytes() });
        self
    }

    fn u32(&mut self, value: u32) -> &mut Self {
        self.bytes.extend(if self.big { value.to_be_bytes() } else { value.to_le_bytes() });
        self
    }

    fn head(&mut self, tag: u32, vr: &[u8; 2], length: u32) -> &mut Self {
        self.u16((tag >> 16) as u16).u16(tag as u16);
        if !self.explicit || tag >> 16 == 0xfffe {
            return self.u32(length);
        }
        self.bytes.extend(vr);
        match vr {
            b"OW" | b"OB" | b"SQ" | b"UN" => self.u16(0).u32(length),
            _ => self.u16(length as u16),
        }
    }

    fn text(&mut self, tag: u32, vr: &[u8; 2], value: &str) -> &mut Self {
        let padded = if value.len() % 2 == 1 { format!("{value} ") } else { value.into() };
        self.head(tag, vr, padded.len() as u32).bytes.extend(padded.as_bytes());
        self
    }

    fn short(&mut self, tag: u32, value: u16) -> &mut Self {
        self.head(tag, b"US", 2).u16(value)
    }

    /// A sequence of undefined length with an item of undefined length around what `inside` adds.
    fn sequence(&mut self, tag: u32, items: usize, inside: impl Fn(&mut Self, usize)) -> &mut Self {
        self.head(tag, b"SQ", u32::MAX);
        for n in 0..items {
            self.head(0xfffe_e000, b"--", u32::MAX);
            inside(self, n);
            self.head(0xfffe_e00d, b"--", 0);
        }
        self.head(0xfffe_e0dd, b"--", 0)
    }
}

/// Row and column directions of an oblique picture and its normal.
fn oblique() -> DMat3 {
    DMat3::from_rotation_x(0.4) * DMat3::from_rotation_z(-0.3)
}

fn vector(v: DVec3) -> String {
    format!("{:.9}\\{:.9}\\{:.9}", v.x, v.y, v.z)
}

const SIZE: [usize; 2] = [4, 3];

fn stored(slice: usize, pixel: usize) -> u16 {
    (100 * slice + pixel) as u16
}

/// Adds everything but the pixels, including patient identifiers.
fn described(maker: &mut Maker, series: &str, instance: usize, position: DVec3) {
    maker.text(0x0008_0018, b"UI", &format!("1.2.3.{series}.{instance}")).text(0x0008_0020, b"DA", "19991231");
    maker.text(0x0008_0060, b"CS", "CT").text(0x0008_103e, b"LO", "SECRET-DESCRIPTION").text(
        0x0009_0010,
        b"LO",
        "SECRET-PRIVATE",
    );
    maker.text(0x0010_0010, b"PN", "SECRET^NAME").text(0x0010_0020, b"LO", "SECRET-ID").text(
        0x0010_0030,
        b"DA",
        "19500101",
    );
    maker.sequence(0x0008_1140, 2, |inner, _| {
        inner.text(0x0020_0032, b"DS", "9\\9\\9").text(0x0010_0010, b"PN", "SECRET^INNER");
    });
    maker.text(0x0020_000e, b"UI", &format!("1.2.3.{series}")).text(0x0020_0011, b"IS", "7");
    maker.text(0x0020_0032, b"DS", &vector(position));
    let turn = oblique();
    maker.text(0x0020_0037, b"DS", &format!("{}\\{}", vector(turn.x_axis), vector(turn.y_axis)));
    sized(maker);
    maker.text(0x0028_0030, b"DS", "2.0\\0.5");
    bits(maker, 12, 0);
    maker.text(0x0028_1052, b"DS", "-1024").text(0x0028_1053, b"DS", "2");
}

fn sized(maker: &mut Maker) {
    maker.short(0x0028_0002, 1).short(0x0028_0010, SIZE[1] as u16).short(0x0028_0011, SIZE[0] as u16);
}

fn bits(maker: &mut Maker, stored: u16, signed: u16) {
    maker.short(0x0028_0100, 16).short(0x0028_0101, stored).short(0x0028_0102, stored - 1).short(0x0028_0103, signed);
}

fn picture(syntax: (&str, bool, bool), series: &str, n: usize, position: DVec3) -> Vec<u8> {
    let mut maker = Maker::new(syntax.0, syntax.1, syntax.2);
    described(&mut maker, series, n, position);
    maker.head(0x7fe0_0010, b"OW", 24);
    (0..12).for_each(|pixel| {
        maker.u16(stored(n, pixel));
    });
    maker.bytes
}

fn position(n: usize) -> DVec3 {
    DVec3::new(10.0, -20.0, 30.0) + 1.25 * n as f64 * oblique().z_axis
}

/// A series of some slices in a new folder, with names in no order.
fn folder(slices: impl IntoIterator<Item = usize>) -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    for n in slices {
        let bytes = picture(PLAIN[0], "1", n, position(n));
        std::fs::write(folder.path().join(format!("{}.dcm", (n * 7 + 3) % 11)), bytes).unwrap();
    }
    folder
}

fn is_the_stack(volume: &VoxelVolume<f32>, slices: usize) {
    assert_eq!(volume.dims, [4, 3, slices]);
    for (at, &value) in volume.data.iter().enumerate() {
        assert_eq!(value, 2.0 * f32::from(stored(at / 12, at % 12)) - 1024.0);
    }
    let ras = DMat3::from_diagonal(DVec3::new(-1.0, -1.0, 1.0));
    let expected = ras * oblique() * DMat3::from_diagonal(DVec3::new(0.5, 2.0, 1.25));
    assert!(volume.world_from_voxel.matrix3.abs_diff_eq(expected, 1e-7), "{}", volume.world_from_voxel);
    assert!(volume.world_from_voxel.translation.abs_diff_eq(ras * position(0), 1e-7));
}

#[test]
fn slices_are_sorted_by_place_scaled_and_turned_into_ras() {
    let folder = folder(0..5);
    let import = import(folder.path()).unwrap();
    is_the_stack(&import.volume, 5);
    assert_eq!(import.notes, []);
    let by_file = crate::read(&folder.path().join("3.dcm")).unwrap();
    assert_eq!(by_file, import.volume);
}

#[test]
fn every_plain_syntax_deflate_and_rle_give_the_same_volume() {
    for syntax in PLAIN {
        let folder = tempfile::tempdir().unwrap();
        for n in 0..3 {
            let bytes = picture(syntax, "1", n, position(n));
            let bytes = if n == 1 { bytes } else { without_meta(bytes, syntax) };
            std::fs::write(folder.path().join(format!("{n}")), bytes).unwrap();
        }
        is_the_stack(&read(folder.path()).unwrap(), 3);
    }
    let folder = tempfile::tempdir().unwrap();
    for n in 0..3 {
        let bytes = if n == 1 { deflated(n) } else { run_length_encoded(n) };
        std::fs::write(folder.path().join(format!("{n}")), bytes).unwrap();
    }
    is_the_stack(&read(folder.path()).unwrap(), 3);
}

/// Strips preamble and meta group, which explicit little-endian and implicit files may lack.
fn without_meta(bytes: Vec<u8>, syntax: (&str, bool, bool)) -> Vec<u8> {
    let meta = Maker::new(syntax.0, true, false).bytes.len();
    if syntax.2 { bytes } else { bytes[meta..].to_vec() }
}

fn deflated(n: usize) -> Vec<u8> {
    let bytes = picture(PLAIN[0], "1", n, position(n));
    let meta = Maker::new(PLAIN[0].0, true, false).bytes.len();
    let start = Maker::new("1.2.840.10008.1.2.1.99", true, false).bytes;
    let mut packer = flate2::write::DeflateEncoder::new(start, flate2::Compression::default());
    packer.write_all(&bytes[meta..]).unwrap();
    packer.finish().unwrap()
}

fn run_length_encoded(n: usize) -> Vec<u8> {
    let mut maker = Maker::new("1.2.840.10008.1.2.5", true, false);
    described(&mut maker, "1", n, position(n));
    let mut packed: Vec<u8> = [2u32, 64, 67].iter().flat_map(|v| v.to_le_bytes()).collect();
    packed.resize(64, 0);
    // A slice's high bytes are all equal: one run of 12. Then the low bytes uncompressed.
    packed.extend([(257 - 12) as u8, (stored(n, 0) >> 8) as u8, 128, 11]);
    packed.extend((0..12).map(|pixel| stored(n, pixel) as u8));
    maker.head(0x7fe0_0010, b"OB", u32::MAX).head(0xfffe_e000, b"--", 0).head(0xfffe_e000, b"--", packed.len() as u32);
    maker.bytes.extend(packed);
    maker.head(0xfffe_e0dd, b"--", 0);
    maker.bytes
}

#[test]
fn signed_pixels_keep_their_sign_and_stray_bits_fall_away() {
    let mut maker = Maker::new(PLAIN[0].0, true, false);
    described(&mut maker, "1", 0, position(0));
    bits(&mut maker, 12, 1);
    maker.head(0x7fe0_0010, b"OW", 24);
    (0..12).for_each(|_| {
        maker.u16(0xaffe);
    });
    let slice = Slice::parse(Path::new("a"), &maker.bytes).unwrap().unwrap();
    let mut values = Vec::new();
    pixels::frame(&slice, &maker.bytes, 0, &mut values).unwrap();
    // 0xffe in 12 bits is -2.
    assert_eq!(values, [-2.0 * 2.0 - 1024.0; 12]);
}

#[test]
fn a_tilted_gantry_gives_a_sheared_affine_and_a_note() {
    let folder = tempfile::tempdir().unwrap();
    let lean = oblique().z_axis + 0.3 * oblique().y_axis;
    for n in 0..4 {
        let place = DVec3::new(1.0, 2.0, 3.0) + n as f64 * lean;
        std::fs::write(folder.path().join(format!("{n}")), picture(PLAIN[1], "1", n, place)).unwrap();
    }
    let import = import(folder.path()).unwrap();
    let degrees = 0.3f64.atan().to_degrees();
    assert!(
        matches!(import.notes[..], [Note::Tilt { degrees: d }] if (d - degrees).abs() < 1e-4),
        "{:?}",
        import.notes
    );
    let third = import.volume.world_from_voxel.matrix3.z_axis;
    assert!(third.abs_diff_eq(DVec3::new(-lean.x, -lean.y, lean.z), 1e-7));
}

#[test]
fn missing_doubled_uneven_and_stray_slices_are_refused() {
    let error = |slices: &[(usize, DVec3)]| {
        let folder = tempfile::tempdir().unwrap();
        for (file, &(n, place)) in slices.iter().enumerate() {
            std::fs::write(folder.path().join(format!("{file}")), picture(PLAIN[0], "1", n, place)).unwrap();
        }
        import(folder.path()).unwrap_err().to_string()
    };
    let even: Vec<(usize, DVec3)> = (0..6).map(|n| (n, position(n))).collect();
    let missing = error(&[&even[..2], &even[4..]].concat());
    assert!(missing.contains("2 slices are missing") && missing.contains("3.750 mm"), "{missing}");
    let doubled = error(&[&even[..], &[(9, position(2))]].concat());
    assert!(doubled.contains("1 of 7 slices lie where another one lies"), "{doubled}");
    let uneven = error(&[&even[..], &[(9, position(5) + 0.5 * oblique().z_axis)]].concat());
    assert!(uneven.contains("unevenly, 0.500 to 1.250 mm"), "{uneven}");
    let beside = error(&[&even[..5], &[(5, position(5) + 9.0 * oblique().x_axis)]].concat());
    assert!(beside.contains("mm beside the line"), "{beside}");
    assert!(error(&even[..1]).contains("1 picture is no volume"));
    let empty = error(&[]);
    assert!(empty.contains("no DICOM picture lies in it"), "{empty}");
}

#[test]
fn the_same_picture_twice_counts_once_and_other_files_are_passed_over() {
    let folder = folder(0..4);
    std::fs::copy(folder.path().join("3.dcm"), folder.path().join("zz-copy.dcm")).unwrap();
    std::fs::write(folder.path().join("README.txt"), "not a picture").unwrap();
    let import = import(folder.path()).unwrap();
    is_the_stack(&import.volume, 4);
    assert!(
        matches!(import.notes[..], [Note::Skipped { count: 1, .. }, Note::Skipped { count: 1, .. }]),
        "{:?}",
        import.notes
    );
}

#[test]
fn of_several_series_the_largest_is_read_and_others_by_number() {
    let folder = folder(0..5);
    for n in 0..3 {
        std::fs::write(folder.path().join(format!("a{n}")), picture(PLAIN[0], "2", n, position(n))).unwrap();
    }
    let list = series(folder.path()).unwrap();
    let of = |series: &Series| (series.modality.clone(), series.number, series.slices, series.places, series.size);
    assert_eq!(list.iter().map(of).collect::<Vec<_>>(), [5, 3].map(|n| ("CT".into(), Some(7), n, n, SIZE)));
    assert!(list.iter().all(|s| s.direction == "axial" && (s.spacing_mm.unwrap()[2] - 1.25).abs() < 1e-6));
    let largest = import(folder.path()).unwrap();
    assert_eq!(largest.notes, [Note::OneOf { what: "series", count: 2, chosen: 0 }]);
    is_the_stack(&largest.volume, 5);
    is_the_stack(&import_series(folder.path(), 1).unwrap().volume, 3);
    is_the_stack(&import(&folder.path().join("a1")).unwrap().volume, 3);
    assert!(matches!(import_series(folder.path(), 2), Err(ReadError::Series { .. })));
}

/// All slices in one file, with functional groups.
fn enhanced(syntax: (&str, bool, bool), frames: usize) -> Vec<u8> {
    let mut maker = Maker::new(syntax.0, syntax.1, syntax.2);
    maker.text(0x0008_0060, b"CS", "MR").text(0x0010_0010, b"PN", "SECRET^NAME").text(0x0020_000e, b"UI", "1.2.3");
    sized(&mut maker);
    bits(&mut maker, 16, 0);
    maker.text(0x0028_0008, b"IS", &frames.to_string());
    let turn = oblique();
    maker.sequence(0x5200_9229, 1, |shared, _| {
        shared.sequence(0x0020_9116, 1, |m, _| {
            m.text(0x0020_0037, b"DS", &format!("{}\\{}", vector(turn.x_axis), vector(turn.y_axis)));
        });
        shared.sequence(0x0028_9110, 1, |m, _| {
            m.text(0x0028_0030, b"DS", "2.0\\0.5");
        });
        shared.sequence(0x0028_9145, 1, |m, _| {
            m.text(0x0028_1052, b"DS", "-1024").text(0x0028_1053, b"DS", "2");
        });
    });
    // Frames are stored from the top down.
    maker.sequence(0x5200_9230, frames, |m, n| {
        m.sequence(0x0020_9113, 1, |m, _| {
            m.text(0x0020_0032, b"DS", &vector(position(frames - 1 - n)));
        });
    });
    maker.head(0x7fe0_0010, b"OW", 24 * frames as u32);
    for n in (0..frames).rev() {
        (0..12).for_each(|pixel| {
            maker.u16(stored(n, pixel));
        });
    }
    maker.bytes
}

#[test]
fn enhanced_files_hold_a_volume_each() {
    for syntax in PLAIN {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("all");
        std::fs::write(&path, enhanced(syntax, 4)).unwrap();
        is_the_stack(&crate::read(&path).unwrap(), 4);
    }
}

#[test]
fn each_wrong_field_has_its_own_error() {
    let with = |change: &dyn Fn(&mut Slice)| {
        let bytes = enhanced(PLAIN[0], 3);
        let mut slice = Slice::parse(Path::new("a"), &bytes).unwrap().unwrap();
        change(&mut slice);
        let stack = stack::stack(Path::new("a"), &[&slice])?;
        pixels::frame(&slice, &bytes, 0, &mut Vec::new()).map(|_| stack.pictures.len())
    };
    assert_eq!(with(&|_| {}).unwrap(), 3);
    let field = |change: &dyn Fn(&mut Slice)| match with(change).unwrap_err() {
        ReadError::Field { field, .. } => field,
        other => panic!("{other}"),
    };
    assert_eq!(field(&|s| s.samples = 3), "SamplesPerPixel");
    assert_eq!(field(&|s| s.bits_allocated = 12), "BitsAllocated");
    assert_eq!(field(&|s| s.bits_stored = 17), "BitsStored");
    assert_eq!(field(&|s| s.orientation = None), "ImageOrientationPatient");
    assert_eq!(field(&|s| s.spacing = None), "PixelSpacing");
    assert_eq!(field(&|s| s.positions.truncate(2)), "ImagePositionPatient (for every frame)");
    assert_eq!(field(&|s| s.pixels = None), "PixelData");
    assert_eq!(
        field(&|s| {
            s.syntax = "1.2.840.10008.1.2.4.53".into();
            s.pixels = Some(Pixels::Fragments(vec![0..0, 0..4, 4..8, 8..12]));
        }),
        "TransferSyntaxUID"
    );
    assert!(matches!(with(&|s| s.rows = 9000), Err(ReadError::Truncated { what: "PixelData", .. })));
}

#[test]
fn no_patient_data_passes() {
    let folder = folder(0..3);
    let path = folder.path().join("3.dcm");
    let whole = std::fs::read(&path).unwrap();
    let mut output = format!("{:?} {:?}", import(folder.path()).unwrap().notes, series(folder.path()).unwrap());
    output += &format!("{:?}", Slice::parse(&path, &whole).unwrap());
    for length in (132..whole.len()).step_by(3) {
        std::fs::write(&path, &whole[..length]).unwrap();
        for result in [import(folder.path()), import(&path)] {
            output += &result.map_or_else(|e| format!("{e} {e:?}"), |i| format!("{:?}", i.notes));
        }
    }
    assert!(
        !output.contains("SECRET") && !output.contains("1950") && !output.contains("1999"),
        "a patient's data came through"
    );
}

#[test]
fn damaged_files_give_errors_and_no_panic() {
    let seeds = [enhanced(PLAIN[0], 3), enhanced(PLAIN[1], 2), enhanced(PLAIN[2], 2)];
    survives_mutations(&seeds, |bytes| {
        let file = Path::new("a");
        let nothing = || ReadError::Format { file: file.into(), found: "no picture".into(), readable: String::new() };
        let bytes = slice::inflated(file, bytes)?;
        let slice = Slice::parse(file, &bytes)?.ok_or_else(nothing)?;
        let stack = stack::stack(file, &[&slice])?;
        crate::source::check_affine(file, "affine", stack.world_from_voxel)?;
        let mut data = Vec::new();
        for picture in &stack.pictures {
            pixels::frame(&slice, &bytes, picture.frame, &mut data)?;
        }
        let dims = [slice.columns, slice.rows, stack.pictures.len()];
        Ok(Import::new(VoxelVolume { dims, data, world_from_voxel: stack.world_from_voxel }, Vec::new()))
    });
}

#[test]
fn run_lengths_unpack_to_exactly_the_pixels() {
    let mut packed: Vec<u8> = [1u32, 64].iter().flat_map(|v| v.to_le_bytes()).collect();
    packed.resize(64, 0);
    packed.extend([2, 7, 8, 9, 254, 5, 128, 0, 1]);
    assert_eq!(rle::decode(&packed, 7, 1).unwrap(), [7, 8, 9, 5, 5, 5, 1]);
    assert_eq!(rle::decode(&packed, 8, 1), Err(CodecError::Short(7)));
    assert!(matches!(rle::decode(&packed, 7, 2), Err(CodecError::Wrong(_))));
}

/// One slice uncompressed, as RLE, JPEG-LS and lossless JPEG 2000, and as 8-bit JPEG.
fn compressed() -> [Vec<u8>; 5] {
    [
        include_bytes!("../../../tests/data/MR_small.dcm").to_vec(),
        include_bytes!("../../../tests/data/MR_small_RLE.dcm").to_vec(),
        include_bytes!("../../../tests/data/MR_small_jpeg_ls_lossless.dcm").to_vec(),
        include_bytes!("../../../tests/data/MR_small_jp2klossless.dcm").to_vec(),
        include_bytes!("../../../tests/data/MR_small_jpeg_baseline.dcm").to_vec(),
    ]
}

/// Reads a single picture, ignoring its position.
fn one_picture(bytes: Vec<u8>) -> Result<Import, ReadError> {
    let file = Path::new("a");
    let nothing = || ReadError::Format { file: file.into(), found: "no picture".into(), readable: String::new() };
    let slice = Slice::parse(file, &bytes)?.ok_or_else(nothing)?;
    let mut data = Vec::new();
    pixels::frame(&slice, &bytes, 0, &mut data)?;
    let volume = VoxelVolume { dims: [slice.columns, slice.rows, 1], data, world_from_voxel: glam::DAffine3::IDENTITY };
    Ok(Import::new(volume, Vec::new()))
}

#[test]
fn a_real_slice_has_the_same_numbers_in_every_compression() {
    let [plain, others @ .., _] = compressed().map(|bytes| one_picture(bytes).unwrap().volume);
    let (low, high) = plain.data.iter().fold((f32::MAX, f32::MIN), |(l, h), &v| (l.min(v), h.max(v)));
    assert!(plain.dims == [64, 64, 1] && low >= 0.0 && high > 500.0, "{low} to {high}");
    for (n, other) in others.iter().enumerate() {
        assert!(*other == plain, "compression {n}");
    }
}

#[test]
fn a_jpeg_has_the_values_that_another_decoder_gives() {
    let [.., jpeg] = compressed();
    let truth = include_bytes!("../../../tests/data/MR_small_jpeg_baseline.u8");
    let found = one_picture(jpeg.clone()).unwrap().volume;
    let off = |(a, &b): (&f32, &u8)| (a - f32::from(b)).abs();
    let worst = found.data.iter().zip(truth).map(off).fold(0.0, f32::max);
    assert!(found.data.len() == truth.len() && worst <= 2.0, "off by up to {worst}");
    // The frame header (SOF0) with 12 bits instead of 8 is rejected.
    let mut extended = jpeg;
    let at = extended.windows(2).position(|w| w == [0xff, 0xc0]).unwrap();
    (extended[at + 1], extended[at + 4]) = (0xc1, 12);
    assert!(one_picture(extended).unwrap_err().to_string().contains("more than 8 bits"));
}

#[test]
fn damaged_compressed_pictures_give_errors_and_no_panic() {
    survives_mutations(&compressed(), one_picture);
}
