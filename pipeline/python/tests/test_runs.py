"""Long calls: progress, Ctrl-C, the interpreter's lock, the console script."""

import os
import signal
import subprocess
import sys
import threading
import time

import pytest
from conftest import STUDY, program, sums

import sastrugi

# Many small items, so that a run stops between two of them.
LONG_STUDY = STUDY.replace("count = 3", "count = 12")


def test_progress_is_told(study, tmp_path):
    told = []
    sastrugi.run(study, tmp_path / "release", progress=lambda done, total, what: told.append((done, total, what)))
    assert told[0][2] == f"{told[0][1]} items, 0 already computed"
    steps = [done for done, _, _ in told]
    assert steps == sorted(steps) and steps[-1] == told[-1][1]
    assert any(what == "terrain/rough-0001" for _, _, what in told)


def test_a_callback_ends_the_run(study, tmp_path):
    def progress(done, total, what):
        if done > 0:
            raise LookupError(what)

    with pytest.raises(LookupError):
        sastrugi.run(study, tmp_path / "release", progress=progress)
    assert not (tmp_path / "release").exists()
    assert sastrugi.run(study, tmp_path / "release").summary["failures"] == []


SCRIPT = """
import sys, sastrugi
try:
    sastrugi.run("study.toml", "release", progress=lambda done, total, what: print(done, flush=True))
except KeyboardInterrupt:
    print("interrupted", flush=True)
    sys.exit(9)
"""


def test_ctrl_c_ends_a_run(study, release, tmp_path):
    (tmp_path / "study.toml").write_text(LONG_STUDY)
    process = subprocess.Popen([sys.executable, "-c", SCRIPT], cwd=tmp_path, stdout=subprocess.PIPE, text=True)
    assert process.stdout.readline().strip() == "0"
    assert int(process.stdout.readline()) > 0
    process.send_signal(signal.SIGINT)
    start = time.monotonic()
    output, _ = process.communicate(timeout=60)
    assert process.returncode == 9 and output.splitlines()[-1] == "interrupted"
    assert time.monotonic() - start < 10
    assert not (tmp_path / "release").exists()
    # What was computed is used, and the bytes are those of an undisturbed run.
    again = sastrugi.run(tmp_path / "study.toml", tmp_path / "release")
    assert again.summary["computed"] < again.summary["items"]
    whole = sastrugi.run(tmp_path / "study.toml", tmp_path / "whole")
    assert sums(again.path) == sums(whole.path)


KERNEL = """
import sys, sastrugi
snow = sastrugi.Fit({{"model": "exponential", "parameters": {{"sigma_m": 0.05, "range_m": 0.2}}}})
site = snow.texture(16.0, 0.1, seed=1, phase="gaussian", periodic=False)
print("started", flush=True)
try:
    {call}
except KeyboardInterrupt:
    print("interrupted", flush=True)
    sys.exit(9)
"""


@pytest.mark.parametrize(
    "call",
    [
        'sastrugi.terrain("spheroids", size_px=[1000, 1000], spheroids=1000000, major_max_px=150)',
        "sastrugi.fit(site, outer_scale=1.0, bootstrap=100000)",
    ],
)
def test_ctrl_c_ends_a_call_within_a_kernel(call):
    """A kernel cannot be stopped, but its caller is free after two seconds. These take many times as long on one thread, however many cores there are."""
    command, environment = [sys.executable, "-c", KERNEL.format(call=call)], {**os.environ, "RAYON_NUM_THREADS": "1"}
    process = subprocess.Popen(command, env=environment, stdout=subprocess.PIPE, text=True)
    assert process.stdout.readline() == "started\n"
    time.sleep(0.5)
    process.send_signal(signal.SIGINT)
    start = time.monotonic()
    output, _ = process.communicate(timeout=60)
    assert (process.returncode, output) == (9, "interrupted\n")
    assert time.monotonic() - start < 6


def test_ctrl_c_ends_the_console_script(tmp_path):
    (tmp_path / "study.toml").write_text(LONG_STUDY)
    command = [sys.executable, "-m", "sastrugi", "run", "study.toml", "-o", "release"]
    process = subprocess.Popen(command, cwd=tmp_path, stderr=subprocess.PIPE, text=True)
    assert any("items, 0 already computed" in process.stderr.readline() for _ in range(5))
    process.send_signal(signal.SIGINT)
    _, errors = process.communicate(timeout=60)
    assert process.returncode == 75
    assert errors.endswith("sastrugi: interrupted; no output file is left incomplete; rerun to resume\n")


def test_the_console_script_is_the_program(tmp_path):
    for arguments in [["--version"], ["terrain", "--help"], ["kinds", "--json"], ["fit"], ["terrain", "multifractal", "--set", "x=1", "-o", "a.tif"]]:
        ours = subprocess.run([sys.executable, "-m", "sastrugi", *arguments], cwd=tmp_path, capture_output=True)
        theirs = subprocess.run([program(), *arguments], cwd=tmp_path, capture_output=True)
        assert (ours.returncode, ours.stdout, ours.stderr) == (theirs.returncode, theirs.stdout, theirs.stderr), arguments
    assert sastrugi.__version__ in subprocess.run([program(), "--version"], capture_output=True, text=True).stdout


def test_other_threads_run_meanwhile():
    """A thread of Python counts while the module works; with the lock held it would stand still."""
    ticks, done = 0, threading.Event()

    def count():
        nonlocal ticks
        while not done.is_set():
            ticks += 1
            time.sleep(0.001)

    counter = threading.Thread(target=count)
    counter.start()
    try:
        start, before = time.monotonic(), ticks
        sastrugi.terrain("weierstrass_mandelbrot", seed=1, size_px=[4000, 4000])
        took, counted = time.monotonic() - start, ticks - before
    finally:
        done.set()
        counter.join()
    assert took > 0.1, "the terrain was too small to tell"
    assert counted > 20 * took, f"{counted} ticks in {took:.2f} s"


def test_options_of_the_program_are_arguments_here(study, release, tmp_path):
    other, file = tmp_path / "other.toml", tmp_path / "file"
    other.write_text(STUDY.replace('name = "small"', 'name = "other"'))
    file.write_text("")
    for call, said in [
        (lambda: sastrugi.run(other, release.path), "is a release of the study `small`; choose another folder, or use `replace=True` to replace it"),
        (lambda: sastrugi.run(study, file), "is a file; `output` must be a folder"),
        (lambda: sastrugi.run(study, tmp_path / "a", work=tmp_path / "a" / "work"), "is replaced; choose another `work`"),
        (lambda: sastrugi.run(study, tmp_path), "is not empty and not a sastrugi release; choose another folder"),
    ]:
        with pytest.raises(sastrugi.SastrugiError) as refused:
            call()
        assert str(refused.value).endswith(said) and refused.value.code == 2


def test_errors_of_studies_name_their_places(tmp_path):
    (tmp_path / "study.toml").write_text(STUDY.replace("seed = 7", "sead = 7"))
    with pytest.raises(sastrugi.SastrugiError, match="unknown key `sead` in study") as refused:
        sastrugi.run(tmp_path / "study.toml", tmp_path / "release")
    assert refused.value.code == 2
    with pytest.raises(sastrugi.SastrugiError, match="no such file") as refused:
        sastrugi.run(tmp_path / "none.toml", tmp_path / "release")
    assert refused.value.code == 65
    assert os.listdir(tmp_path) == ["study.toml"]
