//! The whole operation: drill the skull, change the tool, probe the brain. All four threads.

use std::process::ExitCode;
use trepan_simulator::{Inputs, Program, command};

fn main() -> ExitCode {
    let case = trepan_fixtures::case_head();
    let built_in = Inputs { name: Some(case.name), ct: Some(case.ct), mri: Some(case.mri), labels: Some(case.labels) };
    command(Program::Integrated, built_in)
}
