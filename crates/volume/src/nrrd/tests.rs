use super::*;
use crate::mutation::survives_mutations;
use glam::DQuat;
use trepan_geometry::Vec3;

fn ramp() -> VoxelVolume<i16> {
    let mut volume = VoxelVolume::isotropic([4, 3, 2], Vec3::ZERO, 1.0, 0i16);
    volume.data.iter_mut().enumerate().for_each(|(at, v)| *v = at as i16 - 5);
    volume
}

fn bytes(header: &str, voxels: &[u8]) -> Vec<u8> {
    [header.as_bytes(), voxels].concat()
}

fn little(volume: &VoxelVolume<i16>) -> Vec<u8> {
    volume.data.iter().flat_map(|v| v.to_le_bytes()).collect()
}

fn parsed(bytes: Vec<u8>) -> Result<Import, ReadError> {
    import_source(Source::of_bytes(Path::new("a.nrrd"), bytes), None)
}

const RAW: &str = "NRRD0004\n# made by hand\ntype: short\ndimension: 3\nspace: left-posterior-superior\nsizes: 4 3 2\n\
    space directions: (0,2,0) (1,0,0) (0,0,-3)\nendian: little\nencoding: raw\nspace origin: (10, 20, 30)\nkey:=value\n\n";

#[test]
fn directions_turn_from_the_files_space_into_ras() {
    let import = parsed(bytes(RAW, &little(&ramp()))).unwrap();
    let m = import.volume.world_from_voxel;
    assert_eq!(
        m.matrix3,
        DMat3::from_cols(DVec3::new(0.0, -2.0, 0.0), DVec3::new(-1.0, 0.0, 0.0), DVec3::new(0.0, 0.0, -3.0))
    );
    assert_eq!(m.translation, DVec3::new(-10.0, -20.0, 30.0));
    assert_eq!((import.volume.data[23], import.notes), (18.0, vec![]));
}

#[test]
fn text_big_endian_skips_and_single_further_axes_are_read() {
    let volume = ramp();
    let text: String = volume.data.iter().map(|v| format!("{v} ")).collect();
    let written =
        parsed(bytes(&RAW.replace("raw", "ascii").replace("endian: little\n", ""), text.as_bytes())).unwrap().volume;
    let big: Vec<u8> = volume.data.iter().flat_map(|v| v.to_be_bytes()).collect();
    assert_eq!(parsed(bytes(&RAW.replace("little", "big"), &big)).unwrap().volume, written);
    let skipped = RAW.replace("encoding", "line skip: 1\nbyte skip: 3\nencoding");
    assert_eq!(parsed(bytes(&skipped, &[b"a line\nabc", &little(&volume)[..]].concat())).unwrap().volume, written);
    let last = RAW.replace("encoding", "byte skip: -1\nencoding");
    assert_eq!(parsed(bytes(&last, &[b"rubbish", &little(&volume)[..]].concat())).unwrap().volume, written);
    let four =
        RAW.replace("dimension: 3", "dimension: 4").replace("sizes: 4", "sizes: 1 4").replace("(0,2", "none (0,2");
    assert_eq!(parsed(bytes(&four, &little(&volume))).unwrap().volume, written);
}

#[test]
fn volumes_are_read_by_number_wherever_their_axis_lies() {
    let twice = |first: bool| -> Vec<u8> {
        let at = |n: usize| if first { (n % 2, n / 2) } else { (n / 24, n % 24) };
        (0..48).map(at).flat_map(|(volume, voxel)| ((100 * volume + voxel) as i16).to_le_bytes()).collect()
    };
    let four = |sizes: &str| RAW.replace("dimension: 3", "dimension: 4").replace("sizes: 4 3 2", sizes);
    let list = four("sizes: 2 4 3 2").replace("(0,2", "none (0,2");
    let last = four("sizes: 4 3 2 2").replace("-3)", "-3) none");
    let kinds =
        four("sizes: 2 4 3 2").replace("space directions: (0,2,0) (1,0,0) (0,0,-3)", "kinds: vector space space space");
    let time = four("sizes: 4 3 2 2")
        .replace("superior", "superior-time")
        .replace("(0,2,0) (1,0,0) (0,0,-3)", "(0,2,0,0) (1,0,0,0) (0,0,-3,0) (0,0,0,1)");
    for (header, first) in [(list, true), (last, false), (kinds, true), (time, false)] {
        let file = bytes(&header, &twice(first));
        for number in 0..2 {
            let import = import_source(Source::of_bytes(Path::new("a.nrrd"), file.clone()), Some(number)).unwrap();
            let expected: Vec<f32> = (0..24).map(|voxel| (100 * number + voxel) as f32).collect();
            assert_eq!(import.volume.data, expected, "{header}");
            assert_eq!(import.volume.dims, [4, 3, 2]);
        }
        let unchosen = parsed(file.clone()).unwrap_err().to_string();
        assert!(unchosen.contains("2 volumes") && unchosen.contains("--ct-series N"), "{unchosen}");
        assert!(import_source(Source::of_bytes(Path::new("a.nrrd"), file), Some(2)).is_err());
    }
}

#[test]
fn sizes_along_the_axes_follow_the_definition() {
    let of = |fields: &str| {
        let header = "NRRD0005\ntype: short\ndimension: 3\nsizes: 4 3 2\nendian: little\nencoding: raw\n";
        parsed(bytes(&format!("{header}{fields}\n\n"), &little(&ramp()))).unwrap()
    };
    let (mins, maxs) = ("axis mins: 10 20 30", "axis maxs: 18 29 38");
    for (fields, edges, first) in [
        (format!("{mins}\n{maxs}\ncenters: cell cell cell"), [2.0, 3.0, 4.0], [11.0, 21.5, 32.0]),
        (format!("{mins}\n{maxs}"), [2.0, 3.0, 4.0], [11.0, 21.5, 32.0]),
        (format!("{mins}\naxis maxs: 16 26 34\ncenterings: node node node"), [2.0, 3.0, 4.0], [10.0, 20.0, 30.0]),
        (format!("spacings: 2 3 4\n{mins}"), [2.0, 3.0, 4.0], [11.0, 21.5, 32.0]),
        (format!("spacings: 2 3 4\n{mins}\n{maxs}\ncenters: node ??? cell"), [2.0, 3.0, 4.0], [10.0, 21.5, 32.0]),
        ("spacings: .2 .3 .4\nunits: \"cm\" \"cm\" \"cm\"".into(), [2.0, 3.0, 4.0], [0.0; 3]),
        ("spacings: 2 3 4\nthicknesses: 5 5 5".into(), [2.0, 3.0, 4.0], [0.0; 3]),
        ("thicknesses: 5 5 5".into(), [1.0; 3], [0.0; 3]),
    ] {
        let import = of(&fields);
        let affine = import.volume.world_from_voxel;
        assert!(affine.matrix3.abs_diff_eq(DMat3::from_diagonal(DVec3::from_array(edges)), 1e-9), "{fields}: {affine}");
        assert!(affine.translation.abs_diff_eq(DVec3::from_array(first), 1e-9), "{fields}: {affine}");
        let sizeless = import.notes.iter().any(|note| matches!(note, Note::Unusual { field: "spacings", .. }));
        assert_eq!(sizeless, edges == [1.0; 3], "{fields}");
    }
}

#[test]
fn space_units_become_millimetres() {
    let of = |unit: &str| {
        let header = RAW.replace("encoding", &format!("space units: \"{unit}\" \"{unit}\" \"{unit}\"\nencoding"));
        parsed(bytes(&header, &little(&ramp()))).unwrap()
    };
    let edge = |unit| of(unit).volume.spacing_mm().x;
    let found = ["mm", "cm", "\u{b5}m", "microns", "um", "millimeters", ""].map(edge);
    assert_eq!(found, [2.0, 20.0, 2e-3, 2e-3, 2e-3, 2.0, 2.0]);
    assert!(matches!(of("pixel").notes[..], [Note::Unusual { field: "space units", .. }, ..]));
    let of_space = RAW.replace("space: left-posterior-superior", "space dimension: 3");
    let import = parsed(bytes(&of_space, &little(&ramp()))).unwrap();
    assert_eq!(import.notes, [Note::NoOrientation { field: "no space" }]);
    assert_eq!(import.volume.world_from_voxel.translation, DVec3::new(10.0, 20.0, 30.0));
}

/// A segmentation of two layers, of which the first has two segments.
fn layered() -> Vec<u8> {
    let fields = "Segment0_Name:=skull\nSegment0_LabelValue:=1\nSegment0_Layer:=0\nSegment1_ID:=Segment_2\n\
        Segment1_LabelValue:=2\nSegment1_Layer:=0\nSegment2_Name:=brain\nSegment2_LabelValue:=7\nSegment2_Layer:=1\n\n";
    let header = RAW.replace("dimension: 3", "dimension: 4").replace("sizes: 4", "sizes: 2 4");
    let header = header.replace("(0,2", "none (0,2").replace("short", "uchar").replace("key:=value\n\n", fields);
    bytes(&header, &(0..48u8).map(|at| if at % 2 == 0 { at / 2 % 3 } else { 7 }).collect::<Vec<_>>())
}

#[test]
fn layers_of_a_segmentation_are_read_with_their_names() {
    use crate::{Segment, Segmentation};
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.seg.nrrd");
    let read_as = |bytes: Vec<u8>| {
        std::fs::write(&path, bytes).unwrap();
        Segmentation::read(&path)
    };
    let found = read_as(layered()).unwrap();
    let segment = |name: &str, layer, value| Segment { name: name.into(), layer, value };
    assert_eq!(found.segments, [segment("skull", 0, 1), segment("Segment_2", 0, 2), segment("brain", 1, 7)]);
    assert_eq!(found.layers.iter().map(|layer| layer.data[..3].to_vec()).collect::<Vec<_>>(), [[0, 1, 2], [7, 7, 7]]);
    let image = crate::import(&path).unwrap_err().to_string();
    assert!(image.contains("3D Slicer segmentation") && image.contains("--tissue CLASS=PATH:NAME"), "{image}");
    let older: String = String::from_utf8_lossy(&layered())
        .lines()
        .filter(|line| !line.contains("_L") && !line.contains("Segment2"))
        .map(|line| format!("{line}\n"))
        .collect();
    let older = read_as(older.into_bytes()).unwrap().segments;
    assert_eq!(older, [segment("skull", 0, 1), segment("Segment_2", 1, 1)]);
    for (from, to) in [("Layer:=1", "Layer:=2"), ("Value:=7", "Value:=70000"), ("Value:=7", "Value:=x")] {
        let broken = String::from_utf8_lossy(&layered()).replace(from, to).into_bytes();
        assert!(matches!(read_as(broken), Err(ReadError::Field { .. })), "{to}");
    }
    let half = RAW.replace("short", "float");
    let values: Vec<u8> = (0..24).flat_map(|v| (v as f32 / 2.0).to_le_bytes()).collect();
    assert!(read_as(bytes(&half, &values)).unwrap_err().to_string().contains("whole numbers"));
}

#[test]
fn a_detached_header_finds_its_voxels_beside_it() {
    let folder = tempfile::tempdir().unwrap();
    let header = folder.path().join("a.nhdr");
    std::fs::write(&header, RAW.replace("encoding", "data file: voxels.raw\nencoding")).unwrap();
    let missing = read(&header).unwrap_err();
    assert!(matches!(missing, ReadError::Missing { .. }), "{missing}");
    std::fs::write(folder.path().join("voxels.raw"), little(&ramp())).unwrap();
    assert_eq!(read(&header).unwrap(), parsed(bytes(RAW, &little(&ramp()))).unwrap().volume);
}

#[test]
fn written_volumes_round_trip_exactly() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.nrrd");
    let turn = DMat3::from_quat(DQuat::from_scaled_axis(DVec3::new(0.3, -1.0, 0.7)));
    let affine = DAffine3 {
        matrix3: turn * DMat3::from_diagonal(DVec3::new(0.451171875, 1.0 / 3.0, 2.3708)),
        translation: DVec3::new(0.1, -99.0 / 7.0, 1e-7),
    };
    let volume = VoxelVolume { world_from_voxel: affine, ..ramp() };
    write(&path, &volume).unwrap();
    let back = import(&path).unwrap();
    assert_eq!((back.volume, back.notes), (volume.map(f32::from), vec![]));
    assert!(matches!(write(&folder.path().join("a.nii"), &volume), Err(crate::WriteError::Name { .. })));
}

#[test]
fn each_wrong_field_has_its_own_error() {
    let voxels = little(&ramp());
    let wrong = |from: &str, to: &str| parsed(bytes(&RAW.replace(from, to), &voxels)).unwrap_err();
    for (from, to, field) in [
        ("NRRD0004", "NRRX0004", "magic"),
        ("short", "block", "type"),
        ("little", "middle", "endian"),
        ("raw", "bzip2", "encoding"),
        ("dimension: 3", "dimension: 4", "dimension"),
        ("left-posterior-superior", "sideways", "space"),
        ("(0,2,0)", "(0,x,0)", "space directions"),
        ("(10, 20, 30)", "(10, 20)", "space origin"),
        ("sizes", "seizes", "sizes"),
        ("encoding", "data file: LIST\nencoding", "data file"),
    ] {
        let error = wrong(from, to);
        assert!(matches!(&error, ReadError::Field { field: f, .. } if *f == field), "{to}: {error}");
    }
    assert!(matches!(wrong("4 3 2", "4 0 2"), ReadError::Dimensions { .. }));
    assert!(matches!(wrong("4 3 2", "400000 300000 200000"), ReadError::TooLarge { .. }));
    assert!(matches!(wrong("4 3 2", "4 3 3"), ReadError::Truncated { .. }));
    assert!(matches!(wrong("(0,2,0)", "(0,0,0)"), ReadError::Spacing { .. }));
    assert!(matches!(wrong("(0,2,0)", "(nan,2,0)"), ReadError::Spacing { .. }));
    assert!(matches!(wrong("(0,2,0)", "(1,0,0)"), ReadError::Orientation { .. }));
}

#[test]
fn damaged_files_give_errors_and_no_panic() {
    let volume = ramp();
    let folder = tempfile::tempdir().unwrap();
    let packed = folder.path().join("a.nrrd");
    write(&packed, &volume).unwrap();
    let text: String = volume.data.iter().map(|v| format!("{v}\n")).collect();
    let seeds = [
        bytes(RAW, &little(&volume)),
        std::fs::read(packed).unwrap(),
        bytes(&RAW.replace("raw", "text"), text.as_bytes()),
    ];
    survives_mutations(&seeds, parsed);
    survives_mutations(&[layered()], |bytes| {
        let source = || Source::of_bytes(Path::new("a.nrrd"), bytes.clone());
        let (layers, segments) = segments::of_source(&mut source())?;
        assert!(segments.iter().all(|segment| segment.layer < layers));
        import_source(source(), Some(layers - 1))
    });
}
