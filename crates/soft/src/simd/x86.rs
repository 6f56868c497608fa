//! AVX2 and AVX-512 kernels: eight and sixteen elements at once, chosen at run time.
//!
//! # Theory
//! Nodes are read as whole 16-byte rows and transposed 4×4 in registers; forces are transposed back
//! and added as rows. The gather instruction is slower than this, and the compiler does not
//! generate the transposition by itself. It is faster for single numbers in the AVX-512 kernel.
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

use super::lane::{BIASED, FRACTION, Lane, NODES, ONE, Quad, ROOT_BITS, SIGN, WHOLE, WIDTH};
use super::pass::{Pass, PassReport};
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
pub fn has_avx2() -> bool {
    is_x86_feature_detected!("avx2")
}

/// Whether this CPU can run [`avx512`].
pub fn has_avx512() -> bool {
    is_x86_feature_detected!("avx512f")
}

/// Runs a pass over some blocks, eight elements at once.
pub fn avx2<P: Pass>(pass: &mut P) -> PassReport {
    assert!(has_avx2());
    #[target_feature(enable = "avx2")]
    fn run<P: Pass>(pass: &mut P) -> PassReport {
        pass.run::<Ymm>()
    }
    // SAFETY: the CPU has AVX2, asserted above.
    unsafe { run(pass) }
}

/// Runs a pass over some blocks, sixteen elements at once.
pub fn avx512<P: Pass>(pass: &mut P) -> PassReport {
    assert!(has_avx512());
    #[target_feature(enable = "avx512f")]
    fn run<P: Pass>(pass: &mut P) -> PassReport {
        pass.run::<Zmm>()
    }
    // SAFETY: the CPU has AVX-512F, asserted above.
    unsafe { run(pass) }
}

/// The instructions of each register, by the same names.
mod ymm {
    pub use std::arch::x86_64::{
        _mm256_add_epi32 as add_epi32, _mm256_add_ps as add_ps, _mm256_and_si256 as and_si,
        _mm256_andnot_si256 as andnot_si, _mm256_castps_si256 as castps_si, _mm256_castsi256_ps as castsi_ps,
        _mm256_div_ps as div_ps, _mm256_max_ps as max_ps, _mm256_mul_ps as mul_ps, _mm256_or_si256 as or_si,
        _mm256_set1_epi32 as set1_epi32, _mm256_set1_ps as set1_ps, _mm256_setzero_ps as setzero_ps,
        _mm256_shuffle_ps as shuffle_ps, _mm256_slli_epi32 as slli_epi32, _mm256_sqrt_ps as sqrt_ps,
        _mm256_srli_epi32 as srli_epi32, _mm256_sub_epi32 as sub_epi32, _mm256_sub_ps as sub_ps,
        _mm256_unpackhi_ps as unpackhi_ps, _mm256_unpacklo_ps as unpacklo_ps,
    };
}
mod zmm {
    pub use std::arch::x86_64::{
        _mm512_add_epi32 as add_epi32, _mm512_add_ps as add_ps, _mm512_and_si512 as and_si,
        _mm512_andnot_si512 as andnot_si, _mm512_castps_si512 as castps_si, _mm512_castsi512_ps as castsi_ps,
        _mm512_div_ps as div_ps, _mm512_max_ps as max_ps, _mm512_mul_ps as mul_ps, _mm512_or_si512 as or_si,
        _mm512_set1_epi32 as set1_epi32, _mm512_set1_ps as set1_ps, _mm512_setzero_ps as setzero_ps,
        _mm512_shuffle_ps as shuffle_ps, _mm512_slli_epi32 as slli_epi32, _mm512_sqrt_ps as sqrt_ps,
        _mm512_srli_epi32 as srli_epi32, _mm512_sub_epi32 as sub_epi32, _mm512_sub_ps as sub_ps,
        _mm512_unpackhi_ps as unpackhi_ps, _mm512_unpacklo_ps as unpacklo_ps,
    };
}

macro_rules! operator {
    ($register:ident, $instructions:ident, $($operator:ident, $name:ident, $instruction:ident);*) => {$(
        impl $operator for $register {
            type Output = Self;
            #[inline(always)]
            fn $name(self, other: Self) -> Self {
                // SAFETY: a register of this kind exists only inside its kernel, which has the
                // instruction.
                Self(unsafe { $instructions::$instruction(self.0, other.0) })
            }
        }
    )*};
}

/// Everything in which the registers differ by the names of their instructions only; what is
/// different stands in the items at the end.
macro_rules! lane {
    ($register:ident($raw:ty) of $lanes:literal, $instructions:ident, $($different:item)*) => {
        operator!($register, $instructions, Add, add, add_ps; Sub, sub, sub_ps; Mul, mul, mul_ps; Div, div, div_ps);

        impl $register {
            /// Transposes each 4×4 block: rows of four lanes to vectors, and back.
            #[inline(always)]
            fn transposed([r0, r1, r2, r3]: [$raw; 4]) -> [$raw; 4] {
                use $instructions::*;
                // SAFETY: called only inside the register's kernel, as everything below.
                unsafe {
                    let (t0, t1) = (unpacklo_ps(r0, r1), unpacklo_ps(r2, r3));
                    let (t2, t3) = (unpackhi_ps(r0, r1), unpackhi_ps(r2, r3));
                    let (x, y) = (shuffle_ps::<0x44>(t0, t1), shuffle_ps::<0xEE>(t0, t1));
                    [x, y, shuffle_ps::<0x44>(t2, t3), shuffle_ps::<0xEE>(t2, t3)]
                }
            }

            /// Transposes vectors of all lanes to rows; row i has those of lanes i, i + 4, ….
            #[inline(always)]
            fn rows([x, y, z]: [Self; 3]) -> [$raw; 4] {
                // SAFETY: as above.
                Self::transposed([x.0, y.0, z.0, unsafe { $instructions::setzero_ps() }])
            }
        }

        impl Lane for $register {
            const LANES: usize = $lanes;

            $($different)*

            #[inline(always)]
            fn splat(x: f32) -> Self {
                // SAFETY: as above.
                Self(unsafe { $instructions::set1_ps(x) })
            }

            #[inline(always)]
            fn load(row: &[f32; WIDTH], part: usize) -> Self {
                // SAFETY: both are 64 bytes of any bits.
                Self(unsafe { transmute::<[f32; WIDTH], [$raw; WIDTH / $lanes]>(*row) }[part])
            }

            #[inline(always)]
            fn at_least(self, floor: f32) -> Self {
                self.larger(Self::splat(floor))
            }

            #[inline(always)]
            fn larger(self, other: Self) -> Self {
                // SAFETY: as above. The second operand wins over NaN.
                Self(unsafe { $instructions::max_ps(self.0, other.0) })
            }

            #[inline(always)]
            fn rough_inverse_cube_root(self) -> Self {
                use $instructions::*;
                // SAFETY: as above.
                unsafe {
                    let bits = castps_si(self.0);
                    let mut third = add_epi32(srli_epi32::<2>(bits), srli_epi32::<4>(bits));
                    third = add_epi32(third, srli_epi32::<4>(third));
                    third = add_epi32(third, srli_epi32::<8>(third));
                    Self(castsi_ps(sub_epi32(set1_epi32(ROOT_BITS as i32), third)))
                }
            }

            #[inline(always)]
            fn store(self, row: &mut [f32; WIDTH], part: usize) {
                // SAFETY: both are as many bytes of any bits.
                let lanes = unsafe { transmute::<$raw, [f32; $lanes]>(self.0) };
                row[$lanes * part..$lanes * (part + 1)].copy_from_slice(&lanes);
            }

            #[inline(always)]
            fn sqrt(self) -> Self {
                // SAFETY: as above.
                Self(unsafe { $instructions::sqrt_ps(self.0) })
            }

            #[inline(always)]
            fn with_sign_of(self, sign: Self) -> Self {
                use $instructions::*;
                // SAFETY: as above.
                unsafe {
                    let mask = set1_epi32(SIGN as i32);
                    let magnitude = andnot_si(mask, castps_si(self.0));
                    Self(castsi_ps(or_si(magnitude, and_si(mask, castps_si(sign.0)))))
                }
            }

            #[inline(always)]
            fn exponent(self) -> Self {
                use $instructions::*;
                // SAFETY: as above.
                unsafe {
                    let bits = srli_epi32::<23>(castps_si(self.0));
                    let biased = castsi_ps(or_si(bits, set1_epi32(WHOLE.to_bits() as i32)));
                    Self(sub_ps(biased, set1_ps(BIASED)))
                }
            }

            #[inline(always)]
            fn mantissa(self) -> Self {
                use $instructions::*;
                // SAFETY: as above.
                unsafe {
                    let bits = and_si(castps_si(self.0), set1_epi32(FRACTION as i32));
                    Self(castsi_ps(or_si(bits, set1_epi32(ONE as i32))))
                }
            }

            #[inline(always)]
            fn power_of_two(self) -> Self {
                use $instructions::*;
                // SAFETY: as above.
                unsafe { Self(castsi_ps(slli_epi32::<23>(castps_si(add_ps(self.0, set1_ps(BIASED)))))) }
            }
        }
    };
}

#[inline(always)]
fn row(from: &[Quad; NODES], at: u32) -> __m128 {
    // SAFETY: both are 16 bytes of any bits.
    unsafe { transmute::<Quad, __m128>(from[at as usize % NODES]) }
}

#[inline(always)]
fn add(row: __m128, to: &mut [Quad; NODES], at: u32) {
    let sum = &mut to[at as usize % NODES];
    // SAFETY: both are 16 bytes of any bits, and every x86-64 has SSE.
    *sum = unsafe { transmute::<__m128, Quad>(_mm_add_ps(transmute::<Quad, __m128>(*sum), row)) };
}

#[inline(always)]
fn two_rows(from: &[Quad; NODES], at: &[u32], i: usize) -> __m256 {
    // SAFETY: called only inside the AVX2 kernel.
    unsafe { _mm256_set_m128(row(from, at[i + 4]), row(from, at[i])) }
}

#[inline(always)]
fn four_rows(from: &[Quad; NODES], at: &[u32], i: usize) -> __m512 {
    // SAFETY: called only inside the AVX-512 kernel.
    unsafe {
        let first = _mm512_castps128_ps512(row(from, at[i]));
        let second = _mm512_insertf32x4::<1>(first, row(from, at[i + 4]));
        let third = _mm512_insertf32x4::<2>(second, row(from, at[i + 8]));
        _mm512_insertf32x4::<3>(third, row(from, at[i + 12]))
    }
}

/// Adds the vectors of lanes 4Q to 4Q + 3.
#[inline(always)]
fn add_quarter<const Q: i32>(corners: &[[__m512; 4]; 4], to: &mut [Quad; NODES], at: [&[u32]; 4]) {
    for lane in 0..4 {
        for (rows, at) in corners.iter().zip(at) {
            // SAFETY: called only inside the AVX-512 kernel.
            add(unsafe { _mm512_extractf32x4_ps::<Q>(rows[lane]) }, to, at[4 * Q as usize + lane]);
        }
    }
}

lane! { Ymm(__m256) of 8, ymm,
    #[inline(always)]
    fn gather(from: &[Quad; NODES], at: &[u32]) -> [Self; 3] {
        let rows = [two_rows(from, at, 0), two_rows(from, at, 1), two_rows(from, at, 2), two_rows(from, at, 3)];
        let [x, y, z, _] = Self::transposed(rows);
        [Self(x), Self(y), Self(z)]
    }

    #[inline(always)]
    fn add_rows([o, a, b, c]: [[Self; 3]; 4], to: &mut [Quad; NODES], at: [&[u32]; 4]) {
        let corners = [Self::rows(o), Self::rows(a), Self::rows(b), Self::rows(c)];
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
    fn not_positive(self) -> u32 {
        // SAFETY: called only inside the AVX2 kernel.
        let turned = unsafe { _mm256_movemask_ps(_mm256_cmp_ps::<_CMP_LE_OQ>(self.0, _mm256_setzero_ps())) };
        turned.count_ones()
    }
}

lane! { Zmm(__m512) of 16, zmm,
    #[inline(always)]
    fn numbers(from: &[f32; NODES], at: &[u32]) -> Self {
        // SAFETY: called only inside the AVX-512 kernel; both are 64 bytes of any bits, and every
        // number is below the length once its high bits are cleared.
        unsafe {
            let at = _mm512_loadu_si512(at[..16].as_ptr().cast());
            let within = _mm512_and_si512(at, _mm512_set1_epi32(NODES as i32 - 1));
            Self(_mm512_i32gather_ps::<4>(within, from.as_ptr().cast()))
        }
    }

    #[inline(always)]
    fn gather(from: &[Quad; NODES], at: &[u32]) -> [Self; 3] {
        let rows = [four_rows(from, at, 0), four_rows(from, at, 1), four_rows(from, at, 2), four_rows(from, at, 3)];
        let [x, y, z, _] = Self::transposed(rows);
        [Self(x), Self(y), Self(z)]
    }

    #[inline(always)]
    fn add_rows([o, a, b, c]: [[Self; 3]; 4], to: &mut [Quad; NODES], at: [&[u32]; 4]) {
        let corners = [Self::rows(o), Self::rows(a), Self::rows(b), Self::rows(c)];
        add_quarter::<0>(&corners, to, at);
        add_quarter::<1>(&corners, to, at);
        add_quarter::<2>(&corners, to, at);
        add_quarter::<3>(&corners, to, at);
    }

    #[inline(always)]
    fn not_positive(self) -> u32 {
        // SAFETY: called only inside the AVX-512 kernel.
        let turned = unsafe { _mm512_cmp_ps_mask::<_CMP_LE_OQ>(self.0, _mm512_setzero_ps()) };
        u32::from(turned).count_ones()
    }
}
