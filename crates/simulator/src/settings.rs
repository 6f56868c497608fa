//! Settings of the start page, kept in the user's configuration folder.
//!
//! # Practice
//! The file is written whole or not at all, and readable by the user only. `TREPAN_CONFIG` names
//! another folder. A file that cannot be read counts as none. Paths of images stand in it, because
//! a recent case is opened from them again; they are never shown.

use crate::error::SessionError;
use etcetera::{BaseStrategy, choose_base_strategy};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::fs;
use std::path::PathBuf;
use trepan_report::whole::whole;

/// Largest number of recent cases.
const MOST_RECENT: usize = 12;

/// What the start page remembers.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub(crate) struct Settings {
    /// Who operates, as the person wants to be called; empty for nobody.
    pub person: String,
    /// Short name of the window's language; empty for English.
    pub language: String,
    /// Name of the device; empty for the mouse.
    pub device: String,
    /// The tool at the start, by its place in the tray.
    pub tool: usize,
    /// Name of the quality.
    pub quality: String,
    /// Diameter of the planned flap, mm; 0 for a burr hole.
    pub flap_mm: f32,
    /// Folder that was looked into last.
    pub folder: Option<PathBuf>,
    /// Recent cases, the newest first.
    pub recent: Vec<Recent>,
    /// Seconds that each stage of loading took last, by `first` or `again` and its name.
    pub seconds: BTreeMap<String, f64>,
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            person: String::new(),
            language: String::new(),
            device: String::new(),
            tool: 0,
            quality: "auto".into(),
            flap_mm: 0.0,
            folder: None,
            recent: Vec::new(),
            seconds: BTreeMap::new(),
        }
    }
}

/// A case that was opened before.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub(crate) struct Recent {
    /// What the user calls it.
    pub name: String,
    /// Hash of the case as it was built last.
    pub hash: String,
    /// Where it comes from.
    pub source: Source,
    /// A picture of its skull, of the session before.
    pub picture: Option<PathBuf>,
    /// Place of the opening, RAS mm, if the user chose one.
    pub opening: Option<[f32; 3]>,
    /// Line of the flap that the user drew on the skull, RAS mm; empty without one.
    pub flap_line: Vec<[f32; 3]>,
}

/// A patient's images, and how they are imported.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub(crate) struct Images {
    /// CT, if any.
    pub ct: Option<PathBuf>,
    /// MRI, if any.
    pub mri: Option<PathBuf>,
    /// Label volume of the brain, if any.
    pub labels: Option<PathBuf>,
    /// Label volume of a tumour, if any.
    pub tumour: Option<PathBuf>,
    /// Whether the MRI is registered to the CT.
    pub register: bool,
    /// DICOM series of CT and MRI, by number; `None` takes the usual one.
    pub series: [Option<usize>; 2],
    /// Threshold of bone, HU; `None` takes it from the histogram.
    pub isovalue_hu: Option<i16>,
}

/// Where a case comes from.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(crate) enum Source {
    /// The case that comes with the program.
    #[default]
    BuiltIn,
    /// The scanner's images.
    Images(Images),
    /// A folder that `case build` made.
    Folder(PathBuf),
}

impl Settings {
    /// Reads the user's settings; the default ones if there are none.
    pub fn read() -> Self {
        file().and_then(|file| serde_json::from_slice(&fs::read(file).ok()?).ok()).unwrap_or_default()
    }

    /// Writes the settings.
    pub fn write(&self) -> Result<(), SessionError> {
        let no_folder = || SessionError::Usage("no folder for settings: set HOME or TREPAN_CONFIG".into());
        let file = file().ok_or_else(no_folder)?;
        let json = serde_json::to_vec_pretty(self).map_err(|fault| SessionError::Internal(fault.to_string()))?;
        file.parent().map_or(Ok(()), fs::create_dir_all).map_err(SessionError::output(&file))?;
        Ok(whole(&file, &json)?)
    }

    /// Puts a case on top of the recent ones, in place of an entry of the same source.
    pub fn remember(&mut self, case: Recent) {
        self.recent.retain(|known| known.source != case.source);
        self.recent.insert(0, case);
        self.recent.truncate(MOST_RECENT);
    }
}

fn file() -> Option<PathBuf> {
    let named = std::env::var_os("TREPAN_CONFIG").filter(|folder| !folder.is_empty()).map(PathBuf::from);
    let folder = named.or_else(|| Some(choose_base_strategy().ok()?.config_dir().join("trepan")))?;
    Some(folder.join("settings.json"))
}

/// Folder of the sessions that the start page begins: `TREPAN_SESSIONS`, else `trepan/sessions` in
/// the user's data folder.
pub(crate) fn sessions() -> PathBuf {
    let named = std::env::var_os("TREPAN_SESSIONS").filter(|folder| !folder.is_empty()).map(PathBuf::from);
    let of_user = || Some(choose_base_strategy().ok()?.data_dir().join("trepan").join("sessions"));
    named.or_else(of_user).unwrap_or_else(|| PathBuf::from("trepan-out"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_case_that_is_opened_again_moves_to_the_top() {
        let case = |name: &str, folder: &str| Recent {
            name: name.into(),
            source: Source::Folder(folder.into()),
            ..Recent::default()
        };
        let mut settings = Settings::default();
        (0..20).for_each(|n| settings.remember(case(&n.to_string(), &n.to_string())));
        settings.remember(case("again", "15"));
        let names: Vec<_> = settings.recent.iter().map(|case| case.name.as_str()).collect();
        assert_eq!((names.len(), &names[..3]), (MOST_RECENT, &["again", "19", "18"][..]));
        let json = serde_json::to_string(&settings).unwrap();
        assert_eq!(serde_json::from_str::<Settings>(&json).unwrap(), settings);
        assert_eq!(serde_json::from_str::<Settings>("{\"tool\": 3}").unwrap().quality, "auto", "an older file");
    }
}
