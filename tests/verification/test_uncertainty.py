"""Reference case A8: moments by Monte Carlo, within three of its own standard errors."""

from __future__ import annotations

import chaospy
import numpy as np
import pytest
import sympy

import uqmbd
from uqmbd_drivers import RotationDriver
from uqmbd_joints import Prismatic, Revolute
from uqmbd_montecarlo import MonteCarlo
from uqmbd_springs import SpringDamper


def oscillator():
    """Mass 1 kg at 1 m on a spring k ~ U(80, 120)."""
    stiffness = uqmbd.RandomVariable("stiffness", chaospy.Uniform(80, 120), units="N/m")
    mechanism = uqmbd.Mechanism("oscillator", uqmbd.Translational())
    mass = mechanism.body("mass", mass=1, position=(1, 0))
    mechanism.add(SpringDamper("spring", mechanism.ground, mass, (0, 0), (0, 0), stiffness))
    mechanism.output("x", mass.position[0], units="m")
    return mechanism, lambda k, t: np.cos(np.sqrt(k[:, :1]) * t)


def free_fall():
    """z = v0 t - g t^2/2 with v0 ~ N(3, .2), g ~ N(9.81, .05): gravity itself is random."""
    g = uqmbd.RandomVariable("g", chaospy.Normal(9.81, 0.05), units="m/s^2")
    v0 = uqmbd.RandomVariable("v0", chaospy.Normal(3, 0.2), units="m/s")
    mechanism = uqmbd.Mechanism("fall", uqmbd.Translational(gravity=(0, -g)))
    stone = mechanism.body("stone", mass=2, velocity=(0, v0))
    mechanism.output("z", stone.position[1], units="m")
    return mechanism, lambda x, t: x[:, 1:] * t - x[:, :1] * t**2 / 2


def slider_at_sixty_degrees():
    """Slider x at a crank angle of 60 degrees, L1 ~ U(.145, .155), L2 ~ U(.29, .31)."""
    l1 = uqmbd.RandomVariable("L1", chaospy.Uniform(0.145, 0.155), units="m")
    l2 = uqmbd.RandomVariable("L2", chaospy.Uniform(0.29, 0.31), units="m")
    mechanism = uqmbd.Mechanism("slider_crank", uqmbd.Planar())
    angle = sympy.pi / 3
    crank = mechanism.body("crank", mass=1, inertia=0.01, angle=angle)
    pin = (l1 * sympy.cos(angle), l1 * sympy.sin(angle))
    rod = mechanism.body("rod", mass=1, inertia=0.01, position=pin, angle=-0.4)  # drawn a little off
    slider = mechanism.body("slider", mass=1, inertia=0.01, position=(0.35, 0))
    mechanism.add(Revolute("A", mechanism.ground, crank, (0, 0), (0, 0)))
    mechanism.add(Revolute("B", crank, rod, (l1, 0), (0, 0)))
    mechanism.add(Revolute("C", rod, slider, (l2, 0), (0, 0)))
    mechanism.add(Prismatic("D", mechanism.ground, slider, (0, 0), (0, 0), (1, 0), (1, 0)))
    mechanism.add(RotationDriver("crank_at", mechanism.ground, crank, angle))
    mechanism.output("x", slider.position[0], units="m")
    sine, cosine = np.sin(np.pi / 3), np.cos(np.pi / 3)
    return mechanism, lambda x, t: x[:, :1] * cosine + np.sqrt(x[:, 1:] ** 2 - (x[:, :1] * sine) ** 2) + 0 * t


CASES = {  # times, means, variances: cases.md A8
    oscillator: (
        [0.5, 1, 2],
        [0.2644520399492786, -0.7116916509296296, 0.18618881082400723],
        [0.07421929310185037, 0.08658939940906185, 0.5086903539093101],
    ),
    free_fall: ([1], [-1.905], [0.040625]),
    slider_at_sixty_degrees: ([0.01], [0.3453878667209021], [4.109886029978457e-05]),
}


@pytest.fixture(scope="module", params=CASES, ids=lambda f: f.__name__)
def propagated(request):
    """Node of a Monte Carlo of 1000 samples, with the closed form and the published moments."""
    mechanism, exact = request.param()
    times, mean, variance = CASES[request.param]
    study = uqmbd.Study("case", mechanism, [0, *times], [MonteCarlo(samples=1000, seed=11)], rtol=1e-6)
    return study.propagate(study.propagators[0]), exact, np.array(times), np.array(mean), np.array(variance)


@pytest.mark.thorough
def test_moments_are_within_three_standard_errors(propagated):
    node, _, times, mean, variance = propagated
    found = node["statistics"].isel(output=0).sel(time=times)
    assert (np.abs(found["mean"] - mean) < 3 * found["std_error_mean"]).all()
    assert (np.abs(found["std"] - np.sqrt(variance)) < 3 * found["std_error_std"]).all()
    # the standard errors are what they should be: not so wide that anything would pass
    np.testing.assert_allclose(found["std_error_mean"], np.sqrt(variance / 1000), rtol=0.15)
    assert (found["std_error_std"] < 2 * np.sqrt(variance / 2000)).all()


def test_every_sample_is_the_closed_form_of_its_inputs(propagated):
    node, exact, times, *_ = propagated
    samples = node["samples"]
    assert int(samples["status"].sum()) == 0
    expected = exact(samples["inputs"].values, times)
    np.testing.assert_allclose(
        samples["response"].isel(output=0).sel(time=times), expected, rtol=0, atol=1e-4 * np.abs(expected).max()
    )
