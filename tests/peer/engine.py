"""Our skid-steered vehicle in MuJoCo: spheres for wheels, a box for the chassis, a height field for the ground.

*Tyre.* A sphere meets every prism of the height field under it at once, so a spring and a damper for each contact would grow
with their number. Tyres are therefore springs and dampers between hub and chassis, along the body's z axis, with the stiffness
and damping of ours. The sphere itself is as hard as the time step allows, its contact critically damped. As in our model, the
wheels' mass is carried by the tyres, except for a part that keeps the wheel stable at this time step. Differences: the tyre
yields only along z, and has no flexible tread.

*Chassis.* A contact with impedance `d` seeks the acceleration `(1 - d) a0 - d (b v + k depth)`, with `a0` that without contact,
however many share it. `k` and `b` are those of ten of our points, which carry the vehicle, over its mass; their damping (Hunt and
Crossley) is proportional to the load, here the weight.
"""

import mujoco
import numpy as np

GRAVITY = 9.80665
IMPEDANCE = 0.95
# Time constant of the contact of wheels, s: MuJoCo requires two steps of 1/500 s or more.
WHEEL_CONTACT_S = 0.005
# Rate at which sliding dies out in a contact that sticks, 1/s: at 250 a wheel at rest on a slope of 30 deg chatters.
STICKING_RATE = 100.0
# Normal over tangential compliance: the locked vehicle creeps down 30 deg by 1.5 mm/s, 5 cm in the 30 s of a stuck one.
IMPRATIO = 10.0
# Part of a wheel's mass below its tyre; with less, the spring is unstable at this time step.
UNSPRUNG = 0.3
CHASSIS_POINTS = 10
# Prisms extend this far below the lowest post, so that no contact leaves through their bottom, m.
BASE_M = 2.0
BRAKE_GAIN = 1e4
SIDES = ("left", "right")


def spec(vehicle, rules, terrain):
    """The model before compilation."""
    s = mujoco.MjSpec()
    s.option.timestep = 1 / rules["step_rate_hz"]
    s.option.gravity = (0, 0, -GRAVITY)
    s.option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    s.option.cone = mujoco.mjtCone.mjCONE_ELLIPTIC
    s.option.impratio = IMPRATIO
    add_ground(s, terrain)
    base = s.worldbody.add_body(name="base")
    base.add_freejoint()
    chassis, wheels = vehicle["chassis"], vehicle["wheels"]
    base.mass, base.ipos, base.inertia = sprung(chassis, wheels)
    base.explicitinertial = True
    half = [0.5 * size for size in chassis["size_m"]]
    centre = [0, 0, chassis["bottom_z_m"] + half[2]]
    base.add_geom(name="chassis", type=mujoco.mjtGeom.mjGEOM_BOX, size=half, pos=centre)
    for name, hub in hubs(wheels):
        add_wheel(base, name, hub, wheels, vehicle["tyre"])
    for side in SIDES:
        add_motor(s, side, len(wheels["axles_m"]), vehicle["drive"])
    add_contacts(s, vehicle, rules["surface"])
    return s


def hubs(wheels):
    """Name and position of every wheel."""
    sides = list(zip(SIDES, (0.5, -0.5)))
    places = [(axle, x, *side) for axle, x in enumerate(wheels["axles_m"]) for side in sides]
    return [(f"{side}{axle}", np.array([x, sign * wheels["track_m"], wheels["axle_z_m"]])) for axle, x, side, sign in places]


def sprung(chassis, wheels):
    """Mass, centre of mass and principal inertia of the chassis with what it carries of the wheels."""
    carried = (1 - UNSPRUNG) * wheels["mass_kg"]
    parts = [(chassis["mass_kg"], np.array(chassis["centre_of_mass_m"]))] + [(carried, hub) for _, hub in hubs(wheels)]
    mass = sum(part for part, _ in parts)
    centre = sum(part * at for part, at in parts) / mass
    arms = [(part, at - centre) for part, at in parts]
    return mass, centre, np.array(chassis["inertia_kg_m2"]) + sum(part * (arm @ arm - arm * arm) for part, arm in arms)


def add_ground(s, terrain):
    rows, cols = terrain.heights.shape
    low, high = terrain.heights.min(), terrain.heights.max()
    relief = max(high - low, 1e-6)
    half = [0.5 * (cols - 1) * terrain.cell, 0.5 * (rows - 1) * terrain.cell]
    field = s.add_hfield(name="terrain", nrow=rows, ncol=cols, size=[*half, relief, BASE_M])
    field.userdata = ((terrain.heights - low) / relief).astype(np.float32).ravel()
    s.worldbody.add_geom(
        name="terrain",
        type=mujoco.mjtGeom.mjGEOM_HFIELD,
        hfieldname="terrain",
        pos=[terrain.x0 + half[0], terrain.y0 + half[1], low],
        contype=0,
        conaffinity=0,
    )


def add_wheel(base, name, hub, wheels, tyre):
    body = base.add_body(name=name, pos=hub)
    across = wheels["transverse_inertia_kg_m2"]
    body.mass, body.inertia = UNSPRUNG * wheels["mass_kg"], [across, wheels["spin_inertia_kg_m2"], across]
    body.explicitinertial = True
    spring = body.add_joint(name=f"{name}_tyre", type=mujoco.mjtJoint.mjJNT_SLIDE, axis=[0, 0, 1])
    spring.stiffness[0], spring.damping[0] = tyre["stiffness_n_m"], tyre["damping_n_s_m"]
    body.add_joint(name=name, type=mujoco.mjtJoint.mjJNT_HINGE, axis=[0, 1, 0])
    body.add_geom(name=name, type=mujoco.mjtGeom.mjGEOM_SPHERE, size=[wheels["radius_m"], 0, 0], contype=0, conaffinity=0)


def add_motor(s, side, axles, drive):
    """One motor for the wheels of a side, which turn together: a servo on their mean speed."""
    tendon = s.add_tendon(name=side)
    for axle in range(axles):
        tendon.wrap_joint(f"{side}{axle}", 1 / axles)
    for axle in range(1, axles):
        tie = s.add_equality(type=mujoco.mjtEq.mjEQ_JOINT, name1=f"{side}0", name2=f"{side}{axle}")
        tie.data[:5] = [0, 1, 0, 0, 0]
        tie.solref = [0.005, 1]
        tie.solimp[:2] = [0.99, 0.99]
    gain, limit = drive["servo_gain_n_m_s"], drive["torque_limit_n_m"]
    motor = s.add_actuator(name=side, target=side, trntype=mujoco.mjtTrn.mjTRN_TENDON)
    motor.gainprm[0] = gain
    motor.biastype = mujoco.mjtBias.mjBIAS_AFFINE
    motor.biasprm[2] = -gain
    motor.forcelimited = True
    motor.forcerange = [-limit, limit]


def add_contacts(s, vehicle, surface):
    belly, wheels = vehicle["belly"], 2 * len(vehicle["wheels"]["axles_m"])
    mass = vehicle["chassis"]["mass_kg"] + wheels * vehicle["wheels"]["mass_kg"]
    stiffness, damping = belly["stiffness_n_m"] * CHASSIS_POINTS / mass, belly["dissipation_s_m"] * GRAVITY
    for geom in [g for g in s.geoms if g.name != "terrain"]:
        pair = s.add_pair(geomname1="terrain", geomname2=geom.name, condim=3)
        chassis = geom.name == "chassis"
        friction = surface["belly_friction" if chassis else "wheel_friction"]
        pair.friction[:2] = [friction, friction]
        # MuJoCo divides stiffness by the square of the impedance and damping by it.
        pair.solref = [-stiffness * IMPEDANCE**2, -damping * IMPEDANCE] if chassis else [WHEEL_CONTACT_S, 1]
        pair.solreffriction = [-1e-9, -STICKING_RATE * IMPEDANCE]
        pair.solimp[:2] = [IMPEDANCE, IMPEDANCE]


class Simulation:
    """One vehicle on its ground."""

    def __init__(self, model):
        self.model, self.data = model, mujoco.MjData(model)
        self.motors = [model.actuator(side).id for side in SIDES]

    def place(self, position, quaternion):
        """At rest at a place, raised until nothing touches."""
        mujoco.mj_resetData(self.model, self.data)
        self.data.qpos[:7] = [*position, *quaternion]
        while True:
            mujoco.mj_forward(self.model, self.data)
            if self.data.ncon == 0:
                return
            self.data.qpos[2] += max(1e-4, -self.data.contact.dist.min())

    def brake(self, seconds):
        """Steps with locked wheels."""
        m = self.model
        servo = m.actuator_gainprm.copy(), m.actuator_biasprm.copy(), m.actuator_forcerange.copy()
        m.actuator_gainprm[:, 0], m.actuator_biasprm[:, 2] = BRAKE_GAIN, -BRAKE_GAIN
        m.actuator_forcerange[:] = [-1e6, 1e6]
        self.data.ctrl[:] = 0
        mujoco.mj_step(m, self.data, int(np.ceil(seconds / m.opt.timestep)))
        m.actuator_gainprm[:], m.actuator_biasprm[:], m.actuator_forcerange[:] = servo

    def drive(self, wheel_speeds, steps):
        self.data.ctrl[self.motors] = wheel_speeds
        mujoco.mj_step(self.model, self.data, steps)

    def pose(self):
        """Position and quaternion (w, x, y, z) of base_link."""
        return self.data.qpos[:7].copy()

    def axes(self):
        """Columns: the body's axes in the map frame."""
        matrix = np.empty(9)
        mujoco.mju_quat2Mat(matrix, self.data.qpos[3:7])
        return matrix.reshape(3, 3)
