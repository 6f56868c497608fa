use super::*;
use crate::mutation::survives_mutations;
use std::io::Write;

/// A file of 4x3x2 voxels 0, 1, 2, … in `frames` frames, with axes right-handed and oblique.
fn file(kind: i32, frames: i32, one: impl Fn(i32) -> Vec<u8>) -> Vec<u8> {
    let mut bytes: Vec<u8> = [1, 4, 3, 2, frames, kind, 0].iter().flat_map(|v: &i32| v.to_be_bytes()).collect();
    bytes.extend([0, 1]);
    let numbers = [0.5f32, 2.0, 3.0, 0.0, 1.0, 0.0, -1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 10.0, 20.0, 30.0];
    bytes.extend(numbers.iter().flat_map(|v| v.to_be_bytes()));
    bytes.resize(284, 0);
    bytes.extend((0..24 * frames).flat_map(one));
    bytes.extend([0x41; 20]);
    bytes
}

fn parsed(bytes: Vec<u8>, frame: Option<usize>) -> Result<Import, ReadError> {
    import_source(Source::of_bytes(Path::new("a.mgz"), bytes), frame)
}

fn shorts(frames: i32) -> Vec<u8> {
    file(4, frames, |v| (v as i16).to_be_bytes().into())
}

fn gzip(bytes: &[u8]) -> Vec<u8> {
    let mut gzip = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::default());
    gzip.write_all(bytes).unwrap();
    gzip.finish().unwrap()
}

#[test]
fn every_type_is_read_plain_and_packed() {
    let expected: Vec<f32> = (0..24).map(|v| v as f32).collect();
    let files = [
        file(0, 1, |v| vec![v as u8]),
        file(1, 1, |v| v.to_be_bytes().into()),
        file(3, 1, |v| (v as f32).to_be_bytes().into()),
        shorts(1),
        file(10, 1, |v| (v as u16).to_be_bytes().into()),
    ];
    for bytes in files {
        for bytes in [gzip(&bytes), bytes] {
            let import = parsed(bytes, None).unwrap();
            assert_eq!((import.volume.data, import.notes), (expected.clone(), vec![]));
        }
    }
}

/// The first numbers are those of nibabel 5.4.2; without the flag it turns y and z round.
#[test]
fn the_affine_is_that_of_nibabel() {
    let affine = parsed(shorts(1), None).unwrap().volume.world_from_voxel;
    let m = DMat3::from_cols(DVec3::new(0.0, 0.5, 0.0), DVec3::new(-2.0, 0.0, 0.0), DVec3::new(0.0, 0.0, 3.0));
    assert_eq!((affine.matrix3, affine.translation), (m, DVec3::new(13.0, 19.0, 27.0)));
    let mut no_flag = shorts(1);
    no_flag[29] = 0;
    let import = parsed(no_flag, None).unwrap();
    let affine = import.volume.world_from_voxel;
    assert_eq!((affine.matrix3, affine.translation), (DEFAULT, DVec3::new(2.0, -1.0, 1.5)));
    assert!(matches!(import.notes[..], [Note::Unusual { .. }, Note::NoOrientation { .. }]));
}

#[test]
fn frames_are_read_by_number() {
    assert!(matches!(parsed(shorts(3), None), Err(ReadError::Volumes { found: 3, .. })));
    assert_eq!(parsed(shorts(3), Some(2)).unwrap().volume.data[0], 48.0);
    assert!(parsed(shorts(3), Some(3)).is_err());
}

#[test]
fn each_wrong_field_has_its_own_error() {
    let wrong = |at: usize, value: i32| {
        let mut bytes = shorts(1);
        bytes[at..at + 4].copy_from_slice(&value.to_be_bytes());
        parsed(bytes, None).unwrap_err()
    };
    for (at, value, field) in [(0, 2, "version"), (16, 0, "nframes"), (20, 2, "type"), (20, -1, "type")] {
        let error = wrong(at, value);
        assert!(matches!(&error, ReadError::Field { field: f, .. } if *f == field), "{error}");
    }
    assert!(matches!(wrong(4, -4), ReadError::Dimensions { .. }));
    assert!(matches!(wrong(4, 40), ReadError::Truncated { .. }));
    assert!(matches!(wrong(30, 0), ReadError::Spacing { .. }));
    let path = tempfile::NamedTempFile::new().unwrap();
    std::fs::write(&path, gzip(&shorts(1))).unwrap();
    assert_eq!(crate::import(path.path()).unwrap().facts[0], ("format", FORMAT.name.into()));
}

#[test]
fn damaged_files_give_errors_and_no_panic() {
    survives_mutations(&[shorts(1), gzip(&shorts(1))], |bytes| parsed(bytes, None));
}
