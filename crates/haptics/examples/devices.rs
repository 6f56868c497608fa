//! Lists the devices, opens the one named (default: a scripted craniotomy) and prints its tool's
//! path.
//!
//! `cargo run -p trepan-haptics --example devices [NAME]`

use std::error::Error;
use trepan_geometry::{Buttons, Vec3};
use trepan_haptics::script::{Script, Site};
use trepan_haptics::{DeviceName, GuardedWrench, Setting, Status, Workspace, list};

const DURATION_MS: f64 = 8000.0;

fn main() -> Result<(), Box<dyn Error>> {
    for listed in list() {
        println!("{:<32} {}", listed.name, listed.state);
    }
    let name: DeviceName = std::env::args().nth(1).as_deref().unwrap_or("script:craniotomy").parse()?;
    let site = Site { entry: Vec3::ZERO, inward: Vec3::NEG_Z, bone_mm: 6.0, brain_mm: 8.0 };
    let script = |script: Option<&str>| Script::named(script.unwrap_or("craniotomy"), &site, DURATION_MS);
    let mut device = name.open(&Setting { workspace: Workspace::default(), script: &script })?.device;
    let able = device.capabilities();
    println!("\n{}: {:.1} N peak, {} axes driven", able.name, able.peak_force_n, able.axes_driven);
    println!("{:>8} {:>24} {:>12} {:>6}", "ms", "tip, mm", "speed, mm/s", "pedal");
    for tick in 0..=DURATION_MS as u32 {
        let reading = device.read(f64::from(tick));
        device.apply(GuardedWrench::ZERO);
        if tick % 500 == 0 {
            let tool = reading.tool;
            let (tip, speed) = (tool.tip(), tool.twist.linear.length() * 1e3);
            println!("{tick:>8} {:>24} {speed:>12.2} {:>6}", format!("{tip:.2}"), tool.buttons.has(Buttons::PEDAL));
        }
        if matches!(reading.status, Status::Finished | Status::Lost) {
            break;
        }
    }
    device.close();
    Ok(())
}
