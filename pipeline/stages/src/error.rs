//! Errors of this room, grouped by what the caller should do about them.

use crate::builder::BuildError;
use crate::job::{Cause, JobError};
use crate::machine::{Fault, fault};
use crate::runner::cache::CacheError;
use crate::runner::execute::Stopped;
use crate::study::Refusals;
use sastrugi_schemas::ParameterError;
use sastrugi_store::objects::ObjectError;
use sastrugi_store::release::ReleaseError;
use sastrugi_texture::FitError;
use std::path::Path;

/// An error; each message is one sentence.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// The study is invalid.
    #[error("{name}: {refusals}")]
    Study {
        /// Name of the file.
        name: String,
        /// Its text.
        text: String,
        /// The errors and their places.
        refusals: Refusals,
    },
    /// Bad usage.
    #[error("{0}")]
    Usage(String),
    /// Input data is missing or unusable.
    #[error("{0}")]
    Input(String),
    /// Failure on this machine.
    #[error("{0}")]
    Failed(String),
    /// Failure that may succeed on a retry.
    #[error("{0}")]
    Retry(String),
}

impl Error {
    /// Input that cannot be read.
    pub fn unreadable(path: &Path, error: &std::io::Error) -> Self {
        let path = path.display();
        Self::Input(match error.kind() {
            std::io::ErrorKind::NotFound => format!("{path}: no such file"),
            std::io::ErrorKind::IsADirectory => format!("{path} is a folder, not a file"),
            _ => format!("{path}: {error}"),
        })
    }

    /// A failure on this machine.
    pub fn failed(message: impl std::fmt::Display) -> Self {
        Self::Failed(message.to_string())
    }

    /// A failure to read or write; retryable if the kind of error is.
    pub fn io(error: impl std::error::Error + 'static) -> Self {
        match fault(&error) {
            Some(Fault::Passing) => Self::Retry(error.to_string()),
            _ => Self::Failed(error.to_string()),
        }
    }

    /// The same for a file; one that is not a regular file is unusable input.
    pub fn at(path: &Path, error: std::io::Error) -> Self {
        let words = match error.kind() {
            std::io::ErrorKind::IsADirectory => format!("{} is a folder; name a file", path.display()),
            _ => format!("{}: {error}", path.display()),
        };
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
        let advice = "the run stopped without writing a release; finished items are kept in the work area, so rerun once this is fixed";
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
            ReleaseError::Io { ref path, ref source } if error.unusable_input() => Self::unreadable(path, source),
            _ if error.unusable_input() => Self::Input(error.to_string()),
            _ => Self::io(error),
        }
    }
}

impl From<ObjectError> for Error {
    /// An address or an environment that is wrong is bad usage.
    fn from(error: ObjectError) -> Self {
        match error {
            ObjectError::Address(_) | ObjectError::Environment { .. } | ObjectError::Credentials { .. } => {
                Self::Usage(error.to_string())
            }
            ObjectError::Request { .. } if error.is_transient() => Self::Retry(error.to_string()),
            ObjectError::Request { .. } => Self::Failed(error.to_string()),
            ObjectError::File { path, source } => Self::at(&path, source),
        }
    }
}

impl From<FitError> for Error {
    /// A parameter out of range is bad usage; anything else is a problem with the DEM.
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

/// Attaches the study's text to an error in its graph.
pub fn of_build(name: &str, text: &str, error: BuildError) -> Error {
    match error {
        BuildError::Study(refusals) => Error::Study { name: name.to_owned(), text: text.to_owned(), refusals },
        BuildError::Input(message) => Error::Input(message),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::io::{Error as IoError, ErrorKind};

    /// What the caller should do about an error follows from its cause: exit codes depend on it.
    #[test]
    fn val_causes_become_kinds_of_errors() {
        let of = |cause: Cause| Error::from(JobError { message: "why".to_owned(), cause });
        assert!(matches!(of(Cause::Input), Error::Input(message) if message == "why"));
        assert!(matches!(of(Cause::Item), Error::Failed(message) if message == "why"));
        assert!(matches!(of(Cause::Machine(Fault::Lasting)), Error::Failed(_)));
        assert!(matches!(of(Cause::Machine(Fault::Passing)), Error::Retry(message) if message == "why"));
        let usage = Error::from(ParameterError::new("trim", "is 2"));
        assert!(matches!(usage, Error::Usage(message) if message == "`trim` is 2"));
    }

    /// A full disk is worth a retry, a path that is not a file is bad input, anything else is a failure. Messages name the file.
    #[test]
    fn val_errors_of_files_name_them() {
        let path = Path::new("a/b.tif");
        let no_space = 28;
        for (error, expected) in [
            (IoError::from_raw_os_error(no_space), "retry"),
            (IoError::new(ErrorKind::InvalidInput, "not a file"), "input"),
            (IoError::new(ErrorKind::NotFound, "gone"), "failed"),
        ] {
            let found = Error::at(path, error);
            let kind = match &found {
                Error::Retry(_) => "retry",
                Error::Input(_) => "input",
                Error::Failed(_) => "failed",
                other => panic!("{other}"),
            };
            assert!(kind == expected && found.to_string().starts_with("a/b.tif: "), "{kind}: {found}");
        }
        let folder = Error::at(path, IoError::from(ErrorKind::IsADirectory));
        assert_eq!(folder.to_string(), "a/b.tif is a folder; name a file");
    }

    /// Of a release, a file that is missing, or a folder or a pipe in its place, is unusable input; a refusal by the system is not.
    #[test]
    fn val_missing_and_irregular_files_of_a_release_are_unusable_input() {
        let of = |kind: ErrorKind, why: &str| {
            let path = Path::new("release/manifest.json").to_owned();
            Error::from(ReleaseError::Io { path, source: IoError::new(kind, why) })
        };
        for (kind, words) in [
            (ErrorKind::NotFound, "release/manifest.json: no such file"),
            (ErrorKind::IsADirectory, "release/manifest.json is a folder, not a file"),
            (ErrorKind::InvalidInput, "release/manifest.json: is a pipe"),
        ] {
            let found = of(kind, "is a pipe");
            assert!(matches!(&found, Error::Input(why) if why == words), "{kind}: {found:?}");
        }
        assert!(matches!(of(ErrorKind::PermissionDenied, "no"), Error::Failed(_)));
    }
}
