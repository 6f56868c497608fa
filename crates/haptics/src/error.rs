//! Why a device cannot be opened, and what to install or do.

/// A device could not be opened.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum DeviceError {
    /// The vendor's library is not there or does not load.
    #[error("cannot load {library}: {reason}; {install}")]
    Library {
        /// Names that were tried.
        library: String,
        /// The loader's own words.
        reason: String,
        /// What to install.
        install: &'static str,
    },
    /// The library lacks a function.
    #[error("{library} lacks the function {symbol}: {reason}; {install}")]
    Symbol {
        /// The library.
        library: String,
        /// The function.
        symbol: &'static str,
        /// The loader's own words.
        reason: String,
        /// What to install.
        install: &'static str,
    },
    /// The library is there, the device is not.
    #[error("cannot open {device}: {reason}; {remedy}")]
    Open {
        /// The device as it was asked for.
        device: String,
        /// The vendor's own words.
        reason: String,
        /// What to do.
        remedy: &'static str,
    },
}
