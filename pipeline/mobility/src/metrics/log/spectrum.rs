//! One-sided power spectral density of a series (Welch, 1967), averaged over detrended, Hann-windowed, half-overlapping
//! segments; and band RMS values from it.

use std::f64::consts::TAU;

/// Length of a segment, s: it should hold two periods of the lowest frequency of the band.
const SEGMENT_S: f64 = 10.0;
/// Share of the frequencies, just below the Nyquist frequency, from which the noise floor is estimated.
const TOP_SHARE: f64 = 0.125;

/// Power spectral density of a series.
#[derive(Clone, Debug)]
pub(super) struct Spectrum {
    /// Spacing of the frequencies, Hz.
    step_hz: f64,
    rate_hz: f64,
    /// Density at `step_hz`, `2 step_hz` ..., in squared units per Hz.
    density: Vec<f64>,
}

impl Spectrum {
    /// Density of all pieces of a series; `None` if no piece is long enough for a segment of 2 s.
    pub(super) fn of(pieces: &[Vec<f64>], rate_hz: f64) -> Option<Self> {
        let longest = pieces.iter().map(Vec::len).max()?;
        let n = ((SEGMENT_S * rate_hz).round() as usize).min(longest);
        if (n as f64) < 2.0 * rate_hz || n < 8 {
            return None;
        }
        let hann: Vec<f64> = (0..n).map(|k| 0.5 - 0.5 * libm::cos(TAU * (k as f64 + 0.5) / n as f64)).collect();
        let power: f64 = hann.iter().map(|w| w * w).sum();
        let turns: Vec<[f64; 2]> = (0..n)
            .map(|k| {
                let (sin, cos) = libm::sincos(TAU * k as f64 / n as f64);
                [cos, sin]
            })
            .collect();
        let mut density = vec![0.0; (n - 1) / 2];
        let mut segments = 0.0;
        for piece in pieces.iter().filter(|piece| piece.len() >= n) {
            for start in (0..=piece.len() - n).step_by((n / 2).max(1)) {
                let segment = without_trend(&piece[start..start + n]);
                let windowed: Vec<f64> = segment.iter().zip(&hann).map(|(v, w)| v * w).collect();
                for (bin, total) in density.iter_mut().enumerate() {
                    let (mut re, mut im) = (0.0, 0.0);
                    for (k, v) in windowed.iter().enumerate() {
                        let [cos, sin] = turns[k * (bin + 1) % n];
                        re += v * cos;
                        im += v * sin;
                    }
                    *total += 2.0 * (re * re + im * im) / (power * rate_hz);
                }
                segments += 1.0;
            }
        }
        density.iter_mut().for_each(|d| *d /= segments);
        Some(Self { step_hz: rate_hz / n as f64, rate_hz, density })
    }

    /// Root mean square of the `derivative`-th derivative (0, 1, 2) in a band.
    pub(super) fn band_rms(&self, band_hz: [f64; 2], derivative: i32) -> f64 {
        self.integral(band_hz, derivative, |bin| self.density[bin])
    }

    /// The same for white noise with a given density.
    pub(super) fn noise_rms(&self, band_hz: [f64; 2], derivative: i32, density: f64) -> f64 {
        self.integral(band_hz, derivative, |_| density)
    }

    fn integral(&self, [low, high]: [f64; 2], derivative: i32, density: impl Fn(usize) -> f64) -> f64 {
        let bins = (0..self.density.len()).map(|bin| (bin, (bin + 1) as f64 * self.step_hz));
        let inside = bins.filter(|(_, f)| *f >= low && *f <= high);
        let weight = |f: f64| (0..2 * derivative).fold(1.0, |w, _| w * TAU * f);
        inside.map(|(bin, f)| density(bin) * weight(f) * self.step_hz).sum::<f64>().sqrt()
    }

    /// Mean density in the top eighth of the frequencies: an upper bound on the density of white noise.
    pub(super) fn top(&self) -> f64 {
        let n = self.density.len();
        let first = n - ((n as f64 * TOP_SHARE) as usize).max(1);
        self.density[first..].iter().sum::<f64>() / (n - first) as f64
    }

    /// Standard deviation of white noise with a given density at the series' rate.
    pub(super) fn noise_sigma(&self, density: f64) -> f64 {
        (0.5 * density * self.rate_hz).sqrt()
    }
}

/// Values minus their least-squares line.
fn without_trend(values: &[f64]) -> Vec<f64> {
    let n = values.len() as f64;
    let middle = 0.5 * (n - 1.0);
    let mean = values.iter().sum::<f64>() / n;
    let slope =
        values.iter().enumerate().map(|(k, v)| (k as f64 - middle) * v).sum::<f64>() / (n * (n * n - 1.0) / 12.0);
    values.iter().enumerate().map(|(k, v)| v - mean - slope * (k as f64 - middle)).collect()
}
