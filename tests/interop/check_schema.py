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
