//! Opens the devices that are more than software, by the name that a user gave.

use crate::{DeviceError, DeviceName, HapticDevice, Listed, Watch, Workspace};
use crate::{force_dimension, haply, openhaptics, spacemouse};

/// A device of metal, and the window into its faults.
pub struct Hardware {
    /// For the haptic loop.
    pub device: Box<dyn HapticDevice>,
    /// For whoever shows messages.
    pub watch: Watch,
}

/// Opens the device with the recommended settings; `None` when the name stands for software. `workspace` lays its space
/// into the patient.
pub fn open(name: &DeviceName, workspace: Workspace) -> Option<Result<Hardware, DeviceError>> {
    match name {
        DeviceName::OpenHaptics(device) => {
            let config = openhaptics::Config { device: device.clone(), workspace, ..Default::default() };
            Some(openhaptics::OpenHaptics::open(&config).map(|d| Hardware { watch: d.watch(), device: Box::new(d) }))
        }
        DeviceName::ForceDimension => {
            let config = force_dimension::Config { workspace, ..Default::default() };
            Some(
                force_dimension::ForceDimension::open(&config)
                    .map(|d| Hardware { watch: d.watch(), device: Box::new(d) }),
            )
        }
        DeviceName::Haply => {
            let config = haply::Config { workspace, ..Default::default() };
            Some(haply::Haply::open(&config).map(|d| Hardware { watch: d.watch(), device: Box::new(d) }))
        }
        DeviceName::SpaceMouse => {
            let config = spacemouse::Config { workspace, ..Default::default() };
            Some(spacemouse::SpaceMouse::open(&config).map(|d| Hardware { watch: d.watch(), device: Box::new(d) }))
        }
        DeviceName::Mouse | DeviceName::Script(_) | DeviceName::Replay(_) | DeviceName::Simulated(_) => None,
    }
}

/// The hardware that a user can ask for, and whether its library or service is there. Devices are not opened: that could
/// move them.
pub(crate) fn list() -> Vec<Listed> {
    let listed = |name: &str, found: Result<String, DeviceError>| Listed {
        name: name.to_owned(),
        state: found.unwrap_or_else(|error| error.to_string()),
    };
    vec![
        listed("openhaptics", openhaptics::probe()),
        listed("force-dimension", force_dimension::probe()),
        listed("haply", haply::probe()),
        listed("spacemouse", spacemouse::probe()),
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_hardware_is_opened_here() {
        for name in ["mouse", "script:probe", "replay:x.mcap", "simulated:probe"] {
            assert!(open(&name.parse().unwrap(), Workspace::default()).is_none(), "{name}");
        }
    }

    #[test]
    fn the_list_says_what_is_missing_and_what_to_do() {
        for listed in list() {
            let absent = listed.state.contains(';') && listed.state.starts_with("cannot ");
            let present = listed.state.contains("ready") || listed.state.contains("installed");
            assert!(absent || present, "{}: {}", listed.name, listed.state);
            assert!(listed.name.parse::<DeviceName>().is_ok());
        }
    }
}
