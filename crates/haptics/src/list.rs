//! The devices of this crate.

use crate::descriptor::{Descriptor, DeviceName, Listed, NameError};
use crate::{force_dimension, haply, openhaptics, replay, scripted, simulated, spacemouse};
use std::str::FromStr;

/// All of them, in the order of help texts.
static DEVICES: &[&Descriptor] = &[
    &scripted::MOUSE,
    &scripted::SCRIPT,
    &replay::DEVICE,
    &simulated::DEVICE,
    &openhaptics::DEVICE,
    &force_dimension::DEVICE,
    &haply::DEVICE,
    &spacemouse::DEVICE,
];

impl DeviceName {
    /// The window's pointer.
    pub const MOUSE: Self = Self::new(&scripted::MOUSE, None);

    /// A scripted operation.
    pub fn scripted(operation: &str) -> Self {
        Self::new(&scripted::SCRIPT, Some(operation.to_owned()))
    }
}

impl FromStr for DeviceName {
    type Err = NameError;

    fn from_str(text: &str) -> Result<Self, NameError> {
        Self::among(DEVICES, text)
    }
}

/// Lists every device that a user can request: by the name that opens it, or what is missing.
pub fn list() -> Vec<Listed> {
    let missing = |kind: &Descriptor, error: crate::DeviceError| vec![Listed::new(kind.name, error.to_string())];
    DEVICES.iter().flat_map(|kind| (kind.probe)().unwrap_or_else(|error| missing(kind, error))).collect()
}

/// The names of all devices, for a help text.
pub fn usage() -> String {
    let forms = |kind: &&Descriptor| match kind.usage.strip_prefix('[') {
        // Without and with what may follow, less what may follow that.
        Some(may) => format!("{0}, {0}{1}", kind.name, may.split(['[', ']']).next().unwrap_or_default()),
        None => format!("{}{}", kind.name, kind.usage),
    };
    DEVICES.iter().map(forms).collect::<Vec<_>>().join(", ")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::script::{Script, Site};
    use crate::{Setting, Workspace};
    use trepan_geometry::Vec3;

    fn name(text: &str) -> DeviceName {
        text.parse().unwrap()
    }

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
        for text in names {
            assert_eq!(name(text).to_string(), text);
        }
        assert_eq!((DeviceName::MOUSE, DeviceName::scripted("probe")), (name("mouse"), name("script:probe")));
        assert_eq!(name("force-dimension:01"), name("force-dimension:1"));
    }

    #[test]
    fn names_of_the_same_device_are_recognised() {
        let may = |one: &str, other: &str| name(one).may_be(&name(other));
        assert!(may("haply:049D+60BD", "haply:049D+71CE") && !may("haply:049D+60BD", "haply:049E+60BD"));
        assert!(may("haply", "haply:049D") && may("haply:049d", "haply:049D") && !may("haply:049E", "haply:049D"));
        assert!(may("force-dimension", "force-dimension:1") && !may("force-dimension:0", "force-dimension:1"));
        assert!(may("haply:+60BD", "haply:049D") && !may("openhaptics:a+b", "openhaptics:a+c"));
        assert!(
            may("spacemouse", "spacemouse") && !may("haply", "openhaptics") && !may("script:probe", "script:probe")
        );
    }

    #[test]
    fn errors_name_the_remedy() {
        const KNOWN: &str = "mouse, script:NAME, replay:FILE, simulated:NAME, openhaptics[:NAME], \
                             force-dimension[:N], haply[:ID[+GRIP]], spacemouse";
        let error = |name: &str| name.parse::<DeviceName>().unwrap_err().to_string();
        assert!(error("joystick") == format!("there is no device \"joystick\"; known are {KNOWN}"));
        assert!(error("script").contains("write script:craniotomy-and-probe"));
        assert!(
            error("script:x").contains("device \"script:x\": the scripts are craniotomy-and-probe, craniotomy, probe")
        );
        assert!(error("replay:").contains("file"));
        assert!(error("mouse:2").contains("takes no \"2\""));
        assert!(error("force-dimension:left").contains("0 to 127") && error("force-dimension:128").contains("127"));
    }

    #[test]
    fn the_help_names_every_device() {
        let help = "mouse, script:NAME, replay:FILE, simulated:NAME, openhaptics, openhaptics:NAME, \
                    force-dimension, force-dimension:N, haply, haply:ID, spacemouse";
        assert_eq!(usage(), help);
    }

    #[test]
    fn virtual_devices_open_without_a_watch() {
        let site = Site { entry: Vec3::ZERO, inward: Vec3::NEG_Z, bone_mm: 5.0, brain_mm: 7.0 };
        let script = |name: Option<&str>| Script::named(name.unwrap_or("probe"), &site, 500.0);
        let setting = Setting { workspace: Workspace::default(), script: &script };
        for (text, has_pointer) in [("mouse", true), ("script:probe", false), ("simulated:probe", false)] {
            let opened = name(text).open(&setting).unwrap();
            assert_eq!((opened.watch.is_none(), opened.pointer.is_some()), (true, has_pointer), "{text}");
            assert!(!name(text).is_hardware());
        }
        assert!(name("replay:x.mcap").open(&setting).is_err_and(|error| error.to_string().contains("session")));
    }

    #[test]
    fn the_list_says_what_is_missing_and_what_to_do() {
        for listed in list() {
            let absent = listed.state.contains(';') && listed.state.starts_with("cannot ");
            let present = listed.state.contains("ready") || listed.state.contains("installed");
            assert!(absent || present, "{}: {}", listed.name, listed.state);
            assert!(listed.name.parse::<DeviceName>().is_ok(), "{}", listed.name);
        }
    }
}
