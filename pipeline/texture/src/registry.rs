//! Registry of the fit, the covariance models and the synthesis methods, by name.

use crate::covariance::MODELS;
use crate::fit::FitParameters;
use crate::synth::cholesky::CholeskyParameters;
use crate::synth::fft_ma::FftMaParameters;
use crate::synth::gaussians::GaussiansParameters;
use crate::synth::quasi_wavelets::QuasiWaveletsParameters;
use crate::synth::{self, Method, Synthesis, cholesky, fft_ma, gaussians, quasi_wavelets};
use sastrugi_schemas::fit::FitFile;
use sastrugi_schemas::kind::schema_of;
use sastrugi_schemas::{Kind, ParameterError};
use serde_json::Value;

/// Checks the raw parameters of a method.
type Check = fn(&Value) -> Result<Box<dyn Method>, ParameterError>;

/// Every synthesis method.
const METHODS: [(fn() -> Kind, Check); 4] = [
    (fft_ma::kind, synth::check::<FftMaParameters>),
    (cholesky::kind, synth::check::<CholeskyParameters>),
    (gaussians::kind, synth::check::<GaussiansParameters>),
    (quasi_wavelets::kind, synth::check::<QuasiWaveletsParameters>),
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
    std::iter::once(fit).chain(models).chain(METHODS.map(|(kind, _)| kind())).collect()
}

/// The synthesis method called `name`, with raw `parameters`.
///
/// # Errors
/// An unknown method (the message lists the known ones); parameters that the method refuses whatever the fit.
pub fn method(name: &str, parameters: &Value) -> Result<Box<dyn Method>, ParameterError> {
    match METHODS.into_iter().find(|(kind, _)| kind().kind == name) {
        Some((_, check)) => check(parameters),
        None => {
            let known = METHODS.map(|(kind, _)| kind().kind).join(", ");
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
    method(name, parameters)?.bind(fit)
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
        ];
        assert_eq!(names, expected);
    }

    /// Every name leads to its own method: the parameters with defaults differ between all four.
    #[test]
    fn val_names_lead_to_their_methods() {
        let own = |name: &str| {
            let all = method(name, &json!({ "size_px": [8, 8] })).unwrap().parameters();
            all.as_object().unwrap().keys().cloned().collect::<Vec<_>>()
        };
        let has = |name: &str, key: &str| own(name).iter().any(|k| k == key);
        assert!(has("fft_ma", "phase") && has("fft_ma", "spectrum") && has("fft_ma", "periodic"));
        assert!(has("quasi_wavelets", "packing") && has("quasi_wavelets", "intermittency"));
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
            "`method` is `kriging`; known texture methods: fft_ma, cholesky, gaussians, quasi_wavelets"
        );
    }
}
