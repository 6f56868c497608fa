//! No identifier of a patient gets from the input files into a case, its cache, a recording, a
//! report or a log.
#![expect(clippy::unwrap_used, reason = "a test may panic")]

mod dicom;

use dicom::{head, series};
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;
use trepan_link::Recording;
use trepan_volume::nifti;

/// Identifiers of the patient in the headers and file names below.
const SECRETS: [&str; 14] = [
    "MUSTERMANN",
    "MAIDENNAME",
    "PID-4711",
    "19491224",
    "ACC-0815",
    "Dr-Seltsam",
    "Klinik-Nirgends",
    "Lindenallee",
    "PRIVATE-CREATOR",
    "private-note",
    "1.2.276.99",
    "comment-on-her",
    "series-for-her",
    "nifti-of-her",
];

/// Writes a ball as NIfTI, with an identifier in each free text of the header.
fn ball(folder: &Path, name: &str, inside: u8, outside: u8) -> PathBuf {
    let ball = head().map(|hu| if hu == 40 { inside } else { outside });
    let path = folder.join(name);
    nifti::write(&path, &ball).unwrap();
    let mut bytes = fs::read(&path).unwrap();
    for at in [14, 148, 228] {
        bytes[at..at + 12].copy_from_slice(b"nifti-of-her");
    }
    fs::write(&path, bytes).unwrap();
    path
}

/// Returns every file below a folder, decompressed.
fn contents(folder: &Path) -> Vec<(PathBuf, Vec<u8>)> {
    let mut found = Vec::new();
    for entry in fs::read_dir(folder).unwrap().flatten() {
        let path = entry.path();
        if path.is_dir() {
            found.extend(contents(&path));
            continue;
        }
        let name = path.to_str().unwrap();
        let bytes = match name {
            name if name.ends_with(".mcap") => format!("{:?}", Recording::open(&path).unwrap()).into_bytes(),
            name if name.ends_with(".gz") => {
                let plain = path.with_extension("unpacked.nii");
                nifti::write(&plain, &nifti::read(&path).unwrap()).unwrap();
                fs::read(plain).unwrap()
            }
            _ => fs::read(&path).unwrap(),
        };
        found.push((path, bytes));
    }
    found
}

/// Asserts that other users cannot read the contents of a folder.
#[cfg(unix)]
fn private(folder: &Path) {
    use std::os::unix::fs::PermissionsExt;
    for entry in fs::read_dir(folder).unwrap().flatten() {
        let mode = entry.metadata().unwrap().permissions().mode();
        assert_eq!(mode & 0o077, 0, "{} has mode {mode:o}", entry.path().display());
        if entry.path().is_dir() {
            private(&entry.path());
        }
    }
}

/// Asserts that bytes contain no identifier.
fn assert_no_identifier(what: &str, bytes: &[u8]) {
    for secret in SECRETS {
        let found = bytes.windows(secret.len()).any(|window| window == secret.as_bytes());
        assert!(!found, "{what} contains {secret:?}");
    }
}

#[test]
fn no_identifier_leaves_the_input_files() {
    let home = tempfile::tempdir().unwrap();
    let (inputs, made) = (home.path().join("in"), home.path().join("made"));
    fs::create_dir(&inputs).unwrap();
    let ct = series(&inputs);
    let mri = ball(&inputs, "MUSTERMANN-t1.nii", 90, 5);
    let labels = ball(&inputs, "MUSTERMANN-brain.nii", 1, 0);
    let images =
        ["--ct".as_ref(), ct.as_os_str(), "--mri".as_ref(), mri.as_os_str(), "--labels".as_ref(), labels.as_os_str()];
    let run = |before: &[&str], out: &str, after: &[&str]| {
        let mut command = Command::new(env!("CARGO_BIN_EXE_integrated"));
        command.args(before).args(images).arg("--out").arg(made.join(out)).args(after);
        let output = command.env("TREPAN_CACHE", made.join("cache")).env("RUST_LOG", "info").output().unwrap();
        let log = [output.stdout, output.stderr].concat();
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&log));
        assert_no_identifier("the log", &log);
    };
    fs::create_dir(&made).unwrap();
    run(&["case", "build"], "case", &[]);
    run(&["--headless", "--quality", "usual", "--duration", "1", "--picture", "64x48", "--stl"], "session", &[]);
    #[cfg(unix)]
    private(&made);
    let files = contents(&made);
    for name in
        ["case.json", "skull.nii", "session.mcap", "summary.json", "report.html", "drilled.nii.gz", "drilled.stl"]
    {
        assert!(files.iter().any(|(path, _)| path.ends_with(name)), "{name} was not made: the test looks at nothing");
    }
    for (path, bytes) in &files {
        assert_no_identifier(&path.display().to_string(), bytes);
        assert_no_identifier("a file name", path.strip_prefix(&made).unwrap().as_os_str().as_encoded_bytes());
    }
}
