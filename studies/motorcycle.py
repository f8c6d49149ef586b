"""A motorcycle with uncertain suspension stiffnesses crosses a bump: Galerkin projection of springs with a free length.

The planar model after Sharp has five bodies: frame with rider, upper fork, lower fork with front wheel, swing arm with
rear wheel, and the rocker of the rear suspension.  A rod of fixed length connects the rocker to the swing arm.  The
shock between frame and rocker has a non-zero free length.  The motorcycle rides at 4.4704 m/s.  Both wheel centres
follow the road, which has a haversine bump of 0.3048 m by 0.0508 m; the rear wheel follows later by the wheelbase.

The motion starts with the suspension at rest.  The free lengths are fixed: that of the shock is given, and that of the
front spring balances the drawn machine at the mean stiffness.  Both stiffnesses are normal with a standard deviation of
a thirtieth of their mean.  Each realisation starts from its static equilibrium.

The centres of mass of swing arm (0.25, 0.2578) m and rocker (0.4946, 0.1522) m are reconstructed, because the printed
data contradict themselves.  Two assumptions complete the model.  The front spring acts on the fork axis, which passes
through `p2` with the rake 0.4412 rad.  The bump begins at the front wheel at 0.1 s.
"""

import chaospy
import numpy as np
import sympy

import uqmbd
from uqmbd_collocation import Collocation
from uqmbd_drivers import PositionDriver
from uqmbd_galerkin import Galerkin
from uqmbd_joints import Distance, Fixed, Prismatic, Revolute
from uqmbd_montecarlo import MonteCarlo
from uqmbd_springs import SpringDamper, haversine_bump

GRAVITY, SPEED, WHEELBASE = 9.81, 4.4704, 1.41
BUMP_LENGTH, BUMP_HEIGHT, BUMP_START = 0.3048, 0.0508, 0.1

p2, p5, p7 = (1.173, 0.749), (1.41, 0.282), (0.0, 0.297)
p11, p13, p18 = (0.549, 0.3608), (0.487, 0.4888), (0.539, 0.1878)
p20, p21, p22 = (0.4946, 0.1522), (0.4443, 0.1782), (0.3722, 0.2748)
RAKE = 0.4412
fork_axis = (np.sin(RAKE), -np.cos(RAKE))
fork_length = float(np.dot(np.subtract(p5, p2), fork_axis))
foot = tuple(np.add(p2, fork_length * np.array(fork_axis)))

front_stiffness = uqmbd.RandomVariable("front_stiffness", chaospy.Normal(25000, 833.3), units="N/m")
rear_stiffness = uqmbd.RandomVariable("rear_stiffness", chaospy.Normal(58570, 1952), units="N/m")
FRONT_DAMPING, REAR_DAMPING, SHOCK_FREE_LENGTH = 2134, 11650, 0.3435

# name: centre of mass (m), mass (kg), inertia (kg m^2)
parts = {
    "frame": ((0.6334, 0.5855), 198.81, 37.7614),
    "upper_fork": ((1.1640, 0.7700), 9.99, 1.5840),
    "lower_fork": ((1.3930, 0.2979), 19.15, 0.5011),
    "swing_arm": ((0.25, 0.2578), 26.60, 1.1439),
    "rocker": ((0.4946, 0.1522), 0.001, 0.001),
}

mechanism = uqmbd.Mechanism("motorcycle", uqmbd.Planar(gravity=(0.0, -GRAVITY)))
ground = mechanism.ground
bodies = {
    name: mechanism.body(name, mass=mass, inertia=inertia, position=centre, velocity=(SPEED, 0), angular_velocity=0)
    for name, (centre, mass, inertia) in parts.items()
}
frame, upper_fork, lower_fork, swing_arm, rocker = bodies.values()


def on(name, point):
    """Return a point of the drawing in the frame of a body."""
    centre = parts[name][0]
    return (point[0] - centre[0], point[1] - centre[1])


mechanism.add(Fixed("steering_head", frame, upper_fork, on("frame", p2), on("upper_fork", p2)))
mechanism.add(
    Prismatic("fork", upper_fork, lower_fork, on("upper_fork", p2), on("lower_fork", foot), fork_axis, fork_axis)
)
mechanism.add(Revolute("swing_arm_pivot", frame, swing_arm, on("frame", p11), on("swing_arm", p11)))
mechanism.add(Revolute("rocker_pivot", frame, rocker, on("frame", p18), on("rocker", p18)))
rod_length = float(np.hypot(*np.subtract(p20, p22)))
mechanism.add(Distance("rod", rocker, swing_arm, on("rocker", p20), on("swing_arm", p22), length=rod_length))

# the front spring balances the drawn machine: its load is that of the front wheel less the parts below the spring
weights = {name: GRAVITY * mass for name, (_, mass, _) in parts.items()}
front_load = sum(weights[name] * centre[0] for name, (centre, *_) in parts.items()) / WHEELBASE
front_free_length = fork_length + (front_load - weights["lower_fork"]) * np.cos(RAKE) / 25000
mechanism.add(
    SpringDamper(
        "front_spring", upper_fork, lower_fork, on("upper_fork", p2), on("lower_fork", foot),
        stiffness=front_stiffness, damping=FRONT_DAMPING, free_length=front_free_length,
    )
)  # fmt: skip
mechanism.add(
    SpringDamper(
        "shock", frame, rocker, on("frame", p13), on("rocker", p21),
        stiffness=rear_stiffness, damping=REAR_DAMPING, free_length=SHOCK_FREE_LENGTH,
    )
)  # fmt: skip

travelled = SPEED * uqmbd.t
start = SPEED * BUMP_START
centre = parts["frame"][0]
mechanism.add(PositionDriver("speed", ground, frame, centre, (0, 0), (1, 0), displacement=travelled))
for name, body, point, delay in (("front", "lower_fork", p5, 0), ("rear", "swing_arm", p7, WHEELBASE)):
    road = haversine_bump(BUMP_HEIGHT, BUMP_LENGTH, start=start + delay, along=travelled)
    wheel = on(body, point)
    mechanism.add(PositionDriver(f"{name}_wheel", ground, bodies[body], point, wheel, (0, 1), displacement=road))

upper, lower = on("frame", p13), on("rocker", p21)
across = [a - b for a, b in zip(frame.point(upper), rocker.point(lower), strict=True)]
rate = [a - b for a, b in zip(frame.point_velocity(upper), rocker.point_velocity(lower), strict=True)]
shock_length = sympy.sqrt(sum(x**2 for x in across))
shock_rate = sum(x * v for x, v in zip(across, rate, strict=True)) / shock_length

mechanism.output("frame_height", frame.position[1], units="m")
mechanism.output("pitch", frame.angle, units="rad")
mechanism.output("shock_length", shock_length, units="m")
mechanism.output(
    "shock_force", rear_stiffness * (SHOCK_FREE_LENGTH - shock_length) - REAR_DAMPING * shock_rate, units="N"
)

study = uqmbd.Study(
    "motorcycle",
    mechanism,
    times=np.linspace(0, 1.5, 301),
    propagators=[MonteCarlo(samples=500, seed=1), Collocation(order=2), Galerkin(order=2)],
    start="equilibrium",
    rtol=1e-8,  # a micrometre in the shock is 0.06 N, a hundredth of the force's standard deviation
)
