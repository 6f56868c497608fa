//! A device in one file, of another crate, opened by its name.

use trepan_geometry::{Pose, ToolState, Vec3};
use trepan_haptics::script::{Script, Site};
use trepan_haptics::{
    Capabilities, Descriptor, DeviceError, DeviceName, GuardedWrench, HapticDevice, Listed, Motion, NameError,
    OpenedDevice, Reading, Setting, Status, Workspace,
};

/// Rests at a height.
struct Toy(ToolState);

static TOY: Descriptor = Descriptor {
    name: "toy",
    usage: "[:MM]",
    source: "none",
    motion: Motion::Hardware,
    argument: |_, height| Ok(height.map(str::to_owned)),
    id: |height| height,
    probe: || Ok(vec![Listed::new("toy:5", "ready")]),
    open: |height, setting| {
        let height_mm = height.unwrap_or("0").parse::<f32>();
        let height_mm = height_mm.map_err(|fault| DeviceError::open("toy", fault.to_string(), "give a number"))?;
        let pose = Pose::from_translation(Vec3::Z * height_mm);
        Ok(OpenedDevice::new(Toy(setting.workspace.world(&ToolState::at(pose)))))
    },
};

impl HapticDevice for Toy {
    fn read(&mut self, time_ms: f64) -> Reading {
        Reading { tool: ToolState { time_ms, ..self.0 }, status: Status::Fresh }
    }

    fn apply(&mut self, _: GuardedWrench) {}

    fn capabilities(&self) -> Capabilities {
        Capabilities::passive("toy")
    }

    fn close(&mut self) {}
}

#[test]
fn a_device_of_one_file_is_opened_by_its_name() {
    let named = |text: &str| DeviceName::among(&[&TOY], text);
    let site = Site { entry: Vec3::ZERO, inward: Vec3::NEG_Z, bone_mm: 5.0, brain_mm: 7.0 };
    let script = |name: Option<&str>| Script::named(name.unwrap_or("probe"), &site, 500.0);
    let setting = Setting { workspace: Workspace { scale: 2.0, ..Workspace::default() }, script: &script };
    for (text, tip) in [("toy", Vec3::ZERO), ("toy:5", Vec3::Z * 10.0)] {
        let name = named(text).unwrap();
        assert_eq!((name.to_string().as_str(), name.is_hardware()), (text, true));
        assert_eq!(name.open(&setting).unwrap().device.read(1.0).tool.tip(), tip);
    }
    assert!(named("toy").unwrap().may_be(&named("toy:5").unwrap()));
    let high = named("toy:high").unwrap().open(&setting).err().unwrap();
    assert_eq!(high.to_string(), "cannot open toy: invalid float literal; give a number");
    let unknown = NameError::Unknown { name: "top".into(), known: "toy[:MM]".into() };
    assert_eq!(named("top"), Err(unknown));
    assert!("toy".parse::<DeviceName>().is_err(), "it is not in the list of the crate");
}
