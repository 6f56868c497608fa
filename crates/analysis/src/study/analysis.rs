//! Computes a study's results from its runs and answers.
//!
//! # Practice
//! A participant counts once in a comparison, by the mean over attempts. Incomplete recordings are
//! left out; outliers are not. All comparisons of a study are one family of Holm's correction, so
//! that the chance of any false finding is below the protocol's level.

use super::check::Answers;
use super::plan::{letter, plan};
use super::protocol::{Protocol, Scale};
use super::results::{Attempt, Finding, Law, Of, Outlier, Results};
use super::runs::Run;
use crate::statistics::{
    Classified, Comparison, OUTLIER_Z, Reliability, classify, compare, compare_paired, fit_power_law, holm, mean,
    modified_z, quantile, reliability, variance,
};
use fastrand::Rng;
use std::collections::BTreeMap;

/// Samples of participants for the interval of a learning rate; numerical.
const LEARNING_DRAWS: usize = 299;

/// Results of a study.
pub fn analyse(protocol: &Protocol, runs: &[Run], answers: &Answers) -> Results {
    let whole: Vec<&Run> = runs.iter().filter(|run| run.complete).collect();
    let mut findings = of_scores(protocol, &whole);
    findings.extend(of_answers(protocol, answers));
    let adjusted = holm(&findings.iter().map(|finding| finding.comparison.p).collect::<Vec<_>>());
    for (finding, adjusted) in findings.iter_mut().zip(adjusted) {
        let Comparison { g_low, g_high, .. } = finding.comparison;
        finding.p_holm = adjusted;
        finding.found = adjusted < protocol.statistics.alpha && (g_low > 0.0 || g_high < 0.0);
    }
    let (classified, groups) = classification(protocol, &whole);
    let (attempts, laws) = learning(protocol, &whole);
    Results {
        findings,
        attempts,
        laws,
        reliability: reliabilities(protocol, &whole),
        classified,
        groups,
        outliers: outliers(protocol, &whole),
        runs: runs.to_vec(),
        simulated: runs.iter().any(|run| run.simulated),
    }
}

/// Values by participant.
fn by_participant<'a>(runs: impl Iterator<Item = &'a &'a Run>, measure: &str) -> BTreeMap<&'a str, Vec<f64>> {
    let mut values = BTreeMap::<&str, Vec<f64>>::new();
    for run in runs {
        if let Some(value) = run.scores.get(measure).filter(|value| value.is_finite()) {
            values.entry(&run.participant).or_default().push(*value);
        }
    }
    values
}

/// A group or a condition: its name, and a value of each participant.
type Side = (String, BTreeMap<String, f64>);

/// Compares every two sides; `paired` where they are of the same participants.
fn compare_sides(protocol: &Protocol, measure: &str, task: &str, paired: bool, sides: &[Side]) -> Vec<Finding> {
    let mut found = Vec::new();
    for (at, (first, a)) in sides.iter().enumerate() {
        for (second, b) in &sides[at + 1..] {
            // Each comparison has draws of its own.
            let name = format!("{measure}{task}{first}{second}");
            let seed = name.bytes().fold(protocol.seed, |hash, byte| hash.rotate_left(7) ^ u64::from(byte));
            let draws = protocol.statistics.draws;
            let comparison = if paired {
                let both = a.iter().filter_map(|(code, a)| Some([*a, *b.get(code)?]));
                compare_paired(&both.collect::<Vec<_>>(), draws, seed)
            } else {
                let values = |side: &BTreeMap<String, f64>| side.values().copied().collect::<Vec<_>>();
                compare(&values(a), &values(b), draws, seed)
            };
            let (measure, task, first, second) = (measure.into(), task.into(), first.clone(), second.clone());
            found.extend(comparison.map(|comparison| Finding {
                measure,
                task,
                first,
                second,
                paired,
                comparison,
                p_holm: 1.0,
                found: false,
            }));
        }
    }
    found
}

/// Means of participants over the runs that `is` takes.
fn side(name: String, runs: &[&Run], measure: &str, is: impl Fn(&Run) -> bool) -> Side {
    let values = by_participant(runs.iter().filter(|run| is(run)), measure);
    (name, values.into_iter().map(|(code, values)| (code.to_owned(), mean(&values))).collect())
}

fn of_scores(protocol: &Protocol, runs: &[&Run]) -> Vec<Finding> {
    let mut found = Vec::new();
    for (measure, task) in measures_and_tasks(protocol) {
        let groups = protocol.groups.iter().enumerate().map(|(number, group)| {
            side(group.name.clone(), runs, measure, |run| run.task == task && run.group == number)
        });
        found.extend(compare_sides(protocol, measure, task, false, &groups.collect::<Vec<_>>()));
        let conditions = (0..protocol.conditions.len()).map(letter).map(|letter| {
            let of = |run: &Run| run.task == task && run.condition.as_ref() == Some(&letter);
            side(letter.clone(), runs, measure, of)
        });
        found.extend(compare_sides(protocol, measure, task, true, &conditions.collect::<Vec<_>>()));
    }
    found
}

fn measures_and_tasks(protocol: &Protocol) -> impl Iterator<Item = (&str, &str)> {
    let tasks = |score| protocol.tasks.iter().map(move |task| (score, task.name.as_str()));
    protocol.measures.iter().flat_map(move |measure| tasks(measure.score.as_str()))
}

/// Answers by item, and the raw TLX as the mean of its items.
fn of_answers(protocol: &Protocol, answers: &Answers) -> Vec<Finding> {
    let items = |scale: Scale| protocol.questions.iter().filter(move |q| q.scale == scale).map(|q| q.item.as_str());
    let mut scales: Vec<(&str, Vec<&str>)> = items(Scale::Likert).map(|item| (item, vec![item])).collect();
    let tlx: Vec<&str> = items(Scale::NasaTlx).collect();
    if !tlx.is_empty() {
        scales.push(("raw NASA-TLX", tlx));
    }
    let plan = plan(protocol);
    let paired = !protocol.conditions.is_empty();
    let mut found = Vec::new();
    for (name, items) in &scales {
        // A participant counts who answered all items.
        let side = |name: String, condition: &str, group: Option<usize>| -> Side {
            let of =
                plan.participants.iter().filter(|participant| group.is_none_or(|group| participant.group == group));
            let value = |code: &String| {
                let key = |item: &&str| (code.clone(), condition.to_owned(), (*item).to_owned());
                items.iter().map(|item| answers.get(&key(item)).copied()).collect::<Option<Vec<f64>>>()
            };
            (name, of.filter_map(|of| Some((of.code.clone(), mean(&value(&of.code)?)))).collect())
        };
        let sides: Vec<Side> = if paired {
            (0..protocol.conditions.len()).map(letter).map(|letter| side(letter.clone(), &letter, None)).collect()
        } else {
            protocol.groups.iter().enumerate().map(|(at, group)| side(group.name.clone(), "", Some(at))).collect()
        };
        found.extend(compare_sides(protocol, name, "", paired, &sides));
    }
    found
}

/// Values of each participant by attempt; over conditions, their mean.
fn by_attempt(runs: &[&Run], measure: &str, task: &str, group: Option<usize>) -> Vec<BTreeMap<usize, f64>> {
    let mut values = BTreeMap::<&str, BTreeMap<usize, Vec<f64>>>::new();
    for run in runs.iter().filter(|run| run.task == task && group.is_none_or(|group| run.group == group)) {
        if let Some(value) = run.scores.get(measure).filter(|value| value.is_finite()) {
            values.entry(&run.participant).or_default().entry(run.attempt).or_default().push(*value);
        }
    }
    let means =
        |of: BTreeMap<usize, Vec<f64>>| of.into_iter().map(|(attempt, values)| (attempt, mean(&values))).collect();
    values.into_values().map(means).collect()
}

fn means_of(participants: &[&BTreeMap<usize, f64>]) -> Vec<Attempt> {
    let mut by_attempt = BTreeMap::<usize, Vec<f64>>::new();
    for (attempt, value) in participants.iter().flat_map(|participant| participant.iter()) {
        by_attempt.entry(*attempt).or_default().push(*value);
    }
    let row = |(attempt, values): (usize, Vec<f64>)| {
        let standard_error = (variance(&values) / values.len() as f64).sqrt();
        Attempt { attempt, mean: mean(&values), standard_error }
    };
    by_attempt.into_iter().map(row).collect()
}

fn of<T>(measure: &str, task: &str, group: &str, is: T) -> Of<T> {
    Of { measure: measure.into(), task: task.into(), group: group.into(), is }
}

fn learning(protocol: &Protocol, runs: &[&Run]) -> (Vec<Of<Attempt>>, Vec<Of<Law>>) {
    let (mut rows, mut laws) = (Vec::new(), Vec::new());
    for (measure, task) in measures_and_tasks(protocol) {
        for (number, group) in protocol.groups.iter().enumerate() {
            let participants = by_attempt(runs, measure, task, Some(number));
            let means = means_of(&participants.iter().collect::<Vec<_>>());
            let points = |means: &[Attempt]| means.iter().map(|of| (of.attempt as f64, of.mean)).collect::<Vec<_>>();
            rows.extend(means.iter().map(|is| of(measure, task, &group.name, *is)));
            let Some(law) = fit_power_law(&points(&means)) else { continue };
            let mut rng = Rng::with_seed(protocol.seed ^ 0x300 ^ laws.len() as u64);
            let rate = |_| {
                let drawn = (0..participants.len()).map(|_| &participants[rng.usize(..participants.len())]);
                Some(fit_power_law(&points(&means_of(&drawn.collect::<Vec<_>>())))?.rate)
            };
            let mut rates: Vec<f64> = (0..LEARNING_DRAWS).filter_map(rate).collect();
            let rate = [0.025, 0.975].map(|share| quantile(&mut rates, share));
            laws.push(of(measure, task, &group.name, Law { law, rate }));
        }
    }
    (rows, laws)
}

/// Reliability over the later half of the attempts, where learning has slowed; of two, both.
fn reliabilities(protocol: &Protocol, runs: &[&Run]) -> Vec<Of<Reliability>> {
    let row = |(measure, task): (&str, &str)| {
        let all = protocol.tasks.iter().find(|known| known.name == task)?.attempts;
        let first = if all <= 3 { 1 } else { all / 2 + 1 };
        let participants = by_attempt(runs, measure, task, None);
        let later = |by: &BTreeMap<usize, f64>| (first..=all).map(|attempt| by.get(&attempt).copied()).collect();
        let rows: Vec<Vec<f64>> = participants.iter().filter_map(later).collect();
        Some(of(measure, task, "", reliability(&rows)?))
    };
    measures_and_tasks(protocol).filter_map(row).collect()
}

/// Tells the groups apart by the participants' means of all measures in all tasks.
fn classification(protocol: &Protocol, runs: &[&Run]) -> (Option<Classified>, Vec<usize>) {
    let of = |(measure, task): (&str, &str)| by_participant(runs.iter().filter(|run| run.task == task), measure);
    let features: Vec<_> = measures_and_tasks(protocol).map(of).collect();
    let participants: BTreeMap<&str, usize> = runs.iter().map(|run| (run.participant.as_str(), run.group)).collect();
    let row = |(code, group)| {
        let row = features.iter().map(|values| Some(mean(values.get(code)?))).collect::<Option<Vec<f64>>>()?;
        Some((group, row))
    };
    let (groups, rows): (Vec<usize>, Vec<Vec<f64>>) = participants.into_iter().filter_map(row).unzip();
    (classify(&rows, &groups, protocol.statistics.draws.min(999), protocol.seed), groups)
}

fn outliers(protocol: &Protocol, runs: &[&Run]) -> Vec<Outlier> {
    let mut found = Vec::new();
    for (measure, task) in measures_and_tasks(protocol) {
        for group in 0..protocol.groups.len() {
            let of = runs.iter().filter(|run| run.group == group && run.task == task);
            let values: Vec<(&Run, f64)> =
                of.filter_map(|run| Some((*run, *run.scores.get(measure).filter(|v| v.is_finite())?))).collect();
            let z = modified_z(&values.iter().map(|(_, value)| *value).collect::<Vec<_>>());
            found.extend(values.into_iter().zip(z).filter(|(_, z)| z.abs() > OUTLIER_Z).map(|((run, value), z)| {
                let (session, participant) = (run.session.clone(), run.participant.clone());
                Outlier { session, participant, task: task.into(), measure: measure.into(), value, modified_z: z }
            }));
        }
    }
    found
}

#[cfg(test)]
mod tests {
    use super::super::simulate::draw;
    use super::*;

    fn protocol(novice: &str, attempts: usize) -> Protocol {
        let text = format!(
            "title = 't'\nquestion = 'q'\nconsent = 'c'\nseed = 1\nstatistics = {{ draws = 999 }}\n\
             [[groups]]\nname = 'novices'\ncode = 'N'\nparticipants = 20\nsimulated = {{ {novice} }}\n\
             [[groups]]\nname = 'experts'\ncode = 'E'\nparticipants = 20\n\
             [[tasks]]\nname = 'through'\nattempts = {attempts}\n\
             [[measures]]\nscore = 'plunge_mm'\n[[measures]]\nscore = 'path_mm'\n[[measures]]\nscore = 'drilling_s'\n"
        );
        toml::from_str(&text).unwrap()
    }

    /// Of seeds 1 to `count`, how many give a finding.
    fn findings(protocol: &Protocol, count: u64) -> usize {
        let found = |seed: &u64| {
            let results =
                analyse(&Protocol { seed: *seed, ..protocol.clone() }, &draw(protocol, *seed), &Answers::new());
            results.findings.len() == 3 && results.findings.iter().any(|finding| finding.found)
        };
        (1..=count).filter(found).count()
    }

    #[test]
    fn two_equal_groups_give_no_finding_in_95_of_100_seeds() {
        let mut equal = protocol("", 3);
        let found = findings(&equal, 100);
        assert!(found <= 5, "{found} of 100 at {}", equal.statistics.alpha);
        // At 0.05 five are expected, with a standard deviation of 2.2: the level is what it says.
        equal.statistics.alpha = 0.05;
        let found = findings(&equal, 100);
        assert!((1..=11).contains(&found), "{found} of 100 at 0.05");
    }

    #[test]
    fn a_true_difference_is_found() {
        let found = findings(&protocol("level = 1.4", 3), 40);
        assert!(found >= 36, "{found} of 40");
        let apart = protocol("level = 1.4", 8);
        let results = analyse(&apart, &draw(&apart, 1), &Answers::new());
        assert!(results.simulated && results.laws.len() == 6 && results.reliability.len() == 3);
        let law = results.laws[0].is.law;
        assert!(law.gain > 0.0 && law.r_squared > 0.7, "{law:?}");
        assert!(results.classified.unwrap().accuracy > 0.7);
    }
}
