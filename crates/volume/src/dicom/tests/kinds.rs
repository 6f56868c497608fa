//! Kinds of files that hospitals have: rounded, padded, repeated, of several phases; segmentations.

use super::*;

/// Writes pictures after a change of their bytes' elements; returns the folder.
fn changed(count: usize, change: impl Fn(usize, &mut Maker)) -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    for n in 0..count {
        let mut maker = Maker::new(PLAIN[0].0, true, false);
        described(&mut maker, "1", n, position(n));
        change(n, &mut maker);
        maker.head(0x7fe0_0010, b"OW", 24);
        (0..12).for_each(|pixel| {
            maker.u16(stored(n, pixel));
        });
        std::fs::write(folder.path().join(format!("{n:03}")), maker.bytes).unwrap();
    }
    folder
}

/// Replaces the value of a DS element by one of the same length.
fn replaced(maker: &mut Maker, from: &str, to: &str) {
    assert_eq!(from.len(), to.len());
    let at = maker.bytes.windows(from.len()).position(|w| w == from.as_bytes()).unwrap();
    maker.bytes[at..at + to.len()].copy_from_slice(to.as_bytes());
}

#[test]
fn a_rescale_that_is_lost_in_some_pictures_is_an_error_that_names_one() {
    let folder = changed(6, |n, maker| {
        if n == 4 {
            let at = maker.bytes.len() - (8 + 6) - (8 + 2);
            maker.bytes.truncate(at);
        }
    });
    let error = import(folder.path()).unwrap_err().to_string();
    assert!(error.contains("004: Rescale") && error.contains("1 of 6"), "{error}");
}

#[test]
fn edges_that_differ_in_their_last_digit_are_one_series() {
    let folder = changed(6, |n, maker| {
        if n < 3 {
            replaced(maker, "2.0\\0.5", "2.0\\.5 ")
        }
    });
    is_the_stack(&read(folder.path()).unwrap(), 6);
    let other = changed(6, |n, maker| {
        if n < 2 {
            replaced(maker, "2.0\\0.5", "2.0\\0.6")
        }
    });
    let import = import(other.path()).unwrap();
    assert!(import.notes.contains(&Note::PartOfSeries { chosen: 4, all: 6 }), "{:?}", import.notes);
}

#[test]
fn decimal_commas_one_edge_and_rounded_directions_are_read() {
    let comma = changed(4, |_, maker| replaced(maker, "2.0\\0.5", "2,0\\0,5"));
    is_the_stack(&read(comma.path()).unwrap(), 4);
    let one = changed(4, |_, maker| replaced(maker, "2.0\\0.5", "2.0    "));
    assert!((read(one.path()).unwrap().spacing_mm() - DVec3::new(2.0, 2.0, 1.25)).length() < 1e-6);
    let [x, y] = [oblique().x_axis, oblique().y_axis];
    let long = format!("{}\\{}", vector(x), vector(y));
    let short = format!("{:.2}\\{:.2}\\{:.2}\\{:.2}\\{:.2}\\{:.2}", x.x, x.y, x.z, y.x, y.y, y.z);
    let rounded = changed(4, |_, maker| replaced(maker, &long, &format!("{short:width$}", width = long.len())));
    let m = read(rounded.path()).unwrap().world_from_voxel.matrix3;
    assert!((m.x_axis.length() - 0.5).abs() < 1e-9 && m.x_axis.dot(m.y_axis).abs() < 1e-9);
    let bad = changed(4, |_, maker| replaced(maker, &vector(x), &vector(1.5 * x)[..vector(x).len()]));
    let error = import(bad.path()).unwrap_err().to_string();
    assert!(error.contains("ImageOrientationPatient is ") && error.contains("length 1"), "{error}");
}

#[test]
fn positions_rounded_to_a_digit_are_even() {
    let heights = |digits: usize| -> Vec<f64> {
        (0..40).map(|n| format!("{:.digits$}", 0.625 * f64::from(n)).parse().unwrap()).collect()
    };
    let stack = |heights: &[f64], decimals| {
        let upright = Some([DVec3::X, DVec3::Y]);
        let slice = |&z: &f64| Slice {
            orientation: upright,
            spacing: Some([1.0; 2]),
            frames: 1,
            positions: vec![DVec3::Z * z],
            decimals,
            ..Slice::default()
        };
        let slices: Vec<Slice> = heights.iter().map(slice).collect();
        stack::stack(Path::new("a"), &slices.iter().collect::<Vec<_>>()).map(|stack| stack.notes)
    };
    assert!(matches!(stack(&heights(1), 1).unwrap()[..], [Note::Rounded { by_mm }] if by_mm < 0.0501));
    assert!(stack(&heights(1), 2).is_err(), "written to a hundredth, a twentieth is uneven");
    assert!(stack(&heights(3), 3).unwrap().is_empty());
    let mut missing = heights(1);
    missing.remove(20);
    assert!(stack(&missing, 1).is_err(), "a missing slice is no rounding");
}

#[test]
fn pictures_that_share_an_identifier_or_a_place_are_told_apart() {
    let one = changed(5, |n, maker| replaced(maker, &format!("1.2.3.1.{n}"), "1.2.3.1.0"));
    is_the_stack(&read(one.path()).unwrap(), 5);
    // Two echoes, then two phases, of one series at the same places.
    for (tag, vr) in [(0x0018_0081, b"DS"), (0x0020_0012, b"IS"), (0x0020_0100, b"IS"), (0x0008_0008, b"CS")] {
        let folder = tempfile::tempdir().unwrap();
        for (file, n) in (0..4).flat_map(|n| [(2 * n, n), (2 * n + 1, n)]) {
            let mut maker = Maker::new(PLAIN[0].0, true, false);
            maker.text(tag, vr, if file % 2 == 0 { "1" } else { "2" });
            described(&mut maker, "1", file, position(n));
            maker.head(0x7fe0_0010, b"OW", 24);
            (0..12).for_each(|pixel| {
                maker.u16(stored(n, pixel));
            });
            std::fs::write(folder.path().join(format!("{file}")), maker.bytes).unwrap();
        }
        assert_eq!(
            series(folder.path()).unwrap().iter().map(|s| (s.slices, s.places)).collect::<Vec<_>>(),
            [(4, 4); 2]
        );
        let import = import(folder.path()).unwrap();
        is_the_stack(&import.volume, 4);
        assert!(import.notes.contains(&Note::PartOfSeries { chosen: 4, all: 8 }), "{:?}", import.notes);
    }
}

#[test]
fn padding_is_air() {
    let folder = changed(3, |_, maker| {
        maker.short(0x0028_0120, 5).short(0x0028_0121, 3);
        bits(maker, 16, 0);
        maker.text(0x0028_1052, b"DS", "-3000");
    });
    let import = import(folder.path()).unwrap();
    assert!(import.notes.contains(&Note::Padded { voxels: 3 }), "{:?}", import.notes);
    let beyond = changed(3, |n, maker| {
        maker.short(0x0028_0120, 63536);
        if n == 1 {
            maker.text(0x0028_1052, b"DS", "-1000");
        }
    });
    let first = std::fs::read(beyond.path().join("000")).unwrap();
    let patched: Vec<u8> = first[..first.len() - 2].iter().copied().chain(63536u16.to_le_bytes()).collect();
    std::fs::write(beyond.path().join("000"), patched).unwrap();
    assert_eq!(read(beyond.path()).unwrap().data[11], -1024.0, "wider than the stored 12 bits");
    let expected = |pixel: u16| if (3..=5).contains(&pixel) { -1024.0 } else { 2.0 * f32::from(pixel) - 1024.0 };
    assert_eq!(import.volume.data[..3], [0, 1, 2].map(expected));
}

#[test]
fn the_technical_words_of_a_description_are_shown_and_no_others() {
    let folder = changed(3, |_, maker| {
        maker.text(0x0018_1030, b"LO", "T1 MPRAGE for Mr SECRET");
    });
    let list = series(folder.path()).unwrap();
    assert_eq!(list[0].description, "t1 mprage mr");
    assert!(
        list[0].to_string().contains("3 slices of 4x3 at 3 places, 0.500 x 2.000 x 1.250 mm, axial"),
        "{}",
        list[0]
    );
}

#[test]
fn frames_of_several_orientations_are_refused() {
    let mut bytes = enhanced(PLAIN[0], 3);
    let other = {
        let mut maker = Maker { bytes: Vec::new(), explicit: true, big: false };
        maker.sequence(0x0020_9116, 1, |m, _| {
            m.text(0x0020_0037, b"DS", "1\\0\\0\\0\\1\\0");
        });
        maker.bytes
    };
    // Into the item of the first frame.
    let mark = [0x20, 0x00, 0x13, 0x91];
    let at = bytes.windows(4).position(|w| w == mark).unwrap();
    bytes.splice(at..at, other);
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("all"), bytes).unwrap();
    let error = import(&folder.path().join("all")).unwrap_err().to_string();
    assert!(error.contains("different between frames"), "{error}");
}

/// A binary segmentation of two segments that overlap in one voxel, and a third apart.
fn segmentation_file() -> Vec<u8> {
    let mut maker = Maker::new(PLAIN[0].0, true, false);
    maker.text(0x0008_0060, b"CS", "SEG").text(0x0020_000e, b"UI", "1.2.9");
    sized(&mut maker);
    maker.short(0x0028_0100, 1).short(0x0028_0101, 1).short(0x0028_0102, 0).short(0x0028_0103, 0);
    maker.text(0x0028_0008, b"IS", "4");
    maker.sequence(0x0062_0002, 3, |m, n| {
        m.short(0x0062_0004, n as u16 + 1).text(0x0062_0005, b"LO", ["tumour", "oedema", "vessel"][n]);
    });
    maker.sequence(0x5200_9229, 1, |shared, _| {
        shared.sequence(0x0020_9116, 1, |m, _| {
            m.text(0x0020_0037, b"DS", "1\\0\\0\\0\\1\\0");
        });
        shared.sequence(0x0028_9110, 1, |m, _| {
            m.text(0x0028_0030, b"DS", "2\\2");
        });
    });
    maker.sequence(0x5200_9230, 4, |m, n| {
        m.sequence(0x0020_9113, 1, |m, _| {
            m.text(0x0020_0032, b"DS", &format!("0\\0\\{}", [0, 6, 0, 2][n]));
        });
        m.sequence(0x0062_000a, 1, |m, _| {
            m.short(0x0062_000b, [1, 1, 2, 3][n]);
        });
    });
    // Twelve bits a frame: voxels 0, 1; 11; 1, 2; 5.
    let mut bits = [false; 48];
    [0, 1, 12 + 11, 24 + 1, 24 + 2, 36 + 5].iter().for_each(|&at| bits[at] = true);
    let packed: Vec<u8> = bits.chunks(8).map(|b| b.iter().rev().fold(0, |v, &bit| v << 1 | u8::from(bit))).collect();
    maker.head(0x7fe0_0010, b"OB", packed.len() as u32);
    maker.bytes.extend(packed);
    maker.bytes
}

#[test]
fn a_segmentation_has_named_segments_in_layers() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("seg");
    std::fs::write(&path, segmentation_file()).unwrap();
    let read = Segmentation::read(&path).unwrap();
    let segments: Vec<_> = read.segments.iter().map(|s| (s.name.as_str(), s.layer, s.value)).collect();
    assert_eq!(segments, [("tumour", 0, 1), ("oedema", 1, 2), ("vessel", 0, 3)]);
    assert_eq!((read.layers[0].dims, read.layers[0].spacing_mm()), ([4, 3, 4], DVec3::splat(2.0)));
    let held = |layer: usize, value| {
        let data = read.layers[layer].data.iter().enumerate();
        data.filter(|(_, v)| **v == value).map(|(at, _)| at).collect::<Vec<_>>()
    };
    assert_eq!((held(0, 1), held(1, 2), held(0, 3)), (vec![0, 1, 36 + 11], vec![1, 2], vec![12 + 5]));
    let error = crate::import(&path).unwrap_err().to_string();
    assert!(error.contains("--tissue CLASS=PATH:NAME"), "{error}");
}

#[test]
fn a_damaged_segmentation_gives_errors_and_no_panic() {
    survives_mutations(&[segmentation_file()], |bytes| {
        let file = Path::new("a");
        let nothing = || ReadError::Format { file: file.into(), found: "no picture".into(), readable: String::new() };
        let slice = Slice::parse(file, &bytes)?.ok_or_else(nothing)?;
        let read = segments::read(&slice, &bytes)?;
        Ok(Import::new(read.mask(|_, value| value > 0).map(f32::from), Vec::new()))
    });
}

#[test]
fn a_lossy_jpeg_2000_keeps_its_air() {
    // Air at 0 around a ball of 2000 in 12 bits, written by OpenJPEG at 43 dB.
    let stream = include_bytes!("../../../tests/data/ball_lossy.j2k");
    let stored = codec::jpeg_2000::decode(stream, (64, 64)).unwrap();
    let air = (0..64 * 64).filter(|at| (at % 64 - 32i32).pow(2) + (at / 64 - 32i32).pow(2) > 28 * 28);
    let most = air.map(|at| stored[at as usize]).max().unwrap();
    assert!(most < 200, "air is read as {most}");
    assert!(stored[32 * 64 + 32].abs_diff(2000) < 100);
}
