//! DICOM folders, case folders, recordings, pipes and disks.

use crate::Wrong;
use crate::files::{self, Odd, sound};
use std::fs;
use std::path::Path;
use std::process::Command;

/// See [`Wrong`].
pub const TABLE: &[Wrong] = &[
    ("a folder of nothing", "CT=nothing", &["nothing", "no DICOM picture", "give the folder"]),
    ("a folder of texts", "CT=texts", &["texts", "no DICOM picture", "give the folder"]),
    ("a folder of a pipe", "CT=only-pipe", &["only-pipe", "no DICOM picture"]),
    ("a slice alone", "CT=one-slice", &["1 picture is no volume", "whole series"]),
    ("a slice missing", "CT=missing", &["1 slices are missing", "export the series again"]),
    ("a slice between", "CT=uneven", &["unevenly", "evenly spaced series"]),
    ("a slice beside", "CT=beside", &["beside the line", "folders of their own"]),
    ("every slice twice", "CT=doubled", &["lie where another one lies", "once"]),
    ("slices without a place", "CT=unplaced", &["ImageOrientationPatient", "export the original"]),
    ("slices without a spacing", "CT=unspaced", &["PixelSpacing", "export the original"]),
    ("slices in colour", "CT=colour", &["SamplesPerPixel is 3", "grey"]),
    ("slices of 12 allocated bits", "CT=twelve", &["BitsAllocated is 12", "8, 16 or 32"]),
    ("more bits than there is room for", "CT=many-bits", &["BitsStored", "allocated"]),
    ("slices cut off", "CT=short", &["PixelData", "fetch the file again"]),
    ("slices as video", "CT=video", &["TransferSyntaxUID", "Explicit VR Little Endian"]),
    ("JPEG that is none", "CT=jpeg", &["PixelData", "start with the marker SOI", "fetch the file again"]),
    ("JPEG-LS that is none", "CT=jpeg-ls", &["PixelData", "SOI", "fetch the file again"]),
    ("JPEG 2000 that is none", "CT=jpeg-2000", &["PixelData", "JPEG 2000 stream is damaged"]),
    ("run lengths that are none", "CT=run-lengths", &["PixelData", "byte planes", "fetch the file again"]),
    ("a slice without its rescale", "CT=unscaled", &["Rescale", "1 of 32 pictures", "export the series again"]),
    ("rows over all", "CT=tall", &["PixelData"]),
    ("an MRI series as CT", "CT=mr-series", &["modality is MR", "--ct", "--mri"]),
    ("a CT series as MRI", "MRI=series", &["modality is CT", "--ct", "--mri"]),
    ("an ultrasound series", "CT=us-series", &["modality is US", "--ct"]),
    ("a series beyond the last", "CT=two-series --ct-series 2", &["no series 2", "numbered 0 to 1", "case series"]),
    ("a series beyond the only one", "CT=series --ct-series 7", &["no series 7", "number 0", "case series"]),
    ("a series of the MRI", "MRI=mr-series --mri-series 1", &["no series 1", "case series"]),
    ("a second volume of one", "CT=ct.nii --ct-series 1", &["ct.nii", "no volume 1", "leave the number out"]),
    ("a series of a slice", "--ct IN/series/1.2.3-05.dcm --mri IN/mri.nii --ct-series 0", &["it is a file", "folder"]),
    ("series of no folder", "case series IN/ct.nii", &["ct.nii", "give the one that holds the slices"]),
    ("series of a missing folder", "case series IN/no-such", &["no-such", "give"]),
    ("series of an empty folder", "case series IN/nothing", &["no DICOM series", "give a folder of slices"]),
    ("a pipe as CT", "CT=pipe", &["pipe", "a named pipe", "regular file"]),
    ("a pipe as MRI", "MRI=pipe", &["pipe", "a named pipe"]),
    ("a pipe as labels", "LABELS=pipe", &["pipe", "a named pipe"]),
    ("a pipe as tissue", "CT=ct.nii --tissue tumour=IN/pipe", &["pipe", "a named pipe"]),
    ("a pipe as recording", "--device replay:IN/pipe", &["pipe", "not a regular file"]),
    ("a pipe to compare", "compare IN/pipe IN/whole.mcap --out OUT", &["pipe", "not a regular file"]),
    ("a device as CT", "--ct /dev/zero --mri IN/mri.nii", &["/dev/zero", "a device"]),
    ("a device as recording", "--device replay:/dev/zero", &["/dev/zero", "not a regular file"]),
    ("a case that is not there", "--case IN/no-such", &["no-such", "case build"]),
    ("a case of nothing", "--case IN/nothing", &["case.json", "case build"]),
    ("a case of a file", "--case IN/ct.nii", &["ct.nii", "case build"]),
    ("a case without sense", "--case IN/case-text", &["case.json", "case build"]),
    ("a case of another form", "--case IN/case-form", &["form 99", "case build"]),
    ("a case that lacks a file", "--case IN/case-lacks", &["skull.nii", "case build"]),
    ("a case that was changed", "--case IN/case-changed", &["skull.nii", "not what it was", "case build"]),
    ("a case of a pipe", "--case IN/case-pipe", &["case.json", "a named pipe"]),
    ("a case over another", "case build CT=ct.nii --out IN/nothing", &["exists already", "name a folder"]),
    ("a case of nothing known", "case build --ct IN/no-such.nii --mri IN/mri.nii --out OUT", &["no-such.nii", "give"]),
    ("a plan of nothing known", "plan --ct IN/no-such.nii --mri IN/mri.nii", &["no-such.nii", "give"]),
    ("a plan out of range", "plan --rate-hz 1", &["rate-hz", "100 to 10000"]),
    ("a plan of bad tolerances", "plan --displacement-mm 0", &["--displacement-mm", "0.0001 to 100"]),
    ("a recording that is missing", "--device replay:IN/no-such.mcap", &["no-such.mcap", "check the name"]),
    ("a recording of nothing", "--device replay:IN/void.mcap", &["void.mcap", "--record"]),
    ("a recording of text", "--device replay:IN/text.mcap", &["text.mcap", "--record"]),
    ("a recording cut in its head", "--device replay:IN/cut.mcap", &["cut.mcap", "--record"]),
    ("a folder without recordings", "--device replay:IN/no-recordings", &["no-recordings", "no .mcap"]),
    ("nothing to compare", "compare IN/no-such.mcap IN/whole.mcap --out OUT", &["no-such.mcap", "check the name"]),
    ("a text to compare", "compare IN/whole.mcap IN/text.mcap --out OUT", &["text.mcap", "--record"]),
    ("no room for a case", "case build FILES=16 CT=ct.nii --tets 500 --spacing-mm 2 --out OUT", &["/out", "room"]),
    ("no room for a session", "FILES=16 CT=ct.nii --tets 500 --spacing-mm 2", &["too large", "--out"]),
];

/// Makes invalid folders and files.
pub fn make(home: &Path) {
    let place = |name: &str| home.join(name);
    let each = |name: &str, odd: &dyn Fn(usize) -> Option<Odd>| files::series(&place(name), odd);
    let all = |name: &str, change: fn(Odd) -> Odd| files::series(&place(name), |k| Some(change(sound(k))));
    all("series", |odd| odd);
    each("one-slice", &|k| (k == 3).then(|| sound(k)));
    each("missing", &|k| (k != 9).then(|| sound(k)));
    each("uneven", &|k| Some(Odd { height_mm: sound(k).height_mm + if k == 9 { 0.7 } else { 0.0 }, ..sound(k) }));
    each("beside", &|k| Some(Odd { beside_mm: if k == 9 { 5.0 } else { 0.0 }, ..sound(k) }));
    each("doubled", &|k| Some(Odd { height_mm: sound(k / 2).height_mm, ..sound(k) }));
    all("unplaced", |odd| Odd { placed: false, ..odd });
    all("unspaced", |odd| Odd { spaced: false, ..odd });
    all("colour", |odd| Odd { samples: 3, ..odd });
    all("twelve", |odd| Odd { bits: [12, 12, 11], ..odd });
    all("many-bits", |odd| Odd { bits: [16, 32, 31], ..odd });
    all("short", |odd| Odd { pixels: 100, ..odd });
    all("video", |odd| Odd { syntax: "1.2.840.10008.1.2.4.100", ..odd });
    all("jpeg", |odd| Odd { syntax: "1.2.840.10008.1.2.4.70", ..odd });
    all("jpeg-ls", |odd| Odd { syntax: "1.2.840.10008.1.2.4.80", ..odd });
    all("jpeg-2000", |odd| Odd { syntax: "1.2.840.10008.1.2.4.90", ..odd });
    all("run-lengths", |odd| Odd { syntax: "1.2.840.10008.1.2.5", ..odd });
    each("unscaled", &|k| Some(Odd { scaled: k != 9, ..sound(k) }));
    all("tall", |odd| Odd { rows: 65535, ..odd });
    all("mr-series", |odd| Odd { modality: "MR", ..odd });
    all("us-series", |odd| Odd { modality: "US", ..odd });
    all("two-series", |odd| odd);
    files::series(&place("two-series"), |k| Some(Odd { series: "1.2.4", ..sound(k) }));
    for name in ["nothing", "texts", "only-pipe", "session"] {
        fs::create_dir(place(name)).unwrap();
    }
    fs::write(place("texts/readme.txt"), "slices lie elsewhere").unwrap();
    fs::write(place("session/summary.json"), "{}").unwrap();
    all("pipe-beside", |odd| odd);
    cases(home);
    for name in ["pipe", "only-pipe/pipe", "pipe-beside/pipe", "case-pipe/case.json"] {
        assert!(Command::new("mkfifo").arg(place(name)).status().unwrap().success());
    }
}

/// Makes invalid case folders.
fn cases(home: &Path) {
    let card = |form: u32, files: &str| {
        format!(
            "{{\"form\":{form},\"name\":\"c\",\"hash\":\"ab\",\"version\":\"0\",\"isovalue_hu\":300,\"opening\":null,\"recipe\":null,\"notes\":[],\"files\":{{{files}}}}}"
        )
    };
    let skull = "\"skull.nii\":\"00\"";
    let cards = [
        ("case-text", "not JSON".into()),
        ("case-form", card(99, "")),
        ("case-lacks", card(7, skull)),
        ("case-changed", card(7, skull)),
        ("case-pipe", String::new()),
    ];
    for (name, text) in cards {
        fs::create_dir(home.join(name)).unwrap();
        if !text.is_empty() {
            fs::write(home.join(name).join("case.json"), text).unwrap();
        }
    }
    fs::write(home.join("case-changed/skull.nii"), "changed").unwrap();
}
