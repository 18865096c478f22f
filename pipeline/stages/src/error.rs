//! What a caller of this room can be told, sorted by what the caller should do about it.

use crate::builder::BuildError;
use crate::job::{Cause, JobError};
use crate::machine::{Fault, fault};
use crate::runner::cache::CacheError;
use crate::runner::execute::Stopped;
use crate::study::Refusals;
use sastrugi_schemas::ParameterError;
use sastrugi_store::release::ReleaseError;
use sastrugi_texture::FitError;
use std::path::Path;

/// An error, one sentence each.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// The study's text is wrong.
    #[error("{name}: {refusals}")]
    Study {
        /// Name of the file.
        name: String,
        /// Its text.
        text: String,
        /// What is wrong, and where.
        refusals: Refusals,
    },
    /// The call is wrong.
    #[error("{0}")]
    Usage(String),
    /// Input data is missing or unusable.
    #[error("{0}")]
    Input(String),
    /// The work could not be done.
    #[error("{0}")]
    Failed(String),
    /// The work cannot be done now, but later.
    #[error("{0}")]
    Retry(String),
}

impl Error {
    /// Work that could not be done.
    pub fn failed(message: impl std::fmt::Display) -> Self {
        Self::Failed(message.to_string())
    }

    /// A failure to read or write: to be tried again where the error says that this may help.
    pub fn io(error: impl std::error::Error + 'static) -> Self {
        match fault(&error) {
            Some(Fault::Passing) => Self::Retry(error.to_string()),
            _ => Self::Failed(error.to_string()),
        }
    }

    /// The same about a file; one that is no regular file is unusable input.
    pub fn at(path: &Path, error: std::io::Error) -> Self {
        let words = format!("{}: {error}", path.display());
        if error.kind() == std::io::ErrorKind::InvalidInput {
            return Self::Input(words);
        }
        match Self::io(error) {
            Self::Retry(_) => Self::Retry(words),
            _ => Self::Failed(words),
        }
    }
}

impl From<JobError> for Error {
    fn from(error: JobError) -> Self {
        match error.cause {
            Cause::Input => Self::Input(error.message),
            Cause::Machine(Fault::Passing) => Self::Retry(error.message),
            Cause::Item | Cause::Machine(Fault::Lasting) => Self::Failed(error.message),
        }
    }
}

impl From<Stopped> for Error {
    fn from(stopped: Stopped) -> Self {
        let Stopped { item, error } = stopped;
        let advice = "the run stopped and no release was written; finished items are kept in the work area, so run again once this is fixed";
        error.reworded(|words| format!("{item}: {words}; {advice}")).into()
    }
}

impl From<CacheError> for Error {
    fn from(error: CacheError) -> Self {
        match error {
            CacheError::Busy(_) => Self::Retry(error.to_string()),
            CacheError::NotOurs(_) | CacheError::Link(_) => Self::Usage(error.to_string()),
            CacheError::Io { .. } => Self::io(error),
        }
    }
}

impl From<ReleaseError> for Error {
    fn from(error: ReleaseError) -> Self {
        match error {
            ReleaseError::Occupied { .. } => Self::Usage(error.to_string()),
            _ if error.unusable_input() => Self::Input(error.to_string()),
            _ => Self::io(error),
        }
    }
}

impl From<FitError> for Error {
    /// A parameter out of range is the caller's; anything else lies in the DEM.
    fn from(error: FitError) -> Self {
        match error {
            FitError::Parameter(parameter) => parameter.into(),
            other => Self::Input(other.to_string()),
        }
    }
}

impl From<ParameterError> for Error {
    fn from(error: ParameterError) -> Self {
        Self::Usage(error.to_string())
    }
}

/// Joins an error of the graph to the text that it is about.
pub fn of_build(name: &str, text: &str, error: BuildError) -> Error {
    match error {
        BuildError::Study(refusals) => Error::Study { name: name.to_owned(), text: text.to_owned(), refusals },
        BuildError::Input(message) => Error::Input(message),
    }
}
