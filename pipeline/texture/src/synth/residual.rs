//! Common to the methods that repeat more of a site than its covariance: [`super::modulated`], [`super::wavelet_statistics`],
//! [`super::quilting`] and [`super::exemplar`].
//!
//! They form a second family next to [`super::Texture`], little of which applies to them. A [`super::Kernel`] aims at a covariance model, on
//! cells of any size, rotated and stretched as requested, and its mean covariance is known. These methods repeat the measured residual
//! ([`Source`]): the DEM minus its background, or statistics of that. Hence:
//!
//! * the cells are those of the site;
//! * directions, heights and long waves are the site's: a tile has no `ratio`, `azimuth_deg`, `outer_m`, `marginal` and `marginal_m`;
//! * waves longer than the window of the fit are missing, and belong to the base that the texture is added to; on the background of the fit
//!   (`covariance = "residual"`), wavelengths near the window are amplified ([`super::raised`]);
//! * noise and blur of the DEM, which a fit takes out of its covariance where they are stated, are in the residual and in the texture;
//! * the mean covariance of an ensemble is not known beforehand: [`Synthesis::covariance`] states the residual's along rows, with NaN as
//!   `achieved_m2`, and [`Synthesis::ratio`] is NaN. A scoreboard measures both on realisations.
//!
//! Size, cells, repetition and seams are those of [`Tile`].

use super::fft_ma::CovarianceOf;
use super::measured::{self, Measured};
use super::raised::Raised;
use super::statistics::lags;
use super::tile::{self, OF_COVARIANCE, Tile};
use super::{Cost, LagCovariance, Method, Prospect, Synthesis, SynthesisError, TextureOutcome};
use crate::covariance::filtered::Measurement;
use crate::covariance::masked_covariance;
use crate::fit::FitSettings;
use sastrugi_numeric::{Geometry, Grid, Streams};
use sastrugi_schemas::ParameterError;
use sastrugi_schemas::fit::FitFile;
use sastrugi_schemas::statistics::{LagCovariances, Statistics};
use schemars::JsonSchema;
use serde::Serialize;
use serde::de::DeserializeOwned;
use serde_json::Value;
use std::sync::Arc;

/// Relative difference of cell sizes that counts as rounding.
const CELL_TOLERANCE: f64 = 1e-6;
/// Lags of a measured residual reach this share of a side of the site.
const LAG_SHARE: usize = 4;
/// How the note begins on what a texture lacks without a base; where holes are filled, their surroundings give it.
pub const NO_LONG_WAVES: &str = "the texture has no waves longer than the window of the fit";

/// What a method needs of the measured ground.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Needs {
    /// A covariance: any fit, also a stated one.
    Covariance,
    /// The statistics of the residual: a fit with `statistics = true`.
    Statistics,
    /// The residual itself: the fit's DEM.
    Residual,
}

/// What a texture repeats.
pub trait Source: Send + Sync + Sized + 'static {
    /// Which of them it is.
    const NEEDS: Needs;

    /// The source for a method: from a fit, and from the residual of its DEM if there is one.
    ///
    /// # Errors
    /// A fit without statistics, or with damaged ones; no residual.
    fn of(method: &str, fit: &FitFile, measured: Option<&Arc<Measured>>) -> Result<Arc<Self>, ParameterError>;

    /// Cells of the site, east-west and north-south, m.
    fn cell_m(&self) -> [f64; 2];

    /// Number of cells of the site.
    fn cells(&self) -> u64;

    /// Operations of [`Self::covariances_m2`] for a site of `cells` cells.
    fn covariances_operations(cells: u64) -> f64;

    /// Covariance of the residual at lags of 0, 1, 2 ... cells along rows, m2: `most` lags beyond 0, or as many as are known.
    fn along_rows_m2(&self, most: usize) -> Vec<f64>;

    /// Covariance of the residual at lags in all directions, m2, as far as it is known.
    fn covariances_m2(&self) -> LagCovariances;

    /// Notes for the user.
    fn notes(&self) -> Vec<String>;
}

impl Source for Statistics {
    const NEEDS: Needs = Needs::Statistics;

    fn of(method: &str, fit: &FitFile, _: Option<&Arc<Measured>>) -> Result<Arc<Self>, ParameterError> {
        let Some(statistics) = &fit.statistics else { return Err(no_statistics(method)) };
        statistics.check()?;
        Ok(Arc::new(Statistics::clone(statistics)))
    }

    fn cell_m(&self) -> [f64; 2] {
        self.cell_m
    }

    fn cells(&self) -> u64 {
        self.cells
    }

    /// None: they are stored.
    fn covariances_operations(_: u64) -> f64 {
        0.0
    }

    fn along_rows_m2(&self, most: usize) -> Vec<f64> {
        lags::along_rows(&self.covariance, most)
    }

    fn covariances_m2(&self) -> LagCovariances {
        self.covariance.clone()
    }

    fn notes(&self) -> Vec<String> {
        Vec::new()
    }
}

impl Source for Measured {
    const NEEDS: Needs = Needs::Residual;

    fn of(method: &str, _: &FitFile, measured: Option<&Arc<Measured>>) -> Result<Arc<Self>, ParameterError> {
        measured.cloned().ok_or_else(|| {
            let message = format!(
                "is `{method}`, which copies cells of the measured residual; give the DEM of the fit with --exemplar (in a study, name a \
                 fit of a DEM)"
            );
            ParameterError::new("method", message)
        })
    }

    fn cell_m(&self) -> [f64; 2] {
        self.residual.geometry.cell
    }

    fn cells(&self) -> u64 {
        self.residual.geometry.len() as u64
    }

    fn covariances_operations(cells: u64) -> f64 {
        measured::correlation_operations(cells)
    }

    fn along_rows_m2(&self, most: usize) -> Vec<f64> {
        let z = &self.residual;
        let most = most.min(z.cols() / LAG_SHARE);
        let found = masked_covariance(&z.values, z.cols(), [0, most]);
        (0..=most as isize).map_while(|lag| found.covariance(0, lag)).collect()
    }

    fn covariances_m2(&self) -> LagCovariances {
        let z = &self.residual;
        lags::measure(z, [z.rows(), z.cols()].map(|side| side / LAG_SHARE))
    }

    fn notes(&self) -> Vec<String> {
        vec!["made of cells of the site: licence and attribution of its DEM extend to the texture".to_owned()]
    }
}

fn no_statistics(method: &str) -> ParameterError {
    let message = format!(
        "is `{method}`, which needs the statistics of the residual, and the fit has none; fit the DEM with --statistics (in a study, \
         statistics = true)"
    );
    ParameterError::new("method", message)
}

/// Parameters of a method that repeats the measured residual, without those of its tile.
pub trait ResidualParameters: DeserializeOwned + Serialize + JsonSchema + Clone + Send + Sync + 'static {
    /// Its name.
    const NAME: &'static str;
    /// What it repeats.
    type Source: Source;
    /// The generator of tiles.
    type Kernel: ResidualKernel + 'static;

    /// Whether the tile repeats without seams.
    fn is_periodic(&self) -> bool;

    /// Whether the texture is the residual as measured, or what a measured background lacks.
    fn covariance(&self) -> CovarianceOf;

    /// Refuses parameters that are invalid whatever the site.
    ///
    /// # Errors
    /// Parameters out of range.
    fn check(&self) -> Result<(), ParameterError>;

    /// Cost of a tile from what is known before the fit.
    fn cost_of(&self, tile: &Tile, site: &Site) -> Cost;

    /// The method for one tile, whose cells are those of the site.
    ///
    /// # Errors
    /// A site that the method cannot repeat on this tile.
    fn kernel(&self, tile: &Tile, source: &Arc<Self::Source>) -> Result<Self::Kernel, ParameterError>;
}

/// A generator of tiles.
pub trait ResidualKernel: Send + Sync {
    /// Cost of a tile.
    fn cost(&self) -> Cost;

    /// Notes for the user.
    fn notes(&self) -> Vec<String> {
        Vec::new()
    }

    /// Share of the spectrum that is negative and set to 0.
    fn clip_share(&self) -> f64 {
        0.0
    }

    /// One tile: heights, row-major, m, and notes on it.
    ///
    /// # Errors
    /// See [`SynthesisError`].
    fn make(&self, streams: &Streams) -> Result<(Vec<f64>, Vec<String>), SynthesisError>;
}

/// Size of a site, as far as it is known before the fit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Site {
    /// Number of cells.
    pub cells: u64,
    /// Largest lag of the statistics, rows and columns, cells.
    pub reach: [usize; 2],
}

impl Site {
    /// The site of a fit; without one, as large as the tile, with the longest lags.
    fn of(tile: &Tile, prospect: Option<&Prospect>) -> Self {
        let cells = prospect.and_then(|p| p.cells).unwrap_or(tile.geometry.len() as u64);
        let cell_m = tile.geometry.cell;
        let lags = |k: usize| prospect.map_or(lags::LAG_MAX, |p| reach_cells(p.window_m[k], cell_m[k]));
        Self { cells, reach: [1, 0].map(lags) }
    }
}

/// Largest lag of the statistics of a residual, in cells of `side_m`: 1.5 windows of the background.
fn reach_cells(window_m: f64, side_m: f64) -> usize {
    ((1.5 * window_m / side_m).ceil() as usize).min(lags::LAG_MAX)
}

/// The checked parameters of a method and its tile.
struct Checked<P> {
    tile: Tile,
    own: P,
}

/// Checks raw parameters: those of the tile and those of the method, `P`.
///
/// # Errors
/// Parameters that are unknown or out of range, or that only textures from a covariance have.
pub fn check<P: ResidualParameters>(raw: &Value) -> Result<Box<dyn Method>, ParameterError> {
    check_keys(P::NAME, raw)?;
    let (of_tile, own) = tile::read::<P>(raw)?;
    let tile = Tile::check(of_tile, own.is_periodic())?;
    own.check()?;
    Ok(Box::new(Checked { tile, own }))
}

/// Refuses parameters that only textures from a covariance have.
///
/// # Errors
/// A key of [`OF_COVARIANCE`].
pub(crate) fn check_keys(method: &str, raw: &Value) -> Result<(), ParameterError> {
    match OF_COVARIANCE.iter().find(|(key, _)| !raw[*key].is_null()) {
        Some((key, kept)) => {
            Err(ParameterError::new(*key, format!("cannot be set: `{method}` keeps the {kept} of the site; remove it")))
        }
        None => Ok(()),
    }
}

impl<P: ResidualParameters> Checked<P> {
    fn cost(&self, prospect: Option<&Prospect>) -> Cost {
        // What is refused for its size is refused when the fit is known.
        let made = self.raised(prospect.map(|fit| fit.window_m)).unwrap_or_default();
        let tile = made.as_ref().map_or(&self.tile, |(_, widened)| widened);
        let site = Site::of(tile, prospect);
        let cost = self.own.cost_of(tile, &site);
        self.tile.repeated_cost(if made.is_some() { raised_cost::<P::Source>(cost, tile, site.cells) } else { cost })
    }

    /// The filter of a texture for a background over a window, and the tile that is synthesised for it; `None` for the residual as measured.
    ///
    /// # Errors
    /// An unknown window; too many cells.
    fn raised(&self, window_m: Option<[f64; 2]>) -> Result<Option<(Raised, Tile)>, ParameterError> {
        if self.own.covariance() == CovarianceOf::Surface {
            return Ok(None);
        }
        let raised = Raised::new(window_m, self.tile.geometry.cell)?;
        let widened = raised.widened(&self.tile)?;
        Ok(Some((raised, widened)))
    }

    /// Refuses cells that are not those of the site, east-west and north-south, m.
    fn check_cells(&self, site_m: [f64; 2]) -> Result<(), ParameterError> {
        let tile_m = self.tile.geometry.cell;
        if (0..2).all(|k| (tile_m[k] - site_m[k]).abs() <= CELL_TOLERANCE * site_m[k]) {
            return Ok(());
        }
        let [[x, y], [site_x, site_y]] = [tile_m, site_m].map(|sides| sides.map(super::to_micrometres));
        let name = P::NAME;
        let message = format!(
            "is {x} m x {y} m, but `{name}` works only on the cells of the site, {site_x} m x {site_y} m; set it to that, or resample \
             the DEM and fit it again"
        );
        Err(ParameterError::new("cell_m", message))
    }
}

impl<P: ResidualParameters> Method for Checked<P> {
    fn geometry(&self) -> Geometry {
        self.tile.whole()
    }

    fn parameters(&self) -> Value {
        self.tile.parameters_of_site(&self.own)
    }

    fn is_periodic(&self) -> bool {
        self.tile.periodic
    }

    fn cost(&self) -> Cost {
        Checked::cost(self, None)
    }

    fn cost_of(&self, prospect: &Prospect) -> Cost {
        Checked::cost(self, Some(prospect))
    }

    fn check_prospect(&self, prospect: &Prospect) -> Result<(), ParameterError> {
        if P::Source::NEEDS == Needs::Statistics && !prospect.has_statistics {
            return Err(no_statistics(P::NAME));
        }
        prospect.cell_m.map_or(Ok(()), |site_m| self.check_cells(site_m))
    }

    fn bind(&self, fit: &FitFile, measured: Option<&Arc<Measured>>) -> Result<Box<dyn Synthesis>, ParameterError> {
        let source = P::Source::of(P::NAME, fit, measured)?;
        self.check_cells(source.cell_m())?;
        let raised = self.raised(fit.window_m)?;
        let kernel = self.own.kernel(raised.as_ref().map_or(&self.tile, |(_, widened)| widened), &source)?;
        let raised =
            raised.map(|(filter, widened)| ForBackground { filter, widened, residual: source.covariances_m2() });
        let window = fit.window_m.map(|[x, y]| {
            let window_m = super::to_micrometres(0.5 * (x + y));
            match &raised {
                None => format!("{NO_LONG_WAVES}, {window_m} m; add it to a base that has them"),
                Some(_) => raised_note(window_m, P::Source::NEEDS == Needs::Residual),
            }
        });
        let of_fit = window.into_iter().chain(measurement_notes(fit));
        let notes = self.tile.note().into_iter().chain(source.notes()).chain(of_fit).chain(kernel.notes()).collect();
        Ok(Box::new(Repeated { tile: self.tile.clone(), parameters: self.parameters(), source, raised, kernel, notes }))
    }
}

/// Cost of a texture for the background of a fit, whose widened tile costs `made`, from a site of `cells` cells.
fn raised_cost<S: Source>(made: Cost, widened: &Tile, cells: u64) -> Cost {
    let Cost { memory_bytes, operations } = Raised::cost(made, widened);
    Cost { memory_bytes, operations: operations + S::covariances_operations(cells) }
}

/// A note on a texture for the background of a fit; `copied` if it is made of copied cells.
fn raised_note(window_m: f64, copied: bool) -> String {
    let heights = if copied {
        "; this changes the heights of copied cells, so the share of cells that have the height of their source was counted before it"
    } else {
        ""
    };
    format!(
        "covariance = residual: wavelengths near the window of the fit, {window_m} m, are amplified, so that a measured background and the texture \
         together have the covariance of the site{heights}"
    )
}

/// What a fit takes out of its covariance and the residual keeps.
fn measurement_notes(fit: &FitFile) -> Vec<String> {
    let Ok(settings) = FitSettings::of_fit(fit) else { return Vec::new() };
    let Measurement { inner_scale_m, noise } = settings.measurement();
    let noise_m =
        (noise.white_sigma_m * noise.white_sigma_m + noise.correlated_sigma_m * noise.correlated_sigma_m).sqrt();
    let repeated = (noise_m > 0.0).then(|| {
        let noise_m = super::to_micrometres(noise_m);
        format!("the measured residual holds the noise of the DEM ({noise_m} m), which the texture repeats; the fit's covariance does not")
    });
    let blurred = (inner_scale_m > 0.0).then(|| {
        format!(
            "the measured residual is blurred by the inner scale of the DEM ({inner_scale_m} m), and so is the texture; the fit's covariance is not"
        )
    });
    repeated.into_iter().chain(blurred).collect()
}

/// A method bound to a site.
struct Repeated<S, K> {
    tile: Tile,
    parameters: Value,
    source: Arc<S>,
    raised: Option<ForBackground>,
    kernel: K,
    notes: Vec<String>,
}

/// What makes a texture for the background of a fit.
struct ForBackground {
    filter: Raised,
    /// The tile that the kernel makes for it.
    widened: Tile,
    /// Covariances of the residual, m2.
    residual: LagCovariances,
}

impl<S: Source, K: ResidualKernel> Synthesis for Repeated<S, K> {
    fn geometry(&self) -> Geometry {
        self.tile.whole()
    }

    fn parameters(&self) -> Value {
        self.parameters.clone()
    }

    fn cost(&self) -> Cost {
        let cost = self.kernel.cost();
        self.tile.repeated_cost(match &self.raised {
            None => cost,
            Some(raised) => raised_cost::<S>(cost, &raised.widened, self.source.cells()),
        })
    }

    fn notes(&self) -> Vec<String> {
        self.notes.clone()
    }

    fn covariance(&self) -> Vec<LagCovariance> {
        let Geometry { cols, cell: [dx, _], .. } = self.tile.geometry;
        let most = if self.tile.periodic { cols / 2 } else { cols - 1 };
        let at = |(lag, wanted_m2): (usize, f64)| LagCovariance {
            lag_m: [lag as f64 * dx, 0.0],
            wanted_m2,
            achieved_m2: f64::NAN,
        };
        let wanted_m2 = match &self.raised {
            None => self.source.along_rows_m2(most),
            Some(raised) => raised.filter.along_rows_m2(&raised.residual, most),
        };
        wanted_m2.into_iter().enumerate().map(at).collect()
    }

    fn ratio(&self) -> f64 {
        f64::NAN
    }

    fn is_periodic(&self) -> bool {
        self.tile.periodic
    }

    fn generate(&self, streams: &Streams) -> Result<TextureOutcome, SynthesisError> {
        let (heights_m, notes) = match &self.raised {
            None => self.kernel.make(streams)?,
            Some(ForBackground { filter, widened, residual }) => {
                let copied = (S::NEEDS == Needs::Residual).then_some(residual);
                filter.make(&self.kernel, copied, [&self.tile, widened], streams)?
            }
        };
        Ok(TextureOutcome {
            grid: self.tile.repeated(Grid::new(self.tile.geometry, heights_m)),
            covariance_error_max_m2: f64::NAN,
            clip_share: self.kernel.clip_share(),
            notes,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{FitParameters, FitSettings, fit, method, prepare, prepare_from, residual};
    use serde_json::json;

    const METHODS: [&str; 4] = ["modulated", "wavelet_statistics", "quilting", "exemplar"];

    /// A site of 14 m x 14 m with cells of 10 cm: a normal surface with ridges.
    fn site() -> Grid {
        ground().map(|z| z.abs())
    }

    fn ground() -> Grid {
        let parameters = [("sigma_m", 0.05), ("range_m", 0.3)].map(|(name, value)| (name.to_owned(), value)).into();
        let truth = FitFile { model: "exponential".to_owned(), parameters, ..FitFile::default() };
        let size = json!({ "size_px": [140, 140], "phase": "gaussian", "periodic": false });
        prepare("fft_ma", &size, &truth).unwrap().generate(&Streams::for_seed(1, "site")).unwrap().grid
    }

    fn fitted(z: &Grid, statistics: bool) -> FitFile {
        let parameters = FitParameters { outer_scale_m: 2.0, bootstrap: 0, statistics, ..FitParameters::default() };
        let settings: FitSettings = parameters.try_into().unwrap();
        fit(z, &settings, &Streams::for_seed(1, "fit")).unwrap().fit
    }

    /// Every method makes a texture of the size and cells asked for, with the residual's spread within a third in the mean of four textures (14 m hold some
    /// 130 independent pieces, so the spread of a standard deviation is 10 %, and of its mean 5 %: six of them, 1e-8 for four methods without a bias);
    /// repeated tiles are equal.
    #[test]
    fn val_every_method_makes_textures_of_a_fit() {
        let z = site();
        let fit = fitted(&z, true);
        let measured = Arc::new(Measured::of_fit(&z, &fit).unwrap());
        let rms = |z: &Grid| {
            let squares: Vec<f64> = z.values.iter().filter(|z| z.is_finite()).map(|z| z * z).collect();
            sastrugi_numeric::sums::mean(&squares).sqrt()
        };
        let wanted_m = rms(&measured.residual);
        for name in METHODS {
            let mut parameters = json!({ "size_px": [96, 80], "cell_m": 0.1, "tile": [2, 1] });
            if name == "modulated" {
                // The tile is too small for the widest patches that a fit may find.
                parameters["range_m"] = json!(1.0);
            }
            let texture = prepare_from(name, &parameters, &fit, Some(&measured)).unwrap();
            let made = texture.generate(&Streams::for_seed(2, "texture")).unwrap();
            assert_eq!(made.grid.geometry, Geometry { rows: 160, ..Geometry::square(80, 96, 0.1) }, "{name}");
            assert_eq!(made.grid.row(0), made.grid.row(80), "{name}");
            let others = (3..6).map(|seed| texture.generate(&Streams::for_seed(seed, "texture")).unwrap().grid);
            let found_m: Vec<f64> = std::iter::once(made.grid).chain(others).map(|z| rms(&z)).collect();
            let mean_m = sastrugi_numeric::sums::mean(&found_m);
            assert!((mean_m / wanted_m - 1.0).abs() < 0.33, "{name}: {found_m:?} {wanted_m}");
            assert!(made.covariance_error_max_m2.is_nan() && texture.ratio().is_nan());
            let lags = texture.covariance();
            assert!((lags[0].wanted_m2.sqrt() / wanted_m - 1.0).abs() < 0.05 && lags[0].achieved_m2.is_nan(), "{name}");
            assert!(texture.parameters().get("marginal").is_none() && texture.cost().memory_bytes > 0);
            assert!(texture.notes().iter().any(|note| note.contains("window of the fit")), "{:?}", texture.notes());
        }
    }

    /// Frozen 64-bit hashes of the heights (FNV-1a over their bits) of each method, from the statistics or the heights of [`site`] about their
    /// mean. A deliberate change refreshes the constants from the message, and its commit says why released textures change.
    #[test]
    fn gold_textures_of_a_site() {
        let residual = site().map(|z| z - 0.04);
        let statistics = crate::synth::statistics::measure(&residual, [30, 30]).unwrap();
        let fit = FitFile { statistics: Some(Box::new(statistics)), ..FitFile::default() };
        let measured = Arc::new(Measured { residual });
        let found = METHODS.map(|name| {
            let mut parameters = json!({ "size_px": [96, 80], "cell_m": 0.1 });
            if name == "modulated" {
                // The tile is too small for the widest patches that may be measured.
                parameters["range_m"] = json!(1.0);
            }
            let texture = prepare_from(name, &parameters, &fit, Some(&measured)).unwrap();
            let heights = texture.generate(&Streams::for_seed(2, "texture")).unwrap().grid.values;
            let words = heights.iter().map(|z| z.to_bits());
            words.fold(0xcbf2_9ce4_8422_2325, |hash: u64, word| (hash ^ word).wrapping_mul(0x0100_0000_01b3))
        });
        assert_eq!(found, GOLD, "found {found:#x?}");
    }
    /// By method, in the order of [`METHODS`].
    const GOLD: [u64; 4] = [0x63c4_c780_7b1c_e18b, 0x02d3_91b1_569b_aca7, 0x1f3e_93f0_88fb_a4d0, 0x2a3e_8b1b_04c7_affe];

    /// Noise and blur that a fit takes out of its covariance are in the texture: a note says so.
    #[test]
    fn val_noise_and_blur_are_noted() {
        let z = ground();
        let notes = |noise_sigma_m: f64, inner_scale_m: f64| {
            let parameters = FitParameters {
                outer_scale_m: 2.0,
                bootstrap: 0,
                noise_sigma_m,
                correlated_noise_sigma_m: 0.75 * noise_sigma_m,
                correlated_noise_range_m: 500.0 * noise_sigma_m,
                inner_scale_m,
                ..FitParameters::default()
            };
            let fit = fit(&z, &parameters.try_into().unwrap(), &Streams::for_seed(1, "fit")).unwrap().fit;
            let measured = Arc::new(Measured::of_fit(&z, &fit).unwrap());
            prepare_from("exemplar", &json!({ "size_px": [64, 64] }), &fit, Some(&measured)).unwrap().notes().join("\n")
        };
        let (plain, both) = (notes(0.0, 0.0), notes(0.0004, 0.05));
        assert!(!plain.contains("holds the noise") && !plain.contains("blurred"), "{plain}");
        assert!(both.contains("holds the noise of the DEM (0.0005 m)"), "{both}");
        assert!(both.contains("blurred by the inner scale of the DEM (0.05 m)"), "{both}");
    }

    /// The residual is recomputed as the fit computed it, before trimming: its quantiles are those of the fit file.
    #[test]
    fn val_the_residual_is_that_of_the_fit() {
        let mut z = site();
        (0..40).for_each(|k| z.values[3000 + k] = f64::NAN);
        let fit = fitted(&z, false);
        let measured = Measured::of_fit(&z, &fit).unwrap();
        assert_eq!(crate::synth::marginal::quantiles_m(&measured.residual.values), fit.height_quantiles_m);
        let settings = FitSettings::of_fit(&fit).unwrap();
        assert_eq!(residual(&z, &settings).unwrap().finite_count(), measured.residual.finite_count());
    }

    /// What the methods cannot do is refused in one sentence that names the key.
    #[test]
    fn val_refusals() {
        let z = site();
        let (plain, with) = (fitted(&z, false), fitted(&z, true));
        let measured = Arc::new(Measured::of_fit(&z, &plain).unwrap());
        let refused = |name: &str, parameters: Value, fit: &FitFile, measured: Option<&Arc<Measured>>| {
            prepare_from(name, &parameters, fit, measured).err().map(|e| e.to_string()).unwrap_or_default()
        };
        for (key, value) in [
            ("ratio", json!(0.5)),
            ("azimuth_deg", json!(30.0)),
            ("outer_m", json!(3.0)),
            ("marginal", json!("measured")),
            ("marginal_m", json!([-1.0, 1.0])),
        ] {
            for name in METHODS {
                let mut parameters = json!({ "size_px": [64, 64], "cell_m": 0.1 });
                parameters[key] = value.clone();
                let error = refused(name, parameters, &with, Some(&measured));
                assert!(error.starts_with(&format!("`{key}` cannot be set: `{name}` keeps the ")), "{error}");
            }
        }
        for name in METHODS {
            let error = refused(name, json!({ "size_px": [64, 64], "cell_m": 0.2 }), &with, Some(&measured));
            assert!(error.contains("`cell_m` is 0.2 m x 0.2 m") && error.contains("0.1 m x 0.1 m"), "{error}");
            let error = refused(name, json!({ "size_px": [64, 64] }), &plain, None);
            let expected = if ["quilting", "exemplar"].contains(&name) { "--exemplar" } else { "--statistics" };
            assert!(error.starts_with("`method` is") && error.contains(expected), "{error}");
            let seams = json!({ "size_px": [64, 64], "periodic": false, "tile": [1, 2] });
            assert_eq!(method(name, &seams).err().unwrap().key, "tile");
        }
        // A DEM of other cells is not that of the fit.
        let other = Grid::new(Geometry::square(140, 140, 0.2), z.values.clone());
        let error = Measured::of_fit(&other, &plain).unwrap_err().to_string();
        assert!(error.starts_with("`exemplar` has cells of 0.2 m x 0.2 m"), "{error}");
        // Nor is one of the same cells and other heights; how high it lies has no effect.
        let rougher = z.map(|z| 1.01 * z);
        let error = Measured::of_fit(&rougher, &plain).unwrap_err().to_string();
        assert!(error.starts_with("`exemplar` does not give the residual of the fit"), "{error}");
        assert!(Measured::of_fit(&z.map(|z| z + 100.0), &plain).is_ok());
        // A fit that states no heights cannot tell.
        let silent = FitFile { height_quantiles_m: Vec::new(), ..plain.clone() };
        assert!(Measured::of_fit(&rougher, &silent).is_ok());
        let bare = FitFile { settings: Value::Null, ..plain };
        assert!(Measured::of_fit(&z, &bare).unwrap_err().to_string().starts_with("`settings` are missing"));
    }

    /// Before the fit, missing statistics and other cells are refused, and memory grows with the site for methods that copy.
    #[test]
    fn val_what_a_plan_knows() {
        let settings = |statistics: bool| {
            let parameters = FitParameters { outer_scale_m: 2.0, statistics, ..FitParameters::default() };
            FitSettings::try_from(parameters).unwrap()
        };
        let prospect = |statistics: bool, cells: u64| settings(statistics).prospect(Some([0.1; 2]), cells);
        let of = |name: &str, cell_m: f64| method(name, &json!({ "size_px": [64, 64], "cell_m": cell_m })).unwrap();
        for name in METHODS {
            let copies = ["quilting", "exemplar"].contains(&name);
            assert_eq!(of(name, 0.1).check_prospect(&prospect(false, 10_000)).is_ok(), copies, "{name}");
            assert!(of(name, 0.1).check_prospect(&prospect(true, 10_000)).is_ok(), "{name}");
            let error = of(name, 0.2).check_prospect(&prospect(true, 10_000)).unwrap_err();
            assert_eq!(error.key, "cell_m", "{name}");
            let memory = |cells: u64| of(name, 0.1).cost_of(&prospect(true, cells)).memory_bytes;
            assert_eq!(memory(10_000_000) > memory(10_000), copies, "{name}");
        }
    }

    /// A method that copies cells takes the covariances of the site to make a texture for a background: a plan counts them, and states what the texture does
    /// once it is bound to its site.
    #[test]
    fn val_covariances_of_the_site_are_planned() {
        let z = site();
        let fit = fitted(&z, false);
        let measured = Arc::new(Measured::of_fit(&z, &fit).unwrap());
        let parameters = FitParameters { outer_scale_m: 2.0, bootstrap: 0, ..FitParameters::default() };
        let settings = FitSettings::try_from(parameters).unwrap();
        let planned = |name: &str, covariance: &str, periodic: bool, cells: u64| {
            let raw = json!({ "size_px": [64, 60], "cell_m": 0.1, "covariance": covariance, "periodic": periodic });
            let cost = method(name, &raw).unwrap().cost_of(&settings.prospect(Some([0.1; 2]), cells));
            (cost, raw)
        };
        for name in ["quilting", "exemplar"] {
            for (covariance, periodic) in [("surface", true), ("residual", true), ("residual", false)] {
                let (cost, raw) = planned(name, covariance, periodic, 140 * 140);
                let bound = prepare_from(name, &raw, &fit, Some(&measured)).unwrap();
                assert_eq!(cost, bound.cost(), "{name}, {raw}");
            }
            // A larger site has more of it.
            let more = |covariance: &str| {
                let [small, large] =
                    [10_000, 90_000_000].map(|cells| planned(name, covariance, true, cells).0.operations);
                large - small
            };
            let expected = measured::correlation_operations(90_000_000) - measured::correlation_operations(10_000);
            let found = more("residual") - more("surface");
            assert!((found / expected - 1.0).abs() < 1e-9, "{name}: {found} {expected}");
        }
        // By hand, of a million cells: 2.25 million padded ones, twice, with 2.5 operations for each of 21.2 octaves, and 10.
        let found = measured::correlation_operations(1 << 20);
        let expected = 2.0 * 2.25 * f64::from(1 << 20) * (2.5 * (20.0 + libm::log2(2.25)) + 10.0);
        assert!((found / expected - 1.0).abs() < 1e-12, "{found}");
    }
}
