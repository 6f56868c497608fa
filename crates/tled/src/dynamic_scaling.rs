//! Dynamic mass scaling: mass for elements that stiffen, so that a few do not shorten the step.
//!
//! # Theory
//! An element whose ω² has grown by g since rest would need a step shorter by `√(1 + g/ω₀²)`, ω₀
//! the largest frequency at rest. Its mass times `(ω₀² + g)/(ω₀² + limit)` lowers its present ω² to
//! what the step bears. A body's ω² is at most that of its elements alone (Irons and Treharne
//! 1971), so the step holds for all of it. Weight, damping rate and equilibrium do not change;
//! nodes of stiffened elements move more slowly.
//!
//! # Practice
//! Finding them costs a comparison for each register of elements.
//!
//! # Sources
//! T. Belytschko, W. K. Liu, B. Moran: Nonlinear Finite Elements for Continua and Structures, 2000,
//! chapter 6 (mass scaling; stable step by elements).

use crate::averaging::share;
use trepan_soft::simd::{Lane, WIDTH};

/// Which elements count as stiffened, and how much mass they may get.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct DynamicScaling {
    /// Growth of an element's ω² that the step bears, 1/ms².
    pub limit: f32,
    /// Largest ω² of an element at rest, 1/ms².
    pub stiffest: f32,
    /// Largest factor on an element's mass.
    pub most: f32,
    /// Whether accelerations are averaged.
    pub averages: bool,
}

/// What sixteen elements bear.
#[derive(Clone)]
pub(crate) struct Borne {
    /// Growth of ω² beyond which an element counts as stiffened, 1/ms².
    pub growth: [f32; WIDTH],
    /// A quarter of its mass, g, and the share of it that is averaged.
    quarter_mass: [f32; WIDTH],
    share: [f32; WIDTH],
}

impl Borne {
    /// Lanes without elements.
    pub const EMPTY: Self = Self { growth: [f32::INFINITY; WIDTH], quarter_mass: [0.0; WIDTH], share: [1.0; WIDTH] };

    /// Puts an element into a lane, with a quarter of its mass, g, and its ω², 1/ms².
    pub fn put(&mut self, lane: usize, quarter_mass: f32, omega2: f32, dynamic: &DynamicScaling) {
        self.quarter_mass[lane] = quarter_mass;
        self.growth[lane] = dynamic.limit;
        if dynamic.averages {
            self.share[lane] = share(omega2, dynamic.stiffest);
            self.growth[lane] = self.share[lane] * (dynamic.stiffest + dynamic.limit) - omega2;
        }
    }
}

/// What a node gets from an element that has stiffened.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Added {
    /// The node: in the part, or its place.
    pub node: u32,
    /// Mass, g.
    pub grams: f32,
    /// Mass by which the element is averaged besides its share at rest, g.
    pub averaged: f32,
}

impl DynamicScaling {
    /// No element gets mass.
    pub const NONE: Self = Self { limit: f32::INFINITY, stiffest: 1.0, most: 1.0, averages: false };

    /// Lists the mass for the nodes of stiffened elements in some lanes, from the growth of their
    /// ω². Returns the growth that is left, at most `limit` for what is not stiffened.
    #[cold]
    #[inline(never)]
    pub fn weigh<L: Lane>(
        &self,
        grown: L,
        part: usize,
        (corners, borne): ([&[u32]; 4], &Borne),
        added: &mut Vec<Added>,
    ) -> L {
        let mut left = [0.0; WIDTH];
        grown.store(&mut left, part);
        let lanes = part * L::LANES..(part + 1) * L::LANES;
        for (lane, at) in lanes.enumerate() {
            // False for NaN.
            let is_stiffened = left[at] > borne.growth[at];
            if !is_stiffened {
                // Also 0 for NaN.
                left[at] = left[at].max(0.0).min(self.limit);
                continue;
            }
            // There is room for every corner of every element.
            if added.len() + 4 <= added.capacity() {
                let borne_now = self.stiffest + self.limit;
                let now = borne.share[at] * borne_now - borne.growth[at] + left[at];
                let factor = (now / borne_now).clamp(1.0, self.most);
                let share = (now / borne_now).clamp(borne.share[at], factor);
                let grams = (factor - 1.0) * borne.quarter_mass[at];
                let averaged = (share - borne.share[at]) * borne.quarter_mass[at];
                added.extend(corners.map(|nodes| Added { node: nodes[lane], grams, averaged }));
                left[at] = now / factor - self.stiffest;
            }
        }
        L::load(&left, part)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Computed by hand.
    ///
    /// ω² of 4 + 8 with a limit of 4 + 2 needs twice the mass; 4 + 92 may have three times and is
    /// left with 32. Averaged, an ω² of 0.5 has a quarter of its mass averaged; grown by 2.5 it
    /// needs half of it averaged and no mass, by 11.5 twice its mass, all of it averaged.
    #[test]
    fn a_stiffened_element_gets_the_mass_for_its_growth() {
        let dynamic = DynamicScaling { limit: 2.0, stiffest: 4.0, most: 3.0, averages: false };
        let corners: [[u32; 1]; 4] = [[1], [2], [3], [4]];
        let weigh = |dynamic: DynamicScaling, omega2: f32, grown: f32| {
            let (mut added, mut borne) = (Vec::with_capacity(4), Borne::EMPTY);
            borne.put(0, 0.5, omega2, &dynamic);
            let left = dynamic.weigh(grown, 0, (corners.each_ref().map(|c| &c[..]), &borne), &mut added);
            let first = added.first().map(|a| [a.grams, a.averaged]);
            assert!(
                added.iter().enumerate().all(|(n, a)| a.node == n as u32 + 1 && Some([a.grams, a.averaged]) == first)
            );
            (left, first)
        };
        assert_eq!(weigh(dynamic, 4.0, 8.0), (2.0, Some([0.5, 0.5])));
        assert_eq!(weigh(dynamic, 4.0, 92.0), (28.0, Some([1.0, 1.0])));
        assert_eq!(weigh(dynamic, 4.0, 1.0), (1.0, None));
        assert!(weigh(dynamic, 4.0, f32::NAN).1.is_none());
        let averaging = DynamicScaling { averages: true, ..dynamic };
        assert_eq!(weigh(averaging, 0.5, 0.9).1, None);
        assert_eq!(weigh(averaging, 0.5, 2.5), (-1.0, Some([0.0, 0.125])));
        assert_eq!(weigh(averaging, 0.5, 11.5), (2.0, Some([0.5, 0.875])));
    }
}
