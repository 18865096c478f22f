//! The `sastrugi` command: parses arguments, calls the stages, prints results, and exits with a documented code.

mod args;
mod examples;
mod failure;
mod output;
mod parameters;
mod progress;
mod reference;
mod signals;
mod verbs;

use clap::Parser;
use failure::{Code, Failure};
use std::process::ExitCode;

fn main() -> ExitCode {
    let arguments = match args::Arguments::try_parse() {
        Ok(arguments) => arguments,
        Err(error) => return refuse_arguments(&error),
    };
    if let Err(error) = signals::listen() {
        output::warn(&format!("sastrugi: note: no message will be shown on Ctrl-C: {error}"));
    }
    if let Err(failure) = verbs::start_threads(arguments.common.threads) {
        return output::report(failure);
    }
    match verbs::dispatch(&arguments) {
        Ok(code) => code.into(),
        Err(failure) => output::report(failure),
    }
}

/// `--help` and `--version` are not errors; everything else from clap is bad usage.
fn refuse_arguments(error: &clap::Error) -> ExitCode {
    // A closed terminal cannot be helped.
    let _ = error.print();
    if error.use_stderr() { Code::Usage.into() } else { Code::Done.into() }
}

/// Result of a verb.
type Verdict = Result<Code, Failure>;
