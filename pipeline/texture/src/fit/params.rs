//! Parameters of a fit.

use crate::covariance::Form;
use crate::covariance::filtered::Measurement;
use crate::noise::Noise;
use crate::synth::EMPIRICAL;
use sastrugi_numeric::Geometry;
use sastrugi_roughness::background::{AtPartial, BoxWindow};
use sastrugi_schemas::fit::FitFile;
use sastrugi_schemas::kind::read_parameters;
use sastrugi_schemas::{ParameterError, limits};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::FitError;

/// How the covariance is fitted.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Mode {
    /// The model goes through the same detrending and trimming as the data before the two are compared.
    #[default]
    Corrected,
    /// The published procedure: the model is compared directly with the residual's covariance, so that sigma and b come out
    /// too small.
    Paper,
}

impl Mode {
    /// Name in files.
    pub fn name(self) -> &'static str {
        match self {
            Self::Corrected => "corrected",
            Self::Paper => "paper",
        }
    }
}

/// Raw parameters of a fit, as a study states them.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct FitParameters {
    /// `corrected` (default) or `paper` (Vecherin et al. 2022 as published).
    pub mode: Mode,
    /// Outer scale: width of the moving average that defines the background, m. Default 2 (Vecherin et al. 2022,
    /// section 2); at least 3 cells, at most a third of the DEM.
    #[schemars(transform = limits::positive)]
    pub outer_scale_m: f64,
    /// Significance level at which residuals are trimmed on both sides, in (0, 0.5). Default 0.05 (Vecherin et al.
    /// 2022, section 2).
    #[schemars(transform = limits::between(0.0, 0.5))]
    pub trim: f64,
    /// Covariance model, such as `exponential` or `anisotropic:matern+nugget`, or several separated by commas, or `auto` for the usual ones: the
    /// best by AICc is used, all are listed. A model is `exponential`, `gaussian`, `spherical`, `matern` or `self_affine`, or a sum of two
    /// (`exponential+gaussian`), optionally followed by `+nugget`, preceded by `anisotropic:`, or both. `empirical`, with others (`auto,empirical`)
    /// or alone, stores the measured covariance by lag for textures, whose cells must then be whole multiples of the DEM's; the best of the other
    /// models extrapolates it, `exponential` if there is none.
    /// Default `exponential` (Vecherin et al. 2022, Eq. 9).
    #[schemars(regex(pattern = model_pattern()))]
    pub model: String,
    /// Largest lag of the covariance, m. Default: half the outer scale, at least 3 cells.
    #[schemars(transform = limits::positive)]
    pub max_lag_m: Option<f64>,
    /// A cell is used only if more than this share of its window has data. Default 0.5; 0.9 in `paper` mode.
    #[schemars(transform = limits::half_open(0.0, 1.0))]
    pub min_valid_share: Option<f64>,
    /// Whether objects (trees, rocks, structures) are found and left out before the moving average. Default true. On a bare
    /// site with steep steps (gullies, cliffs) the search removes up to a tenth of the cells: set it to false there. Not used in
    /// `paper` mode.
    pub find_objects: bool,
    /// Replicates of the parametric bootstrap for the intervals: 39 or more, the fewest that give a 95 % interval, or 0 for no intervals. Default 99.
    /// Not used in `paper` mode.
    #[schemars(range(max = BOOTSTRAP_MAX), extend("not" = { "minimum": 1, "maximum": BOOTSTRAP_MIN - 1 }))]
    pub bootstrap: u32,
    /// Standard deviation of the Gaussian point spread function that blurred the DEM (smoothing by photogrammetry), m.
    /// Default 0.
    #[schemars(transform = limits::not_negative)]
    pub inner_scale_m: f64,
    /// Standard deviation of the DEM's white noise per cell, m. Default 0. If unknown, estimate it from a smooth part of the DEM
    /// (`noise_reference` of a study's fit, `--noise-reference`) or fit it as a nugget (`+nugget`).
    #[schemars(transform = limits::not_negative)]
    pub noise_sigma_m: f64,
    /// Standard deviation of spatially correlated noise, as left by dense image matching, m: covariance
    /// sigma^2 exp(-(lag / range)^2) (Hugonnet et al. 2022). Default 0. A noise reference estimates it too.
    #[schemars(transform = limits::not_negative)]
    pub correlated_noise_sigma_m: f64,
    /// Range of the correlated noise, m: 0.6 times the width of the matched patches if each cell has its own patch. Must be
    /// below the outer scale; 0 without correlated noise.
    #[schemars(transform = limits::not_negative)]
    pub correlated_noise_range_m: f64,
    /// Whether the statistics of the residual are stored, from which the texture methods `modulated` and `wavelet_statistics` work without
    /// the DEM. Default false. Not in `paper` mode.
    #[serde(skip_serializing_if = "std::ops::Not::not")]
    pub statistics: bool,
}

/// Models that `auto` tries.
const AUTO: [&str; 9] = [
    "exponential",
    "gaussian",
    "spherical",
    "matern",
    "self_affine",
    "exponential+nugget",
    "exponential+gaussian",
    "anisotropic:exponential",
    "anisotropic:matern",
];
/// Default model, from the paper.
const MODEL: &str = "exponential";
/// Fewest replicates for a 2.5 % quantile.
const BOOTSTRAP_MIN: u32 = 39;
/// Most replicates.
const BOOTSTRAP_MAX: u32 = 100_000;
/// Outer scale of the paper, m.
const OUTER_SCALE_M: f64 = 2.0;
/// Significance level of the paper.
const TRIM: f64 = 0.05;
/// Fewest cells across the outer scale.
const WINDOW_CELLS_MIN: f64 = 3.0;
/// Fewest cells in the largest lag, so that two parameters and noise can be separated.
const LAG_CELLS_MIN: f64 = 3.0;

impl Default for FitParameters {
    fn default() -> Self {
        Self {
            mode: Mode::Corrected,
            outer_scale_m: OUTER_SCALE_M,
            trim: TRIM,
            model: MODEL.to_owned(),
            max_lag_m: None,
            min_valid_share: None,
            find_objects: true,
            bootstrap: 99,
            inner_scale_m: 0.0,
            noise_sigma_m: 0.0,
            correlated_noise_sigma_m: 0.0,
            correlated_noise_range_m: 0.0,
            statistics: false,
        }
    }
}

/// Checked parameters of a fit.
#[derive(Clone)]
pub struct FitSettings {
    parameters: FitParameters,
    pub(super) forms: Vec<Form>,
    /// Whether the measured covariance is stored.
    pub(super) empirical: bool,
    /// Whether the forms come from `auto`.
    auto: bool,
    noise: Noise,
    pub(super) min_valid_share: f64,
}

impl TryFrom<FitParameters> for FitSettings {
    type Error = ParameterError;

    fn try_from(parameters: FitParameters) -> Result<Self, ParameterError> {
        ParameterError::positive("outer_scale_m", parameters.outer_scale_m)?;
        ParameterError::between("trim", parameters.trim, 0.0, 0.5)?;
        if let Some(lag) = parameters.max_lag_m {
            ParameterError::positive("max_lag_m", lag)?;
        }
        if parameters.inner_scale_m >= parameters.outer_scale_m {
            let (inner, outer) = (parameters.inner_scale_m, parameters.outer_scale_m);
            let message = format!("is {inner} m; it must be below the outer scale, {outer} m");
            return Err(ParameterError::new("inner_scale_m", message));
        }
        let share_default = if parameters.mode == Mode::Paper { 0.9 } else { 0.5 };
        let share = parameters.min_valid_share.unwrap_or(share_default);
        if !(0.0..1.0).contains(&share) {
            return Err(ParameterError::new("min_valid_share", format!("is {share}; it must lie in [0, 1)")));
        }
        ParameterError::not_negative("inner_scale_m", parameters.inner_scale_m)?;
        let noise = parameters.noise()?;
        if noise.correlated_range_m >= parameters.outer_scale_m {
            let (range, outer) = (noise.correlated_range_m, parameters.outer_scale_m);
            let message = format!("is {range} m; it must be below the outer scale, {outer} m");
            return Err(ParameterError::new("correlated_noise_range_m", message));
        }
        if parameters.bootstrap > 0 && !(BOOTSTRAP_MIN..=BOOTSTRAP_MAX).contains(&parameters.bootstrap) {
            let message = format!(
                "is {}; it must be 0 (no intervals) or {BOOTSTRAP_MIN} to {BOOTSTRAP_MAX}: fewer cannot give a 95 % interval",
                parameters.bootstrap
            );
            return Err(ParameterError::new("bootstrap", message));
        }
        let (forms, empirical) = forms(&parameters.model)?;
        if parameters.mode == Mode::Paper && (empirical || forms.len() > 1 || forms[0].is_anisotropic()) {
            let message = format!("is `{}`; the published procedure fits one isotropic model", parameters.model);
            return Err(ParameterError::new("model", message));
        }
        if parameters.mode == Mode::Paper && !forms[0].unit().is_stationary() {
            let message =
                format!("is `{}`, which has no finite variance; the published procedure fits one", parameters.model);
            return Err(ParameterError::new("model", message));
        }
        if parameters.mode == Mode::Paper && (parameters.inner_scale_m > 0.0 || !noise.is_none()) {
            let message = "is `paper`, which supports neither an inner scale nor noise; remove them or use `corrected`";
            return Err(ParameterError::new("mode", message));
        }
        if parameters.mode == Mode::Paper && parameters.statistics {
            let message =
                "is `paper`, whose residual is offset and trimmed by its own rules; use `corrected` for statistics";
            return Err(ParameterError::new("mode", message));
        }
        let auto = parameters.model.split(',').any(|name| name.trim() == "auto");
        Ok(Self { parameters, forms, empirical, auto, noise, min_valid_share: share })
    }
}

impl FitParameters {
    fn noise(&self) -> Result<Noise, ParameterError> {
        Noise::new(self.noise_sigma_m, self.correlated_noise_sigma_m, self.correlated_noise_range_m)
    }
}

/// Regular expression of a `model` parameter, for its JSON Schema.
fn model_pattern() -> String {
    let one = format!(r"\s*({}|auto|{EMPIRICAL})\s*", Form::pattern());
    format!("^{one}(,{one})*$")
}

/// The forms that a `model` parameter names, and whether it includes `empirical`. On its own, `empirical` is extrapolated by
/// the default form.
fn forms(text: &str) -> Result<(Vec<Form>, bool), ParameterError> {
    let (empirical, named): (Vec<&str>, Vec<&str>) =
        text.split(',').map(str::trim).partition(|name| *name == EMPIRICAL);
    let names = match named[..] {
        [] => vec![MODEL],
        ["auto"] => AUTO.to_vec(),
        _ => named,
    };
    let parsed = |name: &str| {
        let also = |e: ParameterError| ParameterError {
            message: format!("{}; or `auto`, or `{EMPIRICAL}`, the measured covariance", e.message),
            ..e
        };
        Form::parse(name).map_err(also)
    };
    Ok((names.into_iter().map(parsed).collect::<Result<_, _>>()?, !empirical.is_empty()))
}

impl FitSettings {
    /// The parameters with every default written out.
    pub fn parameters(&self) -> FitParameters {
        FitParameters { min_valid_share: Some(self.min_valid_share), ..self.parameters.clone() }
    }

    /// The settings of a fit file.
    ///
    /// # Errors
    /// A file without settings, such as a stated fit; settings that this program does not know.
    pub fn of_fit(fit: &FitFile) -> Result<Self, ParameterError> {
        if fit.settings.as_object().is_none_or(serde_json::Map::is_empty) {
            let message = "are missing from the fit file, so its residual cannot be computed again; fit the DEM again";
            return Err(ParameterError::new("settings", message));
        }
        read_parameters::<FitParameters>(&fit.settings).and_then(Self::try_from).map_err(|e| e.within("settings"))
    }

    /// Whether the fit stores the statistics of the residual.
    pub fn has_statistics(&self) -> bool {
        self.parameters.statistics
    }

    /// Whether the fit stores the measured covariance, for textures.
    pub fn is_empirical(&self) -> bool {
        self.empirical
    }

    pub(super) fn mode(&self) -> Mode {
        self.parameters.mode
    }

    pub(super) fn outer_scale_m(&self) -> f64 {
        self.parameters.outer_scale_m
    }

    pub(super) fn bootstrap(&self) -> usize {
        self.parameters.bootstrap as usize
    }

    pub(crate) fn measurement(&self) -> Measurement {
        Measurement { inner_scale_m: self.parameters.inner_scale_m, noise: self.noise }
    }

    /// The same fit with the noise estimated from a reference.
    ///
    /// # Errors
    /// A fit whose parameters already state a noise, or whose mode does not support it; a correlated noise whose range reaches
    /// the outer scale.
    pub fn with_noise(&self, noise: &Noise) -> Result<Self, ParameterError> {
        if !self.noise.is_none() {
            let message =
                "or correlated_noise_sigma_m is set, and a noise reference is given as well; use only one of the two";
            return Err(ParameterError::new("noise_sigma_m", message));
        }
        let found = FitParameters {
            noise_sigma_m: noise.white_sigma_m,
            correlated_noise_sigma_m: noise.correlated_sigma_m,
            correlated_noise_range_m: noise.correlated_range_m,
            ..self.parameters.clone()
        };
        found.try_into()
    }

    /// The same fit for transects: `auto` tries isotropic models only.
    pub(super) fn of_transects(&self) -> Self {
        let is_tried = |form: &&Form| !(self.auto && form.is_anisotropic());
        Self { forms: self.forms.iter().filter(is_tried).cloned().collect(), ..self.clone() }
    }

    /// The same fit at another outer scale.
    pub(super) fn at_outer_scale(&self, outer_scale_m: f64) -> Self {
        let parameters = FitParameters { outer_scale_m, max_lag_m: None, ..self.parameters.clone() };
        Self { parameters, empirical: false, ..self.clone() }
    }

    pub(super) fn find_objects(&self) -> bool {
        self.parameters.find_objects && self.mode() == Mode::Corrected
    }

    /// How the background of a partial window is computed: the published procedure uses the mean.
    pub(super) fn at_partial(&self) -> AtPartial {
        match self.mode() {
            Mode::Corrected => AtPartial::Plane,
            Mode::Paper => AtPartial::Mean,
        }
    }

    pub(super) fn trim(&self) -> f64 {
        self.parameters.trim
    }

    /// The window on a DEM of this shape; for transects it extends along them only.
    pub(super) fn window(&self, dem: &Geometry, profiles: bool) -> Result<BoxWindow, FitError> {
        let outer_scale_m = self.parameters.outer_scale_m;
        let [width_m, height_m] = dem.size();
        let cell_m = dem.cell[0].max(dem.cell[1]);
        let narrow_m = if profiles { width_m } else { width_m.min(height_m) };
        if narrow_m < 2.0 * outer_scale_m {
            return Err(FitError::DemTooSmall { width_m, height_m, needed_m: 2.0 * outer_scale_m });
        }
        if outer_scale_m > narrow_m / 3.0 {
            return Err(FitError::OuterScaleTooLarge { outer_scale_m, largest_m: narrow_m / 3.0 });
        }
        // Three cells of 0.1 m are 0.30000000000000004 m.
        if outer_scale_m < (1.0 - 1e-9) * WINDOW_CELLS_MIN * cell_m {
            return Err(FitError::OuterScaleTooSmall { outer_scale_m, cell_m, smallest_m: WINDOW_CELLS_MIN * cell_m });
        }
        let BoxWindow { half: [rows, cols] } = BoxWindow::nearest(outer_scale_m, dem.cell);
        Ok(BoxWindow { half: [if profiles { 0 } else { rows }, cols] })
    }

    /// Refuses a DEM of this shape as a fit of it would: one that is too small for the outer scale or the lags, or has too large cells.
    ///
    /// # Errors
    /// [`FitError::DemTooSmall`], [`FitError::OuterScaleTooLarge`], [`FitError::OuterScaleTooSmall`], or the parameter `max_lag_m`.
    pub fn check_place(&self, dem: &Geometry) -> Result<(), FitError> {
        self.window(dem, false)?;
        self.max_lag_m(dem, false).map(drop)
    }

    /// Largest lag on cells of `cell_m`, m, whatever the shape of the DEM.
    pub(super) fn wanted_lag_m(&self, cell_m: [f64; 2]) -> f64 {
        let least = LAG_CELLS_MIN * cell_m[0].max(cell_m[1]);
        self.parameters.max_lag_m.unwrap_or(0.5 * self.parameters.outer_scale_m).max(least)
    }

    /// Largest lag on a DEM of this shape, m; for transects, along them.
    pub(super) fn max_lag_m(&self, dem: &Geometry, profiles: bool) -> Result<f64, FitError> {
        let max_lag_m = self.wanted_lag_m(dem.cell);
        let [width_m, height_m] = dem.size();
        let half_m = 0.5 * if profiles { width_m } else { width_m.min(height_m) };
        if max_lag_m > half_m {
            let message = format!(
                "is {max_lag_m} m; it must be at most half the DEM's side, {half_m} m, beyond which pairs are too few"
            );
            return Err(ParameterError::new("max_lag_m", message).into());
        }
        Ok(max_lag_m)
    }
}
