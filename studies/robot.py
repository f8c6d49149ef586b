"""A robot arm draws a circle under a sampled controller: uncertain masses, payload and friction make it miss the path.

Two links in a vertical plane carry a payload.  A computed-torque controller at 100 Hz measures the angles and speeds of
both joints.  It commands the torques of their motors, at most 60 N m, which act 4 ms later.  The controller assumes
the nominal masses of the arm, without friction (J. J. Craig, Introduction to Robotics, 3rd ed., Pearson 2005, section
10.4).  The difference between this model and the arm makes the tool miss its path.  The path runs once round a circle
of radius 0.1 m in 2 s, from rest to rest.
"""

import chaospy
import numpy as np
import sympy

import uqmbd
from uqmbd_collocation import Collocation
from uqmbd_galerkin import Galerkin
from uqmbd_joints import Fixed, Revolute
from uqmbd_montecarlo import MonteCarlo
from uqmbd_springs import RotationalFriction, Torque

GRAVITY, DURATION, RATE, DELAY, LIMIT = 9.81, 2.0, 100.0, 0.004, 60.0
UPPER, FORE = 0.40, 0.35  # lengths, m
NOMINAL = {"upper_arm": 5.0, "forearm": 3.0, "payload": 1.0}  # kg
CENTRE, RADIUS = (0.45, 0.05), 0.1  # of the circle, m
STIFFNESS, DAMPING = 225.0, 30.0  # of the error of a joint, 1/s^2 and 1/s: critically damped, at 15 1/s


def phase(time):
    """Return the angle on the circle, a number or an expression: one turn by a quintic from rest to rest."""
    x = time / DURATION
    return 2 * np.pi * x**3 * (10 - 15 * x + 6 * x**2)


def path(time):
    """Return the commanded position of the tool, m."""
    return CENTRE[0] + RADIUS * np.cos(phase(time)), CENTRE[1] + RADIUS * np.sin(phase(time))


def joint_angles(x, y):
    """Return angles of shoulder and elbow (relative) for a position of the tool, elbow down."""
    elbow = np.arccos((x**2 + y**2 - UPPER**2 - FORE**2) / (2 * UPPER * FORE))
    return np.array([np.arctan2(y, x) - np.arctan2(FORE * np.sin(elbow), UPPER + FORE * np.cos(elbow)), elbow])


def reference(time, step=1e-4):
    """Return angles, speeds and accelerations of the joints on the path, the latter two by central differences."""
    before, now, after = (joint_angles(*path(t)) for t in (time - step, time, time + step))
    return now, (after - before) / (2 * step), (after - 2 * now + before) / step**2


def computed_torque(time, measured):
    """Return torques of shoulder and elbow, N m, shape (realisation, 2), from angles and speeds (realisation, 4)."""
    shoulder, elbow, shoulder_speed, elbow_speed = measured.T
    angles, speeds, wanted = reference(time)
    acceleration = wanted + DAMPING * (speeds - measured[:, 2:]) + STIFFNESS * (angles - measured[:, :2])
    m1, m2, m3 = NOMINAL.values()
    # moments of inertia and first moments of mass about the joints, for uniform links and a point payload
    own, tip, coupled = (m1 / 3 + m2 + m3) * UPPER**2, (m2 / 3 + m3) * FORE**2, (m2 / 2 + m3) * UPPER * FORE
    lift_1, lift_2 = (m1 / 2 + m2 + m3) * UPPER * GRAVITY, (m2 / 2 + m3) * FORE * GRAVITY
    mixed = tip + coupled * np.cos(elbow)
    turning = coupled * np.sin(elbow)
    fore = lift_2 * np.cos(shoulder + elbow)
    return np.column_stack(
        [
            (own + tip + 2 * coupled * np.cos(elbow)) * acceleration[:, 0]
            + mixed * acceleration[:, 1]
            - turning * elbow_speed * (2 * shoulder_speed + elbow_speed)
            + lift_1 * np.cos(shoulder)
            + fore,
            mixed * acceleration[:, 0] + tip * acceleration[:, 1] + turning * shoulder_speed**2 + fore,
        ]
    )


upper_mass = uqmbd.RandomVariable("upper_arm_mass", chaospy.Normal(NOMINAL["upper_arm"], 0.15), units="kg")
fore_mass = uqmbd.RandomVariable("forearm_mass", chaospy.Normal(NOMINAL["forearm"], 0.15), units="kg")
payload_mass = uqmbd.RandomVariable("payload", chaospy.Uniform(0.5, 1.5), units="kg")
friction = uqmbd.RandomVariable("friction", chaospy.Uniform(0.2, 0.8), units="N m")

mechanism = uqmbd.Mechanism("robot", uqmbd.Planar(gravity=(0, -GRAVITY)))
first, second = (float(angle) for angle in joint_angles(*path(0.0)))
elbow = (UPPER * np.cos(first), UPPER * np.sin(first))
tip = path(0.0)
along = (np.cos(first + second), np.sin(first + second))

upper = mechanism.body(
    "upper_arm", mass=upper_mass, inertia=upper_mass * UPPER**2 / 12, com=(UPPER / 2, 0), angle=first
)
fore = mechanism.body(
    "forearm", mass=fore_mass, inertia=fore_mass * FORE**2 / 12, com=(FORE / 2, 0), position=elbow, angle=first + second
)
payload = mechanism.body("payload", mass=payload_mass, inertia=1e-4, position=tip, angle=first + second)
mechanism.add(Revolute("shoulder", mechanism.ground, upper, (0, 0), (0, 0)))
mechanism.add(Revolute("elbow", upper, fore, (UPPER, 0), (0, 0)))
mechanism.add(Fixed("grip", fore, payload, (FORE, 0), (0, 0)))
mechanism.add(RotationalFriction("shoulder_friction", mechanism.ground, upper, friction, damping=0.2, transition=0.2))
mechanism.add(RotationalFriction("elbow_friction", upper, fore, friction / 2, damping=0.1, transition=0.2))

controller = uqmbd.Controller(
    "controller",
    measured=[
        upper.angle,
        fore.angle - upper.angle,
        upper.angular_velocity,
        fore.angular_velocity - upper.angular_velocity,
    ],
    commanded={"shoulder": "N m", "elbow": "N m"},
    rate=RATE,
    function=computed_torque,
    delay=DELAY,
    limits=(-LIMIT, LIMIT),
    initial=dict(zip(("shoulder", "elbow"), computed_torque(0.0, np.array([[first, second, 0, 0]]))[0], strict=True)),
)
mechanism.add(controller)
# a motor on the upper arm turns the forearm, which reacts on the upper arm
mechanism.add(Torque("shoulder_motor", upper, controller.command("shoulder") - controller.command("elbow")))
mechanism.add(Torque("elbow_motor", fore, controller.command("elbow")))

cosine, sine = sympy.cos(phase(uqmbd.t)), sympy.sin(phase(uqmbd.t))
outwards, forwards = sympy.Matrix([cosine, sine]), sympy.Matrix([-sine, cosine])
miss = payload.position - sympy.Matrix(CENTRE) - RADIUS * outwards
mechanism.output("path_error", 1000 * miss.dot(outwards), units="mm")  # across the path, outwards
mechanism.output("lead", 1000 * miss.dot(forwards), units="mm")  # along the path, ahead of the commanded position
mechanism.output("shoulder_torque", controller.command("shoulder"), units="N m")
mechanism.output("elbow_torque", controller.command("elbow"), units="N m")

study = uqmbd.Study(
    "robot",
    mechanism,
    times=np.linspace(0, DURATION, 101),
    propagators=[MonteCarlo(samples=300, seed=1), Collocation(order=2), Galerkin(order=2)],
    report_times=[0.6, 1.0],
)
