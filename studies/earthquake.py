"""A frame with a pendulum absorber in an earthquake: storey drift, first passage and the effect of the absorber.

Three storeys stand on firm ground whose acceleration has the spectrum of Kanai and Tajimi: 15.6 rad/s, damping ratio
0.6, standard deviation 0.4 m/s^2.  Its peak in 20 s is about 0.12 g.  Coordinates are relative to the ground, so its
acceleration acts as horizontal gravity.  Below the roof hangs a pendulum with 4 % of the mass of the frame, tuned to
the first mode of the frame (0.5 Hz).

The study propagates the stationary response of the linearised frame: the standard deviations of the drift of the first
storey and of the angle of the pendulum, and the largest drift in 20 s.  Uncertain are the damping ratio and the
stiffness of the frame, the intensity of the motion and the damper of the pendulum.

An earthquake is shorter than the build-up of the stationary response, and the pendulum is not linear.
``python studies/earthquake.py`` therefore integrates the frame from rest on 400 sampled motions of 20 s by Monte Carlo.
It prints the results next to those of the stationary response:

| frame | largest drift, mm | if stationary | probability of exceeding the limit (95 %) | if stationary |
|---|---|---|---|---|
| without absorber | 64.7 | 89.1 | 51.5 % (46.5 to 56.5 %) | 85.9 % |
| with absorber | 49.0 | 53.4 | 20.0 % (16.2 to 24.3 %) | 28.7 % |

The stationary response is on the safe side: crossings come in groups, and the response of the frame without the
absorber builds up for longer than 20 s.

Storeys of 400 t, 20 MN/m and 4 m; the limit of the drift is 1.5 % of the height.  The sampled motions end at 10 Hz,
because the default `cutoff` of this spectrum is 1.1 kHz.
"""

import chaospy
import numpy as np
import sympy

import uqmbd
from uqmbd_collocation import Collocation
from uqmbd_joints import Prismatic, Revolute
from uqmbd_montecarlo import MonteCarlo
from uqmbd_processes import RandomProcess, crossing_rate, expected_maximum, kanai_tajimi, stationary_std
from uqmbd_springs import Gravity, SlidingSpringDamper, TorsionSpringDamper

STOREYS, MASS, STIFFNESS, HEIGHT = 3, 400e3, 20e6, 4.0
FIRST = 2 * np.sin(np.pi / 14) * np.sqrt(STIFFNESS / MASS)
"""Angular frequency of the first mode of three equal storeys, rad/s."""
RATIO, GRAVITY, DURATION, LIMIT = 0.04, 9.81, 20.0, 0.015 * HEIGHT
BOB, LENGTH = RATIO * STOREYS * MASS, GRAVITY / FIRST**2

DENSITY = 0.4**2 * 2 * 0.6 / (np.pi * 15.6 * (1 + 4 * 0.6**2))
"""Density of the acceleration of the rock for a standard deviation of 0.4 m/s^2 at the ground, m^2/s^3."""
ground = RandomProcess("ground", psd=kanai_tajimi(DENSITY, 15.6, 0.6), cutoff=10.0)

damping_ratio = uqmbd.RandomVariable("damping_ratio", chaospy.Uniform(0.01, 0.04), units="1")
stiffness = uqmbd.RandomVariable("stiffness", chaospy.Normal(STIFFNESS, 0.08 * STIFFNESS), units="N/m")
intensity = uqmbd.RandomVariable("intensity", chaospy.Uniform(0.7, 1.3), units="1")
absorber_ratio = uqmbd.RandomVariable("absorber_ratio", chaospy.Uniform(0.05, 0.15), units="1")


def frame(absorber=True):
    """Return the frame and the drift of its first storey (m)."""
    mechanism = uqmbd.Mechanism("frame", uqmbd.Planar(gravity=(0.0, -GRAVITY)))
    shaking, damping = (-intensity * ground(), 0), 2 * damping_ratio * stiffness / FIRST
    places = [(0, HEIGHT * (k + 1)) for k in range(STOREYS)]
    floors = [
        mechanism.body(f"floor_{k + 1}", mass=MASS, inertia=1e6, position=place) for k, place in enumerate(places)
    ]
    for k, (below, floor) in enumerate(zip([mechanism.ground, *floors[:-1]], floors, strict=True), 1):
        guide = Prismatic(f"guide_{k}", mechanism.ground, floor, places[k - 1], (0, 0), axis_i=(1, 0), axis_j=(1, 0))
        mechanism.add(guide)
        mechanism.add(SlidingSpringDamper(f"storey_{k}", below, floor, (0, HEIGHT), (0, 0), (1, 0), stiffness, damping))
        mechanism.add(Gravity(f"shaking_{k}", floor, shaking))
    if absorber:
        bob = mechanism.body("bob", mass=BOB, inertia=1.0, position=(0, HEIGHT * STOREYS - LENGTH))
        mechanism.add(Revolute("hinge", floors[-1], bob, (0, 0), (0, LENGTH)))
        friction = 2 * absorber_ratio * FIRST * BOB * LENGTH**2
        mechanism.add(TorsionSpringDamper("damper", floors[-1], bob, stiffness=0, damping=friction))
        mechanism.add(Gravity("shaking_bob", bob, shaking))
    return mechanism, floors[0].position[0]


def largest_drift(drift):
    """Return the expected maximum of the absolute drift (m): it has twice as many crossings as the drift."""
    return expected_maximum(drift, 2 * DURATION, rule="poisson")


def passage_probability(drift):
    """Return the probability that a stationary drift exceeds the limit on either side, for independent crossings."""
    return 1 - sympy.exp(-2 * DURATION * crossing_rate(drift, LIMIT))


mechanism, drift = frame()
mechanism.output("drift", 1000 * stationary_std(drift), units="mm")
mechanism.output("largest_drift", 1000 * largest_drift(drift), units="mm")
mechanism.output("pendulum", stationary_std(mechanism.bodies["bob"].angle), units="rad")
mechanism.require("drift_limit", largest_drift(drift) <= LIMIT, "expected largest drift in 20 s at most 60 mm")

study = uqmbd.Study(
    "earthquake",
    mechanism,
    propagators=[MonteCarlo(samples=1000, seed=1), Collocation(adaptive="dimension", tolerance=1e-3)],
)


def main():
    """Print results of 20 s on sampled motions, and of the stationary response, with and without the absorber."""
    print("frame | largest drift, mm | and if stationary | probability of exceeding the limit | and if stationary")
    for absorber in (False, True):
        shaken, moved = frame(absorber)
        shaken.output("largest", 1000 * uqmbd.maximum(sympy.Abs(moved)), units="mm")
        shaken.output("expected", 1000 * largest_drift(moved), units="mm")
        shaken.output("passage", passage_probability(moved), units="1")
        shaken.require("limit", sympy.Abs(moved) <= LIMIT)
        method = MonteCarlo(samples=400, seed=1)
        tree = uqmbd.Study("sampled", shaken, [0, DURATION], [method], start="equilibrium").run()["monte-carlo"]
        means = tree["scalars/statistics"].to_dataset()["mean"].sel
        counted = tree["requirements"].to_dataset().sel(requirement="limit")
        low, high = 100 * counted["interval"].values
        print(
            "with absorber" if absorber else "without absorber",
            *(f"{float(means(output=name)):.1f}" for name in ("largest", "expected")),
            f"{100 * float(counted['violation_probability']):.1f} % ({low:.1f} to {high:.1f} %)",
            f"{100 * float(means(output='passage')):.1f} %",
            sep=" | ",
        )


if __name__ == "__main__":
    main()
