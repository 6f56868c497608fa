//! Tests the NIfTI reader with valid and invalid files built byte by byte.

#![expect(clippy::unwrap_used, reason = "a test that cannot make its files should fail")]

use glam::{DAffine3, DMat3, DVec3};
use std::io::Write;
use std::path::{Path, PathBuf};
use trepan_volume::{Import, Note, ReadError, VoxelVolume, WriteError, import_number, nifti, read, write_beside};

/// A NIfTI-1 file with i16 voxels 0, 1, 2, … whose fields can be overwritten.
#[derive(Clone)]
struct File1 {
    bytes: Vec<u8>,
    big: bool,
}

impl File1 {
    fn new(dims: [i16; 3], big: bool) -> Self {
        let mut file = Self { bytes: vec![0; 352], big };
        file.put(0, 348i32.to_be_bytes());
        for (n, size) in [3, dims[0], dims[1], dims[2], 1, 1, 1, 1].into_iter().enumerate() {
            file.put(40 + 2 * n, size.to_be_bytes());
        }
        file.i16(70, 4).i16(72, 16).f32(108, 352.0).f32(112, 1.0);
        for (n, size) in [1.0, 1.0, 2.0, 9.25f32.sqrt()].into_iter().enumerate() {
            file.f32(76 + 4 * n, size);
        }
        file.i16(254, 1).srow([[-1.0, 0.0, 0.0, 9.0], [0.0, 2.0, 0.5, -4.0], [0.0, 0.0, 3.0, 7.0]]);
        file.bytes[344..348].copy_from_slice(b"n+1\0");
        for value in 0..dims.iter().map(|&n| n.max(1) as usize).product::<usize>().min(1000) {
            let raw = value as i16;
            file.bytes.extend(if big { raw.to_be_bytes() } else { raw.to_le_bytes() });
        }
        file
    }

    fn put<const N: usize>(&mut self, at: usize, mut big_endian: [u8; N]) -> &mut Self {
        if !self.big {
            big_endian.reverse();
        }
        self.bytes[at..at + N].copy_from_slice(&big_endian);
        self
    }

    fn i16(&mut self, at: usize, value: i16) -> &mut Self {
        self.put(at, value.to_be_bytes())
    }

    fn f32(&mut self, at: usize, value: f32) -> &mut Self {
        self.put(at, value.to_be_bytes())
    }

    fn srow(&mut self, rows: [[f32; 4]; 3]) -> &mut Self {
        for (n, value) in rows.into_iter().flatten().enumerate() {
            self.f32(280 + 4 * n, value);
        }
        self
    }

    /// Sets the form codes, the edges and a qform of identity with offset (1, 2, 3).
    fn forms(&mut self, sform: i16, qform: i16, edges: [f32; 3]) -> &mut Self {
        self.i16(254, sform).i16(252, qform).f32(268, 1.0).f32(272, 2.0).f32(276, 3.0);
        for (n, edge) in edges.into_iter().enumerate() {
            self.f32(80 + 4 * n, edge);
        }
        self
    }

    fn import(&self) -> Result<Import, ReadError> {
        let folder = tempfile::tempdir().unwrap();
        nifti::import(&saved(folder.path(), "a.nii", &self.bytes))
    }

    fn read(&self) -> Result<VoxelVolume<f32>, ReadError> {
        read_bytes("a.nii", &self.bytes)
    }
}

fn read_bytes(name: &str, bytes: &[u8]) -> Result<VoxelVolume<f32>, ReadError> {
    let folder = tempfile::tempdir().unwrap();
    read(&saved(folder.path(), name, bytes))
}

fn saved(folder: &Path, name: &str, bytes: &[u8]) -> PathBuf {
    let path = folder.join(name);
    std::fs::write(&path, bytes).unwrap();
    path
}

fn gzipped(bytes: &[u8]) -> Vec<u8> {
    let mut gzip = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::default());
    gzip.write_all(bytes).unwrap();
    gzip.finish().unwrap()
}

fn sheared() -> DAffine3 {
    let matrix3 = DMat3::from_cols(DVec3::new(-1.0, 0.0, 0.0), DVec3::new(0.0, 2.0, 0.0), DVec3::new(0.0, 0.5, 3.0));
    DAffine3 { matrix3, translation: DVec3::new(9.0, -4.0, 7.0) }
}

#[test]
fn both_byte_orders_plain_and_gzip_under_any_name_are_the_same_volume() {
    for big in [false, true] {
        let file = File1::new([4, 3, 2], big);
        for (name, bytes) in
            [("a.nii", file.bytes.clone()), ("a.nii.gz", gzipped(&file.bytes)), ("b", gzipped(&file.bytes))]
        {
            let volume = read_bytes(name, &bytes).unwrap();
            assert_eq!(volume.dims, [4, 3, 2]);
            assert_eq!(volume.data, (0..24).map(|v| v as f32).collect::<Vec<_>>());
            assert_eq!(volume.world_from_voxel, sheared());
        }
    }
}

#[test]
fn version_2_in_both_byte_orders() {
    for big in [false, true] {
        let mut bytes = vec![0; 544];
        let mut put = |at: usize, mut raw: [u8; 8]| {
            if !big {
                raw.reverse();
            }
            bytes[at..at + 8].copy_from_slice(&raw);
        };
        for (n, size) in [3i64, 2, 2, 3, 1, 1, 1, 1].into_iter().enumerate() {
            put(16 + 8 * n, size.to_be_bytes());
        }
        [1.0f64, 1.0, 2.0, 3.0].iter().enumerate().for_each(|(n, v)| put(104 + 8 * n, v.to_be_bytes()));
        put(168, 544i64.to_be_bytes());
        put(176, 0.5f64.to_be_bytes());
        put(184, (-10.0f64).to_be_bytes());
        put(344, ((1i64) & 0xffff).to_be_bytes());
        let rows = [[-1.0f64, 0.0, 0.0, 9.0], [0.0, 2.0, 0.5, -4.0], [0.0, 0.0, 3.0, 7.0]];
        rows.iter().flatten().enumerate().for_each(|(n, v)| put(400 + 8 * n, v.to_be_bytes()));
        let word = |v: i32| if big { v.to_be_bytes() } else { v.to_le_bytes() };
        let half = |v: i16| if big { v.to_be_bytes() } else { v.to_le_bytes() };
        bytes[0..4].copy_from_slice(&word(540));
        bytes[4..12].copy_from_slice(b"n+2\0\r\n\x1a\n");
        bytes[12..14].copy_from_slice(&half(64));
        bytes[14..16].copy_from_slice(&half(64));
        bytes[344..348].copy_from_slice(&word(0));
        bytes[348..352].copy_from_slice(&word(1));
        for value in 0..12 {
            let value = f64::from(value);
            bytes.extend(if big { value.to_be_bytes() } else { value.to_le_bytes() });
        }
        let volume = read_bytes("a.nii", &bytes).unwrap();
        assert_eq!(volume.data[..3], [-10.0, -9.5, -9.0]);
        assert_eq!(volume.world_from_voxel, sheared());
        bytes[8] = b'\n';
        assert!(read_bytes("a.nii", &bytes).unwrap_err().to_string().contains("transferred as text"));
    }
}

#[test]
fn every_number_type_is_read() {
    let types: [(i16, i16, &[u8], f32); 10] = [
        (2, 8, &[200], 200.0),
        (256, 8, &[0x9c], -100.0),
        (4, 16, &(-875i16).to_le_bytes(), -875.0),
        (512, 16, &60000u16.to_le_bytes(), 60000.0),
        (8, 32, &(-70000i32).to_le_bytes(), -70000.0),
        (768, 32, &3_000_000_000u32.to_le_bytes(), 3e9),
        (1024, 64, &(-5_000_000_000i64).to_le_bytes(), -5e9),
        (1280, 64, &5_000_000_000u64.to_le_bytes(), 5e9),
        (16, 32, &1.25f32.to_le_bytes(), 1.25),
        (64, 64, &(-2.5f64).to_le_bytes(), -2.5),
    ];
    for (datatype, bits, one, value) in types {
        let mut file = File1::new([2, 2, 2], false);
        file.i16(70, datatype).i16(72, bits).bytes.truncate(352);
        file.bytes.extend(one.repeat(8));
        assert_eq!(file.read().unwrap().data, [value; 8], "datatype {datatype}");
        file.i16(72, 24);
        assert!(matches!(file.read(), Err(ReadError::Field { field: "bitpix", .. })));
    }
    for wrong in [0, 1, 32, 128, 1536, 1792, 2304, 77] {
        assert!(matches!(
            File1::new([2, 2, 2], false).i16(70, wrong).read(),
            Err(ReadError::Field { field: "datatype", .. })
        ));
    }
}

#[test]
fn slope_zero_means_no_scaling_and_others_scale() {
    let mut file = File1::new([2, 2, 2], false);
    assert_eq!(file.f32(112, 0.0).f32(116, 55.0).read().unwrap().data[7], 7.0);
    assert_eq!(file.f32(112, 2.0).f32(116, -1024.0).read().unwrap().data[7], -1010.0);
    for (slope, intercept, last) in
        [(f32::NAN, f32::NAN, 7.0), (f32::INFINITY, 5.0, 7.0), (f32::NAN, 5.0, 7.0), (2.0, f32::NAN, 14.0)]
    {
        let import = file.f32(112, slope).f32(116, intercept).import().unwrap();
        assert_eq!(import.volume.data[7], last, "{slope} {intercept}");
        assert!(import.notes.iter().any(|note| matches!(note, Note::Unusual { field: "scl_slope", .. })));
    }
}

#[test]
fn orientation_comes_from_sform_then_qform_then_spacing_with_a_note() {
    let mut file = File1::new([3, 3, 3], false);
    // A rotation of 90° about z, mirrored third axis, offset (1, 2, 3).
    file.i16(252, 1).f32(76, -1.0).f32(264, 0.5f32.sqrt()).f32(268, 1.0).f32(272, 2.0).f32(276, 3.0);
    let folder = tempfile::tempdir().unwrap();
    let import = |file: &File1| nifti::import(&saved(folder.path(), "a.nii", &file.bytes)).unwrap();
    let both = import(&file);
    assert_eq!(both.volume.world_from_voxel, sheared());
    assert!(matches!(both.notes[..], [Note::TwoOrientations { used: "sform", .. }]), "{:?}", both.notes);
    let quaternion = import(file.f32(88, 3.0).i16(254, 0));
    let columns = DMat3::from_cols(DVec3::Y, -2.0 * DVec3::X, -3.0 * DVec3::Z);
    assert!(quaternion.volume.world_from_voxel.matrix3.abs_diff_eq(columns, 1e-6));
    assert_eq!(quaternion.volume.world_from_voxel.translation, DVec3::new(1.0, 2.0, 3.0));
    let none = import(file.i16(252, 0));
    let left_front_head = DMat3::from_diagonal(DVec3::new(-1.0, 2.0, 3.0));
    let centred = DAffine3 { matrix3: left_front_head, translation: DVec3::new(1.0, -2.0, -3.0) };
    assert_eq!(none.volume.world_from_voxel, centred);
    assert!(matches!(none.notes[..], [Note::NoOrientation { .. }]));
}

#[test]
fn the_transform_that_counts_is_the_one_that_the_policy_names() {
    let ns = |edge: f32, far: f32| [[edge, 0.0, 0.0, far], [0.0, edge, 0.0, far], [0.0, 0.0, 2.0 * edge, far]];
    let (scanner, atlas) = (ns(1.0, 9.0), ns(1.12, 9.0));
    // Rows of the sform, its code, the qform's, pixdim; then the edge along i, the place of voxel 0
    // along x and the start of the fact.
    let two = [2.0, 2.0, 2.0];
    let unit = [[1.0, 0.0, 0.0, 9.0], [0.0, 1.0, 0.0, 9.0], [0.0, 0.0, 1.0, 9.0]];
    for (rows, codes, edges, (edge, x, taken)) in [
        (atlas, (4, 1), [1.0, 1.0, 2.0], (1.0, 1.0, "qform, code 1 (scanner), since the sform, code 4 (MNI)")),
        (atlas, (3, 2), [1.0, 1.0, 2.0], (1.0, 1.0, "qform, code 2")),
        (atlas, (2, 1), [1.12, 1.12, 2.24], (1.12, 9.0, "sform, code 2")),
        (atlas, (4, 4), [1.0, 1.0, 2.0], (1.12, 9.0, "sform, code 4")),
        (atlas, (4, 0), [1.12, 1.12, 2.24], (1.12, 9.0, "sform, code 4")),
        (atlas, (1, 0), [1.0, 1.0, 2.0], (1.12, 9.0, "sform, code 1")),
        (ns(0.0, 0.0), (1, 1), [1.0, 1.0, 2.0], (1.0, 1.0, "qform, code 1")),
        (ns(f32::NAN, 0.0), (1, 1), [1.0, 1.0, 2.0], (1.0, 1.0, "qform, code 1")),
        (unit, (1, 0), two, (2.0, 9.0, "sform, code 1 (scanner), scaled by pixdim")),
        (unit, (1, 1), two, (2.0, 1.0, "qform, code 1")),
        (scanner, (1, 0), [0.0; 3], (1.0, 9.0, "sform, code 1")),
        (scanner, (1, 0), [f32::NAN; 3], (1.0, 9.0, "sform, code 1")),
        (scanner, (1, 1), [0.0; 3], (1.0, 9.0, "sform, code 1")),
        (scanner, (1, 0), [-1.0, 1.0, 2.0], (1.0, 9.0, "sform, code 1")),
        (scanner, (0, 1), [-1.0, 1.0, 2.0], (1.0, 1.0, "qform, code 1")),
        (scanner, (0, 0), [-1.0, 1.0, 2.0], (1.0, 0.5, "none")),
    ] {
        let import = File1::new([2, 2, 2], false).srow(rows).forms(codes.0, codes.1, edges).import().unwrap();
        let fact = &import.facts.iter().find(|(name, _)| *name == "transform").unwrap().1;
        let found = (import.volume.spacing_mm().x as f32, import.volume.world_from_voxel.translation.x as f32);
        assert!(found == (edge, x) && fact.starts_with(taken), "{rows:?} {codes:?} {edges:?}: {found:?} {fact}");
        let plain = rows == scanner && edges[0] == -1.0 && codes.0 == 1 || edges[0] == 1.12 || codes == (4, 4);
        assert!(plain || !import.notes.is_empty(), "{rows:?} {codes:?} {edges:?} has no remark");
    }
}

#[test]
fn gzip_may_have_several_members_and_zeros_after_them() {
    let bytes = File1::new([4, 3, 2], false).bytes;
    let members = [gzipped(&bytes[..370]), gzipped(&bytes[370..]), vec![0; 1000]].concat();
    assert_eq!(read_bytes("a.nii.gz", &members).unwrap(), read_bytes("a.nii", &bytes).unwrap());
}

#[test]
fn a_sheared_volume_is_written_as_nrrd_and_others_as_nifti() {
    let folder = tempfile::tempdir().unwrap();
    for (affine, end) in [(sheared(), "nrrd"), (DAffine3::from_scale(DVec3::new(-1.0, 2.0, 3.0)), "nii.gz")] {
        let volume = VoxelVolume::filled([2, 2, 2], affine, 7i16);
        let path = write_beside(folder.path(), "drilled", &volume).unwrap();
        assert_eq!(path, folder.path().join(format!("drilled.{end}")));
        assert_eq!(read(&path).unwrap(), volume.map(f32::from));
    }
}

#[test]
fn metres_and_micrometres_become_millimetres() {
    let mut file = File1::new([2, 2, 2], false);
    file.srow([[1e-3, 0.0, 0.0, 9e-3], [0.0, 1e-3, 0.0, 0.0], [0.0, 0.0, 1e-3, 0.0]]).bytes[123] = 1;
    for n in 1..4 {
        file.f32(76 + 4 * n, 1e-3);
    }
    let volume = file.read().unwrap();
    assert!(
        volume.spacing_mm().abs_diff_eq(DVec3::ONE, 1e-6) && (volume.world_from_voxel.translation.x - 9.0).abs() < 1e-6
    );
}

#[test]
fn a_pair_of_files_reads_from_either_half() {
    let folder = tempfile::tempdir().unwrap();
    let mut file = File1::new([4, 3, 2], true);
    file.f32(108, 0.0).bytes[344..348].copy_from_slice(b"ni1\0");
    let header = saved(folder.path(), "head.hdr", &file.bytes[..348]);
    let alone = read(&header).unwrap_err().to_string();
    assert!(alone.contains("head.hdr") && alone.contains(".img"), "{alone}");
    let voxels = saved(folder.path(), "head.img", &file.bytes[352..]);
    assert_eq!(read(&header).unwrap(), read(&voxels).unwrap());
    assert_eq!(read(&header).unwrap().data[23], 23.0);
}

#[test]
fn voxels_may_start_later_but_not_in_the_header_or_past_the_end() {
    let mut file = File1::new([2, 2, 2], false);
    file.bytes.splice(352..352, [9; 16]);
    assert_eq!(file.f32(108, 368.0).read().unwrap().data[7], 7.0);
    for wrong in [-1.0, f32::NAN, 100.0, 1e9, 1e30] {
        let error = file.f32(108, wrong).read().unwrap_err();
        assert!(matches!(error, ReadError::Field { field: "vox_offset", .. }), "{error}");
    }
}

#[test]
fn several_volumes_are_read_by_number_only() {
    let mut file = File1::new([2, 2, 2], false);
    file.i16(40, 4).i16(48, 3).bytes.extend([7; 32]);
    let folder = tempfile::tempdir().unwrap();
    let path = saved(folder.path(), "a.nii", &file.bytes);
    let unchosen = read(&path).unwrap_err().to_string();
    assert!(unchosen.contains("3 volumes") && unchosen.contains("--mri-series N, from 0"), "{unchosen}");
    let second = import_number(&path, 1).unwrap();
    assert_eq!(second.volume.data, [f32::from(0x0707i16); 8]);
    assert_eq!(second.notes, [Note::OneOf { what: "volumes", count: 3, chosen: 1 }]);
    assert!(matches!(import_number(&path, 3), Err(ReadError::Volumes { .. })));
}

#[test]
fn sizes_that_no_volume_has_are_refused_before_memory_is_taken() {
    for dims in [[0, 2, 2], [2, -3, 2], [2, 2, 1]] {
        let error = File1::new(dims, false).read().unwrap_err();
        assert!(matches!(error, ReadError::Dimensions { field: "dim", .. }), "{error}");
    }
    for count in [2, 1, 0, -1, 8] {
        let error = File1::new([2, 2, 2], false).i16(40, count).read().unwrap_err();
        assert!(matches!(error, ReadError::Dimensions { field: "dim[0]", .. }), "{error}");
    }
    let mut bomb = File1::new([32767, 32767, 32767], false);
    assert!(matches!(bomb.read(), Err(ReadError::TooLarge { .. })));
    bomb.bytes = gzipped(&bomb.bytes);
    assert!(matches!(bomb.read(), Err(ReadError::TooLarge { .. })));
    let zeros = [vec![0u8; 348], vec![0; 4]].concat();
    assert!(matches!(
        read_bytes("a.nii", &zeros),
        Err(ReadError::Field { field: "sizeof_hdr", .. } | ReadError::Format { .. })
    ));
}

#[test]
fn spacings_and_axes_that_no_scanner_makes_are_refused() {
    for (wrong, qform) in [(0.0, 0), (0.0, 1), (f32::NAN, 0), (f32::INFINITY, 1)] {
        let error = File1::new([2, 2, 2], false).forms(0, qform, [wrong, 1.0, 1.0]).read().unwrap_err();
        assert!(matches!(error, ReadError::Spacing { field: "pixdim", .. }), "{error}");
    }
    let flat = [[1.0, 1.0, 0.0, 0.0], [1.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]];
    let error = File1::new([2, 2, 2], false).srow(flat).read().unwrap_err();
    assert!(matches!(error, ReadError::Orientation { .. }), "{error}");
    let empty = File1::new([2, 2, 2], false).srow([[0.0; 4]; 3]).read().unwrap_err();
    assert!(matches!(empty, ReadError::Spacing { field: "srow_x/y/z", .. }), "{empty}");
    let far = [[1.0, 0.0, 0.0, f32::NAN], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]];
    assert!(matches!(File1::new([2, 2, 2], false).srow(far).read(), Err(ReadError::Orientation { .. })));
}

#[test]
fn files_that_end_early_are_refused() {
    let file = File1::new([4, 3, 2], false);
    for length in [0, 3, 200, 351, 352, 399] {
        let error = read_bytes("a.nii", &file.bytes[..length]).unwrap_err();
        assert!(!matches!(error, ReadError::Io { .. }), "{error}");
    }
    let packed = gzipped(&file.bytes);
    for length in [3, 20, packed.len() - 9, packed.len() - 1] {
        let error = read_bytes("a.nii.gz", &packed[..length]).unwrap_err();
        assert!(matches!(error, ReadError::Compression { .. }), "{length} {error}");
    }
    let mut wrong_sum = packed.clone();
    let at = wrong_sum.len() - 6;
    wrong_sum[at] ^= 1;
    assert!(matches!(read_bytes("a.nii.gz", &wrong_sum), Err(ReadError::Compression { .. })));
}

#[test]
fn other_files_are_refused_with_a_reason() {
    let error = read(Path::new("no-such-folder/ct.nii")).unwrap_err();
    assert_eq!(error.to_string(), "no-such-folder/ct.nii: no such file; check the spelling of the path");
    let mut analyze = File1::new([2, 2, 2], false);
    analyze.bytes[344..348].fill(0);
    assert!(analyze.read().unwrap_err().to_string().contains("Analyze 7.5"));
    analyze.bytes[344..348].copy_from_slice(b"xxxx");
    assert!(matches!(analyze.read(), Err(ReadError::Field { field: "magic", .. })));
    assert!(read_bytes("a.nii", b"\x89PNG\r\n\x1a\n and so on").is_err());
}

#[test]
fn voxels_without_a_number_are_counted() {
    let mut file = File1::new([2, 2, 2], false);
    file.i16(70, 16).i16(72, 32).bytes.truncate(352);
    for value in [1.0, f32::NAN, 2.0, f32::INFINITY, 0.0, 0.0, 0.0, 0.0] {
        file.bytes.extend(value.to_le_bytes());
    }
    let folder = tempfile::tempdir().unwrap();
    let import = nifti::import(&saved(folder.path(), "a.nii", &file.bytes)).unwrap();
    assert_eq!(import.notes, [Note::NotANumber { count: 2 }]);
}

#[test]
fn written_volumes_round_trip_exactly() {
    let folder = tempfile::tempdir().unwrap();
    let turn =
        DMat3::from_rotation_z(0.3) * DMat3::from_rotation_x(-0.8) * DMat3::from_diagonal(DVec3::new(-0.5, 0.75, 2.0));
    let narrow = |v: DVec3| v.as_vec3().as_dvec3();
    let matrix3 = DMat3::from_cols(narrow(turn.x_axis), narrow(turn.y_axis), narrow(turn.z_axis));
    let affine = DAffine3 { matrix3, translation: DVec3::new(-12.5, 80.25, 3.0) };
    let mut ct = VoxelVolume::filled([7, 5, 4], affine, 0i16);
    ct.data.iter_mut().enumerate().for_each(|(at, v)| *v = 31 * at as i16 - 1024);
    for name in ["ct.nii", "ct.nii.gz"] {
        let path = folder.path().join(name);
        nifti::write(&path, &ct).unwrap();
        assert_eq!(nifti::import(&path).unwrap().notes, []);
        assert_eq!(read(&path).unwrap(), ct.map(f32::from));
        let mut bytes = std::fs::read(&path).unwrap();
        if name == "ct.nii" {
            bytes[254] = 0;
            let by_qform = read_bytes("a.nii", &bytes).unwrap();
            assert!(by_qform.world_from_voxel.abs_diff_eq(affine, 1e-5), "{}", by_qform.world_from_voxel);
        }
    }
    let sheared = VoxelVolume::filled([2, 2, 2], sheared(), 7u8);
    nifti::write(&folder.path().join("mask.nii"), &sheared).unwrap();
    assert_eq!(read(&folder.path().join("mask.nii")).unwrap(), sheared.map(f32::from));
}

#[test]
fn a_failed_write_leaves_nothing_behind_and_the_old_file_alone() {
    let folder = tempfile::tempdir().unwrap();
    let volume = VoxelVolume::filled([2, 2, 2], DAffine3::IDENTITY, 1u8);
    let wrong = nifti::write(&folder.path().join("a.dcm"), &volume).unwrap_err();
    assert!(matches!(wrong, WriteError::Name { .. }));
    assert!(matches!(nifti::write(&folder.path().join("no/a.nii"), &volume), Err(WriteError::Io { .. })));
    let old = saved(folder.path(), "a.nii", b"old");
    let ragged = VoxelVolume { data: vec![1u8; 7], ..volume.clone() };
    assert!(matches!(nifti::write(&old, &ragged), Err(WriteError::Dimensions { .. })));
    assert_eq!(std::fs::read(&old).unwrap(), b"old");
    nifti::write(&old, &volume).unwrap();
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1);
}
