//! Languages of the window, from files: those of the program, and those that a user adds.
//!
//! # Practice
//! A file is JSON: the language's `name` in itself, and `texts` with the English text as key. The
//! program's lie in `languages/`, a user's in the folder `languages` beside the settings, where a
//! file of the same name replaces the program's.

use std::collections::HashMap;
use std::fs;
use std::path::Path;
use trepan_report::training::Lesson;
use trepan_window::{Choosable, Language};

/// Short name and file of each language of the program.
const OWN: [(&str, &str); 1] = [("de", include_str!("../../languages/de.json"))];
/// Short name and name of the language of the sources.
const SOURCES: [&str; 2] = ["en", "English"];

/// The languages that can be chosen, by their short names.
#[derive(Clone, Debug, Default)]
pub(crate) struct Languages(Vec<(String, Language)>);

/// A file of a language.
#[derive(serde::Deserialize)]
struct File {
    name: String,
    texts: HashMap<String, String>,
}

pub(super) fn read(json: &str) -> serde_json::Result<Language> {
    serde_json::from_str(json).map(|File { name, texts }| Language { name, texts })
}

impl Languages {
    /// Lists the languages; files that are none are logged.
    pub fn list() -> Self {
        Self::with(Lesson::folder().as_deref().and_then(Path::parent).map(|folder| folder.join("languages")).as_deref())
    }

    fn with(folder: Option<&Path>) -> Self {
        let mut all: Vec<_> =
            OWN.into_iter().filter_map(|(code, json)| Some((code.into(), read(json).ok()?))).collect();
        let entries = folder.and_then(|folder| fs::read_dir(folder).ok()).into_iter().flatten().flatten();
        for path in entries.map(|entry| entry.path()).filter(|path| path.extension().is_some_and(|end| end == "json")) {
            let json = fs::read_to_string(&path).map_err(|fault| fault.to_string());
            match json.and_then(|json| read(&json).map_err(|fault| fault.to_string())) {
                Ok(language) => {
                    let code = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
                    all.retain(|(known, _)| *known != code);
                    all.push((code, language));
                }
                Err(fault) => tracing::warn!("language {}: {fault}", path.display()),
            }
        }
        all.sort_by(|a, b| a.0.cmp(&b.0));
        Self(all)
    }

    /// Short names, English first.
    pub fn codes(&self) -> impl Iterator<Item = &str> {
        SOURCES.into_iter().take(1).chain(self.0.iter().map(|(code, _)| code.as_str()))
    }

    /// What can be chosen, English first.
    pub fn choosable(&self) -> Vec<Choosable> {
        let names = [SOURCES[1]].into_iter().chain(self.0.iter().map(|(_, language)| language.name.as_str()));
        names.map(|name| Choosable { name: name.into(), open: true, ..Choosable::default() }).collect()
    }

    /// Place of a language among those that can be chosen; English where it is unknown.
    pub fn place(&self, code: &str) -> usize {
        self.codes().position(|known| known == code).unwrap_or(0)
    }

    /// A language; `None` is English.
    pub fn get(&self, code: &str) -> Option<Language> {
        self.0.iter().find(|(known, _)| known == code).map(|(_, language)| language.clone())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_file_of_the_user_adds_a_language_or_replaces_one() {
        let home = tempfile::tempdir().unwrap();
        assert_eq!(Languages::with(None).codes().collect::<Vec<_>>(), ["en", "de"]);
        for (file, json) in [
            ("fr.json", r#"{"name": "Français", "texts": {"Quit": "Quitter"}}"#),
            ("de.json", r#"{"name": "Hessisch", "texts": {}}"#),
            ("broken.json", "{"),
            ("notes.txt", "x"),
        ] {
            fs::write(home.path().join(file), json).unwrap();
        }
        let languages = Languages::with(Some(home.path()));
        let names: Vec<_> = languages.choosable().into_iter().map(|choosable| choosable.name).collect();
        assert_eq!(names, ["English", "Hessisch", "Français"]);
        assert_eq!(languages.get("fr").unwrap().texts["Quit"], "Quitter");
        assert_eq!((languages.place("fr"), languages.place("xx"), languages.get("en")), (2, 0, None));
    }
}
