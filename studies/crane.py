"""A slewing crane swings its load past a wall: the probability that load and wall come nearer than 0.3 m.

A boom of 6 m turns by a quarter of a turn about a vertical axis, by a quintic from rest to rest.  A crate hangs from
its tip on a cable: one rigid body on a universal joint, without damping.  The load swings outwards, towards a wall
behind the place where it is set down.  Cable length, duration of the turn and place of the wall are uncertain.  The
clearance is the distance of the shapes, with its minimum between the output times.
"""

import chaospy
import numpy as np
import sympy

import uqmbd
from uqmbd.shapes import Box, Capsule, Cylinder
from uqmbd_drivers import RotationDriver
from uqmbd_geometry import clearance
from uqmbd_joints import Fixed, Revolute, Universal
from uqmbd_montecarlo import MonteCarlo

REACH, HEIGHT, TURN = 6.0, 8.0, np.pi / 2  # m, m, rad
CRATE, MASS = (1.2, 0.8, 0.8), 400.0  # m, kg

cable = uqmbd.RandomVariable("cable", chaospy.Normal(5.0, 0.1), units="m")
duration = uqmbd.RandomVariable("duration", chaospy.Uniform(6.0, 7.0), units="s")
wall = uqmbd.RandomVariable("wall", chaospy.Normal(9.2, 0.05), units="m")

PLACE = (0, wall + 0.1, 3.0)  # of the centre of the wall, which is 0.2 m thick
part = uqmbd.t / duration
angle = sympy.Piecewise((TURN * part**3 * (10 - 15 * part + 6 * part**2), uqmbd.t < duration), (TURN, True))

mechanism = uqmbd.Mechanism("crane", uqmbd.Spatial(gravity=(0.0, 0.0, -9.81)))
along_x = [[0, 0, 1], [0, 1, 0], [-1, 0, 0]]  # the third axis of the capsule is the first axis of the boom
boom = mechanism.body(
    "boom",
    mass=300.0,
    inertia=(5.0, 300.0 * REACH**2 / 12, 300.0 * REACH**2 / 12),
    position=(REACH / 2, 0, HEIGHT),
    shape=[
        Capsule(0.12, REACH, rotation=along_x),
        Cylinder(0.3, HEIGHT, position=(-REACH / 2, 0, -HEIGHT / 2)),
    ],
)
load = mechanism.body(
    "load",
    mass=MASS,
    inertia=tuple(MASS * (a**2 + b**2) / 12 for a, b in (CRATE[1:], CRATE[::2], CRATE[:2])),
    position=(REACH, 0, HEIGHT - cable),
    shape=[Box(CRATE), Capsule(0.02, cable, position=(0, 0, cable / 2))],
)
column = mechanism.add(Revolute("column", mechanism.ground, boom, at=(0, 0, HEIGHT), axis=(0, 0, 1)))
mechanism.add(RotationDriver("slewing_gear", mechanism.ground, boom, angle=angle, axis=(0, 0, 1)))
hook = mechanism.add(Universal("hook", boom, load, (REACH / 2, 0, 0), (0, 0, cable), (0, 1, 0), (1, 0, 0)))
panel = mechanism.body("wall", mass=1.0, inertia=(1.0, 1.0, 1.0), position=PLACE, shape=Box((6.0, 0.2, 6.0)))
mechanism.add(Fixed("foundation", mechanism.ground, panel, PLACE, (0, 0, 0)))

mechanism.output("load_y", load.position[1], units="m")
mechanism.output("swing", hook.angle_i, units="rad")
mechanism.output("gap", clearance(load, panel), units="m")
mechanism.require("clear_of_wall", clearance(load, panel) >= 0.3)

study = uqmbd.Study(
    "crane", mechanism, times=np.linspace(0, 10, 201), propagators=[MonteCarlo(samples=512, sampling="sobol", seed=1)]
)
