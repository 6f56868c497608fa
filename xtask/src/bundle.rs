//! `cargo xtask bundle gpu`: one folder that measures a graphics card where nothing is installed.
//!
//! # Practice
//! The program is built and stripped here, so it runs where the C library is at least as new as on
//! this machine. Machines of a cluster often have a card's driver and no Vulkan loader: where this
//! machine has one, it goes along and is used only where the other has none.

use anyhow::{Context, Result, ensure};
use std::fs;
use std::os::unix::fs::PermissionsExt;
use std::path::Path;
use std::process::Command;

/// Most bytes of a bundle.
const MOST_BYTES: u64 = 48 << 20;

/// Starts the program, with the loader that came along where there is no other.
const MEASURE: &str = r#"#!/bin/sh
# Measures this machine's graphics card; ./measure --help says more.
here=$(CDPATH= cd -- "$(dirname -- "$0")" && pwd)
case "$({ ldconfig -p || /sbin/ldconfig -p; } 2>/dev/null)" in
*libvulkan.so.1*) ;;
*) export LD_LIBRARY_PATH="$here/lib${LD_LIBRARY_PATH:+:$LD_LIBRARY_PATH}" ;;
esac
exec "$here/bin/measure" "$@"
"#;

const README: &str = "\
# Measuring a graphics card with Trepan

`./measure` on x86-64 Linux with a Vulkan driver; nothing needs to be installed. It takes less than
8 minutes and writes `measured/card.json` and `measured/card.html`. `./measure --help` lists the
options. The driver's file may be named: `VK_DRIVER_FILES=.../nvidia_icd.json ./measure`. A software
driver is refused unless `--software` is given, which checks agreement only.

`bin/measure` is under MIT or Apache-2.0. `lib/libvulkan.so.1`, where it is there, is the Khronos
Group's Vulkan loader, under Apache-2.0, as the system that made this bundle ships it. The head
under `bin/fixtures` has its sources and licences in the README beside it.

`python3 mujoco_warp.py 18 17 12` times MuJoCo Warp's flex on the same block of 22,032 tetrahedra
where the packages `mujoco-warp` and `warp-lang` are installed; `measure` has the block as
`22032 tetrahedra`.
";

/// Builds, copies and measures the folder.
pub fn gpu(root: &Path, out: &Path) -> Result<()> {
    make(root, out, ("release", &["--release", "--package", "trepan-trials", "--bin", "measure"]))
}

/// With the build folder and the flags of a profile.
fn make(root: &Path, out: &Path, (profile, flags): (&str, &[&str])) -> Result<()> {
    ensure!(!out.exists(), "{}: is there already; name a new folder", out.display());
    super::cargo(&[&["build"], flags].concat(), &[])?;
    let target = std::env::var_os("CARGO_TARGET_DIR").map_or_else(|| root.join("target"), Into::into);
    let (bin, lib) = (out.join("bin"), out.join("lib"));
    [&bin, &lib].into_iter().try_for_each(fs::create_dir_all)?;
    let mut strip = Command::new("strip");
    strip.arg("-o").arg(bin.join("measure")).arg(target.join(profile).join("measure"));
    ensure!(strip.status().context("strip, of binutils")?.success(), "strip failed");
    copy(&root.join("fixtures/case-head"), &bin.join("fixtures/case-head"))?;
    copy(&root.join("crates/evidence/limits"), &bin.join("limits"))?;
    fs::copy(root.join("crates/trials/tissue/src/rivals/mujoco_warp.py"), out.join("mujoco_warp.py"))?;
    fs::write(out.join("measure"), MEASURE)?;
    fs::set_permissions(out.join("measure"), fs::Permissions::from_mode(0o755))?;
    fs::write(out.join("README.md"), README)?;
    let loaders = ["/usr/lib/x86_64-linux-gnu/libvulkan.so.1", "/usr/lib64/libvulkan.so.1"];
    match loaders.iter().find(|path| Path::new(path).exists()) {
        Some(loader) => drop(fs::copy(loader, lib.join("libvulkan.so.1"))?),
        None => println!("no Vulkan loader here: {} needs one where it runs", out.display()),
    }
    let bytes = size(out)?;
    println!("{}: {:.1} MiB", out.display(), bytes as f64 / f64::from(1 << 20));
    ensure!(bytes <= MOST_BYTES, "{}: {bytes} bytes, over {MOST_BYTES}", out.display());
    Ok(())
}

/// Makes the bundle and runs it as a stranger would: no environment, another home, another folder.
/// In the profile of the tests, which is built already.
pub fn check(root: &Path) -> Result<()> {
    let place = std::env::temp_dir().join(format!("trepan-bundle-{}", std::process::id()));
    let made = make(root, &place.join("bundle"), ("debug", &crate::BINS)).and_then(|()| {
        let mut measure = Command::new(place.join("bundle/measure"));
        measure.args(["--software", "--quick", "agreement"]).current_dir(&place);
        measure.env_clear().envs([("HOME", &place), ("PATH", &"/usr/bin:/bin".into())]);
        let output = measure.output().context("the bundle's measure")?;
        let (text, fault) = (String::from_utf8_lossy(&output.stdout), String::from_utf8_lossy(&output.stderr));
        if fault.contains("no Vulkan driver") && std::env::var_os("CI").is_none() {
            println!("skipped: no Vulkan driver here, so the bundle is not run");
            return Ok(());
        }
        ensure!(output.status.success() && place.join("measured/card.html").is_file(), "the bundle: {text}{fault}");
        Ok(())
    });
    fs::remove_dir_all(&place).context("the bundle's folder")?;
    made
}

/// Copies the files of a folder.
fn copy(from: &Path, to: &Path) -> Result<()> {
    fs::create_dir_all(to)?;
    for file in fs::read_dir(from)? {
        let file = file?;
        fs::copy(file.path(), to.join(file.file_name()))?;
    }
    Ok(())
}

/// Bytes of all files in a folder.
fn size(folder: &Path) -> Result<u64> {
    fs::read_dir(folder)?.try_fold(0, |sum, entry| {
        let entry = entry?;
        Ok(sum + if entry.file_type()?.is_dir() { size(&entry.path())? } else { entry.metadata()?.len() })
    })
}
