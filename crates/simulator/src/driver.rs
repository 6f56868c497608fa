//! Graphics for the picture: opens an adapter, and brings Mesa's software driver where there is none and that is allowed.

use std::path::Path;
use std::process::{Command, Stdio};
use trepan_gpu::{Gpu, Prefer};

/// The packages that a Debian-like system needs for software Vulkan.
const PACKAGES: [&str; 2] = ["libvulkan1", "mesa-vulkan-drivers"];

/// A graphics device, or why there is none and what would help.
pub fn open() -> Result<Gpu, String> {
    let fault = match Gpu::open(Prefer::default()) {
        Ok(gpu) => return Ok(gpu),
        Err(fault) => fault.to_string(),
    };
    let command = format!("apt-get install -y {}", PACKAGES.join(" "));
    if !Path::new("/usr/bin/apt-get").is_file() {
        return Err(format!("no picture: {fault}"));
    }
    if !is_root() {
        return Err(format!("no picture: {fault}; `sudo {command}` brings a software driver"));
    }
    tracing::info!("no Vulkan driver here: installing Mesa's software driver ({command})");
    install()?;
    Gpu::open(Prefer::default())
        .map_err(|fault| format!("no picture, although Mesa's software driver was installed: {fault}"))
}

fn is_root() -> bool {
    use std::os::unix::fs::MetadataExt;
    std::fs::metadata("/proc/self").is_ok_and(|of_process| of_process.uid() == 0)
}

/// Installs; asks for fresh package lists only when the known ones do not serve.
fn install() -> Result<(), String> {
    let get = |arguments: &[&str]| {
        Command::new("apt-get")
            .args(arguments)
            .env("DEBIAN_FRONTEND", "noninteractive")
            .stdin(Stdio::null())
            .stdout(Stdio::null())
            .stderr(Stdio::null())
            .status()
            .is_ok_and(|status| status.success())
    };
    let packages: Vec<&str> = ["install", "-y", "--no-install-recommends"].into_iter().chain(PACKAGES).collect();
    let done = get(&packages) || (get(&["update"]) && get(&packages));
    done.then_some(())
        .ok_or_else(|| format!("no picture: `apt-get install -y {}` failed; run it by hand", PACKAGES.join(" ")))
}
