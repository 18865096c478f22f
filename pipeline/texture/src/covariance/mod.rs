//! Covariance: models (one file each), the estimate from a masked raster, and what detrending and trimming do to it.

pub mod bins;
pub(crate) mod density;
pub(crate) mod empirical;
pub mod filtered;
pub mod form;
pub mod lag;
pub mod masked;
pub mod models;
pub(crate) mod partial;
pub mod trimmed;

use sastrugi_schemas::ParameterError;
use sastrugi_schemas::fit::FitFile;
use std::collections::BTreeMap;

pub use bins::LagBins;
pub use form::{Form, Parameter};
pub use masked::{MaskedCovariance, PairSums, masked_covariance};
pub use models::{MODELS, Model, model};

/// One term of a covariance.
#[derive(Clone, Copy)]
pub struct Structure {
    /// Its family.
    pub model: &'static dyn Model,
    /// Standard deviation sigma, m (self-affine: of increments over 1 m).
    pub sigma_m: f64,
    /// Range b along the long axis, m (self-affine: 1).
    pub range_m: f64,
    /// Shape; 0 for families without one.
    pub shape: f64,
}

/// A covariance function `sum of sigma_i^2 R_i(rho' / b_i)`, plus a nugget at lag zero; rho' is the distance with what lies
/// across the long axis stretched by `1 / ratio` (geometric anisotropy).
#[derive(Clone)]
pub struct Covariance {
    /// Terms, the first the leading one.
    pub structures: Vec<Structure>,
    /// White variance of each cell (noise of the measurement, or texture below the cell), m2.
    pub nugget_m2: f64,
    /// Range across the long axis over range along it, in (0, 1].
    pub ratio: f64,
    /// Direction of the long axis, degrees clockwise from north, in [0, 180).
    pub azimuth_deg: f64,
}

impl Covariance {
    /// An isotropic covariance of one term without nugget.
    ///
    /// # Errors
    /// A sigma or b that is not finite and above 0; a model that needs a shape.
    pub fn new(model: &'static dyn Model, sigma_m: f64, range_m: f64) -> Result<Self, ParameterError> {
        let sigma_m = ParameterError::positive("sigma_m", sigma_m)?;
        let range_m = ParameterError::positive("range_m", range_m)?;
        let shape = model.shape().map_or(0.0, |s| s.start);
        let structures = vec![Structure { model, sigma_m, range_m, shape }];
        Ok(Self { structures, nugget_m2: 0.0, ratio: 1.0, azimuth_deg: 0.0 })
    }

    /// The covariance a fit file states: its `model` with that model's parameters; of an empirical fit, the model that continues it.
    ///
    /// # Errors
    /// An unknown model; a parameter that is missing, unknown or out of range.
    pub fn of_fit(fit: &FitFile) -> Result<Self, ParameterError> {
        let model = fit.map.as_ref().map_or(&fit.model, |map| &map.model);
        let covariance = Form::parse(model)?.covariance(&fit.parameters).map_err(|e| e.within("parameters"))?;
        let variance_m2 = covariance.variance_m2();
        if !(variance_m2.is_normal() && covariance.nugget_m2.is_finite()) {
            return Err(ParameterError::new(
                "parameters",
                format!("give a variance of {variance_m2:e} m2, beyond all computing"),
            ));
        }
        Ok(covariance)
    }

    /// Covariance in m2 at a lag of `[east, north]` m.
    pub fn at(&self, lag_m: [f64; 2]) -> f64 {
        self.at_distance(self.distance_m(lag_m))
    }

    /// Covariance in m2 at a distance along the long axis (any direction, when isotropic).
    pub fn at_distance(&self, distance_m: f64) -> f64 {
        let nugget = if distance_m == 0.0 { self.nugget_m2 } else { 0.0 };
        let term = |s: &Structure| s.sigma_m * s.sigma_m * s.model.correlation(distance_m / s.range_m, s.shape);
        self.structures.iter().map(term).sum::<f64>() + nugget
    }

    /// Length of a lag `[east, north]` as the covariance sees it, m.
    pub fn distance_m(&self, [x, y]: [f64; 2]) -> f64 {
        if self.is_isotropic() {
            return (x * x + y * y).sqrt();
        }
        let (sin, cos) = libm::sincos(self.azimuth_deg.to_radians());
        let (along, across) = (x * sin + y * cos, (x * cos - y * sin) / self.ratio);
        (along * along + across * across).sqrt()
    }

    /// True when no direction differs from another.
    pub fn is_isotropic(&self) -> bool {
        self.ratio == 1.0
    }

    /// True when the covariance is a true one: it has a variance.
    pub fn is_stationary(&self) -> bool {
        self.structures.iter().all(|s| s.model.scale_names().1.is_some())
    }

    /// A covariance with a variance that no one can tell from this one over distances well below `outer_m`: a self-affine
    /// term becomes a Matern one of that range, with the same increments at short lags,
    /// `sigma^2 = s^2 (2 b)^(2 H) Gamma(1 + H) / (2 Gamma(1 - H))`.
    pub fn stationary(&self, outer_m: f64) -> Self {
        let twin = |s: &Structure| match s.model.scale_names().1 {
            Some(_) => *s,
            None => {
                let gammas = libm::tgamma(1.0 + s.shape) / (2.0 * libm::tgamma(1.0 - s.shape));
                let growth = libm::exp(2.0 * s.shape * libm::log(2.0 * outer_m));
                let sigma_m = s.sigma_m * (growth * gammas).sqrt();
                Structure { model: &models::matern::Matern, sigma_m, range_m: outer_m, shape: s.shape }
            }
        };
        Self { structures: self.structures.iter().map(twin).collect(), ..self.clone() }
    }

    /// Variance without the nugget, m2.
    pub fn variance_m2(&self) -> f64 {
        self.structures.iter().map(|s| s.sigma_m * s.sigma_m).sum()
    }

    /// Standard deviation without the nugget, m.
    pub fn sigma_m(&self) -> f64 {
        self.variance_m2().sqrt()
    }

    /// The longest range of its terms, m.
    pub fn range_m(&self) -> f64 {
        self.structures.iter().map(|s| s.range_m).fold(0.0, f64::max)
    }

    /// Its parameters by the names of fit files.
    pub fn parameters(&self, form: &Form) -> BTreeMap<String, f64> {
        form.parameters().into_iter().map(|p| (p.name.clone(), p.of(self))).collect()
    }
}

#[cfg(test)]
mod tests;
