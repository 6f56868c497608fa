//! `cargo xtask calibrate`: fits laws to published curves, reports how well they predict others,
//! and writes `fixtures/measurements/fits.csv`.
//!
//! # Practice
//! A fit is a function that gives rows for that table; [`rows`] lists them. A test compares the
//! table with what the fits give.

pub mod least_squares;
pub mod regions;
pub mod relaxation;

use anyhow::{Context, Result};
use regions::{Fit, Form, Mode, PULLED, Region};
use std::fmt::Write;
use std::path::Path;
use trepan_evidence::curve;
use trepan_evidence::files::whole;
use trepan_evidence::picture::Series;
use trepan_measurements::{brain_living, brain_relaxation, fits, living};

/// A row of the table of fits.
#[derive(Clone, Debug, PartialEq)]
pub struct Row {
    /// Name of the quantity.
    pub key: String,
    /// Value.
    pub value: f64,
    /// Standard error; NaN where the data do not fix it.
    pub error: f64,
    /// Unit of both.
    pub unit: &'static str,
    /// Rows that took part.
    pub condition: String,
}

/// Where the table lies, from the root of the repository.
const TABLE: &str = "fixtures/measurements/fits.csv";

/// All fitted rows.
pub fn rows() -> Vec<Row> {
    let fits = Region::ALL.map(|region| Fit::of(region, Form::Stiffening, PULLED));
    let mut all: Vec<Row> = fits.iter().flat_map(rows_of_region).collect();
    all.extend(rows_of_whole(&fits));
    all.extend(rows_of_relaxation());
    all.push(row_of_speed());
    all
}

/// Parameters of the stiffening law, by the end of their keys, with their units.
const PARAMETERS: [(&str, &str); 3] = [("shear-modulus", "kPa"), ("share", ""), ("bound", "")];

fn rows_of_region(fit: &Fit) -> Vec<Row> {
    let name = fit.region.name();
    let rows = match fit.region.rows(Mode::Tension) {
        Some(_) => format!("brain/{name}-tension and -compression"),
        None => format!("tension and compression of brain-ogden/{name}-ogden-shear-modulus and -ogden-exponent"),
    };
    let of = |(i, (key, unit)): (usize, &(&str, &'static str))| Row {
        key: format!("{name}-{key}"),
        value: fit.minimum.at[i],
        error: fit.minimum.errors[i],
        unit,
        condition: format!("stiffening law fitted to {rows}"),
    };
    PARAMETERS.iter().enumerate().map(of).collect()
}

/// Brain without a class: the mean of its grey and its white matter.
fn rows_of_whole(fits: &[Fit]) -> Vec<Row> {
    let [grey, white] = [&fits[0].minimum, &fits[1].minimum];
    let of = |(i, (key, unit)): (usize, &(&str, &'static str))| Row {
        key: format!("brain-{key}"),
        value: 0.5 * (grey.at[i] + white.at[i]),
        error: 0.5 * grey.errors[i].hypot(white.errors[i]),
        unit,
        condition: "mean of cortex and corona radiata".into(),
    };
    PARAMETERS.iter().enumerate().map(of).collect()
}

fn rows_of_relaxation() -> Vec<Row> {
    let found = relaxation::fit();
    let of = |(i, name): (usize, &&str)| Row {
        key: (*name).into(),
        value: found.at[i],
        error: found.errors[i],
        unit: "",
        condition: format!("Prony series fitted to brain-relaxation/curve, time {} s", relaxation::TIMES_S[i]),
    };
    relaxation::NAMES.iter().enumerate().map(of).collect()
}

/// Moduli at hand speed over those of a slow test. The factor brings them, with relaxation, nearest
/// to what was measured fast, slow, and in life, in the mean of the logarithms.
fn row_of_speed() -> Row {
    let [grey, white] =
        [Region::Cortex, Region::CoronaRadiata].map(|r| Fit::of(r, Form::Stiffening, PULLED).minimum.at[0]);
    let mean = 0.5 * (grey + white);
    let left = 1.0 - relaxation::fit().at.iter().sum::<f64>();
    let fast = |long: f64, relaxing: f64| long + relaxing;
    let measured = [
        fast(brain_relaxation::CORTEX_LONG_TERM_MODULUS.value, brain_relaxation::CORTEX_RELAXING_MODULUS.value) / grey,
        fast(
            brain_relaxation::CORONA_RADIATA_LONG_TERM_MODULUS.value,
            brain_relaxation::CORONA_RADIATA_RELAXING_MODULUS.value,
        ) / white,
        brain_relaxation::CORTEX_LONG_TERM_MODULUS.value / (left * grey),
        brain_relaxation::CORONA_RADIATA_LONG_TERM_MODULUS.value / (left * white),
        brain_living::GRAVITY_SHEAR_MODULUS.value / (left * mean),
        living::PALPATION_SHEAR.value / mean,
    ];
    let logs = measured.map(f64::ln);
    let middle = logs.iter().sum::<f64>() / 6.0;
    let spread = (logs.iter().map(|log| (log - middle).powi(2)).sum::<f64>() / (6.0 * 5.0)).sqrt();
    Row {
        key: "hand-speed-factor".into(),
        value: middle.exp(),
        error: middle.exp() * spread,
        unit: "",
        condition: "moduli at hand speed over those of a slow test, nearest to brain-relaxation/cortex-* and \
                    corona-radiata-*, fast and long-term, brain-living/gravity-shear-modulus, living/palpation-shear"
            .into(),
    }
}

/// The table as text.
pub fn table(rows: &[Row]) -> String {
    let number = |x: f64| if x.is_finite() { significant(x) } else { String::new() };
    let line = |row: &Row| {
        let (value, error) = (number(row.value), number(row.error));
        format!("{},,{value},{error},{},\"{}\",cargo xtask calibrate,fit\n", row.key, row.unit, row.condition)
    };
    "key,at,value,spread,unit,condition,source,mark\n".to_string() + &rows.iter().map(line).collect::<String>()
}

/// Four significant digits.
fn significant(value: f64) -> String {
    let size = value.abs().max(f64::MIN_POSITIVE).log10().floor();
    format!("{value:.*}", (3.0 - size).clamp(0.0, 12.0) as usize)
}

/// Prints every fit and what it predicts, draws curves over data into `out`, and writes the table
/// into the repository at `root` if asked to.
pub fn run(root: &Path, out: &Path, write: bool) -> Result<()> {
    println!("{}", report());
    std::fs::create_dir_all(out).with_context(|| format!("cannot make {}", out.display()))?;
    for (name, series) in Region::ALL.iter().flat_map(|region| Mode::ALL.map(|mode| drawn(*region, mode))) {
        let drawing = curve::svg(&series).map_err(|fault| anyhow::anyhow!("{name}: {fault}"))?;
        whole(&out.join(format!("{name}.svg")), drawing.as_bytes())?;
    }
    println!("curves over data: {}", out.display());
    let text = table(&rows());
    if write {
        whole(&root.join(TABLE), text.as_bytes())?;
        println!("wrote {TABLE}");
    } else {
        print!("{text}");
    }
    Ok(())
}

/// Every form fitted to every region, as a table.
fn report() -> String {
    let mut text =
        "region           law               fitted to            tension  compr.  shear  stable  parameters\n"
            .to_string();
    for region in Region::ALL {
        for form in Form::ALL {
            for (modes, name) in [(PULLED, "tension+compression"), (&Mode::ALL[..], "all")] {
                let fit = Fit::of(region, form, modes);
                let [tension, compression, shear] = Mode::ALL.map(|mode| 100.0 * fit.error(mode));
                let stable = if fit.law.is_stable() { "yes" } else { "no" };
                let parameters = fit.minimum.at.iter().zip(&fit.minimum.errors);
                let parameters: Vec<String> = parameters.map(|(at, error)| format!("{at:.4}±{error:.4}")).collect();
                let _ = writeln!(
                    text,
                    "{:16} {:17} {name:20} {tension:6.1}%{compression:7.1}%{shear:6.1}%  {stable:6}  {}",
                    region.name(),
                    form.name(),
                    parameters.join(" ")
                );
            }
        }
    }
    text + "errors: root mean square over the largest stress of the curve\n"
}

/// Data and laws of a mode of a region, as a chart with a name for its file.
pub fn drawn(region: Region, mode: Mode) -> (String, Series) {
    let curve = region.curve(mode);
    let (first, last) = (curve[0].0, curve[curve.len() - 1].0);
    let places: Vec<f64> = (0..=40).map(|i| first + (last - first) * f64::from(i) / 40.0).collect();
    let of_law = |law: trepan_soft::Law| places.iter().map(|&at| (at, mode.stress(&law, at))).collect::<Vec<_>>();
    let (data, is_measured) = (region.rows(mode), region.rows(mode).is_some());
    let mut lines = vec![(if is_measured { "measured" } else { "published Ogden fit" }.to_string(), curve)];
    for sign in [-1.0, 1.0] {
        let with_spread = data.iter().copied().flatten().filter(|row| row.spread.is_finite());
        let band: Vec<(f64, f64)> = with_spread.map(|row| (row.at, row.value + sign * row.spread)).collect();
        if !band.is_empty() {
            lines.push((format!("measured {} SD", if sign < 0.0 { "-" } else { "+" }), band));
        }
    }
    for form in [Form::Stiffening, Form::OneTermOgden, Form::NeoHookean] {
        lines.push((form.name().into(), of_law(Fit::of(region, form, PULLED).law)));
    }
    let how = if mode == Mode::Shear { "predicted from tension and compression" } else { "fitted" };
    let title = format!("{} in {}, laws {how}", region.name().replace('-', " "), mode.name());
    let x = if mode == Mode::Shear { "amount of shear" } else { "stretch" };
    let y = "nominal stress, kPa".into();
    (format!("{}-{}", region.name(), mode.name()), Series { title, x: x.into(), y, lines, ..Series::default() })
}

/// The law of the program for a region, moduli in kPa, from the table of fits.
pub fn of_program(region: Region) -> trepan_soft::Law {
    let [shear, share, bound] = match region {
        Region::Cortex => [&fits::CORTEX_SHEAR_MODULUS, &fits::CORTEX_SHARE, &fits::CORTEX_BOUND],
        Region::CoronaRadiata => {
            [&fits::CORONA_RADIATA_SHEAR_MODULUS, &fits::CORONA_RADIATA_SHARE, &fits::CORONA_RADIATA_BOUND]
        }
        Region::BasalGanglia => {
            [&fits::BASAL_GANGLIA_SHEAR_MODULUS, &fits::BASAL_GANGLIA_SHARE, &fits::BASAL_GANGLIA_BOUND]
        }
        Region::CorpusCallosum => {
            [&fits::CORPUS_CALLOSUM_SHEAR_MODULUS, &fits::CORPUS_CALLOSUM_SHARE, &fits::CORPUS_CALLOSUM_BOUND]
        }
    };
    Form::Stiffening.law(&[shear.value, share.value, bound.value])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_table_is_what_the_fits_give() {
        for row in rows() {
            let kept = trepan_measurements::find(&format!("fits/{}", row.key)).map(|rows| rows[0]);
            let kept = kept.unwrap_or_else(|| panic!("no fits/{}: run cargo xtask calibrate --write", row.key));
            assert!((kept.value / row.value - 1.0).abs() < 2e-3, "{row:?} {kept:?}: run cargo xtask calibrate --write");
        }
    }
}
