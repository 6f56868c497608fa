//! Builds the emulated libraries as shared libraries for the target of this build.

use std::path::{Path, PathBuf};
use std::process::Command;

/// File under `libraries/`, name of the result, extra flags.
const LIBRARIES: [(&str, &str, &[&str]); 4] = [
    ("fake_hd", "hd", &[]),
    ("fake_drd", "drd", &[]),
    ("fake_drd", "old_drd", &["--cfg", "old"]),
    ("fake_nothing", "nothing", &[]),
];

fn main() {
    println!("cargo::rerun-if-changed=libraries");
    let out = PathBuf::from(variable("OUT_DIR"));
    for (file, name, flags) in LIBRARIES {
        let source = Path::new("libraries").join(file).with_extension("rs");
        let built = Command::new(variable("RUSTC"))
            .args(["--edition", "2024", "--crate-type", "cdylib", "--cap-lints", "allow", "--crate-name", name])
            .args(["-C", "panic=abort", "-C", "debuginfo=0", "--target", &variable("TARGET"), "-o"])
            .args([&out.join(format!("{name}.library")), &source])
            .args(flags)
            .status();
        assert!(built.is_ok_and(|status| status.success()), "{file} does not build");
    }
}

fn variable(name: &str) -> String {
    std::env::var(name).unwrap_or_else(|error| panic!("cargo sets {name} for a build script: {error}"))
}
