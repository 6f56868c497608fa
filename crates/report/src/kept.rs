//! The sessions that were kept, as their summaries tell.

use serde_json::Value;
use std::fs;
use std::path::{Path, PathBuf};

/// A session in its folder.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct SessionFolder {
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

/// Largest number of sessions that the window reads.
const MOST: usize = 500;
/// How deep below a folder sessions are looked for: program, batch, session.
const MOST_DEEP: usize = 3;

impl SessionFolder {
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

    /// Lists the newest sessions in or below these folders, the newest first.
    pub fn list(roots: &[PathBuf]) -> Vec<Self> {
        folders(roots).iter().take(MOST).filter_map(|folder| Self::of(folder)).collect()
    }

    /// Lists all sessions in or below these folders, the newest first.
    pub fn all(roots: &[PathBuf]) -> Vec<Self> {
        folders(roots).iter().filter_map(|folder| Self::of(folder)).collect()
    }

    /// When the session began, UTC as in RFC 3339; of older sessions from the folder's name, empty
    /// if that holds none.
    pub fn date(&self) -> String {
        let of_folder = || {
            let (date, time) = (self.title.get(..10)?, self.title.get(11..19)?);
            let is_date = |text: &str, digits: usize| text.chars().filter(char::is_ascii_digit).count() == digits;
            let whole = self.title.get(10..11) == Some("T") && is_date(date, 8) && is_date(time, 6);
            whole.then(|| format!("{date}T{}Z", time.replace('-', ":")))
        };
        let written = self.summary["date"].as_str().map(String::from);
        written.or_else(of_folder).unwrap_or_default()
    }

    /// Whether it repeats or shows another session: a replay or a watcher's.
    pub fn is_copy(&self) -> bool {
        ["replay", "watch"].contains(&self.device.as_str())
    }

    /// Whether another session is of the same person and case, and of the same lesson or program.
    fn is_like(&self, other: &Self) -> bool {
        let of = |kept: &Self| {
            (kept.person.trim().to_lowercase(), kept.lesson.clone(), kept.program.clone(), kept.case.clone())
        };
        !self.person.trim().is_empty() && !self.is_copy() && !other.is_copy() && of(self) == of(other)
    }

    /// The sessions of the same person and case with the same lesson or program that began before,
    /// the newest first. Sessions are ordered by the names of their folders.
    pub fn before(&self, all: &[Self]) -> Vec<Self> {
        all.iter().filter(|other| other.title < self.title && self.is_like(other)).cloned().collect()
    }
}

/// Folders of sessions in or below these folders, the newest first by their names; each once.
fn folders(roots: &[PathBuf]) -> Vec<PathBuf> {
    let mut found = Vec::new();
    roots.iter().for_each(|root| find(root, MOST_DEEP, &mut found));
    found.sort_by_cached_key(|folder| std::cmp::Reverse(folder.file_name().map(std::ffi::OsStr::to_os_string)));
    let mut seen = std::collections::HashSet::new();
    found.retain(|folder| seen.insert(folder.canonicalize().unwrap_or_else(|_| folder.clone())));
    found
}

fn find(folder: &Path, deep: usize, found: &mut Vec<PathBuf>) {
    if folder.join("summary.json").is_file() {
        found.push(folder.into());
    } else if deep > 0 {
        let below = fs::read_dir(folder).into_iter().flatten().flatten();
        // A link could lead round in a circle.
        let below = below.filter(|entry| entry.file_type().is_ok_and(|kind| kind.is_dir()));
        below.for_each(|entry| find(&entry.path(), deep - 1, found));
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
        let all = SessionFolder::list(&[home.path().into(), home.path().join("missing")]);
        assert_eq!((all.len(), all[0].title.as_str()), (5, "2026-01-05T00-00-00-named"));
        let before: Vec<_> = all[0].before(&all).into_iter().map(|kept| kept.title).collect();
        assert_eq!(before, ["2026-01-03T00-00-00", "2026-01-01T00-00-00"]);
        assert!(SessionFolder { person: String::new(), ..all[0].clone() }.before(&all).is_empty(), "nobody was named");
        let same = [home.path().to_path_buf(), home.path().join("integrated/2026-01-02T00-00-00")];
        assert_eq!((SessionFolder::all(&same).len(), all[0].date().as_str()), (5, "2026-01-05T00:00:00Z"));
        assert_eq!(SessionFolder::with(Path::new("demo"), Value::Null).date(), "");
        let elsewhere = SessionFolder { case: "another head".into(), ..all[0].clone() };
        assert!(elsewhere.before(&all).is_empty(), "another patient is another curve");
        let copy = SessionFolder { device: "watch".into(), ..all[0].clone() };
        assert!(copy.before(&all).is_empty());
    }
}
