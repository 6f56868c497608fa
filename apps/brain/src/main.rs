//! Probes a patient's brain, which deforms and pushes back. Threads: main, haptic, collision, simulation.

use std::process::ExitCode;
use trepan_simulator::{Inputs, Program, command};

fn main() -> ExitCode {
    let case = trepan_fixtures::case_head();
    let built_in = Inputs { name: Some(case.name), ct: Some(case.ct), mri: Some(case.mri), labels: Some(case.labels) };
    command(Program::Brain, built_in)
}
