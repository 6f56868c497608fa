//! Shares of an output's variance by input (Sobol indices), for functions on the unit cube.
//!
//! # Theory
//! Two samples A and B of the inputs, and `A_B^i`: A with the column i of B.
//! ```text
//! first order   S_i = mean f(B) (f(A_B^i) - f(A)) / V     what the variance loses if i is known
//! total         T_i = mean (f(A) - f(A_B^i))² / (2 V)     what is left if all but i are known
//! ```
//! V is the variance over A and B; outputs are centred on their mean first, which changes neither
//! index and takes most noise from the first. The rows of A and B are one Owen-scrambled Sobol
//! sequence of twice as many dimensions.
//!
//! # Sources
//! A. Saltelli et al., *Variance based sensitivity analysis of model output*, Comput. Phys. Commun.
//! 181 (2010), Table 2 (b) and (f); M. J. W. Jansen, *Analysis of variance designs for model
//! output*, Comput. Phys. Commun. 117 (1999).

/// Resamples for the standard errors.
const RESAMPLES: usize = 200;

/// Variance shares of one input.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Indices {
    /// Share of the input alone.
    pub first: f64,
    /// Share of the input with all its interactions.
    pub total: f64,
    /// Standard error of the total share, by bootstrap over the sample's rows.
    pub error: f64,
}

/// Variance shares and the sample that they come from.
#[derive(Clone, Debug, Default)]
pub struct Shares {
    /// Shares of each input.
    pub indices: Vec<Indices>,
    /// Outputs of A and B, ascending.
    pub outputs: Vec<f64>,
}

impl Shares {
    /// Quantile of the outputs.
    pub fn quantile(&self, share: f64) -> f64 {
        self.outputs[((self.outputs.len() - 1) as f64 * share).round() as usize]
    }
}

/// Output at a row of A and of B, and at A with each column of B.
#[derive(Clone, Debug)]
struct Sampled {
    a: f64,
    b: f64,
    mixed: Vec<f64>,
}

/// Shares of `inputs` inputs in each output of `f`. It costs `rows (inputs + 2)` calls; the error
/// falls about with `rows`, a power of two, as long as `f` is smooth.
pub fn shares<const OUT: usize>(
    inputs: usize,
    rows: usize,
    seed: u64,
    mut f: impl FnMut(&[f64]) -> [f64; OUT],
) -> [Shares; OUT] {
    let mut sampled: [Vec<Sampled>; OUT] = std::array::from_fn(|_| Vec::with_capacity(rows));
    let number =
        |row: usize, dimension: usize| f64::from(sobol_burley::sample(row as u32, dimension as u32, seed as u32));
    for row in 0..rows {
        let [a, b] = [0, inputs].map(|from| (from..from + inputs).map(|d| number(row, d)).collect::<Vec<_>>());
        let (of_a, of_b) = (f(&a), f(&b));
        let mixed = |input: usize| {
            let mut at = a.clone();
            at[input] = b[input];
            at
        };
        let of_mixed: Vec<[f64; OUT]> = (0..inputs).map(|input| f(&mixed(input))).collect();
        for (out, into) in sampled.iter_mut().enumerate() {
            let mixed = of_mixed.iter().map(|all| all[out]).collect();
            into.push(Sampled { a: of_a[out], b: of_b[out], mixed });
        }
    }
    let mut random = fastrand::Rng::with_seed(seed);
    sampled.map(|of| {
        let mut outputs: Vec<f64> = of.iter().flat_map(|row| [row.a, row.b]).collect();
        outputs.sort_by(f64::total_cmp);
        Shares { indices: with_errors(&of, inputs, &mut random), outputs }
    })
}

fn with_errors(sampled: &[Sampled], inputs: usize, random: &mut fastrand::Rng) -> Vec<Indices> {
    let all: Vec<&Sampled> = sampled.iter().collect();
    let mut found = estimate(&all, inputs);
    let again: Vec<Vec<Indices>> = (0..RESAMPLES)
        .map(|_| {
            let drawn: Vec<&Sampled> = all.iter().map(|_| all[random.usize(..all.len())]).collect();
            estimate(&drawn, inputs)
        })
        .collect();
    for (input, indices) in found.iter_mut().enumerate() {
        let middle = again.iter().map(|all| all[input].total).sum::<f64>() / RESAMPLES as f64;
        let spread = again.iter().map(|all| (all[input].total - middle).powi(2)).sum::<f64>();
        indices.error = (spread / (RESAMPLES - 1) as f64).sqrt();
    }
    found
}

fn estimate(sampled: &[&Sampled], inputs: usize) -> Vec<Indices> {
    let n = sampled.len() as f64;
    let middle = sampled.iter().map(|row| row.a + row.b).sum::<f64>() / (2.0 * n);
    let variance = sampled.iter().map(|row| (row.a - middle).powi(2) + (row.b - middle).powi(2)).sum::<f64>();
    let variance = variance / (2.0 * n - 1.0);
    if variance <= 0.0 {
        return vec![Indices::default(); inputs];
    }
    let of = |input: usize| {
        let first = sampled.iter().map(|row| (row.b - middle) * (row.mixed[input] - row.a)).sum::<f64>();
        let total = sampled.iter().map(|row| (row.a - row.mixed[input]).powi(2)).sum::<f64>();
        Indices { first: first / (n * variance), total: total / (2.0 * n * variance), error: 0.0 }
    };
    (0..inputs).map(of).collect()
}

/// Largest error of an index on two functions whose indices are known in closed form, with so many
/// rows.
///
/// Ishigami: `sin x₁ + 7 sin² x₂ + 0.1 x₃⁴ sin x₁`, x in -π..π. g: `Π (|4 x_i - 2| + a_i)/(1 +
/// a_i)` with a of 0, 1, 4.5, 9.
pub fn error_on_closed_forms(rows: usize, seed: u64) -> f64 {
    let worst = |found: &Shares, truth: &[[f64; 2]]| {
        let off =
            |(found, truth): (&Indices, &[f64; 2])| (found.first - truth[0]).abs().max((found.total - truth[1]).abs());
        found.indices.iter().zip(truth).map(off).fold(0.0, f64::max)
    };
    let [ishigami] = shares(3, rows, seed, |x| {
        let [a, b, c] = [x[0], x[1], x[2]].map(|x| std::f64::consts::PI * (2.0 * x - 1.0));
        [a.sin() + 7.0 * b.sin().powi(2) + 0.1 * c.powi(4) * a.sin()]
    });
    let a = [0.0, 1.0, 4.5, 9.0];
    let [g] = shares(a.len(), rows, seed, |x| {
        [x.iter().zip(a).map(|(x, a)| ((4.0 * x - 2.0).abs() + a) / (1.0 + a)).product()]
    });
    worst(&ishigami, &ishigami_truth()).max(worst(&g, &g_truth(&a)))
}

/// First and total indices of Ishigami's function.
fn ishigami_truth() -> Vec<[f64; 2]> {
    let (a, b) = (7.0f64, 0.1f64);
    let pi4 = std::f64::consts::PI.powi(4);
    let first = 0.5 * (1.0 + b * pi4 / 5.0).powi(2);
    let second = a * a / 8.0;
    let both = b * b * pi4 * pi4 * 8.0 / 225.0;
    let variance = first + second + both;
    vec![[first / variance, (first + both) / variance], [second / variance; 2], [0.0, both / variance]]
}

/// First and total indices of the g-function.
fn g_truth(a: &[f64]) -> Vec<[f64; 2]> {
    let parts: Vec<f64> = a.iter().map(|a| 1.0 / (3.0 * (1.0 + a).powi(2))).collect();
    let all: f64 = parts.iter().map(|part| 1.0 + part).product();
    let variance = all - 1.0;
    parts.iter().map(|part| [part / variance, part * all / (1.0 + part) / variance]).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn known_indices_come_out_and_the_error_falls_with_the_sample() {
        let [few, many] = [64, 4096].map(|rows| error_on_closed_forms(rows, 1));
        assert!(many < 0.02 && few > many, "{few} with 64 rows, {many} with 4096");
    }

    #[test]
    fn published_indices_of_ishigami_are_those_of_the_closed_form() {
        // Saltelli et al., Global Sensitivity Analysis, 2008: first, then total, by input.
        let truth = ishigami_truth().concat();
        for (is, published) in truth.iter().zip([0.314, 0.558, 0.442, 0.442, 0.0, 0.244]) {
            assert!((is - published).abs() < 1e-3, "{is} {published}");
        }
    }

    #[test]
    fn an_additive_function_has_shares_that_add_up_and_a_constant_has_none() {
        let [sum, constant] = shares(3, 1024, 2, |x| [x[0] + 2.0 * x[1], 5.0]);
        let first: Vec<f64> = sum.indices.iter().map(|i| i.first).collect();
        for (is, truth) in first.iter().zip([0.2, 0.8, 0.0]) {
            assert!((is - truth).abs() < 0.01, "{first:?}");
        }
        assert!(sum.indices.iter().all(|i| (i.total - i.first).abs() < 0.02 && i.error < 0.05));
        assert!((sum.quantile(0.5) - 1.5).abs() < 0.05);
        assert_eq!(constant.indices, [Indices::default(); 3]);
    }
}
