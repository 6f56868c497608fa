//! Makes sessions of simulated motion, to measure exports: `make_sessions DIR COUNT SECONDS`.

use anyhow::{Context, Result};
use rayon::prelude::*;
use std::path::PathBuf;
use trepan_analysis::study::simulate::write_recording;

/// Rate of the sessions, Hz.
const RATE_HZ: f64 = 1000.0;
/// Length of a stroke, ms.
const STROKE_MS: f64 = 450.0;

fn main() -> Result<()> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [folder, count, seconds] = &arguments[..] else { anyhow::bail!("usage: make_sessions DIR COUNT SECONDS") };
    let (count, seconds) = (count.parse::<u64>().context("COUNT")?, seconds.parse::<f64>().context("SECONDS")?);
    (1..=count).into_par_iter().try_for_each(|seed| {
        let session = PathBuf::from(folder).join(format!("{seed:05}"));
        std::fs::create_dir_all(&session)?;
        std::fs::write(session.join("scores.csv"), format!("name,value\nscores.bone_removed_mm3,{seed}\n"))?;
        std::fs::write(session.join("summary.json"), r#"{"app": "simulated", "simulated": true}"#)?;
        // Every fourth session has a second hand.
        write_recording(&session.join("session.mcap"), seed, (seconds, RATE_HZ), STROKE_MS, seed % 4 == 0)
    })?;
    println!("{count} sessions of {seconds} s in {folder}");
    Ok(())
}
