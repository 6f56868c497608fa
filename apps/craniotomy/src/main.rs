//! Drills a patient's skull with force feedback. Threads: main, haptic.

use std::process::ExitCode;
use trepan_simulator::{Inputs, Program, TissueSource, command};

fn main() -> ExitCode {
    let case = trepan_fixtures::case_head();
    let tissues = TissueSource::regions_of_aseg(case.aseg);
    let (ct, mri, labels) = (Some(case.ct), Some(case.mri), Some(case.labels));
    let built_in = Inputs { name: Some(case.name), ct, mri, labels, tissues, ..Inputs::default() };
    command(Program::Craniotomy, built_in)
}
