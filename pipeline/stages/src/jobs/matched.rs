//! The covariance that a texture matches: a fit of the study, or a model stated in the study.

use super::fit;
use crate::job::{ItemRef, JobError, Work};
use sastrugi_schemas::ParameterError;
use sastrugi_schemas::fit::FitFile;
use sastrugi_texture::{Cost, Method, Prospect};
use serde_json::{Value, json};
use std::collections::BTreeMap;

/// The covariance that a texture matches.
#[derive(Clone)]
pub enum Matched {
    /// A fit of the study.
    Item(ItemRef),
    /// A covariance stated in the study.
    Stated(Box<FitFile>),
}

impl Matched {
    /// The fit file.
    ///
    /// # Errors
    /// A file that cannot be read.
    pub fn read(&self, work: &Work<'_>) -> Result<FitFile, JobError> {
        match self {
            Self::Stated(fit) => Ok(FitFile::clone(fit)),
            Self::Item(item) => {
                let path = work.parent(item, fit::FIT)?;
                let bytes = std::fs::read(&path).map_err(|e| JobError::at(&path, e))?;
                serde_json::from_slice(&bytes).map_err(JobError::new)
            }
        }
    }

    /// Its description in recipes and in the table `terrains`.
    pub fn describe(&self) -> Value {
        match self {
            Self::Item(item) => json!(item.id),
            Self::Stated(fit) => json!({ "model": fit.model, "parameters": fit.parameters }),
        }
    }

    /// The item that computes the fit.
    pub fn parent(&self) -> Option<ItemRef> {
        match self {
            Self::Item(item) => Some(item.clone()),
            Self::Stated(_) => None,
        }
    }

    /// Cost of a texture synthesised by the method. For a fit of the study, whose range is not known yet, it follows from the parameters
    /// of the method, with memory for a range as long as the window of the fit; `prospects` holds the settings of the fits by id.
    ///
    /// # Errors
    /// A stated covariance that the method refuses.
    pub fn cost(&self, method: &dyn Method, prospects: &BTreeMap<String, Prospect>) -> Result<Cost, ParameterError> {
        match self {
            Self::Item(fit) => Ok(prospects.get(&fit.id).map_or_else(|| method.cost(), |fit| method.cost_of(fit))),
            Self::Stated(fit) => Ok(method.bind(fit, None)?.cost()),
        }
    }
}

/// Approximate time of one arithmetic operation of a method, s: adding bumps all over a field, a dense factorisation, or transforms.
pub fn seconds_per_operation(method: &str) -> f64 {
    match method {
        "gaussians" | "quasi_wavelets" => 3.5e-9,
        "cholesky" => 2e-10,
        _ => 5e-10,
    }
}
