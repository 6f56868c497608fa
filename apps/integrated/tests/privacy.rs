//! No identifier of a patient gets from the input files into a case, its cache, a recording, a
//! report or a log.
#![expect(clippy::unwrap_used, reason = "a test may panic")]

use glam::Vec3;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;
use trepan_link::Recording;
use trepan_volume::{VoxelVolume, nifti};

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

/// Writer of an explicit little-endian DICOM file.
struct Slice(Vec<u8>);

impl Slice {
    fn new() -> Self {
        let mut slice = Self([vec![0; 128], b"DICM".to_vec()].concat());
        slice.text(0x0002_0010, b"UI", "1.2.840.10008.1.2.1");
        slice
    }

    fn element(&mut self, tag: u32, vr: &[u8; 2], value: &[u8]) -> &mut Self {
        self.0.extend(((tag >> 16) as u16).to_le_bytes());
        self.0.extend((tag as u16).to_le_bytes());
        self.0.extend(vr);
        let even = value.len() + value.len() % 2;
        match vr {
            b"OW" | b"UN" | b"UT" => {
                self.0.extend([0, 0]);
                self.0.extend((even as u32).to_le_bytes());
            }
            _ => self.0.extend((even as u16).to_le_bytes()),
        }
        self.0.extend(value);
        self.0.resize(self.0.len() + even - value.len(), b' ');
        self
    }

    fn text(&mut self, tag: u32, vr: &[u8; 2], value: &str) -> &mut Self {
        self.element(tag, vr, value.as_bytes())
    }

    fn short(&mut self, tag: u32, value: u16) -> &mut Self {
        self.element(tag, b"US", &value.to_le_bytes())
    }
}

const SIDE: usize = 32;
const SPACING_MM: f32 = 2.0;

/// Makes a hollow ball of bone about the origin.
fn head() -> VoxelVolume<i16> {
    let mut ct = VoxelVolume::isotropic([SIDE; 3], Vec3::splat(-31.0), SPACING_MM, -1000i16);
    for at in 0..ct.data.len() {
        let r = ct.centre_of([at % SIDE, at / SIDE % SIDE, at / (SIDE * SIDE)]).length();
        ct.data[at] = match r {
            r if r < 24.0 => 40,
            r if r < 29.0 => 1200,
            _ => -1000,
        };
    }
    ct
}

/// Writes the head as a DICOM series with all identifiers that a hospital adds.
fn series(folder: &Path) -> PathBuf {
    let place = folder.join("MUSTERMANN^ERIKA");
    fs::create_dir(&place).unwrap();
    let ct = head();
    for k in 0..SIDE {
        let mut slice = Slice::new();
        slice.text(0x0008_0016, b"UI", "1.2.840.10008.5.1.4.1.1.2").text(
            0x0008_0018,
            b"UI",
            &format!("1.2.276.99.{k}"),
        );
        slice.text(0x0008_0050, b"SH", "ACC-0815").text(0x0008_0060, b"CS", "CT").text(
            0x0008_0080,
            b"LO",
            "Klinik-Nirgends",
        );
        slice.text(0x0008_0081, b"ST", "Lindenallee 5").text(0x0008_0090, b"PN", "Dr-Seltsam").text(
            0x0008_103e,
            b"LO",
            "series-for-her",
        );
        slice.text(0x0009_0010, b"LO", "PRIVATE-CREATOR").text(0x0009_1001, b"LT", "private-note").text(
            0x0009_1002,
            b"UN",
            "private-note",
        );
        slice.text(0x0010_0010, b"PN", "MUSTERMANN^ERIKA").text(0x0010_0020, b"LO", "PID-4711").text(
            0x0010_0030,
            b"DA",
            "19491224",
        );
        slice.text(0x0010_1005, b"PN", "MAIDENNAME^ERIKA").text(0x0010_1040, b"LO", "Lindenallee 5").text(
            0x0010_4000,
            b"LT",
            "comment-on-her",
        );
        slice.text(0x0020_000d, b"UI", "1.2.276.99.1").text(0x0020_000e, b"UI", "1.2.276.99.2").text(
            0x0020_4000,
            b"LT",
            "comment-on-her",
        );
        // DICOM's axes are left and posterior.
        slice.text(0x0020_0032, b"DS", &format!("31\\31\\{}", -31.0 + SPACING_MM * k as f32));
        slice.text(0x0020_0037, b"DS", "-1\\0\\0\\0\\-1\\0");
        slice
            .short(0x0028_0002, 1)
            .text(0x0028_0004, b"CS", "MONOCHROME2")
            .short(0x0028_0010, SIDE as u16)
            .short(0x0028_0011, SIDE as u16);
        slice
            .text(0x0028_0030, b"DS", "2\\2")
            .short(0x0028_0100, 16)
            .short(0x0028_0101, 16)
            .short(0x0028_0102, 15)
            .short(0x0028_0103, 1);
        slice.text(0x0028_1052, b"DS", "0").text(0x0028_1053, b"DS", "1").text(0x0040_a160, b"UT", "comment-on-her");
        let pixels: Vec<u8> =
            ct.data[k * SIDE * SIDE..][..SIDE * SIDE].iter().flat_map(|hu| hu.to_le_bytes()).collect();
        slice.element(0x7fe0_0010, b"OW", &pixels);
        fs::write(place.join(format!("MUSTERMANN-{k:02}.dcm")), slice.0).unwrap();
    }
    place
}

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
