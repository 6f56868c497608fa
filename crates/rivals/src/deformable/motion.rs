//! How far the nodes of a mesh can have moved since a volume was fitted to them.
//!
//! # Theory
//! Of every step counts the largest change of any coordinate, m. What was fitted when the sum of m
//! was s, and is now S, lies within `S - s` along each axis of where it was: a volume that is
//! `S - s` wider still holds its nodes. So a tree need not be refitted where nobody looks.
//!
//! # Practice
//! One pass over the coordinates, 0.4 ns each. A node that is nowhere keeps its last place, and its
//! way from there counts when it is back. A sum that would lose small steps to rounding begins
//! anew, and all that was fitted is out of date.

use trepan_geometry::Vec3;

/// The last places of the nodes and the sum of their largest steps.
#[derive(Debug)]
pub(crate) struct Motion {
    /// Last finite places, mm.
    pub places: Vec<Vec3>,
    sum_mm: f64,
    /// Counts the beginnings.
    age: u32,
}

/// When something was fitted.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Fitted {
    sum_mm: f64,
    age: u32,
}

/// The sum that begins anew: below it f64 keeps a tenth of a micrometre.
const MOST_MM: f64 = 1e8;
/// Rounding of one difference, as a share.
const ROUNDING: f64 = 1e-6;

impl Motion {
    /// A mesh at rest, and what is fitted to it now.
    pub fn of(positions: &[Vec3]) -> (Self, Fitted) {
        let motion = Self { places: positions.to_vec(), sum_mm: 0.0, age: 0 };
        let now = motion.now();
        (motion, now)
    }

    /// Takes the moved nodes.
    pub fn follow(&mut self, positions: &[Vec3]) {
        let step = largest_step(bytemuck::cast_slice_mut(&mut self.places), bytemuck::cast_slice(positions));
        self.sum_mm += f64::from(step) * (1.0 + ROUNDING);
        if self.sum_mm > MOST_MM {
            (self.sum_mm, self.age) = (0.0, self.age.wrapping_add(1));
        }
    }

    /// The mark of what is fitted now.
    pub fn now(&self) -> Fitted {
        Fitted { sum_mm: self.sum_mm, age: self.age }
    }

    /// Largest change of a coordinate since then, mm; infinite when it is not known.
    pub fn since(&self, then: Fitted) -> f32 {
        if then.age == self.age { ((self.sum_mm - then.sum_mm) * (1.0 + ROUNDING)) as f32 } else { f32::INFINITY }
    }
}

/// Largest finite change of a coordinate; moves `places` there.
fn largest_step(places: &mut [f32], now: &[f32]) -> f32 {
    const LANES: usize = 16;
    let mut most = [0.0f32; LANES];
    let whole = places.len() / LANES * LANES;
    for (places, now) in places[..whole].chunks_exact_mut(LANES).zip(now.chunks_exact(LANES)) {
        for lane in 0..LANES {
            let step = (now[lane] - places[lane]).abs();
            let is_known = step < f32::INFINITY;
            most[lane] = if is_known && step > most[lane] { step } else { most[lane] };
            places[lane] = if is_known { now[lane] } else { places[lane] };
        }
    }
    let mut largest = most.into_iter().fold(0.0, f32::max);
    for (place, now) in places[whole..].iter_mut().zip(&now[whole..]) {
        let step = (now - *place).abs();
        if step < f32::INFINITY {
            (*place, largest) = (*now, largest.max(step));
        }
    }
    largest
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_way_of_a_node_that_was_nowhere_counts_when_it_is_back() {
        let rest: Vec<Vec3> = (0..20).map(|n| Vec3::splat(n as f32)).collect();
        let (mut motion, then) = Motion::of(&rest);
        let with = |n: usize, p: Vec3| {
            let mut moved = rest.clone();
            moved[n] = p;
            moved
        };
        motion.follow(&with(19, Vec3::NAN));
        assert_eq!(motion.since(then), 0.0);
        motion.follow(&with(19, Vec3::new(19.0, 22.0, 19.0)));
        assert!((motion.since(then) - 3.0).abs() < 1e-4);
        motion.follow(&with(3, Vec3::new(1e9, 3.0, f32::INFINITY)));
        assert_eq!(motion.since(then), f32::INFINITY);
        let now = motion.now();
        motion.follow(&with(3, Vec3::new(1e9, 3.0, 3.5)));
        assert!((motion.since(now) - 0.5).abs() < 1e-4, "from its last known place: {}", motion.since(now));
    }
}
