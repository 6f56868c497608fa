//! Opens hardware devices by the name that a user gave.

use crate::{DeviceError, DeviceName, HapticDevice, Listed, Watch, Workspace};
use crate::{force_dimension, haply, openhaptics, script, spacemouse};

/// A hardware device and the watch on its faults.
pub struct Hardware {
    /// The device, for the haptic loop.
    pub device: Box<dyn HapticDevice>,
    /// Its faults, for the code that shows messages.
    pub watch: Watch,
}

/// Opens the device with the recommended settings; `None` when the name is a virtual device.
/// `workspace` maps device space to world space.
pub fn open(name: &DeviceName, workspace: Workspace) -> Option<Result<Hardware, DeviceError>> {
    match name {
        DeviceName::OpenHaptics(device) => {
            let config = openhaptics::Config { device: device.clone(), workspace, ..Default::default() };
            Some(openhaptics::OpenHaptics::open(&config).map(|d| Hardware { watch: d.watch(), device: Box::new(d) }))
        }
        DeviceName::ForceDimension(number) => {
            let index = number.unwrap_or(0).cast_signed();
            let config = force_dimension::Config { index, workspace, ..Default::default() };
            Some(
                force_dimension::ForceDimension::open(&config)
                    .map(|d| Hardware { watch: d.watch(), device: Box::new(d) }),
            )
        }
        DeviceName::Haply(device) => {
            let mut ids =
                device.iter().flat_map(|ids| ids.split('+')).map(|id| Some(id.to_owned()).filter(|id| !id.is_empty()));
            let (device, grip) = (ids.next().flatten(), ids.next().flatten());
            let config = haply::Config { device, grip, workspace, ..Default::default() };
            Some(haply::Haply::open(&config).map(|d| Hardware { watch: d.watch(), device: Box::new(d) }))
        }
        DeviceName::SpaceMouse => {
            let config = spacemouse::Config { workspace, ..Default::default() };
            Some(spacemouse::SpaceMouse::open(&config).map(|d| Hardware { watch: d.watch(), device: Box::new(d) }))
        }
        DeviceName::Mouse | DeviceName::Script(_) | DeviceName::Replay(_) | DeviceName::Simulated(_) => None,
    }
}

/// Lists every device that a user can request, and whether it is available.
pub fn list() -> Vec<Listed> {
    let ready = |name: String, state: &str| Listed { name, state: state.to_owned() };
    let mut listed = vec![ready("mouse".to_owned(), "ready where there is a window")];
    listed.extend(script::NAMES.map(|name| ready(format!("script:{name}"), "ready")));
    listed.extend(script::NAMES.map(|name| ready(format!("simulated:{name}"), "ready")));
    listed.push(ready("replay:FILE".to_owned(), "ready"));
    listed.extend(connected());
    listed
}

/// Lists the hardware that a user can open: each connected device by name, or what is missing.
/// Devices are not opened: that could move them.
fn connected() -> Vec<Listed> {
    let one = |name: &str, found: Result<String, DeviceError>| Listed {
        name: name.to_owned(),
        state: found.unwrap_or_else(|error| error.to_string()),
    };
    let mut listed = vec![one("openhaptics", openhaptics::probe())];
    for (name, found) in [("force-dimension", force_dimension::probe()), ("haply", haply::probe())] {
        match found {
            Ok(devices) => listed.extend(devices),
            Err(error) => listed.push(one(name, Err(error))),
        }
    }
    listed.push(one("spacemouse", spacemouse::probe()));
    listed
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
        for listed in connected() {
            let absent = listed.state.contains(';') && listed.state.starts_with("cannot ");
            let present = listed.state.contains("ready") || listed.state.contains("installed");
            assert!(absent || present, "{}: {}", listed.name, listed.state);
            assert!(listed.name.parse::<DeviceName>().is_ok());
        }
    }

    #[test]
    fn every_listed_name_parses() {
        for listed in list() {
            assert!(listed.name.parse::<DeviceName>().is_ok(), "{}", listed.name);
            assert!(!listed.state.is_empty());
        }
    }
}
