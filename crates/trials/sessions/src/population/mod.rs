//! Heads that no one has seen: made from real ones by a seed, each imported, opened, drilled,
//! pressed.
//!
//! # Theory
//! A program that was made on one head is judged on others. Each head is a real one after warps,
//! other scanners and other illnesses ([`trepan_trials_scenes::population`]); its brain is known,
//! since the real one's is. Each goes through the import, then through an operation at several
//! places by every quality: drilled by a simulated hand, left alone while the brain sinks, pressed
//! by up to 8 mm, left again. What must hold is the same for all: the bone opens, the brain is
//! quiet where nothing touches it, no element is inverted, and no warning is raised without its
//! cause.
//!
//! # Practice
//! One part for each head. Heads are synthetic variations of few people: they show where the
//! program breaks, not how often it would in a clinic. `auto` measures its case on every tenth
//! head, as a session does; on the others it chooses by the laws of `trepan-budget`, which costs
//! half a minute less.

mod ride;

use anyhow::{Context, Result};
use clap::Parser;
use ride::{FLAP, HOLE, Ride, Task};
use std::path::{Path, PathBuf};
use std::sync::OnceLock;
use trepan_budget::{Machine, Rows, Setup};
use trepan_evidence::part::{Part, Scope};
use trepan_evidence::suite::{Findings, Gate, Row};
use trepan_evidence::worst::{self, Rank};
use trepan_geometry::Vec3;
use trepan_patient::Inputs;
use trepan_simulator::{Options, Session};
use trepan_stages::Program;
use trepan_trials_scenes::population::{BaseHead, Files, Head, HeadRecipe, base_heads};
use trepan_volume::{VoxelVolume, nifti, resample};

/// Heads in a quick run and in a full one.
const HEADS: (u64, u64) = (6, 100);
/// Every so many heads `auto` measures its case.
const MEASURED_EACH: u64 = 10;
/// Longest way of a node in a millisecond in which nothing touches the brain, mm.
const JUMP_MM: f64 = 0.05;
/// Least overlap of the brain that is found with the one that is known.
const DICE: f64 = 0.9;
/// Over which places of the head it is opened, beside the default: directions from the brain's
/// middle.
const PLACES: [(&str, Vec3); 2] =
    [("left front", Vec3::new(-0.62, 0.42, 0.66)), ("right back", Vec3::new(0.6, -0.45, 0.66))];
/// Distance of the point that an opening is asked for at, mm from the brain's middle: outside every
/// head.
const OUTSIDE_MM: f32 = 130.0;
/// What the rows of the import are called.
const IMPORT: &str = "import";

/// One part for each head.
pub fn parts(scope: Scope) -> Vec<Part> {
    let part = |number: u64| {
        let name = format!("head {number:03}");
        Part::new(name.clone(), move |scope, findings: &mut Findings| {
            if let Err(fault) = operate(scope, number, &name, findings) {
                findings.rows.push(Row::new(&name, "not run").with("fault", format!("{fault:#}")));
            }
        })
    };
    (1..=scope.pick(HEADS.0, HEADS.1)).map(part).collect()
}

/// The real heads, read once.
fn bases() -> Result<&'static [BaseHead]> {
    static BASES: OnceLock<Vec<BaseHead>> = OnceLock::new();
    if BASES.get().is_none() {
        let heads = base_heads()?;
        return Ok(BASES.get_or_init(|| heads));
    }
    BASES.get().map(Vec::as_slice).context("no real head")
}

/// A head on disk, with a cache of its own, which goes with it.
struct Patient {
    folder: tempfile::TempDir,
    files: Files,
    recipe: HeadRecipe,
    brain: VoxelVolume<u8>,
}

impl Patient {
    fn made(scope: Scope, number: u64) -> Result<Self> {
        let bases = bases()?;
        let seed = scope.random(number).u64(1..u64::MAX);
        let recipe =
            if number == 1 { HeadRecipe::mild(seed, bases.len()) } else { HeadRecipe::drawn(seed, bases.len()) };
        let head = Head::make(&recipe, &bases[recipe.base]);
        let folder = tempfile::tempdir()?;
        let files = head.write(folder.path())?;
        Ok(Self { folder, files, recipe, brain: head.brain })
    }

    fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    /// The flags that name its images, with the brain that was found in them once that is known.
    fn flags(&self, found: Option<&Path>) -> Vec<String> {
        let path = |path: &Path| path.display().to_string();
        let mut flags = vec!["--ct".into(), path(&self.files.ct), "--mri".into(), path(&self.files.mri)];
        flags.extend(["--cache".into(), path(&self.path("cases"))]);
        if let Some(found) = found {
            flags.extend(["--labels".into(), path(found)]);
        }
        for (class, codes) in [("white", "2,41"), ("grey", "3,42"), ("ventricle", "4,5,14,15,43,44")] {
            flags.extend(["--tissue".into(), format!("{class}={}:{codes}", path(&self.files.labels))]);
        }
        if let Some(tumour) = &self.files.tumour {
            flags.extend(["--tissue".into(), format!("tumour={}", path(tumour))]);
        }
        flags
    }
}

/// What the import of a head came to.
struct Imported {
    /// The brain that was found, on its own grid.
    found: VoxelVolume<u8>,
    /// Middle of the brain, mm.
    middle: Vec3,
    bone_mm: f32,
    brain_mm: f32,
    remarks: Vec<String>,
}

fn import(patient: &Patient) -> Result<Imported> {
    let session = open(patient.flags(None), "usual")?;
    let scene = session.scene();
    let brain = scene.brain.as_ref().context("the head has a brain")?;
    Ok(Imported {
        found: brain.classes.map(|class| u8::from(class != 0)),
        middle: brain.mesh.bounds().centre(),
        bone_mm: scene.site.bone_mm,
        brain_mm: scene.site.brain_mm,
        remarks: scene.remarks.clone(),
    })
}

/// A session without pictures.
fn open(flags: Vec<String>, quality: &str) -> Result<Session> {
    let base = ["integrated", "--headless", "--frames-per-second", "0", "--quality", quality];
    let flags = base.into_iter().map(String::from).chain(flags);
    Ok(Session::open(Program::Integrated, Options::try_parse_from(flags)?, Inputs::default())?)
}

/// Overlap (Dice 1945) of a mask that was found with the one that is known, on the grid of the
/// latter.
fn dice(found: &VoxelVolume<u8>, known: &VoxelVolume<u8>) -> f64 {
    let grid = trepan_volume::Grid::of(known);
    let found = resample(found, &grid, trepan_volume::Interpolation::Majority, 0);
    let (mut both, mut sum) = (0u64, 0u64);
    for (a, b) in found.data.iter().zip(&known.data) {
        both += u64::from(*a != 0 && *b != 0);
        sum += u64::from(*a != 0) + u64::from(*b != 0);
    }
    2.0 * both as f64 / sum.max(1) as f64
}

/// Everything that is done with one head.
fn operate(scope: Scope, number: u64, name: &str, findings: &mut Findings) -> Result<()> {
    let patient = Patient::made(scope, number)?;
    let imported = import(&patient).with_context(|| patient.recipe.describe())?;
    findings.rows.push(row_of_import(name, &patient, &imported));
    let found = patient.path("found.nii");
    nifti::write(&found, &imported.found)?;
    let flags = patient.flags(Some(&found));
    let qualities = match scope.quick && number > 1 {
        true => &["draft", "usual"][..],
        false => &["draft", "usual", "fine", "auto"],
    };
    let places = [("default", None)].into_iter().chain(PLACES.map(|(place, way)| (place, Some(way))));
    for (at, (place, way)) in places.take(scope.pick(1, 3)).enumerate() {
        let mut flags = flags.clone();
        if let Some(way) = way {
            let [x, y, z] = (imported.middle + OUTSIDE_MM * way.normalize()).to_array();
            flags.push(format!("--opening={x:.1},{y:.1},{z:.1}"));
        }
        for quality in qualities {
            let measured = at == 0 && (number - 1).is_multiple_of(MEASURED_EACH);
            let (quality_flag, more) = match *quality == "auto" && !measured {
                true => ("usual", by_laws(&imported)?),
                false => (*quality, Vec::new()),
            };
            let flags = flags.iter().cloned().chain(more).collect();
            findings.rows.push(row_of_ride(name, place, quality, open(flags, quality_flag), HOLE)?);
        }
    }
    let flap = [flags, vec!["--flap".into(), "30".into()]].concat();
    findings.rows.push(row_of_ride(name, "flap", "usual", open(flap, "usual"), FLAP)?);
    Ok(())
}

/// The flags of what `auto` chooses by its laws alone.
fn by_laws(imported: &Imported) -> Result<Vec<String>> {
    let voxel_mm3 = imported.found.spacing_mm().element_product();
    let brain_mm3 = imported.found.data.iter().filter(|v| **v != 0).count() as f64 * voxel_mm3;
    let scene = trepan_budget::Scene { brain_mm3, ..trepan_budget::Scene::default() };
    let Setup { bone, tissue, .. } = trepan_budget::plan_with(&Machine::default(), &scene, &Rows::stored()?)?.setup();
    let flags = [
        ("--spacing-mm", bone.spacing_mm.to_string()),
        ("--rigid", bone.method.into()),
        ("--tets", tissue.tets.to_string()),
        ("--opening-refinement", tissue.halvings.to_string()),
    ];
    Ok(flags.into_iter().flat_map(|(flag, value)| [flag.to_string(), value]).collect())
}

fn row_of_import(name: &str, patient: &Patient, imported: &Imported) -> Row {
    let ml = |mask: &VoxelVolume<u8>| {
        mask.data.iter().filter(|v| **v != 0).count() as f64 * mask.spacing_mm().element_product() * 1e-3
    };
    Row::new(name, IMPORT)
        .with("head", patient.recipe.describe())
        .with("remarks", imported.remarks.clone())
        .metric("dice", dice(&imported.found, &patient.brain))
        .metric("brain_found_ml", ml(&imported.found))
        .metric("brain_known_ml", ml(&patient.brain))
        .metric("opening_bone_mm", imported.bone_mm.into())
        .metric("opening_brain_mm", imported.brain_mm.into())
}

/// A row of one operation. A head that cannot be opened there says so in it.
fn row_of_ride(head: &str, place: &str, quality: &str, session: Result<Session>, task: Task) -> Result<Row> {
    let row = Row::new(format!("{head}, {place}"), quality);
    let session = match session {
        Ok(session) => session,
        Err(fault) => return Ok(row.with("refused", format!("{fault:#}"))),
    };
    let ride: Ride = ride::ride(&session, task)?;
    Ok(row
        .with("setup", ride.setup.as_str())
        .metric("opened", f64::from(u8::from(ride.opened)))
        .metric("jump_mm", ride.jump_mm.into())
        .metric("held_jump_mm", ride.held_jump_mm.into())
        .metric("rest_motion_mm", ride.solver_faults.rest_motion_mm.into())
        .metric("inverted", ride.solver_faults.inverted as f64)
        .metric("non_finite", ride.solver_faults.non_finite as f64)
        .metric("limited", ride.solver_faults.limited as f64)
        .metric("skipped_ms", ride.solver_faults.skipped_ms)
        .metric("contacts_left_out", ride.solver_faults.contacts_left_out as f64)
        .metric("falsely_pressed", ride.falsely_pressed.into())
        .metric("pressed", ride.pressed.into())
        .metric("drill_on_brain_warned", ride.touched.into())
        .metric("drill_on_brain_scored", ride.touches.into())
        .metric("bone_mm", ride.bone_mm.into())
        .metric("brain_mm", ride.brain_mm.into())
        .metric("displacement_mm", ride.most_mm.into())
        .metric("tissue_n", ride.tissue_n.into())
        .metric("force_n", ride.peak_n.into()))
}

/// What must hold for every head, place and quality.
pub fn judge(scope: Scope, findings: &mut Findings) {
    let number = |row: &Row, name: &str| row.metrics.get(name).copied().unwrap_or(f64::NAN);
    let rides: Vec<&Row> = findings.rows.iter().filter(|row| row.metrics.contains_key("opened")).collect();
    let all = |name: &str, wrong: &dyn Fn(f64) -> bool| rides.iter().filter(|row| wrong(number(row, name))).count();
    let refused = findings.rows.iter().filter(|row| row.config.contains_key("refused")).count();
    let not_run = findings.rows.iter().filter(|row| row.method == "not run").count();
    let over = |limit: f64| move |value: f64| value.is_nan() || value > limit;
    let imports = || findings.rows.iter().filter(|row| row.method == IMPORT);
    // One warning may stand over several touches in a row.
    let warned =
        |row: &Row| (number(row, "drill_on_brain_warned") > 0.0) != (number(row, "drill_on_brain_scored") > 0.0);
    let gates = [
        ("heads that could not be run", not_run),
        ("operations refused", refused),
        ("operations in which the bone did not open", all("opened", &|opened| opened < 1.0)),
        ("operations with a jump over 0.05 mm in a millisecond without touch", all("jump_mm", &over(JUMP_MM))),
        ("operations with motion over 0.02 mm in a step at rest", all("rest_motion_mm", &over(0.02))),
        ("operations with inverted elements", all("inverted", &over(0.0))),
        ("operations in which the solver skipped time", all("skipped_ms", &over(0.0))),
        ("operations with nodes that were not finite", all("non_finite", &over(0.0))),
        ("operations with nodes clamped to a limit", all("limited", &over(0.0))),
        ("operations with contacts left out", all("contacts_left_out", &over(0.0))),
        ("operations with a false \"brain is pressed hard\"", all("falsely_pressed", &over(0.0))),
        (
            "operations with a false or missing \"the drill is on the brain\"",
            rides.iter().filter(|row| warned(row)).count(),
        ),
        (
            "heads whose brain was found with a Dice under 0.9 and no remark on it",
            imports().filter(|row| number(row, "dice") < DICE && !doubts(row)).count(),
        ),
    ];
    let rank = |metric, low_is_bad| Rank { metric, low_is_bad };
    let high = ["jump_mm", "rest_motion_mm", "skipped_ms"].map(|metric| rank(metric, false));
    let mut tables = vec![worst::table("population", scope, &rides, &high)];
    tables.push(worst::table("population", scope, &imports().collect::<Vec<_>>(), &[rank("dice", true)]));
    findings.gates.extend(gates.map(|(name, count)| Gate::at_most(name, count as f64, 0.0)));
    findings.tables.extend(tables);
}

/// Whether the import said that the brain it found may be wrong.
fn doubts(row: &Row) -> bool {
    let remarks = row.config.get("remarks").and_then(|remarks| remarks.as_array());
    let text = |remark: &serde_json::Value| remark.as_str().unwrap_or_default().to_lowercase();
    remarks.into_iter().flatten().any(|remark| text(remark).contains("brain mask"))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ride(metric: &str, value: f64) -> Row {
        let usual = [
            ("opened", 1.0),
            ("jump_mm", 0.01),
            ("rest_motion_mm", 0.01),
            ("inverted", 0.0),
            ("skipped_ms", 0.0),
            ("non_finite", 0.0),
            ("limited", 0.0),
            ("contacts_left_out", 0.0),
            ("falsely_pressed", 0.0),
            ("drill_on_brain_warned", 1.0),
            ("drill_on_brain_scored", 1.0),
        ];
        let row = usual
            .into_iter()
            .fold(Row::new("head 001, default", "usual"), |row, (name, value)| row.metric(name, value));
        row.metric(metric, value)
    }

    fn broken(row: Row) -> usize {
        let mut findings = Findings { rows: vec![row], ..Findings::default() };
        judge(Scope { quick: true, seed: 1 }, &mut findings);
        findings.gates.iter().filter(|gate| !gate.pass).count()
    }

    #[test]
    fn every_fault_breaks_its_gate() {
        assert_eq!(broken(ride("opened", 1.0)), 0);
        for (metric, value) in [
            ("opened", 0.0),
            ("jump_mm", 0.06),
            ("jump_mm", f64::NAN),
            ("rest_motion_mm", 0.03),
            ("inverted", 1.0),
            ("skipped_ms", 2.0),
            ("non_finite", 1.0),
            ("limited", 1.0),
            ("contacts_left_out", 1.0),
            ("falsely_pressed", 1.0),
            ("drill_on_brain_warned", 0.0),
        ] {
            assert_eq!(broken(ride(metric, value)), 1, "{metric}");
        }
        let import = |dice: f64, remark: &str| {
            Row::new("head 001", IMPORT).metric("dice", dice).with("remarks", vec![remark.to_string()])
        };
        assert_eq!(
            [broken(import(0.95, "")), broken(import(0.7, "")), broken(import(0.7, "the brain mask leaks"))],
            [0, 1, 0]
        );
        assert_eq!(broken(Row::new("head 002", "not run")), 1);
        assert_eq!(broken(Row::new("head 002, default", "usual").with("refused", "no bone")), 1);
    }

    #[test]
    fn dice_is_one_for_the_same_and_a_half_for_half() {
        let mut a = VoxelVolume::isotropic([10; 3], Vec3::ZERO, 1.0, 0u8);
        a.data[..400].fill(1);
        let mut b = a.clone();
        assert_eq!(dice(&a, &b), 1.0);
        b.data[..200].fill(0);
        b.data[400..600].fill(1);
        assert_eq!(dice(&a, &b), 0.5);
    }
}
