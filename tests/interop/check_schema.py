"""Studies validated against the program's JSON Schema, by jsonschema and by Taplo, as in editors.

check_schema.py SCHEMA STUDY...
"""

import copy
import json
import subprocess
import sys
import tempfile
import tomllib
from pathlib import Path

from jsonschema import Draft202012Validator

# A valid study, with one table of each section that the changes below apply to.
STUDY = {
    "study": {"name": "x", "seed": 1, "date": "2026-01-01"},
    "dem": [{"id": "d", "file": "d.tif"}],
    "terrain": [{"id": "t", "kind": "gap"}],
    "fit": [{"id": "f", "dem": "d"}],
    "texture": [{"id": "s", "fit": "f"}],
    "roughness": {},
    "missions": [{"id": "m", "terrains": ["t"]}],
    "traverse": [{"id": "v", "missions": "m"}],
    "route": [{"id": "r", "terrains": ["t"]}],
    "hypothesis": [{"id": "h", "statistic": "time_s", "groups": ["a", "b"], "test": "difference"}],
}
SIZES = {"size_m": [20.0, 20.0], "size_px": [200, 200]}

# What plan refuses, whatever the rest of the study.
REFUSED = [
    ("study", {"date": "2026-1-7"}),
    ("study", {"date": "2026-13-01"}),
    ("study", {"name": "Snow"}),
    ("study", {"license": " "}),
    ("study", {"url": "example.org"}),
    ("study", {"doi": "https://doi.org/10.5281/zenodo.1"}),
    ("study", {"creators": [" , "]}),
    ("study", {"creators": [{"name": "Doe, Jane", "orcid": "0000-0002-1825"}]}),
    ("study", {"keywords": ["snow", "snow"]}),
    ("study", {"split": [1.2, -0.1, -0.1]}),
    ("dem", {"cell_m": [0.1, 0.0]}),
    ("dem", {"statistic": "mode"}),
    ("terrain", {"id": "a_b"}),
    ("terrain", {"count": 0}),
    ("terrain", {"cell_m": -0.1}),
    ("terrain", SIZES),
    ("terrain", {"sweep": {"depth": [0.1]}}),
    ("terrain", {"sweep": {"depth_m": []}}),
    ("terrain", {"sweep": {"depth_m": [[0.1]]}}),
    ("fit", {"outer_scale_m": -1}),
    ("fit", {"bootstrap": 19}),
    ("fit", {"bootstrap": 200_000}),
    ("fit", {"model": "exponental"}),
    ("fit", {"model": "auto;empirical"}),
    ("texture", {"amplitude": 0}),
    ("texture", {"realisations": 0}),
    ("texture", {"method": "quasi_wavelets", "intermittency": 5}),
    ("texture", {"cell_m": [0.1, 0.0]}),
    ("texture", {"fit": {"model": "exponental", "sigma_m": 0.03, "range_m": 0.3}}),
    ("texture", SIZES),
    ("roughness", {"low_max": 0}),
    ("missions", {"count": 0}),
    ("traverse", {"vehicle": "husky"}),
    ("traverse", {"surface": {"wheel_friction": -0.1}}),
    ("route", {"vehicle": "custom"}),
    ("route", {"neighbours": 6}),
    ("hypothesis", {"alpha": 0.7}),
    ("hypothesis", {"groups": ["a"]}),
    ("hypothesis", {"groups": ["a", "a"]}),
    ("hypothesis", {"groups": ["a", "b", "c"]}),
    ("hypothesis", {"test": "trend"}),
    ("hypothesis", {"margin": 1.0}),
    ("hypothesis", {"test": "equivalence"}),
    ("hypothesis", {"test": "equivalence", "margin": 1.0, "direction": "rises"}),
]

# What it accepts, close to the limits.
ACCEPTED = [
    ("study", {"split": [0.8, 0.2], "doi": "10.5281/zenodo.1", "license": "LicenseRef-Ours", "creators": ["Lab", {"name": "Doe, Jane"}]}),
    ("dem", {"statistic": "p97.5", "license": "public domain"}),
    ("terrain", {"sweep": {"depth_m": [0.1, 0.2], "hi_mag_m": [0.0]}}),
    ("terrain", {"kind": "multifractal", "sweep": {"high.fractal_dimension": [2.3]}}),
    *[("fit", {"bootstrap": number}) for number in [0, 39, 100_000]],
    *[("fit", {"model": m}) for m in ["auto", "auto,empirical", "empirical", "anisotropic:matern+nugget", "exponential+gaussian, spherical"]],
    ("texture", {"methods": ["fft_ma", "quasi_wavelets"], "packing": 2}),
    ("texture", {"fit": {"model": "anisotropic:exponential", "sigma_m": 0.03, "range_m": 0.3, "ratio": 0.5, "azimuth_deg": 30}}),
    ("traverse", {"vehicle": "custom", "vehicle_changes": {"chassis": {"mass_kg": 60.0}}}),
    ("traverse", {"sweep": {"vehicle_changes.drive.torque_limit_n_m": [30.0]}}),
    ("hypothesis", {"test": "trend", "groups": ["a", "b", "c"], "direction": "falls"}),
    ("hypothesis", {"test": "equivalence", "margin": 1}),
]


def changed(section, change):
    """The valid study with other keys in the table of a section."""
    study = copy.deepcopy(STUDY)
    table = study[section]
    (table[0] if isinstance(table, list) else table).update(change)
    return study


def broken(study):
    """Copies of a study with one error each, and its place."""
    for section, tables in study.items():
        table = tables[0] if isinstance(tables, list) else tables
        wrong = {"unknown key": ("no_such_key", 1), "wrong type": ("id" if "id" in table else "seed", ["x"])}
        if table.get("kind") or table.get("method"):
            wrong["unknown kind"] = ("kind" if "kind" in table else "method", "no_such_kind")
        for what, (key, value) in wrong.items():
            other = copy.deepcopy(study)
            inside = other[section][0] if isinstance(tables, list) else other[section]
            if section == "roughness" and key == "seed":
                key = "border_m"
            inside[key] = value
            yield f"[{section}] {what}", other


def main():
    schema_path, studies = Path(sys.argv[1]), [Path(path) for path in sys.argv[2:]]
    schema = json.loads(schema_path.read_text())
    Draft202012Validator.check_schema(schema)
    validator = Draft202012Validator(schema)
    counts = {"studies": 0, "broken": 0}
    for path in studies:
        study = tomllib.loads(path.read_text())
        errors = [f"{path.name}: {list(e.absolute_path)}: {e.message[:300]}" for e in validator.iter_errors(study)]
        assert not errors, "\n".join(errors)
        counts["studies"] += 1
        for what, other in broken(study):
            assert not validator.is_valid(other), f"{path.name}: {what} passes"
            counts["broken"] += 1
    for section, change in ACCEPTED:
        assert validator.is_valid(changed(section, change)), f"[{section}] {change} is refused"
    for section, change in REFUSED:
        assert not validator.is_valid(changed(section, change)), f"[{section}] {change} passes"
        counts["broken"] += 1
    taplo = Path(sys.executable).with_name("taplo")
    lint = [taplo, "lint", "--schema", schema_path.absolute().as_uri()]
    call = subprocess.run([*lint, *studies], capture_output=True, text=True)
    assert call.returncode == 0, call.stderr
    with tempfile.TemporaryDirectory() as folder:
        wrong = Path(folder) / "wrong.toml"
        text = studies[-1].read_text()
        for change in [("seed = ", "seed = true #"), ("id = ", "no_such_key = 1\nid = "), ("kind = ", "kind = 5 #")]:
            wrong.write_text(text.replace(*change, 1))
            call = subprocess.run([*lint, wrong], capture_output=True, text=True)
            assert call.returncode != 0 and "not valid" in call.stderr + call.stdout or "not of type" in call.stderr, f"Taplo takes {change}: {call.stderr}"
    print(json.dumps(counts))


main()
