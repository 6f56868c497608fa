//! The kernels of the element forces, and their selection for this CPU.

use super::pass::{Pass, PassReport};
#[cfg(target_arch = "x86_64")]
use super::x86;
use wide::f32x8;

/// Implementation of the element forces; all give the same bytes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kernel {
    /// The fastest that this CPU supports.
    Fastest,
    /// One element at a time.
    Scalar,
    /// Eight elements at once with portable SIMD.
    Wide,
    /// Eight elements at once with AVX2 (x86 since about 2013).
    Avx2,
    /// Sixteen elements at once with AVX-512 (servers, some PCs).
    Avx512,
}

impl Kernel {
    /// Every kernel, the scalar one first, the fastest last.
    pub fn all() -> [Self; 5] {
        [Self::Scalar, Self::Wide, Self::Avx2, Self::Avx512, Self::Fastest]
    }

    /// Name on the command line and in charts.
    pub fn name(self) -> &'static str {
        match self {
            Self::Fastest => "fastest",
            Self::Scalar => "scalar",
            Self::Wide => "wide",
            Self::Avx2 => "avx2",
            Self::Avx512 => "avx512",
        }
    }

    /// Whether this CPU has the kernel's instructions.
    pub fn runs_here(self) -> bool {
        match self {
            Self::Fastest | Self::Scalar | Self::Wide => true,
            #[cfg(target_arch = "x86_64")]
            Self::Avx2 => x86::has_avx2(),
            #[cfg(target_arch = "x86_64")]
            Self::Avx512 => x86::has_avx512(),
            #[cfg(not(target_arch = "x86_64"))]
            Self::Avx2 | Self::Avx512 => false,
        }
    }

    /// The kernel that `Fastest` selects on this CPU; any other kernel unchanged.
    pub fn resolved(self) -> Self {
        match self {
            Self::Fastest => [Self::Avx512, Self::Avx2].into_iter().find(|k| k.runs_here()).unwrap_or(Self::Wide),
            other => other,
        }
    }

    /// Runs a pass with this kernel.
    #[inline]
    pub fn run<P: Pass>(self, pass: &mut P) -> PassReport {
        match self {
            Self::Scalar => pass.run::<f32>(),
            #[cfg(target_arch = "x86_64")]
            Self::Avx2 => x86::avx2(pass),
            #[cfg(target_arch = "x86_64")]
            Self::Avx512 => x86::avx512(pass),
            _ => pass.run::<f32x8>(),
        }
    }
}
