use super::*;
use crate::mutation::survives_mutations;
use std::io::Write;

const HEADER: &str = "ObjectType = Image\nNDims = 3\nBinaryData = True\nBinaryDataByteOrderMSB = False\nCompressedData = False\n\
    TransformMatrix = 0 1 0 -1 0 0 0 0 1\nOffset = 10 20 30\nElementSpacing = 0.5 2 3\nDimSize = 4 3 2\nElementType = MET_SHORT\n\
    ElementDataFile = LOCAL\n";

fn voxels(order: ByteOrder) -> Vec<u8> {
    let bytes = |v: i16| if order == ByteOrder::Big { v.to_be_bytes() } else { v.to_le_bytes() };
    (0..24).flat_map(|v| bytes(v - 5)).collect()
}

fn zlib(bytes: &[u8]) -> Vec<u8> {
    let mut zlib = flate2::write::ZlibEncoder::new(Vec::new(), flate2::Compression::default());
    zlib.write_all(bytes).unwrap();
    zlib.finish().unwrap()
}

fn parsed(header: &str, voxels: &[u8]) -> Result<Import, ReadError> {
    import_source(Source::of_bytes(Path::new("a.mha"), [header.as_bytes(), voxels].concat()), None)
}

#[test]
fn the_matrix_lists_axis_after_axis_in_lps() {
    let import = parsed(HEADER, &voxels(ByteOrder::Little)).unwrap();
    let m = import.volume.world_from_voxel;
    assert_eq!(
        m.matrix3,
        DMat3::from_cols(DVec3::new(0.0, -0.5, 0.0), DVec3::new(2.0, 0.0, 0.0), DVec3::new(0.0, 0.0, 3.0))
    );
    assert_eq!(m.translation, DVec3::new(-10.0, -20.0, 30.0));
    assert_eq!((import.volume.data[23], import.notes), (18.0, vec![]));
}

#[test]
fn big_endian_zlib_text_and_header_sizes_are_read() {
    let little = voxels(ByteOrder::Little);
    let plain = parsed(HEADER, &little).unwrap().volume;
    let same = |from: &str, to: &str, voxels: &[u8]| {
        assert_eq!(parsed(&HEADER.replace(from, to), voxels).unwrap().volume, plain, "{to}");
    };
    same("MSB = False", "MSB = True", &voxels(ByteOrder::Big));
    let turned = parsed(&HEADER.replace("0.5 2", "-0.5 2"), &little).unwrap().volume.world_from_voxel;
    assert_eq!(turned.matrix3.x_axis, -plain.world_from_voxel.matrix3.x_axis);
    same("CompressedData = False", "CompressedData = True", &zlib(&little));
    same("NDims", "HeaderSize = 3\nNDims", &[b"abc", &little[..]].concat());
    same("NDims", "HeaderSize = -1\nNDims", &[b"rubbish", &little[..]].concat());
    let text: String = (0..24).map(|v| format!("{} ", v - 5)).collect();
    same("BinaryData = True", "BinaryData = False", text.as_bytes());
    let scaled =
        HEADER.replace("NDims", "ElementToIntensityFunctionSlope = 2\nElementToIntensityFunctionOffset = -1\nNDims");
    let import = parsed(&scaled, &little).unwrap();
    assert_eq!(import.volume.data[23], 35.0);
    assert!(import.notes[0].to_string().contains("ITK programs leave it out"), "{:?}", import.notes);
}

#[test]
fn volumes_and_channels_are_read_by_number() {
    let twice = [voxels(ByteOrder::Little), voxels(ByteOrder::Little).iter().map(|_| 7).collect()].concat();
    let of = |header: &str, number| {
        import_source(Source::of_bytes(Path::new("a.mha"), [header.as_bytes(), &twice].concat()), number)
    };
    let volumes = HEADER
        .replace("4 3 2", "4 3 2 2")
        .replace("0 1 0 -1 0 0 0 0 1", "0 1 0 0 -1 0 0 0 0 0 1 0 0 0 0 1")
        .replace("0.5 2 3", "0.5 2 3 1")
        .replace("10 20 30", "10 20 30 0");
    let channels = HEADER.replace("NDims", "ElementNumberOfChannels = 2\nNDims");
    assert_eq!(of(&volumes, Some(0)).unwrap().volume, parsed(HEADER, &twice).unwrap().volume);
    assert_eq!(of(&volumes, Some(1)).unwrap().volume.data, [1799.0; 24]);
    assert_eq!(of(&channels, Some(1)).unwrap().volume.data[..3], [-4.0, -2.0, 0.0]);
    for header in [volumes, channels] {
        assert!(matches!(of(&header, None), Err(ReadError::Volumes { found: 2, .. })));
        assert!(matches!(of(&header, Some(2)), Err(ReadError::Volumes { found: 2, .. })));
    }
}

#[test]
fn voxels_in_a_second_file_are_found_beside_the_header() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.mhd");
    std::fs::write(&path, HEADER.replace("LOCAL", "a.raw")).unwrap();
    assert!(matches!(read(&path), Err(ReadError::Missing { .. })));
    std::fs::write(folder.path().join("a.raw"), voxels(ByteOrder::Little)).unwrap();
    assert_eq!(read(&path).unwrap(), parsed(HEADER, &voxels(ByteOrder::Little)).unwrap().volume);
}

#[test]
fn each_wrong_field_has_its_own_error() {
    let wrong = |from: &str, to: &str| parsed(&HEADER.replace(from, to), &voxels(ByteOrder::Little)).unwrap_err();
    for (from, to, field) in [
        ("= Image", "= Tube", "ObjectType"),
        ("MET_SHORT", "MET_STRING", "ElementType"),
        ("LOCAL", "LIST", "ElementDataFile"),
        ("LOCAL", "a%03d.raw 1 3 1", "ElementDataFile"),
        ("0 1 0 -1 0 0 0 0 1", "0 1 0", "TransformMatrix"),
        ("10 20 30", "10 20", "Offset"),
        ("DimSize", "DimSice", "DimSize"),
    ] {
        let error = wrong(from, to);
        assert!(matches!(&error, ReadError::Field { field: f, .. } if *f == field), "{to}: {error}");
    }
    assert!(matches!(wrong("4 3 2", "4 3 0"), ReadError::Dimensions { .. }));
    assert!(matches!(wrong("4 3 2", "4 3"), ReadError::Dimensions { .. }));
    assert!(matches!(wrong("4 3 2", "900000 900000 900000"), ReadError::TooLarge { .. }));
    assert!(matches!(wrong("0.5 2 3", "0 2 3"), ReadError::Spacing { .. }));
    assert!(matches!(wrong("0 1 0 -1", "1 0 0 1"), ReadError::Orientation { .. }));
    let cut = zlib(&voxels(ByteOrder::Little));
    let error =
        parsed(&HEADER.replace("CompressedData = False", "CompressedData = True"), &cut[..cut.len() - 7]).unwrap_err();
    assert!(matches!(error, ReadError::Compression { .. } | ReadError::Truncated { .. }), "{error}");
}

#[test]
fn damaged_files_give_errors_and_no_panic() {
    let little = voxels(ByteOrder::Little);
    let packed = HEADER.replace("CompressedData = False", "CompressedData = True");
    let seeds = [[HEADER.as_bytes(), &little].concat(), [packed.as_bytes(), &zlib(&little)].concat()];
    survives_mutations(&seeds, |bytes| import_source(Source::of_bytes(Path::new("a.mha"), bytes), None));
}
