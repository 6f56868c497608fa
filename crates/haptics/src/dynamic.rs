//! Loads vendor libraries when a device is opened: building and running without them needs nothing
//! proprietary.
//!
//! # Practice
//! A library is never unloaded: the vendors' own threads may outlive it, and loading it twice in
//! one process is known to fail.
#![expect(unsafe_code, reason = "loading a library runs its initialisers, and a symbol's type cannot be checked")]

use crate::DeviceError;
use libloading::Library;
use std::ffi::{CStr, OsStr, c_char};
use std::path::Path;

/// A loaded library.
pub(crate) struct Loaded {
    library: &'static Library,
    name: String,
    install: &'static str,
}

impl Loaded {
    /// Loads `path`, or the first of `names` that the system finds.
    pub(crate) fn open(path: Option<&Path>, names: &[&str], install: &'static str) -> Result<Self, DeviceError> {
        let wanted: Vec<&OsStr> = match path {
            Some(path) => vec![path.as_os_str()],
            None => names.iter().map(OsStr::new).collect(),
        };
        let mut reasons = Vec::new();
        for name in &wanted {
            // SAFETY: a vendor's library that the user installed or named; its initialisers are
            // trusted like those of any installed program.
            match unsafe { Library::new(name) } {
                Ok(library) => {
                    let name = name.to_string_lossy().into_owned();
                    return Ok(Self { library: Box::leak(Box::new(library)), name, install });
                }
                Err(error) => {
                    let words = error.to_string();
                    let own = format!("{}: ", name.to_string_lossy());
                    reasons.push(words.strip_prefix(&own).unwrap_or(&words).to_owned());
                }
            }
        }
        // The loader reports the same for every name, or for a missing dependency.
        reasons.dedup();
        let library = wanted.iter().map(|name| name.to_string_lossy()).collect::<Vec<_>>().join(" or ");
        Err(DeviceError::Library { library, reason: reasons.join("; "), install })
    }

    /// Looks up the function `symbol`.
    ///
    /// # Safety
    /// `F` must be the function's true type, an `extern "system"` function pointer.
    pub(crate) unsafe fn symbol<F: Copy + 'static>(&self, symbol: &'static str) -> Result<F, DeviceError> {
        // SAFETY: the caller guarantees the type; the library is never unloaded, so the pointer
        // stays valid.
        match unsafe { self.library.get::<F>(symbol.as_bytes()) } {
            Ok(function) => Ok(*function),
            Err(error) => Err(DeviceError::Symbol {
                library: self.name.clone(),
                symbol,
                reason: error.to_string(),
                install: self.install,
            }),
        }
    }

    /// The name under which the library was found.
    pub(crate) fn name(&self) -> &str {
        &self.name
    }
}

/// Declares a library: a struct of function pointers, all required, each looked up by name. Those
/// under `safe` take numbers only, and an invalid one only raises an error.
macro_rules! functions {
    ($(#[$doc:meta])* $table:ident {
        safe { $($plain:ident($($number:ty),*) $(-> $answer:ty)?;)* }
        $($name:ident($($argument:ty),*) $(-> $result:ty)?;)*
    }) => {
        $(#[$doc])*
        #[expect(non_snake_case, reason = "the vendor's names")]
        #[derive(Clone, Copy)]
        pub(super) struct $table {
            $(pub(super) $plain: extern "system" fn($($number),*) $(-> $answer)?,)*
            $($name: unsafe extern "system" fn($($argument),*) $(-> $result)?,)*
        }

        impl $table {
            fn of(library: &$crate::dynamic::Loaded) -> Result<Self, $crate::DeviceError> {
                Ok(Self {
                    $(
                        // SAFETY: the types are those of the vendor's header.
                        $name: unsafe { library.symbol(stringify!($name)) }?,
                    )*
                    $(
                        // SAFETY: the types are the vendor's header's, which accepts any number.
                        $plain: unsafe { library.symbol(stringify!($plain)) }?,
                    )*
                })
            }
        }
    };
}

pub(crate) use functions;

/// Copies a library's text.
///
/// # Safety
/// `text` is null or a C string.
pub(crate) unsafe fn owned(text: *const c_char) -> String {
    if text.is_null() {
        return "no description".to_owned();
    }
    // SAFETY: not null; the caller guarantees the rest.
    unsafe { CStr::from_ptr(text) }.to_string_lossy().into_owned()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_missing_library_gives_the_loaders_words_and_what_to_install() {
        let error =
            Loaded::open(None, &["libtrepan-none.so"], "install nothing").err().expect("there is none").to_string();
        assert!(error.contains("libtrepan-none.so") && error.contains("install nothing"), "{error}");
        let loaders_words = error.split(';').next().unwrap_or_default();
        assert!(loaders_words.len() > "cannot load libtrepan-none.so: ".len() + 10, "{error}");
    }
}
