//! Builds the emulators: shared libraries with the vendors' symbols.
#![expect(unsafe_code, reason = "calls into the emulator")]

use std::path::{Path, PathBuf};
use std::process::Command;

/// A copy of an emulator of its own: a library that the loader has not seen keeps its own state.
pub struct Emulator {
    library: libloading::Library,
    path: PathBuf,
    _folder: tempfile::TempDir,
}

impl Emulator {
    /// Compiles `tests/emulators/{name}.rs` with the compiler that builds the tests.
    pub fn build(name: &str, flags: &[&str]) -> Self {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join(format!("lib{name}.so"));
        let source = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/emulators").join(name).with_extension("rs");
        let compiler = std::env::var_os("RUSTC").unwrap_or_else(|| "rustc".into());
        let built = Command::new(compiler)
            .args([
                "--edition",
                "2024",
                "--crate-type",
                "cdylib",
                "-C",
                "panic=abort",
                "-C",
                "debuginfo=0",
                "--cap-lints",
                "allow",
                "-o",
            ])
            .args([&path, &source])
            .args(flags)
            .status();
        assert!(built.unwrap().success(), "{name} does not build");
        // SAFETY: a library that was just built from this repository.
        let library = unsafe { libloading::Library::new(&path) }.unwrap();
        Self { library, path, _folder: folder }
    }

    pub fn path(&self) -> &Path {
        &self.path
    }

    pub fn set(&self, key: u32, value: f64) {
        // SAFETY: the emulator's own function, of this type.
        unsafe { self.library.get::<extern "C" fn(u32, f64)>(b"fake_set") }.unwrap()(key, value);
    }

    pub fn get(&self, key: u32) -> f64 {
        // SAFETY: the emulator's own function, of this type.
        unsafe { self.library.get::<extern "C" fn(u32) -> f64>(b"fake_get") }.unwrap()(key)
    }
}
