//! Families of correlation functions, one file each.

pub mod exponential;
pub mod gaussian;
pub mod matern;
pub mod self_affine;
pub mod spherical;

use sastrugi_schemas::{Kind, ParameterError};

/// A family of isotropic correlation functions.
pub trait Model: Sync {
    /// Name, source and parameters.
    fn kind(&self) -> Kind;

    /// Correlation at a distance of `ratio = rho / b >= 0`; 1 at 0 (self-affine: see there). `shape` is the value of
    /// [`Model::shape`], and is ignored by a model without one.
    fn correlation(&self, ratio: f64, shape: f64) -> f64;

    /// [`Model::correlation`] for one shape, as a function of the ratio: what depends on the shape alone is computed once.
    fn of_shape(&'static self, shape: f64) -> Box<dyn Fn(f64) -> f64 + Send + Sync> {
        Box::new(move |ratio| self.correlation(ratio, shape))
    }

    /// The shape parameter, if the model has one in addition to sigma and b.
    fn shape(&self) -> Option<Shape> {
        None
    }

    /// True if the correlation falls linearly from 1: then sigma^2 / b is the short-range slope, up to a factor.
    fn is_linear_at_origin(&self) -> bool {
        false
    }

    /// Names of sigma and b in fit files; no b for a model without a characteristic scale.
    fn scale_names(&self) -> (&'static str, Option<&'static str>) {
        ("sigma_m", Some("range_m"))
    }
}

/// A shape parameter.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Shape {
    /// Name in fit files.
    pub name: &'static str,
    /// Smallest and largest value.
    pub bounds: (f64, f64),
    /// Where a search starts.
    pub start: f64,
}

/// Every model.
pub static MODELS: [&dyn Model; 5] =
    [&exponential::Exponential, &gaussian::Gaussian, &spherical::Spherical, &matern::Matern, &self_affine::SelfAffine];

/// The model called `name`.
///
/// # Errors
/// An unknown name; the message lists the known ones.
pub fn model(name: &str) -> Result<&'static dyn Model, ParameterError> {
    MODELS.into_iter().find(|m| m.kind().kind == name).ok_or_else(|| {
        let known: Vec<&str> = MODELS.iter().map(|m| m.kind().kind).collect();
        let known = known.join(", ");
        ParameterError::new(
            "model",
            format!(
                "is `{name}`; it must be one of {known}, or a sum of two (`exponential+gaussian`), optionally followed by \
                 `+nugget` or preceded by `anisotropic:`"
            ),
        )
    })
}
