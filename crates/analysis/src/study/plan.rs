//! Participants with their codes and orders, the blinding, and how many participants are needed.

use super::protocol::{Order, Protocol, Question, Statistics};
use crate::files::whole;
use crate::statistics::{Design, participants_needed, power};
use anyhow::Result;
use fastrand::Rng;
use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::path::Path;

/// A participant.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Participant {
    /// Code, such as N07.
    pub code: String,
    /// Number of the group.
    pub group: usize,
    /// Order: letters of blinded conditions, or names of tasks.
    pub order: Vec<String>,
}

/// A study's plan.
#[derive(Clone, Debug)]
pub struct Plan {
    /// All participants.
    pub participants: Vec<Participant>,
    /// Number of the condition behind each letter, from A on.
    pub key: Vec<usize>,
}

/// Letter of a blinded condition.
pub(super) fn letter(at: usize) -> String {
    char::from(b'A' + at as u8).to_string()
}

/// Plans a study; the same by the same seed.
pub fn plan(protocol: &Protocol) -> Plan {
    let mut rng = Rng::with_seed(protocol.seed);
    let mut key: Vec<usize> = (0..protocol.conditions.len()).collect();
    rng.shuffle(&mut key);
    let names: Vec<String> = match key.len() {
        0 => protocol.tasks.iter().map(|task| task.name.clone()).collect(),
        count => (0..count).map(letter).collect(),
    };
    let square = square(protocol.order, names.len());
    let mut participants = Vec::new();
    for (number, group) in protocol.groups.iter().enumerate() {
        // Each group has every row as often, in a random order.
        let mut rows: Vec<usize> = Vec::new();
        while rows.len() < group.participants {
            let mut block: Vec<usize> = (0..square.len()).collect();
            rng.shuffle(&mut block);
            rows.extend(block);
        }
        let digits = group.participants.to_string().len().max(2);
        participants.extend((0..group.participants).map(|at| Participant {
            code: format!("{}{:0digits$}", group.code, at + 1),
            group: number,
            order: square[rows[at]].iter().map(|place| names[*place].clone()).collect(),
        }));
    }
    Plan { participants, key }
}

/// A square of orders of `count` things. A Williams square of an odd number has twice the rows:
/// each order also backwards.
fn square(order: Order, count: usize) -> Vec<Vec<usize>> {
    // Williams' first row: 0, 1, n-1, 2, n-2...
    let williams = |at: usize| {
        if at == 0 {
            0
        } else if at % 2 == 1 {
            at.div_ceil(2)
        } else {
            count - at / 2
        }
    };
    let first: Vec<usize> = match order {
        Order::Latin => (0..count).collect(),
        Order::Williams => (0..count).map(williams).collect(),
    };
    let rows = (0..count).map(|shift| first.iter().map(|place| (place + shift) % count).collect::<Vec<_>>());
    let mut rows: Vec<Vec<usize>> = rows.collect();
    if order == Order::Williams && count % 2 == 1 && count > 1 {
        let backwards: Vec<Vec<usize>> = rows.iter().map(|row| row.iter().rev().copied().collect()).collect();
        rows.extend(backwards);
    }
    rows
}

impl Plan {
    /// The participants as CSV: code, group, order.
    pub fn participants_csv(&self, protocol: &Protocol) -> String {
        let mut csv = "participant,group,order\n".to_owned();
        for Participant { code, group, order } in &self.participants {
            _ = writeln!(csv, "{code},{},{}", protocol.groups[*group].name.replace(',', " "), order.join(" "));
        }
        csv
    }

    /// Name of the condition behind each letter.
    pub fn names(&self, protocol: &Protocol) -> BTreeMap<String, String> {
        let name = |(at, condition): (usize, &usize)| (letter(at), protocol.conditions[*condition].name.clone());
        self.key.iter().enumerate().map(name).collect()
    }

    /// Writes `participants.csv`, `consent.txt`, `answers.csv` to fill in and, with conditions,
    /// `key.csv` and a file of settings for each letter.
    pub fn write(&self, protocol: &Protocol, folder: &Path) -> Result<()> {
        whole(&folder.join("participants.csv"), self.participants_csv(protocol).as_bytes())?;
        whole(&folder.join("consent.txt"), protocol.consent.trim_start().as_bytes())?;
        let answers = folder.join("answers.csv");
        if !answers.exists() && !protocol.questions.is_empty() {
            whole(&answers, self.answers_csv(protocol, |_, _| String::new()).as_bytes())?;
        }
        if self.key.is_empty() {
            return Ok(());
        }
        let lines = self.names(protocol).into_iter().map(|(letter, name)| format!("{letter},{name}\n"));
        whole(&folder.join("key.csv"), ("condition,name\n".to_owned() + &lines.collect::<String>()).as_bytes())?;
        for (at, condition) in self.key.iter().enumerate() {
            let settings = protocol.conditions[*condition].set.join("\n") + "\n";
            whole(&folder.join(format!("condition-{}.txt", letter(at))), settings.as_bytes())?;
        }
        Ok(())
    }

    /// `answers.csv`, with an answer of each participant's code to each question.
    pub fn answers_csv(&self, protocol: &Protocol, mut answer: impl FnMut(&str, &Question) -> String) -> String {
        let mut csv = "participant,condition,item,value\n".to_owned();
        for participant in &self.participants {
            let conditions = if self.key.is_empty() { vec![String::new()] } else { participant.order.clone() };
            for condition in conditions {
                for question in &protocol.questions {
                    let (code, value) = (&participant.code, answer(&participant.code, question));
                    _ = writeln!(csv, "{code},{condition},{},{value}", question.item);
                }
            }
        }
        csv
    }
}

/// The power of the study as lines of text.
pub fn power_lines(protocol: &Protocol) -> String {
    let Statistics { effect, alpha, power: wanted, .. } = protocol.statistics;
    let mut lines = String::new();
    let mut line = |design, n: usize, what: &str, unit: &str| {
        let reached = power(design, effect, n, alpha);
        let needed = participants_needed(design, effect, wanted, alpha).map_or("over 100000".into(), |n| n.to_string());
        _ = writeln!(
            lines,
            "{what}: {n} {unit} find an effect of {effect} standard deviations at {alpha} with power {reached:.3}; \
             {wanted} needs {needed}"
        );
    };
    let smallest = protocol.groups.iter().map(|group| group.participants).min().unwrap_or(0);
    if protocol.groups.len() > 1 {
        line(Design::Groups, smallest, "groups", "participants in the smallest group");
    }
    if protocol.conditions.len() > 1 {
        let all = protocol.groups.iter().map(|group| group.participants).sum();
        line(Design::Pairs, all, "conditions", "participants");
    }
    lines += "one comparison; with more, Holm's correction needs more participants\n";
    lines
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn squares_are_balanced() {
        for count in 2..=7 {
            for order in [Order::Latin, Order::Williams] {
                let rows = square(order, count);
                let each = rows.len() / count;
                for place in 0..count {
                    for thing in 0..count {
                        assert_eq!(rows.iter().filter(|row| row[place] == thing).count(), each, "{order:?} {count}");
                    }
                }
                if order == Order::Williams {
                    for (a, b) in (0..count).flat_map(|a| (0..count).map(move |b| (a, b))).filter(|(a, b)| a != b) {
                        let follows = rows.iter().flat_map(|row| row.windows(2)).filter(|pair| **pair == [a, b]);
                        assert_eq!(follows.count(), each, "{b} after {a} of {count}");
                    }
                }
            }
        }
    }
}
