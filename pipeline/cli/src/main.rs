//! The `sastrugi` command.

#[cfg(all(target_os = "linux", target_env = "gnu"))]
mod arena;

use std::process::ExitCode;

fn main() -> ExitCode {
    #[cfg(all(target_os = "linux", target_env = "gnu"))]
    arena::share();
    sastrugi_cli::run(std::env::args_os()).into()
}
