//! Screening of inputs by elementary effects (Morris), for functions on the unit cube.
//!
//! # Theory
//! A trajectory starts at a random node of a grid of `p = 4` levels and changes one input after the
//! other, in random order, by `Δ = p/(2(p-1)) = 2/3`:
//! ```text
//! d_i = (f(x + Δ e_i) - f(x)) / Δ     μ*_i = mean |d_i|     σ_i = standard deviation of d_i
//! ```
//! μ* ranks inputs; σ near μ* or over it means that the effect depends on the other inputs.
//!
//! # Sources
//! M. D. Morris, *Factorial sampling plans for preliminary computational experiments*,
//! Technometrics 33 (1991); F. Campolongo, J. Cariboni, A. Saltelli, *An effective screening design
//! for sensitivity analysis of large models*, Environ. Model. Softw. 22 (2007): μ*.

/// Change of an input in a step of a trajectory.
const DELTA: f64 = 2.0 / 3.0;

/// Effect of one input.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Effect {
    /// Mean size of the change of the output over the whole range of the input.
    pub mean: f64,
    /// Standard deviation of the change, with its sign.
    pub deviation: f64,
}

/// Effects of `inputs` inputs on each output of `f`, by output and input. It costs
/// `trajectories (inputs + 1)` calls.
pub fn effects<const OUT: usize>(
    inputs: usize,
    trajectories: usize,
    random: &mut fastrand::Rng,
    mut f: impl FnMut(&[f64]) -> [f64; OUT],
) -> [Vec<Effect>; OUT] {
    let mut found: [Vec<Vec<f64>>; OUT] = std::array::from_fn(|_| vec![Vec::new(); inputs]);
    for _ in 0..trajectories {
        let (mut at, mut order) = (Vec::new(), (0..inputs).collect::<Vec<_>>());
        at.resize_with(inputs, || f64::from(random.u8(0..4)) / 3.0);
        random.shuffle(&mut order);
        let mut before = f(&at);
        for input in order {
            let step = if at[input] < 0.5 { DELTA } else { -DELTA };
            at[input] += step;
            let now = f(&at);
            (0..OUT).for_each(|out| found[out][input].push((now[out] - before[out]) / step));
            before = now;
        }
    }
    found.map(|by_input| by_input.iter().map(|changes| effect(changes)).collect())
}

fn effect(changes: &[f64]) -> Effect {
    let n = changes.len() as f64;
    let middle = changes.iter().sum::<f64>() / n;
    let spread = changes.iter().map(|change| (change - middle).powi(2)).sum::<f64>() / (n - 1.0).max(1.0);
    Effect { mean: changes.iter().map(|change| change.abs()).sum::<f64>() / n, deviation: spread.sqrt() }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_linear_function_has_its_coefficients_as_effects_without_deviation() {
        let slopes = [3.0, -2.0, 0.0, 0.5];
        let f = |x: &[f64]| [x.iter().zip(slopes).map(|(x, slope)| slope * x).sum(), 7.0];
        let [of_first, of_constant] = effects(4, 5, &mut fastrand::Rng::with_seed(3), f);
        for (effect, slope) in of_first.iter().zip(slopes) {
            assert!((effect.mean - f64::abs(slope)).abs() < 1e-12 && effect.deviation < 1e-12, "{effect:?}");
        }
        assert!(of_constant.iter().all(|effect| *effect == Effect::default()));
    }

    #[test]
    fn an_interaction_shows_as_deviation() {
        // d/dx of x y is y, of mean 1/2 and standard deviation 0.373 on the levels 0, 1/3, 2/3, 1.
        let [of] = effects(2, 4000, &mut fastrand::Rng::with_seed(5), |x| [x[0] * x[1]]);
        for effect in of {
            assert!((effect.mean - 0.5).abs() < 0.02 && (effect.deviation - 0.373).abs() < 0.02, "{effect:?}");
        }
    }
}
