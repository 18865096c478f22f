"""Shared by the tests: the program to compare with, and a small release."""

import os
import shutil
import subprocess
from pathlib import Path

import pytest

import sastrugi

ROOT = Path(__file__).resolve().parents[3]
DEMS = ROOT / "fixtures" / "dem"

STUDY = """
[study]
name = "small"
seed = 7
date = "2026-01-01"
split = [0.34, 0.33, 0.33]

[[terrain]]
id = "rough"
kind = "multifractal"
group = "a"
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
"""


def program():
    """The program: `SASTRUGI`, or the console script of this installation."""
    found = os.environ.get("SASTRUGI") or shutil.which("sastrugi")
    assert found, "set SASTRUGI to the program to compare with"
    return found


@pytest.fixture
def sastrugi_program(tmp_path):
    """Calls the program in a temporary folder; fails unless it exits with 0."""

    def call(*arguments):
        done = subprocess.run([program(), *map(str, arguments)], cwd=tmp_path, capture_output=True, text=True)
        assert done.returncode == 0, f"{arguments}: {done.stderr}"
        return done.stdout

    return call


@pytest.fixture(scope="session")
def study(tmp_path_factory):
    path = tmp_path_factory.mktemp("study") / "study.toml"
    path.write_text(STUDY)
    return path


@pytest.fixture(scope="session")
def release(study, tmp_path_factory):
    return sastrugi.run(study, tmp_path_factory.mktemp("module") / "release")


def sums(folder):
    """Checksums of a release by path."""
    lines = (Path(folder) / "SHA256SUMS").read_text().splitlines()
    return {path: digest for digest, path in (line.split("  ", 1) for line in lines)}
