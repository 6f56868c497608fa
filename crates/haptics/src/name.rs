//! Device names on the command line.

use crate::script;
use std::path::PathBuf;
use std::str::FromStr;

/// The device that a user requested.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum DeviceName {
    /// `mouse`: the window's pointer.
    Mouse,
    /// `script:NAME`: a scripted operation.
    Script(String),
    /// `replay:FILE`: the motion of a recorded session.
    Replay(PathBuf),
    /// `simulated:NAME`: a device with mass, friction and delay, in a hand model that follows a
    /// scripted operation.
    Simulated(String),
    /// `openhaptics[:NAME]`: 3D Systems Touch and related devices, by the name in the vendor's
    /// set-up tool.
    OpenHaptics(Option<String>),
    /// `force-dimension[:N]`: omega, delta, sigma, lambda, Falcon; the first, or by number from 0.
    ForceDimension(Option<u8>),
    /// `haply[:ID[+GRIP]]`: Inverse3 with VerseGrip, through its service; the first, or by their
    /// four hexadecimal digits.
    Haply(Option<String>),
    /// `spacemouse`: a six-axis knob without force.
    SpaceMouse,
}

/// Why a device name is invalid.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum NameError {
    /// No driver has this name.
    #[error("there is no device {name:?}; known are {KNOWN}")]
    Unknown {
        /// The requested name.
        name: String,
    },
    /// The script of a scripted or simulated device is unknown.
    #[error("device {name:?}: the scripts are {}", script::NAMES.join(", "))]
    UnknownScript {
        /// The requested name.
        name: String,
    },
    /// The name needs something after its colon.
    #[error("device {name:?} lacks its {what}; write {name}:{example}")]
    Incomplete {
        /// The requested name.
        name: String,
        /// What is missing.
        what: &'static str,
        /// An example of it.
        example: &'static str,
    },
    /// The device needs a number.
    #[error("device {name}:{text} goes by a number; write {name}:N with N from 0 to 127, as --list-devices does")]
    NoNumber {
        /// The device.
        name: String,
        /// The text after the colon.
        text: String,
    },
    /// The device takes nothing after a colon.
    #[error("device {name:?} takes no {extra:?}; write {name}")]
    Superfluous {
        /// The device.
        name: String,
        /// The text after the colon.
        extra: String,
    },
}

const KNOWN: &str = "mouse, script:NAME, replay:FILE, simulated:NAME, openhaptics[:NAME], force-dimension[:N], haply[:ID[+GRIP]], spacemouse";

impl DeviceName {
    /// Whether both names may mean the same hardware device; a name without an id may mean any of
    /// its kind.
    pub fn may_be(&self, other: &Self) -> bool {
        fn meet<T: PartialEq>(one: &Option<T>, other: &Option<T>) -> bool {
            one.is_none() || other.is_none() || one == other
        }
        /// The device's id, without its grip's.
        fn inverse(ids: &Option<String>) -> Option<&str> {
            ids.as_deref().and_then(|ids| ids.split('+').next()).filter(|id| !id.is_empty())
        }
        match (self, other) {
            (Self::OpenHaptics(one), Self::OpenHaptics(other)) => meet(one, other),
            (Self::Haply(one), Self::Haply(other)) => meet(&inverse(one), &inverse(other)),
            (Self::ForceDimension(one), Self::ForceDimension(other)) => meet(one, other),
            _ => *self == Self::SpaceMouse && *other == Self::SpaceMouse,
        }
    }
}

impl FromStr for DeviceName {
    type Err = NameError;

    fn from_str(text: &str) -> Result<Self, NameError> {
        let (driver, detail) = match text.split_once(':') {
            Some((driver, detail)) => (driver, Some(detail).filter(|d| !d.is_empty())),
            None => (text, None),
        };
        let plain = |device: Self| match detail {
            None => Ok(device),
            Some(extra) => Err(NameError::Superfluous { name: driver.to_owned(), extra: extra.to_owned() }),
        };
        let incomplete = |what, example| NameError::Incomplete { name: driver.to_owned(), what, example };
        match driver {
            "mouse" => plain(Self::Mouse),
            "spacemouse" => plain(Self::SpaceMouse),
            "haply" => Ok(Self::Haply(detail.map(str::to_uppercase))),
            "force-dimension" => match detail.map(|number| (number, number.parse::<u8>())) {
                None => Ok(Self::ForceDimension(None)),
                Some((_, Ok(number))) if number < 128 => Ok(Self::ForceDimension(Some(number))),
                Some((text, _)) => Err(NameError::NoNumber { name: driver.to_owned(), text: text.to_owned() }),
            },
            "openhaptics" => Ok(Self::OpenHaptics(detail.map(str::to_owned))),
            "replay" => Ok(Self::Replay(detail.ok_or_else(|| incomplete("file", "session.mcap"))?.into())),
            "script" | "simulated" => {
                let name = detail.ok_or_else(|| incomplete("operation", script::NAMES[0]))?;
                if !script::NAMES.contains(&name) {
                    return Err(NameError::UnknownScript { name: text.to_owned() });
                }
                Ok(if driver == "script" { Self::Script(name.into()) } else { Self::Simulated(name.into()) })
            }
            _ => Err(NameError::Unknown { name: text.to_owned() }),
        }
    }
}

impl std::fmt::Display for DeviceName {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Mouse => f.write_str("mouse"),
            Self::Script(name) => write!(f, "script:{name}"),
            Self::Replay(path) => write!(f, "replay:{}", path.display()),
            Self::Simulated(name) => write!(f, "simulated:{name}"),
            Self::OpenHaptics(None) => f.write_str("openhaptics"),
            Self::OpenHaptics(Some(name)) => write!(f, "openhaptics:{name}"),
            Self::ForceDimension(None) => f.write_str("force-dimension"),
            Self::ForceDimension(Some(number)) => write!(f, "force-dimension:{number}"),
            Self::Haply(None) => f.write_str("haply"),
            Self::Haply(Some(id)) => write!(f, "haply:{id}"),
            Self::SpaceMouse => f.write_str("spacemouse"),
        }
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_survive_a_round_trip() {
        let names = [
            "mouse",
            "script:probe",
            "replay:a:b.mcap",
            "simulated:craniotomy",
            "openhaptics",
            "openhaptics:Left",
            "force-dimension",
            "force-dimension:1",
            "haply",
            "haply:049D",
            "haply:049D+60BD",
            "spacemouse",
        ];
        for name in names {
            assert_eq!(name.parse::<DeviceName>().unwrap().to_string(), name);
        }
    }

    #[test]
    fn names_of_the_same_device_are_recognised() {
        let may = |one: &str, other: &str| one.parse::<DeviceName>().unwrap().may_be(&other.parse().unwrap());
        assert!(may("haply:049D+60BD", "haply:049D+71CE") && !may("haply:049D+60BD", "haply:049E+60BD"));
        assert!(may("haply", "haply:049D") && may("haply:049d", "haply:049D") && !may("haply:049E", "haply:049D"));
        assert!(may("force-dimension", "force-dimension:1") && !may("force-dimension:0", "force-dimension:1"));
        assert!(
            may("spacemouse", "spacemouse") && !may("haply", "openhaptics") && !may("script:probe", "script:probe")
        );
    }

    #[test]
    fn errors_name_the_remedy() {
        let error = |name: &str| name.parse::<DeviceName>().unwrap_err().to_string();
        assert!(error("joystick").contains(KNOWN));
        assert!(error("script").contains("write script:craniotomy-and-probe"));
        assert!(error("script:x").contains("craniotomy-and-probe, craniotomy, probe"));
        assert!(error("replay:").contains("file"));
        assert!(error("mouse:2").contains("takes no \"2\""));
        assert!(error("force-dimension:left").contains("0 to 127"));
    }
}
