//! Prints what the present processor offers, in one line: instruction sets, then `wide` if the kernels use wide vectors on it.

/// The instruction sets that the standard library finds. It asks the processor (CPUID), as every library does that chooses by them.
#[cfg(target_arch = "x86_64")]
fn offers() -> Vec<&'static str> {
    macro_rules! found {
        ($($set:tt),*) => { [$(($set, std::arch::is_x86_feature_detected!($set))),*] };
    }
    let sets = found![
        "sse2", "sse3", "ssse3", "sse4.1", "sse4.2", "popcnt", "avx", "f16c", "fma", "bmi1", "bmi2", "lzcnt", "avx2",
        "avx512f"
    ];
    let wide = ("wide", sastrugi_numeric::uses_wide_vectors());
    sets.into_iter().chain([wide]).filter(|(_, is_there)| *is_there).map(|(name, _)| name).collect()
}

#[cfg(not(target_arch = "x86_64"))]
fn offers() -> Vec<&'static str> {
    Vec::new()
}

fn main() {
    println!("{}", offers().join(" "));
}
