//! Fourier transforms whose bits do not depend on the CPU.
//!
//! Lengths 2^a 3^b 5^c are transformed by `stockham.rs` with `libm` twiddles, other lengths by Bluestein's chirp algorithm (1970)
//! on a padded length of that form. Forward transforms are unnormalised, with `exp(-2 pi i k n / N)`; inverse transforms are divided
//! by the number of points.
//!
//! Two-dimensional transforms process four lines at a time (`quads.rs`) with the widest vectors of the CPU, and give the same bits.
//!
//! | transform of | function |
//! |---|---|
//! | a real field | [`RealFft2::forward`], [`RealFft2::inverse`]; [`RealFft2::forward_rows`] if its other rows are zero, [`RealFft2::inverse_rows`] for its first rows only; [`RealFft2::inverse_of`] for a spectrum that is written column by column |
//! | a field that is even in both directions, such as a covariance | [`even_spectrum`] |
//! | complex numbers in one dimension | [`Transform`] |

mod butterflies;
mod even;
mod plane;
mod quads;
mod real;
mod stockham;
mod transform;

pub use even::even_spectrum;
pub use num_complex::Complex64;
pub use real::{HalfSpectrum, RealFft2};
pub use transform::Transform;

/// True for 2^a 3^b 5^c.
pub fn is_smooth(mut n: usize) -> bool {
    for factor in [2, 3, 5] {
        while n > 1 && n.is_multiple_of(factor) {
            n /= factor;
        }
    }
    n == 1
}

/// The smallest 2^a 3^b 5^c that is at least `n`.
///
/// ```
/// use sastrugi_numeric::fft::{is_smooth, smooth_length};
///
/// assert!(is_smooth(360) && !is_smooth(14));
/// assert_eq!([7, 360, 1009].map(smooth_length), [8, 360, 1024]);
/// ```
pub fn smooth_length(n: usize) -> usize {
    (n.max(1)..).find(|&m| is_smooth(m)).unwrap_or(n)
}

#[cfg(test)]
mod tests {
    use super::quads::QuadTransform;
    use super::*;
    use crate::simd::Vectors;
    use crate::streams::Streams;
    use std::f64::consts::PI;

    fn noise(n: usize, purpose: &str) -> Vec<f64> {
        let mut s = Streams::for_seed(1, "fft-test").stream(purpose);
        (0..n).map(|_| s.normal()).collect()
    }

    /// Single transforms, four side by side with the vectors of the baseline, and with the widest vectors give the same bits.
    #[test]
    fn prop_vectors_change_no_bit() {
        for n in [1, 2, 3, 5, 8, 16, 30, 45, 64, 81, 125, 128, 512, 1024, 2560, 4096, 4320, 7, 97, 1009] {
            for inverse in [false, true] {
                let (re, im) = (noise(4 * n, "re"), noise(4 * n, "im"));
                let side_by_side = |vectors: Vectors| {
                    let transform = QuadTransform::with(n, vectors);
                    let mut buffers = transform.buffers();
                    for (k, quad) in buffers.data[..n].iter_mut().enumerate() {
                        (quad.re, quad.im) = ([0, 1, 2, 3].map(|l| re[l * n + k]), [0, 1, 2, 3].map(|l| im[l * n + k]));
                    }
                    match inverse {
                        true => transform.process::<true>(&mut buffers).to_vec(),
                        false => transform.process::<false>(&mut buffers).to_vec(),
                    }
                };
                let (wide, plain) = (side_by_side(Vectors::best()), side_by_side(Vectors::Baseline));
                let alone = Transform::new(n);
                for lane in 0..4 {
                    let mut run: Vec<Complex64> =
                        (lane * n..(lane + 1) * n).map(|k| Complex64::new(re[k], im[k])).collect();
                    match inverse {
                        true => alone.inverse_unscaled(&mut run, &mut alone.scratch()),
                        false => alone.forward(&mut run, &mut alone.scratch()),
                    }
                    for ((v, w), b) in run.iter().zip(&wide).zip(&plain) {
                        let bits = [v.re, v.im].map(f64::to_bits);
                        assert_eq!(bits, [w.re[lane], w.im[lane]].map(f64::to_bits), "{n}, inverse {inverse}");
                        assert_eq!(bits, [b.re[lane], b.im[lane]].map(f64::to_bits), "{n}, inverse {inverse}");
                    }
                }
            }
        }
    }

    /// The definition, as a double sum.
    fn direct(field: &[f64], rows: usize, cols: usize, kx: usize, ky: usize) -> Complex64 {
        let mut total = Complex64::default();
        for r in 0..rows {
            for c in 0..cols {
                let turn = (r * ky) as f64 / rows as f64 + (c * kx) as f64 / cols as f64;
                let (sin, cos) = libm::sincos(-2.0 * PI * turn);
                total += Complex64::new(cos, sin) * field[r * cols + c];
            }
        }
        total
    }

    #[test]
    fn val_forward_equals_the_definition() {
        for (rows, cols) in [(1, 1), (2, 2), (5, 8), (6, 7), (7, 11), (9, 1), (1, 10), (17, 18), (24, 13)] {
            let field = noise(rows * cols, "field");
            let spectrum = RealFft2::new(rows, cols).forward(&field);
            for kx in 0..=cols / 2 {
                for ky in 0..rows {
                    let error = (spectrum.values[kx * rows + ky] - direct(&field, rows, cols, kx, ky)).norm();
                    assert!(error < 1e-11, "{rows}x{cols} at {kx},{ky}: {error}");
                }
            }
        }
    }

    /// Every stored mode counts once, plus its conjugate if the half spectrum omits it; columns 0 and `cols / 2` contribute only
    /// their Hermitian part.
    #[test]
    fn val_inverse_equals_the_definition() {
        for (rows, cols) in [(1, 1), (2, 2), (5, 8), (6, 7), (7, 11), (9, 1), (1, 10), (17, 18), (24, 13)] {
            let half = cols / 2 + 1;
            let (re, im) = (noise(rows * half, "re"), noise(rows * half, "im"));
            let values: Vec<Complex64> = re.iter().zip(&im).map(|(&a, &b)| Complex64::new(a, b)).collect();
            let spectrum = HalfSpectrum { rows, cols, values };
            let fft = RealFft2::new(rows, cols);
            let field = fft.inverse(spectrum.clone());
            assert_eq!(field.len(), rows * cols);
            for (at, z) in field.iter().enumerate() {
                let mut total = 0.0;
                for (mode, v) in spectrum.values.iter().enumerate() {
                    let (kx, ky) = (mode / rows, mode % rows);
                    let turn = (at / cols * ky) as f64 / rows as f64 + (at % cols * kx) as f64 / cols as f64;
                    let (sin, cos) = libm::sincos(2.0 * PI * turn);
                    total += spectrum.multiplicity(kx) * (v.re * cos - v.im * sin);
                }
                assert!((z - total / (rows * cols) as f64).abs() < 1e-12, "{rows}x{cols} at {at}");
            }
        }
    }

    /// The even spectrum is a quarter of the transform of the complete field.
    #[test]
    fn val_even_spectrum() {
        for [rows, cols] in [[1, 1], [2, 3], [9, 8], [16, 31], [40, 33], [7, 22]] {
            let (half_rows, half_cols) = (rows / 2 + 1, cols / 2 + 1);
            let mut quarter = noise(half_rows * half_cols, "quarter");
            // Eight lines of zeros.
            quarter.iter_mut().skip(8 * half_cols).take(8 * half_cols).for_each(|v| *v = 0.0);
            let mirrored = |k: usize, n: usize| k.min(n - k);
            let whole: Vec<f64> = (0..rows * cols)
                .map(|k| quarter[mirrored(k / cols, rows) * half_cols + mirrored(k % cols, cols)])
                .collect();
            let all = RealFft2::new(rows, cols).forward(&whole);
            let even = even_spectrum([rows, cols], |r, line| {
                line.copy_from_slice(&quarter[r * half_cols..(r + 1) * half_cols]);
            });
            assert_eq!(even.len(), half_rows * half_cols);
            for (k, v) in even.iter().enumerate() {
                let other = all.values[k / half_rows * rows + k % half_rows];
                assert!((other - v).norm() < 1e-11, "{rows}x{cols} at {k}: {v} {other}");
            }
        }
    }

    /// Incomplete groups do not depend on the previous contents of their buffers: with large values in all other groups, one thread
    /// (whose buffers held them before) and one thread per group give the same bits.
    #[test]
    fn prop_threads_change_no_bit() {
        let [rows, cols] = [64, 36];
        let pool = |threads| rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        let noise = noise(rows * cols, "field");
        let large = |row: usize| if row < 32 { 1e8 } else { 1.0 };
        let fft = RealFft2::new(rows - 3, cols);
        let run = |threads| {
            pool(threads).install(|| {
                let even = even_spectrum([rows, cols], |r, line| {
                    line.iter_mut().enumerate().for_each(|(c, v)| *v = large(r) * noise[r * cols + c]);
                });
                let forward = fft.forward(&noise[..(rows - 3) * cols]);
                let back = fft.inverse(forward.clone());
                let complex = forward.values.iter().flat_map(|v| [v.re, v.im]);
                even.into_iter().chain(complex).chain(back).map(f64::to_bits).collect::<Vec<u64>>()
            })
        };
        let alone = run(1);
        assert!((0..40).all(|_| run(5) == alone));
    }

    /// The first rows of a field have the bits that they have among all rows, for complete and incomplete groups of rows.
    #[test]
    fn prop_rows_left_out_change_no_bit() {
        for (rows, cols) in [(1, 1), (1, 10), (9, 1), (2, 2), (17, 18), (24, 13), (35, 97), (33, 40), (64, 8)] {
            let fft = RealFft2::new(rows, cols);
            let spectrum = fft.forward(&noise(rows * cols, "field"));
            let bits = |field: Vec<f64>| field.into_iter().map(f64::to_bits).collect::<Vec<u64>>();
            let all = bits(fft.inverse(spectrum.clone()));
            for wanted in [0, 1, 7, 8, 9, rows - 1, rows, rows + 5] {
                let expected = &all[..wanted.min(rows) * cols];
                assert_eq!(bits(fft.inverse_rows(spectrum.clone(), wanted)), expected, "{rows}x{cols}, {wanted}");
            }
        }
    }

    /// Rows of zeros may be left out: the same numbers, whatever the number of rows that are left.
    #[test]
    fn prop_rows_of_zeros_change_no_number() {
        for (rows, cols) in [(1, 12), (12, 1), (2, 2), (33, 40), (17, 31), (64, 24), (35, 97)] {
            let fft = RealFft2::new(rows, cols);
            for given in [0, 1, 7, 8, 9, rows - 1, rows] {
                let mut field = noise(given.min(rows) * cols, "field");
                let found = fft.forward_rows(&field);
                field.resize(rows * cols, 0.0);
                assert_eq!(found.values, fft.forward(&field).values, "{rows}x{cols}, {given}");
            }
        }
    }

    #[test]
    fn prop_round_trip() {
        for (rows, cols) in [(1, 1), (33, 40), (17, 31), (64, 64), (35, 97), (128, 30)] {
            let field = noise(rows * cols, "field");
            let fft = RealFft2::new(rows, cols);
            let back = fft.inverse(fft.forward(&field));
            assert_eq!(back.len(), field.len());
            // Compared one by one: the maximum of errors passes over NaN.
            for (at, (a, b)) in field.iter().zip(&back).enumerate() {
                assert!((a - b).abs() < 1e-12, "{rows}x{cols} at {at}: {a} {b}");
            }
        }
    }

    #[test]
    fn val_smooth_lengths() {
        assert_eq!([0, 1, 7, 11, 1009, 2048].map(smooth_length), [1, 1, 8, 12, 1024, 2048]);
        let smooth: Vec<usize> = (0..=32).filter(|n| is_smooth(*n)).collect();
        assert_eq!(smooth, [1, 2, 3, 4, 5, 6, 8, 9, 10, 12, 15, 16, 18, 20, 24, 25, 27, 30, 32]);
    }

    /// Parseval: each stored mode counts as often as it occurs in the full spectrum.
    #[test]
    fn val_power_of_the_half_spectrum() {
        for (rows, cols) in [(1, 1), (2, 2), (5, 8), (6, 7), (9, 1), (1, 10), (1, 9), (24, 13)] {
            let field = noise(rows * cols, "field");
            let spectrum = RealFft2::new(rows, cols).forward(&field);
            assert_eq!(spectrum.values.len(), rows * spectrum.half_cols());
            let of_mode = |(mode, v): (usize, &Complex64)| spectrum.multiplicity(mode / rows) * v.norm_sqr();
            let power: f64 = spectrum.values.iter().enumerate().map(of_mode).sum();
            let squares: f64 = field.iter().map(|v| v * v).sum();
            assert!((power / (rows * cols) as f64 / squares - 1.0).abs() < 1e-12, "{rows}x{cols}");
        }
    }

    /// Several runs in one slice are transformed like each of them alone.
    #[test]
    fn prop_consecutive_runs_are_separate() {
        for n in [12, 7] {
            let transform = Transform::new(n);
            let input: Vec<Complex64> = noise(3 * n, "re").into_iter().map(|v| Complex64::new(v, 0.5)).collect();
            let (mut together, mut alone) = (input.clone(), input.clone());
            transform.forward(&mut together, &mut transform.scratch());
            alone.chunks_mut(n).for_each(|run| transform.forward(run, &mut transform.scratch()));
            assert_eq!(together, alone, "{n}");
            transform.inverse_unscaled(&mut together, &mut transform.scratch());
            alone.chunks_mut(n).for_each(|run| transform.inverse_unscaled(run, &mut transform.scratch()));
            assert_eq!(together, alone, "{n}");
            let worst = together.iter().zip(&input).fold(0.0, |m, (a, b)| f64::max(m, (a / n as f64 - b).norm()));
            assert!(worst < 1e-13, "{n}: {worst}");
        }
    }

    #[test]
    fn val_bluestein_matches_a_direct_sum() {
        let n = 1009;
        let t = Transform::new(n);
        let re = noise(n, "re");
        let mut data: Vec<Complex64> = re.iter().map(|&v| Complex64::new(v, 0.0)).collect();
        t.forward(&mut data, &mut t.scratch());
        for k in [0, 1, 500, 1008] {
            assert!((data[k] - direct(&re, 1, n, k, 0)).norm() < 1e-9);
        }
    }

    /// `rustfft` as an independent reference, for lengths with all mixtures of radices, and for others (Bluestein).
    #[test]
    fn val_matches_rustfft() {
        for n in [2, 3, 4, 5, 6, 8, 15, 16, 30, 60, 81, 125, 128, 2560, 4320, 8192, 7, 14, 97, 1009] {
            let (re, im) = (noise(n, "re"), noise(n, "im"));
            let input: Vec<Complex64> = re.iter().zip(&im).map(|(&a, &b)| Complex64::new(a, b)).collect();
            let transform = Transform::new(n);
            let mut scratch = transform.scratch();
            for inverse in [false, true] {
                let (mut ours, mut theirs) = (input.clone(), input.clone());
                let mut planner = rustfft::FftPlannerScalar::new();
                if inverse {
                    transform.inverse_unscaled(&mut ours, &mut scratch);
                    planner.plan_fft_inverse(n).process(&mut theirs);
                } else {
                    transform.forward(&mut ours, &mut scratch);
                    planner.plan_fft_forward(n).process(&mut theirs);
                }
                for (at, (a, b)) in ours.iter().zip(&theirs).enumerate() {
                    assert!((a - b).norm() < 1e-15 * n as f64 + 1e-13, "{n} at {at}: {a} {b}");
                }
            }
        }
    }

    /// Bits of transforms at lengths for which twiddles from the C library depend on the CPU.
    #[test]
    fn gold_bits_are_frozen() {
        let mut digest = 0u64;
        for n in [60, 1009, 2560, 8192] {
            let transform = Transform::new(n);
            let mut data: Vec<Complex64> = noise(n, "re").into_iter().map(|v| Complex64::new(v, 0.25)).collect();
            transform.forward(&mut data, &mut transform.scratch());
            for v in data {
                digest = (digest ^ v.re.to_bits()).wrapping_mul(0x0100_0000_01b3);
                digest = (digest ^ v.im.to_bits()).wrapping_mul(0x0100_0000_01b3);
            }
        }
        assert_eq!(digest, 7_467_512_922_136_635_467);
    }
}
