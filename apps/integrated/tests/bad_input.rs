//! Wrong inputs: the error names the file, the field and the remedy, the exit code is 2, and no
//! file is left.
#![expect(clippy::unwrap_used, reason = "a test may panic")]

use glam::{DAffine3, DVec3, Vec3};
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};
use trepan_volume::{VoxelVolume, nifti};

struct Bench {
    folder: tempfile::TempDir,
}

impl Bench {
    fn new() -> Self {
        Self { folder: tempfile::tempdir().expect("a temporary folder") }
    }

    fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    /// Writes a small CT of 64 mm: a hollow ball of bone centred at `centre`.
    fn ct(&self, name: &str, centre: Vec3) -> PathBuf {
        let mut ct = VoxelVolume::isotropic([32, 32, 32], centre - 31.0, 2.0, -1000i16);
        for at in 0..ct.data.len() {
            let r = (ct.centre_of([at % 32, at / 32 % 32, at / 1024]).as_vec3() - centre).length();
            ct.data[at] = if (24.0..29.0).contains(&r) {
                1200
            } else if r < 24.0 {
                40
            } else {
                -1000
            };
        }
        nifti::write(&self.path(name), &ct).expect("the CT is written");
        self.path(name)
    }

    fn mri(&self, name: &str) -> PathBuf {
        let mri = VoxelVolume::isotropic([32, 32, 32], Vec3::splat(-31.0), 2.0, 80u8);
        nifti::write(&self.path(name), &mri).expect("the MRI is written");
        self.path(name)
    }

    fn run(&self, arguments: &[&str]) -> Output {
        Command::new(env!("CARGO_BIN_EXE_integrated"))
            .args(["--headless", "--duration", "1", "--out"])
            .arg(self.path("out"))
            .args(arguments)
            .env("TREPAN_CACHE", self.path("cache"))
            .output()
            .unwrap()
    }

    /// Asserts exit code 2, all words in the message, no panic and no files left.
    fn refuses(&self, arguments: &[&str], words: &[&str]) {
        let output = self.run(arguments);
        let log = String::from_utf8_lossy(&output.stderr).to_string();
        assert_eq!(output.status.code(), Some(2), "{arguments:?}: {log}");
        assert!(!log.contains("panicked"), "{log}");
        for word in words {
            assert!(log.contains(word), "{arguments:?} should say {word:?} but says: {log}");
        }
        assert!(!self.path("out").exists(), "an output folder was left");
        let kept = fs::read_dir(self.path("cache")).map_or(0, Iterator::count);
        assert_eq!(kept, 0, "something was left in the cache");
    }

    fn refuses_ct(&self, ct: &Path, words: &[&str]) {
        let mri = self.mri("mri.nii");
        self.refuses(&["--ct", ct.to_str().unwrap(), "--mri", mri.to_str().unwrap()], words);
    }
}

#[test]
fn a_missing_file() {
    let bench = Bench::new();
    bench.refuses_ct(&bench.path("no-such.nii.gz"), &["no-such.nii.gz", "give"]);
}

#[test]
fn a_truncated_gzip() {
    let bench = Bench::new();
    let whole = fs::read(bench.ct("ct.nii.gz", Vec3::ZERO)).unwrap();
    let cut = bench.path("cut.nii.gz");
    fs::write(&cut, &whole[..whole.len() / 2]).unwrap();
    bench.refuses_ct(&cut, &["cut.nii.gz"]);
}

#[test]
fn a_wrong_magic() {
    let bench = Bench::new();
    let text = bench.path("notes.nii");
    fs::write(&text, "this is not an image\n".repeat(100)).unwrap();
    bench.refuses_ct(&text, &["notes.nii"]);
}

#[test]
fn a_picture_of_two_dimensions() {
    let bench = Bench::new();
    let ct = bench.ct("flat.nii", Vec3::ZERO);
    let mut bytes = fs::read(&ct).unwrap();
    bytes[40..42].copy_from_slice(&2i16.to_le_bytes());
    bytes[46..48].copy_from_slice(&1i16.to_le_bytes());
    fs::write(&ct, bytes).unwrap();
    bench.refuses_ct(&ct, &["flat.nii", "dim"]);
}

#[test]
fn voxels_that_are_nan() {
    let bench = Bench::new();
    let nan = VoxelVolume::isotropic([16, 16, 16], Vec3::splat(-15.0), 2.0, f32::NAN);
    nifti::write(&bench.path("nan.nii"), &nan).unwrap();
    bench.refuses_ct(&bench.path("nan.nii"), &["nan.nii", "NaN", "4096"]);
}

#[test]
fn an_empty_mask() {
    let bench = Bench::new();
    let (ct, mri) = (bench.ct("ct.nii", Vec3::ZERO), bench.mri("mri.nii"));
    let mask = VoxelVolume::filled([32, 32, 32], DAffine3::from_scale(DVec3::splat(2.0)), 0u8);
    nifti::write(&bench.path("empty.nii"), &mask).unwrap();
    let labels = bench.path("empty.nii");
    let arguments =
        ["--ct", ct.to_str().unwrap(), "--mri", mri.to_str().unwrap(), "--labels", labels.to_str().unwrap()];
    bench.refuses(&arguments, &["empty.nii", "empty"]);
}

#[test]
fn images_that_do_not_overlap() {
    let bench = Bench::new();
    let ct = bench.ct("far.nii", Vec3::splat(500.0));
    bench.refuses_ct(&ct, &["do not overlap", "468", "-32"]);
}

#[test]
fn unknown_names() {
    let bench = Bench::new();
    bench.refuses(&["--device", "script:sneeze"], &["sneeze", "craniotomy-and-probe"]);
    bench.refuses(&["--device", "telepathy"], &["telepathy", "force-dimension"]);
    bench.refuses(&["--device", "replay:no-such.mcap"], &["no-such.mcap"]);
    bench.refuses(&["--device", "mouse"], &["window"]);
    bench.refuses(&["--quality", "best"], &["best", "auto, draft, usual, fine"]);
    bench.refuses(&["--displacement-mm", "-1"], &["--displacement-mm"]);
    bench.refuses(&["--rigid", "magic"], &["magic", "thesis"]);
    bench.refuses(&["--solver", "magic"], &["magic", "tled"]);
    bench.refuses(&["--duration", "-3"], &["duration"]);
    bench.refuses(&["--ct", "only.nii"], &["--mri"]);
    bench.refuses(&["--record", "no/such/folder/x.mcap"], &["no/such/folder"]);
    bench.refuses(&["--case", "no-such-case"], &["no-such-case", "case build"]);
}
