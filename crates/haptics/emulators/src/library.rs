//! Emulated libraries, ready to be loaded.
#![expect(unsafe_code, reason = "calls into the emulator")]

use std::path::{Path, PathBuf};

/// A separate copy of an emulated library: the loader gives each new file its own state.
pub struct Library {
    library: libloading::Library,
    path: PathBuf,
    _folder: tempfile::TempDir,
}

impl Library {
    /// libHD, with up to two devices.
    pub fn hd() -> Self {
        Self::copied(include_bytes!(concat!(env!("OUT_DIR"), "/hd.library")))
    }

    /// libdrd, with one device.
    pub fn drd() -> Self {
        Self::copied(include_bytes!(concat!(env!("OUT_DIR"), "/drd.library")))
    }

    /// libdrd of an older version, without its optional functions.
    pub fn old_drd() -> Self {
        Self::copied(include_bytes!(concat!(env!("OUT_DIR"), "/old_drd.library")))
    }

    /// A library without any of the vendors' functions.
    pub fn nothing() -> Self {
        Self::copied(include_bytes!(concat!(env!("OUT_DIR"), "/nothing.library")))
    }

    fn copied(bytes: &[u8]) -> Self {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join(libloading::library_filename("emulated"));
        std::fs::write(&path, bytes).unwrap();
        // SAFETY: a library that this crate's build script made from this repository.
        let library = unsafe { libloading::Library::new(&path) }.unwrap();
        Self { library, path, _folder: folder }
    }

    /// The library's file, for the driver to load.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Sets the value of a key.
    pub fn set(&self, key: u32, value: f64) {
        // SAFETY: the emulator's own function, of this type.
        unsafe { self.library.get::<extern "C" fn(u32, f64)>(b"fake_set") }.unwrap()(key, value);
    }

    /// Returns the value of a key.
    pub fn get(&self, key: u32) -> f64 {
        // SAFETY: the emulator's own function, of this type.
        unsafe { self.library.get::<extern "C" fn(u32) -> f64>(b"fake_get") }.unwrap()(key)
    }
}
