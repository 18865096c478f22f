//! Wide vectors on CPUs that have them, with the same bits as the baseline.
//!
//! An operation is compiled twice, for AVX2 and for any CPU, and the best version for the present CPU is run. It consists only of
//! `+ - * /` and comparisons, each rounded separately (the compiler never fuses a product and a sum), so the choice changes no bit; tests
//! run both versions and compare them.

use pulp::{Scalar256b, Simd, WithSimd};

/// Whether transforms, phases and contacts with the ground use wide vectors on this CPU; their bits are the same either way.
pub fn uses_wide_vectors() -> bool {
    !matches!(Vectors::best(), Vectors::Baseline)
}

/// Vectors of four numbers.
#[derive(Clone, Copy, Debug)]
pub enum Vectors {
    /// One instruction for all four numbers.
    #[cfg(target_arch = "x86_64")]
    Avx2(pulp::x86::V3),
    /// Instructions that every CPU has.
    Baseline,
}

impl Vectors {
    /// The widest vectors of this CPU.
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
