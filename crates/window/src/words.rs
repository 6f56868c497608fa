//! The language of the window: what a text in English is in another one.
//!
//! # Practice
//! The English text is the key, looked up where the window puts it on screen. A number in a text
//! stands as `{}` in key and translation: "{} mm apart". A text without a line of its own is taken
//! apart at "; ", ": " and ", ". What is missing stays English; [`missing`] lists it. One
//! letter, as in a unit or a key, is no word.

use std::cell::RefCell;
use std::collections::{BTreeSet, HashMap};

/// A language of the window.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Language {
    /// Its name in itself: Deutsch.
    pub name: String,
    /// English text and its translation.
    pub texts: HashMap<String, String>,
}

thread_local! {
    /// The language of this thread's window, and the texts that it lacks; `None` is English.
    static SPOKEN: RefCell<Option<(Language, BTreeSet<String>)>> = const { RefCell::new(None) };
}

/// Sets the language of the window on this thread; `None` is English.
pub fn speak(language: Option<Language>) {
    SPOKEN.set(language.map(|language| (language, BTreeSet::new())));
}

/// Returns the texts that were shown without a translation, and have a word to translate.
pub fn missing() -> Vec<String> {
    SPOKEN.with_borrow(|spoken| spoken.iter().flat_map(|(_, missing)| missing.iter().cloned()).collect())
}

/// Translates a text into the language of the window.
pub fn tr(text: &str) -> String {
    SPOKEN.with_borrow_mut(|spoken| match spoken {
        Some((language, missing)) => language.translate(text, missing),
        None => text.into(),
    })
}

/// Where a text without a line of its own is taken apart.
const JOINTS: [&str; 4] = ["\n", "; ", ": ", ", "];

impl Language {
    fn translate(&self, text: &str, missing: &mut BTreeSet<String>) -> String {
        let is_word = |pair: [char; 2]| pair.iter().all(|letter| letter.is_alphabetic());
        if !text.chars().zip(text.chars().skip(1)).any(|(a, b)| is_word([a, b])) {
            return text.into();
        }
        if let Some(found) = self.texts.get(text) {
            return found.clone();
        }
        let (key, numbers) = template(text);
        if let Some(found) = self.find(&key) {
            return filled(&found, &numbers);
        }
        if let Some((head, joint, tail)) = self.parts(text) {
            return [&*self.translate(head, missing), joint, &self.translate(tail, missing)].concat();
        }
        missing.insert(key);
        text.into()
    }

    /// Takes a text apart where a part has a line of its own, else at the first joint.
    fn parts<'a>(&self, text: &'a str) -> Option<(&'a str, &'a str, &'a str)> {
        let apart = |(at, joint): (usize, &'a str)| (&text[..at], joint, &text[at + joint.len()..]);
        let all = || JOINTS.iter().flat_map(|joint| text.match_indices(joint)).map(apart);
        let has_line = |part: &str| self.find(&template(part).0).is_some();
        let both = all().find(|(head, _, tail)| has_line(head) && has_line(tail));
        both.or_else(|| all().find(|(head, _, tail)| has_line(head) || has_line(tail))).or_else(|| all().next())
    }

    /// Finds a line for a text, or for the same text with a small first letter.
    fn find(&self, key: &str) -> Option<String> {
        let small = |letter: char| letter.to_lowercase().next().unwrap_or(letter);
        let begun = || self.texts.get(&with_first(key, small)).map(|found| sentence(found));
        self.texts.get(key).cloned().or_else(begun)
    }
}

/// Begins a text with a large letter.
pub(crate) fn sentence(text: &str) -> String {
    with_first(text, |letter| letter.to_uppercase().next().unwrap_or(letter))
}

fn with_first(text: &str, case: fn(char) -> char) -> String {
    let mut letters = text.chars();
    letters.next().map_or_else(String::new, |first| [case(first)].into_iter().chain(letters).collect())
}

/// Takes the numbers out of a text. A digit that follows a letter, as in F1 and mm3, is none.
fn template(text: &str) -> (String, Vec<&str>) {
    let (mut key, mut numbers, mut rest) = (String::new(), Vec::new(), text);
    while let Some(first) = rest.chars().next() {
        let is_free = !key.ends_with(char::is_alphanumeric);
        let digits = rest.strip_prefix('-').filter(|_| is_free && !key.ends_with('}')).unwrap_or(rest);
        let length = digits.find(|c: char| !c.is_ascii_digit() && c != '.').unwrap_or(digits.len());
        let number = digits[..length].trim_end_matches('.');
        if is_free && number.starts_with(|c: char| c.is_ascii_digit()) {
            let end = rest.len() - digits.len() + number.len();
            numbers.push(&rest[..end]);
            key.push_str("{}");
            rest = &rest[end..];
        } else {
            key.push(first);
            rest = &rest[first.len_utf8()..];
        }
    }
    (key, numbers)
}

/// Puts numbers into the places of a template.
fn filled(template: &str, numbers: &[&str]) -> String {
    let mut parts = template.split("{}");
    let first = parts.next().unwrap_or_default().to_string();
    let numbers = numbers.iter().copied().chain(std::iter::repeat(""));
    parts.zip(numbers).fold(first, |text, (part, number)| text + number + part)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn german() -> Language {
        let lines = [
            ("bone below the tool", "Knochen unter dem Werkzeug"),
            ("about {} s left", "noch etwa {} s"),
            ("the drill has stalled", "der Bohrer steht"),
            ("press less", "weniger drücken"),
        ];
        let texts = lines.map(|(english, german)| (english.to_string(), german.to_string())).into();
        Language { name: "Deutsch".into(), texts }
    }

    #[test]
    fn numbers_stand_apart_and_texts_are_taken_apart_where_needed() {
        speak(Some(german()));
        assert_eq!(tr("bone below the tool"), "Knochen unter dem Werkzeug");
        assert_eq!(tr("about 12.5 s left"), "noch etwa 12.5 s");
        assert_eq!(tr("The drill has stalled: press less"), "Der Bohrer steht: weniger drücken");
        assert_eq!(tr("3.2"), "3.2");
        assert!(missing().is_empty());
        assert_eq!(tr("x: y, about 3 s left"), "x: y, noch etwa 3 s", "at the joint before a known part");
        assert_eq!(tr("press less, 3 times"), "weniger drücken, 3 times");
        assert_eq!(missing(), ["{} times"]);
        speak(None);
        assert_eq!(tr("press less"), "press less");
    }

    #[test]
    fn digits_of_a_name_are_no_number() {
        assert_eq!(template("F1, 20.5 mm3, -3 to 1.").0, "F1, {} mm3, {} to {}.");
        assert_eq!(template("-1.5 and 2-3").1, ["-1.5", "2", "3"]);
        assert_eq!(template("a-3").0, "a-{}");
        assert_eq!(filled("{} von {}", &["1", "2"]), "1 von 2");
    }
}
