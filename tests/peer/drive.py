"""Drives the missions of a release in MuJoCo and prints their outcomes as JSON.

    drive.py RELEASE VEHICLE.toml [--processes N] [--terrain ID] [--traverse ID] [--mission ID --poses FILE.csv]

With `--traverse`, missions of that run alone are driven, with its settings. With `--poses` the poses of both engines on one mission go to a CSV
file for plotting.
"""

import argparse
import json
import math
import sys
import time
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

import engine
import mujoco
import numpy as np
import release as release_files
from metrics import of_poses
from steering import PurePursuit


# Points at which MuJoCo's ground is compared with the DEM.
RAYS = 20_000


class Course:
    """A terrain with the vehicle on it."""

    def __init__(self, terrain, rules, vehicle):
        self.terrain, self.rules, self.vehicle = terrain, rules, vehicle
        self.simulation = engine.Simulation(engine.spec(vehicle, rules, terrain).compile())

    def largest_height_error(self):
        """MuJoCo's ground, by rays cast down, minus the DEM: at cell centres, and between them, m."""
        rows, cols = self.terrain.heights.shape
        mujoco.mj_kinematics(self.simulation.model, self.simulation.data)
        generator = np.random.default_rng(1)
        j, i = generator.integers(1, rows - 2, RAYS), generator.integers(1, cols - 2, RAYS)
        fraction = generator.random((2, RAYS))
        errors = []
        for fx, fy in ((np.full(RAYS, 1e-6), np.full(RAYS, 2e-6)), fraction):
            x, y = self.terrain.x0 + (i + fx) * self.terrain.cell, self.terrain.y0 + (j + fy) * self.terrain.cell
            heights = self.terrain.height(x, y)
            errors.append(float(np.max([abs(self.ground(*at) - h) for *at, h in zip(x, y, heights)])))
        return errors

    def ground(self, x, y):
        model, data, top = self.simulation.model, self.simulation.data, 1e3
        down = np.array([0.0, 0.0, -1.0])
        return top - mujoco.mj_rayHfield(model, data, model.geom("terrain").id, np.array([x, y, top]), down, None)

    def put_down(self, mission):
        """The vehicle at rest at the start: fitted to the ground under its hubs, dropped with locked wheels."""
        wheels = self.vehicle["wheels"]
        heading = math.radians(mission["heading_deg"])
        cos, sin = math.cos(heading), math.sin(heading)
        hubs = np.array([hub[:2] for _, hub in engine.hubs(wheels)])
        at = np.array([mission["start_x_m"], mission["start_y_m"]])
        plan = at + hubs @ np.array([[cos, sin], [-sin, cos]])
        heights = self.terrain.height(plan[:, 0], plan[:, 1])
        ahead, left, middle = np.linalg.lstsq(np.column_stack([hubs, np.ones(len(hubs))]), heights, rcond=None)[0]
        x_axis, across = np.array([cos, sin, ahead]), np.array([-sin, cos, left])
        normal = np.cross(x_axis, across)
        x_axis, z_axis = x_axis / np.linalg.norm(x_axis), normal / np.linalg.norm(normal)
        quaternion = np.empty(4)
        mujoco.mju_mat2Quat(quaternion, np.column_stack([x_axis, np.cross(z_axis, x_axis), z_axis]).ravel())
        self.simulation.place([*at, middle + wheels["radius_m"] - wheels["axle_z_m"]], quaternion)
        self.simulation.brake(self.rules["settle_s"])

    def drive(self, mission):
        """Outcome, time, and poses at the sample rate (time, position, quaternion w x y z)."""
        rules, simulation = self.rules, self.simulation
        rate = rules["step_rate_hz"]
        control, sample = rate // rules["control_rate_hz"], rate // rules["sample_rate_hz"]
        stride = math.gcd(control, sample)
        self.put_down(mission)
        steering = PurePursuit(mission, rules, self.vehicle["drive"])
        judge = Judge(rules, self.terrain, steering, simulation.pose())
        poses, step = [], 0
        while True:
            pose, axes = simulation.pose(), simulation.axes()
            if step % control == 0:
                steering.update(pose[0], pose[1], math.atan2(axes[1, 0], axes[0, 0]), control / rate)
            if step % sample == 0:
                poses.append([step / rate, *pose])
            outcome = judge.outcome(step / rate, pose, axes)
            if outcome:
                return outcome, step / rate, np.array(poses)
            simulation.drive(steering.wheel_speeds(self.vehicle["wheels"]), stride)
            step += stride


class Judge:
    """How a mission ends."""

    def __init__(self, rules, terrain, steering, pose):
        self.rules, self.terrain, self.steering = rules, terrain, steering
        self.anchor, self.since = pose[:2], 0.0
        self.tip = math.radians(rules["tip_deg"])

    def outcome(self, time_s, pose, axes):
        if not self.terrain.contains(pose[0], pose[1]):
            return "out_of_bounds"
        pitch, roll = math.asin(max(-1.0, min(1.0, axes[2, 0]))), math.atan2(axes[2, 1], axes[2, 2])
        if abs(pitch) > self.tip or abs(roll) > self.tip:
            return "tipped"
        if self.steering.to_goal(pose[0], pose[1]) <= self.rules["goal_tolerance_m"]:
            return "success"
        if np.hypot(*(pose[:2] - self.anchor)) >= self.rules["stuck_distance_m"]:
            self.anchor, self.since = pose[:2], time_s
        if time_s - self.since >= self.rules["stuck_time_s"]:
            return "stuck"
        return "timeout" if time_s >= self.rules["timeout_s"] else None


def course_of(release, terrain_id, vehicle_file, traverse=None):
    """A terrain of a release, and its missions, of one run if given."""
    rows = release_files.missions(release)
    missions = [row for row in rows if row["terrain_id"] == terrain_id and traverse in (None, row["traverse_id"])]
    rules, vehicle = release_files.parameters(release, missions[0]), release_files.vehicle(vehicle_file)
    return Course(release_files.Terrain.of(release, terrain_id), rules, vehicle), missions


def drive_terrain(release, terrain_id, vehicle_file, traverse):
    """Every mission of a terrain, and statistics of the computation."""
    course, missions = course_of(release, terrain_id, vehicle_file, traverse)
    at_centres, between = course.largest_height_error()
    driven, simulated, start = [], 0.0, time.process_time()
    for mission in missions:
        outcome, time_s, poses = course.drive(mission)
        simulated += time_s + course.rules["settle_s"]
        found = of_poses(poses, course.rules["sample_rate_hz"])
        name = {"terrain_id": terrain_id, "mission_id": mission["mission_id"]}
        driven.append({**name, "outcome": outcome, "time_s": time_s, **found})
    spent = time.process_time() - start
    print(f"{terrain_id}: {simulated:.0f} s simulated in {spent:.0f} s, ground {1e6 * at_centres:.2g} um off", file=sys.stderr)
    return {"missions": driven, "simulated_s": simulated, "cpu_s": spent, "height_error_m": [at_centres, between]}


def drive_release(release, vehicle_file, processes, only=None, traverse=None):
    rows = release_files.missions(release)
    terrains = sorted({row["terrain_id"] for row in rows if only in (None, row["terrain_id"])})
    with ProcessPoolExecutor(processes) as pool:
        jobs = [pool.submit(drive_terrain, release, terrain, vehicle_file, traverse) for terrain in terrains]
        done = [job.result() for job in jobs]
    return {
        "mujoco": mujoco.__version__,
        "height_error_m": np.max([part["height_error_m"] for part in done], axis=0).tolist(),
        "simulated_s": sum(part["simulated_s"] for part in done),
        "cpu_s": sum(part["cpu_s"] for part in done),
        "missions": [row for part in done for row in part["missions"]],
    }


def write_poses(release, vehicle_file, terrain_id, mission_id, path):
    course, missions = course_of(release, terrain_id, vehicle_file)
    mission = next(row for row in missions if row["mission_id"] == mission_id)
    outcome, time_s, theirs = course.drive(mission)
    ours = release_files.samples(release, terrain_id)[mission_id]
    with open(path, "w") as file:
        file.write("engine,time_s,x_m,y_m,z_m,qw,qx,qy,qz\n")
        for name, poses in (("sastrugi", ours), ("mujoco", theirs)):
            for pose in poses:
                file.write(",".join([name, *(f"{value:.9g}" for value in pose)]) + "\n")
    print(f"{terrain_id}/{mission_id}: sastrugi {mission['outcome']} {mission['time_s']} s, mujoco {outcome} {time_s} s")


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("release", type=Path)
    parser.add_argument("vehicle", type=Path)
    parser.add_argument("--processes", type=int, default=2)
    parser.add_argument("--terrain")
    parser.add_argument("--traverse")
    parser.add_argument("--mission")
    parser.add_argument("--poses", type=Path)
    arguments = parser.parse_args()
    if arguments.poses:
        write_poses(arguments.release, arguments.vehicle, arguments.terrain, arguments.mission, arguments.poses)
    else:
        a = arguments
        json.dump(drive_release(a.release, a.vehicle, a.processes, a.terrain, a.traverse), sys.stdout)


if __name__ == "__main__":
    main()
