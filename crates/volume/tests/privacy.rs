//! Checks that no patient data passes the readers, with valid, truncated and damaged files full of
//! identifiers.

use std::path::Path;
use trepan_volume::{dicom, import};

/// Identifiers that must never appear in output: names, numbers and dates.
const SECRETS: [&str; 9] = [
    "SECRET",
    "Secret",
    "secret",
    "S\u{0}E\u{0}C",
    "19450827",
    "194508",
    "161803398",
    "271828182",
    "1.2.826.0.1.31415926",
];

/// Text for every element about the patient, study, institution and staff, in every VR with text or
/// a date.
const TEXTS: [(u32, &[u8; 2], &str); 38] = [
    (0x0008_0005, b"CS", "ISO_IR 100"),
    (0x0008_0014, b"UI", "1.2.826.0.1.31415926.1"),
    (0x0008_0018, b"UI", "1.2.826.0.1.31415926.2"),
    (0x0008_0020, b"DA", "19450827"),
    (0x0008_002a, b"DT", "19450827101112"),
    (0x0008_0050, b"SH", "SECRET-ACC"),
    (0x0008_0060, b"CS", "CT"),
    (0x0008_0080, b"LO", "SECRET HOSPITAL"),
    (0x0008_0081, b"ST", "SECRET STREET 1"),
    (0x0008_0090, b"PN", "SECRET^DOCTOR"),
    (0x0008_1010, b"SH", "SECRETSTATION"),
    (0x0008_1030, b"LO", "SECRET STUDY"),
    (0x0008_103e, b"LO", "SECRET SERIES"),
    (0x0008_1070, b"PN", "SECRET^OPERATOR"),
    (0x0008_2111, b"ST", "SECRET derivation"),
    (0x0009_0010, b"LO", "SECRET PRIVATE CREATOR"),
    (0x0009_1001, b"UN", "SECRET private bytes"),
    (0x0009_1002, b"LT", "SECRET private text"),
    (0x0010_0010, b"PN", "SECRET^NAME^^DR"),
    (0x0010_0020, b"LO", "161803398"),
    (0x0010_0021, b"LO", "SECRET ISSUER"),
    (0x0010_0030, b"DA", "19450827"),
    (0x0010_0032, b"TM", "194508"),
    (0x0010_1000, b"LO", "271828182"),
    (0x0010_1001, b"PN", "SECRET^OTHER"),
    (0x0010_1010, b"AS", "077Y"),
    (0x0010_1040, b"LO", "SECRET ADDRESS"),
    (0x0010_2154, b"SH", "161803398"),
    (0x0010_21b0, b"LT", "SECRET HISTORY"),
    (0x0010_4000, b"LT", "SECRET COMMENT"),
    (0x0018_1000, b"LO", "SECRETSERIAL"),
    (0x0020_000d, b"UI", "1.2.826.0.1.31415926.3"),
    (0x0020_000e, b"UI", "1.2.826.0.1.31415926.4"),
    (0x0020_0010, b"SH", "SECRETSTUDYID"),
    (0x0020_0011, b"IS", "7"),
    (0x0020_4000, b"LT", "SECRET IMAGE COMMENT"),
    (0x0032_1032, b"PN", "SECRET^PHYSICIAN"),
    (0x0040_0244, b"DA", "19450827"),
];

fn element(bytes: &mut Vec<u8>, tag: u32, vr: &[u8; 2], value: &[u8]) {
    bytes.extend([((tag >> 16) as u16).to_le_bytes(), (tag as u16).to_le_bytes()].concat());
    bytes.extend(vr);
    let length = value.len() + value.len() % 2;
    match vr {
        b"UN" | b"OW" | b"OB" | b"UT" | b"SQ" => bytes.extend([&[0, 0], &(length as u32).to_le_bytes()[..]].concat()),
        _ => bytes.extend((length as u16).to_le_bytes()),
    }
    bytes.extend(value);
    bytes.resize(bytes.len() + value.len() % 2, b' ');
}

/// A slice; `wrong` replaces one of the picture's elements by a secret.
fn slice(n: usize, wrong: Option<(u32, &str)>) -> Vec<u8> {
    let mut bytes = [&[0; 128], &b"DICM"[..]].concat();
    element(&mut bytes, 0x0002_0010, b"UI", b"1.2.840.10008.1.2.1\0");
    element(&mut bytes, 0x0002_0016, b"AE", b"SECRETTITLE");
    let place = format!("0\\0\\{n}");
    let instance = format!("1.2.826.0.1.31415926.9.{n}");
    let mut all: Vec<(u32, [u8; 2], Vec<u8>)> =
        TEXTS.iter().map(|&(tag, vr, text)| (tag, *vr, text.as_bytes().to_vec())).collect();
    let inner = [&[0xfe, 0xff, 0, 0xe0, 28, 0, 0, 0, 0x10, 0, 0x10, 0, b'P', b'N', 20, 0][..], b"SECRET^INNER^OF^ITEM"]
        .concat();
    all.push((0x0008_1140, *b"SQ", inner));
    all.push((0x0020_0032, *b"DS", place.into_bytes()));
    all.push((0x0020_0037, *b"DS", b"1\\0\\0\\0\\1\\0".to_vec()));
    all.push((0x0028_0030, *b"DS", b"1\\1".to_vec()));
    for (tag, value) in [(2u32, 1u16), (0x10, 3), (0x11, 4), (0x100, 16), (0x101, 16), (0x102, 15), (0x103, 0)] {
        all.push((0x0028_0000 + tag, *b"US", value.to_le_bytes().to_vec()));
    }
    all.push((0x0040_a160, *b"UT", b"SECRET unlimited text".to_vec()));
    all.push((0x7fe0_0010, *b"OW", (0..12).flat_map(|v: u16| v.to_le_bytes()).collect()));
    all.sort_by_key(|entry| entry.0);
    for (tag, vr, mut value) in all {
        if tag == 0x0008_0018 {
            value = instance.clone().into_bytes();
        }
        match wrong {
            Some((which, secret)) if which == tag => element(&mut bytes, tag, &vr, secret.as_bytes()),
            _ => element(&mut bytes, tag, &vr, &value),
        }
    }
    bytes
}

/// All output of the readers for a path.
fn output(path: &Path) -> String {
    let of = |result: Result<trepan_volume::Import, trepan_volume::ReadError>| match result {
        Ok(import) => format!("{import:?} {}", import.notes.iter().map(ToString::to_string).collect::<String>()),
        Err(error) => format!("{error} {error:?}"),
    };
    let mut all = of(import(path));
    if path.is_dir() {
        all += &format!("{:?}", dicom::series(path));
        all += &of(dicom::import_series(path, 0));
        all += &of(dicom::import_series(path, 9));
    }
    all
}

fn is_clean(text: &str, what: &str) {
    for secret in SECRETS {
        assert!(!text.contains(secret), "{secret:?} comes through from {what}: {text}");
    }
}

#[test]
fn no_identifier_of_a_dicom_series_passes() {
    let folder = tempfile::tempdir().unwrap();
    let file = |n: usize| folder.path().join(format!("{n}.dcm"));
    (0..4).for_each(|n| std::fs::write(file(n), slice(n, None)).unwrap());
    let whole = output(folder.path());
    assert!(whole.contains("dims: [4, 3, 4]"), "the series must be read for the test to mean something: {whole}");
    is_clean(&whole, "the whole series");
    let bytes = slice(1, None);
    for length in (132..bytes.len()).step_by(7) {
        std::fs::write(file(1), &bytes[..length]).unwrap();
        is_clean(&output(folder.path()), "a cut slice in a series");
        is_clean(&output(&file(1)), "a cut slice");
    }
    let numbers = [0x0020_0011, 0x0020_0032, 0x0020_0037, 0x0028_0030, 0x0028_1052];
    for (tag, secret) in numbers.into_iter().flat_map(|tag| SECRETS.map(|secret| (tag, secret))) {
        std::fs::write(file(1), slice(1, Some((tag, secret)))).unwrap();
        // Numbers such as series number, position or spacing are shown: only text is a secret
        // there.
        if secret.chars().any(char::is_alphabetic) {
            is_clean(&output(folder.path()), "a secret where a number belongs");
            is_clean(&output(&file(1)), "a secret where a number belongs");
        }
    }
    for secret in SECRETS {
        std::fs::write(file(1), slice(1, Some((0x0008_0060, secret)))).unwrap();
        is_clean(&output(folder.path()), "a secret as modality");
    }
}

fn every_cut_and_flip_is_clean(name: &str, bytes: &[u8]) {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let path = folder.path().join(name);
    let check = |bytes: &[u8]| {
        std::fs::write(&path, bytes).expect("room");
        is_clean(&output(&path), name);
    };
    check(bytes);
    assert!(import(&path).is_ok(), "{:?}", import(&path));
    (0..bytes.len()).step_by(3).for_each(|length| check(&bytes[..length]));
    for at in 0..bytes.len() {
        let mut flipped = bytes.to_vec();
        flipped[at] ^= 4;
        check(&flipped);
    }
}

#[test]
fn comments_and_names_in_the_other_formats_stay_there() {
    let voxels = [0u8; 16];
    let nrrd = "NRRD0004\n# SECRET comment\ntype: int16\ndimension: 3\nsizes: 2 2 2\nencoding: raw\nendian: little\n\
         space: right-anterior-superior\nspace directions: (1,0,0) (0,1,0) (0,0,1)\nspace origin: (0,0,0)\n\
         content: SECRET^NAME\npatient:=SECRET 161803398\nborn:=19450827\n\n";
    every_cut_and_flip_is_clean("a.nrrd", &[nrrd.as_bytes(), &voxels].concat());
    let meta = "ObjectType = Image\nNDims = 3\nComment = SECRET comment\nPatientName = SECRET^NAME\nPatientID = 161803398\n\
         PatientBirthDate = 19450827\nBinaryData = True\nBinaryDataByteOrderMSB = False\nTransformMatrix = 1 0 0 0 1 0 0 0 1\n\
         Offset = 0 0 0\nElementSpacing = 1 1 1\nDimSize = 2 2 2\nElementType = MET_SHORT\nElementDataFile = LOCAL\n";
    every_cut_and_flip_is_clean("a.mha", &[meta.as_bytes(), &voxels].concat());
    let mut nifti = vec![0u8; 352];
    nifti[0..4].copy_from_slice(&348i32.to_le_bytes());
    for (n, value) in [3i16, 2, 2, 2, 1, 1, 1, 1].into_iter().enumerate() {
        nifti[40 + 2 * n..42 + 2 * n].copy_from_slice(&value.to_le_bytes());
    }
    nifti[70..74].copy_from_slice(&[4, 0, 16, 0]);
    for at in [76, 80, 84, 88, 280, 300, 320] {
        nifti[at..at + 4].copy_from_slice(&1f32.to_le_bytes());
    }
    nifti[108..112].copy_from_slice(&352f32.to_le_bytes());
    nifti[254] = 1;
    nifti[344..348].copy_from_slice(b"n+1\0");
    // data_type, db_name, descrip, aux_file, intent_name
    for (at, text) in
        [(4, "SECRET"), (14, "SECRET^NAME"), (148, "SECRET 19450827 161803398"), (228, "SECRETFILE"), (328, "SECRET")]
    {
        nifti[at..at + text.len()].copy_from_slice(text.as_bytes());
    }
    nifti.extend(voxels);
    every_cut_and_flip_is_clean("a.nii", &nifti);
}
