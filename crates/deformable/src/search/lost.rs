//! Points that still look for their tetrahedron, coordinate by coordinate, so that eight are
//! compared with a box at once.

use crate::extent::Extent;
use trepan_geometry::Vec3;

/// Numbers and places of lost points.
pub struct Lost {
    numbers: Vec<u32>,
    /// x, y and z of each.
    axes: [Vec<f32>; 3],
}

/// Points compared at once.
const LANES: usize = 8;

impl Lost {
    /// Room for so many points.
    pub fn with_capacity(points: usize) -> Self {
        let axes = core::array::from_fn(|_| Vec::with_capacity(points));
        Self { numbers: Vec::with_capacity(points), axes }
    }

    /// Forgets all.
    pub fn clear(&mut self) {
        self.numbers.clear();
        self.axes.iter_mut().for_each(Vec::clear);
    }

    /// Adds a point with its number.
    pub fn push(&mut self, number: u32, p: Vec3) {
        self.numbers.push(number);
        self.axes.iter_mut().zip(p.to_array()).for_each(|(axis, x)| axis.push(x));
    }

    /// Takes the `k`th away; the last one takes its place.
    pub fn swap_remove(&mut self, k: usize) {
        self.numbers.swap_remove(k);
        self.axes.iter_mut().for_each(|axis| _ = axis.swap_remove(k));
    }

    /// Whether no point is lost.
    pub fn is_empty(&self) -> bool {
        self.numbers.is_empty()
    }

    /// Number of lost points.
    pub fn len(&self) -> usize {
        self.numbers.len()
    }

    /// Number of the lost point at `k`.
    pub fn number(&self, k: usize) -> u32 {
        self.numbers[k]
    }

    /// Place of the lost point at `k`, world mm.
    pub fn place(&self, k: usize) -> Vec3 {
        self.axes.each_ref().map(|axis| axis[k]).into()
    }

    /// Box of all.
    pub fn bounds(&self) -> Extent {
        let ranges = self.axes.each_ref().map(|axis| range(axis));
        Extent { low: ranges.map(|r| r.0).into(), high: ranges.map(|r| r.1).into() }
    }

    /// The first one from the `k`th on that lies in a box.
    #[inline]
    pub fn next_in(&self, mut k: usize, b: &Extent) -> Option<usize> {
        let [x, y, z] = self.axes.each_ref().map(|axis| &axis[..self.numbers.len()]);
        let (low, high) = (b.low.to_array(), b.high.to_array());
        let inside = |n: usize| {
            (low[0] <= x[n])
                & (x[n] <= high[0])
                & (low[1] <= y[n])
                & (y[n] <= high[1])
                & (low[2] <= z[n])
                & (z[n] <= high[2])
        };
        while k + LANES <= x.len() && !(k..k + LANES).fold(false, |any, n| any | inside(n)) {
            k += LANES;
        }
        (k..x.len()).find(|&n| inside(n))
    }
}

/// Least and greatest, lane by lane: a plain fold waits for every comparison.
fn range(axis: &[f32]) -> (f32, f32) {
    let (mut low, mut high) = ([f32::INFINITY; LANES], [f32::NEG_INFINITY; LANES]);
    let (chunks, rest) = axis.as_chunks::<LANES>();
    for chunk in chunks.iter().map(|chunk| &chunk[..]).chain([rest]) {
        for ((x, low), high) in chunk.iter().zip(&mut low).zip(&mut high) {
            *low = if x < low { *x } else { *low };
            *high = if x > high { *x } else { *high };
        }
    }
    let least = low.into_iter().fold(f32::INFINITY, f32::min);
    (least, high.into_iter().fold(f32::NEG_INFINITY, f32::max))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_next_one_in_a_box_is_found_in_any_lane() {
        let mut lost = Lost::with_capacity(40);
        (0..37).for_each(|n| lost.push(n, Vec3::new(n as f32, -(n as f32), 0.5 * n as f32)));
        for n in 0..37 {
            let at = lost.place(n);
            let here = Extent::of(&[at]).widened(0.1);
            assert_eq!((lost.next_in(0, &here), lost.next_in(n, &here)), (Some(n), Some(n)));
            assert_eq!(lost.next_in(n + 1, &here), None);
        }
        assert_eq!(lost.bounds(), Extent::of(&[Vec3::ZERO, Vec3::new(36.0, -36.0, 18.0)]));
        lost.swap_remove(3);
        assert_eq!((lost.number(3), lost.len(), lost.place(3).x), (36, 36, 36.0));
    }
}
