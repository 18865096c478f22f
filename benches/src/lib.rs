//! Shared by the benches: floors measured with other programs in the same run.

use std::path::{Path, PathBuf};
use std::process::Command;

/// Numbers printed by a script of `floors/`, measured in a separate process with one thread; `None` if Python lacks a package
/// that it needs. Uses the checkout's own Python if `./test` has installed one.
pub fn floor(script: &str, arguments: &[&str]) -> Option<Vec<f64>> {
    floor_in("readers", script, arguments)
}

/// As [`floor`], with the Python of another environment of `.cache`.
pub fn floor_in(environment: &str, script: &str, arguments: &[&str]) -> Option<Vec<f64>> {
    let python = python(environment).unwrap_or_else(|| PathBuf::from("python3"));
    let mut command = Command::new(python);
    command.arg(script_of(script)).args(arguments).env("OMP_NUM_THREADS", "1").env("PYTHONDONTWRITEBYTECODE", "1");
    let run = command.output().ok()?;
    let words = String::from_utf8(run.stdout).ok().filter(|_| run.status.success())?;
    words.split_whitespace().map(|w| w.parse().ok()).collect()
}

/// Python of an environment of `.cache`, if it is installed.
pub fn python(environment: &str) -> Option<PathBuf> {
    let own = Path::new(env!("CARGO_MANIFEST_DIR")).join("../.cache").join(environment).join("bin/python");
    own.exists().then_some(own)
}

/// A script of `floors/`.
pub fn script_of(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("floors").join(name)
}
