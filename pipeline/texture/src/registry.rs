//! Fit, covariance models and synthesis methods by name: the one list that knows them all.

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

/// How the parameters of a method are checked.
type Check = fn(&Value) -> Result<Box<dyn Method>, ParameterError>;

/// Every synthesis method.
const METHODS: [(fn() -> Kind, Check); 4] = [
    (fft_ma::kind, synth::check::<FftMaParameters>),
    (cholesky::kind, synth::check::<CholeskyParameters>),
    (gaussians::kind, synth::check::<GaussiansParameters>),
    (quasi_wavelets::kind, synth::check::<QuasiWaveletsParameters>),
];

/// Every kind of this room: the fit, the covariance models, the synthesis methods.
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

/// The synthesis method of that name with raw `parameters`.
///
/// # Errors
/// An unknown method (the known ones are listed); parameters that the method refuses whatever it is to match.
pub fn method(name: &str, parameters: &Value) -> Result<Box<dyn Method>, ParameterError> {
    match METHODS.into_iter().find(|(kind, _)| kind().kind == name) {
        Some((_, check)) => check(parameters),
        None => {
            let known = METHODS.map(|(kind, _)| kind().kind).join(", ");
            Err(ParameterError::new("method", format!("is `{name}`; known texture methods: {known}")))
        }
    }
}

/// A texture of the method of that name with raw `parameters`, matching `fit`.
///
/// # Errors
/// As [`method`]; a fit that the method refuses.
pub fn prepare(name: &str, parameters: &Value, fit: &FitFile) -> Result<Box<dyn Synthesis>, ParameterError> {
    method(name, parameters)?.bind(fit)
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn val_kinds_are_named_once() {
        let names: Vec<_> = kinds().iter().map(|k| (k.family, k.kind)).collect();
        let families = |f: &str| names.iter().filter(|(family, _)| *family == f).count();
        assert_eq!((families("fit"), families("covariance"), families("texture")), (1, MODELS.len(), METHODS.len()));
        let distinct: std::collections::BTreeSet<_> = names.iter().collect();
        assert_eq!(distinct.len(), names.len());
    }

    #[test]
    fn val_an_unknown_method_lists_the_known() {
        let error = prepare("kriging", &json!({}), &FitFile::default()).err().unwrap();
        assert_eq!(
            error.to_string(),
            "`method` is `kriging`; known texture methods: fft_ma, cholesky, gaussians, quasi_wavelets"
        );
    }
}
