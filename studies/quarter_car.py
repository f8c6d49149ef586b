"""A quarter car on a rough road: comfort, road holding and suspension travel from its stationary response.

The road is of class C of ISO 8608 between 0.01 and 10 cycle/m.  At 20 m/s its wavelengths of 100 m to 0.1 m excite the
car with 0.2 Hz to 200 Hz.  The outputs describe the stationary motion of the linearised car.  No motion is integrated,
and each realisation costs about as much as a natural frequency.

- Comfort: the standard deviation of the acceleration of the body.
- Road holding: the standard deviation of the tyre force over the static load, and the number of lift-offs in a minute.
  The linear car has negative tyre forces instead of lift-off, so the study counts crossings of zero.
- Suspension travel: the expected largest deviation from equilibrium in 10 minutes.

The number of lift-offs varies by powers of ten.  Its logarithm is smooth in the inputs: the requirement on it has a
probability of violation by collocation with an interval of 2 %, where the number itself has errors of 6 %.

Body 320 kg, wheel 40 kg, suspension 20 kN/m and 1.2 kN s/m, tyre 180 kN/m without damping: a quarter of a passenger
car.  Its modes are at 1.2 Hz (20 % damped) and 11 Hz (22 %).  Uncertain are the load, the springs, the damper
(temperature and wear) and the stiffness of the tyre (pressure).

`quarter_car_paths.py` has the same car with lift-off and a bump stop on sampled roads.
"""

import chaospy
import sympy

import uqmbd
from uqmbd_collocation import Collocation
from uqmbd_montecarlo import MonteCarlo
from uqmbd_processes import RandomProcess, crossing_rate, expected_maximum, iso8608, stationary_std
from uqmbd_springs import RadialTyre, SpringDamper

GRAVITY, SPEED, WHEEL_MASS, DURATION = 9.81, 20.0, 40.0, 600.0

body_mass = uqmbd.RandomVariable("body_mass", chaospy.Uniform(260, 380), units="kg")
stiffness = uqmbd.RandomVariable("stiffness", chaospy.Normal(20e3, 1e3), units="N/m")
damping = uqmbd.RandomVariable("damping", chaospy.Uniform(900, 1500), units="N s/m")
tyre_stiffness = uqmbd.RandomVariable("tyre_stiffness", chaospy.Normal(180e3, 12e3), units="N/m")

road = RandomProcess("road", psd=iso8608("C", band=(0.01, 10.0)), over="distance", units="m")
height = road(SPEED * uqmbd.t)

car = uqmbd.Mechanism("quarter_car", uqmbd.Line(gravity=-GRAVITY))
wheel = car.body("wheel", mass=WHEEL_MASS, position=0.3)
body = car.body("body", mass=body_mass, position=0.8)
car.add(SpringDamper("suspension", wheel, body, 0, 0, stiffness=stiffness, damping=damping, free_length=0.65))
tyre = car.add(RadialTyre("tyre", car.ground, wheel, 0, road=height, radius=0.32, stiffness=tyre_stiffness))

static_load = (body_mass + WHEEL_MASS) * GRAVITY
acceleration, force = body.acceleration[0], tyre.reaction_force[0]
travel = body.position[0] - wheel.position[0]
travel_maximum = expected_maximum(travel, DURATION) - uqmbd.at_equilibrium(travel)

car.output("comfort", stationary_std(acceleration), units="m/s^2")
car.output("load_variation", stationary_std(force) / static_load, units="1")
car.output("lift_offs", 60 * crossing_rate(force, 0.0), units="1")
car.output("largest_travel", 1000 * travel_maximum, units="mm")
car.require("comfortable", stationary_std(acceleration) <= 1.5)
car.require("contact", sympy.log(60 * crossing_rate(force, 0.0)) <= 0, description="at most one lift-off a minute")

study = uqmbd.Study(
    "quarter_car",
    car,
    propagators=[MonteCarlo(samples=2000, seed=1), Collocation(order=4)],
)
