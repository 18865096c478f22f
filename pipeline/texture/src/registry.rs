//! Registry of the fit, the covariance models and the synthesis methods, by name.

use crate::covariance::MODELS;
use crate::fit::FitParameters;
use crate::synth::cholesky::CholeskyParameters;
use crate::synth::exemplar::ExemplarParameters;
use crate::synth::fft_ma::FftMaParameters;
use crate::synth::gaussians::GaussiansParameters;
use crate::synth::measured::Measured;
use crate::synth::modulated::ModulatedParameters;
use crate::synth::quasi_wavelets::QuasiWaveletsParameters;
use crate::synth::quilting::QuiltingParameters;
use crate::synth::residual::{self, Needs};
use crate::synth::wavelet_statistics::WaveletStatisticsParameters;
use crate::synth::{
    self, Method, Synthesis, cholesky, exemplar, fft_ma, gaussians, modulated, quasi_wavelets, quilting,
    wavelet_statistics,
};
use sastrugi_schemas::fit::FitFile;
use sastrugi_schemas::kind::schema_of;
use sastrugi_schemas::{Kind, ParameterError};
use serde_json::Value;
use std::sync::Arc;

/// Checks the raw parameters of a method.
type Check = fn(&Value) -> Result<Box<dyn Method>, ParameterError>;

/// A synthesis method, what it needs, and how its parameters are checked.
type Entry = (fn() -> Kind, Needs, Check);

/// Every synthesis method.
const METHODS: [Entry; 8] = [
    (fft_ma::kind, Needs::Covariance, synth::check::<FftMaParameters>),
    (cholesky::kind, Needs::Covariance, synth::check::<CholeskyParameters>),
    (gaussians::kind, Needs::Covariance, synth::check::<GaussiansParameters>),
    (quasi_wavelets::kind, Needs::Covariance, synth::check::<QuasiWaveletsParameters>),
    (modulated::kind, Needs::Statistics, residual::check::<ModulatedParameters>),
    (wavelet_statistics::kind, Needs::Statistics, residual::check::<WaveletStatisticsParameters>),
    (quilting::kind, Needs::Residual, residual::check::<QuiltingParameters>),
    (exemplar::kind, Needs::Residual, residual::check::<ExemplarParameters>),
];

/// Every kind of this crate: the fit, the covariance models, the synthesis methods.
pub fn kinds() -> Vec<Kind> {
    let fit = Kind {
        family: "fit",
        kind: "covariance",
        summary: "covariance of the texture of a measured DEM, corrected for detrending and trimming or as published",
        source: "Vecherin et al. 2022, section 2 and Eq. 9",
        parameters: schema_of::<FitParameters>(),
    };
    let models = MODELS.into_iter().map(|m| m.kind());
    std::iter::once(fit).chain(models).chain(METHODS.map(|(kind, ..)| kind())).collect()
}

/// What the synthesis method called `name` needs; `None` for an unknown one.
pub fn needs(name: &str) -> Option<Needs> {
    METHODS.into_iter().find(|(kind, ..)| kind().kind == name).map(|(_, needs, _)| needs)
}

/// Refuses keys of other methods that a method has a reason not to have, so that a caller can give it before it lists the known keys.
///
/// # Errors
/// Anisotropy, outer range or height distribution for a method that repeats a site.
pub fn check_keys(name: &str, parameters: &Value) -> Result<(), ParameterError> {
    match needs(name) {
        None | Some(Needs::Covariance) => Ok(()),
        Some(Needs::Statistics | Needs::Residual) => residual::check_keys(name, parameters),
    }
}

/// The synthesis method called `name`, with raw `parameters`.
///
/// # Errors
/// An unknown method (the message lists the known ones); parameters that the method refuses whatever the fit.
pub fn method(name: &str, parameters: &Value) -> Result<Box<dyn Method>, ParameterError> {
    match METHODS.into_iter().find(|(kind, ..)| kind().kind == name) {
        Some((_, _, check)) => check(parameters),
        None => {
            let known = METHODS.map(|(kind, ..)| kind().kind).join(", ");
            Err(ParameterError::new("method", format!("is `{name}`; known texture methods: {known}")))
        }
    }
}

/// A texture that matches `fit`, by the method called `name` with raw `parameters`.
///
/// ```
/// use sastrugi_numeric::Streams;
/// use sastrugi_schemas::fit::FitFile;
/// use sastrugi_texture::prepare;
/// use serde_json::json;
///
/// # fn main() -> Result<(), Box<dyn std::error::Error>> {
/// // A stated covariance: 5 cm, range 0.3 m.
/// let parameters = [("sigma_m", 0.05), ("range_m", 0.3)].map(|(k, v)| (k.to_owned(), v)).into();
/// let fit = FitFile { model: "exponential".to_owned(), parameters, ..FitFile::default() };
/// let texture = prepare("fft_ma", &json!({ "size_m": [8.0, 6.0], "cell_m": 0.1 }), &fit)?;
/// let grid = texture.generate(&Streams::for_seed(7, "example"))?.grid;
/// assert_eq!((grid.rows(), grid.cols()), (60, 80));
/// // With unit phases every periodic tile has exactly the stated variance about zero.
/// let variance = grid.values.iter().map(|z| z * z).sum::<f64>() / 4800.0;
/// assert!((variance / 0.0025 - 1.0).abs() < 1e-9);
/// // A misspelt parameter is refused.
/// assert!(prepare("fft_ma", &json!({ "phases": "unit" }), &fit).is_err());
/// # Ok(())
/// # }
/// ```
///
/// # Errors
/// As [`method`]; also a fit that the method refuses.
pub fn prepare(name: &str, parameters: &Value, fit: &FitFile) -> Result<Box<dyn Synthesis>, ParameterError> {
    prepare_from(name, parameters, fit, None)
}

/// As [`prepare`], with the residual of the fit's DEM, from which `quilting` and `exemplar` copy.
///
/// # Errors
/// As [`prepare`].
pub fn prepare_from(
    name: &str,
    parameters: &Value,
    fit: &FitFile,
    measured: Option<&Arc<Measured>>,
) -> Result<Box<dyn Synthesis>, ParameterError> {
    method(name, parameters)?.bind(fit, measured)
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    /// Names are part of every study and fit file: written out here, so that a renamed, lost or doubled kind is noticed.
    #[test]
    fn val_kinds_are_named_once() {
        let names: Vec<_> = kinds().iter().map(|k| (k.family, k.kind)).collect();
        let expected = [
            ("fit", "covariance"),
            ("covariance", "exponential"),
            ("covariance", "gaussian"),
            ("covariance", "spherical"),
            ("covariance", "matern"),
            ("covariance", "self_affine"),
            ("texture", "fft_ma"),
            ("texture", "cholesky"),
            ("texture", "gaussians"),
            ("texture", "quasi_wavelets"),
            ("texture", "modulated"),
            ("texture", "wavelet_statistics"),
            ("texture", "quilting"),
            ("texture", "exemplar"),
        ];
        assert_eq!(names, expected);
    }

    /// Every name leads to its own method: the parameters with defaults differ between them.
    #[test]
    fn val_names_lead_to_their_methods() {
        let own = |name: &str| {
            let all = method(name, &json!({ "size_px": [8, 8] })).unwrap().parameters();
            all.as_object().unwrap().keys().cloned().collect::<Vec<_>>()
        };
        let has = |name: &str, key: &str| own(name).iter().any(|k| k == key);
        assert!(has("fft_ma", "phase") && has("fft_ma", "spectrum") && has("fft_ma", "periodic"));
        assert!(has("quasi_wavelets", "packing") && has("quasi_wavelets", "intermittency"));
        assert!(has("wavelet_statistics", "rounds") && has("quilting", "overlap") && has("exemplar", "neighbours"));
        assert!(has("modulated", "periodic") && !has("modulated", "marginal") && !has("modulated", "rounds"));
        assert!(!has("cholesky", "phase") && !has("cholesky", "packing") && !has("gaussians", "packing"));
        // Parameters of one method are refused by another.
        assert_eq!(method("cholesky", &json!({ "phase": "unit" })).err().unwrap().key, "phase");
        assert!(method("gaussians", &json!({ "size_px": [8, 8], "bumps": 40 })).is_ok());
        assert_eq!(method("gaussians", &json!({ "bumps": 0 })).err().unwrap().key, "bumps");
    }

    #[test]
    fn val_an_unknown_method_lists_the_known_ones() {
        let error = prepare("kriging", &json!({}), &FitFile::default()).err().unwrap();
        assert_eq!(
            error.to_string(),
            "`method` is `kriging`; known texture methods: fft_ma, cholesky, gaussians, quasi_wavelets, modulated, \
             wavelet_statistics, quilting, exemplar"
        );
    }
}
