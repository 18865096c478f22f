//! The command line as a library: parses arguments, calls the stages, prints results, and returns a documented exit code.
//!
//! Two programs call it: the binary `sastrugi`, and the console script of the Python package.

mod args;
mod examples;
mod failure;
mod output;
mod parameters;
mod progress;
mod reference;
mod signals;
mod verbs;

pub use failure::Code;

use clap::Parser;
use failure::Failure;
use std::ffi::OsString;
use std::io::Write;

/// Runs one command: `arguments` as a shell hands them over, the name of the program first.
///
/// Installs signal handlers and the thread pool, so a process calls it once. On Ctrl-C it exits the process with [`Code::Retry`].
pub fn run(arguments: impl IntoIterator<Item = OsString>) -> Code {
    let code = done(arguments).unwrap_or_else(output::report);
    // A library has nothing that flushes at exit. A closed stdout cannot be helped.
    let _ = std::io::stdout().flush();
    code
}

fn done(arguments: impl IntoIterator<Item = OsString>) -> Verdict {
    let arguments = match args::Arguments::try_parse_from(arguments) {
        Ok(arguments) => arguments,
        Err(error) => return Ok(refuse_arguments(&error)),
    };
    if let Err(error) = signals::listen() {
        output::warn(&format!("sastrugi: note: no message will be shown on Ctrl-C: {error}"));
    }
    verbs::start_threads(arguments.common.threads)?;
    verbs::dispatch(&arguments)
}

/// `--help` and `--version` are not errors; everything else from clap is bad usage.
fn refuse_arguments(error: &clap::Error) -> Code {
    // A closed terminal cannot be helped.
    let _ = error.print();
    if error.use_stderr() { Code::Usage } else { Code::Done }
}

/// Result of a verb.
type Verdict = Result<Code, Failure>;
