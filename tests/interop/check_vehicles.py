"""Our MJCF and URDF of vehicles in MuJoCo: mass, positions of wheels, and how they stand and roll.

    check_vehicles.py FOLDER NAME...

For each name, FOLDER contains NAME.xml, NAME.urdf, NAME.json (the vehicle's parameters, as printed by `kinds --json`) and NAME/, a
release in which our own model drives it over level ground. Expected values are computed from the parameters, not from the exports.
"""

import json
import math
import sys
from pathlib import Path

import mujoco
import numpy as np
import pyarrow.parquet as pq
from common import Mismatch, expect

GRAVITY = 9.80665
SIDES = ("left", "right")
AXLES = {2: ("front", "rear"), 3: ("front", "middle", "rear")}
# MuJoCo's contacts yield by 0.2 to 0.6 mm under a standing vehicle.
HEIGHT_TOLERANCE_M = 1e-3
SETTLE_S = 6
STEP_M = 0.1


class Vehicle:
    """Quantities derived from the parameters of a vehicle."""

    def __init__(self, numbers):
        self.numbers = numbers
        chassis, wheels = numbers["chassis"], numbers["wheels"]
        names = AXLES[len(wheels["axles_m"])]
        sides = list(zip(SIDES, (0.5, -0.5)))
        self.hubs = {
            f"{name}_{side}_wheel": np.array([x, sign * wheels["track_m"], wheels["axle_z_m"]])
            for name, x in zip(names, wheels["axles_m"])
            for side, sign in sides
        }
        self.mass = chassis["mass_kg"] + len(self.hubs) * wheels["mass_kg"]
        moments = chassis["mass_kg"] * np.array(chassis["centre_of_mass_m"]) + wheels["mass_kg"] * sum(self.hubs.values())
        self.centre = moments / self.mass
        self.sag = self.mass * GRAVITY / len(self.hubs) / numbers["tyre"]["stiffness_n_m"]
        steered = 2 * len(numbers["drive"].get("steered_axles", []))
        hanging = {"rigid": 0, "independent": len(self.hubs), "rocker_bogie": 4}[numbers["suspension"]["kind"]]
        self.joints = len(self.hubs) + steered + hanging


def on_level_ground(spec, step_under=None):
    """The model over a plane, optionally with a block under a wheel."""
    spec.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_PLANE, size=[0, 0, 1])
    if step_under is not None:
        half = [0.2, 0.1, STEP_M / 2]
        spec.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_BOX, size=half, pos=[step_under[0], step_under[1], STEP_M / 2])
    return spec.compile()


def step(model, data, seconds):
    mujoco.mj_step(model, data, math.ceil(seconds / model.opt.timestep))


def check_parts(what, model, vehicle):
    """Mass, centre of mass, wheels and joints, all joints at zero."""
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    base = model.body("base_link").id
    expect(abs(model.body_subtreemass[base] - vehicle.mass) < 1e-6 * vehicle.mass, f"{what}: {model.body_subtreemass[base]} kg")
    centre = data.subtree_com[base] - data.xpos[base]
    expect(np.abs(centre - vehicle.centre).max() < 1e-6, f"{what}: centre of mass {centre}, not {vehicle.centre}")
    # The free joint is one more.
    expect(model.njnt == vehicle.joints + 1, f"{what}: {model.njnt} joints, not {vehicle.joints} and the free one")
    wheels = vehicle.numbers["wheels"]
    for name, hub in vehicle.hubs.items():
        body = model.body(name).id
        found = data.xpos[body] - data.xpos[base]
        expect(np.abs(found - hub).max() < 1e-9, f"{what}: {name} at {found}, not {hub}")
        geoms = [g for g in range(model.ngeom) if model.geom_bodyid[g] == body and model.geom_contype[g]]
        (geom,) = geoms
        expect(model.geom_type[geom] == mujoco.mjtGeom.mjGEOM_CYLINDER, f"{what}: {name} is not a cylinder")
        radius, half_width, _ = model.geom_size[geom]
        expect(abs(radius - wheels["radius_m"]) < 1e-9 and abs(2 * half_width - wheels["width_m"]) < 1e-9, f"{what}: {name} {radius}")
        axis = data.geom_xmat[geom].reshape(3, 3)[:, 2]
        expect(abs(abs(axis[1]) - 1) < 1e-9, f"{what}: the axle of {name} points to {axis}")


def inertia(model, data):
    """Moments of inertia about the centre of mass of the vehicle."""
    base = model.body("base_link").id
    total = np.zeros(3)
    for body in range(1, model.nbody):
        turn = data.ximat[body].reshape(3, 3)
        arm = data.xipos[body] - data.subtree_com[base]
        own = np.diag(turn @ np.diag(model.body_inertia[body]) @ turn.T)
        total += own + model.body_mass[body] * (arm @ arm - arm * arm)
    return total


def expected_inertia(vehicle):
    chassis, wheels = vehicle.numbers["chassis"], vehicle.numbers["wheels"]
    across = wheels["transverse_inertia_kg_m2"]
    parts = [(chassis["mass_kg"], np.array(chassis["centre_of_mass_m"]), np.array(chassis["inertia_kg_m2"]))]
    own = np.array([across, wheels["spin_inertia_kg_m2"], across])
    parts += [(wheels["mass_kg"], hub, own) for hub in vehicle.hubs.values()]
    arms = [(mass, at - vehicle.centre, own) for mass, at, own in parts]
    return sum(own + mass * (arm @ arm - arm * arm) for mass, arm, own in arms)


def rest_height(release):
    """Height of base_link on level ground in our own model, at the end of a drive, m."""
    (path,) = sorted(release.glob("tables/samples/*.parquet"))
    return pq.read_table(path, columns=["z_m"])["z_m"].to_pylist()[-1]


def check_rest(what, model, vehicle, ours):
    """At rest, as high as our model except for the sag of its tyres: wheels are rigid here."""
    data = mujoco.MjData(model)
    base = model.body("base_link").id
    data.qpos[2] = vehicle.numbers["wheels"]["radius_m"] - vehicle.numbers["wheels"]["axle_z_m"] + 0.005
    step(model, data, SETTLE_S)
    off = data.xpos[base][2] - (ours + vehicle.sag)
    expect(abs(off) < HEIGHT_TOLERANCE_M, f"{what}: stands {off} m off our height")
    expect(np.abs(data.qvel[:6]).max() < 1e-3, f"{what}: does not come to rest, {data.qvel[:6]}")
    tilt = math.degrees(math.acos(data.xmat[base].reshape(3, 3)[2, 2]))
    expect(tilt < 0.2, f"{what}: tilts by {tilt} deg")
    return data, off


def check_drive(what, model, data, vehicle, speed=0.4):
    """Motors at a positive speed drive forward, at that speed."""
    spin = speed / vehicle.numbers["wheels"]["radius_m"]
    motors = [a for a in range(model.nu) if model.actuator(a).name.endswith("_motor")]
    skid = vehicle.numbers["drive"]["kind"] == "skid_steer"
    expect(len(motors) == (2 if skid else len(vehicle.hubs)), f"{what}: {len(motors)} motors")
    data.ctrl[motors] = spin
    step(model, data, 3)
    expect(abs(data.qvel[0] / speed - 1) < 0.05, f"{what}: rolls at {data.qvel[0]} m/s instead of {speed}")
    expect(abs(data.qpos[1]) < 0.05, f"{what}: leaves its line by {data.qpos[1]} m")
    return data.qvel[0]


def check_differential(what, path, vehicle):
    """With a block under one front wheel, the rockers turn by opposite angles, and the chassis by half of what it would otherwise."""
    hub = vehicle.hubs["front_left_wheel"]
    model = on_level_ground(mujoco.MjSpec.from_file(str(path)), hub)
    data = mujoco.MjData(model)
    data.qpos[2] += STEP_M
    step(model, data, SETTLE_S)
    left, right = [math.degrees(data.joint(f"{side}_rocker_pivot").qpos[0]) for side in SIDES]
    expect(abs(left + right) < 0.3 and abs(left) > 1, f"{what}: rockers at {left} and {right} deg")
    return [left, right]


def floating(path, vehicle):
    """A URDF model as its comments require: its root is not fixed to the world, and wheels do not collide with the chassis."""
    spec = mujoco.MjSpec.from_file(str(path))
    spec.body("base_link").add_freejoint()
    for name in vehicle.hubs:
        spec.add_exclude(bodyname1="base_link", bodyname2=name)
    return spec


def add_springs(model, vehicle):
    """Statements in the comments of the URDF, from the parameters."""
    springs = vehicle.numbers["suspension"]
    if springs["kind"] != "independent":
        return
    preload = vehicle.numbers["chassis"]["mass_kg"] * GRAVITY / len(vehicle.hubs)
    for name in vehicle.hubs:
        joint = model.joint(f"{name}_suspension")
        model.jnt_stiffness[joint.id] = springs["stiffness_n_m"]
        model.qpos_spring[model.jnt_qposadr[joint.id]] = -preload / springs["stiffness_n_m"]


def check(folder, name):
    vehicle = Vehicle(json.loads((folder / f"{name}.json").read_text())[0]["parameters"])
    ours = rest_height(folder / name)
    answer = {"height_m": ours, "sag_m": vehicle.sag}
    mjcf = on_level_ground(mujoco.MjSpec.from_file(str(folder / f"{name}.xml")))
    check_parts(f"{name}.xml", mjcf, vehicle)
    data, answer["mjcf_off_m"] = check_rest(f"{name}.xml", mjcf, vehicle, ours)
    fresh = mujoco.MjData(mjcf)
    mujoco.mj_forward(mjcf, fresh)
    error = np.abs(inertia(mjcf, fresh) / expected_inertia(vehicle) - 1).max()
    expect(error < 1e-3, f"{name}.xml: moments of inertia are off by {error}")
    answer["drive_m_s"] = check_drive(f"{name}.xml", mjcf, data, vehicle)
    if vehicle.numbers["suspension"]["kind"] == "rocker_bogie":
        answer["rockers_deg"] = check_differential(f"{name}.xml", folder / f"{name}.xml", vehicle)
    urdf = on_level_ground(floating(folder / f"{name}.urdf", vehicle))
    check_parts(f"{name}.urdf", urdf, vehicle)
    add_springs(urdf, vehicle)
    _, answer["urdf_off_m"] = check_rest(f"{name}.urdf", urdf, vehicle, ours)
    return answer


def main():
    folder = Path(sys.argv[1])
    try:
        answers = {name: check(folder, name) for name in sys.argv[2:]}
    except Mismatch as mismatch:
        sys.exit(str(mismatch))
    json.dump(answers, sys.stdout, indent=1)
    print()


if __name__ == "__main__":
    main()
