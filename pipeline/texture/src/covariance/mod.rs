//! Covariance: models (one file each), the estimate from a masked raster, and what detrending and trimming do to it.

pub mod bins;
pub mod exponential;
pub mod filtered;
pub mod masked;
pub mod partial;
pub mod trimmed;

use sastrugi_schemas::fit::FitFile;
use sastrugi_schemas::{Kind, ParameterError};

pub use bins::LagBins;
pub use masked::{MaskedCovariance, masked_covariance};

/// A family of isotropic correlation functions with one range.
pub trait Model: Sync {
    /// Name, source and parameters.
    fn kind(&self) -> Kind;

    /// Correlation at a distance of `ratio = rho / b >= 0`; 1 at 0.
    fn correlation(&self, ratio: f64) -> f64;
}

/// Every model.
pub static MODELS: [&dyn Model; 1] = [&exponential::Exponential];

/// The model of that name.
///
/// # Errors
/// An unknown name, with the known ones.
pub fn model(name: &str) -> Result<&'static dyn Model, ParameterError> {
    MODELS.into_iter().find(|m| m.kind().kind == name).ok_or_else(|| {
        let known: Vec<&str> = MODELS.iter().map(|m| m.kind().kind).collect();
        ParameterError::new("model", format!("is `{name}`; known covariance models: {}", known.join(", ")))
    })
}

/// A covariance function `sigma^2 R(rho / b)`.
#[derive(Clone, Copy)]
pub struct Covariance {
    model: &'static dyn Model,
    /// Standard deviation sigma, m.
    pub sigma_m: f64,
    /// Range b, m.
    pub range_m: f64,
}

impl Covariance {
    /// A covariance of the given model.
    ///
    /// # Errors
    /// A sigma or b that is not finite and above 0.
    pub fn new(model: &'static dyn Model, sigma_m: f64, range_m: f64) -> Result<Self, ParameterError> {
        let sigma_m = ParameterError::positive("sigma_m", sigma_m)?;
        let range_m = ParameterError::positive("range_m", range_m)?;
        Ok(Self { model, sigma_m, range_m })
    }

    /// The covariance with `sigma = exp(ln_sigma)` and `b = exp(ln_range)`, for a search over logarithms.
    pub(crate) fn from_logarithms(model: &'static dyn Model, ln_sigma: f64, ln_range: f64) -> Self {
        Self { model, sigma_m: libm::exp(ln_sigma), range_m: libm::exp(ln_range) }
    }

    /// The covariance a fit file states: its `model` with `sigma_m` and `range_m`.
    ///
    /// # Errors
    /// An unknown model; a parameter that is missing, unknown or out of range.
    pub fn of_fit(fit: &FitFile) -> Result<Self, ParameterError> {
        let model = model(&fit.model)?;
        let known = ["sigma_m", "range_m"];
        if let Some(key) = fit.parameters.keys().find(|k| !known.contains(&k.as_str())) {
            let message = format!("is no parameter of model `{}`, which has {}", fit.model, known.join(", "));
            return Err(ParameterError::new(key, message).within("parameters"));
        }
        let value = |key: &str| {
            let found = fit.parameters.get(key).copied();
            found.ok_or_else(|| ParameterError::new(key, "is missing from the fit file").within("parameters"))
        };
        Self::new(model, value("sigma_m")?, value("range_m")?).map_err(|e| e.within("parameters"))
    }

    /// Covariance in m2 at a distance of `distance_m >= 0`.
    pub fn at(&self, distance_m: f64) -> f64 {
        self.sigma_m * self.sigma_m * self.model.correlation(distance_m / self.range_m)
    }
}

#[cfg(test)]
mod tests;
