//! Opens the devices that the options name, and keeps the properties that their force guards depend
//! on.

use crate::case::plan::Plan;
use crate::error::SessionError;
use crate::options::Options;
use crate::program::Program;
use crate::run::stop::Stop;
use crate::run::watch::{Watched, Watching};
use trepan_contact::{GuardConfig, Viscoelastic};
use trepan_geometry::Vec3;
use trepan_haptics::script::{self, Script, Site};
use trepan_haptics::{
    Capabilities, Clutch, DeviceName, HapticDevice, ThreadedDevice, Watch, Workspace, hardware, mouse, simulated,
};
use trepan_link::Recording;

/// An open device of a hand.
#[derive(Default)]
pub(crate) struct OpenDevice {
    /// Device for the haptic loop; `None` for a replay, which has recorded readings.
    pub device: Option<Box<dyn HapticDevice>>,
    /// Handle with which the window moves the mouse device.
    pub pointer: Option<mouse::MouseHandle>,
    /// Access to the device's faults.
    pub watch: Option<Watch>,
    /// The session that is watched, if any.
    pub watching: Option<Watching>,
}

impl OpenDevice {
    /// Opens the device.
    pub fn open(
        name: &DeviceName,
        program: Program,
        options: &Options,
        plan: &Plan,
        rate_hz: f32,
        stop: &Stop,
    ) -> Result<Self, SessionError> {
        let none = Self::default();
        let start = || scripted(program.script(), options, plan).map(|script| script.at(0.0));
        if let Some(name) = &options.watch {
            let (watched, watching) = Watched::open(name, start()?, stop)?;
            return Ok(Self { device: Some(Box::new(watched)), watching: Some(watching), ..none });
        }
        if let Some(device) = software(name, options, plan)? {
            return Ok(Self { device: Some(device), ..none });
        }
        Ok(match name {
            DeviceName::Mouse => {
                let (pointer, mouse) = mouse::pair(start()?.world_from_tool);
                Self { device: Some(Box::new(mouse)), pointer: Some(pointer), ..none }
            }
            DeviceName::Replay(_) => none,
            hardware => match opened(hardware, workspace(&plan.site, options.device_scale), rate_hz)? {
                Some((device, watch)) => Self { device: Some(Box::new(device)), watch: Some(watch), ..none },
                None => none,
            },
        })
    }

    /// Opens the device of the second hand. Hardware runs on its own thread, so that its link never
    /// delays the first hand.
    pub fn second(name: &DeviceName, options: &Options, plan: &Plan, rate_hz: f32) -> Result<Self, SessionError> {
        if let Some(device) = software(name, options, plan)? {
            return Ok(Self { device: Some(device), ..Self::default() });
        }
        let mut beside = workspace(&plan.site, options.device_scale);
        // With both hands in the middle of their workspaces the tools are side by side.
        beside.world_from_device.translation += beside.world_from_device.rotation * (SIDE_MM * Vec3::NEG_X);
        let (device, watch) = opened(name, beside, rate_hz)?.ok_or_else(|| unfit(name))?;
        let device: Box<dyn HapticDevice> = Box::new(ThreadedDevice::new(Box::new(device)));
        Ok(Self { device: Some(device), watch: Some(watch), ..Self::default() })
    }
}

/// Makes a device of software: a script, or a simulated hand that follows one.
fn software(name: &DeviceName, options: &Options, plan: &Plan) -> Result<Option<Box<dyn HapticDevice>>, SessionError> {
    Ok(match name {
        DeviceName::Script(operation) => Some(Box::new(scripted(operation, options, plan)?)),
        DeviceName::Simulated(operation) => Some(simulated_hand(scripted(operation, options, plan)?)),
        _ => None,
    })
}

/// Makes a simulated device in a firm hand that follows a script.
pub(crate) fn simulated_hand(script: Script) -> Box<dyn HapticDevice> {
    let (config, grip) = (simulated::Config::default(), simulated::HandModel::FIRM);
    Box::new(simulated::Simulated::new(config, grip, Box::new(script)))
}

/// Opens hardware; `None` if the name is not one of hardware. Refuses a tick rate above that of the
/// device.
fn opened(name: &DeviceName, workspace: Workspace, rate_hz: f32) -> Result<Option<(Clutch, Watch)>, SessionError> {
    let Some(opened) = hardware::open(name, workspace) else { return Ok(None) };
    let opened = opened.map_err(|fault| SessionError::Device(fault.to_string()))?;
    let Capabilities { name, rate_hz: most_hz, .. } = opened.device.capabilities();
    if rate_hz > most_hz {
        let fault = format!("--rate-hz {rate_hz} is too fast for {name}: give at most {most_hz}");
        return Err(SessionError::Usage(fault));
    }
    Ok(Some((Clutch::new(opened.device), opened.watch)))
}

/// Duration of a scripted operation, and of one that cuts a flap, s.
const SCRIPT_S: (f64, f64) = (20.0, 75.0);

/// Makes the script of an operation that follows a plan.
fn scripted(name: &str, options: &Options, plan: &Plan) -> Result<Script, SessionError> {
    let usual_s = if name == "flap" { SCRIPT_S.1 } else { SCRIPT_S.0 };
    let how = script::Plan { outline: plan.outline.clone(), ..script::Plan::default() };
    let script = Script::planned(name, &plan.site, 1e3 * options.duration.unwrap_or(usual_s), &how);
    script.map_err(|fault| SessionError::Device(fault.to_string()))
}

/// Offset of the second hand's workspace to the left of the first one's, mm.
const SIDE_MM: f32 = 30.0;

/// Name of the second hand's device, if given; refuses one that conflicts with the first.
pub(crate) fn second_name(first: &DeviceName, options: &Options) -> Result<Option<DeviceName>, SessionError> {
    let Some(text) = &options.second_device else { return Ok(None) };
    let name: DeviceName = text.parse().map_err(|fault: trepan_haptics::NameError| second(fault.to_string()))?;
    if matches!(first, DeviceName::Replay(_)) {
        return Err(second("a replay brings its second hand along: leave this flag out".into()));
    }
    if matches!(name, DeviceName::Mouse | DeviceName::Replay(_)) {
        return Err(unfit(&name));
    }
    if name.may_be(first) {
        return Err(second(format!("{first} and {name} may be one device: name two as --list-devices does")));
    }
    Ok(Some(name))
}

fn unfit(name: &DeviceName) -> SessionError {
    let known = "script:aspirate, simulated:NAME, or a device that --list-devices shows";
    second(format!("the second hand cannot hold {name}: give {known}"))
}

fn second(fault: String) -> SessionError {
    SessionError::Usage(format!("--second-device: {fault}"))
}

/// Describes the faults of a device; `None` without faults.
pub(crate) fn faults(watch: &Watch) -> Option<String> {
    let last = watch.fault().map_or_else(String::new, |fault| format!("; the last one: {fault}"));
    (watch.count() > 0).then(|| format!("the device had {} faults{last}", watch.count()))
}

/// Maps the device's workspace to the site: centred 20 mm outside the entry, oriented like the
/// picture.
fn workspace(site: &Site, scale: f32) -> Workspace {
    Workspace::facing(site.entry - 20.0 * site.inward, site.inward, Vec3::Z, scale)
}

/// Name of the requested device; by default the mouse with a window, else the program's script.
pub(crate) fn device_name(program: Program, options: &Options, windowed: bool) -> Result<DeviceName, SessionError> {
    let script = || DeviceName::Script(program.script().into());
    let name = match &options.device {
        Some(text) => {
            text.parse().map_err(|fault: trepan_haptics::NameError| SessionError::Device(fault.to_string()))?
        }
        None if windowed => DeviceName::Mouse,
        None => script(),
    };
    if name == DeviceName::Mouse && !windowed {
        let text =
            "the mouse needs a window: leave out --headless on a machine with a display, or give --device script:NAME";
        return Err(SessionError::Device(text.into()));
    }
    Ok(name)
}

/// Device properties that the force guard and the walls depend on; recorded, so that a replay gives
/// the same forces.
pub(crate) struct DeviceLimits {
    /// Capabilities, with the encoder step multiplied by the motion scale.
    device: Capabilities,
    /// Motion scale, world mm per device mm.
    scale: f32,
}

/// Prefix of the first hand's header entries.
pub(crate) const FIRST: &str = "device_";
/// Prefix of the second hand's header entries.
pub(crate) const SECOND: &str = "second_device_";

const PEAK: &str = "peak_force_n";
const CONTINUOUS: &str = "continuous_force_n";
const DELAY: &str = "delay_ticks";
const STEP: &str = "position_step_mm";
const AXES: &str = "axes_driven";
const MASS: &str = "moving_mass_g";
const DAMPING: &str = "damping_n_ms_per_mm";
const SCALE: &str = "scale";

impl DeviceLimits {
    /// Properties of an open device whose motion is multiplied by `scale`.
    pub fn of(device: &Capabilities, scale: f32) -> Self {
        let position_resolution_mm = scale * device.position_resolution_mm;
        Self { device: Capabilities { position_resolution_mm, ..device.clone() }, scale }
    }

    /// Reads the properties of a hand's device ([`FIRST`], [`SECOND`]) from a recording; zeros
    /// without a recording.
    pub fn recorded(recording: Option<&Recording>, hand: &str) -> Self {
        let config = recording.map(|recording| &recording.header.config);
        let number = |name: &str| config.and_then(|c| c.get(&format!("{hand}{name}"))?.parse().ok()).unwrap_or(0.0f32);
        let device = Capabilities {
            peak_force_n: number(PEAK),
            continuous_force_n: number(CONTINUOUS),
            delay_ticks: number(DELAY) as u8,
            position_resolution_mm: number(STEP),
            axes_driven: number(AXES) as u8,
            moving_mass_g: number(MASS),
            damping: number(DAMPING),
            ..Capabilities::passive("")
        };
        Self { device, scale: Some(number(SCALE)).filter(|&scale| scale > 0.0).unwrap_or(1.0) }
    }

    /// Header entries that [`DeviceLimits::recorded`] reads.
    pub fn entries(&self, hand: &str) -> [(String, String); 8] {
        let device = &self.device;
        [
            (PEAK, device.peak_force_n),
            (CONTINUOUS, device.continuous_force_n),
            (DELAY, device.delay_ticks.into()),
            (STEP, device.position_resolution_mm),
            (AXES, device.axes_driven.into()),
            (MASS, device.moving_mass_g),
            (DAMPING, device.damping),
            (SCALE, self.scale),
        ]
        .map(|(name, value)| (format!("{hand}{name}"), value.to_string()))
    }

    /// Configuration of the force guard.
    pub fn guard(&self) -> GuardConfig {
        self.device.guard_config()
    }

    /// Divides a wall's stiffness and damping by a scale over 1, and limits them to what the device
    /// renders stably.
    pub fn coupled(&self, wall: Viscoelastic, tick_ms: f32) -> Viscoelastic {
        let scale = self.scale.max(1.0);
        let wall = Viscoelastic { stiffness: wall.stiffness / scale, damping: wall.damping / scale };
        self.device.coupled(wall, tick_ms)
    }
}
