"""Recordings of a release, read by Rerun: check_rerun.py RELEASE.

`rerun mcap check --full` finds no issue in any of them; one of them converted has poses, transforms, texts and states.
"""

import os
import subprocess
import sys
import tempfile
from pathlib import Path

from common import expect, run

RERUN = Path(sys.executable).parent / "rerun"
# What Rerun must show of each flavour, as entity@component.
SHOWN = {
    "viewer": [
        "/tf@Transform3D:translation", "/vehicle/pose@InstancePoses3D:translations", "/events@TextLog:text",
        "/vehicle/state@sastrugi.VehicleState:message", "/imu@sastrugi.Imu:message",
        "/terrain/mesh@foxglove.SceneUpdate:message",
    ],
    "ros2": [
        "/tf@Transform3D:translation", "/tf_static@Transform3D:translation", "/odom@nav_msgs.msg.Odometry:message",
        "/events@TextLog:text", "/imu@Scalars:scalars", "/joint_states/velocity@Scalars:scalars",
        "/terrain/points@Points3D:positions",
    ],
}


def rerun(*arguments):
    """Output of Rerun, whose side files are kept in a separate folder."""
    with tempfile.TemporaryDirectory() as home:
        environment = {**os.environ, "HOME": home, "RERUN_TELEMETRY": "0"}
        called = subprocess.run([RERUN, *map(str, arguments)], env=environment, capture_output=True, text=True)
    expect(called.returncode == 0, f"rerun {' '.join(map(str, arguments))}: {called.stdout}{called.stderr}")
    return called.stdout


def check_file(path):
    """Number of topics, none of which has an issue."""
    checked = rerun("mcap", "check", "--full", path)
    # The report's table begins below its rule: status, channel, chunks, topic, issues.
    rows = [line.split() for line in checked.split("\u2500\n")[-1].splitlines() if line.strip()]
    bad = [" ".join(row) for row in rows if row[0] != "ok"]
    expect(rows and not bad, f"{path}: rerun mcap check: {bad or checked}")
    return len(rows)


def check_release(release):
    paths = sorted((release / "mcap").glob("**/*.mcap"))
    expect(paths, f"{release} has no MCAP")
    topics = sum(check_file(path) for path in paths)
    flavour = "ros2" if (paths[0].parent / "metadata.yaml").exists() else "viewer"
    with tempfile.TemporaryDirectory() as folder:
        converted = Path(folder) / "mission.rrd"
        rerun("mcap", "convert", paths[0], "-o", converted)
        printed = rerun("rrd", "print", "-v", converted)
    missing = [shown for shown in SHOWN[flavour] if shown not in printed]
    expect(not missing, f"{paths[0]}: Rerun does not show {missing}")
    return {"files": len(paths), "topics": topics}


if __name__ == "__main__":
    run(check_release, lambda paths: {})
