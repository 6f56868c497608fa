//! Measured cost and error of each choice: tables in `rows/*.csv`.
//!
//! # Practice
//! A line is a choice with the power laws of its error and cost; the README names the command that
//! measures them again. A caller's own rows go to [`plan_with`](crate::plan_with).

use crate::power_law::FEATURES;
use crate::{Bone, Picture, PlanError, PowerLaw, Scene, Tissue};

/// Numbers of a power law in a table.
const LAW: usize = FEATURES + 3;

/// One choice with its power laws.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Row<T> {
    /// The choice.
    pub what: T,
    /// Its error: mm of depth on bone, mm of displacement in tissue, percent of white in the
    /// picture.
    pub error: PowerLaw,
    /// Its cost relative to the matching time in [`Machine`](crate::Machine).
    /// The unit is a tick; a tetrahedron and step of the expected length, sleeping ones included;
    /// or a pixel of the full picture.
    pub cost: PowerLaw,
    /// How wrong a tool's force on tissue is; known where the case was measured.
    pub force: Option<TissueForce>,
}

/// How wrong a tool's force on tissue is, in one case.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TissueForce {
    /// Error of the force, N.
    pub error_n: f64,
    /// The force, N.
    pub force_n: f64,
}

impl TissueForce {
    /// Error that a scene's tolerances allow, N.
    pub fn allowed_n(&self, scene: &Scene) -> f64 {
        scene.tissue_force_n.max(scene.tissue_force_share * self.force_n)
    }
}

/// All available choices.
#[derive(Clone, Debug, PartialEq)]
pub struct Rows {
    /// Ways to represent bone.
    pub bone: Vec<Row<Bone>>,
    /// Ways to represent tissue.
    pub tissue: Vec<Row<Tissue>>,
    /// Ways to draw.
    pub picture: Vec<Row<Picture>>,
}

impl Rows {
    /// The stored rows.
    ///
    /// # Errors
    /// When a stored table cannot be parsed, which a test excludes.
    pub fn stored() -> Result<Self, PlanError> {
        Ok(Self {
            bone: read(include_str!("../rows/bone.csv"))?,
            tissue: read(include_str!("../rows/tissue.csv"))?,
            picture: read(include_str!("../rows/picture.csv"))?,
        })
    }
}

/// A kind of choice in a table.
pub trait Kind: Copy + Sized {
    /// Name of the table.
    const TABLE: &'static str;
    /// Its key columns.
    const KEYS: &'static [&'static str];
    /// The features of its power laws.
    const FEATURES: [&'static str; FEATURES];

    /// Parses the key columns; `None` if they are invalid.
    fn read(keys: &[&'static str]) -> Option<Self>;

    /// Formats the key columns.
    fn write(&self) -> Vec<String>;
}

/// Parses a table.
///
/// # Errors
/// Names the table and the line that cannot be read.
pub fn read<T: Kind>(table: &'static str) -> Result<Vec<Row<T>>, PlanError> {
    let wrong = |line: usize, fault: String| PlanError::Table { table: T::TABLE, line: line + 1, fault };
    let mut lines = table.lines().enumerate();
    match lines.next() {
        Some((_, head)) if head == header::<T>() => {}
        _ => return Err(wrong(0, format!("expected the columns {}", header::<T>()))),
    }
    let row = |(line, text): (usize, &'static str)| {
        let fields: Vec<&'static str> = text.split(',').collect();
        let expected = T::KEYS.len() + 2 * LAW;
        if fields.len() != expected {
            return Err(wrong(line, format!("{} fields, expected {expected}", fields.len())));
        }
        let (keys, laws) = fields.split_at(T::KEYS.len());
        let what = T::read(keys).ok_or_else(|| wrong(line, format!("no choice: {}", keys.join(","))))?;
        let law =
            |from: &[&str]| law(from).ok_or_else(|| wrong(line, format!("not {LAW} numbers: {}", from.join(","))));
        Ok(Row { what, error: law(&laws[..LAW])?, cost: law(&laws[LAW..])?, force: None })
    };
    lines.map(row).collect()
}

/// Formats a table of rows.
pub fn write<T: Kind>(rows: &[Row<T>]) -> String {
    let mut text = header::<T>() + "\n";
    for row in rows {
        let laws = [row.error, row.cost]
            .into_iter()
            .flat_map(numbers)
            .map(|n| format!("{:.4}", (n * 1e4).round() / 1e4 + 0.0));
        text += &row.what.write().into_iter().chain(laws).collect::<Vec<_>>().join(",");
        text += "\n";
    }
    text
}

fn header<T: Kind>() -> String {
    let law = |of: &str| {
        let [a, b, c] = T::FEATURES;
        [format!("{of}_1"), format!("{of}_{a}"), format!("{of}_{b}"), format!("{of}_{c}")]
            .into_iter()
            .chain([format!("{of}_spread"), format!("{of}_bound")])
            .collect::<Vec<_>>()
            .join(",")
    };
    format!("{},{},{}", T::KEYS.join(","), law("error"), law("cost"))
}

fn numbers(law: PowerLaw) -> [f64; LAW] {
    let [a, b, c, d] = law.weights;
    [a, b, c, d, law.spread, law.bound]
}

fn law(fields: &[&str]) -> Option<PowerLaw> {
    let numbers: Vec<f64> = fields.iter().map(|field| field.parse().ok()).collect::<Option<_>>()?;
    let [a, b, c, d, spread, bound] = numbers[..] else { return None };
    Some(PowerLaw { weights: [a, b, c, d], spread, bound })
}

impl Kind for Bone {
    const TABLE: &'static str = "bone.csv";
    const KEYS: &'static [&'static str] = &["method", "spacing_mm", "points"];
    const FEATURES: [&'static str; FEATURES] = ["radius", "press", "finest"];

    fn read(keys: &[&'static str]) -> Option<Self> {
        let [method, spacing, points] = keys else { return None };
        Some(Self { method, spacing_mm: spacing.parse().ok()?, points: points.parse().ok()? })
    }

    fn write(&self) -> Vec<String> {
        vec![self.method.into(), self.spacing_mm.to_string(), self.points.to_string()]
    }
}

impl Kind for Tissue {
    const TABLE: &'static str = "tissue.csv";
    const KEYS: &'static [&'static str] = &["solver", "tets", "halvings"];
    const FEATURES: [&'static str; FEATURES] = ["motion", "radius", "volume"];

    fn read(keys: &[&'static str]) -> Option<Self> {
        let [solver, tets, halvings] = keys else { return None };
        Some(Self { solver, tets: tets.parse().ok()?, halvings: halvings.parse().ok()? })
    }

    fn write(&self) -> Vec<String> {
        vec![self.solver.into(), self.tets.to_string(), self.halvings.to_string()]
    }
}

impl Kind for Picture {
    const TABLE: &'static str = "picture.csv";
    const KEYS: &'static [&'static str] = &["rays", "detail"];
    const FEATURES: [&'static str; FEATURES] = ["pixel", "view", "finest"];

    fn read(keys: &[&'static str]) -> Option<Self> {
        let [rays, detail] = keys else { return None };
        let sparse = match *rays {
            "sparse" => true,
            "every" => false,
            _ => return None,
        };
        Some(Self { sparse, detail: detail.parse().ok()? })
    }

    fn write(&self) -> Vec<String> {
        vec![if self.sparse { "sparse" } else { "every" }.into(), self.detail.to_string()]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Quality;

    /// Every stored method exists, no choice is repeated, and every preset is stored.
    #[test]
    fn the_stored_rows_are_consistent() {
        let rows = Rows::stored().unwrap();
        for setup in Quality::ALL.into_iter().filter_map(Quality::preset) {
            assert_eq!(rows.bone.iter().filter(|row| row.what == setup.bone).count(), 1, "{}", setup.bone);
            assert_eq!(rows.tissue.iter().filter(|row| row.what == setup.tissue).count(), 1, "{}", setup.tissue);
            assert_eq!(rows.picture.iter().filter(|row| row.what == setup.picture).count(), 1, "{}", setup.picture);
        }
        assert!(rows.picture.iter().any(|row| row.error.at_most(&[0.0; 3]) == 0.0), "the exact picture is exact");
    }

    #[test]
    fn a_table_that_is_written_is_read_again() {
        let rows = Rows::stored().unwrap();
        assert_eq!(write(&rows.bone), include_str!("../rows/bone.csv"));
        assert_eq!(write(&rows.tissue), include_str!("../rows/tissue.csv"));
        assert_eq!(write(&rows.picture), include_str!("../rows/picture.csv"));
    }

    #[test]
    fn a_bad_table_is_refused_by_line() {
        let fault = |table| read::<Picture>(table).unwrap_err().to_string();
        assert!(fault("a,b\n").contains("picture.csv, line 1: expected the columns rays,detail"));
        let table = |line: &str| &*Box::leak(format!("{}\n{line}\n", header::<Picture>()).into_boxed_str());
        assert!(fault(table("every,1")).contains("line 2: 2 fields, expected 14"));
        assert!(fault(table("few,1,0,0,0,0,0,0,0,0,0,0,0,0")).contains("no choice: few,1"));
        assert!(fault(table("every,1,0,x,0,0,0,0,0,0,0,0,0,0")).contains("not 6 numbers"));
    }
}
