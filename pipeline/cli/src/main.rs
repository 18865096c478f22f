//! The `sastrugi` command: reads arguments, calls the stages, prints, and ends with a documented exit code.

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
        output::warn(&format!("sastrugi: note: Ctrl-C will not be announced: {error}"));
    }
    if let Err(failure) = verbs::start_threads(arguments.common.threads) {
        return output::report(failure);
    }
    match verbs::dispatch(&arguments) {
        Ok(code) => code.into(),
        Err(failure) => output::report(failure),
    }
}

/// `--help` and `--version` are no errors; anything else that clap says is bad usage.
fn refuse_arguments(error: &clap::Error) -> ExitCode {
    // Nothing can be done about a terminal that is gone.
    let _ = error.print();
    if error.use_stderr() { Code::Usage.into() } else { Code::Done.into() }
}

/// What a verb comes to.
type Verdict = Result<Code, Failure>;
