//! The `sastrugi` command.

use std::process::ExitCode;

fn main() -> ExitCode {
    sastrugi_cli::run(std::env::args_os()).into()
}
