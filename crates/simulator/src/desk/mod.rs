//! The program in its window: start page, loading, session, result, and the start page again.
//!
//! # Practice
//! The window opens before anything is loaded. A session loads, runs and writes its files on a
//! thread of its own and lends its picture to the window ([`trepan_window::Stage`]); until
//! then a draft of the scene is shown if its case is in the cache.

mod action;
mod browse;
mod check;
mod draft;
mod form;
#[cfg(test)]
mod gallery;
mod job;
mod language;
mod pages;
mod pictures;
mod results;
mod state;

pub(crate) use job::Done;

use crate::error::SessionError;
use crate::options::Options;
use crate::show::driver;
use crate::{Inputs, desk::language::Languages, desk::state::App};
use trepan_patient::PatientError;
use trepan_runtime::stop::Stop;
use trepan_stages::program::Program;
use trepan_window as window;

/// Runs the program in a window until it is closed; returns what the last session came to.
pub(crate) fn run(program: Program, options: Options, built_in: Inputs) -> Option<Result<Done, SessionError>> {
    let stop = match Stop::on_signals() {
        Ok(stop) => stop,
        Err(fault) => return Some(Err(SessionError::Internal(format!("signals: {fault}")))),
    };
    let device = driver::open();
    let (stage, offers) = window::stage();
    let languages = Languages::list();
    if let Some(code) = options.language.as_deref().filter(|code| !languages.codes().any(|known| known == *code)) {
        let known = languages.codes().collect::<Vec<_>>().join(", ");
        return Some(Err(SessionError::Usage(format!("--language: there is no language {code}; give one of {known}"))));
    }
    let starts = options.names_no_session();
    let desk = App::new(program, options, built_in, (stage, device.clone()), stop);
    let desk = if starts { desk } else { desk.begin_directly() };
    let title = format!("Trepan {}", program.name());
    let (desk, offers, shown) = window::open(&title, device.as_ref().ok(), offers, desk);
    let (job, mut form, last) = desk.end();
    offers.refuse();
    let done = job.map(|job| job.end(&mut form.settings)).or(last);
    match shown {
        Err(fault) => Some(Err(SessionError::Usage(format!("{fault}; or give --headless")))),
        Ok(()) => done.filter(|done| !matches!(done, Err(SessionError::Patient(PatientError::Cancelled)))),
    }
}
