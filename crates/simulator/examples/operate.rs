//! An operation on the built-in case without window or device, and what became of it.
//!
//! `cargo run --release -p trepan-simulator --example operate -- FOLDER`

use clap::Parser;
use trepan_simulator::{Inputs, Options, Program, Session, TissueSource};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let out = std::env::args().nth(1).unwrap_or_else(|| "target/operate".into());
    let options =
        Options::parse_from(["operate", "--headless", "--quality", "draft", "--duration", "8", "--out", &out]);
    let case = trepan_fixtures::case_head();
    let tissues = TissueSource::regions_of_aseg(case.aseg);
    let inputs = Inputs {
        name: Some(case.name),
        ct: Some(case.ct),
        mri: Some(case.mri),
        labels: Some(case.labels),
        tissues,
        ..Inputs::default()
    };
    let summary = Session::open(Program::Integrated, options, inputs)?.run()?.summary;
    println!("{} ticks, {:.1} mm3 removed; files in {out}", summary.ticks, summary.bone_removed_mm3);
    Ok(())
}
