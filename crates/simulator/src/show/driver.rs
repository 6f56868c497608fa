//! Opens a graphics adapter; as root, installs Mesa's software driver where there is none.

use std::path::Path;
use std::process::{Command, Stdio};
use trepan_gpu::{Gpu, GpuError, Prefer};

/// Packages for software Vulkan on a Debian-like system.
const PACKAGES: [&str; 2] = ["libvulkan1", "mesa-vulkan-drivers"];

/// Opens a graphics device. Without one, it installs the driver as root, or logs the command that
/// would.
pub(crate) fn open() -> Result<Gpu, GpuError> {
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

/// Installs the packages; updates the package lists only if the first attempt fails.
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
