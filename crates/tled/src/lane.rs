//! One number per element, for one element or for eight at once: the arithmetic of the kernels is written once.
//!
//! # Practice
//! Only operations that IEEE 754 rounds exactly, and no fused ones, so every width gives the same bits.

use std::ops::{Add, Mul, Sub};
use wide::{f32x8, u32x8};

/// A register of f32, one lane per element.
pub(crate) trait Lane: Copy + Add<Output = Self> + Sub<Output = Self> + Mul<Output = Self> {
    /// The same number in every lane.
    fn splat(x: f32) -> Self;
    /// The larger of each lane and `floor`; `floor` for NaN.
    fn at_least(self, floor: f32) -> Self;
    /// `x^(-1/3)` within 4 % for x over 0, by its bits: the exponent divided by -3.
    fn rough_inverse_cube_root(self) -> Self;
    /// How many lanes are zero or negative.
    fn not_positive(self) -> u32;

    /// `x^(-1/3)` to f32 precision: three Newton steps `y ← y (4 - x y³)/3`.
    #[inline(always)]
    fn inverse_cube_root(self) -> Self {
        let (third, four) = (Self::splat(1.0 / 3.0), Self::splat(4.0));
        let mut y = self.rough_inverse_cube_root();
        for _ in 0..3 {
            y = y * (four - self * (y * y * y)) * third;
        }
        y
    }
}

const EXPONENT_MAGIC: u32 = 0x54A2_FA8C;

impl Lane for f32 {
    #[inline(always)]
    fn splat(x: f32) -> Self {
        x
    }

    #[inline(always)]
    fn at_least(self, floor: f32) -> Self {
        self.max(floor)
    }

    #[inline(always)]
    fn rough_inverse_cube_root(self) -> Self {
        let bits = self.to_bits();
        let mut third = (bits >> 2) + (bits >> 4);
        third += third >> 4;
        third += third >> 8;
        Self::from_bits(EXPONENT_MAGIC.wrapping_sub(third))
    }

    #[inline(always)]
    fn not_positive(self) -> u32 {
        u32::from(self <= 0.0)
    }
}

impl Lane for f32x8 {
    #[inline(always)]
    fn splat(x: f32) -> Self {
        Self::splat(x)
    }

    #[inline(always)]
    fn at_least(self, floor: f32) -> Self {
        self.fast_max(Self::splat(floor))
    }

    #[inline(always)]
    fn rough_inverse_cube_root(self) -> Self {
        let bits: u32x8 = bytemuck::cast(self);
        let mut third = (bits >> 2) + (bits >> 4);
        third += third >> 4;
        third += third >> 8;
        bytemuck::cast(u32x8::splat(EXPONENT_MAGIC) - third)
    }

    #[inline(always)]
    fn not_positive(self) -> u32 {
        self.simd_le(Self::splat(0.0)).to_bitmask().count_ones()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn the_inverse_cube_root_is_right_to_f32_and_the_same_in_every_width(x in 0.01f32..1e6) {
            let exact = f64::from(x).powf(-1.0 / 3.0);
            let found = x.inverse_cube_root();
            prop_assert!((f64::from(found) / exact - 1.0).abs() < 5e-7);
            prop_assert_eq!(<f32x8 as Lane>::splat(x).inverse_cube_root().to_array(), [found; 8]);
        }
    }

    #[test]
    fn nan_and_negative_are_raised_to_the_floor_and_zero_counts_as_turned() {
        assert_eq!((f32::NAN.at_least(0.3), (-1.0f32).at_least(0.3)), (0.3, 0.3));
        let mixed = f32x8::new([f32::NAN, -1.0, 0.0, 1.0, 2.0, -0.0, -3.0, 4.0]);
        assert_eq!(mixed.at_least(0.3).to_array(), [0.3, 0.3, 0.3, 1.0, 2.0, 0.3, 0.3, 4.0]);
        assert_eq!(mixed.not_positive(), 4);
    }
}
