//! The devices of a program without hardware: the window's pointer and a scripted operation.

use crate::descriptor::{Descriptor, Listed, Motion, NameError, OpenedDevice, no_argument};
use crate::{mouse, script};

/// `mouse`: follows the window's pointer from where the program's operation begins.
pub(crate) static MOUSE: Descriptor = Descriptor {
    name: "mouse",
    usage: "",
    source: "critically damped second-order filter",
    motion: Motion::Window,
    argument: no_argument,
    id: |_| "",
    probe: || Ok(vec![Listed::new("mouse", "ready where there is a window")]),
    open: |_, setting| {
        let (pointer, mouse) = mouse::pair((setting.script)(None)?.at(0.0).world_from_tool);
        Ok(OpenedDevice { pointer: Some(pointer), ..OpenedDevice::new(mouse) })
    },
};

/// `script:NAME`: performs a scripted operation.
pub(crate) static SCRIPT: Descriptor = Descriptor {
    name: "script",
    usage: ":NAME",
    source: "Flash and Hogan 1985, J. Neurosci. 5",
    motion: Motion::Script,
    argument: operation_name,
    id: |name| name,
    probe: || Ok(script::NAMES.map(|name| Listed::new(format!("script:{name}"), "ready")).into()),
    open: |operation, setting| Ok(OpenedDevice::new((setting.script)(operation)?)),
};

/// The argument of a device that a script moves: one of [`script::NAMES`].
pub(crate) fn operation_name(device: &str, operation: Option<&str>) -> Result<Option<String>, NameError> {
    match operation {
        None => Err(NameError::lacks(device, "operation", script::NAMES[0])),
        Some(name) if script::NAMES.contains(&name) => Ok(Some(name.to_owned())),
        Some(name) => {
            let name = format!("{device}:{name}");
            Err(NameError::Argument(format!("{name:?}: the scripts are {}", script::NAMES.join(", "))))
        }
    }
}
