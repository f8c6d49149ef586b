"""A slider-crank with random link lengths whose crank rotates: phase errors of a plain chaos grow with time.

Crank 0.15 m and rod 0.35 m are slender.  The slider moves on the x axis; gravity acts along -y.  The crank starts at 45
degrees and at rest.  A torque of 0.45 N m drives it against a viscous damping of 0.03 N m s, so that the crank turns
over.  Crank and rod length are normal with a standard deviation of 2 %.  The masses are fixed, so the inertias depend
on the lengths.
"""

import chaospy
import numpy as np
import sympy

import uqmbd
from uqmbd_joints import Prismatic, Revolute
from uqmbd_montecarlo import MonteCarlo
from uqmbd_springs import Torque, TorsionSpringDamper

crank_length = uqmbd.RandomVariable("crank_length", chaospy.Normal(0.15, 0.003), units="m")
rod_length = uqmbd.RandomVariable("rod_length", chaospy.Normal(0.35, 0.007), units="m")

# the given pose: crank at 45 degrees, slider on the x axis, for every pair of lengths
pin_x = crank_length * sympy.cos(sympy.pi / 4)
pin_y = crank_length * sympy.sin(sympy.pi / 4)
rod_angle = -sympy.asin(pin_y / rod_length)
slider_position = pin_x + rod_length * sympy.cos(rod_angle)

mechanism = uqmbd.Mechanism("slider_crank_rotating", uqmbd.Planar(gravity=(0.0, -9.81)))
ground = mechanism.ground
crank = mechanism.body(
    "crank", mass=0.36, inertia=0.36 * crank_length**2 / 12, position=(pin_x / 2, pin_y / 2), angle=sympy.pi / 4
)
rod = mechanism.body(
    "rod",
    mass=0.15,
    inertia=0.15 * rod_length**2 / 12,
    position=((pin_x + slider_position) / 2, pin_y / 2),
    angle=rod_angle,
)
slider = mechanism.body("slider", mass=0.10, inertia=1e-4, position=(slider_position, 0))

mechanism.add(Revolute("crank_bearing", ground, crank, point_i=(0, 0), point_j=(-crank_length / 2, 0)))
mechanism.add(Revolute("crank_pin", crank, rod, point_i=(crank_length / 2, 0), point_j=(-rod_length / 2, 0)))
pin = mechanism.add(Revolute("piston_pin", rod, slider, point_i=(rod_length / 2, 0), point_j=(0, 0)))
mechanism.add(Prismatic("guide", ground, slider, point_i=(0, 0), point_j=(0, 0), axis_i=(1, 0), axis_j=(1, 0)))
mechanism.add(Torque("drive", crank, torque=0.45))
mechanism.add(TorsionSpringDamper("friction", ground, crank, stiffness=0, damping=0.03))

mechanism.output("slider_x", slider.position[0], units="m")
mechanism.output("crank_angle", crank.angle, units="rad")
mechanism.output("pin_force", pin.reaction_force[0], units="N")

study = uqmbd.Study(
    "slider_crank_rotating",
    mechanism,
    times=np.linspace(0, 4, 801),
    propagators=[MonteCarlo(samples=500, seed=1)],
)
