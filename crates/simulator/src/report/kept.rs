//! The sessions that were kept, as their summaries tell.

use serde_json::Value;
use std::fs;
use std::path::{Path, PathBuf};

/// A session in its folder.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Kept {
    /// Its folder.
    pub folder: PathBuf,
    /// Date, time and name, as in the name of the folder.
    pub title: String,
    /// The program.
    pub program: String,
    /// Name of the case.
    pub case: String,
    /// Name of the device.
    pub device: String,
    /// Who operated; empty if unknown.
    pub person: String,
    /// Name of the lesson; empty without one.
    pub lesson: String,
    /// Its summary.
    pub summary: Value,
}

/// Largest number of sessions that are read.
const MOST: usize = 500;

impl Kept {
    /// Reads the session in a folder.
    pub fn of(folder: &Path) -> Option<Self> {
        let summary = serde_json::from_slice(&fs::read(folder.join("summary.json")).ok()?).ok()?;
        Some(Self::with(folder, summary))
    }

    /// A session with this summary.
    pub fn with(folder: &Path, summary: Value) -> Self {
        let text = |key: &str| summary[key].as_str().unwrap_or_default().to_string();
        let title = folder.file_name().unwrap_or_default().to_string_lossy().into_owned();
        let [program, case, device, person, lesson] = ["app", "case", "device", "person", "lesson"].map(text);
        Self { folder: folder.into(), title, program, case, device, person, lesson, summary }
    }

    /// Lists the sessions in the folders of programs below these folders, the newest first.
    pub fn list(roots: &[PathBuf]) -> Vec<Self> {
        let below = |folder: &Path| fs::read_dir(folder).into_iter().flatten().flatten().map(|entry| entry.path());
        let mut folders: Vec<PathBuf> =
            roots.iter().flat_map(|root| below(root)).flat_map(|program| below(&program)).collect();
        folders.sort_by_key(|folder| std::cmp::Reverse(folder.file_name().map(std::ffi::OsStr::to_os_string)));
        folders.iter().take(MOST).filter_map(|folder| Self::of(folder)).collect()
    }

    /// Whether another session is of the same person, and of the same lesson or program.
    fn is_like(&self, other: &Self) -> bool {
        let of = |kept: &Self| (kept.person.trim().to_lowercase(), kept.lesson.clone(), kept.program.clone());
        !self.person.trim().is_empty() && self.device != "replay" && other.device != "replay" && of(self) == of(other)
    }

    /// The sessions of the same person with the same lesson or program that began before this one,
    /// the newest first. Sessions are ordered by the names of their folders.
    pub fn before(&self, all: &[Self]) -> Vec<Self> {
        all.iter().filter(|other| other.title < self.title && self.is_like(other)).cloned().collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn sessions_are_listed_and_compared_by_person_and_lesson() {
        let home = tempfile::tempdir().unwrap();
        let write = |title: &str, person: &str, lesson: Option<&str>| {
            let folder = home.path().join("integrated").join(title);
            fs::create_dir_all(&folder).unwrap();
            let summary =
                json!({ "app": "integrated", "case": "c", "device": "mouse", "person": person, "lesson": lesson });
            fs::write(folder.join("summary.json"), summary.to_string()).unwrap();
        };
        for (title, person, lesson) in [
            ("2026-01-01T00-00-00", "Ada", Some("flap")),
            ("2026-01-02T00-00-00", "Bob", Some("flap")),
            ("2026-01-03T00-00-00", "ada ", Some("flap")),
            ("2026-01-04T00-00-00", "Ada", None),
            ("2026-01-05T00-00-00-named", "Ada", Some("flap")),
        ] {
            write(title, person, lesson);
        }
        fs::create_dir_all(home.path().join("integrated/half-written")).unwrap();
        let all = Kept::list(&[home.path().into(), home.path().join("missing")]);
        assert_eq!((all.len(), all[0].title.as_str()), (5, "2026-01-05T00-00-00-named"));
        let before: Vec<_> = all[0].before(&all).into_iter().map(|kept| kept.title).collect();
        assert_eq!(before, ["2026-01-03T00-00-00", "2026-01-01T00-00-00"]);
        assert!(Kept { person: String::new(), ..all[0].clone() }.before(&all).is_empty(), "nobody was named");
    }
}
