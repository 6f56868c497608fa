//! Runs third-party Python packages in a temporary virtual environment.
//!
//! # Practice
//! Needs Python 3 with `venv`, and access to the package index. `TREPAN_PYTHON` names another
//! Python; if it has the packages already, it is used as it is. The packages are not linked, kept
//! or shipped.

use anyhow::{Context, Result, bail};
use std::ffi::OsStr;
use std::path::PathBuf;
use std::process::Command;

/// Environment variable that names another Python.
const PYTHON: &str = "TREPAN_PYTHON";

/// Temporary folder with a script and a Python that has the packages.
pub struct Workshop {
    folder: tempfile::TempDir,
    python: PathBuf,
    /// Packages with their versions, as `name==version`.
    pub versions: String,
}

impl Workshop {
    /// Sets up packages, as (name to import, name in the index), and a script, and prints the
    /// packages' versions.
    pub fn with(packages: &[(&str, &str)], script: &str) -> Result<Self> {
        let folder = tempfile::tempdir()?;
        std::fs::write(folder.path().join("script.py"), script)?;
        let given: PathBuf = std::env::var_os(PYTHON).unwrap_or_else(|| "python3".into()).into();
        let imports = packages.iter().map(|(import, _)| format!("import {import}\n")).collect::<String>();
        let python = match output_of(Command::new(&given).args(["-c", &imports])) {
            Ok(_) => given,
            Err(_) => {
                let environment = folder.path().join("environment");
                output_of(Command::new(given).args(["-m", "venv"]).arg(&environment))?;
                let python = environment.join(if cfg!(windows) { "Scripts/python.exe" } else { "bin/python" });
                let mut install = Command::new(&python);
                install.args(["-m", "pip", "install", "--quiet", "--only-binary", ":all:"]);
                output_of(install.args(packages.iter().map(|(_, package)| package)))?;
                python
            }
        };
        let list =
            output_of(Command::new(&python).args(["-m", "pip", "list", "--format", "freeze"])).unwrap_or_default();
        let named = |line: &&str| packages.iter().any(|(_, package)| line.starts_with(&format!("{package}==")));
        let versions = list.lines().filter(named).collect::<Vec<_>>().join(", ");
        println!("  {versions}");
        Ok(Self { folder, python, versions })
    }

    /// Path of a file in the folder, which is the script's working directory.
    pub fn at(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    /// Returns the script's output, or the last line of its error text.
    pub fn run(&self, arguments: impl IntoIterator<Item = impl AsRef<OsStr>>) -> Result<String> {
        output_of(Command::new(&self.python).arg(self.at("script.py")).args(arguments).current_dir(self.folder.path()))
    }
}

/// Returns a program's output, or the last line of its error text.
fn output_of(command: &mut Command) -> Result<String> {
    let program = command.get_program().to_string_lossy().into_owned();
    let out = command.output().with_context(|| program.clone())?;
    if out.status.success() {
        return Ok(String::from_utf8_lossy(&out.stdout).into_owned());
    }
    let complaint = [&out.stderr, &out.stdout].map(|bytes| String::from_utf8_lossy(bytes).into_owned());
    let last = complaint.iter().flat_map(|text| text.lines().rev()).find(|line| !line.trim().is_empty());
    bail!("{program}: {}", last.unwrap_or("it failed without a word"))
}
