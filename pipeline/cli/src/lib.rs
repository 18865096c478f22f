//! The command line as a library: parses arguments, calls the stages, prints results, and returns a documented exit code.
//!
//! Two programs call it: the binary `sastrugi`, and the console script of the Python package.
//!
//! # Flow
//!
//! 1. [`run`] parses the arguments (`args.rs`). `--help`, `--version` and refused arguments end here.
//! 2. `verbs::dispatch` calls the verb, in a file of `verbs/`. A verb computes nothing: it calls `sastrugi_stages`, `sastrugi_server` or
//!    `sastrugi_report`.
//! 3. Results go to stdout, as text or with `--json` as JSON; progress and warnings go to stderr.
//! 4. An error becomes a message and a [`Code`], which is part of the contract.
//!
//! # Example
//!
//! ```
//! use sastrugi_cli::{Code, run};
//! use std::ffi::OsString;
//!
//! // Prints the parameters of a generator, with units, defaults and sources.
//! let code = run(["sastrugi", "kinds", "gap"].map(OsString::from));
//! assert_eq!(code, Code::Done);
//! ```

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
        output::warn(&format!("sastrugi: note: Ctrl-C will end the program without a message: {error}"));
    }
    verbs::start_threads(arguments.common.threads)?;
    verbs::dispatch(&arguments)
}

/// `--help` and `--version` are not errors; everything else from clap is bad usage.
fn refuse_arguments(error: &clap::Error) -> Code {
    let told = error.render().to_string();
    let plain = in_plain_words(&told);
    if plain == told {
        // In colour on a terminal; a closed one cannot be helped.
        let _ = error.print();
    } else {
        output::warn(plain.trim_end());
    }
    if error.use_stderr() { Code::Usage } else { Code::Done }
}

/// A message on arguments, in which the standard library does not speak of numbers.
fn in_plain_words(told: &str) -> String {
    let words = [
        ("invalid float literal", "expected a number"),
        ("cannot parse float from empty string", "expected a number"),
        ("invalid digit found in string", "expected a whole number, 0 or above"),
        ("cannot parse integer from empty string", "expected a whole number, 0 or above"),
    ];
    words.iter().fold(told.to_owned(), |told, (from, to)| told.replace(from, to))
}

/// Result of a verb.
type Verdict = Result<Code, Failure>;
