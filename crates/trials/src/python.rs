//! Packages of others as programs of their own: a Python environment that is made for a run and
//! goes with it.
//!
//! # Practice
//! Needs Python 3 with `venv`, and its package index once. `TREPAN_PYTHON` names another Python; if
//! that has the packages already, it is used as it is. Nothing of theirs is linked, kept or
//! shipped.

use std::ffi::OsStr;
use std::path::PathBuf;
use std::process::Command;

/// The environment variable with another Python.
const PYTHON: &str = "TREPAN_PYTHON";

/// A folder with a Python that has some packages.
pub struct Workshop {
    folder: tempfile::TempDir,
    python: PathBuf,
}

impl Workshop {
    /// With packages, as (name to import, name in the index), and a script to run; says which
    /// versions they are.
    pub fn with(packages: &[(&str, &str)], script: &str) -> Result<Self, String> {
        let folder = tempfile::tempdir().map_err(|fault| fault.to_string())?;
        std::fs::write(folder.path().join("script.py"), script).map_err(|fault| fault.to_string())?;
        let given: PathBuf = std::env::var_os(PYTHON).unwrap_or_else(|| "python3".into()).into();
        let imports = packages.iter().map(|(import, _)| format!("import {import}\n")).collect::<String>();
        let python = match said(Command::new(&given).args(["-c", &imports])) {
            Ok(_) => given,
            Err(_) => {
                let environment = folder.path().join("environment");
                said(Command::new(given).args(["-m", "venv"]).arg(&environment))?;
                let python = environment.join(if cfg!(windows) { "Scripts/python.exe" } else { "bin/python" });
                let mut install = Command::new(&python);
                install.args(["-m", "pip", "install", "--quiet", "--only-binary", ":all:"]);
                said(install.args(packages.iter().map(|(_, package)| package)))?;
                python
            }
        };
        let list = said(Command::new(&python).args(["-m", "pip", "list", "--format", "freeze"])).unwrap_or_default();
        let named = |line: &&str| packages.iter().any(|(_, package)| line.starts_with(&format!("{package}==")));
        println!("  {}", list.lines().filter(named).collect::<Vec<_>>().join(", "));
        Ok(Self { folder, python })
    }

    /// A file in the folder, in which the script runs too.
    pub fn at(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    /// What the script prints, or the last line of its complaint.
    pub fn run(&self, arguments: impl IntoIterator<Item = impl AsRef<OsStr>>) -> Result<String, String> {
        said(Command::new(&self.python).arg(self.at("script.py")).args(arguments).current_dir(self.folder.path()))
    }
}

/// What a program prints, or why it failed: the last line of its complaint.
fn said(command: &mut Command) -> Result<String, String> {
    let program = command.get_program().to_string_lossy().into_owned();
    let out = command.output().map_err(|fault| format!("{program}: {fault}"))?;
    if out.status.success() {
        return Ok(String::from_utf8_lossy(&out.stdout).into_owned());
    }
    let complaint = [&out.stderr, &out.stdout].map(|bytes| String::from_utf8_lossy(bytes).into_owned());
    let last = complaint.iter().flat_map(|text| text.lines().rev()).find(|line| !line.trim().is_empty());
    Err(format!("{program}: {}", last.unwrap_or("it failed without a word")))
}
