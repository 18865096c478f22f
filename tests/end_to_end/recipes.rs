//! The recipes of `fixtures/cluster`, run as they are: in each, a shard is killed mid-run, and the release is that of one machine.
//! `tests/engines` starts clusters of hosts, of which one crashes.

#![cfg(unix)]

use sastrugi_tests::{
    Called, area, called, differing, installed, program, python, run_study, small_study, sums, write,
};
use std::collections::BTreeMap;
use std::fs;
use std::os::unix::fs::{PermissionsExt, symlink};
use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::Instant;

/// What sets up the engines that are Python packages, and their environment.
const SET_UP: &str = "tests/engines/set_up workflow";
const ENVIRONMENT: &str = "engines/workflow";

/// What unpacks Slurm and GNU parallel.
const SET_UP_SLURM: &str = "tests/engines/set_up slurm";

fn recipe(name: &str) -> PathBuf {
    sastrugi_fixtures::workspace_root().join("fixtures/cluster").join(name)
}

fn engine(name: &str) -> PathBuf {
    sastrugi_fixtures::workspace_root().join("tests/engines").join(name)
}

/// True if this system allows the namespaces that hosts are made of; else a message.
fn hosts_are_allowed() -> bool {
    let call = Command::new("unshare").args(["--user", "--map-root-user", "--net", "true"]).output();
    let allowed = call.is_ok_and(|output| output.status.success());
    if !allowed {
        eprintln!("SKIPPED: this system does not allow user namespaces (unshare --user --map-root-user --net)");
    }
    allowed
}

/// A folder with a study, its release by one machine, and a program of which the first shard is killed.
struct Site {
    folder: tempfile::TempDir,
    whole: BTreeMap<String, String>,
    killed: PathBuf,
}

impl Site {
    fn new() -> Self {
        let folder = area();
        let whole = run_study(folder.path(), &small_study(), &[]);
        let killed = folder.path().join("killed");
        fs::copy(engine("killed"), &killed).unwrap();
        symlink(program(), folder.path().join("sastrugi")).unwrap();
        Self { folder, whole, killed }
    }

    fn path(&self) -> &Path {
        self.folder.path()
    }

    /// Calls a recipe with the parameters that all of them take.
    fn call(&self, command: &mut Command) -> Called {
        let at = |name: &str| self.path().join(name);
        command.current_dir(self.path()).env("SASTRUGI", &self.killed);
        command.env("SHARDS", "3").env("THREADS", "1").env("PAUSE", "1");
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

    /// Calls a recipe that makes the release, and prints a row of the table of engines in `docs/cluster.md`.
    fn releases(&self, engine: &str, nodes: u32, killed: &str, command: &mut Command) -> Called {
        let start = Instant::now();
        let call = self.call(command);
        let seconds = start.elapsed().as_secs_f64();
        self.is_released(&call);
        println!("| {engine} | {nodes} | {killed} | yes | {seconds:.0} s |");
        call
    }

    /// Calls a script of `tests/engines`, which starts two nodes, one of which crashes.
    fn releases_on_hosts(&self, engine: &str, command: &mut Command) -> Called {
        let call = self.releases(engine, 2, "a program, a node", command);
        assert!(call.stdout.contains("crashed node"), "no host crashed: {}", call.stdout);
        call
    }
}

/// The steps, called as an engine calls them: one that is killed asks for another try.
#[test]
fn val_steps() {
    let site = Site::new();
    let step = |arguments: &[&str]| site.call(Command::new(recipe("step")).args(arguments));
    assert_eq!(step(&["ancestors"]).code, 0);
    assert_eq!(["1", "2", "3"].map(|index| step(&["shard", index]).code), [75, 0, 0]);
    let call = step(&["merge"]);
    assert!(call.code == 65 && call.stderr.contains("shard 1 of 3 is missing"), "{} {}", call.code, call.stderr);
    assert_eq!(step(&["shard", "1"]).code, 0);
    site.is_released(&step(&["merge"]));
    assert_eq!((step(&["all"]).code, step(&[]).code), (2, 2));
    // A file in the place of the folder for shards does not pass.
    let mut nowhere = Command::new("env");
    nowhere.arg("PARTS=study.toml/parts").arg(recipe("step")).arg("merge");
    assert_eq!(site.call(&mut nowhere).code, 1);
}

/// The jobs wait for each other, also in a federation, where `sbatch` prints the cluster's name after the number; a log has the job's number.
#[test]
fn val_slurm_jobs_wait_for_each_other() {
    let folder = area();
    let path = folder.path();
    let sbatch = "#!/bin/sh\necho \"$@\" >> calls\necho \"$(wc -l < calls);north\"\n";
    write(path, "sbatch", sbatch);
    fs::set_permissions(path.join("sbatch"), fs::Permissions::from_mode(0o755)).unwrap();
    let places = std::env::join_paths([path, Path::new("/usr/bin"), Path::new("/bin")]).unwrap();
    let mut submit = Command::new(recipe("slurm/submit"));
    submit.arg("--partition=short").current_dir(path).env("PATH", places).env("SHARDS", "4").env("PARTS", "parts");
    let call = called(&mut submit);
    assert_eq!((call.code, call.stdout.as_str()), (0, "3\n"), "{}", call.stderr);
    let calls = fs::read_to_string(path.join("calls")).unwrap();
    let expected: [&[&str]; 3] = [
        &["ancestors-%j.log", "--partition=short"],
        &["shard-%A-%a.log", "--array=1-4", "--dependency=afterok:1 ", "--partition=short"],
        &["merge-%j.log", "--dependency=afterok:2 ", "--partition=short"],
    ];
    assert_eq!(calls.lines().count(), expected.len(), "{calls}");
    for (line, words) in calls.lines().zip(expected) {
        assert!(words.iter().all(|word| line.contains(word)), "{line}");
    }
}

/// True if Slurm can be started here; else a message.
fn slurm_is_installed() -> bool {
    installed("engines/slurm/usr/bin/sbatch", SET_UP_SLURM).is_some() && hosts_are_allowed()
}

/// How often Slurm has started a job again, over all jobs.
fn restarts(call: &Called) -> usize {
    call.stdout.matches("Restarts=1 ").count()
}

/// The job puts the killed program back into the queue; Slurm does so with the job of the crashed node.
#[test]
#[ignore = "slow: needs Slurm"]
fn val_slurm() {
    if slurm_is_installed() {
        let call = Site::new().releases_on_hosts("Slurm", Command::new(engine("slurm")).arg("submit"));
        assert_eq!(restarts(&call), 2, "{}", call.stdout);
    }
}

/// The profile for Slurm: Snakemake submits the killed program again; Slurm puts the job of the crashed node back into the queue.
#[test]
#[ignore = "slow: needs Slurm and Snakemake"]
fn val_snakemake_on_slurm() {
    if python(ENVIRONMENT, SET_UP).is_some() && slurm_is_installed() {
        let call = Site::new().releases_on_hosts("Snakemake on Slurm", Command::new(engine("slurm")).arg("snakemake"));
        assert_eq!(restarts(&call), 1, "{}", call.stdout);
    }
}

#[test]
#[ignore = "slow: needs Snakemake"]
fn val_snakemake() {
    let Some(python) = python(ENVIRONMENT, SET_UP) else { return };
    let mut command = Command::new(python);
    command.args(["-m", "snakemake", "--cores", "2", "--retries", "3", "--snakefile"]);
    Site::new().releases("Snakemake", 1, "a program", command.arg(recipe("snakemake/Snakefile")));
}

#[test]
#[ignore = "slow: needs Ray"]
fn val_ray_on_this_machine() {
    let Some(python) = python(ENVIRONMENT, SET_UP) else { return };
    let mut command = Command::new(python);
    command.env_remove("RAY_ADDRESS").env("RAY_USAGE_STATS_ENABLED", "0").arg(recipe("ray/driver.py"));
    Site::new().releases("Ray", 1, "a program", &mut command);
}

/// Ray runs the tasks of the killed program and of the crashed node again.
#[test]
#[ignore = "slow: needs Ray"]
fn val_ray_on_two_nodes() {
    if python(ENVIRONMENT, SET_UP).is_some() && hosts_are_allowed() {
        Site::new().releases_on_hosts("Ray", &mut Command::new(engine("ray")));
    }
}

#[test]
#[ignore = "slow: needs GNU parallel"]
fn val_gnu_parallel() {
    let Some(parallel) = installed("engines/slurm/usr/bin/parallel", SET_UP_SLURM) else { return };
    let path = std::env::join_paths([parallel.parent().unwrap(), Path::new("/usr/bin"), Path::new("/bin")]).unwrap();
    Site::new().releases("GNU parallel", 1, "a program", Command::new(recipe("parallel/run")).env("PATH", path));
}
