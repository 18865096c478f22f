//! Wide vectors where the CPU has them, with the bits of the baseline.
//!
//! An operation is compiled twice, for AVX2 and for any CPU, and is run as this one can. Its source is `+ - *` alone, each
//! rounded by itself (the compiler never fuses a product and a sum), so the choice changes no bit; tests run both and
//! compare.

use pulp::{Scalar256b, Simd, WithSimd};

/// Vectors of four numbers.
#[derive(Clone, Copy, Debug)]
pub enum Vectors {
    /// One instruction for all four.
    #[cfg(target_arch = "x86_64")]
    Avx2(pulp::x86::V3),
    /// What every CPU has.
    Baseline,
}

impl Vectors {
    /// The best of this CPU.
    pub fn best() -> Self {
        #[cfg(target_arch = "x86_64")]
        if let Some(avx2) = pulp::x86::V3::try_new() {
            return Self::Avx2(avx2);
        }
        Self::Baseline
    }

    /// Runs `operation` with these vectors.
    #[inline]
    pub fn run<Op: WithSimd>(self, operation: Op) -> Op::Output {
        match self {
            #[cfg(target_arch = "x86_64")]
            Self::Avx2(avx2) => Simd::vectorize(avx2, operation),
            Self::Baseline => Simd::vectorize(Scalar256b, operation),
        }
    }
}
