//! Parameters of a comparison.

use crate::covariance::Form;
use crate::fit::{FitParameters, FitSettings, Mode};
use sastrugi_schemas::ParameterError;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Most quantities of a comparison by simulation.
const QUANTITIES_MAX: f64 = 6.0;
/// Most simulations.
const SIMULATIONS_MAX: u32 = 100_000;

/// Raw parameters of a comparison.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct CompareParameters {
    /// Outer scale of both fits, m. Default 2.
    pub outer_scale_m: f64,
    /// Significance level at which residuals are trimmed. Default 0.05.
    pub trim: f64,
    /// Whether objects (trees, rocks, structures) of both sides are found and left out. Default true. Set it to false if a texture should reproduce
    /// the objects of its site: they are then judged with the rest.
    pub find_objects: bool,
    /// Covariance model of both sides: a single term, optionally with `+nugget`. Default `exponential`.
    pub model: String,
    /// Relative difference of sigma that still counts as the same. Default 0.1.
    pub equivalence_sigma: f64,
    /// Relative difference of b that still counts as the same. Default 0.25.
    pub equivalence_range: f64,
    /// Relative difference of a shape (smoothness, Hurst exponent) that still counts as the same. Default 0.25.
    pub equivalence_shape: f64,
    /// Relative difference of the ratio of axes that still counts as the same. Default 0.25.
    pub equivalence_anisotropy: f64,
    /// Root mean square distance of the quantiles of standardised heights that still counts as the same, in standard deviations.
    /// Default 0.1.
    pub equivalence_heights: f64,
    /// Root mean square relative difference of a statistic (split halves, and `--statistics`) that still counts as the same.
    /// Default 0.25.
    pub equivalence_agreement: f64,
    /// Largest difference of the covariances at any lag up to half a window (`--statistics`) that still counts as the same, as a share of the
    /// site's variance. Default 0.05.
    pub equivalence_covariance: f64,
    /// Simulated surfaces of each side, at least 6 / alpha - 1; `--statistics` simulates none. Default 199.
    pub simulations: u32,
    /// Largest probability of any wrong `different`, and of each wrong `same`. Default 0.05.
    pub alpha: f64,
}

impl Default for CompareParameters {
    fn default() -> Self {
        let fit = FitParameters::default();
        Self {
            outer_scale_m: fit.outer_scale_m,
            trim: fit.trim,
            find_objects: fit.find_objects,
            model: fit.model,
            equivalence_sigma: 0.1,
            equivalence_range: 0.25,
            equivalence_shape: 0.25,
            equivalence_anisotropy: 0.25,
            equivalence_heights: 0.1,
            equivalence_agreement: 0.25,
            equivalence_covariance: 0.05,
            simulations: 199,
            alpha: 0.05,
        }
    }
}

/// Checked parameters of a comparison.
#[derive(Clone)]
pub struct CompareSettings {
    parameters: CompareParameters,
    pub(super) form: Form,
    pub(super) fit: FitSettings,
}

impl TryFrom<CompareParameters> for CompareSettings {
    type Error = ParameterError;

    fn try_from(parameters: CompareParameters) -> Result<Self, ParameterError> {
        let p = &parameters;
        for (name, bound) in [
            ("equivalence_sigma", p.equivalence_sigma),
            ("equivalence_range", p.equivalence_range),
            ("equivalence_shape", p.equivalence_shape),
            ("equivalence_anisotropy", p.equivalence_anisotropy),
            ("equivalence_heights", p.equivalence_heights),
            ("equivalence_agreement", p.equivalence_agreement),
            ("equivalence_covariance", p.equivalence_covariance),
        ] {
            ParameterError::positive(name, bound)?;
        }
        ParameterError::between("alpha", p.alpha, 0.0, 0.5)?;
        let form = one_term(&p.model)?;
        let fit = FitParameters {
            mode: Mode::Corrected,
            outer_scale_m: p.outer_scale_m,
            trim: p.trim,
            find_objects: p.find_objects,
            model: form.name().to_owned(),
            bootstrap: 0,
            ..FitParameters::default()
        };
        Ok(Self { fit: fit.try_into()?, form, parameters })
    }
}

/// A single-term form, whose parameters mean the same on both sides.
fn one_term(model: &str) -> Result<Form, ParameterError> {
    let refuse = || {
        let message = format!(
            "is `{model}`; a comparison needs one model with one term, such as `exponential` or `matern+nugget`"
        );
        ParameterError::new("model", message)
    };
    if model.contains(',') || model.trim() == "auto" {
        return Err(refuse());
    }
    let form = Form::parse(model.trim())?;
    // Anisotropy is fitted in any case.
    if form.terms().len() == 1 { Ok(form.isotropic()) } else { Err(refuse()) }
}

impl CompareSettings {
    /// The parameters with every default written out.
    pub fn parameters(&self) -> &CompareParameters {
        &self.parameters
    }

    /// Refuses too few simulations for a comparison that needs them: the smallest p-value is 1 / (simulations + 1), and it must be able to pass the
    /// first step of Holm's adjustment.
    ///
    /// # Errors
    /// Fewer simulations than that, or more than 100 000.
    pub fn check_simulations(&self) -> Result<(), ParameterError> {
        let p = &self.parameters;
        let least = (QUANTITIES_MAX / p.alpha).ceil() - 1.0;
        if f64::from(p.simulations) >= least && p.simulations <= SIMULATIONS_MAX {
            return Ok(());
        }
        let message = format!(
            "is {}; it must lie in [{least}, {SIMULATIONS_MAX}] at alpha = {}: with fewer, no difference could be significant",
            p.simulations, p.alpha
        );
        Err(ParameterError::new("simulations", message))
    }
}
