"""MuJoCo on the missions of the bench `traverse`, as its floor.

    traverse.py HEIGHTS GIVEN.json

Heights are doubles, north row first; the JSON has their geometry, the missions (as rows of the table `missions`), and the parameters
of traverse and vehicle. Prints simulated seconds, settling included, over processor seconds, and time steps
over processor seconds. The vehicle is that of `tests/peer`.
"""

import json
import sys
import time
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "tests/peer"))

import drive  # noqa: E402
import release  # noqa: E402

given = json.loads(Path(sys.argv[2]).read_text())
heights = np.fromfile(sys.argv[1], "<f8").reshape(given["rows"], given["cols"])
terrain = release.Terrain(np.flipud(heights), given["cell_m"], given["x0_m"], given["y0_m"])
course = drive.Course(terrain, given["rules"], given["vehicle"])
start, simulated = time.process_time(), 0.0
for mission in given["missions"]:
    _, time_s, _ = course.drive(mission)
    simulated += time_s + given["rules"]["settle_s"]
spent = time.process_time() - start
print(simulated / spent, simulated * given["rules"]["step_rate_hz"] / spent)
