//! Stores parts on disk, so that a stopped run resumes and shards from several machines can be
//! merged.
//!
//! # Practice
//! `OUT/parts/SUITE/PART.json` holds one part and is written atomically. A run reuses
//! parts of the identical program, scope and seed, and ignores all others; it deletes its parts
//! when
//! the report is written. Merging takes parts of one program or one commit, with one scope and
//! seed,
//! from any machine.

use crate::files::whole;
use crate::part::{Scope, Suite};
use crate::picture::Table;
use crate::report::{Making, Report, slugs};
use crate::suite::{Findings, Row};
use crate::timer::{Control, Samples};
use anyhow::{Context, Result, bail};
use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};
use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::fs;
use std::path::{Path, PathBuf};

const PARTS: &str = "parts";

/// Content of one part's file.
#[derive(Serialize, Deserialize)]
pub struct StoredPart {
    /// Hash of the program that made the part.
    program: String,
    /// Run time, s.
    pub seconds: f64,
    /// Whether the part ran to its end; one that did not is made again.
    ended: bool,
    /// Timing control before and after the part, the worse of both.
    control: Control,
    /// Provenance.
    pub making: Making,
    /// Findings.
    pub findings: Findings,
}

/// Folder with parts and reports.
pub struct Store {
    folder: PathBuf,
    program: String,
    /// Provenance at the start of the run: the sources may change meanwhile.
    making: Making,
}

impl Store {
    /// Opens a folder, created if missing.
    pub fn open(folder: &Path, scope: Scope) -> Result<Self> {
        fs::create_dir_all(folder).with_context(|| format!("cannot make {}", folder.display()))?;
        let program = fs::read(std::env::current_exe()?).context("cannot read this program")?;
        let hash = Sha256::digest(&program).iter().fold(String::new(), |mut hash, byte| {
            _ = write!(hash, "{byte:02x}");
            hash
        });
        Ok(Self { folder: folder.into(), program: hash, making: Making::here(scope) })
    }

    fn place(&self, suite: &str, part: &str) -> PathBuf {
        self.folder.join(PARTS).join(suite).join(format!("{part}.json"))
    }

    /// Finished part that this program made in this scope, if stored.
    pub fn found(&self, suite: &str, part: &str) -> Option<StoredPart> {
        self.own(suite, part).filter(|stored| stored.ended)
    }

    /// Part that this program made in this scope, finished or not.
    fn own(&self, suite: &str, part: &str) -> Option<StoredPart> {
        let stored: StoredPart = serde_json::from_slice(&fs::read(self.place(suite, part)).ok()?).ok()?;
        (stored.program == self.program && stored.making.scope() == self.making.scope()).then_some(stored)
    }

    /// Parts of a suite that this program made in this scope: name, file and part. Nothing
    /// else in the folder is read.
    fn all_own(&self, suite: &Suite) -> impl Iterator<Item = (String, PathBuf, StoredPart)> {
        let names = slugs(suite, self.making.scope()).into_iter();
        names.filter_map(|name| Some((name.clone(), self.place(suite.name, &name), self.own(suite.name, &name)?)))
    }

    /// Report over the parts that this program made. `None` if there are none.
    pub fn merged(&self, suite: &Suite) -> Result<Option<Report>> {
        judged(suite, self.all_own(suite))
    }

    /// Stores a part with its run time, its timing control, and whether it ran to its end.
    pub fn keep(
        &self,
        suite: &str,
        part: &str,
        (seconds, control): (f64, Control),
        (findings, ended): (Findings, bool),
    ) -> Result<()> {
        let (program, making) = (self.program.clone(), self.making.clone());
        let stored = StoredPart { program, seconds, ended, control, making, findings };
        whole(&self.place(suite, part), &serde_json::to_vec(&stored)?)
    }

    /// Deletes this program's parts of a suite, which are in its report.
    pub fn forget(&self, suite: &Suite) {
        self.all_own(suite).for_each(|(_, path, _)| _ = fs::remove_file(path));
        _ = fs::remove_dir(self.folder.join(PARTS).join(suite.name));
        _ = fs::remove_dir(self.folder.join(PARTS));
    }

    /// Last run time of each part, s, by `SUITE/PART`.
    pub fn durations(&self) -> BTreeMap<String, f64> {
        let read = fs::read(self.folder.join(durations(self.making.scope()))).ok();
        read.and_then(|bytes| serde_json::from_slice(&bytes).ok()).unwrap_or_default()
    }

    /// Stores the run times of parts.
    pub fn remember(&self, all: &BTreeMap<String, f64>) -> Result<()> {
        whole(&self.folder.join(durations(self.making.scope())), &serde_json::to_vec_pretty(all)?)
    }
}

fn durations(scope: Scope) -> &'static str {
    scope.pick("durations-quick.json", "durations.json")
}

/// Report over all parts of a suite in some folders, in the suite's order. `None` if no
/// folder has any.
pub fn merged(suite: &Suite, folders: &[PathBuf]) -> Result<Option<Report>> {
    judged(suite, stored(suite.name, folders)?)
}

/// Parts of a suite in some folders: name, file and part. Temporary files of interrupted writes are
/// skipped.
fn stored(suite: &str, folders: &[PathBuf]) -> Result<impl Iterator<Item = (String, PathBuf, StoredPart)>> {
    let mut all = Vec::new();
    for folder in folders {
        for entry in fs::read_dir(folder.join(PARTS).join(suite)).into_iter().flatten() {
            let path = entry?.path();
            if path.extension().is_none_or(|ending| ending != "json") {
                continue;
            }
            let name = path.file_stem().unwrap_or_default().to_string_lossy().into_owned();
            let read = fs::read(&path).with_context(|| format!("cannot read {}", path.display()))?;
            let part = serde_json::from_slice(&read).with_context(|| format!("{} is no part", path.display()))?;
            all.push((name, path, part));
        }
    }
    Ok(all.into_iter())
}

/// Combines and judges parts of one suite as one run.
fn judged(suite: &Suite, all: impl Iterator<Item = (String, PathBuf, StoredPart)>) -> Result<Option<Report>> {
    let mut parts: BTreeMap<String, (PathBuf, StoredPart)> = BTreeMap::new();
    for (name, path, part) in all {
        if let Some((other, _)) = parts.insert(name, (path.clone(), part)) {
            bail!("{} and {} are the same part: leave one out", other.display(), path.display());
        }
    }
    let Some((first, of_first)) = parts.values().next() else { return Ok(None) };
    let alike = |one: &StoredPart, two: &StoredPart| {
        let [one_commit, two_commit] = [one, two].map(|part| &*part.making.commit);
        // Uncommitted changes, and sources without a commit, cannot be checked for equality.
        let is_sure = !one_commit.ends_with("-dirty") && one_commit != "unknown";
        let same_code = one.program == two.program || is_sure && one_commit == two_commit;
        same_code && one.making.scope() == two.making.scope()
    };
    if let Some((path, other)) = parts.values().find(|(_, part)| !alike(part, of_first)) {
        let describe = |m: &Making| format!("commit {}, quick {}, seed {}", m.commit, m.quick, m.seed);
        let [one, two] = [&of_first.making, &other.making].map(describe);
        let remedy = "merge parts of one program, or of one commit without changes";
        bail!("{} is of {one}, {} of {two}: {remedy}", first.display(), path.display());
    }
    let scope = of_first.making.scope();
    let wanted = slugs(suite, scope);
    let missing: Vec<&String> = wanted.iter().filter(|name| !parts.contains_key(*name)).collect();
    if !missing.is_empty() {
        bail!("{}: {} part(s) are missing, such as {}: run their shard first", suite.name, missing.len(), missing[0]);
    }
    let controls: Vec<Control> = parts.values().map(|(_, part)| part.control).collect();
    let beside = beside(wanted.iter().filter_map(|name| Some((name, &parts.get(name)?.1))));
    let take = |name: &String| parts.remove(name).map(|(_, part)| (name.clone(), part.making, part.findings));
    let mut report = Report::of(suite, wanted.iter().filter_map(take).collect());
    if let Some(report) = &mut report {
        report.findings.rows.push(control(&controls));
        report.findings.tables.push(beside.clone());
    }
    Ok(report)
}

/// Table of the control beside each part: how long the part took, and how busy the machine was.
fn beside<'a>(parts: impl Iterator<Item = (&'a String, &'a StoredPart)>) -> Table {
    let row = |(name, part): (&String, &StoredPart)| {
        let Control { empty_p99_us, sum_p50_us, sum_p99_us, load } = part.control;
        let numbers = [part.seconds, load, empty_p99_us, sum_p50_us, sum_p99_us];
        std::iter::once(name.clone()).chain(numbers.map(|number| format!("{number:.2}"))).collect()
    };
    let columns = ["part", "took, s", "load", "empty call p99, us", "fixed sum p50, us", "fixed sum p99, us"];
    Table {
        title: "Machine beside every part".into(),
        columns: columns.map(String::from).into(),
        rows: parts.map(row).collect(),
    }
}

/// Row of the timing control: medians over the parts, and the worst.
fn control(all: &[Control]) -> Row {
    let sorted = |of: fn(&Control) -> f64| Samples::from(all.iter().map(of).collect::<Vec<f64>>());
    let (middle, slow) = (sorted(|c| c.sum_p50_us), sorted(|c| c.sum_p99_us));
    Row::new("control of the machine beside every part", "an empty call, a fixed sum")
        .metric("empty_p99_us", sorted(|c| c.empty_p99_us).quantile(0.5))
        .metric("sum_p50_us", middle.quantile(0.5))
        .metric("sum_p99_us", slow.quantile(0.5))
        .metric("sum_p50_spread_percent", 100.0 * (middle.quantile(0.9) / middle.quantile(0.1) - 1.0))
}

/// Report stored in a folder, if any.
pub fn report(folder: &Path, suite: &str) -> Result<Option<Report>> {
    let path = folder.join(format!("{suite}.json"));
    match fs::read(&path) {
        Ok(bytes) => {
            let report = serde_json::from_slice(&bytes);
            Ok(Some(report.with_context(|| format!("{} is no report of a suite", path.display()))?))
        }
        Err(fault) if fault.kind() == std::io::ErrorKind::NotFound => Ok(None),
        Err(fault) => Err(fault).with_context(|| format!("cannot read {}", path.display())),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::part::Part;
    use crate::suite::{Gate, Row};

    fn judge(_: Scope, findings: &mut Findings) {
        let sum = findings.rows.iter().map(|row| row.metrics["value_mm"]).sum();
        findings.gates.push(Gate::at_most("sum over all parts, mm", sum, 100.0));
    }

    fn parts(scope: Scope) -> Vec<Part> {
        let part = |n: u64| {
            Part::new(format!("part {n}"), move |scope: Scope, findings: &mut Findings| {
                let value = scope.random(n).f64();
                findings.rows.push(Row::new("s", format!("m{n}")).metric("value_mm", value));
            })
        };
        (0..scope.pick(5, 9)).map(part).collect()
    }

    const SUITE: Suite = Suite { name: "made-up", question: "q", chart: ("a", "b"), parts, judge };
    const SCOPE: Scope = Scope { quick: true, seed: 1 };

    fn run(folder: &Path, takes: impl Fn(usize) -> bool) {
        let store = Store::open(folder, SCOPE).unwrap();
        for (_, part) in parts(SCOPE).into_iter().enumerate().filter(|(number, _)| takes(*number)) {
            let (slug, found) = (part.slug(), part.run(SCOPE));
            store.keep(SUITE.name, &slug, (0.1, Control::default()), found).unwrap();
        }
    }

    #[test]
    fn two_merged_shards_equal_the_file_of_one_run() {
        let all = tempfile::tempdir().unwrap();
        let [one, even, odd] = ["one", "even", "odd"].map(|name| all.path().join(name));
        run(&one, |_| true);
        run(&even, |n| n % 2 == 0);
        run(&odd, |n| n % 2 == 1);
        let file = |folders: &[PathBuf]| serde_json::to_string(&merged(&SUITE, folders).unwrap().unwrap()).unwrap();
        assert_eq!(file(std::slice::from_ref(&one)), file(&[odd.clone(), even.clone()]));
        let fault = |folders: &[PathBuf]| merged(&SUITE, folders).unwrap_err().to_string();
        assert!(fault(std::slice::from_ref(&odd)).contains("missing, such as part-0"));
        assert!(fault(&[one, odd]).contains("the same part"));
        assert!(merged(&SUITE, &[all.path().join("none")]).unwrap().is_none());
    }

    #[test]
    fn a_stopped_run_resumes_and_another_scope_does_not() {
        let all = tempfile::tempdir().unwrap();
        run(all.path(), |n| n < 2);
        let store = Store::open(all.path(), SCOPE).unwrap();
        assert!(store.found(SUITE.name, "part-1").is_some() && store.found(SUITE.name, "part-2").is_none());
        let other = Store::open(all.path(), Scope { seed: 2, ..SCOPE }).unwrap();
        assert!(other.found(SUITE.name, "part-1").is_none());
        let found = store.found(SUITE.name, "part-1").unwrap().findings;
        store.keep(SUITE.name, "part-1", (0.1, Control::default()), (found, false)).unwrap();
        assert!(store.found(SUITE.name, "part-1").is_none(), "a part that panicked is made again");
        assert!(store.merged(&SUITE).unwrap_err().to_string().contains("missing, such as part-2"));
        run(all.path(), |_| true);
        let larger = Store::open(all.path(), Scope { quick: false, seed: 1 }).unwrap();
        larger.keep(SUITE.name, "part-8", (0.1, Control::default()), (Findings::default(), true)).unwrap();
        for stray in [".tmpXYZ", "part-of-an-older-format.json"] {
            fs::write(all.path().join("parts/made-up").join(stray), "{").unwrap();
        }
        assert!(store.merged(&SUITE).unwrap().is_some(), "what others and a stopped write left is not asked");
        store.forget(&SUITE);
        assert!(store.found(SUITE.name, "part-0").is_none() && store.merged(&SUITE).unwrap().is_none());
        assert!(larger.found(SUITE.name, "part-8").is_some(), "another run's part is left");
    }

    #[test]
    fn parts_of_two_programs_are_merged_only_where_one_commit_made_both() {
        let all = tempfile::tempdir().unwrap();
        run(all.path(), |_| true);
        let merged_of = |programs: [&str; 2], commit: &str| {
            for n in 0..5 {
                let path = all.path().join(format!("parts/made-up/part-{n}.json"));
                let mut part: StoredPart = serde_json::from_slice(&fs::read(&path).unwrap()).unwrap();
                part.program = programs[n % 2].into();
                part.making.commit = commit.into();
                whole(&path, &serde_json::to_vec(&part).unwrap()).unwrap();
            }
            merged(&SUITE, &[all.path().into()])
        };
        assert!(merged_of(["one", "two"], "0123abc").is_ok() && merged_of(["one", "one"], "0123abc-dirty").is_ok());
        for unsure in ["0123abc-dirty", "unknown"] {
            assert!(merged_of(["one", "two"], unsure).unwrap_err().to_string().contains("merge parts of one program"));
        }
    }

    #[test]
    fn an_unreadable_report_is_an_error_and_a_missing_one_is_not() {
        let all = tempfile::tempdir().unwrap();
        assert!(report(all.path(), "made-up").unwrap().is_none());
        fs::create_dir(all.path().join("made-up.json")).unwrap();
        assert!(report(all.path(), "made-up").unwrap_err().to_string().contains("cannot read"));
    }
}
