//! Power of a t-test, and how many participants a study needs.
//!
//! # Theory
//! Under an effect the t of a test has a noncentral distribution: t = (z + shift) / s, where s² is
//! chi-square over its degrees of freedom. Its tail is integrated over s. The permutation test has
//! the same power to a good approximation.
//!
//! # Sources
//! Cohen 1988, Statistical Power Analysis for the Behavioral Sciences.

use statrs::distribution::{Continuous, ContinuousCDF, Gamma, Normal, StudentsT};

/// What is compared.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Design {
    /// Two groups of the same size.
    Groups,
    /// Two conditions of each participant.
    Pairs,
}

/// Steps of the integral; numerical.
const STEPS: usize = 2000;

/// Power of a two-sided test at level `alpha` with `n` participants in each group, or `n` pairs.
/// The effect is in standard deviations, for pairs in those of the differences.
pub fn power(design: Design, effect: f64, n: usize, alpha: f64) -> f64 {
    let size = n as f64;
    let (shift, freedom) = match design {
        Design::Groups => (effect * (size / 2.0).sqrt(), 2.0 * size - 2.0),
        Design::Pairs => (effect * size.sqrt(), size - 1.0),
    };
    let (Ok(t), Ok(chi)) = (StudentsT::new(0.0, 1.0, freedom), Gamma::new(0.5 * freedom, 0.5)) else { return f64::NAN };
    let critical = t.inverse_cdf(1.0 - 0.5 * alpha);
    let normal = Normal::standard();
    // s = sqrt(chi-square / freedom); beyond eight deviations nothing is left.
    let width = 8.0 / (2.0 * freedom).sqrt();
    let (low, high) = ((1.0 - width).max(1e-6), 1.0 + width);
    let step = (high - low) / STEPS as f64;
    let found = |s: f64| {
        let density = chi.pdf(freedom * s * s) * 2.0 * freedom * s;
        density * (1.0 - normal.cdf(critical * s - shift) + normal.cdf(-critical * s - shift))
    };
    (0..STEPS).map(|at| step * found(low + (at as f64 + 0.5) * step)).sum()
}

/// Fewest participants (in each group, or pairs) for a power; `None` if 100,000 are too few.
pub fn participants_needed(design: Design, effect: f64, wanted: f64, alpha: f64) -> Option<usize> {
    let enough = |n: &usize| power(design, effect, *n, alpha) >= wanted;
    let mut high = 3;
    while !enough(&high) {
        high *= 2;
        if high > 100_000 {
            return None;
        }
    }
    (high / 2..=high).filter(|n| *n >= 3).find(enough)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sizes_are_those_of_published_tables() {
        // Cohen 1988, table 2.4.1 (two groups, two-sided 0.05, power 0.8): 393, 64 and 26.
        let groups = [0.2, 0.5, 0.8].map(|effect| participants_needed(Design::Groups, effect, 0.8, 0.05));
        assert!(
            groups[1..] == [Some(64), Some(26)] && groups[0].is_some_and(|n| (393..=394).contains(&n)),
            "{groups:?}"
        );
        // G*Power 3.1: 34 pairs for an effect of 0.5.
        assert_eq!(participants_needed(Design::Pairs, 0.5, 0.8, 0.05), Some(34));
        assert!((power(Design::Groups, 0.0, 20, 0.05) - 0.05).abs() < 1e-4);
        assert_eq!(participants_needed(Design::Groups, 0.0, 0.8, 0.05), None);
    }
}
