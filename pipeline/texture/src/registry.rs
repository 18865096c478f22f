//! Fit, covariance models and synthesis methods by name: the one list that knows them all.

use crate::covariance::MODELS;
use crate::fit::FitParameters;
use crate::synth::{Synthesis, Wanted, cholesky, fft_ma, gaussians, quasi_wavelets};
use sastrugi_schemas::fit::FitFile;
use sastrugi_schemas::kind::schema_of;
use sastrugi_schemas::{Kind, ParameterError};
use serde_json::Value;

/// How a method is prepared.
type Prepare = fn(&Value, Wanted) -> Result<Box<dyn Synthesis>, ParameterError>;

/// Every synthesis method.
const METHODS: [(fn() -> Kind, Prepare); 4] = [
    (fft_ma::kind, fft_ma::prepare),
    (cholesky::kind, cholesky::prepare),
    (gaussians::kind, gaussians::prepare),
    (quasi_wavelets::kind, quasi_wavelets::prepare),
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

/// A texture of `method` with raw `parameters`, matching `fit`.
///
/// # Errors
/// An unknown method (the known ones are listed); parameters or a fit that the method refuses.
pub fn prepare(method: &str, parameters: &Value, fit: &FitFile) -> Result<Box<dyn Synthesis>, ParameterError> {
    match METHODS.into_iter().find(|(kind, _)| kind().kind == method) {
        Some((kind, _)) if fit.map.is_some() && kind().kind != fft_ma::kind().kind => {
            let message = format!("is `{method}`; an empirical covariance is made by `fft_ma` only");
            Err(ParameterError::new("method", message))
        }
        Some((_, prepare)) => prepare(parameters, Wanted::of_fit(fit)?),
        None => {
            let known = METHODS.map(|(kind, _)| kind().kind).join(", ");
            Err(ParameterError::new("method", format!("is `{method}`; known texture methods: {known}")))
        }
    }
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
