//! AVX2 and AVX-512 kernels: eight and sixteen elements at once, chosen at run time.
//!
//! # Theory
//! Nodes are read as whole 16-byte rows and transposed 4×4 in registers; forces are transposed back
//! and added as rows. The gather instruction is slower than this, and the compiler does not
//! generate the transposition by itself.
//!
//! ```text
//! rows 4q+i (x y z 0) ── r_i, a 128-bit part q each ──▶ unpack, shuffle ──▶ x, y, z of 4 lanes
//! ```
//!
//! # Practice
//! No fused multiply-add: these kernels give the same bits as the scalar one.
#![expect(
    unsafe_code,
    reason = "the instructions are unsafe to call where the compiler cannot see that the CPU has them"
)]

use crate::lane::{BIASED, FRACTION, Lane, ONE, Quad, ROOT_BITS, SIGN, WHOLE, WIDTH};
use crate::pass::{Pass, PassReport};
use std::arch::x86_64::*;
use std::mem::transmute;
use std::ops::{Add, Div, Mul, Sub};

/// Eight AVX2 lanes, created only inside [`avx2`].
#[derive(Clone, Copy)]
struct Ymm(__m256);

/// Sixteen AVX-512F lanes, created only inside [`avx512`].
#[derive(Clone, Copy)]
struct Zmm(__m512);

/// Whether this CPU can run [`avx2`].
pub(crate) fn has_avx2() -> bool {
    is_x86_feature_detected!("avx2")
}

/// Whether this CPU can run [`avx512`].
pub(crate) fn has_avx512() -> bool {
    is_x86_feature_detected!("avx512f")
}

/// Runs a pass over some blocks, eight elements at once.
pub(crate) fn avx2<P: Pass>(pass: &mut P) -> PassReport {
    assert!(has_avx2());
    #[target_feature(enable = "avx2")]
    fn run<P: Pass>(pass: &mut P) -> PassReport {
        pass.run::<Ymm>()
    }
    // SAFETY: the CPU has AVX2, asserted above.
    unsafe { run(pass) }
}

/// Runs a pass over some blocks, sixteen elements at once.
pub(crate) fn avx512<P: Pass>(pass: &mut P) -> PassReport {
    assert!(has_avx512());
    #[target_feature(enable = "avx512f")]
    fn run<P: Pass>(pass: &mut P) -> PassReport {
        pass.run::<Zmm>()
    }
    // SAFETY: the CPU has AVX-512F, asserted above.
    unsafe { run(pass) }
}

macro_rules! arithmetic {
    ($register:ident, $($operator:ident, $name:ident, $instruction:ident);*) => {$(
        impl $operator for $register {
            type Output = Self;
            #[inline(always)]
            fn $name(self, other: Self) -> Self {
                // SAFETY: a register of this kind exists only inside its kernel, which has the
                // instruction.
                Self(unsafe { $instruction(self.0, other.0) })
            }
        }
    )*};
}

arithmetic!(Ymm, Add, add, _mm256_add_ps; Sub, sub, _mm256_sub_ps; Mul, mul, _mm256_mul_ps; Div, div, _mm256_div_ps);
arithmetic!(Zmm, Add, add, _mm512_add_ps; Sub, sub, _mm512_sub_ps; Mul, mul, _mm512_mul_ps; Div, div, _mm512_div_ps);

#[inline(always)]
fn row(from: &[Quad], at: u32) -> __m128 {
    // SAFETY: both are 16 bytes of any bits.
    unsafe { transmute::<Quad, __m128>(from[at as usize]) }
}

#[inline(always)]
fn add(row: __m128, to: &mut [Quad], at: u32) {
    let sum = &mut to[at as usize];
    // SAFETY: both are 16 bytes of any bits, and every x86-64 has SSE.
    *sum = unsafe { transmute::<__m128, Quad>(_mm_add_ps(transmute::<Quad, __m128>(*sum), row)) };
}

impl Lane for Ymm {
    const LANES: usize = 8;

    #[inline(always)]
    fn splat(x: f32) -> Self {
        // SAFETY: called only inside the AVX2 kernel.
        Self(unsafe { _mm256_set1_ps(x) })
    }

    #[inline(always)]
    fn load(row: &[f32; WIDTH], part: usize) -> Self {
        // SAFETY: both are 64 bytes of any bits.
        Self(unsafe { transmute::<[f32; WIDTH], [__m256; 2]>(*row) }[part])
    }

    #[inline(always)]
    fn gather(from: &[Quad], at: &[u32]) -> [Self; 4] {
        // SAFETY: called only inside the AVX2 kernel.
        unsafe {
            let r0 = _mm256_set_m128(row(from, at[4]), row(from, at[0]));
            let r1 = _mm256_set_m128(row(from, at[5]), row(from, at[1]));
            let r2 = _mm256_set_m128(row(from, at[6]), row(from, at[2]));
            let r3 = _mm256_set_m128(row(from, at[7]), row(from, at[3]));
            let (t0, t1) = (_mm256_unpacklo_ps(r0, r1), _mm256_unpacklo_ps(r2, r3));
            let (t2, t3) = (_mm256_unpackhi_ps(r0, r1), _mm256_unpackhi_ps(r2, r3));
            let (x, y) = (_mm256_shuffle_ps::<0x44>(t0, t1), _mm256_shuffle_ps::<0xEE>(t0, t1));
            let (z, w) = (_mm256_shuffle_ps::<0x44>(t2, t3), _mm256_shuffle_ps::<0xEE>(t2, t3));
            [Self(x), Self(y), Self(z), Self(w)]
        }
    }

    #[inline(always)]
    fn add_rows(corners: [[Self; 3]; 4], to: &mut [Quad], at: [&[u32]; 4]) {
        let [o, a, b, c] = corners;
        let corners = [eight_rows(o), eight_rows(a), eight_rows(b), eight_rows(c)];
        for lane in 0..4 {
            for (rows, at) in corners.iter().zip(at) {
                // SAFETY: called only inside the AVX2 kernel.
                add(unsafe { _mm256_castps256_ps128(rows[lane]) }, to, at[lane]);
            }
        }
        for lane in 0..4 {
            for (rows, at) in corners.iter().zip(at) {
                // SAFETY: called only inside the AVX2 kernel.
                add(unsafe { _mm256_extractf128_ps::<1>(rows[lane]) }, to, at[lane + 4]);
            }
        }
    }

    #[inline(always)]
    fn at_least(self, floor: f32) -> Self {
        // SAFETY: called only inside the AVX2 kernel. The second operand wins over NaN.
        Self(unsafe { _mm256_max_ps(self.0, _mm256_set1_ps(floor)) })
    }

    #[inline(always)]
    fn larger(self, other: Self) -> Self {
        // SAFETY: called only inside the AVX2 kernel. The second operand wins over NaN.
        Self(unsafe { _mm256_max_ps(self.0, other.0) })
    }

    #[inline(always)]
    fn rough_inverse_cube_root(self) -> Self {
        // SAFETY: called only inside the AVX2 kernel.
        unsafe {
            let bits = _mm256_castps_si256(self.0);
            let mut third = _mm256_add_epi32(_mm256_srli_epi32::<2>(bits), _mm256_srli_epi32::<4>(bits));
            third = _mm256_add_epi32(third, _mm256_srli_epi32::<4>(third));
            third = _mm256_add_epi32(third, _mm256_srli_epi32::<8>(third));
            Self(_mm256_castsi256_ps(_mm256_sub_epi32(_mm256_set1_epi32(ROOT_BITS as i32), third)))
        }
    }

    #[inline(always)]
    fn not_positive(self) -> u32 {
        // SAFETY: called only inside the AVX2 kernel.
        let turned = unsafe { _mm256_movemask_ps(_mm256_cmp_ps::<_CMP_LE_OQ>(self.0, _mm256_setzero_ps())) };
        turned.count_ones()
    }

    #[inline(always)]
    fn store(self, row: &mut [f32; WIDTH], part: usize) {
        // SAFETY: both are 32 bytes of any bits.
        row[8 * part..8 * part + 8].copy_from_slice(&unsafe { transmute::<__m256, [f32; 8]>(self.0) });
    }

    #[inline(always)]
    fn sqrt(self) -> Self {
        // SAFETY: called only inside the AVX2 kernel.
        Self(unsafe { _mm256_sqrt_ps(self.0) })
    }

    #[inline(always)]
    fn with_sign_of(self, sign: Self) -> Self {
        // SAFETY: called only inside the AVX2 kernel.
        unsafe {
            let mask = _mm256_set1_epi32(SIGN as i32);
            let magnitude = _mm256_andnot_si256(mask, _mm256_castps_si256(self.0));
            Self(_mm256_castsi256_ps(_mm256_or_si256(magnitude, _mm256_and_si256(mask, _mm256_castps_si256(sign.0)))))
        }
    }

    #[inline(always)]
    fn exponent(self) -> Self {
        // SAFETY: called only inside the AVX2 kernel.
        unsafe {
            let bits = _mm256_srli_epi32::<23>(_mm256_castps_si256(self.0));
            let biased = _mm256_castsi256_ps(_mm256_or_si256(bits, _mm256_set1_epi32(WHOLE.to_bits() as i32)));
            Self(_mm256_sub_ps(biased, _mm256_set1_ps(BIASED)))
        }
    }

    #[inline(always)]
    fn mantissa(self) -> Self {
        // SAFETY: called only inside the AVX2 kernel.
        unsafe {
            let bits = _mm256_and_si256(_mm256_castps_si256(self.0), _mm256_set1_epi32(FRACTION as i32));
            Self(_mm256_castsi256_ps(_mm256_or_si256(bits, _mm256_set1_epi32(ONE as i32))))
        }
    }

    #[inline(always)]
    fn power_of_two(self) -> Self {
        // SAFETY: called only inside the AVX2 kernel.
        unsafe {
            let bits = _mm256_castps_si256(_mm256_add_ps(self.0, _mm256_set1_ps(BIASED)));
            Self(_mm256_castsi256_ps(_mm256_slli_epi32::<23>(bits)))
        }
    }
}

#[inline(always)]
fn four_rows(from: &[Quad], at: &[u32], i: usize) -> __m512 {
    // SAFETY: called only inside the AVX-512 kernel.
    unsafe {
        let first = _mm512_castps128_ps512(row(from, at[i]));
        let second = _mm512_insertf32x4::<1>(first, row(from, at[i + 4]));
        let third = _mm512_insertf32x4::<2>(second, row(from, at[i + 8]));
        _mm512_insertf32x4::<3>(third, row(from, at[i + 12]))
    }
}

/// Transposes vectors of eight lanes to rows; row i has those of lanes i and i + 4.
#[inline(always)]
fn eight_rows([x, y, z]: [Ymm; 3]) -> [__m256; 4] {
    // SAFETY: called only inside the AVX2 kernel.
    unsafe {
        let w = _mm256_setzero_ps();
        let (t0, t1) = (_mm256_unpacklo_ps(x.0, y.0), _mm256_unpackhi_ps(x.0, y.0));
        let (s0, s1) = (_mm256_unpacklo_ps(z.0, w), _mm256_unpackhi_ps(z.0, w));
        [
            _mm256_shuffle_ps::<0x44>(t0, s0),
            _mm256_shuffle_ps::<0xEE>(t0, s0),
            _mm256_shuffle_ps::<0x44>(t1, s1),
            _mm256_shuffle_ps::<0xEE>(t1, s1),
        ]
    }
}

/// Transposes vectors of sixteen lanes to rows; row i has those of lanes i, i + 4, i + 8, i + 12.
#[inline(always)]
fn sixteen_rows([x, y, z]: [Zmm; 3]) -> [__m512; 4] {
    // SAFETY: called only inside the AVX-512 kernel.
    unsafe {
        let w = _mm512_setzero_ps();
        let (t0, t1) = (_mm512_unpacklo_ps(x.0, y.0), _mm512_unpackhi_ps(x.0, y.0));
        let (s0, s1) = (_mm512_unpacklo_ps(z.0, w), _mm512_unpackhi_ps(z.0, w));
        [
            _mm512_shuffle_ps::<0x44>(t0, s0),
            _mm512_shuffle_ps::<0xEE>(t0, s0),
            _mm512_shuffle_ps::<0x44>(t1, s1),
            _mm512_shuffle_ps::<0xEE>(t1, s1),
        ]
    }
}

/// Adds the vectors of lanes 4Q to 4Q + 3.
#[inline(always)]
fn add_quarter<const Q: i32>(corners: &[[__m512; 4]; 4], to: &mut [Quad], at: [&[u32]; 4]) {
    for lane in 0..4 {
        for (rows, at) in corners.iter().zip(at) {
            // SAFETY: called only inside the AVX-512 kernel.
            add(unsafe { _mm512_extractf32x4_ps::<Q>(rows[lane]) }, to, at[4 * Q as usize + lane]);
        }
    }
}

impl Lane for Zmm {
    const LANES: usize = 16;

    #[inline(always)]
    fn splat(x: f32) -> Self {
        // SAFETY: called only inside the AVX-512 kernel.
        Self(unsafe { _mm512_set1_ps(x) })
    }

    #[inline(always)]
    fn load(row: &[f32; WIDTH], _part: usize) -> Self {
        // SAFETY: both are 64 bytes of any bits.
        Self(unsafe { transmute::<[f32; WIDTH], __m512>(*row) })
    }

    #[inline(always)]
    fn gather(from: &[Quad], at: &[u32]) -> [Self; 4] {
        let (r0, r1) = (four_rows(from, at, 0), four_rows(from, at, 1));
        let (r2, r3) = (four_rows(from, at, 2), four_rows(from, at, 3));
        // SAFETY: called only inside the AVX-512 kernel.
        unsafe {
            let (t0, t1) = (_mm512_unpacklo_ps(r0, r1), _mm512_unpacklo_ps(r2, r3));
            let (t2, t3) = (_mm512_unpackhi_ps(r0, r1), _mm512_unpackhi_ps(r2, r3));
            let (x, y) = (_mm512_shuffle_ps::<0x44>(t0, t1), _mm512_shuffle_ps::<0xEE>(t0, t1));
            let (z, w) = (_mm512_shuffle_ps::<0x44>(t2, t3), _mm512_shuffle_ps::<0xEE>(t2, t3));
            [Self(x), Self(y), Self(z), Self(w)]
        }
    }

    #[inline(always)]
    fn add_rows(corners: [[Self; 3]; 4], to: &mut [Quad], at: [&[u32]; 4]) {
        let [o, a, b, c] = corners;
        let corners = [sixteen_rows(o), sixteen_rows(a), sixteen_rows(b), sixteen_rows(c)];
        add_quarter::<0>(&corners, to, at);
        add_quarter::<1>(&corners, to, at);
        add_quarter::<2>(&corners, to, at);
        add_quarter::<3>(&corners, to, at);
    }

    #[inline(always)]
    fn at_least(self, floor: f32) -> Self {
        // SAFETY: called only inside the AVX-512 kernel. The second operand wins over NaN.
        Self(unsafe { _mm512_max_ps(self.0, _mm512_set1_ps(floor)) })
    }

    #[inline(always)]
    fn larger(self, other: Self) -> Self {
        // SAFETY: called only inside the AVX-512 kernel. The second operand wins over NaN.
        Self(unsafe { _mm512_max_ps(self.0, other.0) })
    }

    #[inline(always)]
    fn rough_inverse_cube_root(self) -> Self {
        // SAFETY: called only inside the AVX-512 kernel.
        unsafe {
            let bits = _mm512_castps_si512(self.0);
            let mut third = _mm512_add_epi32(_mm512_srli_epi32::<2>(bits), _mm512_srli_epi32::<4>(bits));
            third = _mm512_add_epi32(third, _mm512_srli_epi32::<4>(third));
            third = _mm512_add_epi32(third, _mm512_srli_epi32::<8>(third));
            Self(_mm512_castsi512_ps(_mm512_sub_epi32(_mm512_set1_epi32(ROOT_BITS as i32), third)))
        }
    }

    #[inline(always)]
    fn not_positive(self) -> u32 {
        // SAFETY: called only inside the AVX-512 kernel.
        let turned = unsafe { _mm512_cmp_ps_mask::<_CMP_LE_OQ>(self.0, _mm512_setzero_ps()) };
        u32::from(turned).count_ones()
    }

    #[inline(always)]
    fn store(self, row: &mut [f32; WIDTH], part: usize) {
        // SAFETY: both are 64 bytes of any bits.
        row[16 * part..].copy_from_slice(&unsafe { transmute::<__m512, [f32; WIDTH]>(self.0) });
    }

    #[inline(always)]
    fn sqrt(self) -> Self {
        // SAFETY: called only inside the AVX-512 kernel.
        Self(unsafe { _mm512_sqrt_ps(self.0) })
    }

    #[inline(always)]
    fn with_sign_of(self, sign: Self) -> Self {
        // SAFETY: called only inside the AVX-512 kernel.
        unsafe {
            let mask = _mm512_set1_epi32(SIGN as i32);
            let magnitude = _mm512_andnot_si512(mask, _mm512_castps_si512(self.0));
            Self(_mm512_castsi512_ps(_mm512_or_si512(magnitude, _mm512_and_si512(mask, _mm512_castps_si512(sign.0)))))
        }
    }

    #[inline(always)]
    fn exponent(self) -> Self {
        // SAFETY: called only inside the AVX-512 kernel.
        unsafe {
            let bits = _mm512_srli_epi32::<23>(_mm512_castps_si512(self.0));
            let biased = _mm512_castsi512_ps(_mm512_or_si512(bits, _mm512_set1_epi32(WHOLE.to_bits() as i32)));
            Self(_mm512_sub_ps(biased, _mm512_set1_ps(BIASED)))
        }
    }

    #[inline(always)]
    fn mantissa(self) -> Self {
        // SAFETY: called only inside the AVX-512 kernel.
        unsafe {
            let bits = _mm512_and_si512(_mm512_castps_si512(self.0), _mm512_set1_epi32(FRACTION as i32));
            Self(_mm512_castsi512_ps(_mm512_or_si512(bits, _mm512_set1_epi32(ONE as i32))))
        }
    }

    #[inline(always)]
    fn power_of_two(self) -> Self {
        // SAFETY: called only inside the AVX-512 kernel.
        unsafe {
            let bits = _mm512_castps_si512(_mm512_add_ps(self.0, _mm512_set1_ps(BIASED)));
            Self(_mm512_castsi512_ps(_mm512_slli_epi32::<23>(bits)))
        }
    }
}
