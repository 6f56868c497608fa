//! Graphics for the picture: opens an adapter, and brings Mesa's software driver where there is
//! none and that is allowed.

use std::path::Path;
use std::process::{Command, Stdio};
use trepan_gpu::{Gpu, GpuError, Prefer};

/// The packages that a Debian-like system needs for software Vulkan.
const PACKAGES: [&str; 2] = ["libvulkan1", "mesa-vulkan-drivers"];

/// A graphics device. Where there is none: brings the driver if that is allowed, else says what
/// would.
pub fn open() -> Result<Gpu, GpuError> {
    let opened = Gpu::open(Prefer::default());
    if !matches!(opened, Err(GpuError::NoAdapter)) || !Path::new("/usr/bin/apt-get").is_file() {
        return opened;
    }
    let command = format!("apt-get install -y {}", PACKAGES.join(" "));
    if !is_root() {
        tracing::warn!("no Vulkan driver here; `sudo {command}` brings a software driver");
        return opened;
    }
    tracing::info!("no Vulkan driver here: installing Mesa's software driver ({command})");
    if !install() {
        tracing::warn!("`{command}` failed; run it by hand");
        return opened;
    }
    Gpu::open(Prefer::default())
}

fn is_root() -> bool {
    use std::os::unix::fs::MetadataExt;
    std::fs::metadata("/proc/self").is_ok_and(|of_process| of_process.uid() == 0)
}

/// Installs; asks for fresh package lists only when the known ones do not serve.
fn install() -> bool {
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
    get(&packages) || (get(&["update"]) && get(&packages))
}
