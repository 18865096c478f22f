//! What a texture matches: a fit of the study, or a covariance that the study states.

use super::fit;
use crate::job::{ItemRef, JobError, Work};
use sastrugi_schemas::ParameterError;
use sastrugi_schemas::fit::FitFile;
use sastrugi_texture::{Cost, Method, Prospect};
use serde_json::{Value, json};
use std::collections::BTreeMap;

/// What a texture matches.
#[derive(Clone)]
pub enum Matched {
    /// A fit of the study.
    Item(ItemRef),
    /// A covariance that the study states.
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

    /// As a recipe and the table `terrains` name it.
    pub fn describe(&self) -> Value {
        match self {
            Self::Item(item) => json!(item.id),
            Self::Stated(fit) => json!({ "model": fit.model, "parameters": fit.parameters }),
        }
    }

    /// The item that makes the fit.
    pub fn parent(&self) -> Option<ItemRef> {
        match self {
            Self::Item(item) => Some(item.clone()),
            Self::Stated(_) => None,
        }
    }

    /// What a texture of the method takes. For a fit of the study, only what the method's parameters determine, and memory for a
    /// range as long as the fit's window; `prospects` tells of the fits.
    ///
    /// # Errors
    /// A stated covariance that the method refuses.
    pub fn cost(&self, method: &dyn Method, prospects: &BTreeMap<String, Prospect>) -> Result<Cost, ParameterError> {
        match self {
            Self::Item(fit) => Ok(prospects.get(&fit.id).map_or_else(|| method.cost(), |fit| method.cost_of(fit))),
            Self::Stated(fit) => Ok(method.bind(fit)?.cost()),
        }
    }
}

/// Rough time of an arithmetic operation of a method, s: of transforms, of bumps that are added all over a field, of a dense factor.
pub fn seconds_per_operation(method: &str) -> f64 {
    match method {
        "gaussians" | "quasi_wavelets" => 3.5e-9,
        "cholesky" => 2e-10,
        _ => 5e-10,
    }
}
