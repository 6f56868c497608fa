//! Finds the nearest failure of a method: the smallest change of one condition that breaks it.
//!
//! # Theory
//! A condition c has a nominal value c₀ and limits. A change is measured in octaves,
//! ```text
//! t = log₂(c / c₀),   for Poisson's ratio   t = log₂((½ - ν) / (½ - ν₀))
//! ```
//! since ½ - ν is what the bulk modulus grows with. From t = 0 trials go outwards by equal steps in
//! both directions; the first that fails is bisected against the last that works until the two are
//! 5 % apart.
//!
//! # Practice
//! A method that works again beyond its first failure is reported with the first one. A failure
//! narrower than a step may be missed. A panic and a value that is not a number fail.

use std::panic::{AssertUnwindSafe, catch_unwind};

/// Ratio of the failing to the last working value at which bisection ends.
pub const RESOLUTION: f64 = 1.05;

/// Whether a value is over a limit or not a number.
pub fn exceeds(value: f64, limit: f64) -> bool {
    value.is_nan() || value > limit
}

/// How a condition is counted.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Scale {
    /// By its logarithm.
    Log,
    /// By its logarithm, in whole numbers.
    Whole,
    /// By the logarithm of its distance from ½: Poisson's ratio.
    BelowHalf,
}

impl Scale {
    fn value(self, nominal: f64, octaves: f64) -> f64 {
        let factor = octaves.exp2();
        match self {
            Self::Log => nominal * factor,
            Self::Whole => (nominal * factor).round(),
            Self::BelowHalf => 0.5 - (0.5 - nominal) * factor,
        }
    }

    /// Factor by which the counted quantity differs from its nominal value.
    fn factor(self, nominal: f64, value: f64) -> f64 {
        match self {
            Self::Log | Self::Whole => value / nominal,
            Self::BelowHalf => (0.5 - value) / (0.5 - nominal),
        }
    }
}

/// A quantity that is changed alone, and the trial of a method of type `M` at one of its values.
pub struct Condition<M> {
    /// Name.
    pub name: &'static str,
    /// Unit; "1" for a ratio.
    pub unit: &'static str,
    /// Value at which a session works.
    pub nominal: f64,
    /// Lowest and highest value that are tried.
    pub limits: [f64; 2],
    /// How it is counted.
    pub scale: Scale,
    /// Names of the trace's axes, with units.
    pub axes: [&'static str; 2],
    /// Runs the method at a value.
    pub trial: fn(&M, f64) -> Trial,
}

/// What a method did at one value of a condition.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Trial {
    /// Why it failed; `None` if it worked.
    pub fault: Option<String>,
    /// What was recorded on the way.
    pub trace: Vec<(f64, f64)>,
}

/// A trial with the value of its condition.
#[derive(Clone, Debug, PartialEq)]
pub struct Tried {
    /// Value of the condition.
    pub value: f64,
    /// What was recorded.
    pub trace: Vec<(f64, f64)>,
}

/// The nearest failure under one condition.
#[derive(Clone, Debug, PartialEq)]
pub struct Failure {
    /// The failing trial.
    pub at: Tried,
    /// Factor from the nominal value; 1 for a method that fails as it stands.
    pub factor: f64,
    /// How it fails.
    pub fault: String,
    /// The working trial next to it; `None` for a method that fails as it stands.
    pub works: Option<Tried>,
}

impl<M> Condition<M> {
    /// The condition with limits no further than some octaves from its nominal value.
    pub fn within(&self, octaves: f64) -> Self {
        let ends = [-octaves, octaves].map(|t| self.scale.value(self.nominal, t));
        let [low, high] = [ends[0].min(ends[1]), ends[0].max(ends[1])];
        Self { limits: [self.limits[0].max(low), self.limits[1].min(high)], ..*self }
    }

    /// The nearest failure of a method, or `None` between the limits. `step` is the distance
    /// between trials on the way outwards, octaves.
    pub fn nearest(&self, method: &M, step: f64) -> Option<Failure> {
        let start = match self.tried(method, self.nominal) {
            Ok(works) => works,
            Err((at, fault)) => return Some(Failure { at, factor: 1.0, fault, works: None }),
        };
        let octaves = |value: f64| self.scale.factor(self.nominal, value).log2();
        let reach = self.limits.map(octaves);
        let reach = [reach[0].min(reach[1]).min(0.0), reach[0].max(reach[1]).max(0.0)];
        let mut works = [(0.0, start.clone()), (0.0, start)];
        let mut distance = 0.0;
        while works[0].0 > reach[0] || works[1].0 < reach[1] {
            distance += step;
            let mut found: Vec<Failure> = Vec::new();
            for (side, works) in works.iter_mut().enumerate() {
                let next = if side == 0 { (-distance).max(reach[0]) } else { distance.min(reach[1]) };
                // A whole number may round to the one before.
                let value = self.scale.value(self.nominal, next);
                if next == works.0 || value == works.1.value {
                    works.0 = next;
                    continue;
                }
                match self.tried(method, value) {
                    Ok(tried) => *works = (next, tried),
                    Err(failed) => found.push(self.bisected(method, works.clone(), (next, failed))),
                }
            }
            if let Some(nearest) = found.into_iter().min_by(|a, b| a.octaves().total_cmp(&b.octaves())) {
                return Some(nearest);
            }
        }
        None
    }

    /// Narrows a failure until it is within [`RESOLUTION`] of a trial that works.
    fn bisected(&self, method: &M, mut works: (f64, Tried), mut fails: (f64, (Tried, String))) -> Failure {
        while (fails.0 - works.0).abs() > RESOLUTION.log2() {
            let middle = 0.5 * (works.0 + fails.0);
            let value = self.scale.value(self.nominal, middle);
            if value == works.1.value || value == fails.1.0.value {
                break;
            }
            match self.tried(method, value) {
                Ok(tried) => works = (middle, tried),
                Err(failed) => fails = (middle, failed),
            }
        }
        let (at, fault) = fails.1;
        let factor = self.scale.factor(self.nominal, at.value);
        Failure { at, factor, fault, works: Some(works.1) }
    }

    /// Runs a trial; the error is the failed one with its reason. A panic fails.
    fn tried(&self, method: &M, value: f64) -> Result<Tried, (Tried, String)> {
        let trial = catch_unwind(AssertUnwindSafe(|| (self.trial)(method, value)));
        let trial = trial.unwrap_or_else(|_| Trial { fault: Some("panics".into()), trace: Vec::new() });
        let tried = Tried { value, trace: trial.trace };
        trial.fault.map_or(Ok(tried.clone()), |fault| Err((tried, fault)))
    }
}

impl Failure {
    /// Size of the change, octaves; 0 for a method that fails as it stands.
    pub fn octaves(&self) -> f64 {
        self.factor.log2().abs()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn condition(nominal: f64, limits: [f64; 2], scale: Scale) -> Condition<[f64; 2]> {
        let trial = |works: &[f64; 2], value: f64| {
            assert!(value < 1000.0, "on purpose");
            let fault = (value < works[0] || value > works[1]).then(|| "outside".to_string());
            Trial { fault, trace: vec![(0.0, value)] }
        };
        Condition { name: "made up", unit: "mm", nominal, limits, scale, axes: ["x", "y"], trial }
    }

    #[test]
    fn the_nearer_of_two_failures_is_found_to_five_percent() {
        let found = condition(1.0, [1e-3, 1e3], Scale::Log).nearest(&[0.11, 40.0], 1.0).unwrap();
        assert!(found.at.value < 0.11 && found.at.value * RESOLUTION > 0.11, "{}", found.at.value);
        let works = found.works.clone().unwrap();
        assert!(works.value >= 0.11 && works.value <= found.at.value * RESOLUTION);
        assert_eq!((found.factor, found.at.trace[0].1), (found.at.value, found.at.value));
        let upwards = condition(1.0, [1.0, 1e3], Scale::Log).nearest(&[0.11, 40.0], 1.0).unwrap();
        assert!((40.0..40.0 * RESOLUTION).contains(&upwards.at.value), "{}", upwards.at.value);
    }

    #[test]
    fn limits_a_panic_and_what_fails_as_it_stands() {
        assert_eq!(condition(1.0, [0.1, 10.0], Scale::Log).nearest(&[0.01, 40.0], 1.0), None);
        let stands = condition(1.0, [0.1, 10.0], Scale::Log).nearest(&[2.0, 40.0], 1.0).unwrap();
        assert_eq!((stands.factor, stands.works), (1.0, None));
        let panics = condition(1.0, [1.0, 1e6], Scale::Log).nearest(&[0.0, 1e9], 1.0).unwrap();
        assert!(panics.fault == "panics" && (1000.0..1050.0).contains(&panics.at.value));
    }

    #[test]
    fn whole_numbers_stay_whole_and_poissons_ratio_is_counted_from_a_half() {
        let whole = condition(1.0, [0.0, 16.0], Scale::Whole);
        let found = Condition { limits: [1.0, 16.0], ..whole }.nearest(&[0.0, 5.0], 0.5).unwrap();
        assert_eq!((found.at.value, found.works.unwrap().value), (6.0, 5.0));
        let poisson = condition(0.45, [0.3, 0.4999], Scale::BelowHalf).nearest(&[0.0, 0.49], 1.0).unwrap();
        assert!(poisson.at.value > 0.49 && poisson.at.value < 0.491, "{}", poisson.at.value);
        assert!((poisson.factor - 0.2).abs() < 0.01, "{}", poisson.factor);
    }
}
