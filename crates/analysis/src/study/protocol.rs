//! A study's protocol, a TOML file: groups, tasks, blinded conditions, questions, measures.

use crate::files::shown;
use anyhow::{Context, Result, bail};
use serde::{Deserialize, Serialize};
use std::collections::BTreeSet;
use std::fs;
use std::path::Path;

/// A study's protocol.
#[derive(Clone, Debug, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct Protocol {
    /// Title of the pages.
    pub title: String,
    /// What the study asks.
    pub question: String,
    /// What participants read and sign before they begin.
    pub consent: String,
    /// Seed of the order, of the blinding and of what is drawn at random.
    pub seed: u64,
    /// Levels and draws of the statistics.
    #[serde(default)]
    pub statistics: Statistics,
    /// How the conditions, or else the tasks, are ordered.
    #[serde(default)]
    pub order: Order,
    /// Groups of participants.
    pub groups: Vec<Group>,
    /// Tasks of each participant.
    pub tasks: Vec<Task>,
    /// Blinded conditions; each participant has all of them.
    #[serde(default)]
    pub conditions: Vec<Condition>,
    /// Scores that are analysed.
    pub measures: Vec<Measure>,
    /// Questions after each condition, or after the study without conditions.
    #[serde(default)]
    pub questions: Vec<Question>,
}

/// Levels and draws of the statistics.
#[derive(Clone, Copy, Debug, Deserialize, Serialize)]
#[serde(default, deny_unknown_fields)]
pub struct Statistics {
    /// Level of significance, corrected over all comparisons: the chance of any false finding.
    pub alpha: f64,
    /// Power that the number of participants is planned for.
    pub power: f64,
    /// Effect that matters, in standard deviations.
    pub effect: f64,
    /// Draws of each permutation test and bootstrap.
    pub draws: usize,
}

impl Default for Statistics {
    fn default() -> Self {
        Self { alpha: 0.01, power: 0.8, effect: 0.8, draws: 9999 }
    }
}

/// How conditions or tasks are ordered.
#[derive(Clone, Copy, Debug, Default, Deserialize, Serialize, PartialEq, Eq)]
#[serde(rename_all = "lowercase")]
pub enum Order {
    /// Latin square: each at each place as often.
    Latin,
    /// Williams square: each also after each other as often (Williams 1949).
    #[default]
    Williams,
}

/// A group of participants.
#[derive(Clone, Debug, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct Group {
    /// Name on the pages.
    pub name: String,
    /// Letters that begin its participants' codes.
    pub code: String,
    /// Number of participants.
    pub participants: usize,
    /// Learning of simulated participants; only `simulate` reads it.
    #[serde(default)]
    pub simulated: Hand,
}

/// How simulated participants of a group do. A measure is `level` times its usual value times
/// (1 + `gain` × attempt^-`rate`), and differs between participants and attempts.
#[derive(Clone, Copy, Debug, Deserialize, Serialize, PartialEq)]
#[serde(default, deny_unknown_fields)]
pub struct Hand {
    /// Level after endless practice, over the usual.
    pub level: f64,
    /// What practice takes away from the first attempt on, over the level.
    pub gain: f64,
    /// Exponent of practice.
    pub rate: f64,
    /// Spread between participants, of the logarithm.
    pub between: f64,
    /// Spread between attempts, of the logarithm.
    pub within: f64,
}

impl Default for Hand {
    fn default() -> Self {
        Self { level: 1.0, gain: 1.0, rate: 0.6, between: 0.2, within: 0.2 }
    }
}

/// A task.
#[derive(Clone, Debug, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct Task {
    /// Name of the lesson (`--lesson`), or of the program for sessions without one.
    pub name: String,
    /// Attempts of each participant, in each condition.
    pub attempts: usize,
}

/// A blinded condition.
#[derive(Clone, Debug, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct Condition {
    /// Name on the pages, once the blinding is lifted.
    pub name: String,
    /// Settings of `--set`, such as `rigid=god-object-sphere`, one a line.
    pub set: Vec<String>,
}

/// A score that is analysed.
#[derive(Clone, Debug, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct Measure {
    /// Name in the table `scores`, or `strokes.per_min`, `strokes.path_mm`, `strokes.peak_mm_s`.
    pub score: String,
    /// Usual value of simulated participants; only `simulate` reads it.
    #[serde(default = "one")]
    pub usual: f64,
}

fn one() -> f64 {
    1.0
}

/// A question to participants.
#[derive(Clone, Debug, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct Question {
    /// Name of the item in `answers.csv`.
    pub item: String,
    /// What is asked.
    pub text: String,
    /// Range of the answers.
    pub scale: Scale,
}

/// Range of a question's answers.
#[derive(Clone, Copy, Debug, Deserialize, Serialize, PartialEq, Eq)]
#[serde(rename_all = "kebab-case")]
pub enum Scale {
    /// NASA-TLX: 0 to 100; the mean of the items is the raw TLX (Hart 2006).
    NasaTlx,
    /// Likert: 1 (not at all) to 7 (fully).
    Likert,
}

impl Scale {
    /// Least and greatest answer.
    pub fn range(self) -> [f64; 2] {
        match self {
            Self::NasaTlx => [0.0, 100.0],
            Self::Likert => [1.0, 7.0],
        }
    }
}

impl Protocol {
    /// Reads and checks a protocol.
    pub fn read(path: &Path) -> Result<Self> {
        let text = fs::read_to_string(path).with_context(|| format!("cannot read {}; check the name", shown(path)))?;
        let wrong = || format!("{} is no protocol; protocols/ of this crate has two to start from", shown(path));
        let protocol: Self = toml::from_str(&text).with_context(wrong)?;
        protocol.check().with_context(wrong)?;
        Ok(protocol)
    }

    fn check(&self) -> Result<()> {
        let mut codes = BTreeSet::new();
        for group in &self.groups {
            let Group { name, code, participants, .. } = group;
            if !(1..=4).contains(&code.len()) || !code.bytes().all(|byte| byte.is_ascii_uppercase()) {
                bail!("the code {code:?} of group {name:?} is not one to four letters A to Z; give such as N");
            }
            if !codes.insert(code) {
                bail!("two groups have the code {code}; give each its own");
            }
            if !(1..=9999).contains(participants) {
                bail!("group {name:?} has {participants} participants; give 1 to 9999");
            }
        }
        if self.groups.is_empty() || self.tasks.is_empty() || self.measures.is_empty() {
            bail!("it needs at least one of [[groups]], [[tasks]] and [[measures]]; add what is missing");
        }
        if self.conditions.len() == 1 || self.conditions.len() > 26 {
            bail!("{} conditions cannot be compared blinded; give none, or 2 to 26", self.conditions.len());
        }
        if let Some(task) = self.tasks.iter().find(|task| task.attempts == 0) {
            bail!("task {:?} has no attempts; give 1 or more", task.name);
        }
        let Statistics { alpha, power, effect, draws } = self.statistics;
        let shares = [("alpha", alpha), ("power", power)];
        if let Some((name, value)) = shares.iter().find(|(_, value)| !(*value > 0.0 && *value < 1.0)) {
            bail!("{name} = {value} is not between 0 and 1; usual are alpha = 0.01 and power = 0.8");
        }
        if effect.is_nan() || effect <= 0.0 || draws < 99 {
            bail!("effect = {effect}, draws = {draws}; give an effect over 0 and at least 99 draws");
        }
        if (draws as f64 + 1.0) * alpha < 10.0 {
            bail!("{draws} draws cannot show p under {alpha} in ten comparisons; give more than {:.0}", 10.0 / alpha);
        }
        Ok(())
    }

    /// The group of a planned participant's code.
    pub fn group_of(&self, code: &str) -> Option<usize> {
        let letters = code.trim_end_matches(|c: char| c.is_ascii_digit());
        let group = self.groups.iter().position(|group| group.code == letters)?;
        let participants = self.groups[group].participants;
        let digits = participants.to_string().len().max(2);
        (1..=participants).any(|n| code == format!("{letters}{n:0digits$}")).then_some(group)
    }
}
