//! Checks prose: length of lines, length of first sentences, and words that are retired.

/// Longest line of a comment or of Markdown, characters.
const COLUMNS: usize = 100;
/// Longest first sentence of a docstring, words.
const WORDS: usize = 25;
/// A line with this text names old words on purpose: what version 0.1 wrote is still read.
const OLD: &str = "version 0.1";

/// Words that are not used any more, and what is used instead: `OLD -> NEW`, a line each.
const RETIRED: &str = include_str!("retired_words.txt");

/// Participles, which say what happened to a thing and not what it is.
const PARTICIPLES: [&str; 24] = [
    "Asked", "Built", "Crossed", "Drawn", "Ended", "Felt", "Flown", "Garbled", "Held", "Kept", "Lent", "Looked", "Met",
    "Opened", "Paid", "Ran", "Seen", "Shown", "Stored", "Taken", "Taught", "Told", "Worn", "Wanted",
];

/// Participles that variables and fields were named after.
const OF_VARIABLES: [&str; 5] = ["told", "said", "heard", "taught", "flown"];

/// Faults of a source file in Rust or WGSL, each with its line.
pub fn in_source(text: &str) -> Vec<String> {
    let mut faults = retired(text);
    faults
        .extend(text.lines().enumerate().filter_map(|(at, line)| participle(at, line).or_else(|| variable(at, line))));
    let comments = text.lines().enumerate().filter(|(_, line)| line.trim_start().starts_with("//"));
    faults.extend(comments.filter_map(|(at, line)| too_wide(at, line)));
    faults.extend(first_sentences(text));
    faults
}

/// Faults of a Markdown file, each with its line. Tables and blocks of code may be wider.
pub fn in_markdown(text: &str) -> Vec<String> {
    let mut faults = retired(text);
    let mut is_code = false;
    for (at, line) in text.lines().enumerate() {
        let fence = line.trim_start().starts_with("```");
        is_code ^= fence;
        if !is_code && !fence && !line.trim_start().starts_with('|') {
            faults.extend(too_wide(at, line));
        }
    }
    faults
}

/// A type that is named by a participle alone.
fn participle(at: usize, line: &str) -> Option<String> {
    let keyword = ["struct ", "enum ", "trait ", "type "].into_iter();
    let name = keyword.filter_map(|keyword| line.split_once(keyword)).find(|(before, _)| {
        let before = before.trim();
        before.is_empty() || before.starts_with("pub")
    });
    let name = name?.1.split(|c: char| !c.is_alphanumeric()).next()?;
    PARTICIPLES.contains(&name).then(|| format!("{}: `{name}` is a participle, name the thing", at + 1))
}

/// A variable, field or function that is named by a participle alone.
fn variable(at: usize, line: &str) -> Option<String> {
    let code = line.trim_start();
    let code = ["pub fn ", "fn ", "let mut ", "let ", "pub "]
        .iter()
        .find_map(|start| code.strip_prefix(start))
        .unwrap_or(code);
    let (name, rest) = code.split_at(code.find(|c: char| !c.is_alphanumeric() && c != '_').unwrap_or(code.len()));
    let is_named = [": ", " = ", "("].iter().any(|next| rest.starts_with(next));
    (is_named && OF_VARIABLES.contains(&name)).then(|| format!("{}: `{name}` is a participle, name the thing", at + 1))
}

/// A line that is too wide, unless it is one long word such as an address.
fn too_wide(at: usize, line: &str) -> Option<String> {
    let columns = line.chars().count();
    let words = line.split_whitespace().filter(|word| word.chars().any(char::is_alphanumeric)).count();
    (columns > COLUMNS && words > 1).then(|| format!("{}: {columns} columns, the limit is {COLUMNS}", at + 1))
}

/// Retired words that stand in a text as whole words.
fn retired(text: &str) -> Vec<String> {
    let pairs: Vec<_> = RETIRED.lines().filter_map(|pair| pair.split_once(" -> ")).collect();
    let mut faults = Vec::new();
    for (at, line) in text.lines().enumerate().filter(|(_, line)| !line.contains(OLD)) {
        let found = pairs.iter().filter(|(word, _)| has_word(line, word));
        faults.extend(found.map(|(word, instead)| format!("{}: `{word}` is retired, write {instead}", at + 1)));
    }
    faults
}

fn has_word(line: &str, word: &str) -> bool {
    let is_part = |c: char| c.is_alphanumeric() || c == '_' || c == '-';
    line.match_indices(word).any(|(at, _)| {
        let (before, after) = (line[..at].chars().next_back(), line[at + word.len()..].chars().next());
        !before.is_some_and(is_part) && !after.is_some_and(is_part)
    })
}

/// First sentences of docstrings that have too many words.
fn first_sentences(text: &str) -> Vec<String> {
    let mut faults = Vec::new();
    let mut before = None;
    let mut lines = text.lines().enumerate().peekable();
    while let Some((at, line)) = lines.next() {
        let Some((mark, first)) = doc(line) else {
            before = None;
            continue;
        };
        if before.replace(mark) == Some(mark) {
            continue;
        }
        let mut paragraph = String::from(first);
        while let Some((_, more)) =
            lines.next_if(|(_, line)| doc(line).is_some_and(|(m, t)| m == mark && !t.is_empty()))
        {
            paragraph.push(' ');
            paragraph.push_str(doc(more).map_or("", |(_, text)| text));
        }
        let words = sentence(&paragraph).split_whitespace().count();
        if words > WORDS {
            faults.push(format!("{}: the first sentence has {words} words, the limit is {WORDS}", at + 1));
        }
    }
    faults
}

/// Mark and text of a line of a docstring.
fn doc(line: &str) -> Option<(&'static str, &str)> {
    let line = line.trim_start();
    ["//!", "///"].into_iter().find_map(|mark| Some((mark, line.strip_prefix(mark)?.trim())))
}

/// What ends with a stop before a capital or before code.
fn sentence(paragraph: &str) -> &str {
    let begins = |c: char| c.is_uppercase() || matches!(c, '`' | '[' | '(');
    let mut ends = paragraph.match_indices(['.', '?', '!']).filter(|(at, _)| {
        let rest = &paragraph[at + 1..];
        rest.starts_with(' ') && rest.trim_start().starts_with(begins)
    });
    ends.next().map_or(paragraph, |(at, _)| &paragraph[..=at])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_planted_retired_word_is_found_as_a_whole_word() {
        let mut pairs = RETIRED.lines().map(|pair| pair.split_once(" -> ").expect("OLD -> NEW").0);
        assert!(pairs.clone().count() > 19);
        assert!(pairs.clone().all(|word| in_source(&format!("/// Counts {word}.\nfn f() {{}}\n")).len() == 1));
        assert!(pairs.clone().all(|word| in_markdown(&format!("Use `{word}`.")).len() == 1));
        assert!(pairs.clone().all(|word| in_source(&format!("    \"{word}\" => 1, // of {OLD}\n")).is_empty()));
        assert!(pairs.all(|word| in_markdown(&format!("Neither a{word} nor {word}_b is on the list.")).is_empty()));
    }

    #[test]
    fn a_type_or_variable_that_is_named_by_a_participle_is_found() {
        for line in ["pub struct Held {", "    enum Shown<'a> {", "pub(crate) type Asked = u8;"] {
            assert_eq!(in_source(line).len(), 1, "{line}");
        }
        for line in ["let told = 1;", "    let mut said: u8;", "    pub heard: u32,", "fn taught(a: u8) {"] {
            assert_eq!(in_source(line).len(), 1, "{line}");
        }
        for line in ["struct HeldTool;", "it.told()", "let told_ms = 1;", "let x = Kept;", "    Drawn,", "impl Held {"]
        {
            assert!(in_source(line).is_empty(), "{line}");
        }
    }

    #[test]
    fn a_first_sentence_of_26_words_is_found_wherever_its_lines_break() {
        let words = |n: usize| (0..n).map(|i| if i % 9 == 8 { "word\n/// " } else { "word " }).collect::<String>();
        assert_eq!(first_sentences(&format!("/// {}.", words(26).trim())).len(), 1);
        assert!(first_sentences(&format!("/// {}.\n/// Another sentence. {}", words(25).trim(), words(9))).is_empty());
        assert!(
            first_sentences(&format!("/// Short.\n///\n/// {}", words(40))).is_empty(),
            "later paragraphs are free"
        );
        let two = format!("//! {}\n\n/// Short.\n", words(30).replace("///", "//!"));
        assert_eq!(first_sentences(&two), ["1: the first sentence has 30 words, the limit is 25"]);
    }

    #[test]
    fn a_line_of_101_columns_is_found_in_prose_alone() {
        let line = |n: usize| format!("// ö {}", "a".repeat(n - 5));
        assert!(in_source(&line(100)).is_empty());
        assert_eq!(in_source(&line(101)).len(), 1);
        assert!(in_source(&format!("let x = \"{}\";", "a ".repeat(60))).is_empty(), "rustfmt is for code");
        let wide = "word ".repeat(30);
        assert_eq!(in_markdown(&wide).len(), 1);
        assert!(in_markdown(&format!("| {wide} |\n```\n{wide}\n```\n")).is_empty());
        assert!(in_markdown(&format!("<https://example.org/{}>", "a".repeat(100))).is_empty());
    }
}
