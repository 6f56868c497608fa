//! Why a device cannot be opened, and what to install or do.

/// A device could not be opened.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum DeviceError {
    /// The vendor's library is missing or does not load.
    #[error("cannot load {library}: {reason}; {install}")]
    Library {
        /// Names that were tried.
        library: String,
        /// The loader's message.
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
        /// The loader's message.
        reason: String,
        /// What to install.
        install: &'static str,
    },
    /// The library is present but the device cannot be opened.
    #[error("cannot open {device}: {reason}; {remedy}")]
    Open {
        /// The requested device.
        device: String,
        /// The vendor's message.
        reason: String,
        /// What to do.
        remedy: &'static str,
    },
    /// The operation that moves a virtual device cannot be made.
    #[error(transparent)]
    Script(#[from] crate::script::ScriptError),
}

impl DeviceError {
    /// The device cannot be opened.
    pub fn open(device: impl Into<String>, reason: impl Into<String>, remedy: &'static str) -> Self {
        Self::Open { device: device.into(), reason: reason.into(), remedy }
    }
}
