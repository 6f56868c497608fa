//! SIMD abstraction: one number per lane, one lane per element, for kernels generic over the width.
//!
//! # Practice
//! Uses only operations that IEEE 754 rounds exactly, and no fused ones, so every width gives the
//! same bits on every machine.

use std::ops::{Add, Div, Mul, Sub};
use wide::{f32x8, u32x8};

/// Tetrahedra in a block.
pub const WIDTH: usize = 16;

/// A 16-byte row of four numbers: a node's displacement or a force, and padding.
pub type Quad = [f32; 4];

/// Rows of a part's tables, at least its nodes. A node number modulo this power of two is always
/// inside, so that kernels read and add rows without a check and a branch each.
pub const NODES: usize = 4096;

/// A register of f32, one lane per element.
///
/// Implementations are always inlined: the instructions of x86 registers are
/// available only inside their kernel.
pub trait Lane: Copy + Add<Output = Self> + Sub<Output = Self> + Mul<Output = Self> + Div<Output = Self> {
    /// Number of lanes; a divisor of [`WIDTH`].
    const LANES: usize;
    /// Sets every lane to the same number.
    fn splat(x: f32) -> Self;
    /// Loads lanes `part * LANES ..` of a block's row.
    fn load(row: &[f32; WIDTH], part: usize) -> Self;
    /// Loads the vector of one node for each lane.
    fn gather(from: &[Quad; NODES], at: &[u32]) -> [Self; 3];
    /// Adds the vectors of four corners to their rows, lane by lane and corner by corner.
    fn add_rows(corners: [[Self; 3]; 4], to: &mut [Quad; NODES], at: [&[u32]; 4]);
    /// The larger of each lane and `floor`; `floor` for NaN.
    fn at_least(self, floor: f32) -> Self;
    /// The larger of two; `other` where this one is NaN.
    fn larger(self, other: Self) -> Self;
    /// `x^(-1/3)` within 4 % for x over 0, from the bits: the exponent divided by -3.
    fn rough_inverse_cube_root(self) -> Self;
    /// Number of lanes that are zero or negative.
    fn not_positive(self) -> u32;
    /// Stores to lanes `part * LANES ..` of a block's row.
    fn store(self, row: &mut [f32; WIDTH], part: usize);
    /// Square root.
    fn sqrt(self) -> Self;
    /// The magnitude of `self` with the sign of `sign`.
    fn with_sign_of(self, sign: Self) -> Self;
    /// e of `m 2^e`, for x over 0.
    fn exponent(self) -> Self;
    /// m of `m 2^e`, from 1 to 2, for x over 0.
    fn mantissa(self) -> Self;
    /// `2^n` for a whole n from -126 to 127.
    fn power_of_two(self) -> Self;

    /// Loads the number of one node for each lane.
    #[inline(always)]
    fn numbers(from: &[f32; NODES], at: &[u32]) -> Self {
        let mut row = [0.0; WIDTH];
        for lane in 0..Self::LANES {
            row[lane] = from[at[lane] as usize % NODES];
        }
        Self::load(&row, 0)
    }

    /// Mean of the numbers of four corners for each lane.
    #[inline(always)]
    fn mean(from: &[f32; NODES], [o, a, b, c]: [&[u32]; 4]) -> Self {
        let (o, a, b, c) =
            (Self::numbers(from, o), Self::numbers(from, a), Self::numbers(from, b), Self::numbers(from, c));
        (o + a + b + c) * Self::splat(0.25)
    }

    /// Adds each lane to the numbers of its four corners, lane by lane and corner by corner.
    #[inline(always)]
    fn add_to(self, to: &mut [f32; NODES], at: [&[u32]; 4]) {
        let mut row = [0.0; WIDTH];
        self.store(&mut row, 0);
        for lane in 0..Self::LANES {
            for at in at {
                to[at[lane] as usize % NODES] += row[lane];
            }
        }
    }

    /// The smaller of each lane and `most`; `most` for NaN.
    #[inline(always)]
    fn smaller(self, most: f32) -> Self {
        let zero = Self::splat(0.0);
        zero - (zero - self).at_least(-most)
    }

    /// The largest of its lanes.
    #[inline(always)]
    fn largest(self) -> f32 {
        let mut row = [f32::NEG_INFINITY; WIDTH];
        self.store(&mut row, 0);
        row.into_iter().fold(f32::NEG_INFINITY, f32::max)
    }

    /// `log₂ x` for x over 0, within 1e-7: `½ + 2/ln 2 · artanh((m-√2)/(m+√2))` and the exponent.
    #[inline(always)]
    fn log2(self) -> Self {
        let (m, root) = (self.mantissa(), Self::splat(std::f32::consts::SQRT_2));
        let s = (m - root) / (m + root);
        let q = s * s;
        let series = Self::splat(1.0 / 9.0) * q + Self::splat(1.0 / 7.0);
        let series = (series * q + Self::splat(0.2)) * q + Self::splat(1.0 / 3.0);
        let artanh = s + s * q * series;
        self.exponent() + (Self::splat(0.5) + artanh * Self::splat(2.0 * std::f32::consts::LOG2_E))
    }

    /// `2^x` with a relative error under 2e-7; x is clamped to -126..126.
    #[inline(always)]
    fn exp2(self) -> Self {
        let zero = Self::splat(0.0);
        let x = self.at_least(-126.0);
        let x = zero - (zero - x).at_least(-126.0);
        let whole = (x + Self::splat(ROUND)) - Self::splat(ROUND);
        let f = x - whole;
        let mut series = Self::splat(EXP2[6]);
        series = series * f + Self::splat(EXP2[5]);
        series = series * f + Self::splat(EXP2[4]);
        series = series * f + Self::splat(EXP2[3]);
        series = series * f + Self::splat(EXP2[2]);
        series = series * f + Self::splat(EXP2[1]);
        series = series * f + Self::splat(EXP2[0]);
        (series * f + Self::splat(1.0)) * whole.power_of_two()
    }

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

/// Scalar product.
#[inline(always)]
pub fn dot<L: Lane>(a: &[L; 3], b: &[L; 3]) -> L {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// Sum of the squares of three rows.
#[inline(always)]
pub fn squared<L: Lane>([a, b, c]: &[[L; 3]; 3]) -> L {
    dot(a, a) + dot(b, b) + dot(c, c)
}

/// Adding and subtracting this rounds to a whole number.
const ROUND: f32 = 12_582_912.0;

/// `ln 2ⁿ / n!` for n = 1..7.
const EXP2: [f32; 7] = [
    std::f32::consts::LN_2,
    0.240_226_5,
    0.055_504_11,
    0.009_618_129,
    0.001_333_355_8,
    0.000_154_035_3,
    0.000_015_252_734,
];

/// `2^23`: the low bits of `2^23 + n` are n; and the same plus the exponent bias.
pub const WHOLE: f32 = 8_388_608.0;
pub const BIASED: f32 = WHOLE + 127.0;
/// Fraction bits of a float, and the bits of 1.0.
pub const FRACTION: u32 = 0x007F_FFFF;
pub const ONE: u32 = 0x3F80_0000;
/// Sign bit of a float.
pub const SIGN: u32 = 0x8000_0000;

/// Subtracting a third of a float's bits from this gives its rough inverse cube root.
pub const ROOT_BITS: u32 = 0x54A2_FA8C;

impl Lane for f32 {
    const LANES: usize = 1;

    #[inline(always)]
    fn splat(x: f32) -> Self {
        x
    }

    #[inline(always)]
    fn load(row: &[f32; WIDTH], part: usize) -> Self {
        row[part]
    }

    #[inline(always)]
    fn gather(from: &[Quad; NODES], at: &[u32]) -> [Self; 3] {
        let [x, y, z, _] = from[at[0] as usize % NODES];
        [x, y, z]
    }

    #[inline(always)]
    fn add_rows(corners: [[Self; 3]; 4], to: &mut [Quad; NODES], at: [&[u32]; 4]) {
        for (corner, at) in corners.iter().zip(at) {
            let row = &mut to[at[0] as usize % NODES];
            (0..3).for_each(|k| row[k] += corner[k]);
        }
    }

    #[inline(always)]
    fn at_least(self, floor: f32) -> Self {
        self.max(floor)
    }

    #[inline(always)]
    fn larger(self, other: Self) -> Self {
        self.max(other)
    }

    #[inline(always)]
    fn rough_inverse_cube_root(self) -> Self {
        let bits = self.to_bits();
        let mut third = (bits >> 2) + (bits >> 4);
        third += third >> 4;
        third += third >> 8;
        Self::from_bits(ROOT_BITS.wrapping_sub(third))
    }

    #[inline(always)]
    fn not_positive(self) -> u32 {
        u32::from(self <= 0.0)
    }

    #[inline(always)]
    fn store(self, row: &mut [f32; WIDTH], part: usize) {
        row[part] = self;
    }

    #[inline(always)]
    fn sqrt(self) -> Self {
        f32::sqrt(self)
    }

    #[inline(always)]
    fn with_sign_of(self, sign: Self) -> Self {
        self.copysign(sign)
    }

    #[inline(always)]
    fn exponent(self) -> Self {
        Self::from_bits((self.to_bits() >> 23) | WHOLE.to_bits()) - BIASED
    }

    #[inline(always)]
    fn mantissa(self) -> Self {
        Self::from_bits((self.to_bits() & FRACTION) | ONE)
    }

    #[inline(always)]
    fn power_of_two(self) -> Self {
        Self::from_bits((self + BIASED).to_bits() << 23)
    }
}

impl Lane for f32x8 {
    const LANES: usize = 8;

    #[inline(always)]
    fn splat(x: f32) -> Self {
        Self::splat(x)
    }

    #[inline(always)]
    fn load(row: &[f32; WIDTH], part: usize) -> Self {
        bytemuck::cast::<[f32; WIDTH], [Self; 2]>(*row)[part]
    }

    #[inline(always)]
    fn gather(from: &[Quad; NODES], at: &[u32]) -> [Self; 3] {
        let mut columns = [[0.0; 8]; 3];
        for lane in 0..8 {
            let [x, y, z, _] = from[at[lane] as usize % NODES];
            (columns[0][lane], columns[1][lane], columns[2][lane]) = (x, y, z);
        }
        columns.map(Self::new)
    }

    #[inline(always)]
    fn add_rows(corners: [[Self; 3]; 4], to: &mut [Quad; NODES], at: [&[u32]; 4]) {
        let corners = corners.map(|corner| corner.map(Self::to_array));
        for lane in 0..8 {
            for (corner, at) in corners.iter().zip(at) {
                let row = &mut to[at[lane] as usize % NODES];
                (0..3).for_each(|k| row[k] += corner[k][lane]);
            }
        }
    }

    #[inline(always)]
    fn at_least(self, floor: f32) -> Self {
        self.fast_max(Self::splat(floor))
    }

    #[inline(always)]
    fn larger(self, other: Self) -> Self {
        self.fast_max(other)
    }

    #[inline(always)]
    fn rough_inverse_cube_root(self) -> Self {
        let bits: u32x8 = bytemuck::cast(self);
        let mut third = (bits >> 2) + (bits >> 4);
        third += third >> 4;
        third += third >> 8;
        bytemuck::cast(u32x8::splat(ROOT_BITS) - third)
    }

    #[inline(always)]
    fn not_positive(self) -> u32 {
        self.simd_le(Self::splat(0.0)).to_bitmask().count_ones()
    }

    #[inline(always)]
    fn store(self, row: &mut [f32; WIDTH], part: usize) {
        row[8 * part..8 * part + 8].copy_from_slice(&self.to_array());
    }

    #[inline(always)]
    fn sqrt(self) -> Self {
        Self::sqrt(self)
    }

    #[inline(always)]
    fn with_sign_of(self, sign: Self) -> Self {
        let (bits, sign): (u32x8, u32x8) = (bytemuck::cast(self), bytemuck::cast(sign));
        bytemuck::cast((bits & u32x8::splat(!SIGN)) | (sign & u32x8::splat(SIGN)))
    }

    #[inline(always)]
    fn exponent(self) -> Self {
        let bits: u32x8 = bytemuck::cast(self);
        let biased: Self = bytemuck::cast((bits >> 23) | u32x8::splat(WHOLE.to_bits()));
        biased - Self::splat(BIASED)
    }

    #[inline(always)]
    fn mantissa(self) -> Self {
        let bits: u32x8 = bytemuck::cast(self);
        bytemuck::cast((bits & u32x8::splat(FRACTION)) | u32x8::splat(ONE))
    }

    #[inline(always)]
    fn power_of_two(self) -> Self {
        let bits: u32x8 = bytemuck::cast(self + Self::splat(BIASED));
        bytemuck::cast(bits << 23)
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
            let root = x.inverse_cube_root();
            prop_assert!((f64::from(root) / exact - 1.0).abs() < 5e-7);
            prop_assert_eq!(<f32x8 as Lane>::splat(x).inverse_cube_root().to_array(), [root; 8]);
        }
    }

    proptest! {
        #[test]
        fn logarithm_and_power_are_right_to_f32_and_the_same_in_every_width(x in 1e-6f32..1e6, y in -60.0f32..60.0) {
            prop_assert!((f64::from(Lane::log2(x)) - f64::from(x).log2()).abs() < 2e-7 * (1.0 + f64::from(x).log2().abs()));
            prop_assert!((f64::from(Lane::exp2(y)) / f64::from(y).exp2() - 1.0).abs() < 4e-7);
            let same = |one: f32, eight: f32x8| eight.to_array().map(f32::to_bits) == [one.to_bits(); 8];
            prop_assert!(same(Lane::log2(x), Lane::log2(<f32x8 as Lane>::splat(x))));
            prop_assert!(same(Lane::exp2(y), Lane::exp2(<f32x8 as Lane>::splat(y))));
            prop_assert!(same(x.with_sign_of(y), <f32x8 as Lane>::splat(x).with_sign_of(<f32x8 as Lane>::splat(y))));
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
