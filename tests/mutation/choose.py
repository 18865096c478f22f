"""Chooses mutants for tests/mutation/sample: a seeded sample without replacement, as one configuration of cargo-mutants for each room.

choose.py FOLDER COUNT SEED ROOM...: reads FOLDER/all.json (`cargo mutants --list --json`), writes FOLDER/<room>.toml.
"""

import json
import random
import re
import sys
from pathlib import Path


def main(folder: str, count: str, seed: str, *rooms: str) -> None:
    out = Path(folder)
    mutants = sorted((m["package"].removeprefix("sastrugi-"), m["name"]) for m in json.loads((out / "all.json").read_text()))
    chosen = sorted(random.Random(int(seed)).sample(mutants, int(count)))
    for room in rooms:
        names = [name for of, name in chosen if of == room]
        # Names are matched as regular expressions, anywhere in the text.
        patterns = [f"^{re.escape(name)}$" for name in names]
        (out / f"{room}.toml").write_text(f"examine_re = {json.dumps(patterns, indent=2)}\n")
        print(f"{room}: {len(names)} of {sum(of == room for of, _ in mutants)} mutants")


main(*sys.argv[1:])
