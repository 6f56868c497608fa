//! The physical constants that the programs use, by row of the register, and which of them rest on
//! a measurement.
//!
//! # Practice
//! `USED` is compared with the sources by a test: a row that some crate uses and the list lacks
//! fails it, as does one that nothing uses any more. `--list-constants`, the report, the
//! README and the user guide derive from the list; `TREPAN_WRITE=1 cargo test -p trepan-simulator
//! --lib constants` brings the list, the README and the user guide up to date.

use serde::Serialize;
use std::fmt::Write;
use trepan_measurements::{Row, find};

/// Rows used, by name.
const USED: &[&str] = &[
    "aspirator/fastest",
    "aspirator/removal-rate",
    "aspirator/spared",
    "bleeding/capillary-rate",
    "bleeding/capillary-time",
    "bleeding/coagulation-reach",
    "bleeding/coagulation-time",
    "bleeding/density",
    "bleeding/residue",
    "bleeding/rinse",
    "bleeding/suction",
    "bleeding/suction-reach",
    "bleeding/tumour-rate",
    "bleeding/vessel-density",
    "bleeding/vessel-rate",
    "bleeding/vessel-time",
    "bleeding/viscosity",
    "brain-living/mooney-ratio",
    "brain-living/poisson",
    "brain-living/swine-ogden-exponent",
    "brain-living/swine-ogden-shear-modulus",
    "brain-living/young-modulus",
    "brain-membranes/dura-failure-strain",
    "brain-membranes/dura-young-modulus",
    "brain-membranes/pia-shear-stiffness",
    "brain-relaxation/cortex-time",
    "brain-relaxation/fluid-time",
    "brain-relaxation/slow-time",
    "brain-relaxation/swine-fast-share",
    "brain-relaxation/swine-fast-time",
    "brain-relaxation/swine-slow-share",
    "brain-relaxation/swine-slow-time",
    "devices/inverse3-continuous-force",
    "devices/inverse3-peak-force",
    "devices/touch-continuous-force",
    "devices/touch-damping",
    "devices/touch-friction",
    "devices/touch-mass",
    "devices/touch-peak-force",
    "devices/touch-torque",
    "drilling/break-through",
    "drilling/burr-cutting-ratio",
    "drilling/burr-edge",
    "drilling/burr-edges",
    "drilling/burr-energy",
    "drilling/burr-greatest-load",
    "drilling/burr-pole-share",
    "drilling/burr-power",
    "drilling/burr-speed",
    "drilling/burr-stall-speed",
    "drilling/contact-damping",
    "drilling/contact-damping-unlimited",
    "drilling/contact-stiffness",
    "drilling/free-way-beyond",
    "drilling/perforator-cutting-ratio",
    "drilling/perforator-edge",
    "drilling/perforator-edges",
    "drilling/perforator-energy",
    "drilling/perforator-power",
    "drilling/perforator-speed",
    "drilling/perforator-stall-speed",
    "drilling/slipping-friction",
    "drilling/sticking-friction",
    "drilling/thin-bone",
    "drilling/vibration-frequency",
    "drilling/vibration-share",
    "drilling/vibration-slowest",
    "dura/incision-force",
    "dura/open-length",
    "dura/poisson-ratio",
    "dura/radius",
    "dura/suture-force",
    "dura/suture-time",
    "dura/thickness",
    "fits/basal-ganglia-bound",
    "fits/basal-ganglia-share",
    "fits/basal-ganglia-shear-modulus",
    "fits/brain-bound",
    "fits/brain-share",
    "fits/brain-shear-modulus",
    "fits/corona-radiata-bound",
    "fits/corona-radiata-share",
    "fits/corona-radiata-shear-modulus",
    "fits/corpus-callosum-bound",
    "fits/corpus-callosum-share",
    "fits/corpus-callosum-shear-modulus",
    "fits/cortex-bound",
    "fits/cortex-share",
    "fits/cortex-shear-modulus",
    "fits/hand-speed-factor",
    "fits/relaxation-fluid-share",
    "fits/relaxation-slow-share",
    "fits/relaxation-solid-share",
    "grip/brain-force-warning",
    "grip/firm-grip-damping",
    "grip/firm-grip-mass",
    "grip/firm-grip-stiffness",
    "grip/light-grip-damping",
    "grip/light-grip-mass",
    "grip/light-grip-stiffness",
    "hands/drilling-peak-greatest",
    "hands/tissue-damping",
    "hands/tissue-damping-unlimited",
    "hands/tissue-stiffness",
    "hands/warning-forbidden",
    "hands/warning-near",
    "hands/warning-soon",
    "pulse/breathing-frequency",
    "pulse/breathing-pressure",
    "pulse/mmhg",
    "pulse/pressure-supine-least",
    "pulse/pressure-supine-most",
    "pulse/pulse-frequency",
    "pulse/pulse-pressure",
    "sag/weight",
    "sag/weight-in-fluid",
    "sensitivity/shear-modulus",
    "shift/landmarks-end",
    "skull/cutting-share-of-cancellous",
    "skull/density-cancellous",
    "skull/density-cortical",
    "skull/density-of-reference",
    "support/bare-base-height",
    "support/base-height",
    "support/base-reach",
    "support/breathing-weight",
    "support/breathing-weight-frequency",
    "support/csf-loss",
    "support/csf-loss-uniform",
    "support/drain-speed-up",
    "support/drain-time",
    "support/falx-depth",
    "support/falx-stiffness",
    "support/layer-modulus",
    "support/layer-shear",
    "support/pulse-weight",
    "support/pulse-weight-frequency",
    "support/stem-height",
    "support/vein-reach",
    "support/vein-stiffness",
    "tissue/artery-young-modulus",
    "tissue/soft-tumour-ratio",
    "tissue/stiff-tumour-ratio",
    "tissue/ventricle-poisson",
    "tissue/ventricle-young-modulus",
    "tissue/vessel-ratio",
    "tissue/white-over-grey",
];

/// The first row of each name.
fn rows() -> impl Iterator<Item = &'static Row> {
    USED.iter().filter_map(|name| find(name)).map(|rows| &rows[0])
}

/// A constant, for a report.
#[derive(Clone, Debug, Serialize)]
pub struct Constant {
    name: String,
    value: String,
    condition: &'static str,
    source: &'static str,
    mark: &'static str,
    calibrated: bool,
}

/// All constants, those that rest on a measurement first.
pub fn all() -> Vec<Constant> {
    let of = |row: &'static Row| {
        let spread = if row.spread.is_nan() { String::new() } else { format!(" ± {}", row.spread) };
        Constant {
            name: row.name(),
            value: format!("{}{spread} {}", row.value, row.unit).trim_end().into(),
            condition: row.condition,
            source: row.source,
            mark: row.mark.name(),
            calibrated: row.is_calibrated(),
        }
    };
    let mut all: Vec<Constant> = rows().map(of).collect();
    all.sort_by_key(|constant| !constant.calibrated);
    all
}

/// How many constants rest on a measurement, in a sentence.
pub fn sentence() -> String {
    counted(&rows().collect::<Vec<_>>())
}

fn counted(rows: &[&Row]) -> String {
    let calibrated = rows.iter().filter(|row| row.is_calibrated()).count();
    let (all, open) = (rows.len(), rows.len() - calibrated);
    format!("{calibrated} of {all} physical constants rest on a published measurement, {open} are uncalibrated")
}

/// Every constant with its source, for a terminal.
pub fn table() -> String {
    let mut text = format!("{}.\n", sentence());
    for (calibrated, title) in [(true, "Calibrated"), (false, "Uncalibrated: assumed, or from memory")] {
        let _ = write!(text, "\n{title}\n");
        for constant in all().iter().filter(|constant| constant.calibrated == calibrated) {
            let Constant { name, value, condition, source, mark, .. } = constant;
            let _ = writeln!(text, "  {name:36} {value:22} {condition} [{mark}: {source}]");
        }
    }
    text
}

/// Text at the end of `--help`.
pub fn help() -> String {
    format!("--set list prints the ingredients of the models; --list-constants the physical constants: {}.", sentence())
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs;
    use std::path::{Path, PathBuf};
    use trepan_measurements::{ALL, Mark};

    /// The table of the user guide: by table of the register, what is calibrated and what is not.
    fn markdown(rows: &[&Row]) -> String {
        let mut tables: Vec<&str> = rows.iter().map(|row| row.table).collect();
        tables.dedup();
        let mut text = String::from("| table | calibrated | uncalibrated |\n|---|---|---|\n");
        for table in tables {
            let names = |calibrated: bool| {
                let of_table = rows.iter().filter(|row| row.table == table && row.is_calibrated() == calibrated);
                let of_row = |row: &&Row| format!("{}{}", row.key, if row.mark == Mark::Fit { " (fit)" } else { "" });
                let names: Vec<String> = of_table.map(of_row).collect();
                if names.is_empty() { "none".into() } else { names.join(", ") }
            };
            let _ = writeln!(text, "| `{}` | {} | {} |", table.replace('_', "-"), names(true), names(false));
        }
        text
    }

    /// Rust sources of a folder, without tests.
    fn sources(folder: &Path, into: &mut Vec<PathBuf>) {
        for entry in fs::read_dir(folder).unwrap() {
            let path = entry.unwrap().path();
            let name = path.file_name().unwrap().to_string_lossy().into_owned();
            match path.is_dir() {
                true if name != "tests" => sources(&path, into),
                false if name.ends_with(".rs") && name != "tests.rs" => into.push(path),
                _ => {}
            }
        }
    }

    /// Code of the program that names the register, without comments and tests.
    fn codes(crates: &Path) -> Vec<String> {
        let mut files = Vec::new();
        for entry in fs::read_dir(crates).unwrap() {
            let folder = entry.unwrap().path();
            let is_program = !folder.ends_with("trials") && !folder.ends_with("measurements");
            if is_program && folder.join("src").is_dir() {
                sources(&folder.join("src"), &mut files);
            }
        }
        let code = |file: &PathBuf| {
            let text = fs::read_to_string(file).unwrap();
            let text = text.split("#[cfg(test)]").next().unwrap_or_default();
            text.lines().map(|line| line.split("//").next().unwrap_or_default()).collect::<Vec<_>>().join("\n")
        };
        files.iter().map(code).filter(|text| text.contains("trepan_measurements")).collect()
    }

    /// Writes `text` between two marks of a file, if asked to; returns whether it stood there.
    fn stands(file: &Path, [from, to]: [&str; 2], text: &str) -> bool {
        let before = fs::read_to_string(file).unwrap();
        let start = before.find(from).unwrap() + from.len();
        let end = start + before[start..].find(to).unwrap();
        let is_right = &before[start..end] == text;
        if !is_right && std::env::var_os("TREPAN_WRITE").is_some() {
            fs::write(file, [&before[..start], text, &before[end..]].concat()).unwrap();
        }
        is_right
    }

    #[test]
    fn the_list_the_readme_and_the_guide_say_what_the_sources_use() {
        let home = Path::new(env!("CARGO_MANIFEST_DIR"));
        let codes = codes(&home.join(".."));
        let ends = |rest: &str| !rest.starts_with(|c: char| c.is_alphanumeric() || c == '_');
        // A table may have another name in a source: `use ...::table as name`.
        let names = |text: &str, table: &str| -> Vec<String> {
            let marker = format!("{table} as ");
            let renamed = text.split(&marker).skip(1);
            let name = |rest: &str| rest.split(|c: char| !c.is_alphanumeric() && c != '_').next().map(String::from);
            renamed.filter_map(name).chain([table.to_string()]).collect()
        };
        let is_used = |row: &Row| {
            let key = row.key.replace('-', "_").to_uppercase();
            let stands = |text: &String, name: String| {
                let path = format!("{name}::{key}");
                text.match_indices(&path).any(|(at, _)| ends(&text[at + path.len()..]))
            };
            codes.iter().any(|text| names(text, row.table).into_iter().any(|name| stands(text, name)))
        };
        let used: Vec<&Row> = ALL.iter().map(|rows| &rows[0]).filter(|row| is_used(row)).collect();
        assert!(!used.is_empty());
        let lines: String = used.iter().map(|row| format!("    {:?},\n", row.name())).collect();
        let right = [
            stands(&home.join("src/constants.rs"), ["&[&str] = &[\n", "];"], &lines),
            stands(&home.join("../../README.md"), ["drilling constants | ", ";"], &counted(&used)),
            stands(&home.join("../../apps/README.md"), ["its source.\n\n", "\nA session"], &markdown(&used)),
        ];
        assert_eq!(right, [true; 3], "list, README, guide; TREPAN_WRITE=1 with this test brings them up to date");
        assert!(table().contains("Uncalibrated") && help().contains("--list-constants"));
    }
}
