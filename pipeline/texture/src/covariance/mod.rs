//! Covariance: models (one file each), the estimate from a masked raster, and the effects of detrending and trimming on it.

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
    /// Correlation model.
    pub model: &'static dyn Model,
    /// Standard deviation sigma, m (self-affine: of increments over 1 m).
    pub sigma_m: f64,
    /// Range b along the long axis, m (self-affine: 1).
    pub range_m: f64,
    /// Shape; 0 for models without one.
    pub shape: f64,
}

/// A covariance function `sum of sigma_i^2 R_i(rho' / b_i)`, plus a nugget at lag zero; rho' is the distance with the component
/// across the long axis stretched by `1 / ratio` (geometric anisotropy).
#[derive(Clone)]
pub struct Covariance {
    /// Terms, the leading one first.
    pub structures: Vec<Structure>,
    /// Variance that is uncorrelated from cell to cell (measurement noise, or texture below the cell size), m2.
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

    /// The covariance that a fit file states: its `model` with that model's parameters; for an empirical fit, the model that
    /// extrapolates the map.
    ///
    /// ```
    /// use sastrugi_schemas::fit::FitFile;
    /// use sastrugi_texture::covariance::Covariance;
    ///
    /// # fn main() -> Result<(), Box<dyn std::error::Error>> {
    /// // The long axis points to the north; the range across it is half as long.
    /// let parameters = [("sigma_m", 0.5), ("range_m", 2.0), ("ratio", 0.5), ("azimuth_deg", 0.0)];
    /// let parameters = parameters.map(|(name, value)| (name.to_owned(), value)).into();
    /// let fit = FitFile { model: "anisotropic:exponential".to_owned(), parameters, ..FitFile::default() };
    /// let covariance = Covariance::of_fit(&fit)?;
    /// assert_eq!(covariance.at([0.0, 0.0]), 0.25);
    /// // Two metres north or one metre east: exp(-1) is left.
    /// assert_eq!(covariance.at([0.0, 2.0]), covariance.at([1.0, 0.0]));
    /// assert!((covariance.at([0.0, 2.0]) / 0.25 - (-1.0f64).exp()).abs() < 1e-12);
    /// # Ok(())
    /// # }
    /// ```
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
                format!("give a variance of {variance_m2:e} m2, which is too large or too small to compute with"),
            ));
        }
        Ok(covariance)
    }

    /// Covariance in m2 at a lag of `[east, north]` m.
    pub fn at(&self, lag_m: [f64; 2]) -> f64 {
        self.at_distance(self.distance_m(lag_m))
    }

    /// Covariance in m2 at a distance along the long axis (in any direction, if isotropic).
    pub fn at_distance(&self, distance_m: f64) -> f64 {
        let nugget = if distance_m == 0.0 { self.nugget_m2 } else { 0.0 };
        let term = |s: &Structure| s.sigma_m * s.sigma_m * s.model.correlation(distance_m / s.range_m, s.shape);
        self.structures.iter().map(term).sum::<f64>() + nugget
    }

    /// [`Self::at_distance`] for many distances: what depends on the parameters alone is computed once.
    pub(crate) fn by_distance(&self) -> impl Fn(f64) -> f64 + Send + Sync + use<> {
        let term = |s: &Structure| (s.sigma_m * s.sigma_m, s.range_m, s.model.of_shape(s.shape));
        let terms: Vec<_> = self.structures.iter().map(term).collect();
        let nugget_m2 = self.nugget_m2;
        move |distance_m| {
            let nugget = if distance_m == 0.0 { nugget_m2 } else { 0.0 };
            let all = terms.iter().map(|(sill_m2, range_m, correlation)| sill_m2 * correlation(distance_m / range_m));
            all.sum::<f64>() + nugget
        }
    }

    /// [`Self::at`] for many lags.
    pub(crate) fn by_lag(&self) -> impl Fn([f64; 2]) -> f64 + Send + Sync + use<> {
        let (length_m, covariance) = (self.lengths(), self.by_distance());
        move |lag_m| covariance(length_m(lag_m))
    }

    /// Effective length of a lag `[east, north]`: rho', m.
    pub fn distance_m(&self, lag_m: [f64; 2]) -> f64 {
        self.lengths()(lag_m)
    }

    /// The effective length as a function of the lag.
    fn lengths(&self) -> impl Fn([f64; 2]) -> f64 + Send + Sync + use<> {
        let axis = (!self.is_isotropic()).then(|| libm::sincos(self.azimuth_deg.to_radians()));
        let ratio = self.ratio;
        move |[x, y]| {
            let Some((sin, cos)) = axis else { return (x * x + y * y).sqrt() };
            let (along, across) = (x * sin + y * cos, (x * cos - y * sin) / ratio);
            (along * along + across * across).sqrt()
        }
    }

    /// True if the range is the same in all directions.
    pub fn is_isotropic(&self) -> bool {
        self.ratio == 1.0
    }

    /// True if all terms have a finite variance.
    pub fn is_stationary(&self) -> bool {
        self.structures.iter().all(|s| s.model.scale_names().1.is_some())
    }

    /// A stationary covariance that is indistinguishable from this one over distances well below `outer_m`: a self-affine
    /// term becomes a Matern term with that range and the same increments at short lags,
    /// `sigma^2 = s^2 (2 b)^(2 H) Gamma(1 + H) / (2 Gamma(1 - H))`.
    pub fn stationary(&self, outer_m: f64) -> Self {
        let stationary = |s: &Structure| match s.model.scale_names().1 {
            Some(_) => *s,
            None => {
                let gammas = libm::tgamma(1.0 + s.shape) / (2.0 * libm::tgamma(1.0 - s.shape));
                let growth = libm::exp(2.0 * s.shape * libm::log(2.0 * outer_m));
                let sigma_m = s.sigma_m * (growth * gammas).sqrt();
                Structure { model: &models::matern::Matern, sigma_m, range_m: outer_m, shape: s.shape }
            }
        };
        Self { structures: self.structures.iter().map(stationary).collect(), ..self.clone() }
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

    /// Its parameters, named as in fit files.
    pub fn parameters(&self, form: &Form) -> BTreeMap<String, f64> {
        form.parameters().into_iter().map(|p| (p.name.clone(), p.of(self))).collect()
    }
}

#[cfg(test)]
mod tests;
