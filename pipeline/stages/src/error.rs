//! What a caller of this room can be told, sorted by what the caller should do about it.

use crate::jobs::JobError;
use crate::registry::BuildError;
use crate::runner::cache::CacheError;
use crate::study::StudyError;
use sastrugi_schemas::ParameterError;

/// An error, one sentence each.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// The study's text is wrong.
    #[error("{name}: {error}")]
    Study {
        /// Name of the file.
        name: String,
        /// Its text.
        text: String,
        /// What is wrong, and where.
        error: StudyError,
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
    /// A failure of this machine.
    pub fn failed(message: impl std::fmt::Display) -> Self {
        Self::Failed(message.to_string())
    }
}

impl From<JobError> for Error {
    fn from(error: JobError) -> Self {
        if error.unusable_input { Self::Input(error.message) } else { Self::Failed(error.message) }
    }
}

impl From<CacheError> for Error {
    fn from(error: CacheError) -> Self {
        match error {
            CacheError::Busy(_) => Self::Retry(error.to_string()),
            CacheError::Io { .. } => Self::Failed(error.to_string()),
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
        BuildError::Study(error) => Error::Study { name: name.to_owned(), text: text.to_owned(), error },
        BuildError::Input(message) => Error::Input(message),
    }
}
