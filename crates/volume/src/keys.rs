//! Text headers of "key: value" lines.

use crate::ReadError;
use crate::source::Source;
use std::str::FromStr;

/// Most lines of a header.
const MOST_LINES: usize = 10_000;

/// The keys and values of a header, keys in lower case without spaces; those of NRRD's "key:=value"
/// start with a colon.
pub(crate) struct Keys(Vec<(String, String)>);

impl Keys {
    /// Reads lines until `last` is true for one, or the file ends.
    ///
    /// Skips lines that start with #.
    pub fn read(source: &mut Source, parting: &str, last: impl Fn(&str) -> bool) -> Result<Self, ReadError> {
        let mut keys = Vec::new();
        for _ in 0..MOST_LINES {
            let Some(line) = source.line()? else { return Ok(Self(keys)) };
            if let Some((key, value)) = line.split_once(parting).filter(|_| !line.starts_with('#')) {
                match value.strip_prefix('=') {
                    Some(value) => keys.push((format!(":{}", plain(key)), value.trim().to_owned())),
                    None => keys.push((plain(key), value.trim().to_owned())),
                }
            }
            if last(&line) {
                return Ok(Self(keys));
            }
        }
        Err(source.field("the header", format!("more than {MOST_LINES} lines long"), "fetch the file again"))
    }

    /// The value of the first of some names for a key.
    pub fn text(&self, names: &[&str]) -> Option<&str> {
        let found = names.iter().find_map(|name| self.0.iter().find(|(key, _)| *key == plain(name)));
        found.map(|(_, value)| value.as_str())
    }

    /// Keys that start with `start`, without it, and their values.
    pub fn starting(&self, start: &str) -> impl Iterator<Item = (&str, &str)> {
        self.0.iter().filter_map(move |(key, value)| Some((key.strip_prefix(start)?, value.as_str())))
    }

    /// The value of a required key.
    pub fn needed(&self, source: &Source, field: &'static str) -> Result<&str, ReadError> {
        self.text(&[field])
            .ok_or_else(|| source.field(field, "missing", "the header must give it; fetch the file again"))
    }
}

/// Parses numbers separated by any other characters.
pub(crate) fn numbers<T: FromStr>(source: &Source, field: &'static str, text: &str) -> Result<Vec<T>, ReadError> {
    let words = text.split(|c: char| c.is_whitespace() || "(),".contains(c)).filter(|w| !w.is_empty());
    let read =
        |word: &str| word.parse().map_err(|_| source.field(field, format!("{text:?}"), "numbers must stand there"));
    words.take(1000).map(read).collect()
}

fn plain(key: &str) -> String {
    key.chars().filter(|c| !c.is_whitespace()).flat_map(char::to_lowercase).collect()
}
