//! International Roughness Index of profiles.
//!
//! # What
//! The "golden car" quarter-car model is driven over the profile at 80 km/h. The index is the mean absolute suspension
//! velocity divided by the speed of the car, in m/km. With sprung height z_s, unsprung height z_u and ground h,
//! $$ \ddot z_s = -c(\dot z_s - \dot z_u) - k_2 (z_s - z_u) , \quad
//!    \mu \ddot z_u = c(\dot z_s - \dot z_u) + k_2 (z_s - z_u) + k_1 (h - z_u) , $$
//! c = 6 /s, k_1 = 653 /s2, k_2 = 63.3 /s2, mu = 0.15. The input is the slope of the profile over 250 mm (rounded to whole
//! cells), constant between cells, for which the state is advanced exactly. The car starts with the slope of the first 11 m.
//!
//! # Source
//! M. W. Sayers, On the calculation of international roughness index from longitudinal road profile, Transportation Research
//! Record 1501 (1995) 1-12; ASTM E1926.
//!
//! # When not to use it
//! The index is defined for roads. It is undefined for cells above 0.3 m and for profiles below 20 m.

use crate::band::transposed;
use crate::detrend::runs;
use rayon::prelude::*;
use sastrugi_numeric::{Grid, sums};
use serde::Serialize;

/// Speed, m/s.
const SPEED_M_S: f64 = 80.0 / 3.6;
/// Suspension damping over sprung mass, 1/s.
const DAMPING: f64 = 6.0;
/// Tyre stiffness over sprung mass, 1/s2.
const TYRE_STIFFNESS: f64 = 653.0;
/// Suspension stiffness over sprung mass, 1/s2.
const SUSPENSION_STIFFNESS: f64 = 63.3;
/// Unsprung over sprung mass.
const MASS_RATIO: f64 = 0.15;
/// Length over which the tyre envelops the profile, m.
const BASE_M: f64 = 0.25;
/// Length at the start of the profile whose slope initialises the car, m.
const START_M: f64 = 11.0;
/// Shortest profile, m.
const LENGTH_MIN_M: f64 = 20.0;
/// Largest cell, m.
const CELL_MAX_M: f64 = 0.3;
/// Halvings of a step before its exponential series, and number of terms of that series.
const HALVINGS: u32 = 10;
const TERMS: u32 = 14;

/// IRI of a surface: the mean over its profiles; NaN if they are too short or too coarse.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Iri {
    /// Mean of the profiles along x, m/km.
    pub along_x_m_km: f64,
    /// Mean of the profiles along y, m/km.
    pub along_y_m_km: f64,
}

/// IRI of all profiles along x (driven eastwards), and of all along y (southwards). Gaps split a profile.
pub fn iri(dem: &Grid) -> Iri {
    let [dx, dy] = dem.geometry.cell;
    let by_col = transposed(&dem.values, dem.rows(), dem.cols());
    Iri { along_x_m_km: mean_index(&dem.values, dem.cols(), dx), along_y_m_km: mean_index(&by_col, dem.rows(), dy) }
}

fn mean_index(profiles: &[f64], n: usize, cell_m: f64) -> f64 {
    let of_profile = |profile: &[f64]| -> Vec<f64> {
        runs(profile, 2).into_iter().filter_map(|[from, to]| iri_of_profile(&profile[from..to], cell_m)).collect()
    };
    let indices: Vec<Vec<f64>> = profiles.par_chunks(n).map(of_profile).collect();
    sums::mean(&indices.concat())
}

/// IRI of a profile of heights in m, m/km; `None` below 20 m, with cells above 0.3 m, or with gaps.
///
/// # Examples
/// ```
/// use sastrugi_roughness::iri_of_profile;
///
/// // 100 m of a uniform grade, and with a step of 1 cm in the middle, or of 2 cm: the index is linear in the profile.
/// let profile = |step_m: f64| -> Vec<f64> {
///     (0..1000).map(|k| 0.02 * f64::from(k) + if k < 500 { 0.0 } else { step_m }).collect()
/// };
/// let [grade, one, two] = [0.0, 0.01, 0.02].map(|step_m| iri_of_profile(&profile(step_m), 0.1).unwrap());
/// assert!(grade < 1e-9 && one > 0.1);
/// assert!((two / one - 2.0).abs() < 1e-9);
/// assert_eq!(iri_of_profile(&profile(0.0)[..100], 0.1), None);
/// ```
pub fn iri_of_profile(heights: &[f64], cell_m: f64) -> Option<f64> {
    let base = ((BASE_M / cell_m).round() as usize).max(1);
    let fine = cell_m > 0.0 && cell_m <= CELL_MAX_M * (1.0 + 1e-9);
    let long = heights.len() as f64 * cell_m >= LENGTH_MIN_M && heights.len() > base;
    if !(fine && long && heights.iter().all(|z| z.is_finite())) {
        return None;
    }
    let start = (START_M / cell_m).round() as usize;
    let first = (heights[start] - heights[0]) / (start as f64 * cell_m);
    let step = step(cell_m / SPEED_M_S);
    let mut state = [first, 0.0, first, 0.0];
    let mut strokes = Vec::with_capacity(heights.len() - base);
    for (behind, ahead) in heights.iter().zip(&heights[base..]) {
        let slope = (ahead - behind) / (base as f64 * cell_m);
        state = std::array::from_fn(|i| (0..4).fold(step[i][4] * slope, |sum, j| sum + step[i][j] * state[j]));
        strokes.push((state[0] - state[2]).abs());
    }
    Some(1000.0 * sums::mean(&strokes))
}

type Matrix = [[f64; 5]; 5];

/// Transition matrix of a time step, for the slopes of sprung and unsprung mass, their rates, and a constant ground slope:
/// the exponential of the system matrix.
fn step(time_s: f64) -> Matrix {
    let (k1, k2, c, mu) = (TYRE_STIFFNESS, SUSPENSION_STIFFNESS, DAMPING, MASS_RATIO);
    let motion = [
        [0.0, 1.0, 0.0, 0.0, 0.0],
        [-k2, -c, k2, c, 0.0],
        [0.0, 0.0, 0.0, 1.0, 0.0],
        [k2 / mu, c / mu, -(k1 + k2) / mu, -c / mu, k1 / mu],
        [0.0; 5],
    ];
    let part = time_s / f64::from(1u32 << HALVINGS);
    let scaled = motion.map(|row| row.map(|v| v * part));
    let one: Matrix = std::array::from_fn(|i| std::array::from_fn(|j| f64::from(u8::from(i == j))));
    // Horner: 1 + X (1 + X/2 (1 + X/3 (...))).
    let series = (1..=TERMS).rev().fold(one, |inner, k| {
        let product = multiply(&scaled, &inner);
        std::array::from_fn(|i| std::array::from_fn(|j| one[i][j] + product[i][j] / f64::from(k)))
    });
    (0..HALVINGS).fold(series, |power, _| multiply(&power, &power))
}

fn multiply(a: &Matrix, b: &Matrix) -> Matrix {
    std::array::from_fn(|i| std::array::from_fn(|j| (0..5).map(|k| a[i][k] * b[k][j]).sum()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use sastrugi_numeric::Geometry;
    use sastrugi_numeric::fft::Complex64;
    use std::f64::consts::{PI, TAU};

    /// IRI of a sine divided by its mean slope: the transfer function of the car, solved by hand, times that of a slope over
    /// the base (the mean of a rectified slope is 4 a / lambda).
    fn gain(wavelength_m: f64, base_m: f64) -> f64 {
        let omega = TAU * SPEED_M_S / wavelength_m;
        let suspension = Complex64::new(SUSPENSION_STIFFNESS, DAMPING * omega);
        let one = Complex64::new(1.0, 0.0);
        let wheel = TYRE_STIFFNESS - MASS_RATIO * omega * omega;
        let stroke = one * TYRE_STIFFNESS / ((suspension / (omega * omega) - one) * wheel - suspension);
        let u = PI * base_m / wavelength_m;
        stroke.norm() * (libm::sin(u) / u).abs()
    }

    fn index_of_sine(amplitude_m: f64, wavelength_m: f64, cell_m: f64) -> f64 {
        let n = (2000.0 / cell_m) as usize;
        let heights: Vec<f64> =
            (0..n).map(|k| amplitude_m * libm::sin(TAU * k as f64 * cell_m / wavelength_m)).collect();
        iri_of_profile(&heights, cell_m).unwrap()
    }

    /// Steady motion over 2 km of sines; the start-up transient is below 0.5 % of it.
    #[test]
    fn val_sines_have_the_index_of_the_transfer_function() {
        for wavelength in [0.8, 1.3, 2.4, 5.0, 8.0, 15.4, 30.0, 60.0] {
            let index = index_of_sine(0.01, wavelength, 0.05);
            let wanted = 1000.0 * 4.0 * 0.01 / wavelength * gain(wavelength, 0.25);
            assert!((index / wanted - 1.0).abs() < 0.01, "{wavelength}: {index} {wanted}");
        }
    }

    /// Sayers and Karamihas, The Little Book of Profiling (1998), section on the IRI: its gain for slope peaks at
    /// wavelengths near 15 m and 2.4 m, and has fallen to one half at about 30 m and 1.25 m.
    #[test]
    fn val_the_gain_has_its_published_peaks() {
        let wavelengths: Vec<f64> = (0..1200).map(|k| 0.9 * libm::exp2(f64::from(k) / 200.0)).collect();
        let peak = |low: f64, high: f64| {
            let inside = wavelengths.iter().filter(|w| (low..high).contains(*w));
            *inside.max_by(|a, b| gain(**a, 0.25).total_cmp(&gain(**b, 0.25))).unwrap()
        };
        assert!((peak(1.2, 5.0) / 2.4 - 1.0).abs() < 0.1, "{}", peak(1.2, 5.0));
        assert!((peak(5.0, 40.0) / 15.0 - 1.0).abs() < 0.1, "{}", peak(5.0, 40.0));
        assert!((gain(30.0, 0.25) - 0.5).abs() < 0.1 && (gain(1.25, 0.25) - 0.5).abs() < 0.15);
    }

    /// The equations of the header, integrated by Runge-Kutta steps a fortieth of a cell long, from the mean slope of the first 11 m: over
    /// a ramp that ends after half of them, so that the car starts out of balance.
    #[test]
    fn val_the_index_equals_an_integration() {
        let cell: f64 = 0.05;
        let heights: Vec<f64> = (0..600)
            .map(|k| f64::from(k) * cell)
            .map(|x| 0.02 * x.min(5.5) + 0.01 * libm::sin(TAU * x / 3.1) * x / 30.0)
            .collect();
        let (start, base) = (220, 5);
        let first = (heights[start] - heights[0]) / 11.0;
        let mut state = [first, 0.0, first, 0.0];
        let step_s = cell / (80.0 / 3.6) / 40.0;
        let mut strokes = 0.0;
        for k in 0..600 - base {
            let ground = (heights[k + base] - heights[k]) / 0.25;
            let rate = |[s, ds, u, du]: [f64; 4]| {
                let suspension = 6.0 * (ds - du) + 63.3 * (s - u);
                [ds, -suspension, du, (suspension + 653.0 * (ground - u)) / 0.15]
            };
            for _ in 0..40 {
                let ahead =
                    |r: [f64; 4], share: f64| -> [f64; 4] { std::array::from_fn(|i| state[i] + share * step_s * r[i]) };
                let a = rate(state);
                let b = rate(ahead(a, 0.5));
                let c = rate(ahead(b, 0.5));
                let d = rate(ahead(c, 1.0));
                state = std::array::from_fn(|i| state[i] + step_s / 6.0 * (a[i] + 2.0 * b[i] + 2.0 * c[i] + d[i]));
            }
            strokes += (state[0] - state[2]).abs();
        }
        let expected = 1000.0 * strokes / (600 - base) as f64;
        let found = iri_of_profile(&heights, cell).unwrap();
        assert!(expected > 0.1 && (found / expected - 1.0).abs() < 1e-7, "{found} {expected}");
    }

    /// Ridges across y on oblong cells: profiles along x are level, and those along y have their own cell size. Pieces beside a gap that
    /// are shorter than 20 m are left out.
    #[test]
    fn val_each_axis_has_its_own_profiles() {
        let g = Geometry { rows: 150, cols: 250, cell: [0.1, 0.2], origin: [0.0; 2] };
        let sine: Vec<f64> = (0..150).map(|r| 0.01 * libm::sin(TAU * 0.2 * f64::from(r) / 5.0)).collect();
        let mut dem = Grid::new(g, (0..g.len()).map(|k| sine[k / 250]).collect());
        let expected = iri_of_profile(&sine, 0.2).unwrap();
        for _ in 0..2 {
            let found = iri(&dem);
            assert!(found.along_x_m_km < 1e-9 && (found.along_y_m_km / expected - 1.0).abs() < 1e-12, "{found:?}");
            dem.values[75 * 250 + 20] = f64::NAN;
        }
    }

    #[test]
    fn prop_the_index_is_linear_and_unaffected_by_planes() {
        let index = index_of_sine(0.01, 5.0, 0.1);
        assert!((index_of_sine(0.03, 5.0, 0.1) / index - 3.0).abs() < 1e-9);
        let plane: Vec<f64> = (0..1000).map(|k| 3.0 + 0.02 * f64::from(k)).collect();
        assert!(iri_of_profile(&plane, 0.1).unwrap() < 1e-9);
    }

    #[test]
    fn val_short_coarse_or_empty_profiles_have_no_index() {
        assert_eq!(iri_of_profile(&[0.0; 100], 0.1), None);
        assert_eq!(iri_of_profile(&[0.0; 1000], 0.4), None);
        assert_eq!(iri_of_profile(&[f64::NAN; 1000], 0.1), None);
        assert_eq!(iri_of_profile(&[], 0.1), None);
        let strip = iri(&Grid::filled(Geometry::square(3, 400, 0.1), 1.0));
        assert!(strip.along_x_m_km == 0.0 && strip.along_y_m_km.is_nan());
    }

    /// Coefficients of the published program for heights 0.25 m apart (Sayers, Gillespie and Paterson, World Bank Technical
    /// Paper 46, 1986; also ASTM E1926), to seven digits.
    #[test]
    fn val_the_step_has_the_published_coefficients() {
        let published = [
            [0.9966071, 0.01091514, -0.002083274, 0.0003190145, 0.005476107],
            [-0.5563044, 0.9438768, -0.8324718, 0.05064701, 1.388776],
            [0.02153176, 0.002126763, 0.7508714, 0.008221888, 0.2275968],
            [3.335013, 0.3376467, -39.12762, 0.4347564, 35.79262],
        ];
        let step = step(0.25 / SPEED_M_S);
        for (ours, theirs) in step.iter().flatten().zip(published.as_flattened()) {
            assert!((ours - theirs).abs() < 1e-6 * (1.0 + theirs.abs()), "{ours} {theirs}");
        }
    }

    /// A step of 0.3 m equals two steps of 0.15 m, and slow motion follows the ground.
    #[test]
    fn val_the_step_is_an_exponential() {
        let (full, half) = (step(0.3 / SPEED_M_S), step(0.15 / SPEED_M_S));
        let twice = multiply(&half, &half);
        let differs = |i: usize, j: usize| (full[i][j] - twice[i][j]).abs() / (1.0 + full[i][j].abs());
        assert!((0..25).all(|k| differs(k / 5, k % 5) < 1e-10), "{full:?} {twice:?}");
        // A state at rest on a constant slope stays at rest: the slope coefficients sum to 1.
        assert!((full[0][0] + full[0][2] + full[0][4] - 1.0).abs() < 1e-10);
    }
}
