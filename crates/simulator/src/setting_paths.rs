//! Settings by the paths that they have in a recording's header, as in
//! `--set operation.flap_mm=30`, and files of them: `--set @FILE`.
//!
//! # Practice
//! A path stands for a flag, whose unit, range and errors hold. A file has a `PATH=VALUE` in a
//! line; what follows `#` is a comment. The command line counts over a file. `recording settings`
//! prints such a file of a recorded session.

use std::collections::BTreeMap;
use std::ffi::OsString;
use std::fs;
use trepan_models::ingredients::{Ingredients, KEYS, setting};

/// Paths outside `ingredients`, each with its flag.
const FLAGS: [(&str, &str); 15] = [
    ("quality", "--quality"),
    ("sizes.spacing_mm", "--spacing-mm"),
    ("sizes.tets", "--tets"),
    ("sizes.halvings", "--opening-refinement"),
    ("operation.flap_mm", "--flap"),
    ("operation.csf_loss", "--csf-loss"),
    ("operation.csf_speed_up", "--csf-speed-up"),
    ("operation.forbidden", "--forbid"),
    ("operation.young_modulus_kpa", "--young-modulus-kpa"),
    ("operation.aspiration_mm_s", "--aspiration"),
    ("operation.bleeding", "--bleeding"),
    ("operation.dura", "--dura"),
    ("operation.rate_hz", "--rate-hz"),
    ("device.scale", "--device-scale"),
    ("device.force_scale", "--force-scale"),
];

/// Replaces the paths in a command line by their flags, files by what they hold.
///
/// # Errors
/// If a file cannot be read or a line of it is no `PATH=VALUE`.
pub(crate) fn expand(words: impl IntoIterator<Item = OsString>) -> Result<Vec<OsString>, String> {
    let (mut given, mut of_files) = (Vec::new(), Vec::new());
    let mut words = words.into_iter();
    while let Some(word) = words.next() {
        let joined = word.to_str().and_then(|word| word.strip_prefix("--set=")).map(OsString::from);
        let value = if word == "--set" { words.next() } else { joined };
        match value.as_ref().map(|value| value.to_str()) {
            None => given.push(word),
            Some(None) => given.extend([word].into_iter().chain(value)),
            Some(Some(text)) => match text.strip_prefix('@') {
                Some(file) => of_files.extend(of_file(file)?),
                None => given.extend(pieces(text).iter().map(|piece| flag(piece).into())),
            },
        }
    }
    let is_given = |flag: &str| {
        // `--rigid` and `--solver` are ingredients too.
        let name = match flag.strip_prefix("--set=").map(|key| key.split('=').next().unwrap_or(key)) {
            Some("rigid" | "rigid-points") => "--rigid",
            Some("solver") => "--solver",
            _ => flag.split_once('=').map_or(flag, |(name, _)| name),
        };
        let same = |word: &str| word.strip_prefix(name).is_some_and(|rest| rest.is_empty() || rest.starts_with('='));
        name != "--set" && given.iter().any(|word| word.to_str().is_some_and(same))
    };
    of_files.retain(|flag| !is_given(flag));
    let first = given.len().min(1);
    given.splice(first..first, of_files.into_iter().map(OsString::from));
    Ok(given)
}

/// The flags of a file of settings.
fn of_file(file: &str) -> Result<Vec<String>, String> {
    let fault = |fault: String| format!("--set @{file}: {fault}");
    let text = fs::read_to_string(file).map_err(|read| fault(format!("cannot be read: {read}")))?;
    let lines = text.lines().enumerate().map(|(n, line)| (n + 1, line.split('#').next().unwrap_or_default().trim()));
    let lines = lines.filter(|(_, line)| !line.is_empty());
    let one = |(n, line): (usize, &str)| match line.split_once('=') {
        Some((path, value)) => Ok(flag(&format!("{}={}", path.trim(), value.trim()))),
        None => Err(fault(format!("line {n} is \"{line}\", not PATH=VALUE; `--set list` prints the paths"))),
    };
    lines.map(one).collect()
}

/// The settings of `a=1,b=2,3`: `a=1` and `b=2,3`.
fn pieces(text: &str) -> Vec<String> {
    let mut all: Vec<String> = Vec::new();
    for piece in text.split(',') {
        match all.last_mut() {
            Some(last) if !piece.contains('=') => *last += &format!(",{piece}"),
            _ => all.push(piece.into()),
        }
    }
    all
}

/// The flag of a setting.
fn flag(setting: &str) -> String {
    let of = |(path, flag): &(&str, &str)| Some(format!("{flag}{}", setting.strip_prefix(path)?));
    let named = FLAGS.iter().find(|(path, _)| setting.split_once('=').is_some_and(|(name, _)| name == *path));
    named.and_then(of).unwrap_or_else(|| format!("--set={}", setting.strip_prefix("ingredients.").unwrap_or(setting)))
}

/// The paths outside `ingredients` for a terminal.
pub(crate) fn table() -> String {
    FLAGS.iter().map(|(path, flag)| format!("{path:27} as {flag}\n")).collect()
}

/// A recorded session's settings as a file for `--set @FILE`, by its header's entries and its
/// ingredients. What has no flag is left out, such as a flap's drawn line.
pub(crate) fn file(entries: &BTreeMap<String, String>, ingredients: &Ingredients) -> String {
    let plain = |text: &String| text.replace(['[', ']', '"'], "");
    let line = |path: &str, text: String| format!("{path}={text}\n");
    let flags = FLAGS.iter().filter(|(path, _)| *path != "quality");
    let flags = flags.filter_map(|(path, _)| Some(line(path, plain(entries.get(*path)?))));
    let ingredients = KEYS.iter().filter_map(|key| {
        let value = key.value(ingredients);
        let is_own = key.name != "shaft" && setting(&format!("{}={value}", key.name)).is_ok();
        is_own.then(|| line(&format!("ingredients.{}", key.name), value))
    });
    format!("# Settings of a recorded session, for --set @FILE\n{}", flags.chain(ingredients).collect::<String>())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::config::SessionConfig;
    use crate::operation::Operation;
    use crate::options::Options;
    use trepan_budget::Quality;
    use trepan_haptics::DeviceName;
    use trepan_patient::TissueClass;
    use trepan_stages::program::Program;

    fn expanded(line: &str) -> Vec<String> {
        let words = expand(line.split(' ').map(OsString::from)).unwrap();
        words.into_iter().map(|word| word.into_string().unwrap()).collect()
    }

    #[test]
    fn a_path_is_its_flag_and_an_ingredient_stays_one() {
        let line = "x --set operation.flap_mm=30,friction=0.2 --set=ingredients.threads=2 --out o";
        assert_eq!(expanded(line), ["x", "--flap=30", "--set=friction=0.2", "--set=threads=2", "--out", "o"]);
        let line = "x --set operation.forbidden=tumour,vessel,sizes.tets=3000 --set list";
        assert_eq!(expanded(line), ["x", "--forbid=tumour,vessel", "--tets=3000", "--set=list"]);
        for (path, _) in FLAGS {
            let fault = Options::of_program(Program::Integrated, ["x".into(), format!("--set={path}=wide")]);
            let fault = fault.unwrap_err().to_string();
            assert!(fault.contains("wide") && fault.contains("--"), "{path}: {fault}");
        }
    }

    #[test]
    fn the_settings_of_a_session_are_read_again_and_the_command_line_counts_over_them() {
        let operation = Operation {
            flap_mm: 31.5,
            csf_loss: Some(0.25),
            csf_speed_up: 10.0,
            forbidden: vec![TissueClass::Tumour, TissueClass::Vessel],
            young_modulus_kpa: 1.5,
            rate_hz: 500.0,
            ..Operation::default()
        };
        let rigid = Some("god-object-sphere");
        let ingredients =
            Ingredients { rigid, rigid_points: Some(0), threads: Some(2), ..Ingredients::of(Quality::Auto) };
        let config = SessionConfig { operation: operation.clone(), ingredients, ..SessionConfig::default() };
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("mine.settings");
        fs::write(&path, file(&config.entries(), &config.ingredients)).unwrap();
        let parse = |more: &str| {
            let line = format!("x --set @{} {more}", path.display());
            Options::of_program(Program::Integrated, line.split_whitespace().map(String::from)).unwrap()
        };
        let options = parse("");
        assert_eq!(Operation::of(&options, &DeviceName::MOUSE, None), operation);
        let mut made = Ingredients::of(Quality::Usual);
        options.given().unwrap().iter().for_each(|given| given.key.set(&mut made, &given.text).unwrap());
        assert_eq!(made, config.ingredients);
        let over = parse("--flap 20 --set friction=0.7");
        let friction = over.given().unwrap().iter().rfind(|given| given.key.name == "friction").unwrap().text.clone();
        assert_eq!((over.flap, over.csf_loss, friction.as_str()), (Some(20.0), Some(0.25), "0.7"));
        let mut by_flag = Ingredients::of(Quality::Usual);
        let given = parse("--rigid brute --solver reference").given().unwrap();
        given.iter().for_each(|given| given.key.set(&mut by_flag, &given.text).unwrap());
        assert_eq!((by_flag.rigid, by_flag.solver), (Some("brute"), Some("reference")));
    }

    #[test]
    fn a_file_that_is_missing_or_says_nothing_is_refused_by_name_and_line() {
        let fault = |file: &str| expand(["x".into(), format!("--set=@{file}").into()]).unwrap_err();
        assert!(fault("/no/such.settings").contains("/no/such.settings: cannot be read"));
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("a.settings");
        fs::write(&file, "# mine\n\noperation.flap_mm = 30 # wide\nflap 30\n").unwrap();
        let fault = fault(file.to_str().unwrap());
        assert!(fault.contains("line 4 is \"flap 30\"") && fault.contains("--set list"), "{fault}");
    }
}
