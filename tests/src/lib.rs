//! Shared by the tests of the complete program: the built binary, temporary folders, small studies.

#![allow(clippy::expect_used, reason = "a test may end where it stands")]

pub mod checkout;
pub mod server;
pub mod synthetic;

use parquet::file::reader::FileReader;
use parquet::file::serialized_reader::SerializedFileReader;
use parquet::record::Field;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};
use std::time::Duration;

/// The program built with this test.
///
/// # Panics
/// When it is missing: `./test` builds it first.
pub fn program() -> PathBuf {
    let test = std::env::current_exe().expect("the test has a path");
    let folder = test.parent().and_then(Path::parent).expect("tests are in target/<profile>/deps");
    let program = folder.join("sastrugi");
    assert!(program.is_file(), "{} is missing: build the workspace first (./test does)", program.display());
    program
}

/// Copies what cargo has compiled into another target folder, so that a build of the same packages there starts from it.
///
/// # Panics
/// When it cannot be copied.
pub fn copy_build(target: &Path) {
    let to = target.join("release");
    std::fs::create_dir_all(&to).expect("a folder");
    let libraries =
        "find deps -name '*.rlib' -o -name '*.rmeta' -o -name '*.so' -o -name '*.a'; find .fingerprint build -type f";
    let line = format!("{{ {libraries}; }} | xargs -d '\\n' cp -p --parents -t '{}'", to.display());
    let from = program().with_file_name("");
    let call = called(Command::new("bash").args(["-euo", "pipefail", "-c", &line]).current_dir(from));
    assert_eq!(call.code, 0, "{}", call.stderr);
}

/// Keeps from a command, such as a build in a [copy][copy_build], what cargo tells this test of its own package: build scripts of other packages that
/// read these variables would run again.
pub fn outside_package(command: &mut Command) -> &mut Command {
    let is_told = |name: &str| name.starts_with("CARGO_PKG_") || name.starts_with("CARGO_MANIFEST_");
    let told = std::env::vars_os().map(|(name, _)| name).filter(|name| name.to_str().is_some_and(is_told));
    told.fold(command, |command, name| command.env_remove(name))
}

/// Result of a call of the program.
pub struct Called {
    /// Exit code.
    pub code: i32,
    /// Standard output.
    pub stdout: String,
    /// Standard error.
    pub stderr: String,
}

/// Calls the program in a folder.
///
/// # Panics
/// When it cannot be started.
pub fn sastrugi_in(folder: &Path, arguments: &[&str]) -> Called {
    called(Command::new(program()).args(arguments).current_dir(folder))
}

/// Runs a prepared command until it exits.
///
/// # Panics
/// When it cannot be started.
pub fn called(command: &mut Command) -> Called {
    let Output { status, stdout, stderr } = command.output().expect("the program starts");
    Called {
        code: status.code().unwrap_or(-1),
        stdout: String::from_utf8_lossy(&stdout).into_owned(),
        stderr: String::from_utf8_lossy(&stderr).into_owned(),
    }
}

/// Largest resident memory of a command that runs the program, KiB, as the system counts it for a child.
///
/// # Panics
/// When the program fails, or there is no `python3`, which measures.
pub fn peak_kib(folder: &Path, arguments: &[&str]) -> u64 {
    peak_kib_with(folder, arguments, &[])
}

/// The same with environment variables.
///
/// # Panics
/// As [`peak_kib`].
pub fn peak_kib_with(folder: &Path, arguments: &[&str], variables: &[(&str, &str)]) -> u64 {
    const MEASURE: &str = "import resource, subprocess, sys\n\
        subprocess.run(sys.argv[1:], check=True, stdout=subprocess.DEVNULL)\n\
        print(resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss)";
    let mut command = Command::new("python3");
    command.args(["-c", MEASURE]).arg(program()).args(arguments).current_dir(folder);
    let call = called(command.envs(variables.iter().copied()));
    assert_eq!(call.code, 0, "{}", call.stderr);
    call.stdout.trim().parse().expect("a number of KiB")
}

/// A temporary folder, removed when dropped.
///
/// # Panics
/// When it cannot be created.
pub fn area() -> tempfile::TempDir {
    tempfile::tempdir().expect("a temporary folder")
}

/// The checksums of a release by path.
///
/// # Panics
/// When there is no release.
pub fn sums(release: &Path) -> BTreeMap<String, String> {
    let text = std::fs::read_to_string(release.join("SHA256SUMS")).expect("a sealed release");
    text.lines().filter_map(|l| l.split_once("  ")).map(|(sum, path)| (path.to_owned(), sum.to_owned())).collect()
}

/// Writes a study and runs it to the folder's `release`; returns the checksums of the release.
///
/// # Panics
/// When the run fails.
pub fn run_study(folder: &Path, study: &str, more: &[&str]) -> BTreeMap<String, String> {
    write(folder, "study.toml", study);
    let call = sastrugi_in(folder, &[&["run", "study.toml", "-o", "release", "--quiet"], more].concat());
    assert_eq!(call.code, 0, "{}", call.stderr);
    sums(&folder.join("release"))
}

/// Runs a study file in two shards next to it and merges them; returns the checksums of the merged release.
///
/// # Panics
/// When a shard or the merge fails.
pub fn run_in_shards(folder: &Path, study: &str) -> BTreeMap<String, String> {
    for (shard, name) in [("1/2", "part-1"), ("2/2", "part-2")] {
        let call = sastrugi_in(folder, &["run", study, "-o", name, "--shard", shard, "--quiet"]);
        assert_eq!(call.code, 0, "{}", call.stderr);
    }
    let call = sastrugi_in(folder, &["merge", "part-1", "part-2", "-o", "merged", "--quiet"]);
    assert_eq!(call.code, 0, "{}", call.stderr);
    sums(&folder.join("merged"))
}

/// Runs a study to the folder's `release`, killed with SIGKILL after each of the pauses and restarted, and lets it finish; returns the
/// checksums of the release. A release that exists after a kill must be the `whole` one.
///
/// # Panics
/// When a partial release exists, or the last run fails.
pub fn run_with_kills(
    folder: &Path,
    study: &str,
    whole: &BTreeMap<String, String>,
    pauses_ms: &[u64],
) -> BTreeMap<String, String> {
    write(folder, "study.toml", study);
    for pause_ms in pauses_ms {
        let mut child = Command::new(program())
            .args(["run", "study.toml", "-o", "release", "--quiet"])
            .current_dir(folder)
            .stdout(Stdio::null())
            .stderr(Stdio::null())
            .spawn()
            .expect("the program starts");
        std::thread::sleep(Duration::from_millis(*pause_ms));
        child.kill().and_then(|()| child.wait()).expect("the program ends");
        if folder.join("release").exists() {
            assert_eq!(differing(whole, &sums(&folder.join("release"))), Vec::<String>::new(), "a partial release");
        }
    }
    run_study(folder, study, &[])
}

/// Paths whose checksums differ, or that only one side has.
pub fn differing(a: &BTreeMap<String, String>, b: &BTreeMap<String, String>) -> Vec<String> {
    let paths: std::collections::BTreeSet<&String> = a.keys().chain(b.keys()).collect();
    paths.into_iter().filter(|p| a.get(*p) != b.get(*p)).cloned().collect()
}

/// A study that has every stage and takes about a second.
pub fn small_study() -> String {
    let dem = sastrugi_fixtures::jacksboro();
    format!(
        r#"
[study]
name = "small"
seed = 7
date = "2026-01-01"

[[dem]]
id = "site"
file = "{}"
window = [-84.40, 36.46, -84.20, 36.66]

[[fit]]
id = "fit"
dem = "site"
outer_scale_m = 1000.0
bootstrap = 39

[[fit]]
id = "naive"
dem = "site"
mode = "paper"
outer_scale_m = 4000.0

[[texture]]
id = "tile"
fit = "naive"
phase = "gaussian"
periodic = false
size_m = [4500.0, 4500.0]
cell_m = 90.0

[[terrain]]
id = "rough"
kind = "multifractal"
group = "a"
count = 2
size_px = [320, 300]

[[terrain]]
id = "smooth"
kind = "weierstrass_mandelbrot"
group = "b"
size_px = [280, 300]

[[missions]]
id = "short"
terrains = ["rough", "smooth"]
count = 3
length_m = 5.0
border_m = 1.5

[[traverse]]
id = "husky"
missions = "short"
"#,
        dem.display()
    )
}

/// A study of textures that repeat a site: side by side, on a background, tiled.
pub fn textured_study() -> String {
    r#"
[study]
name = "textures"
seed = 7
date = "2026-01-01"

[[terrain]]
id = "site"
kind = "weierstrass_mandelbrot"
size_px = [200, 180]
cell_m = 0.1

[[fit]]
id = "fit"
dem = "site"
outer_scale_m = 2.0
bootstrap = 0
statistics = true

[[texture]]
id = "side"
fit = "fit"
methods = ["fft_ma", "modulated", "wavelet_statistics", "quilting", "exemplar"]
realisations = 2
periodic = false
size_px = [96, 80]
cell_m = 0.1

[[texture]]
id = "laid"
fit = "fit"
method = "quilting"
onto = { background = "fit" }
size_px = [80, 80]

[[texture]]
id = "loose"
fit = "fit"
method = "wavelet_statistics"
seed = 5
size_px = [128, 144]
tile = [2, 1]
rounds = 3
"#
    .to_owned()
}

/// The small study with routes: missions along them, and teams that plan with limited sensing.
pub fn routed_study() -> String {
    small_study()
        + r#"
[[missions]]
id = "planned"
kind = "routed"
of = "short"
vehicle = "husky_a200"
route = { cost = "band_rms", plan_cell_m = 0.1 }

[[traverse]]
id = "along"
missions = "planned"

[[route]]
id = "ways"
terrains = ["rough"]
pairs = 2
border_m = 1.5
plan_cell_m = 0.1
max_up_deg = 60.0
max_down_deg = 60.0

[[navigate]]
id = "team"
route = "ways"
formation = "wedge"
spacing_m = 0.8
radius_m = 0.1
arrive_m = 0.2
speed_m_s = 0.4
speed_min_m_s = 0.1
speed_max_m_s = 0.8
sensing_radius_m = 2.5
drawn_losses = 1
"#
}

/// One row of a table: values by column; text, numbers, or null.
pub type Row = BTreeMap<String, serde_json::Value>;

/// The rows of a table of a release, in order; empty if it has no file.
///
/// # Panics
/// When a file of the table cannot be read.
pub fn rows(release: &Path, table: &str) -> Vec<Row> {
    let Ok(parts) = std::fs::read_dir(release.join("tables").join(table)) else { return Vec::new() };
    let mut parts: Vec<PathBuf> = parts.map(|e| e.expect("a part").path()).collect();
    parts.sort();
    parts.iter().flat_map(|part| rows_of(part)).collect()
}

fn rows_of(part: &Path) -> Vec<Row> {
    let file = std::fs::File::open(part).expect("a part can be opened");
    let reader = SerializedFileReader::new(file).expect("a part is Parquet");
    let row = |row: parquet::errors::Result<parquet::record::Row>| {
        let row = row.expect("a row can be read");
        row.get_column_iter().map(|(name, field)| (name.clone(), value(field))).collect()
    };
    reader.get_row_iter(None).expect("a part has rows").map(row).collect()
}

fn value(field: &Field) -> serde_json::Value {
    match field {
        Field::Bool(flag) => (*flag).into(),
        Field::Str(text) => text.as_str().into(),
        Field::Long(number) => (*number).into(),
        Field::Double(number) => (*number).into(),
        _ => serde_json::Value::Null,
    }
}

/// Writes a text file.
///
/// # Panics
/// When the file system refuses.
pub fn write(folder: &Path, name: &str, text: &str) -> PathBuf {
    let path = folder.join(name);
    std::fs::write(&path, text).expect("a file can be written");
    path
}

/// A program in `.cache`, which `command` installs; `None` (after a message) if it is missing.
///
/// # Panics
/// When it is missing and CI is set: a check that does not run must not pass there.
pub fn installed(path: &str, command: &str) -> Option<PathBuf> {
    let program = sastrugi_fixtures::workspace_root().join(".cache").join(path);
    if program.exists() {
        return Some(program);
    }
    assert!(std::env::var_os("CI").is_none(), "{path}: not installed; run {command} with network access");
    eprintln!("SKIPPED: {path} is not installed; {command} installs it");
    None
}

/// Python of the environment `.cache/<environment>`, which `command` sets up; `None` (after a message) if it is missing.
///
/// # Panics
/// As [`installed`].
pub fn python(environment: &str, command: &str) -> Option<PathBuf> {
    installed(&format!("{environment}/bin/python"), command)
}
