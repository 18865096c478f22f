//! Areal parameters of a surface, after ISO 25178-2:2021.
//!
//! Heights z are taken above the least-squares plane (the F-operator; the cell is the only S-filter), over the A cells with
//! data.
//!
//! | parameter | formula |
//! |---|---|
//! | Sq, Sa | `sqrt(sum z^2 / A)`, `sum abs(z) / A` |
//! | Ssk, Sku | `sum z^3 / (A Sq^3)`, `sum z^4 / (A Sq^4)` (3 for a normal distribution) |
//! | Sp, Sv, Sz | `max z`, `-min z`, `Sp + Sv`: grow with the number of cells |
//! | Sdq | `sqrt(<z_x^2 + z_y^2>)`, central differences: grows as cells get smaller |
//! | Sal, Str | autocorrelation length and texture aspect ratio: [`crate::autocorrelation`] |
//! | Std | texture direction: [`crate::SpectralMap::direction_deg`], over the band in which the slope of the spectrum is fitted |
//!
//! Also computed: the Hurst exponent ([`crate::hurst`]), the structure exponents ([`crate::multifractality`]), the structure
//! function and the profile spectra.
//!
//! Parameters of two surfaces are comparable only if cell and band agree: the residual of a moving average has no structure
//! beyond its window. Cost: three to seven transforms of the padded grid; about 100 bytes per cell.

use crate::gradient::rms_slopes;
use crate::hurst::{Hurst, hurst};
use crate::lags::LagSums;
use crate::multifractality::{ScalingExponent, scaling_exponents};
use crate::plane::level;
use crate::profiles::{ProfileBin, profile_spectra};
use crate::spectrum::SpectralMap;
use crate::structure::{StructureBin, autocorrelation, lags_of, structure_function};
use sastrugi_numeric::{Grid, sums};
use serde::Serialize;

/// Areal parameters; NaN where undefined.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ArealParameters {
    /// Root mean square height, m.
    pub sq_m: f64,
    /// Mean absolute height, m.
    pub sa_m: f64,
    /// Skewness.
    pub ssk: f64,
    /// Kurtosis.
    pub sku: f64,
    /// Highest peak, m.
    pub sp_m: f64,
    /// Deepest pit, m.
    pub sv_m: f64,
    /// Height of the highest peak above the deepest pit, m.
    pub sz_m: f64,
    /// Root mean square slope.
    pub sdq: f64,
    /// Root mean square slope along x and along y.
    pub rms_slopes: [f64; 2],
    /// Autocorrelation length, m.
    pub sal_m: f64,
    /// Texture aspect ratio Str.
    pub aspect_ratio: f64,
    /// Texture direction Std, degrees clockwise from north in [0, 180).
    pub direction_deg: f64,
    /// Hurst exponent; `None` if the surface has too few pairs.
    pub hurst: Option<Hurst>,
    /// Structure exponents zeta(1) to zeta(4); `None` if the surface is too small.
    pub exponents: Option<[ScalingExponent; 4]>,
    /// Structure function.
    #[serde(skip)]
    pub structure: Vec<StructureBin>,
    /// Spectra of profiles.
    #[serde(skip)]
    pub profiles: Vec<ProfileBin>,
}

/// Areal parameters of a surface: `map` is its spectrum, `band_cycles_m` the frequencies used for the texture direction,
/// `hurst_lags_m` the lags of the Hurst exponent (see [`hurst`]).
pub fn areal_parameters(
    dem: &Grid,
    map: Option<&SpectralMap>,
    band_cycles_m: [f64; 2],
    hurst_lags_m: Option<[f64; 2]>,
) -> ArealParameters {
    let surface = level(dem);
    let cell = surface.geometry.cell;
    let heights = sums::finite(&surface.values);
    let mean = |f: fn(f64) -> f64| sums::mean(&heights.iter().map(|&z| f(z)).collect::<Vec<_>>());
    let variance = mean(|z| z * z);
    let (low, high) = surface.range().unwrap_or((f64::NAN, f64::NAN));
    let [slope_x, slope_y] = rms_slopes(&surface);
    let lags = LagSums::of(&surface, lags_of(&surface));
    let texture = autocorrelation(&lags, cell);
    ArealParameters {
        sq_m: variance.sqrt(),
        sa_m: mean(f64::abs),
        ssk: mean(|z| z * z * z) / (variance * variance.sqrt()),
        sku: mean(|z| z * z * (z * z)) / (variance * variance),
        sp_m: high,
        sv_m: -low,
        sz_m: high - low,
        sdq: (slope_x * slope_x + slope_y * slope_y).sqrt(),
        rms_slopes: [slope_x, slope_y],
        sal_m: texture.sal_m,
        aspect_ratio: texture.aspect_ratio,
        direction_deg: if variance > 0.0 { map.map_or(f64::NAN, |m| m.direction_deg(band_cycles_m)) } else { f64::NAN },
        hurst: hurst(&surface, hurst_lags_m),
        exponents: scaling_exponents(&surface),
        structure: structure_function(&lags, cell),
        profiles: profile_spectra(&surface),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use sastrugi_numeric::{Geometry, Streams};
    use std::f64::consts::{FRAC_1_SQRT_2, PI, TAU};

    fn parameters(dem: &Grid) -> ArealParameters {
        areal_parameters(dem, SpectralMap::of(dem).as_ref(), [0.1, 3.0], None)
    }

    /// A wave of amplitude 1 on a plane: Sq = 1 / sqrt(2), Sa = 2 / pi, Sku = 3/2, Ssk = 0, Sz = 2, and a slope of
    /// sin(k d) / (d sqrt(2)) by central differences. The plane fitted to the wave is not exactly level: tolerance 1 %.
    #[test]
    fn val_a_wave_on_a_plane() {
        let g = Geometry { rows: 400, cols: 401, cell: [0.05, 0.08], origin: [0.0; 2] };
        let k = TAU / 1.0;
        let dem = Grid::new(
            g,
            (0..g.len()).map(|i| libm::sin(k * g.x(i % 401)) + 0.3 * g.x(i % 401) - g.y(i / 401)).collect(),
        );
        let f = parameters(&dem);
        let near = |value: f64, expected: f64| (value / expected - 1.0).abs() < 0.01;
        assert!(near(f.sq_m, FRAC_1_SQRT_2) && near(f.sa_m, 2.0 / PI) && near(f.sku, 1.5), "{f:?}");
        assert!(f.ssk.abs() < 0.02 && (f.sz_m - 2.0).abs() < 0.15, "{f:?}");
        assert!(near(f.sdq, libm::sin(k * 0.05) / 0.05 * FRAC_1_SQRT_2), "{f:?}");
        assert!(f.rms_slopes[1] < 0.01 * f.rms_slopes[0]);
        // Ridges run north-south.
        assert!(f.direction_deg < 2.0 || f.direction_deg > 178.0, "{f:?}");
        assert!(near(f.sal_m, libm::acos(0.2) / k), "{f:?}");
    }

    /// One cell of 8 m amid eight of -1 m, 100 m up: moments 8, 56 and 456 m to their powers.
    #[test]
    fn val_a_peak_by_hand() {
        let mut dem = Grid::filled(Geometry::square(3, 3, 1.0), 99.0);
        dem.values[4] = 108.0;
        let f = areal_parameters(&dem, None, [0.1, 0.4], None);
        let near = |value: f64, expected: f64| (value - expected).abs() < 1e-12;
        assert!(near(f.sq_m, 8.0f64.sqrt()) && near(f.sa_m, 16.0 / 9.0), "{f:?}");
        assert!(near(f.ssk, 56.0 / 512.0f64.sqrt()) && near(f.sku, 456.0 / 64.0), "{f:?}");
        assert!(near(f.sp_m, 8.0) && near(f.sv_m, 1.0) && near(f.sz_m, 9.0), "{f:?}");
        // The peak itself is level, and only it has four neighbours.
        assert!(f.sdq == 0.0 && f.rms_slopes == [0.0; 2] && f.direction_deg.is_nan(), "{f:?}");
    }

    /// White noise with and without holes: moments within 7 standard errors (sqrt(1/2n), sqrt(6/n), sqrt(24/n); 1e-10).
    #[test]
    fn stat_moments_of_noise_with_holes() {
        for hole_share in [0.0, 0.4] {
            let mut s = Streams::for_seed(1, "areal-test").stream("noise");
            let mut value = || if s.uniform() < hole_share { f64::NAN } else { 0.01 * s.normal() };
            let dem = Grid::new(Geometry::square(200, 300, 0.1), (0..60_000).map(|_| value()).collect());
            let n = dem.finite_count() as f64;
            let f = parameters(&dem);
            assert!((f.sq_m / 0.01 - 1.0).abs() < 7.0 * (0.5 / n).sqrt(), "{f:?}");
            assert!(f.ssk.abs() < 7.0 * (6.0 / n).sqrt() && (f.sku - 3.0).abs() < 7.0 * (24.0 / n).sqrt(), "{f:?}");
            assert!((f.sa_m / 0.01 - (2.0 / PI).sqrt()).abs() < 7.0 * (0.37 / n).sqrt(), "{f:?}");
        }
    }

    #[test]
    fn val_empty_and_flat_surfaces() {
        for value in [f64::NAN, 3.0] {
            let f = parameters(&Grid::filled(Geometry::square(40, 40, 1.0), value));
            assert!(f.ssk.is_nan() && f.sal_m.is_nan() && f.hurst.is_none() && f.direction_deg.is_nan(), "{f:?}");
        }
    }
}
