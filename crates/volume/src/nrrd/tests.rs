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
    import_source(Source::of_bytes(Path::new("a.nrrd"), bytes))
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
    let several = four.replace("sizes: 1", "sizes: 2");
    assert!(matches!(parsed(bytes(&several, &[0; 96])), Err(ReadError::Volumes { found: 2, .. })));
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
}
