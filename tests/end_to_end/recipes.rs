//! The recipes of `fixtures/cluster`, run as they are: in each, the program is killed once in a shard, and the release is that of one machine.

#![cfg(unix)]

use sastrugi_tests::{Called, area, called, differing, program, python, run_study, small_study, sums, write};
use std::collections::BTreeMap;
use std::fs;
use std::os::unix::fs::PermissionsExt;
use std::path::{Path, PathBuf};
use std::process::Command;

/// What sets up the engines that are Python packages, and their environment.
const SET_UP: &str = "tests/engines/set_up workflow";
const ENVIRONMENT: &str = "engines/workflow";

fn recipe(name: &str) -> PathBuf {
    sastrugi_fixtures::workspace_root().join("fixtures/cluster").join(name)
}

/// A folder with a study, its release by one machine, and a program that is killed when it is called for the second shard the first time.
struct Site {
    folder: tempfile::TempDir,
    whole: BTreeMap<String, String>,
    program: PathBuf,
}

impl Site {
    fn new() -> Self {
        let folder = area();
        let whole = run_study(folder.path(), &small_study(), &[]);
        let once = folder.path().join("once");
        let text = format!(
            "#!/bin/bash\nif [[ \"$*\" == *\"--shard 2/\"* ]] && mkdir {once} 2>/dev/null; then\n  {sastrugi} \"$@\" &\n  \
             sleep 0.03; kill -9 $!; wait $!\nelse\n  exec {sastrugi} \"$@\"\nfi\n",
            once = once.display(),
            sastrugi = program().display()
        );
        let program = write(folder.path(), "killed-once", &text);
        fs::set_permissions(&program, fs::Permissions::from_mode(0o755)).unwrap();
        Self { folder, whole, program }
    }

    fn path(&self) -> &Path {
        self.folder.path()
    }

    /// Calls a recipe with the parameters that all of them take.
    fn call(&self, command: &mut Command) -> Called {
        let at = |name: &str| self.path().join(name);
        command.current_dir(self.path()).env("SASTRUGI", &self.program).env("SHARDS", "3").env("THREADS", "1");
        for (name, file) in [("STUDY", "study.toml"), ("CACHE", "cache"), ("PARTS", "parts"), ("RELEASE", "merged")] {
            command.env(name, at(file));
        }
        called(command)
    }

    /// The recipe has met the kill, and made the release.
    fn is_released(&self, call: &Called) {
        assert_eq!(call.code, 0, "{}{}", call.stdout, call.stderr);
        assert!(self.path().join("once").is_dir(), "nothing was killed");
        assert_eq!(differing(&self.whole, &sums(&self.path().join("merged"))), [""; 0]);
    }
}

/// The steps, called as an engine calls them: one that is killed asks for another try.
#[test]
fn val_steps() {
    let site = Site::new();
    let step = |arguments: &[&str]| site.call(Command::new(recipe("step")).args(arguments));
    assert_eq!(step(&["ancestors"]).code, 0);
    assert_eq!(["1", "2", "3"].map(|index| step(&["shard", index]).code), [0, 75, 0]);
    let call = step(&["merge"]);
    assert!(call.code == 65 && call.stderr.contains("shard 2 of 3 is missing"), "{} {}", call.code, call.stderr);
    assert_eq!(step(&["shard", "2"]).code, 0);
    site.is_released(&step(&["merge"]));
    assert_eq!((step(&["all"]).code, step(&[]).code), (2, 2));
}

#[test]
#[ignore = "slow: needs Snakemake"]
fn val_snakemake() {
    let Some(python) = python(ENVIRONMENT, SET_UP) else { return };
    let site = Site::new();
    let mut command = Command::new(python);
    command.args(["-m", "snakemake", "--cores", "2", "--retries", "3", "--snakefile"]);
    site.is_released(&site.call(command.arg(recipe("snakemake/Snakefile"))));
}

#[test]
#[ignore = "slow: needs Ray"]
fn val_ray() {
    let Some(python) = python(ENVIRONMENT, SET_UP) else { return };
    let site = Site::new();
    let mut command = Command::new(python);
    command.env_remove("RAY_ADDRESS").env("RAY_USAGE_STATS_ENABLED", "0").arg(recipe("ray/driver.py"));
    site.is_released(&site.call(&mut command));
}

#[test]
#[ignore = "slow: needs GNU parallel"]
fn val_gnu_parallel() {
    let version = Command::new("parallel").arg("--version").output();
    if !version.is_ok_and(|output| String::from_utf8_lossy(&output.stdout).starts_with("GNU parallel")) {
        eprintln!("SKIPPED: GNU parallel is not installed");
        return;
    }
    let site = Site::new();
    site.is_released(&site.call(&mut Command::new(recipe("parallel/run"))));
}
