//! Computes a study's results from its runs and answers.
//!
//! # Practice
//! A participant counts once in a comparison, by the mean over attempts. Incomplete recordings are
//! left out; outliers are not. All comparisons of a study are one family of Holm's correction, so that
//! the chance of any false finding is below the protocol's level.

use super::check::Answers;
use super::plan::{letter, plan};
use super::protocol::{Protocol, Scale};
use super::results::{Attempt, Finding, Law, Outlier, Reliable, Results};
use super::runs::Run;
use crate::statistics::{
    Classified, Comparison, OUTLIER_Z, classify, compare, compare_paired, fit_power_law, holm, mean, modified_z,
    quantile, reliability, variance,
};
use fastrand::Rng;
use std::collections::BTreeMap;

/// Samples of participants for the interval of a learning rate; numerical.
const LEARNING_DRAWS: usize = 299;

/// Results of a study.
pub fn analyse(protocol: &Protocol, runs: &[Run], answers: &Answers) -> Results {
    let whole: Vec<&Run> = runs.iter().filter(|run| run.complete).collect();
    let mut findings = between_groups(protocol, &whole);
    findings.extend(between_conditions(protocol, &whole));
    findings.extend(of_answers(protocol, answers));
    let adjusted = holm(&findings.iter().map(|finding| finding.comparison.p).collect::<Vec<_>>());
    for (finding, adjusted) in findings.iter_mut().zip(adjusted) {
        let Comparison { g_low, g_high, .. } = finding.comparison;
        finding.p_holm = adjusted;
        finding.found = adjusted < protocol.alpha && (g_low > 0.0 || g_high < 0.0);
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

fn pairs(count: usize) -> impl Iterator<Item = (usize, usize)> {
    (0..count).flat_map(move |a| (a + 1..count).map(move |b| (a, b)))
}

fn finding(measure: &str, task: &str, [first, second]: [String; 2], paired: bool, comparison: Comparison) -> Finding {
    let (measure, task) = (measure.into(), task.into());
    Finding { measure, task, first, second, paired, comparison, p_holm: 1.0, found: false }
}

fn between_groups(protocol: &Protocol, runs: &[&Run]) -> Vec<Finding> {
    let mut found = Vec::new();
    for (measure, task) in measures_and_tasks(protocol) {
        for (a, b) in pairs(protocol.groups.len()) {
            let means = |group: usize| -> Vec<f64> {
                let of = runs.iter().filter(|run| run.group == group && run.task == task);
                by_participant(of, measure).values().map(|values| mean(values)).collect()
            };
            let sides = [a, b].map(|group| protocol.groups[group].name.clone());
            let seed = protocol.seed ^ found.len() as u64;
            let comparison = compare(&means(a), &means(b), protocol.draws, seed);
            found.extend(comparison.map(|comparison| finding(measure, task, sides, false, comparison)));
        }
    }
    found
}

fn measures_and_tasks(protocol: &Protocol) -> impl Iterator<Item = (&str, &str)> {
    let tasks = |score| protocol.tasks.iter().map(move |task| (score, task.name.as_str()));
    protocol.measures.iter().flat_map(move |measure| tasks(measure.score.as_str()))
}

fn between_conditions(protocol: &Protocol, runs: &[&Run]) -> Vec<Finding> {
    let mut found = Vec::new();
    for (measure, task) in measures_and_tasks(protocol) {
        for (a, b) in pairs(protocol.conditions.len()) {
            let sides = [a, b].map(letter);
            let of = |side: &String| {
                let of = runs.iter().filter(|run| run.task == task && run.condition.as_ref() == Some(side));
                by_participant(of, measure)
            };
            let (first, second) = (of(&sides[0]), of(&sides[1]));
            let both = first.iter().filter_map(|(code, a)| Some([mean(a), mean(second.get(code)?)]));
            let seed = protocol.seed ^ 0x100 ^ found.len() as u64;
            let comparison = compare_paired(&both.collect::<Vec<_>>(), protocol.draws, seed);
            found.extend(comparison.map(|comparison| finding(measure, task, sides, true, comparison)));
        }
    }
    found
}

/// Answers by item, and the raw TLX as the mean of its items.
fn of_answers(protocol: &Protocol, answers: &Answers) -> Vec<Finding> {
    let items = |scale: Scale| protocol.questions.iter().filter(move |q| q.scale == scale).map(|q| q.item.as_str());
    let mut scales: Vec<(&str, Vec<&str>)> = items(Scale::Likert).map(|item| (item, vec![item])).collect();
    let tlx: Vec<&str> = items(Scale::NasaTlx).collect();
    if !tlx.is_empty() {
        scales.push(("raw NASA-TLX", tlx));
    }
    let value = |code: &str, condition: &str, items: &[&str]| -> Option<f64> {
        let key = |item: &&str| (code.to_owned(), condition.to_owned(), (**item).to_owned());
        let values: Option<Vec<f64>> = items.iter().map(|item| answers.get(&key(item)).copied()).collect();
        Some(mean(&values?))
    };
    let plan = plan(protocol);
    let mut found = Vec::new();
    for (name, items) in &scales {
        let seed = protocol.seed ^ 0x200 ^ found.len() as u64;
        for (a, b) in pairs(protocol.conditions.len()) {
            let sides = [a, b].map(letter);
            let both = plan.participants.iter().filter_map(|participant| {
                Some([value(&participant.code, &sides[0], items)?, value(&participant.code, &sides[1], items)?])
            });
            let comparison = compare_paired(&both.collect::<Vec<_>>(), protocol.draws, seed);
            found.extend(comparison.map(|comparison| finding(name, "", sides, true, comparison)));
        }
        for (a, b) in pairs(if protocol.conditions.is_empty() { protocol.groups.len() } else { 0 }) {
            let of = |group: usize| -> Vec<f64> {
                let codes = plan.participants.iter().filter(|participant| participant.group == group);
                codes.filter_map(|participant| value(&participant.code, "", items)).collect()
            };
            let sides = [a, b].map(|group| protocol.groups[group].name.clone());
            let comparison = compare(&of(a), &of(b), protocol.draws, seed);
            found.extend(comparison.map(|comparison| finding(name, "", sides, false, comparison)));
        }
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

/// Attempt, mean over participants, standard error.
fn means_of(participants: &[&BTreeMap<usize, f64>]) -> Vec<(f64, f64, f64)> {
    let mut by_attempt = BTreeMap::<usize, Vec<f64>>::new();
    for (attempt, value) in participants.iter().flat_map(|participant| participant.iter()) {
        by_attempt.entry(*attempt).or_default().push(*value);
    }
    let row = |(attempt, values): (usize, Vec<f64>)| {
        (attempt as f64, mean(&values), (variance(&values) / values.len() as f64).sqrt())
    };
    by_attempt.into_iter().map(row).collect()
}

fn learning(protocol: &Protocol, runs: &[&Run]) -> (Vec<Attempt>, Vec<Law>) {
    let (mut rows, mut laws) = (Vec::new(), Vec::new());
    for (measure, task) in measures_and_tasks(protocol) {
        for (number, group) in protocol.groups.iter().enumerate() {
            let participants = by_attempt(runs, measure, task, Some(number));
            let means = means_of(&participants.iter().collect::<Vec<_>>());
            let points = |means: &[(f64, f64, f64)]| means.iter().map(|(at, mean, _)| (*at, *mean)).collect::<Vec<_>>();
            let about = || (measure.to_owned(), task.to_owned(), group.name.clone());
            rows.extend(means.iter().map(|(attempt, mean, standard_error)| {
                let (measure, task, group) = about();
                let attempt = *attempt as usize;
                Attempt { measure, task, group, attempt, mean: *mean, standard_error: *standard_error }
            }));
            let Some(law) = fit_power_law(&points(&means)) else { continue };
            let mut rng = Rng::with_seed(protocol.seed ^ 0x300 ^ laws.len() as u64);
            let rate = |_| {
                let drawn = (0..participants.len()).map(|_| &participants[rng.usize(..participants.len())]);
                Some(fit_power_law(&points(&means_of(&drawn.collect::<Vec<_>>())))?.rate)
            };
            let mut rates: Vec<f64> = (0..LEARNING_DRAWS).filter_map(rate).collect();
            let [rate_low, rate_high] = [0.025, 0.975].map(|share| quantile(&mut rates, share));
            let (measure, task, group) = about();
            laws.push(Law { measure, task, group, law, rate_low, rate_high });
        }
    }
    (rows, laws)
}

/// Reliability over the later half of the attempts, where learning has slowed; of two, both.
fn reliabilities(protocol: &Protocol, runs: &[&Run]) -> Vec<Reliable> {
    let of = |(measure, task): (&str, &str)| {
        let all = protocol.tasks.iter().find(|known| known.name == task)?.attempts;
        let first = if all <= 3 { 1 } else { all / 2 + 1 };
        let participants = by_attempt(runs, measure, task, None);
        let row = |of: &BTreeMap<usize, f64>| (first..=all).map(|attempt| of.get(&attempt).copied()).collect();
        let rows: Vec<Vec<f64>> = participants.iter().filter_map(row).collect();
        Some(Reliable { measure: measure.into(), task: task.into(), reliability: reliability(&rows)? })
    };
    measures_and_tasks(protocol).filter_map(of).collect()
}

/// Tells the groups apart by the participants' means of all measures in all tasks.
fn classification(protocol: &Protocol, runs: &[&Run]) -> (Option<Classified>, Vec<usize>) {
    let mut rows = BTreeMap::<&str, (usize, Vec<f64>)>::new();
    let features: Vec<(&str, &str)> = measures_and_tasks(protocol).collect();
    for run in runs {
        rows.entry(&run.participant).or_insert((run.group, vec![f64::NAN; features.len()]));
    }
    for (at, (measure, task)) in features.iter().enumerate() {
        for (code, values) in by_participant(runs.iter().filter(|run| run.task == *task), measure) {
            if let Some((_, row)) = rows.get_mut(code) {
                row[at] = mean(&values);
            }
        }
    }
    rows.retain(|_, (_, row)| row.iter().all(|value| value.is_finite()));
    let (groups, rows): (Vec<usize>, Vec<Vec<f64>>) = rows.into_values().unzip();
    (classify(&rows, &groups, protocol.draws.min(999), protocol.seed), groups)
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

    fn protocol(novice: &str) -> Protocol {
        let text = format!(
            "title = 't'\nquestion = 'q'\nconsent = 'c'\nseed = 1\ndraws = 999\n\
             [[groups]]\nname = 'novices'\ncode = 'N'\nparticipants = 20\nsimulated = {{ {novice} }}\n\
             [[groups]]\nname = 'experts'\ncode = 'E'\nparticipants = 20\n\
             [[tasks]]\nname = 'through'\nattempts = 8\n\
             [[measures]]\nscore = 'plunge_mm'\n[[measures]]\nscore = 'path_mm'\n[[measures]]\nscore = 'drilling_s'\n"
        );
        toml::from_str(&text).unwrap()
    }

    #[test]
    fn two_equal_groups_give_no_finding_in_95_of_100_seeds() {
        let equal = protocol("");
        let silent = (1..=100)
            .filter(|seed| {
                let results =
                    analyse(&Protocol { seed: *seed, ..equal.clone() }, &draw(&equal, *seed), &Answers::new());
                assert_eq!(results.findings.len(), 3);
                !results.findings.iter().any(|finding| finding.found)
            })
            .count();
        assert!(silent >= 95, "{silent} of 100 seeds gave no finding");
    }

    #[test]
    fn a_true_difference_is_found_with_the_planned_power() {
        // The mean of a participant has a spread of about 0.22 of its level, so 1.3 times is 1.2 to 1.5.
        let apart = protocol("level = 1.3");
        let found = (1..=40)
            .filter(|seed| {
                let results = analyse(&apart, &draw(&apart, *seed), &Answers::new());
                results.findings.iter().any(|finding| finding.found && finding.comparison.g > 0.0)
            })
            .count();
        assert!(found >= 36, "{found} of 40");
        let results = analyse(&apart, &draw(&apart, 1), &Answers::new());
        assert!(results.simulated && results.laws.len() == 6 && results.reliability.len() == 3);
        let law = results.laws[0].law;
        assert!(law.gain > 0.0 && law.r_squared > 0.7, "{law:?}");
        assert!(results.classified.unwrap().accuracy > 0.7);
    }
}
