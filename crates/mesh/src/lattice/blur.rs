//! Gaussian smoothing of a grid, one axis after another.

use rayon::prelude::*;

/// Smooths with a Gaussian of `sigma` voxels along each axis, truncated at 3 σ; border values are
/// extended.
pub(super) fn blur(values: &mut [f32], dims: [usize; 3], sigma: [f64; 3]) {
    for axis in (0..3).filter(|&axis| sigma[axis] > 0.05) {
        let kernel = gaussian(sigma[axis]);
        for_each_line(values, dims, axis, |line, smooth| convolve(line, &kernel, smooth));
    }
}

fn gaussian(sigma: f64) -> Vec<f32> {
    let reach = (3.0 * sigma).ceil() as i32;
    let weights: Vec<f64> = (-reach..=reach).map(|n| (-0.5 * (f64::from(n) / sigma).powi(2)).exp()).collect();
    let sum: f64 = weights.iter().sum();
    weights.into_iter().map(|w| (w / sum) as f32).collect()
}

fn convolve(line: &[f32], kernel: &[f32], smooth: &mut [f32]) {
    let reach = kernel.len() as isize / 2;
    let last = line.len() as isize - 1;
    for (at, smooth) in smooth.iter_mut().enumerate() {
        let tap = |(n, w): (usize, &f32)| w * line[(at as isize + n as isize - reach).clamp(0, last) as usize];
        *smooth = kernel.iter().enumerate().map(tap).sum();
    }
}

/// Applies `f` to each line along `axis`, in parallel over slabs.
fn for_each_line(values: &mut [f32], [nx, ny, nz]: [usize; 3], axis: usize, f: impl Fn(&[f32], &mut [f32]) + Sync) {
    let layer = nx * ny;
    match axis {
        0 => values.par_chunks_mut(nx).for_each_init(
            || vec![0.0; nx],
            |line, row| {
                line.copy_from_slice(row);
                f(line, row);
            },
        ),
        1 => values.par_chunks_mut(layer).for_each_init(
            || (vec![0.0; ny], vec![0.0; ny]),
            |(line, out), slab| {
                for x in 0..nx {
                    (0..ny).for_each(|y| line[y] = slab[x + nx * y]);
                    f(line, out);
                    (0..ny).for_each(|y| slab[x + nx * y] = out[y]);
                }
            },
        ),
        _ => {
            // Lines along z cross all slabs: work on a transposed copy.
            let mut lines = vec![0.0; values.len()];
            let along_z = |line: &mut Vec<f32>, (at, out): (usize, &mut [f32])| {
                (0..nz).for_each(|z| line[z] = values[at + layer * z]);
                f(line, out);
            };
            lines.par_chunks_mut(nz).enumerate().for_each_init(|| vec![0.0; nz], along_z);
            values.par_chunks_mut(layer).enumerate().for_each(|(z, slab)| {
                slab.iter_mut().enumerate().for_each(|(at, value)| *value = lines[at * nz + z]);
            });
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_point_becomes_the_product_of_three_gaussians() {
        let (dims, sigma) = ([15, 13, 17], [1.0, 0.7, 1.5]);
        let mut values = vec![0.0; dims.iter().product()];
        values[7 + 15 * (6 + 13 * 8)] = 1.0;
        blur(&mut values, dims, sigma);
        let kernels = sigma.map(gaussian);
        for (at, value) in values.iter().enumerate() {
            let offsets = [at % 15, at / 15 % 13, at / 195]
                .iter()
                .zip([7, 6, 8])
                .map(|(&a, b)| a as isize - b)
                .collect::<Vec<_>>();
            let weight = |d: usize| {
                kernels[d].get((kernels[d].len() as isize / 2 + offsets[d]) as usize).copied().unwrap_or(0.0)
            };
            assert!((value - weight(0) * weight(1) * weight(2)).abs() < 1e-7);
        }
        assert!((values.iter().sum::<f32>() - 1.0).abs() < 1e-5);
    }

    #[test]
    fn a_constant_stays() {
        let mut values = vec![3.5; 4 * 5 * 6];
        blur(&mut values, [4, 5, 6], [2.0; 3]);
        assert!(values.iter().all(|v| (v - 3.5).abs() < 1e-5));
    }
}
