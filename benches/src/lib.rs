//! What benches share: floors that other programs set in the same run.

use std::path::Path;
use std::process::Command;

/// Seconds that a script of `floors/` prints, measured in a process of its own with one thread; `None` where Python lacks
/// what it needs. The checkout's own Python is used where `./test` has made one.
pub fn floor(script: &str, arguments: &[&str]) -> Option<Vec<f64>> {
    let here = Path::new(env!("CARGO_MANIFEST_DIR"));
    let own = here.join("../.cache/readers/bin/python");
    let python = if own.exists() { own.as_path() } else { Path::new("python3") };
    let script = here.join("floors").join(script);
    let run = Command::new(python).arg(script).args(arguments).env("OMP_NUM_THREADS", "1").output().ok()?;
    let words = String::from_utf8(run.stdout).ok().filter(|_| run.status.success())?;
    words.split_whitespace().map(|w| w.parse().ok()).collect()
}
