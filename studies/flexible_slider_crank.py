"""A slider crank with an elastic rod, after Simeon and the Test Set for IVP Solvers; its stiffness is uncertain.

The crank turns at 150 rad/s. Two bending modes and two quadratic functions along the rod describe its deformation in a
frame at the crank pin. Reference: B. Simeon, Mathematical Modelling of Systems 2 (1996) 1-18; Test Set for IVP Solvers,
problem "slider crank", F. Mazzia and C. Magherini, University of Bari. The functions `rod_model` and `build` take the
data of the test set, and the test of this study compares its published solution.
"""

import chaospy
import numpy as np
import sympy

import uqmbd
from uqmbd_collocation import Collocation
from uqmbd_drivers import RotationDriver
from uqmbd_flexible import ModalModel, NodeShape, flexible_body
from uqmbd_joints import Prismatic, Revolute
from uqmbd_montecarlo import MonteCarlo

SPEED = 150.0  # rad/s
CRANK, ROD = 0.15, 0.30  # lengths, m
CRANK_MASS, ROD_MASS, SLIDER_MASS = 0.36, 0.151104, 0.075552  # kg
CRANK_INERTIA, ROD_INERTIA = 0.002727, 0.0045339259  # about the pins, kg m^2
DENSITY, MODULUS, HEIGHT, WIDTH = 7870.0, 0.2e12, 0.008, 0.008  # kg/m^3, Pa, m, m
PI = 3.1415927  # as in the test set

# position of the slider, m; angular velocity of the rod, rad/s; coordinates of the modes, m, and their rates, m/s
SMOOTH = (
    0.450016933,
    -74.9957670,
    (0, 0, 0.103339863e-4, 0.169327969e-4),
    (0.444896105, 0.463434311e-2, -0.178591076e-5, -0.268938672e-5),
)
"""Start of the test set on the smooth motion."""
RIGID = (0.45, -75.0, (0, 0, 0, 0), (0, 0, 0, 0))
"""Start of the test set as a rigid mechanism."""


def rod_model(modulus: float | uqmbd.RandomVariable = MODULUS, damped=False):
    """Return the elastic rod: lateral modes sin(pi x) and sin(2 pi x), and displacements along it at x = 1/2 and 1."""
    heavy, stiff, solid = DENSITY * WIDTH * HEIGHT * ROD, WIDTH * HEIGHT / ROD, DENSITY * WIDTH * HEIGHT * ROD
    slender = (HEIGHT / ROD) ** 2
    mass = heavy * np.array([[0.5, 0, 0, 0], [0, 0.5, 0, 0], [0, 0, 8, 1], [0, 0, 1, 2]])
    stiffness = sympy.diag(PI**4 / 24 * slender, PI**4 * 2 / 3 * slender, sympy.Matrix([[16, -8], [-8, 7]]) / 3)
    crossed = np.zeros((4, 4))
    crossed[0, 2:] = -16 / PI**3, 8 / PI**3 - 1 / PI
    crossed[1, 3] = 0.5 / PI
    along, across = solid * np.array([0, 0, 2 / 3, 1 / 6]), solid * np.array([2 / PI, 0, 0, 0])
    damping = np.zeros((4, 4))
    damping[0, 0], damping[1, 1] = 5, 25
    damping[2:, 2:] = 0.5 * np.array([[230.8375455264791, -262.6884879920526], [-262.6884879920526, 421.7421837156818]])
    return ModalModel(
        mass=ROD_MASS,
        com=(ROD / 2, 0),
        inertia=ROD_INERTIA,
        modal_mass=mass,
        stiffness=stiffness * stiff * modulus,
        translation=[along, across],
        rotation=[ROD * solid * np.array([1 / PI, -0.5 / PI, 0, 0])],
        gyration=[solid * (crossed - crossed.T)],
        linear=[[ROD * solid * np.array([0, 0, 1 / 3, 1 / 6])]],
        quadratic=[[mass]],
        nodes={
            "middle": NodeShape(np.array([ROD / 2, 0]), np.array([[0, 0, 1, 0], [1, 0, 0, 0]])),
            "end": NodeShape(
                np.array([ROD, 0]),
                np.array([[0, 0, 0, 1], [0, 0, 0, 0]]),
                np.array([[-PI / ROD, 2 * PI / ROD, 0, 0]]),
            ),
        },
        damping=damping if damped else None,
        length=ROD,
    )


def build(model, start=SMOOTH, name="flexible slider crank"):
    """Return the mechanism with a model of the rod, at a start of the test set."""
    place, speed, initial, rates = start
    mechanism = uqmbd.Mechanism(name, uqmbd.Planar())
    crank = mechanism.body("crank", CRANK_MASS, com=(CRANK / 2, 0), inertia=CRANK_INERTIA - CRANK_MASS * CRANK**2 / 4)
    slider = mechanism.body("slider", SLIDER_MASS, inertia=1e-3, position=(place, 0))
    rod = flexible_body(
        mechanism, "rod", model, position=(CRANK, 0), angular_velocity=speed, initial=initial, rates=rates
    )
    mechanism.add(Revolute("main bearing", mechanism.ground, crank, (0, 0), (0, 0)))
    mechanism.add(RotationDriver("motor", mechanism.ground, crank, angle=SPEED * uqmbd.t))
    mechanism.add(Revolute("crank pin", crank, rod.body, (CRANK, 0), (0, 0)))
    mechanism.add(Revolute("piston pin", rod.node("end"), slider, (0, 0), (0, 0)))
    mechanism.add(Prismatic("guide", mechanism.ground, slider, (0, 0), (0, 0), (1, 0), (1, 0)))
    mechanism.output("rod angle", rod.body.angle, units="rad")
    mechanism.output("slider", slider.position[0], units="m")
    for k in range(model.modes):
        mechanism.output(f"q{k + 1}", rod.modes.coordinate(f"mode {k + 1}"), units="m")
    return mechanism


modulus = uqmbd.RandomVariable("modulus", chaospy.Uniform(0.19e12, 0.21e12), units="Pa")
mechanism = build(rod_model(modulus, damped=True))
mechanism.output("largest bending", uqmbd.maximum(mechanism.components["rod modes"].coordinate("mode 1")), units="m")
mechanism.require("bending below 1.7 mm", mechanism.components["rod modes"].coordinate("mode 1") <= 1.7e-3)

study = uqmbd.Study(
    "flexible slider crank",
    mechanism,
    times=np.linspace(0, 0.04, 81),
    propagators=[MonteCarlo(samples=300, sampling="latin-hypercube", seed=1), Collocation(order=12)],
)
