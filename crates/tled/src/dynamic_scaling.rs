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
}

impl DynamicScaling {
    /// No element gets mass.
    pub const NONE: Self = Self { limit: f32::INFINITY, stiffest: 1.0, most: 1.0 };

    /// Lists the mass for the nodes of stiffened elements in some lanes, from the growth of their
    /// ω²; returns the growth that is left.
    #[cold]
    #[inline(never)]
    pub fn weigh<L: Lane>(
        &self,
        grown: L,
        part: usize,
        (corners, quarter_mass): ([&[u32]; 4], &[f32; WIDTH]),
        added: &mut Vec<(u32, f32)>,
    ) -> L {
        let mut left = [0.0; WIDTH];
        grown.store(&mut left, part);
        let lanes = part * L::LANES..(part + 1) * L::LANES;
        for (lane, at) in lanes.enumerate() {
            let factor = ((self.stiffest + left[at]) / (self.stiffest + self.limit)).min(self.most);
            // False for NaN. There is room for every corner of every element.
            if left[at] > self.limit && added.len() + 4 <= added.capacity() {
                let grams = (factor - 1.0) * quarter_mass[at];
                added.extend(corners.map(|nodes| (nodes[lane], grams)));
                left[at] = (self.stiffest + left[at]) / factor - self.stiffest;
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
    /// left with 32.
    #[test]
    fn a_stiffened_element_gets_the_mass_for_its_growth() {
        let dynamic = DynamicScaling { limit: 2.0, stiffest: 4.0, most: 3.0 };
        let corners: [[u32; 1]; 4] = [[1], [2], [3], [4]];
        let weigh = |grown: f32| {
            let mut added = Vec::with_capacity(4);
            let left = dynamic.weigh(grown, 0, (corners.each_ref().map(|c| &c[..]), &[0.5; WIDTH]), &mut added);
            (left, added)
        };
        assert_eq!(weigh(8.0), (2.0, vec![(1, 0.5), (2, 0.5), (3, 0.5), (4, 0.5)]));
        let (left, added) = weigh(92.0);
        assert!((left - 28.0).abs() < 1e-4 && added[0] == (1, 1.0), "{left} {added:?}");
        assert_eq!(weigh(1.0), (1.0, vec![]));
        assert!(weigh(f32::NAN).1.is_empty());
    }
}
