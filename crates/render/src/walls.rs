//! The walls of a hole, smooth: the tetrahedra that a resection leaves are coarse and jagged.
//!
//! # Theory
//! Each vertex goes towards the mean of its neighbours and, by a little more, back (Taubin 1995):
//! jags of an edge's length vanish, the hole's shape stays. Vertices of the former boundary are
//! held, so that walls meet the cortex.

use glam::Vec3;

/// Shares of the way to the neighbours' mean, of a round; numerical.
const SHARES: [f32; 2] = [0.5, -0.53];
/// Rounds, numerical.
const ROUNDS: usize = 4;

/// Neighbours of the vertices of walls.
#[derive(Clone, Debug, Default)]
pub(crate) struct Walls {
    /// Of each vertex, in order; none where it is held.
    neighbours: Vec<Vec<u32>>,
}

impl Walls {
    /// Of triangles over so many vertices, some of them held.
    pub fn of(triangles: &[[u32; 3]], vertices: usize, is_held: impl Fn(usize) -> bool) -> Self {
        let mut neighbours = vec![Vec::new(); vertices];
        for &[a, b, c] in triangles {
            for (at, others) in [(a, [b, c]), (b, [c, a]), (c, [a, b])] {
                neighbours[at as usize].extend(others);
            }
        }
        for (at, row) in neighbours.iter_mut().enumerate() {
            row.sort_unstable();
            row.dedup();
            if is_held(at) {
                row.clear();
            }
        }
        Self { neighbours }
    }

    /// Smooths the vertices' places, of which there may be more after them.
    pub fn smooth(&self, places: &mut [Vec3]) {
        let mut before = Vec::with_capacity(self.neighbours.len());
        for share in [SHARES; ROUNDS].into_iter().flatten() {
            before.clear();
            before.extend_from_slice(&places[..self.neighbours.len()]);
            for (place, row) in places.iter_mut().zip(&self.neighbours).filter(|(_, row)| !row.is_empty()) {
                let mean = row.iter().map(|&n| before[n as usize]).sum::<Vec3>() / row.len() as f32;
                *place += share * (mean - *place);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A half pipe of a radius, whose vertices alternate by a share of it.
    fn pipe(radius_mm: f32, jagged: f32) -> (Vec<Vec3>, Vec<[u32; 3]>) {
        let (long, around) = (24u32, 24u32);
        let place = |n: u32| {
            let (i, j) = (n / around, n % around);
            let (sin, cos) = (j as f32 / (around - 1) as f32 * std::f32::consts::PI).sin_cos();
            let r = radius_mm * (1.0 + jagged * if (i + j) % 2 == 0 { 1.0 } else { -1.0 });
            Vec3::new(r * cos, r * sin, i as f32)
        };
        let cell = |n: u32| {
            let (i, j) = (n / (around - 1), n % (around - 1));
            let a = i * around + j;
            [[a, a + 1, a + around], [a + 1, a + around + 1, a + around]]
        };
        ((0..long * around).map(place).collect(), (0..(long - 1) * (around - 1)).flat_map(cell).collect())
    }

    #[test]
    fn jags_vanish_the_hole_stays_and_what_is_held_does_not_move() {
        let (jagged, triangles) = pipe(7.0, 0.1);
        let inner = |n: usize| (4..20).contains(&(n / 24)) && (4..20).contains(&(n % 24));
        let walls = Walls::of(&triangles, jagged.len(), |n| n % 24 == 0);
        let mut places = jagged.clone();
        walls.smooth(&mut places);
        let off = |n: usize| places[n].truncate().length() - 7.0;
        let of_inner = (0..places.len()).filter(|n| inner(*n));
        let worst = of_inner.clone().map(|n| off(n).abs()).fold(0.0, f32::max);
        let mean = of_inner.clone().map(off).sum::<f32>() / of_inner.count() as f32;
        assert!(worst < 0.15 && mean.abs() < 0.1, "jags of 0.7 mm: {worst} mm left, the radius changes by {mean} mm");
        assert!((0..places.len()).step_by(24).all(|n| places[n] == jagged[n]));
    }
}
