//! Exit codes and the one message of a failure.

use crate::output::warn;
use miette::{GraphicalReportHandler, GraphicalTheme, LabeledSpan, MietteDiagnostic, NamedSource, Report};
use sastrugi_stages::Error;
use std::io::IsTerminal;
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

impl From<Code> for ExitCode {
    fn from(code: Code) -> Self {
        Self::from(code as u8)
    }
}

/// A verb that did not do what it was asked.
#[derive(Debug)]
pub struct Failure(Error);

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

    fn code(&self) -> Code {
        match self.0 {
            Error::Study { .. } | Error::Usage(_) => Code::Usage,
            Error::Input(_) => Code::Input,
            Error::Failed(_) => Code::Failed,
            Error::Retry(_) => Code::Retry,
        }
    }

    /// Prints the message on stderr and gives the exit code.
    pub fn report(self) -> ExitCode {
        let code = self.code();
        match self.0 {
            Error::Study { name, text, error } => print_study_error(&name, &text, &error),
            Error::Usage(m) | Error::Input(m) | Error::Failed(m) | Error::Retry(m) => warn(&format!("sastrugi: {m}")),
        }
        code.into()
    }
}

impl From<Error> for Failure {
    fn from(error: Error) -> Self {
        Self(error)
    }
}

fn print_study_error(name: &str, text: &str, error: &sastrugi_stages::study::StudyError) {
    let mut diagnostic = MietteDiagnostic::new(error.message.clone());
    if let Some(span) = error.span.clone() {
        diagnostic = diagnostic.with_label(LabeledSpan::underline(span));
    }
    if let Some(help) = error.help.clone() {
        diagnostic = diagnostic.with_help(help);
    }
    let report = Report::new(diagnostic).with_source_code(NamedSource::new(name, text.to_owned()));
    let colours = std::io::stderr().is_terminal() && std::env::var_os("NO_COLOR").is_none();
    let theme = if colours { GraphicalTheme::unicode() } else { GraphicalTheme::unicode_nocolor() };
    let mut rendered = String::new();
    let handler = GraphicalReportHandler::new_themed(theme).with_width(100);
    match handler.render_report(&mut rendered, report.as_ref()) {
        Ok(()) => warn(&format!("sastrugi: the study is refused\n{}", rendered.trim_end_matches('\n'))),
        Err(_) => warn(&format!("sastrugi: {name}: {}", error.message)),
    }
}
