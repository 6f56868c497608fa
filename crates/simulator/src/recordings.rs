//! `recording check` and `recording repair`: reports what a recording contains and lacks, and
//! rewrites what can be read.

use crate::config::SessionConfig;
use crate::error::SessionError;
use crate::setting_paths;
use std::path::Path;
use std::process::ExitCode;
use trepan_link::wire::SessionHeader;
use trepan_link::{Recording, repair};
use trepan_patient::identity::Identity;
use trepan_report::printable::printable;
use trepan_stages::program::Program;

/// Describes what a recording lacks, with the remedy if there is one; `None` if it is complete.
pub(crate) fn not_whole(program: Program, file: &Path, recording: &Recording) -> Option<String> {
    let (losses, program, file) = (recording.losses()?, program.name(), file.display());
    let remedy = format!("; `{program} recording repair {file} NEW.mcap` keeps all that can be read");
    Some(format!("{file} is not whole: {losses}{}", if recording.damage.is_some() { &remedy } else { "" }))
}

/// Prints a recorded session's settings.
pub(crate) fn settings(file: &Path) -> Result<ExitCode, SessionError> {
    let config = SessionConfig::of(&Recording::open(file)?.header)?;
    print!("{}", setting_paths::file(&config.entries(), &config.ingredients));
    Ok(ExitCode::SUCCESS)
}

/// Opens a recording for replay on a case; refuses one of another patient or without ticks.
pub(crate) fn open(program: Program, file: &Path, case: &Identity) -> Result<Recording, SessionError> {
    let recording = Recording::open(file)?;
    let losses = not_whole(program, file, &recording);
    if recording.ticks.is_empty() {
        let none = || format!("{} contains no tick: its session ended before the first", file.display());
        let fault = losses.unwrap_or_else(none);
        return Err(SessionError::Usage(format!("--device: there is nothing to run again: {fault}")));
    }
    let recorded = Identity::of(&recording.header);
    if recorded.is(case) == Some(false) {
        let fault = format!("{} is of another case: it was recorded on {}", file.display(), recorded.describe());
        let remedy = "give the --ct and --mri, or the --case, of that one, or none of them for the built-in case";
        return Err(SessionError::Usage(format!("--device: {fault}, this is {}; {remedy}", case.describe())));
    }
    let unread = |fault| SessionError::Usage(format!("{}: {fault}", file.display()));
    SessionConfig::of(&recording.header).map_err(unread)?;
    losses.iter().for_each(|losses| tracing::warn!("{}", printable(losses)));
    Ok(recording)
}

/// A recording of nothing but the header of a watched session; refuses one of another patient or of
/// an unknown version.
pub(crate) fn of_watched(name: &str, header: SessionHeader, case: &Identity) -> Result<Recording, SessionError> {
    let watched = Identity::of(&header);
    if header.app.is_empty() {
        let fault = "its header cannot be read: run the same version on both sides";
        return Err(SessionError::Usage(format!("--watch {name}: {fault}")));
    }
    if watched.is(case) == Some(false) {
        let (is, was) = (case.describe(), watched.describe());
        return Err(SessionError::Usage(format!(
            "--watch {name}: that session operates on another case, {was}, this is {is}; give the --ct and --mri, or \
             the --case, of that one, or none of them for the built-in case"
        )));
    }
    SessionConfig::of(&header).map_err(|fault| SessionError::Usage(format!("--watch {name}: {fault}")))?;
    Ok(Recording { header, ..Recording::default() })
}

/// Warns if the recording's case was built differently from the same images, or if its patient is
/// unknown.
pub(crate) fn unlike(recording: &Recording, case: &Identity) -> Option<String> {
    let recorded = Identity::of(&recording.header);
    let made_alike = recorded.case.is_none() || recorded.case == case.case;
    (!made_alike).then(|| match recorded.is(case) {
        Some(_) => "the recording's case was made otherwise of these images (voxels, tetrahedra, labels or version): \
                    forces may differ"
            .into(),
        None => format!(
            "whether the recording is of this patient is unknown, because an older version made it: \
             it was recorded on {}, this is {}",
            recorded.describe(),
            case.describe()
        ),
    })
}

/// Prints what a recording contains and lacks.
pub(crate) fn check(program: Program, file: &Path) -> Result<ExitCode, SessionError> {
    let recording = Recording::open(file)?;
    print(file, &describe(&recording));
    let no_index = || {
        let (program, file) = (program.name(), file.display());
        format!(
            "{file} has no valid index: other programs refuse it; `{program} recording repair {file} NEW.mcap` makes one"
        )
    };
    let lack = not_whole(program, file, &recording).or_else(|| (!recording.indexed).then(no_index));
    Ok(lack.map_or(ExitCode::SUCCESS, |lack| {
        println!("{}", printable(&lack));
        ExitCode::FAILURE
    }))
}

/// Writes a new recording from what can be read.
pub(crate) fn repair_file(file: &Path, out: &Path) -> Result<ExitCode, SessionError> {
    if out.exists() {
        return Err(SessionError::Usage(format!("{} exists already: name a file that does not", out.display())));
    }
    if let Some(losses) = Recording::open(file)?.losses() {
        print(file, &losses);
    }
    let repaired = repair(file, out)?;
    let recording = Recording::open(out)?;
    print(out, &format!("{}, {} messages", describe(&recording), repaired.messages));
    recording.losses().into_iter().for_each(|losses| print(out, &losses));
    Ok(ExitCode::SUCCESS)
}

fn print(file: &Path, text: &str) {
    println!("{}", printable(&format!("{}: {text}", file.display())));
}

fn describe(recording: &Recording) -> String {
    let seconds = recording.ticks.last().map_or(0.0, |tick| tick.time_ms * 1e-3);
    let header = &recording.header;
    format!("{} of {}, {} ticks, {seconds:.1} s", header.app, header.case, recording.ticks.len())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_header_that_is_refused_names_the_session_and_the_entry() {
        let config = [("operation.flap_mm".to_string(), "wide".to_string())].into();
        let header = SessionHeader { app: "craniotomy".into(), config, ..SessionHeader::default() };
        let case = Identity::of(&header);
        let fault = of_watched("left", header, &case).unwrap_err().to_string();
        assert!(["--watch left: ", "operation.flap_mm", "wide"].iter().all(|part| fault.contains(part)), "{fault}");
    }
}
