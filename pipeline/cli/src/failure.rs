//! Failures of verbs, and exit codes.

use sastrugi_stages::Error;
use std::process::ExitCode;

/// Exit codes: part of the contract.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum Code {
    /// Done.
    Done = 0,
    /// Failed, or every item failed.
    Failed = 1,
    /// Bad usage or a bad study.
    Usage = 2,
    /// Done, but some items failed.
    Partial = 3,
    /// Verification found a difference.
    Difference = 4,
    /// Input data missing or unusable.
    Input = 65,
    /// Interrupted or retryable.
    Retry = 75,
}

impl Code {
    /// The exit code of an error.
    pub fn of(error: &Error) -> Self {
        match error {
            Error::Study { .. } | Error::Usage(_) => Self::Usage,
            Error::Input(_) => Self::Input,
            Error::Failed(_) => Self::Failed,
            Error::Retry(_) => Self::Retry,
        }
    }
}

impl From<Code> for ExitCode {
    fn from(code: Code) -> Self {
        Self::from(code as u8)
    }
}

/// Why a verb failed.
#[derive(Debug)]
pub struct Failure(pub Error);

impl Failure {
    /// Bad usage.
    pub fn usage(message: impl Into<String>) -> Self {
        Self(Error::Usage(message.into()))
    }

    /// Anything that went wrong on this machine.
    pub fn failed(message: impl std::fmt::Display) -> Self {
        Self(Error::Failed(message.to_string()))
    }

    /// Input data that is missing or unusable.
    pub fn input(message: impl std::fmt::Display) -> Self {
        Self(Error::Input(message.to_string()))
    }

    /// Its exit code.
    pub fn code(&self) -> Code {
        Code::of(&self.0)
    }
}

impl From<Error> for Failure {
    fn from(error: Error) -> Self {
        Self(error)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use sastrugi_stages::study::{Refusals, StudyError};

    /// The codes that the help documents.
    #[test]
    fn val_exit_codes() {
        let study = Error::Study {
            name: "study.toml".to_owned(),
            text: String::new(),
            refusals: Refusals(vec![StudyError::at(None, "wrong")]),
        };
        let code = |failure: Failure| failure.code() as u8;
        assert_eq!(code(study.into()), 2);
        assert_eq!(code(Failure::usage("how")), 2);
        assert_eq!(code(Failure::input("what")), 65);
        assert_eq!(code(Failure::failed("why")), 1);
        assert_eq!(code(Error::Retry("later".to_owned()).into()), 75);
        assert_eq!([Code::Done, Code::Partial, Code::Difference].map(|code| code as u8), [0, 3, 4]);
    }
}
