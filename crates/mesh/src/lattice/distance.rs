//! Squared Euclidean distance on a grid, exact, one axis after another.
//!
//! # Theory
//! D(x) = min over y of (x − y)² + D'(y) is, along one axis, the lower envelope of parabolas; a single sweep finds it, so the cost is linear
//! (Felzenszwalb and Huttenlocher 2012, Distance transforms of sampled functions).

use rayon::prelude::*;

/// Larger than any squared distance, small enough that sums stay finite.
const FAR: f32 = 1e30;

/// Squared distance, mm², from each voxel's centre to that of the nearest voxel with `inside == kind`.
pub(super) fn squared_distance(inside: &[bool], dims: [usize; 3], spacing: [f32; 3], kind: bool) -> Vec<f32> {
    let mut squared: Vec<f32> = inside.iter().map(|&v| if v == kind { 0.0 } else { FAR }).collect();
    for axis in 0..3 {
        let unit = spacing[axis] * spacing[axis];
        for_each_line(&mut squared, dims, axis, |line, scratch| envelope(line, scratch, unit));
    }
    squared
}

/// Calls `f` with a copy of each line along `axis` and a scratch line as long, then stores the line; in parallel over slabs.
pub(super) fn for_each_line(
    values: &mut [f32],
    dims: [usize; 3],
    axis: usize,
    f: impl Fn(&mut [f32], &mut [f32]) + Sync,
) {
    let [nx, ny, nz] = dims;
    match axis {
        0 => values.par_chunks_mut(nx).for_each_init(|| vec![0.0; nx], |scratch, line| f(line, scratch)),
        1 => values.par_chunks_mut(nx * ny).for_each_init(
            || (vec![0.0; ny], vec![0.0; ny]),
            |(line, scratch), slab| {
                for x in 0..nx {
                    (0..ny).for_each(|y| line[y] = slab[x + nx * y]);
                    f(line, scratch);
                    (0..ny).for_each(|y| slab[x + nx * y] = line[y]);
                }
            },
        ),
        _ => along_z(values, nx * ny, nz, f),
    }
}

/// Lines along z lie across all slabs: work on a transposed copy.
fn along_z(values: &mut [f32], layer: usize, nz: usize, f: impl Fn(&mut [f32], &mut [f32]) + Sync) {
    let mut lines = vec![0.0; values.len()];
    lines.par_chunks_mut(nz).enumerate().for_each_init(
        || vec![0.0; nz],
        |scratch, (at, line)| {
            (0..nz).for_each(|z| line[z] = values[at + layer * z]);
            f(line, scratch);
        },
    );
    values.par_chunks_mut(layer).enumerate().for_each(|(z, slab)| {
        slab.iter_mut().enumerate().for_each(|(at, value)| *value = lines[at * nz + z]);
    });
}

/// Replaces `line` by the lower envelope of parabolas `unit · (x − y)² + line[y]`.
fn envelope(line: &mut [f32], out: &mut [f32], unit: f32) {
    let mut apexes: Vec<(usize, f32)> = Vec::with_capacity(line.len());
    for y in (0..line.len()).filter(|&y| line[y] < FAR) {
        let height = |at: usize| f64::from(line[at]) + f64::from(unit) * (at * at) as f64;
        let crossing = |at: usize| ((height(y) - height(at)) / (2.0 * f64::from(unit) * (y - at) as f64)) as f32;
        while apexes.last().is_some_and(|&(at, from)| crossing(at) <= from) {
            apexes.pop();
        }
        let from = apexes.last().map_or(f32::NEG_INFINITY, |&(at, _)| crossing(at));
        apexes.push((y, from));
    }
    if apexes.is_empty() {
        return;
    }
    let mut current = 0;
    for (x, out) in out.iter_mut().enumerate() {
        while current + 1 < apexes.len() && apexes[current + 1].1 < x as f32 {
            current += 1;
        }
        let y = apexes[current].0;
        *out = line[y] + unit * (x as f32 - y as f32).powi(2);
    }
    line.copy_from_slice(out);
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn brute_force(inside: &[bool], [nx, ny, _]: [usize; 3], spacing: [f32; 3], kind: bool) -> Vec<f32> {
        let place = |at: usize| [at % nx, at / nx % ny, at / (nx * ny)];
        let squared = |a: usize, b: usize| {
            (0..3).map(|d| ((place(a)[d] as f32 - place(b)[d] as f32) * spacing[d]).powi(2)).sum::<f32>()
        };
        let nearest = |a| (0..inside.len()).filter(|&b| inside[b] == kind).map(|b| squared(a, b)).fold(FAR, f32::min);
        (0..inside.len()).map(nearest).collect()
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(24))]
        #[test]
        fn it_is_the_brute_force_distance(seed in any::<u64>(), rare in 2u64..40, dims in prop::array::uniform3(1usize..8)) {
            let mut state = seed | 1;
            let mut next = || { state = state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407); state >> 33 };
            let inside: Vec<bool> = (0..dims.iter().product()).map(|_| next() % rare == 0).collect();
            let spacing = [0.5, 1.0, 2.5];
            for kind in [true, false] {
                let fast = squared_distance(&inside, dims, spacing, kind);
                let slow = brute_force(&inside, dims, spacing, kind);
                for (a, b) in fast.iter().zip(&slow) {
                    prop_assert!((a - b).abs() <= 1e-4 * b.abs().max(1.0), "{a} {b}");
                }
            }
        }
    }
}
