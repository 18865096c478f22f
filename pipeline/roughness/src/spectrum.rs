//! Power spectral density of a surface.
//!
//! # What
//! The two-sided two-dimensional density, in m4 over spatial frequency in cycles/m,
//! $$ S(f_x, f_y) = \frac{\Delta x\,\Delta y}{\sum_j w_j^2}
//!    \left| \sum_j w_j z_j \, e^{-2\pi i (f_x x_j + f_y y_j)} \right|^2 , $$
//! averaged over rings of |f|. White noise of variance s^2 has `S = s^2 dx dy` at every frequency, and the integral of S
//! over all frequencies, negative ones included, is the variance (Parseval).
//!
//! # How
//! The least-squares plane of the cells with data is removed; w is a Hann window along both axes, and 0 in cells without
//! data, which is equivalent to filling them with that plane. The field is zero-padded to lengths 2^a 3^b 5^c. Rings are an
//! eighth of an octave wide, from one cycle per longest side to the lower of the two Nyquist frequencies; rings without a
//! mode are omitted. Plane and window lower the density of the lowest two or three cycles per side, so slopes are fitted
//! above them.
//!
//! # Source
//! Window and normalisation: Harris, Proc. IEEE 66 (1978) 51; radial average as in Jacobs, Junge and Pastewka, Surf.
//! Topogr. 5 (2017) 013001, their C^2D.
//!
//! # Cost
//! One real transform of the grid, and about 24 bytes per cell.

use crate::plane::Plane;
use sastrugi_numeric::fft::{Complex64, HalfSpectrum, RealFft2, smooth_length};
use sastrugi_numeric::{Geometry, Grid, sums};
use serde::Serialize;
use std::f64::consts::TAU;

/// Rings per doubling of the frequency.
pub(crate) const RINGS_PER_OCTAVE: f64 = 8.0;
/// Lower end of the default slope band, cycles per shortest side.
const SLOPE_CYCLES_MIN: f64 = 4.0;
/// Upper end of the default slope band over the Nyquist frequency.
const SLOPE_NYQUIST_SHARE: f64 = 0.5;
/// Share of the largest density in the band below which a ring holds only rounding errors: well above the square of amplitudes
/// near 1e-16 of the largest.
const SLOPE_NOISE_SHARE: f64 = 1e-12;
/// Share of the density of rings on either side below which a ring is a gap.
const SLOPE_GAP_SHARE: f64 = 0.01;
/// Rings on either side that are compared.
const SLOPE_GAP_RINGS: usize = 3;
/// Cycles per shortest side above which rings are wider than the spacing of modes along an axis, so that none is a gap for lack of
/// a mode: low density between the lines of a sum of waves is real there.
const SLOPE_GAP_CYCLES_MAX: f64 = 11.5;

/// One ring of the radially averaged spectrum.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct SpectrumBin {
    /// Mean spatial frequency of the modes, cycles/m.
    pub frequency_cycles_m: f64,
    /// Mean power spectral density, m4.
    pub psd_m4: f64,
    /// Number of modes of the padded transform in the ring, counting both signs of each frequency.
    pub modes: u64,
}

/// Radially averaged power spectral density, by increasing frequency. Empty if fewer than three cells have data, or a side
/// is below 3 cells.
///
/// # Examples
/// ```
/// use sastrugi_numeric::{Geometry, Grid};
/// use sastrugi_roughness::power_spectrum;
///
/// // Waves of 4 m, on 32 m of cells of half a metre.
/// let wave = [0.0, 0.5f64.sqrt(), 1.0, 0.5f64.sqrt(), 0.0, -0.5f64.sqrt(), -1.0, -0.5f64.sqrt()];
/// let dem = Grid::new(Geometry::square(64, 64, 0.5), (0..64 * 64).map(|k| wave[k % 8]).collect());
/// let spectrum = power_spectrum(&dem);
/// let peak = spectrum.iter().max_by(|a, b| a.psd_m4.total_cmp(&b.psd_m4)).unwrap();
/// assert!((peak.frequency_cycles_m / 0.25 - 1.0).abs() < 0.1);
/// ```
pub fn power_spectrum(dem: &Grid) -> Vec<SpectrumBin> {
    SpectralMap::of(dem).map_or_else(Vec::new, |map| map.rings())
}

/// The two-dimensional density at the frequencies of the padded transform, before any averaging.
#[derive(Clone, Debug)]
pub struct SpectralMap {
    geometry: Geometry,
    spectrum: HalfSpectrum,
    /// Factor from squared modulus to density, m2.
    density: f64,
}

impl SpectralMap {
    /// Density of a surface; `None` if fewer than three cells have data, or a side is below 3 cells.
    pub fn of(dem: &Grid) -> Option<Self> {
        let g = dem.geometry;
        if g.rows < 3 || g.cols < 3 || dem.finite_count() < 3 {
            return None;
        }
        let (rows, cols) = (smooth_length(g.rows), smooth_length(g.cols));
        let (field, window_power) = tapered(dem, rows, cols);
        let spectrum = RealFft2::new(rows, cols).forward(&field);
        Some(Self { geometry: g, spectrum, density: g.cell[0] * g.cell[1] / window_power })
    }

    /// Frequencies `[east, north]` in cycles/m with `f_east >= 0`, density in m4, and multiplicity (2 if the opposite frequency
    /// is not listed).
    pub fn modes(&self) -> impl Iterator<Item = ([f64; 2], f64, f64)> + '_ {
        let (s, g) = (&self.spectrum, &self.geometry);
        let step = [1.0 / (s.cols as f64 * g.cell[0]), 1.0 / (s.rows as f64 * g.cell[1])];
        let signed = |k: usize, n: usize| if 2 * k > n { k as f64 - n as f64 } else { k as f64 };
        s.values.chunks_exact(s.rows).enumerate().flat_map(move |(kx, column)| {
            // Rows count southwards.
            let mode = move |(ky, value): (usize, &Complex64)| {
                let frequency = [kx as f64 * step[0], -signed(ky, s.rows) * step[1]];
                (frequency, self.density * value.norm_sqr(), s.multiplicity(kx))
            };
            column.iter().enumerate().map(mode)
        })
    }

    /// Means over rings.
    pub fn rings(&self) -> Vec<SpectrumBin> {
        ring_means(&self.spectrum, &self.geometry, self.density)
    }

    /// Texture direction (Std of ISO 25178-2), degrees clockwise from north in [0, 180): perpendicular to the maximum of the
    /// angular spectrum, which is the density integrated over the frequencies of the band. It therefore runs along ridges
    /// and furrows; the standard gives the angle of the maximum itself. The angular spectrum is smoothed over 9 degrees.
    /// NaN if the band holds no power.
    pub fn direction_deg(&self, band_cycles_m: [f64; 2]) -> f64 {
        let mut angular = [0.0; ANGLES];
        for ([east, north], psd, multiplicity) in self.modes() {
            let frequency = (east * east + north * north).sqrt();
            if frequency >= band_cycles_m[0] && frequency <= band_cycles_m[1] {
                let degrees = libm::atan2(east, north).to_degrees();
                angular[degrees.rem_euclid(180.0).round() as usize % ANGLES] += multiplicity * psd;
            }
        }
        let smooth =
            |k: usize| -> f64 { (0..2 * SMOOTH + 1).map(|j| angular[(k + ANGLES + j - SMOOTH) % ANGLES]).sum() };
        let best = (0..ANGLES).fold((0, 0.0), |best, k| if smooth(k) > best.1 { (k, smooth(k)) } else { best });
        if best.1 > 0.0 { ((best.0 + ANGLES / 2) % ANGLES) as f64 } else { f64::NAN }
    }
}

/// Directions in half a turn of the angular spectrum.
const ANGLES: usize = 180;
/// Directions on either side that smooth the angular spectrum.
const SMOOTH: usize = 4;

/// The windowed field, padded to `(rows, cols)`, and the sum of the squared window.
fn tapered(dem: &Grid, rows: usize, cols: usize) -> (Vec<f64>, f64) {
    let g = dem.geometry;
    let plane = Plane::of(dem);
    let (hann_rows, hann_cols) = (hann(g.rows), hann(g.cols));
    let mut field = vec![0.0; rows * cols];
    let mut powers = Vec::with_capacity(g.rows);
    for (r, (out, wr)) in field.chunks_exact_mut(cols).zip(&hann_rows).enumerate() {
        let mut power = 0.0;
        for (c, ((v, wc), &z)) in out.iter_mut().zip(&hann_cols).zip(dem.row(r)).enumerate() {
            if z.is_finite() {
                let weight = wr * wc;
                *v = weight * (z - plane.at(r, c));
                power += weight * weight;
            }
        }
        powers.push(power);
    }
    (field, sums::sum(&powers))
}

/// Hann window without its zero ends: `sin^2(pi (k + 1/2) / n)`.
pub(crate) fn hann(n: usize) -> Vec<f64> {
    (0..n).map(|k| 0.5 - 0.5 * libm::cos(TAU * (k as f64 + 0.5) / n as f64)).collect()
}

fn nyquist(g: &Geometry) -> f64 {
    0.5 / g.cell[0].max(g.cell[1])
}

fn ring_means(spectrum: &HalfSpectrum, g: &Geometry, density: f64) -> Vec<SpectrumBin> {
    let [size_x, size_y] = g.size();
    let (lowest, highest) = (1.0 / size_x.max(size_y), nyquist(g));
    let rings = (libm::log2(highest / lowest) * RINGS_PER_OCTAVE).ceil().max(1.0) as usize;
    let (step_x, step_y) = (1.0 / (spectrum.cols as f64 * g.cell[0]), 1.0 / (spectrum.rows as f64 * g.cell[1]));
    // Frequencies, densities and modes by ring.
    let mut totals = vec![(0.0, 0.0, 0u64); rings];
    for (kx, column) in spectrum.values.chunks_exact(spectrum.rows).enumerate() {
        let multiplicity = spectrum.multiplicity(kx);
        let fx = kx as f64 * step_x;
        for (ky, mode) in column.iter().enumerate() {
            let fy = ky.min(spectrum.rows - ky) as f64 * step_y;
            let frequency = (fx * fx + fy * fy).sqrt();
            if frequency >= lowest && frequency <= highest {
                let ring = (libm::log2(frequency / lowest) * RINGS_PER_OCTAVE) as usize;
                let total = &mut totals[ring.min(rings - 1)];
                total.0 += multiplicity * frequency;
                total.1 += multiplicity * mode.norm_sqr();
                total.2 += multiplicity as u64;
            }
        }
    }
    let bin = |(frequencies, powers, modes): (f64, f64, u64)| SpectrumBin {
        frequency_cycles_m: frequencies / modes as f64,
        psd_m4: density * powers / modes as f64,
        modes,
    };
    totals.into_iter().filter(|t| t.2 > 0).map(bin).collect()
}

/// Default band of the slope fit, cycles/m: from 4 cycles per shortest side, above the frequencies that plane and window
/// affect, to half the Nyquist frequency, below aliasing.
pub fn default_slope_band(g: &Geometry) -> [f64; 2] {
    let [size_x, size_y] = g.size();
    [SLOPE_CYCLES_MIN / size_x.min(size_y), SLOPE_NYQUIST_SHARE * nyquist(g)]
}

/// Slope of log density over log frequency, by equally weighted least squares over the rings of the band (inclusive, cycles/m).
/// Rings of rounding noise and gaps are left out. Gaps: a surface that varies along one axis only has no power, or only leakage
/// from padding, in rings without a mode on that axis, which occur below 11.5 cycles per `side_m`, the shortest side. NaN with
/// fewer than two rings, or fewer than half of the rings in the band. A surface with Hurst exponent H has `-2 (H + 1)`.
pub fn psd_slope(spectrum: &[SpectrumBin], band_cycles_m: [f64; 2], side_m: f64) -> f64 {
    let [low, high] = band_cycles_m;
    let inside = |b: &SpectrumBin| b.frequency_cycles_m >= low && b.frequency_cycles_m <= high;
    let band: Vec<usize> = (0..spectrum.len()).filter(|&k| inside(&spectrum[k])).collect();
    let noise = SLOPE_NOISE_SHARE * largest(band.iter().map(|&k| &spectrum[k]));
    let narrow = |k: usize| spectrum[k].frequency_cycles_m * side_m < SLOPE_GAP_CYCLES_MAX;
    let usable = |&&k: &&usize| spectrum[k].psd_m4 > noise && !(narrow(k) && is_gap(spectrum, k));
    let usable = band.iter().filter(usable).map(|&k| &spectrum[k]);
    let points: Vec<[f64; 2]> = usable.map(|b| [libm::log(b.frequency_cycles_m), libm::log(b.psd_m4)]).collect();
    if 2 * points.len() < band.len() { f64::NAN } else { crate::multifractality::line_slope(&points) }
}

fn largest<'a>(rings: impl IntoIterator<Item = &'a SpectrumBin>) -> f64 {
    rings.into_iter().map(|b| b.psd_m4).fold(0.0, f64::max)
}

/// Whether a ring is far below the rings on both sides.
fn is_gap(spectrum: &[SpectrumBin], k: usize) -> bool {
    let below = largest(&spectrum[k.saturating_sub(SLOPE_GAP_RINGS)..k]);
    let above = largest(spectrum[k + 1..].iter().take(SLOPE_GAP_RINGS));
    spectrum[k].psd_m4 < SLOPE_GAP_SHARE * below.min(above)
}

#[cfg(test)]
mod tests {
    use super::*;
    use sastrugi_numeric::Streams;

    fn field(geometry: Geometry, value: impl Fn(f64, f64) -> f64) -> Grid {
        let cell = |k: usize| value(geometry.x(k % geometry.cols), geometry.y(k / geometry.cols));
        Grid::new(geometry, (0..geometry.len()).map(cell).collect())
    }

    /// White noise of variance 4 on cells of 0.5 x 0.25 m: density 0.5 m4 in every ring, also with a third of the cells
    /// missing and a plane added. Rings of n modes have a relative standard error of `sqrt(c / n)`, c = 4.5 for window and
    /// padding (1.5^2 from Hann, 2 from conjugate pairs); threshold 7 standard errors over about 60 rings: false-alarm rate
    /// below 1e-6 (in small rings the tail of a mean of exponentials is heavier than normal, hence only rings above 200
    /// modes). Catches a normalisation off by 2 %.
    #[test]
    fn stat_white_noise_is_flat() {
        let geometry = Geometry { rows: 400, cols: 343, cell: [0.5, 0.25], origin: [0.0; 2] };
        for hole_share in [0.0, 0.33] {
            let mut s = Streams::for_seed(1, "spectrum-test").stream("noise");
            let mut dem = field(geometry, |x, y| 3.0 * x - y);
            dem.values.iter_mut().for_each(|z| {
                let noise = 2.0 * s.normal();
                *z = if s.uniform() < hole_share { f64::NAN } else { *z + noise };
            });
            let spectrum = power_spectrum(&dem);
            assert!(spectrum.len() > 40);
            for b in spectrum.iter().filter(|b| b.modes > 200) {
                let allowed = 7.0 * (4.5 / b.modes as f64).sqrt();
                assert!((b.psd_m4 / 0.5 - 1.0).abs() < allowed, "{b:?}");
            }
        }
    }

    /// Rings by the definition: a direct transform, at every frequency of either sign, of the levelled field under a window of squared
    /// sines; with holes, oblong cells, and padding from 11 to 12 columns.
    #[test]
    fn val_rings_equal_the_definition() {
        let g = Geometry { rows: 10, cols: 11, cell: [0.5, 0.8], origin: [0.0; 2] };
        let mut s = Streams::for_seed(3, "spectrum-test").stream("noise");
        let mut dem = field(g, |x, y| 0.3 * x - y);
        dem.values.iter_mut().for_each(|z| {
            let noise = s.normal();
            *z = if s.uniform() < 0.2 { f64::NAN } else { *z + noise };
        });
        let sine = |k: usize, n: usize| libm::sin(0.5 * TAU * (k as f64 + 0.5) / n as f64);
        let weight = |k: usize| libm::pow(sine(k / 11, 10) * sine(k % 11, 11), 2.0);
        let level = crate::plane::level(&dem);
        let cells: Vec<(usize, f64)> =
            level.values.iter().copied().enumerate().filter(|(_, z)| z.is_finite()).collect();
        let window_power: f64 = cells.iter().map(|(k, _)| weight(*k) * weight(*k)).sum();
        // Frequencies, densities and modes by ring: 8 rings an octave from 1 / 8 to 0.625 cycles/m.
        let mut rings = [(0.0, 0.0, 0u64); 19];
        for (kx, ky) in (0..12usize).flat_map(|kx| (0..10usize).map(move |ky| (kx, ky))) {
            let [fx, fy] = [kx.min(12 - kx) as f64 * (1.0 / 6.0), ky.min(10 - ky) as f64 * 0.125];
            let frequency = (fx * fx + fy * fy).sqrt();
            if !(0.125..=0.625).contains(&frequency) {
                continue;
            }
            let mode: Complex64 = cells
                .iter()
                .map(|(k, z)| {
                    let turns = (kx * (k % 11)) as f64 / 12.0 + (ky * (k / 11)) as f64 / 10.0;
                    let (sin, cos) = libm::sincos(-TAU * turns);
                    Complex64::new(cos, sin) * (weight(*k) * z)
                })
                .sum();
            let ring = &mut rings[((libm::log2(frequency / 0.125) * 8.0) as usize).min(18)];
            *ring = (ring.0 + frequency, ring.1 + mode.norm_sqr() * 0.4 / window_power, ring.2 + 1);
        }
        let expected: Vec<_> = rings.into_iter().filter(|ring| ring.2 > 0).collect();
        let found = power_spectrum(&dem);
        assert_eq!(found.iter().map(|b| b.modes).collect::<Vec<_>>(), expected.iter().map(|r| r.2).collect::<Vec<_>>());
        for (b, (frequencies, powers, modes)) in found.iter().zip(expected) {
            assert!((b.frequency_cycles_m - frequencies / modes as f64).abs() < 1e-12, "{b:?}");
            assert!((b.psd_m4 - powers / modes as f64).abs() < 1e-10, "{b:?}");
        }
    }

    /// From 4 cycles per shorter side (40 m) to half the Nyquist frequency of the larger cell side (0.8 m).
    #[test]
    fn val_the_default_slope_band() {
        let g = Geometry { rows: 50, cols: 100, cell: [0.5, 0.8], origin: [0.0; 2] };
        let [low, high] = default_slope_band(&g);
        assert!((low - 0.1).abs() < 1e-15 && (high - 0.3125).abs() < 1e-15, "{low} {high}");
    }

    /// The sum of the density over all modes times the area of a mode is the variance of the windowed field.
    #[test]
    fn val_parseval() {
        let mut s = Streams::for_seed(2, "spectrum-test").stream("noise");
        let g = Geometry::square(60, 45, 0.1);
        let dem = Grid::new(g, (0..g.len()).map(|_| s.normal()).collect());
        let (tapered, power) = tapered(&dem, 60, 45);
        let spectrum = RealFft2::new(60, 45).forward(&tapered);
        let modes = spectrum.values.chunks_exact(60).enumerate();
        let total: f64 =
            modes.map(|(kx, c)| spectrum.multiplicity(kx) * c.iter().map(|m| m.norm_sqr()).sum::<f64>()).sum();
        let density_integral = total * (0.01 / power) / (6.0 * 4.5);
        let variance = tapered.iter().map(|v| v * v).sum::<f64>() / power;
        assert!((density_integral / variance - 1.0).abs() < 1e-12);
    }

    #[test]
    fn val_a_wave_peaks_at_its_frequency() {
        let dem = field(Geometry::square(200, 200, 0.1), |x, y| libm::sin(TAU * (1.2 * x + 1.6 * y)));
        let spectrum = power_spectrum(&dem);
        let peak = spectrum.iter().max_by(|a, b| a.psd_m4.total_cmp(&b.psd_m4)).unwrap();
        assert!((peak.frequency_cycles_m / 2.0 - 1.0).abs() < 0.09, "{peak:?}");
    }

    /// A wave that travels east has ridges that run north-south; the density peaks at the frequency of the wave.
    #[test]
    fn val_direction_of_waves() {
        for azimuth_deg in [0.0f64, 20.0, 45.0, 90.0, 120.0, 179.0] {
            let (sin, cos) = libm::sincos(azimuth_deg.to_radians());
            let g = Geometry { rows: 200, cols: 160, cell: [0.1, 0.15], origin: [0.0; 2] };
            // Ridges along the azimuth: the phase grows across it.
            let dem = field(g, |x, y| libm::sin(TAU * (x * cos - y * sin)));
            let map = SpectralMap::of(&dem).unwrap();
            let found = map.direction_deg([0.3, 3.0]);
            let apart = (found - azimuth_deg).rem_euclid(180.0);
            assert!(apart.min(180.0 - apart) < 2.5, "{azimuth_deg}: {found}");
            let peak = map.modes().max_by(|a, b| a.1.total_cmp(&b.1)).unwrap().0;
            assert!((peak[0] * cos - peak[1] * sin).abs() > 0.97, "{peak:?}");
            assert!(map.direction_deg([3.1, 3.0]).is_nan());
        }
    }

    #[test]
    fn val_slope_of_a_power_law() {
        let bin = |f: f64| SpectrumBin { frequency_cycles_m: f, psd_m4: 7.0 / (f * f * f), modes: 1 };
        let spectrum: Vec<SpectrumBin> = (1..50).map(|k| bin(0.1 * f64::from(k))).collect();
        assert!((psd_slope(&spectrum, [0.2, 3.0], 10.0) + 3.0).abs() < 1e-12);
        assert!(psd_slope(&spectrum, [9.0, 10.0], 10.0).is_nan());
    }

    /// A trench across the ground: low rings without a mode on the axis of its profile hold only rounding errors, or leakage where
    /// sides are padded (all but 400 and 720). Steps fall off as f^-2, and the share of modes on the axis in a ring as 1/f: -3, give
    /// or take lobes.
    #[test]
    fn val_gaps_do_not_affect_the_slope() {
        for side in [400, 660, 666, 667, 700, 720] {
            let g = Geometry::square(side, side, 0.15);
            let side_m = 0.15 * side as f64;
            let middle_m = 0.5 * side_m;
            let trench = field(g, |_, y| if (y - middle_m).abs() < 1.5 { -1.0 } else { 0.0 });
            let (spectrum, band) = (power_spectrum(&trench), default_slope_band(&g));
            let empty =
                (0..spectrum.len()).filter(|&k| spectrum[k].frequency_cycles_m >= band[0] && is_gap(&spectrum, k));
            assert!((3..9).contains(&empty.count()), "{side}");
            let slope = psd_slope(&spectrum, band, side_m);
            assert!((slope + 3.0).abs() < 0.8, "{side}: {slope}");
            // The same along the other axis.
            let across = field(g, |x, _| if (x - middle_m).abs() < 1.5 { -1.0 } else { 0.0 });
            assert!((psd_slope(&power_spectrum(&across), band, side_m) - slope).abs() < 1e-6, "{side}");
        }
    }

    /// Lines of a sum of waves, half an octave apart: the rings between them are kept above 11.5 cycles per side.
    #[test]
    fn val_lines_far_above_the_side_leave_no_gaps() {
        let bin = |k: u32| {
            let f = libm::pow(2.0, f64::from(k) / RINGS_PER_OCTAVE);
            SpectrumBin {
                frequency_cycles_m: f,
                psd_m4: if k.is_multiple_of(4) { 1.0 } else { 1e-6 } / (f * f),
                modes: 9,
            }
        };
        let spectrum: Vec<SpectrumBin> = (32..64).map(bin).collect();
        assert!((0..spectrum.len()).any(|k| is_gap(&spectrum, k)));
        let [all, without] = [1.0, 0.001].map(|side_m| psd_slope(&spectrum, [16.0, 256.0], side_m));
        let logs: Vec<[f64; 2]> =
            spectrum.iter().map(|b| [libm::log(b.frequency_cycles_m), libm::log(b.psd_m4)]).collect();
        assert_eq!(all, crate::multifractality::line_slope(&logs));
        assert_ne!(all, without);
    }

    /// Falling, rising and bent spectra have no gaps; neither does a broad valley.
    #[test]
    fn val_no_gaps_in_smooth_spectra() {
        let of = |psd: &dyn Fn(f64) -> f64| -> Vec<SpectrumBin> {
            let bin = |f: f64| SpectrumBin { frequency_cycles_m: f, psd_m4: psd(f), modes: 9 };
            (0..60).map(|k| bin(libm::pow(2.0, f64::from(k) / RINGS_PER_OCTAVE))).collect()
        };
        let valley = |f: f64| libm::pow(f, -6.0) + 1e-6 * libm::pow(f, 4.0);
        let laws: [&dyn Fn(f64) -> f64; 4] =
            [&|f| libm::pow(f, -9.0), &|f| libm::pow(f, 9.0), &|f| libm::exp(-libm::pow(f - 20.0, 2.0)), &valley];
        for (n, law) in laws.into_iter().enumerate() {
            let spectrum = of(law);
            assert!((0..spectrum.len()).all(|k| !is_gap(&spectrum, k)), "{n}");
        }
    }

    /// Half of the rings is enough; fewer is not.
    #[test]
    fn val_a_slope_of_too_few_rings_is_nan() {
        let of = |noisy: usize| {
            let psd = |k: usize| if k <= noisy { 1e-16 } else { libm::pow(k as f64, -3.0) };
            let bin = |k| SpectrumBin { frequency_cycles_m: k as f64, psd_m4: psd(k), modes: 1 };
            psd_slope(&(1..=8).map(bin).collect::<Vec<_>>(), [0.5, 9.0], 1.0)
        };
        assert!([0, 1, 4].iter().all(|&noisy| (of(noisy) + 3.0).abs() < 1e-12));
        assert!(of(5).is_nan());
    }

    #[test]
    fn val_empty_small_and_flat_surfaces() {
        assert!(power_spectrum(&Grid::filled(Geometry::square(9, 9, 1.0), f64::NAN)).is_empty());
        assert!(power_spectrum(&Grid::filled(Geometry::square(2, 9, 1.0), 1.0)).is_empty());
        let flat = power_spectrum(&Grid::filled(Geometry::square(9, 9, 1.0), 1.0));
        assert!(psd_slope(&flat, [0.0, 1.0], 9.0).is_nan());
    }
}
