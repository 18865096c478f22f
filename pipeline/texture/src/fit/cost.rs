//! Processor time of a fit.
//!
//! For n cells, a window of w x v cells, m forms, B replicates of at most n' cells, and r rings of lags:
//! $$ t = t_0 + t_n n + k\, t_w W w v (s + \frac{m - 1}{5}) + B\,(t_s n' + k'\, t_r r^2 d\, u) $$
//! The first two terms are the search for objects and the moving averages of the complete raster. The `W` term is the model on the lags of a
//! window, which every step of a search recomputes; the number of steps hardly depends on the data. Every form is fitted once; the best is
//! fitted again at other windows and, along its profile, with ranges held: W is [`WINDOWS`], more where three double windows fit into the raster. A
//! replicate is a surface, its transforms, a search from a good start, and four such searches for resampled blocks, all with the best form. k is 1 where
//! all windows are complete. Holes make most windows partial, but are known only once the heights are read: k is [`MEASURED`] for measured DEMs, times
//! [`OBLONG`] for oblong cells, whose lags have more distinct lengths. k' is [`MEASURED_REPLICATE`] or 1. d is [`DIRECTIONAL`] if a form is anisotropic and
//! therefore needs bins by direction.
//!
//! s and u are the cost of the best form relative to an exponential ([`relative_cost`]). Of several forms it is not known before the fit which
//! one is best: s is the mean of the costliest and of the average form, u the geometric mean of the costliest and of the cheapest.
//!
//! The constants were calibrated on surfaces of 90 000 to 1.4 million cells, windows of 20 to 200 cells, complete and with 44 % of holes, on
//! one core; the predictions were within a factor of 1.5 of the measured times. With replicates of the best of nine forms they were within a factor of 2.5:
//! the best costs as much as an exponential, or twenty times as much.

use super::params::Mode;
use super::resampling::CELLS_MAX;
use super::{FitSettings, case};
use crate::covariance::Form;
use crate::synth::Prospect;
use sastrugi_numeric::Geometry;
use sastrugi_roughness::background::BoxWindow;

/// Fixed cost of a fit, s.
const BASE_S: f64 = 0.3;
/// Per cell, s.
const CELL_S: f64 = 7e-7;
/// Per cell of a window, for all steps of the search for one form, s.
const WINDOW_CELL_S: f64 = 1.8e-4;
/// Per cell of a replicate, s.
const REPLICATE_CELL_S: f64 = 2.0e-7;
/// Per replicate and pair of rings, s.
const REPLICATE_RINGS_S: f64 = 1.05e-4;
/// Cost of the windows at which a raster is fitted, relative to the first: without and with the double one.
const WINDOWS: [f64; 2] = [1.6, 3.4];
/// Factor for holes and ragged borders of a measured DEM.
const MEASURED: f64 = 2.1;
/// The same for a replicate.
const MEASURED_REPLICATE: f64 = 1.5;
/// Factor for oblong cells.
const OBLONG: f64 = 1.8;
/// Factor for bins by direction in a replicate.
const DIRECTIONAL: f64 = 2.4;
/// Factors for a model that needs Bessel functions, in a search and in a replicate.
const BESSEL: [f64; 2] = [2.0, 4.5];
/// The same for a second term, whose parameters are less certain.
const SECOND_TERM: [f64; 2] = [1.0, 3.0];
/// The same for an anisotropic form, whose covariance does not follow from distance alone, beside that for bins by direction.
const ANISOTROPIC: [f64; 2] = [1.4, 1.8];
/// Most rings of lags.
const RINGS_MAX: f64 = 32.0;
/// Per cell in `paper` mode, s.
const PAPER_CELL_S: f64 = 4e-7;
/// For the statistics of a residual, s: fixed and per cell. An estimate, not calibrated.
const STATISTICS_S: [f64; 2] = [3.0, 6e-6];
/// Windows assumed across a surface of unknown cell size.
const WINDOWS_ACROSS: f64 = 10.0;
/// Windows along the torus of a non-periodic texture of a model: sixteen ranges of an exponential, each assumed as long as the window. A fit may find a
/// longer range, up to the bound of its search; if that were planned for, most textures would run alone or not at all.
const TORUS_WINDOWS: f64 = 16.0;

impl FitSettings {
    /// What is known before the fit of a surface with this number of cells, for planning.
    pub fn prospect(&self, cell_m: Option<[f64; 2]>, cells: u64) -> Prospect {
        let window = |cell_m: [f64; 2]| BoxWindow::nearest(self.outer_scale_m(), cell_m);
        let lags = |cell_m: [f64; 2]| {
            let binned = case::lag_cells(self.wanted_lag_m(cell_m), cell_m);
            case::measured_lags(binned, window(cell_m))
        };
        Prospect {
            torus_m: TORUS_WINDOWS * self.outer_scale_m(),
            cell_m,
            cells: Some(cells),
            window_m: cell_m.map_or([self.outer_scale_m(); 2], |cell_m| window(cell_m).size_m(cell_m)),
            is_measured: self.is_empirical(),
            max_lag: cell_m.filter(|_| self.is_empirical()).map_or([0; 2], lags),
            has_statistics: self.has_statistics(),
        }
    }

    /// Approximate time of a fit of `cells` cells on one core, s. If shape and cell size are unknown, a square ten windows wide is assumed.
    pub fn seconds(&self, cells: u64, place: Option<&Geometry>, is_measured: bool) -> f64 {
        let n = cells as f64;
        if self.mode() == Mode::Paper {
            return 0.02 + PAPER_CELL_S * n;
        }
        let window = self.window_cells(n, place);
        let [search, replicate] = self.relative_cost();
        let searches = search + (self.forms.len() as f64 - 1.0) / 5.0;
        let [holes, of_replicate] = if is_measured { [MEASURED, MEASURED_REPLICATE] } else { [1.0; 2] };
        let k = if place.is_some_and(is_oblong) { OBLONG * holes } else { holes };
        BASE_S
            + CELL_S * n
            + k * WINDOW_CELL_S * self.windows(place) * window[0] * window[1] * searches
            + self.bootstrap() as f64 * self.replicate_seconds(n, window, of_replicate * replicate)
            + if self.has_statistics() { STATISTICS_S[0] + STATISTICS_S[1] * n.min(CELLS_MAX as f64) } else { 0.0 }
    }

    /// Expected cost of the best form in a search and in a replicate, relative to an exponential.
    fn relative_cost(&self) -> [f64; 2] {
        let of_forms: Vec<[f64; 2]> = self.forms.iter().map(relative_cost).collect();
        let most = |k: usize| of_forms.iter().fold(0.0, |most: f64, of_form| most.max(of_form[k]));
        let least = of_forms.iter().fold(f64::INFINITY, |least: f64, of_form| least.min(of_form[1]));
        let sum: f64 = of_forms.iter().map(|of_form| of_form[0]).sum();
        [0.5 * (most(0) + sum / of_forms.len() as f64), (most(1) * least).sqrt()]
    }

    fn replicate_seconds(&self, cells: f64, window: [f64; 2], k: f64) -> f64 {
        // Lags up to half a window.
        let rings = (0.5 * window[0].max(window[1])).clamp(3.0, RINGS_MAX);
        let directions = if self.forms.iter().any(Form::is_anisotropic) { DIRECTIONAL } else { 1.0 };
        REPLICATE_CELL_S * cells.min(CELLS_MAX as f64) + k * REPLICATE_RINGS_S * rings * rings * directions
    }

    /// Cells along the window, east-west and north-south.
    fn window_cells(&self, cells: f64, place: Option<&Geometry>) -> [f64; 2] {
        let unknown = [cells.sqrt() / WINDOWS_ACROSS; 2];
        place
            .map_or(unknown, |g| g.cell.map(|cell| self.outer_scale_m() / cell))
            .map(|side| side.clamp(1.0, cells.sqrt().max(1.0)))
    }

    /// Cost of the windows tried.
    fn windows(&self, place: Option<&Geometry>) -> f64 {
        let across = place.map_or(WINDOWS_ACROSS, |g| g.size()[0].min(g.size()[1]) / self.outer_scale_m());
        WINDOWS[usize::from(across >= 6.0)]
    }
}

/// Cost of a form in a search and in a replicate, relative to an exponential.
fn relative_cost(form: &Form) -> [f64; 2] {
    let has_bessel = form.name().contains("matern");
    let factors = [(has_bessel, BESSEL), (form.terms().len() > 1, SECOND_TERM), (form.is_anisotropic(), ANISOTROPIC)];
    let applied = factors.into_iter().filter(|(applies, _)| *applies);
    applied.fold([1.0; 2], |cost, (_, factor)| [cost[0] * factor[0], cost[1] * factor[1]])
}

fn is_oblong(place: &Geometry) -> bool {
    (place.cell[0] / place.cell[1] - 1.0).abs() > 1e-3
}

#[cfg(test)]
mod tests {
    use super::super::FitParameters;
    use super::*;

    fn seconds(parameters: FitParameters, place: Geometry, is_measured: bool) -> f64 {
        FitSettings::try_from(parameters).unwrap().seconds(place.len() as u64, Some(&place), is_measured)
    }

    /// Processor times on one core, s, of 2026-11-28: a gravel bar with 44 % holes at 2 cm cells, a hillside with a third holes at 50 cm cells,
    /// a complete radar DEM with oblong cells, and complete synthetic surfaces at 5 cm cells.
    #[test]
    fn val_predictions_are_near_the_measured_times() {
        let of = |outer_scale_m: f64, bootstrap: u32, model: &str| FitParameters {
            outer_scale_m,
            bootstrap,
            model: model.to_owned(),
            ..FitParameters::default()
        };
        let gravel = Geometry::square(331, 423, 0.02);
        let hillside = Geometry::square(561, 542, 0.5);
        let radar = Geometry { rows: 344, cols: 403, cell: [74.65, 92.4], origin: [0.0; 2] };
        let snow = |side: usize| Geometry::square(side, side, 0.05);
        for (outer_scale_m, bootstrap, model, place, is_measured, measured_s) in [
            (0.5, 0, "exponential", gravel, true, 1.32),
            (0.5, 99, "exponential", gravel, true, 6.01),
            (0.5, 99, "empirical", gravel, true, 5.98),
            (0.5, 0, "auto", gravel, true, 2.40),
            (1.0, 0, "exponential", gravel, true, 3.64),
            (1.0, 99, "exponential", gravel, true, 14.76),
            (2.0, 0, "exponential", gravel, true, 6.46),
            (2.0, 99, "exponential", gravel, true, 21.05),
            (10.0, 99, "exponential", hillside, true, 10.87),
            (40.0, 0, "exponential", hillside, true, 9.63),
            (9000.0, 0, "exponential", radar, true, 13.95),
            (9000.0, 99, "exponential", radar, true, 23.21),
            (1.0, 39, "exponential", snow(300), false, 1.64),
            (2.0, 39, "exponential", snow(300), false, 3.30),
            (1.0, 39, "exponential", snow(600), false, 4.04),
            (2.0, 39, "exponential", snow(600), false, 5.20),
            (4.0, 0, "exponential", snow(600), false, 4.23),
            (1.0, 39, "exponential", snow(1200), false, 10.95),
            (2.0, 39, "exponential", snow(1200), false, 10.76),
            (10.0, 0, "exponential", snow(1200), false, 17.41),
            (1.0, 39, "exponential", gravel, true, 7.42),
            (1.0, 39, "exponential+gaussian", gravel, true, 14.03),
            (1.0, 0, "anisotropic:exponential", gravel, true, 4.30),
            (1.0, 39, "anisotropic:exponential", gravel, true, 25.56),
            (1.0, 0, "matern", gravel, true, 5.71),
            (1.0, 39, "matern", gravel, true, 23.92),
            (1.0, 0, "anisotropic:matern", gravel, true, 14.09),
            (1.0, 39, "anisotropic:matern", gravel, true, 81.24),
            (1.0, 0, "auto", gravel, true, 18.16),
            (2.0, 0, "auto", gravel, true, 32.30),
        ] {
            let ratio = seconds(of(outer_scale_m, bootstrap, model), place, is_measured) / measured_s;
            println!("{outer_scale_m} m, {bootstrap} replicates, {model}: {ratio:.2} of the measured {measured_s} s");
            assert!((1.0 / 1.5..1.5).contains(&ratio), "{outer_scale_m} m, {bootstrap}, {model}: {ratio}");
        }
        // The best of nine forms was a Gaussian, then `anisotropic:matern`, whose replicates cost twenty times as much.
        for (outer_scale_m, bootstrap, measured_s) in [(0.5, 99, 10.1), (1.0, 39, 79.3)] {
            let ratio = seconds(of(outer_scale_m, bootstrap, "auto"), gravel, true) / measured_s;
            assert!((1.0 / 2.5..2.5).contains(&ratio), "{outer_scale_m} m, {bootstrap}, auto: {ratio}");
        }
    }
}
