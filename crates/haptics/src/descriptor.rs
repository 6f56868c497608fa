//! A kind of device as a value: what it is called, what it takes, how it is opened.
//!
//! # Practice
//! A kind is one file with a [`HapticDevice`] and a [`Descriptor`]. [`DeviceName::among`] makes it
//! usable from any crate (`tests/toy_device.rs`); a `mod` line and its name in `list.rs` bring it
//! to the command lines.

use crate::mouse::MouseHandle;
use crate::script::{Script, ScriptError};
use crate::{DeviceError, HapticDevice, Watch, Workspace};
use std::path::Path;

/// A kind of device.
#[derive(Debug)]
pub struct Descriptor {
    /// Name on command lines.
    pub name: &'static str,
    /// What follows the name on a command line, as in `:FILE` or `[:NAME]`; empty for nothing.
    pub usage: &'static str,
    /// Vendor's library, protocol or model that it follows.
    pub source: &'static str,
    /// Where its motion comes from.
    pub motion: Motion,
    /// Checks what follows the name's colon, and returns it in the form that is kept. It gets the
    /// name, for messages.
    pub argument: fn(&str, Option<&str>) -> Result<Option<String>, NameError>,
    /// The part of an argument that names the device; empty for any of its kind.
    pub id: fn(&str) -> &str,
    /// Lists the devices by the names that open them; an error says what is missing and how to fix
    /// it. Opens none: that could move it.
    pub probe: fn() -> Result<Vec<Listed>, DeviceError>,
    /// Opens the device of an argument with the recommended settings.
    pub open: fn(Option<&str>, &Setting<'_>) -> Result<OpenedDevice, DeviceError>,
}

/// Where a device's motion comes from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Motion {
    /// A hand that holds hardware.
    Hardware,
    /// The window's pointer.
    Window,
    /// A scripted operation, which the argument names.
    Script,
    /// A recorded session, whose file the argument names; the session reads it.
    Recording,
}

/// Where a device is opened.
pub struct Setting<'a> {
    /// Maps the device's space to world space.
    pub workspace: Workspace,
    /// Makes the scripted operation of a name, or the program's usual one.
    pub script: &'a dyn Fn(Option<&str>) -> Result<Script, ScriptError>,
}

/// An open device and its other ends.
pub struct OpenedDevice {
    /// The device, for the haptic loop.
    pub device: Box<dyn HapticDevice>,
    /// Its faults, for the code that shows messages, if it can have any.
    pub watch: Option<Watch>,
    /// The window's end, if the window moves it.
    pub pointer: Option<MouseHandle>,
}

impl OpenedDevice {
    /// A device without faults.
    pub fn new(device: impl HapticDevice + 'static) -> Self {
        Self { device: Box::new(device), watch: None, pointer: None }
    }

    /// A device whose faults `watch` shows.
    pub fn watched(watch: Watch, device: impl HapticDevice + 'static) -> Self {
        Self { watch: Some(watch), ..Self::new(device) }
    }
}

/// A device that a user can request.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Listed {
    /// What to write after `--device`.
    pub name: String,
    /// Whether it is available, and if not, what is missing.
    pub state: String,
}

impl Listed {
    /// A device by its name and state.
    pub fn new(name: impl Into<String>, state: impl Into<String>) -> Self {
        Self { name: name.into(), state: state.into() }
    }
}

/// The device that a user requested: a kind and what follows its colon.
#[derive(Clone, Debug)]
pub struct DeviceName {
    kind: &'static Descriptor,
    argument: Option<String>,
}

impl DeviceName {
    pub(crate) const fn new(kind: &'static Descriptor, argument: Option<String>) -> Self {
        Self { kind, argument }
    }

    /// The device that `text` names, of one of the `kinds`.
    pub fn among(kinds: &[&'static Descriptor], text: &str) -> Result<Self, NameError> {
        let (name, argument) = match text.split_once(':') {
            Some((name, argument)) => (name, Some(argument).filter(|argument| !argument.is_empty())),
            None => (text, None),
        };
        let known = || kinds.iter().map(|kind| format!("{}{}", kind.name, kind.usage)).collect::<Vec<_>>().join(", ");
        let kind = kinds.iter().copied().find(|kind| kind.name == name);
        let kind = kind.ok_or_else(|| NameError::Unknown { name: text.to_owned(), known: known() })?;
        Ok(Self { kind, argument: (kind.argument)(name, argument)? })
    }

    /// Its kind of device.
    pub fn kind(&self) -> &'static Descriptor {
        self.kind
    }

    /// Name of the scripted operation that moves it, if one does.
    pub fn operation(&self) -> Option<&str> {
        self.argument.as_deref().filter(|_| self.kind.motion == Motion::Script)
    }

    /// File of the recording that moves it, if one does.
    pub fn recording(&self) -> Option<&Path> {
        self.argument.as_deref().filter(|_| self.kind.motion == Motion::Recording).map(Path::new)
    }

    /// Whether it is hardware that a hand holds.
    pub fn is_hardware(&self) -> bool {
        self.kind.motion == Motion::Hardware
    }

    /// Whether both names may mean the same hardware device; a name without an id may mean any of
    /// its kind.
    pub fn may_be(&self, other: &Self) -> bool {
        let id = |name: &Self| name.argument.as_deref().map_or("", self.kind.id).to_owned();
        let (one, two) = (id(self), id(other));
        std::ptr::eq(self.kind, other.kind) && self.is_hardware() && (one.is_empty() || two.is_empty() || one == two)
    }

    /// Opens the device with the recommended settings.
    pub fn open(&self, setting: &Setting<'_>) -> Result<OpenedDevice, DeviceError> {
        (self.kind.open)(self.argument.as_deref(), setting)
    }
}

impl PartialEq for DeviceName {
    fn eq(&self, other: &Self) -> bool {
        std::ptr::eq(self.kind, other.kind) && self.argument == other.argument
    }
}

impl std::fmt::Display for DeviceName {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(self.kind.name)?;
        self.argument.iter().try_for_each(|argument| write!(f, ":{argument}"))
    }
}

/// The [`Descriptor::argument`] of a device that takes none.
pub fn no_argument(name: &str, argument: Option<&str>) -> Result<Option<String>, NameError> {
    match argument {
        None => Ok(None),
        Some(extra) => Err(NameError::Argument(format!("{name:?} takes no {extra:?}; write {name}"))),
    }
}

/// Why a device name is invalid.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum NameError {
    /// No driver has this name.
    #[error("there is no device {name:?}; known are {known}")]
    Unknown {
        /// The requested name.
        name: String,
        /// The names that there are.
        known: String,
    },
    /// What follows the name's colon is missing or invalid.
    #[error("device {0}")]
    Argument(String),
}

impl NameError {
    /// The name lacks what must follow its colon.
    pub fn lacks(name: &str, what: &str, example: &str) -> Self {
        Self::Argument(format!("{name:?} lacks its {what}; write {name}:{example}"))
    }
}
