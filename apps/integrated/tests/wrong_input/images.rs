//! Images: missing, truncated, changed, of the wrong kind, too large, in another space.

use crate::Wrong;
use crate::files::{Nifti, gz, meta, nrrd};
use std::fs;
use std::path::Path;

/// See [`Wrong`].
pub const TABLE: &[Wrong] = &[
    ("a missing CT", "CT=no-such.nii.gz", &["no-such.nii.gz", "give the path"]),
    ("a missing MRI", "MRI=no-such.nii", &["no-such.nii", "give the path"]),
    ("missing labels", "LABELS=no-such.nii", &["no-such.nii", "give the path"]),
    ("an empty file", "CT=void.nii", &["void.nii", "it is empty"]),
    ("an empty gzip", "CT=void.nii.gz", &["void.nii.gz", "it is empty"]),
    ("a text", "CT=text.nii", &["text.nii", "it is a text", "NIfTI"]),
    ("a PNG", "CT=picture.png", &["picture.png", "a PNG picture"]),
    ("a JPEG", "CT=picture.jpg", &["picture.jpg", "a JPEG picture"]),
    ("a ZIP", "CT=images.zip", &["images.zip", "unpack it first"]),
    ("a PDF", "CT=report.pdf", &["report.pdf", "a PDF"]),
    ("an MGH cut off", "CT=t1.mgz", &["t1.mgz", "fetch the file again"]),
    ("noise", "CT=bytes.nii", &["bytes.nii", "no known format"]),
    ("an escape in a name", "--ct IN/\\e[2Jred.nii --mri IN/mri.nii", &["u{1b}[2Jred.nii", "give the path"]),
    // NIfTI
    ("NIfTI cut in its head", "CT=cut-head.nii", &["cut-head.nii", "header", "fetch the file again"]),
    ("NIfTI cut in its voxels", "CT=cut.nii", &["cut.nii", "ends after", "fetch the file again"]),
    ("packed NIfTI cut", "CT=cut.nii.gz", &["cut.nii.gz", "damaged", "fetch the file again"]),
    ("packed NIfTI with a changed byte", "CT=changed.nii.gz", &["changed.nii.gz", "fetch the file again"]),
    ("NIfTI of another magic", "CT=magic.nii", &["magic.nii", "magic", "n+1"]),
    ("Analyze", "CT=analyze.nii", &["analyze.nii", "Analyze 7.5", "convert it"]),
    ("half of a pair", "CT=half.hdr", &["half.hdr", "ends in .img"]),
    ("NIfTI of two dimensions", "CT=flat.nii", &["flat.nii", "dim[0]", "not a single picture"]),
    ("NIfTI one slice thick", "CT=thin.nii", &["thin.nii", "at least 2 voxels"]),
    ("NIfTI of no size", "CT=zero.nii", &["zero.nii", "at least 2 voxels"]),
    ("NIfTI of a negative size", "CT=negative.nii", &["negative.nii", "at least 2 voxels"]),
    ("NIfTI over time", "CT=time.nii", &["time.nii", "5 volumes", "--ct-series N"]),
    ("NIfTI over time, beyond its end", "CT=time.nii --ct-series 5", &["time.nii", "5 volumes", "from 0"]),
    ("NIfTI of vectors", "CT=vectors.nii", &["vectors.nii", "3 volumes"]),
    ("NIfTI of colours", "CT=rgb.nii", &["rgb.nii", "colour", "grey values"]),
    ("NIfTI of complex numbers", "CT=complex.nii", &["complex.nii", "complex", "magnitude"]),
    ("NIfTI of a datatype that is none", "CT=datatype.nii", &["datatype.nii", "datatype", "is right"]),
    ("NIfTI of other bits", "CT=bitpix.nii", &["bitpix.nii", "bitpix"]),
    ("NIfTI with flat axes", "CT=axes.nii", &["axes.nii", "srow"]),
    ("NIfTI with axes that are no numbers", "CT=nan-axes.nii", &["nan-axes.nii", "srow"]),
    ("NIfTI on the moon", "CT=moon.nii", &["moon.nii", "srow"]),
    ("NIfTI with voxels before its head", "CT=offset.nii", &["offset.nii", "vox_offset", "352"]),
    ("NIfTI with voxels behind its end", "CT=beyond.nii", &["beyond.nii", "vox_offset"]),
    ("NIfTI that declares more", "CT=declares-more.nii", &["declares-more.nii", "limit is 600000000"]),
    ("packed NIfTI that unpacks to all memory", "CT=bomb.nii.gz", &["bomb.nii.gz", "dim", "limit is 600000000"]),
    ("the same as MRI", "MRI=bomb.nii.gz", &["bomb.nii.gz", "GB of memory", "crop"]),
    ("the same as labels", "LABELS=bomb.nii.gz", &["bomb.nii.gz", "GB of memory", "crop"]),
    ("the same as tissue", "CT=ct.nii --tissue tumour=IN/bomb.nii.gz", &["bomb.nii.gz", "GB of memory"]),
    ("more than is free", "CT=large.nii.gz", &["large.nii.gz", "GB are free here", "crop"]),
    // NRRD
    ("NRRD of another magic", "CT=magic.nrrd", &["magic.nrrd", "no known format"]),
    ("NRRD cut in its head", "CT=cut-head.nrrd", &["cut-head.nrrd", "missing"]),
    ("NRRD cut in its voxels", "CT=cut.nrrd", &["cut.nrrd", "ends after"]),
    ("NRRD of two dimensions", "CT=flat.nrrd", &["flat.nrrd", "sizes", "not a single picture"]),
    ("NRRD of other dimensions", "CT=dimension.nrrd", &["dimension.nrrd", "number of sizes"]),
    ("NRRD of vectors", "CT=vectors.nrrd", &["vectors.nrrd", "3 volumes"]),
    ("NRRD of no size", "CT=zero.nrrd", &["zero.nrrd", "at least 2 voxels"]),
    ("NRRD of a size that is no number", "CT=words.nrrd", &["words.nrrd", "sizes", "numbers must stand"]),
    ("NRRD of an unknown type", "CT=type.nrrd", &["type.nrrd", "type", "short or float"]),
    ("NRRD of blocks", "CT=block.nrrd", &["block.nrrd", "type"]),
    ("NRRD in another packing", "CT=packing.nrrd", &["packing.nrrd", "encoding", "unu save"]),
    ("NRRD in no space", "CT=space.nrrd", &["space.nrrd", "space", "LPS"]),
    ("NRRD with flat axes", "CT=axes.nrrd", &["axes.nrrd", "space directions"]),
    ("NRRD of no byte order", "CT=endian.nrrd", &["endian.nrrd", "little or big"]),
    ("NRRD in several files", "CT=list.nrrd", &["list.nrrd", "one file must hold all"]),
    ("NRRD without its voxels", "CT=apart.nrrd", &["no-such.raw", "no such file"]),
    ("NRRD that unpacks to all memory", "CT=bomb.nrrd", &["bomb.nrrd", "limit is 600000000"]),
    ("NRRD whose voxels are a pipe", "CT=pipe.nrrd", &["pipe", "a named pipe"]),
    // MetaImage
    ("MetaImage cut in its voxels", "CT=cut.mha", &["cut.mha", "ends after"]),
    ("MetaImage of two dimensions", "CT=flat.mha", &["flat.mha", "DimSize", "not a single picture"]),
    ("MetaImage of no size", "CT=zero.mha", &["zero.mha", "at least 2 voxels"]),
    ("MetaImage over time", "CT=time.mha", &["time.mha", "5 volumes"]),
    ("MetaImage of vectors", "CT=vectors.mha", &["vectors.mha", "3 volumes"]),
    ("MetaImage of an unknown type", "CT=type.mha", &["type.mha", "ElementType", "MET_SHORT"]),
    ("MetaImage with voxels of no size", "CT=spacing.mha", &["spacing.mha", "voxel edges", "mm are right"]),
    ("MetaImage with flat axes", "CT=axes.mha", &["axes.mha", "TransformMatrix"]),
    ("MetaImage of a mesh", "CT=mesh.mha", &["mesh.mha", "ObjectType", "only Image"]),
    ("MetaImage without its voxels", "CT=apart.mhd", &["no-such.raw", "no such file"]),
    ("MetaImage in several files", "CT=list.mhd", &["list.mhd", "one file must hold all"]),
    ("MetaImage that unpacks to all memory", "CT=bomb.mha", &["bomb.mha", "limit is 600000000"]),
    // DICOM in one file
    ("DICOM cut off", "CT=cut.dcm", &["cut.dcm", "folder of the whole series"]),
    ("DICOM of a report", "CT=report.dcm", &["report.dcm", "no DICOM picture"]),
    // What the voxels mean
    ("an MRI as CT", "CT=mri.nii", &["mri.nii", "not a CT in HU", "--ct", "--mri"]),
    ("a CT as MRI", "MRI=ct.nii", &["ct.nii", "values are a CT's", "--ct", "--mri"]),
    ("a CT whose intercept is lost", "CT=no-air.nii", &["no-air.nii", "rescale intercept", "in HU"]),
    ("a CT of no numbers", "CT=nan.nii", &["nan.nii", "32768 voxels", "NaN"]),
    ("an MRI with holes", "MRI=one-nan.nii", &["one-nan.nii", "NaN", "write them as 0"]),
    ("a CT without bone", "CT=no-bone.nii", &["no bone", "--isovalue-hu"]),
    ("a CT below its threshold", "CT=ct.nii --isovalue-hu 2000", &["2000 HU", "no bone", "--isovalue-hu"]),
    ("an MRI of nothing", "--ct IN/ct.nii --mri IN/noise.nii", &["brain", "--labels PATH"]),
    ("an MRI of a ball", "--ct IN/ct.nii --mri IN/mri.nii", &["brain", "--labels PATH"]),
    ("images a room apart", "CT=far.nii", &["do not overlap", "468", "--register"]),
    ("labels a room apart", "LABELS=far-brain.nii", &["far-brain.nii", "lie apart"]),
    ("a mask of nothing", "LABELS=empty-mask.nii", &["empty-mask.nii", "no voxel"]),
    ("a mask of halves", "LABELS=half-labels.nii", &["half-labels.nii", "0.5", "whole numbers"]),
    ("a mask below nothing", "LABELS=negative-labels.nii", &["negative-labels.nii", "-1", "whole numbers"]),
    ("an image as labels", "LABELS=ct.nii", &["ct.nii", "whole numbers", "label volume"]),
    (
        "tissue outside",
        "CT=ct.nii --tissue tumour=IN/outside.nii",
        &["tumour", "outside.nii", "none of it in the brain"],
    ),
    ("tissue of no code", "CT=ct.nii --tissue grey=IN/brain.nii:9", &["grey", "labels [9]", "fill no voxel"]),
    ("tissue of no segment", "CT=ct.nii --tissue grey=IN/brain.nii:core", &["grey", "\"core\"", "give codes"]),
    ("a mask as MRI", "--ct IN/head-ct.nii --mri IN/head-brain.nii", &["mask or a label volume", "--labels", "--mri"]),
    (
        "a CT that is not in HU",
        "--ct IN/offset-hu.nii --mri IN/mri.nii --labels IN/brain.nii",
        &["no HU", "--isovalue-hu"],
    ),
    ("a segmentation of layers as MRI", "MRI=layers.seg.nrrd", &["layers.seg.nrrd", "segment", "--tissue"]),
    ("a segmentation that is cut", "CT=ct.nii --tissue tumour=IN/cut.nrrd", &["cut.nrrd", "ends after"]),
    ("tissue that is an image", "CT=ct.nii --tissue grey=IN/ct.nii", &["ct.nii", "whole numbers"]),
    ("tissue that is missing", "CT=ct.nii --tissue grey=IN/no-such.nii", &["no-such.nii", "give the path"]),
    ("voxels metres apart", "CT=wide.nii", &["wide.nii", "28800 mm", "correct the voxel edges"]),
    ("labels metres apart", "LABELS=wide.nii", &["wide.nii"]),
    (
        "a skull of too many voxels",
        "--ct IN/head-ct.nii --mri IN/head-mri.nii --labels IN/head-brain.nii --spacing-mm 0.2",
        &["--spacing-mm 0.2", "give a larger spacing"],
    ),
    ("a place inside the skull", "CT=ct.nii --opening 5,5,5", &["--opening", "inside the skull", "outside the skull"]),
    ("a place a metre away", "CT=ct.nii --opening 600,500,600", &["--opening", "mm away", "outside the skull"]),
    ("a place in the middle", "CT=ct.nii --opening 0,0,0", &["--opening", "outside the skull"]),
    ("a turned MRI", "--ct IN/head-ct.nii --mri IN/turned-mri.nii", &["not lie in the CT's space", "--register"]),
    ("a shifted MRI", "--ct IN/head-ct.nii --mri IN/shifted-mri.nii", &["not lie in the CT's space", "--register"]),
    (
        "turned labels",
        "--ct IN/head-ct.nii --mri IN/head-mri.nii --labels IN/turned-brain.nii",
        &["the labels", "not lie in the CT's space"],
    ),
    (
        "a turned MRI with sound labels",
        "--ct IN/head-ct.nii --mri IN/turned-mri.nii --labels IN/head-brain.nii",
        &["the MRI's brain", "--register"],
    ),
    ("registration of nothing", "CT=ct.nii --mri IN/noise.nii --register", &["cannot be used multiple times"]),
    ("registration of a blank", "--ct IN/ct.nii --mri IN/noise.nii --register", &["registration", "contrast", "give"]),
];

/// Writes invalid volumes.
pub fn make(home: &Path) {
    let put = |name: &str, bytes: Vec<u8>| fs::write(home.join(name), bytes).unwrap();
    put("void.nii", Vec::new());
    put("void.nii.gz", gz(&[]));
    put("text.nii", b"this is not an image\n".repeat(100));
    put("picture.png", b"\x89PNG\r\n\x1a\n0000".to_vec());
    put("picture.jpg", b"\xff\xd8\xff\xe0JFIF".to_vec());
    put("images.zip", b"PK\x03\x04zipped".to_vec());
    put("report.pdf", b"%PDF-1.4".to_vec());
    put("t1.mgz", gz(&[0, 0, 0, 1, 0, 0, 0, 9]));
    put("bytes.nii", (0..9999u32).map(|n| (n * n / 7 + 200) as u8).collect());
    niftis(&put);
    for (name, from, to) in [
        ("magic.nrrd", "NRRD0004", "NERD0004"),
        (
            "flat.nrrd",
            "dimension: 3\nspace: RAS\nsizes: 32 32 32\nspace directions: (2,0,0) (0,2,0) (0,0,2)",
            "dimension: 2\nsizes: 32 1024",
        ),
        ("dimension.nrrd", "dimension: 3", "dimension: 4"),
        (
            "vectors.nrrd",
            "dimension: 3\nspace: RAS\nsizes: 32 32 32\nspace directions: (2,0,0)",
            "dimension: 4\nspace: RAS\nsizes: 3 32 32 32\nspace directions: none (2,0,0)",
        ),
        ("zero.nrrd", "sizes: 32 32 32", "sizes: 32 0 32"),
        ("words.nrrd", "sizes: 32 32 32", "sizes: 32 many 32"),
        ("type.nrrd", "type: short", "type: long double"),
        ("block.nrrd", "type: short", "type: block"),
        ("packing.nrrd", "encoding: raw", "encoding: bzip2"),
        ("space.nrrd", "space: RAS", "space: outer"),
        ("axes.nrrd", "(0,0,2)", "(0,2,0)"),
        ("endian.nrrd", "endian: little\n", ""),
        ("list.nrrd", "encoding: raw", "encoding: raw\ndata file: LIST"),
        ("apart.nrrd", "encoding: raw", "encoding: raw\ndata file: no-such.raw"),
        ("pipe.nrrd", "encoding: raw", "encoding: raw\ndata file: pipe"),
    ] {
        put(name, nrrd(from, to));
    }
    let layers = "dimension: 4\nspace: RAS\nsizes: 2 32 32 16\nspace directions: none (2,0,0)";
    let named = "type: uchar\nSegment0_Name:=tumour\nSegment0_Layer:=0\nSegment1_Name:=oedema\nSegment1_Layer:=1";
    let of_layers = nrrd("dimension: 3\nspace: RAS\nsizes: 32 32 32\nspace directions: (2,0,0)", layers);
    put("layers.seg.nrrd", replaced(&of_layers, "type: short", named));
    put("cut-head.nrrd", nrrd("type", "type")[..60].to_vec());
    put("cut.nrrd", nrrd("type", "type")[..5000].to_vec());
    for (name, from, to) in [
        ("flat.mha", "NDims = 3\nDimSize = 32 32 32", "NDims = 2\nDimSize = 32 1024"),
        ("zero.mha", "DimSize = 32 32 32", "DimSize = 32 0 32"),
        ("time.mha", "NDims = 3\nDimSize = 32 32 32", "NDims = 4\nDimSize = 32 32 32 5"),
        ("vectors.mha", "NDims = 3", "NDims = 3\nElementNumberOfChannels = 3"),
        ("type.mha", "MET_SHORT", "MET_OTHER"),
        ("spacing.mha", "ElementSpacing = 2 2 2", "ElementSpacing = 2 0 2"),
        ("axes.mha", "1 0 0 0 1 0 0 0 1", "1 0 0 1 0 0 0 0 1"),
        ("mesh.mha", "ObjectType = Image", "ObjectType = Mesh"),
        ("apart.mhd", "ElementDataFile = LOCAL", "ElementDataFile = no-such.raw"),
        ("list.mhd", "ElementDataFile = LOCAL", "ElementDataFile = LIST"),
    ] {
        put(name, meta(from, to));
    }
    put("cut.mha", meta("NDims", "NDims")[..5000].to_vec());
    let slice = crate::files::slice(3, &crate::files::sound(3));
    put("cut.dcm", slice[..slice.len() / 2].to_vec());
    let mut report = [vec![0; 128], b"DICM".to_vec()].concat();
    report.extend([8, 0, 0x60, 0, b'C', b'S', 2, 0, b'S', b'R']);
    fs::create_dir(home.join("report")).unwrap();
    put("report.dcm", report);
}

/// Replaces a text in bytes once.
fn replaced(bytes: &[u8], from: &str, to: &str) -> Vec<u8> {
    let at = bytes.windows(from.len()).position(|w| w == from.as_bytes()).unwrap();
    [&bytes[..at], to.as_bytes(), &bytes[at + from.len()..]].concat()
}

fn niftis(put: &dyn Fn(&str, Vec<u8>)) {
    let whole = Nifti::default().with_ball();
    put("cut-head.nii", whole[..200].to_vec());
    put("cut.nii", whole[..whole.len() / 2].to_vec());
    let packed = gz(&whole);
    put("cut.nii.gz", packed[..packed.len() / 2].to_vec());
    let mut changed = packed.clone();
    let middle = changed.len() / 2;
    changed[middle] ^= 0xff;
    put("changed.nii.gz", changed);
    let dim = |dim: [i16; 8]| Nifti { dim, ..Nifti::default() };
    let rows = |rows: [[f32; 4]; 3]| Nifti { srow: Some(rows), ..Nifti::default() };
    let of = [
        ("magic.nii", Nifti { magic: *b"n+9\0", ..Nifti::default() }),
        ("analyze.nii", Nifti { magic: [0; 4], ..Nifti::default() }),
        ("half.hdr", Nifti { magic: *b"ni1\0", ..Nifti::default() }),
        ("flat.nii", dim([2, 32, 1024, 1, 1, 1, 1, 1])),
        ("thin.nii", dim([3, 32, 1024, 1, 1, 1, 1, 1])),
        ("zero.nii", dim([3, 32, 0, 32, 1, 1, 1, 1])),
        ("negative.nii", dim([3, 32, -32, 32, 1, 1, 1, 1])),
        ("time.nii", dim([4, 32, 32, 6, 5, 1, 1, 1])),
        ("vectors.nii", dim([5, 32, 32, 10, 1, 3, 1, 1])),
        ("rgb.nii", Nifti { datatype: 128, bitpix: 24, ..Nifti::default() }),
        ("complex.nii", Nifti { datatype: 32, bitpix: 64, ..Nifti::default() }),
        ("datatype.nii", Nifti { datatype: 77, ..Nifti::default() }),
        ("bitpix.nii", Nifti { bitpix: 8, ..Nifti::default() }),
        ("axes.nii", rows([[2.0, 0.0, 0.0, 0.0], [2.0, 0.0, 0.0, 0.0], [0.0, 0.0, 2.0, 0.0]])),
        ("nan-axes.nii", rows([[f32::NAN; 4]; 3])),
        ("moon.nii", rows([[2.0, 0.0, 0.0, 1e9], [0.0, 2.0, 0.0, 0.0], [0.0, 0.0, 2.0, 0.0]])),
        ("offset.nii", Nifti { vox_offset: 100.0, ..Nifti::default() }),
        ("beyond.nii", Nifti { vox_offset: 1e9, ..Nifti::default() }),
        ("offset-hu.nii", Nifti { slope: [1.0, 499.0], ..Nifti::default() }),
        ("declares-more.nii", dim([3, 2000, 2000, 2000, 1, 1, 1, 1])),
    ];
    of.iter().for_each(|(name, nifti)| put(name, nifti.with_ball()));
    // 900 x 900 x 730 voxels of 8 bytes are under the limit for volumes, but over 4 GB.
    let large = Nifti { dim: [3, 900, 900, 730, 1, 1, 1, 1], ..Nifti::default() };
    let piece = gz(&vec![0; 16 << 20]);
    put("large.nii.gz", std::iter::once(gz(&large.header())).chain(std::iter::repeat_n(piece, 71)).flatten().collect());
}
