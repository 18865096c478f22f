"""What happens at the limits of a process: too little memory, and forks."""

import os
import subprocess
import sys

PRELUDE = """
import resource, sastrugi
def refusal(call):
    try:
        call()
    except sastrugi.SastrugiError as error:
        return f"{error.code} {error}"
"""


def said(code):
    """What a Python process of its own prints; fails if it does not end in order within a minute."""
    # Each thread reserves address space: with those of many cores nothing would be left below the limit of a test.
    environment = {**os.environ, "OPENBLAS_NUM_THREADS": "1", "RAYON_NUM_THREADS": "2"}
    done = subprocess.run([sys.executable, "-c", PRELUDE + code], capture_output=True, text=True, timeout=60, env=environment)
    assert done.returncode == 0, f"{done.returncode}: {done.stderr}"
    return done.stdout


def test_too_little_memory_is_an_exception():
    """The process lives on and can make something smaller."""
    found = said("""
resource.setrlimit(resource.RLIMIT_AS, (3 << 30, 3 << 30))
snow = sastrugi.Fit({"model": "exponential", "parameters": {"sigma_m": 0.03, "range_m": 0.28}})
print(refusal(lambda: sastrugi.terrain("multifractal", size_px=[16000, 16000])))
print(refusal(lambda: snow.texture(1600.0, 0.1)))
print(sastrugi.terrain("multifractal", size_px=[90, 70]).shape)
""")
    terrain, texture, shape = found.splitlines()
    assert terrain.startswith("75 the terrain needs about ") and "GiB is available" in terrain
    assert texture.startswith("75 the texture needs about ")
    assert shape == "(70, 90)"


FORKED = """
import os
def make():
    return sastrugi.terrain("multifractal", size_px=[90, 70])
def forked():
    child = os.fork()
    if child == 0:
        print(refusal(make), flush=True)
        os._exit(0)
    os.waitpid(child, 0)
"""


def test_forks_of_a_process_that_has_computed_are_refused():
    """They would wait for threads that a fork does not copy. A fork of one that has not computed yet has threads of its own."""
    before, after = said(FORKED + "forked()\nmake()\nforked()\n").splitlines()
    assert before == "None"
    assert after.startswith("2 this process was forked from one that had used sastrugi") and "`spawn`" in after
