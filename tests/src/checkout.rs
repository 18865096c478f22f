//! Scratch copies of the checkout, and commands of the documentation that are followed in them.

use crate::{called, outside_package};
use std::fs;
use std::path::Path;
use std::process::Command;

/// Runs a command line in a folder, outside the package of this test; its output is shown when it fails.
///
/// # Panics
/// When it fails.
pub fn run(folder: &Path, line: &str) {
    let mut command = Command::new("bash");
    command.args(["-euo", "pipefail", "-c", line]).current_dir(folder);
    let call = called(outside_package(&mut command));
    assert_eq!(call.code, 0, "{line}\n{}{}", call.stdout, call.stderr);
}

/// Copies the files under version control to a folder, whose former content goes.
///
/// # Panics
/// When they cannot be copied.
pub fn copy(to: &Path) {
    if to.exists() {
        fs::remove_dir_all(to).expect("the former copy can be removed");
    }
    fs::create_dir_all(to).expect("a folder");
    let files = format!("git ls-files -z | xargs -0 cp -p --parents -t '{}'", to.display());
    run(&sastrugi_fixtures::workspace_root(), &files);
}
