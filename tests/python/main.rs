//! The Python package: its tests, its docstrings, its types and the notebooks, with the library that the workspace builds; and, slowly, the
//! wheel in an empty environment and the example dataset under PyTorch.
//!
//! The packages that these need are installed in `.cache/python` by `./test`, PyTorch with LeRobot in `.cache/lerobot`. Without them, the tests
//! are skipped with a message; with CI set, that is a failure.

#![allow(clippy::unwrap_used, reason = "a test may end where it stands")]

use sastrugi_tests::{Called, area, called, copy_build, outside_package, program, sastrugi_in, write};
use std::ffi::OsString;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::Instant;

fn python() -> Option<PathBuf> {
    sastrugi_tests::python("python", "./test")
}

fn root() -> PathBuf {
    sastrugi_fixtures::workspace_root()
}

/// Folder of the package's sources.
fn sources() -> PathBuf {
    root().join("pipeline/python")
}

/// The package in a folder, without a wheel: its Python sources, and the library that was built with this test.
fn assemble(folder: &Path) {
    let package = folder.join("sastrugi");
    fs::create_dir(&package).unwrap();
    for entry in fs::read_dir(sources().join("sastrugi")).unwrap() {
        let path = entry.unwrap().path();
        if path.is_file() {
            fs::copy(&path, package.join(path.file_name().unwrap())).unwrap();
        }
    }
    let library = program().with_file_name("lib_native.so");
    assert!(library.is_file(), "{} is missing: build the workspace first (./test does)", library.display());
    fs::copy(library, package.join("_native.abi3.so")).unwrap();
}

/// Python with the assembled package, in a folder of its own.
fn with_package(python: &Path, package: &Path, folder: &Path) -> Command {
    let mut command = Command::new(python);
    command.env("PYTHONPATH", package).env("PYTHONDONTWRITEBYTECODE", "1").env("SASTRUGI", program());
    command.env("MPLBACKEND", "Agg").current_dir(folder);
    command
}

fn notebooks() -> Vec<PathBuf> {
    let all = fs::read_dir(root().join("docs/notebooks")).unwrap().map(|entry| entry.unwrap().path());
    let mut notebooks: Vec<PathBuf> = all.filter(|path| path.extension().is_some_and(|e| e == "ipynb")).collect();
    notebooks.sort();
    assert_eq!(notebooks.len(), 3, "{notebooks:?}");
    notebooks
}

fn check(call: &Called) {
    assert_eq!(call.code, 0, "{}{}", call.stdout, call.stderr);
}

/// The tests in `pipeline/python/tests`, and the examples of every docstring.
#[test]
fn val_the_package_passes_its_tests() {
    let Some(python) = python() else { return };
    let (package, folder) = (area(), area());
    assemble(package.path());
    let modules = package.path().join("sastrugi");
    let mut pytest = with_package(&python, package.path(), folder.path());
    pytest.args(["-m", "pytest", "-q", "-p", "no:cacheprovider", "--doctest-modules"]);
    let call = called(pytest.arg(modules).arg(sources().join("tests")));
    check(&call);
    assert!(call.stdout.contains(" passed") && !call.stdout.contains("skipped"), "{}", call.stdout);
}

/// The package's signatures agree with each other and with their use, strictly. That the stub is true is one of the package's own tests.
#[test]
fn val_the_package_is_typed() {
    let Some(python) = python() else { return };
    let (package, folder) = (area(), area());
    assemble(package.path());
    let example = sources().join("examples/height_patches.py");
    let mut mypy = with_package(&python, package.path(), folder.path());
    mypy.args(["-m", "mypy", "--strict", "--cache-dir", "cache"]).arg(package.path().join("sastrugi")).arg(example);
    // Large libraries, of which a few names are used.
    let settings = "[mypy]\n[mypy-xarray.*,matplotlib.*]\nfollow_imports = skip\n";
    fs::write(folder.path().join("mypy.ini"), settings).unwrap();
    check(&called(mypy.args(["--config-file", "mypy.ini"])));
}

#[test]
fn val_notebooks_run() {
    let Some(python) = python() else { return };
    let (package, folder) = (area(), area());
    assemble(package.path());
    let mut run = with_package(&python, package.path(), folder.path());
    check(&called(run.arg(root().join("tests/python/run_notebooks.py")).args(notebooks())));
}

/// Missions on three terrains, for [`LOADER`].
const STUDY: &str = r#"
[study]
name = "small"
seed = 7
date = "2026-01-01"

[[terrain]]
id = "rough"
kind = "multifractal"
count = 3
size_px = [320, 300]

[[missions]]
id = "short"
terrains = ["rough"]
count = 2
length_m = 5.0
border_m = 1.5

[[traverse]]
id = "husky"
missions = "short"
"#;

/// Takes the example dataset in batches, in this process and in two of its own, and compares them with its items.
const LOADER: &str = r#"
import sys

import numpy as np
import torch

sys.path.insert(0, sys.argv[1])
import sastrugi
from height_patches import HeightPatches

if __name__ == "__main__":
    dataset = HeightPatches(sastrugi.Release("release"))
    heights, arrived = zip(*(dataset[k] for k in range(len(dataset))))
    for workers in [{}, {"num_workers": 2, "multiprocessing_context": "spawn"}]:
        batches = list(torch.utils.data.DataLoader(dataset, batch_size=4, **workers))
        assert [len(batch[0]) for batch in batches] == [4, 2]
        loaded = [torch.cat(parts) for parts in zip(*batches)]
        assert loaded[0].dtype == torch.float32 and np.array_equal(loaded[0].numpy(), np.stack(heights))
        assert loaded[1].tolist() == [float(one) for one in arrived]
"#;

/// PyTorch's own loader takes the example dataset as it is.
#[test]
#[ignore = "slow: needs PyTorch"]
fn val_torch_loads_the_example_dataset() {
    let Some(python) = sastrugi_tests::python("lerobot", "tests/readers/set_up lerobot") else { return };
    let (package, folder) = (area(), area());
    assemble(package.path());
    write(folder.path(), "study.toml", STUDY);
    check(&sastrugi_in(folder.path(), &["run", "study.toml", "-o", "release", "--quiet"]));
    write(folder.path(), "loader.py", LOADER);
    let mut load = with_package(&python, package.path(), folder.path());
    check(&called(load.arg("loader.py").arg(sources().join("examples"))));
}

/// The wheel, built by maturin and installed in an empty environment: module, program, tests and notebooks.
#[test]
#[ignore = "slow: builds the wheel"]
fn val_the_wheel_runs_in_an_empty_environment() {
    let Some(python) = python() else { return };
    let folder = area();
    let environment = folder.path().join("environment");
    let target = folder.path().join("target");
    copy_build(&target);
    let mut build = Command::new(&python);
    build.args(["-m", "maturin", "build", "--release", "--locked", "--out"]).arg(folder.path().join("wheels"));
    build.arg("--interpreter").arg(&python).env("CARGO_TARGET_DIR", &target).current_dir(sources());
    check(&called(outside_package(&mut build)));
    let wheels: Vec<PathBuf> =
        fs::read_dir(folder.path().join("wheels")).unwrap().map(|entry| entry.unwrap().path()).collect();
    let [wheel] = &wheels[..] else { panic!("{wheels:?}") };
    let name = wheel.file_name().unwrap().to_string_lossy().into_owned();
    assert!(name.starts_with("sastrugi-") && name.contains("-cp310-abi3-"), "{name}");
    println!("{name}: {} bytes", fs::metadata(wheel).unwrap().len());

    check(&called(Command::new(&python).args(["-m", "venv"]).arg(&environment)));
    let bin = environment.join("bin");
    let pip = |more: Vec<OsString>| {
        let mut pip = Command::new(bin.join("python"));
        pip.args(["-m", "pip", "install", "--quiet", "--disable-pip-version-check"]);
        check(&called(pip.args(more)));
    };
    // Alone it brings NumPy and nothing else.
    pip(vec![wheel.into()]);
    let call = called(Command::new(bin.join("sastrugi")).arg("--version"));
    assert_eq!((call.code, call.stdout.trim()), (0, concat!("sastrugi ", env!("CARGO_PKG_VERSION"))));
    let listed = called(Command::new(bin.join("python")).args(["-m", "pip", "list", "--format", "freeze"]));
    let installed: Vec<&str> = listed.stdout.lines().filter_map(|line| line.split_once("==")).map(|(n, _)| n).collect();
    assert!(installed.contains(&"numpy") && installed.contains(&"sastrugi"), "{installed:?}");
    assert!(installed.iter().all(|name| ["numpy", "pip", "sastrugi", "setuptools"].contains(name)), "{installed:?}");

    // With the terms of what it contains.
    let same = "import importlib.metadata as m, pathlib, sys\n\
        [notice] = [file for file in m.files('sastrugi') if file.name == 'THIRD-PARTY.md']\n\
        assert notice.read_text() == pathlib.Path(sys.argv[1]).read_text(encoding='utf-8')";
    check(&called(Command::new(bin.join("python")).args(["-c", same]).arg(root().join("THIRD-PARTY.md"))));

    pip(vec!["--requirement".into(), root().join("tests/python/requirements.txt").into()]);
    let inside = |script: &[&str]| {
        let mut command = Command::new(bin.join("python"));
        command.args(script).env("SASTRUGI", bin.join("sastrugi")).env("MPLBACKEND", "Agg").current_dir(folder.path());
        command.env("PYTHONDONTWRITEBYTECODE", "1");
        command
    };
    // Runs a command that must succeed, and prints its time and what it says.
    let shown = |what: &str, command: &mut Command| {
        let start = Instant::now();
        let call = called(command);
        check(&call);
        println!("{what}, {:.0} s: {}", start.elapsed().as_secs_f64(), call.stdout.trim().replace('\n', "; "));
        call
    };
    let mut pytest = inside(&["-m", "pytest", "-q", "-p", "no:cacheprovider"]);
    let call = shown("tests", pytest.arg(sources().join("tests")));
    assert!(call.stdout.contains(" passed") && !call.stdout.contains("skipped"), "{}", call.stdout);
    let mut run = inside(&[]);
    shown("notebooks", run.arg(root().join("tests/python/run_notebooks.py")).args(notebooks()));
}
