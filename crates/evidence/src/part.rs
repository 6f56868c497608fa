//! Parts: independent pieces of a suite that any machine can run at any time.
//!
//! # Theory
//! A suite is a list of parts and a judgement. A part makes rows from its scope alone; the
//! judgement reads rows only. So parts may run in any order, in any number of processes, and again
//! after a crash, and the judgement over all of them equals that of one run.

use crate::suite::{Findings, Gate, Row};
use std::panic::{AssertUnwindSafe, catch_unwind};

/// How much of a suite to run, and with which random numbers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Scope {
    /// Fewer and smaller scenes, for daily use.
    pub quick: bool,
    /// Seed of all random numbers, from 1.
    pub seed: u64,
}

impl Scope {
    /// Returns the first argument in a quick run, else the second.
    pub fn pick<T>(&self, quick: T, full: T) -> T {
        if self.quick { quick } else { full }
    }

    /// Random generator of a scene: its seed offset by the run's.
    pub fn random(&self, own: u64) -> fastrand::Rng {
        fastrand::Rng::with_seed(own.wrapping_add((self.seed - 1).wrapping_mul(0x9E37_79B9_7F4A_7C15)))
    }
}

/// Function that makes a part's findings.
type Make = dyn FnOnce(Scope, &mut Findings);

/// Independent piece of a suite.
pub struct Part {
    /// Name, unique in the suite.
    pub name: String,
    run: Box<Make>,
}

impl Part {
    /// Creates a part from its name and function.
    pub fn new(name: impl Into<String>, run: impl FnOnce(Scope, &mut Findings) + 'static) -> Self {
        Self { name: name.into(), run: Box::new(run) }
    }

    /// The name as used in file names: letters, digits, dots and hyphens.
    pub fn slug(&self) -> String {
        let kept = |c: char| if c.is_alphanumeric() || c == '.' { c.to_ascii_lowercase() } else { '-' };
        let slug: String = self.name.chars().map(kept).collect();
        slug.split('-').filter(|word| !word.is_empty()).collect::<Vec<_>>().join("-")
    }

    /// Runs the part. A panic breaks an acceptance limit but does not end the run; the second value
    /// is
    /// whether the part ran to its end.
    pub fn run(self, scope: Scope) -> (Findings, bool) {
        let (slug, mut findings) = (self.slug(), Findings::default());
        let ended = catch_unwind(AssertUnwindSafe(|| (self.run)(scope, &mut findings))).is_ok();
        if !ended {
            findings.rows.push(Row::new(&self.name, "not run to its end"));
            findings.gates.push(Gate::at_least(format!("{}: runs to its end", self.name), 0.0, 1.0));
        }
        findings.rows.iter_mut().for_each(|row| row.part.clone_from(&slug));
        (findings, ended)
    }
}

/// A validation suite.
pub struct Suite {
    /// Name on the command line.
    pub name: &'static str,
    /// The question that the suite answers.
    pub question: &'static str,
    /// The metrics of its default chart: cost, then error.
    pub chart: (&'static str, &'static str),
    /// Lists its parts without running them.
    pub parts: fn(Scope) -> Vec<Part>,
    /// Adds gates, charts and maps over the rows of all parts.
    pub judge: fn(Scope, &mut Findings),
}

impl Suite {
    /// Runs and judges all parts in order.
    pub fn run(&self, scope: Scope) -> Findings {
        let mut findings = Findings::default();
        (self.parts)(scope).into_iter().for_each(|part| findings.append(part.run(scope).0));
        (self.judge)(scope, &mut findings);
        findings
    }
}

/// Judgement of suites whose parts make all gates themselves.
pub fn nothing_more(_: Scope, _: &mut Findings) {}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_panic_breaks_a_limit_and_earlier_findings_stay() {
        let scope = Scope { quick: true, seed: 1 };
        let part = Part::new("Walls: 1 mm, ν 0.3", |_, findings: &mut Findings| {
            findings.rows.push(Row::new("s", "m"));
            panic!("on purpose");
        });
        assert_eq!(part.slug(), "walls-1-mm-ν-0.3");
        let (found, ended) = part.run(scope);
        assert!(!ended && found.rows.len() == 2 && !found.gates[0].pass);
        assert_eq!(found.rows[0].part, "walls-1-mm-ν-0.3");
    }

    #[test]
    fn seed_one_is_the_scenes_seed_and_others_differ() {
        let at = |seed| Scope { quick: true, seed }.random(7).u64(..);
        assert_eq!(at(1), fastrand::Rng::with_seed(7).u64(..));
        assert_ne!(at(1), at(2));
    }
}
