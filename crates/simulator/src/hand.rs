//! Opens the devices that the options name.

use crate::error::SessionError;
use crate::options::Options;
use trepan_geometry::Vec3;
use trepan_haptics::script::{self, Script, ScriptError, Site};
use trepan_haptics::{
    Capabilities, Clutch, DeviceName, HapticDevice, Motion, OpenedDevice, Setting, ThreadedDevice, Watch, Workspace,
    mouse,
};
use trepan_patient::Plan;
use trepan_runtime::stop::Stop;
use trepan_runtime::watch::{Watched, Watching};
use trepan_stages::program::Program;

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
        let script = |name: Option<&str>| scripted(name.unwrap_or(program.script()), program, options, plan);
        if let Some(name) = &options.watch {
            let (watched, watching) = Watched::open(name, script(None).map_err(refused)?.at(0.0), stop)?;
            return Ok(Self { device: Some(Box::new(watched)), watching: Some(watching), ..Self::default() });
        }
        if name.recording().is_some() {
            return Ok(Self::default());
        }
        let workspace = workspace(&plan.site, options.device_scale);
        let OpenedDevice { device, watch, pointer } = opened(name, &Setting { workspace, script: &script }, rate_hz)?;
        Ok(Self { device: Some(device), watch, pointer, ..Self::default() })
    }

    /// Opens the device of the second hand. Hardware runs on its own thread, so that its link never
    /// delays the first hand.
    pub fn second(name: &DeviceName, options: &Options, plan: &Plan, rate_hz: f32) -> Result<Self, SessionError> {
        let script = |name: Option<&str>| scripted(name.unwrap_or_default(), Program::Integrated, options, plan);
        let mut beside = workspace(&plan.site, options.device_scale);
        // With both hands in the middle of their workspaces the tools are side by side.
        beside.world_from_device.translation += beside.world_from_device.rotation * (SIDE_MM * Vec3::NEG_X);
        let OpenedDevice { mut device, watch, .. } =
            opened(name, &Setting { workspace: beside, script: &script }, rate_hz)?;
        if name.is_hardware() {
            device = Box::new(ThreadedDevice::new(device));
        }
        Ok(Self { device: Some(device), watch, ..Self::default() })
    }
}

/// Opens a device; hardware gets a clutch, and must be as fast as the session.
fn opened(name: &DeviceName, setting: &Setting<'_>, rate_hz: f32) -> Result<OpenedDevice, SessionError> {
    let mut opened = name.open(setting).map_err(refused)?;
    if name.is_hardware() {
        let Capabilities { name, rate_hz: most_hz, .. } = opened.device.capabilities();
        if rate_hz > most_hz {
            let fault = format!("--rate-hz {rate_hz} is too fast for {name}: give at most {most_hz}");
            return Err(SessionError::Usage(fault));
        }
        opened.device = Box::new(Clutch::new(opened.device));
    }
    Ok(opened)
}

fn refused(fault: impl std::fmt::Display) -> SessionError {
    SessionError::Device(fault.to_string())
}

/// Duration of a scripted operation, s: of one that cuts a flap, of a resection by what it takes,
/// of others. An incision of the dura adds to the last.
fn script_s(name: &str, plan: &Plan) -> f64 {
    let incises_s = if plan.incisions.is_empty() { 0.0 } else { 40.0 };
    match (name, plan.target) {
        ("flap", _) => 75.0,
        ("bleed", _) => 150.0 + incises_s,
        ("resect" | "arm", target) => {
            60.0 + incises_s
                + target.map_or(60.0, |target| {
                    f64::from(target.radius_mm).powi(2) * (0.43 * f64::from(target.radius_mm) + 2.0)
                })
        }
        ("cut", _) => 60.0,
        _ => 20.0,
    }
}

/// Makes the script of an operation that follows a plan.
fn scripted(name: &str, program: Program, options: &Options, plan: &Plan) -> Result<Script, ScriptError> {
    let usual = if program.has_tissue() { script::Plan::default() } else { script::Plan::of_bone() };
    let how =
        script::Plan { outline: plan.outline.clone(), is_open: !program.has_bone(), target: plan.target, ..usual };
    let how = script::Plan { incisions: plan.incisions.clone(), ..how };
    Script::planned(name, &plan.site, 1e3 * options.duration.unwrap_or(script_s(name, plan)), &how)
}

/// Offset of the second hand's workspace to the left of the first one's, mm.
const SIDE_MM: f32 = 30.0;

/// Name of the second hand's device, if given; refuses one that conflicts with the first.
pub(crate) fn second_name(first: &DeviceName, options: &Options) -> Result<Option<DeviceName>, SessionError> {
    let Some(text) = &options.second_device else { return Ok(None) };
    let name: DeviceName = text.parse().map_err(|fault: trepan_haptics::NameError| second(fault.to_string()))?;
    if first.recording().is_some() {
        return Err(second("a replay brings its second hand along: leave this flag out".into()));
    }
    if matches!(name.kind().motion, Motion::Window | Motion::Recording) {
        return Err(unfit(&name));
    }
    if name.may_be(first) {
        return Err(second(format!("{first} and {name} may be one device: name two as --list-devices does")));
    }
    Ok(Some(name))
}

fn unfit(name: &DeviceName) -> SessionError {
    let known = "script:aspirate, script:suck, simulated:NAME, or a device that --list-devices shows";
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
    let name = match &options.device {
        Some(text) => text.parse().map_err(|fault: trepan_haptics::NameError| refused(fault))?,
        None if windowed => DeviceName::MOUSE,
        None => DeviceName::scripted(program.script()),
    };
    if name.kind().motion == Motion::Window && !windowed {
        let text =
            "the mouse needs a window: leave out --headless on a machine with a display, or give --device script:NAME";
        return Err(SessionError::Device(text.into()));
    }
    Ok(name)
}
