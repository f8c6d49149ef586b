"""Small mechanisms with known moments: closed forms, and a quadrature of an independently integrated motion."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache, cached_property
from typing import Any

import numpy as np
import sympy

from uqmbd.mechanism import Mechanism, Planar, Translational
from uqmbd.propagation import Study
from uqmbd.randomness import uniform_variable
from uqmbd.testing.solutions.parts import Pin, Rod, Spring
from uqmbd.typing import Array

__all__ = ["CASES", "ReferenceSolution", "certain", "fragile"]


RTOL = 1e-8
"""Tolerance of the integration: its error must be negligible compared with the error of a method."""

GRAVITY = 9.81

POPULATION = 22_500
"""Number of grid points for the reference distributions: 150 by 150 for two inputs."""


@dataclass(frozen=True, eq=False)
class ReferenceSolution:
    """Study with known moments and outputs."""

    study: Study  # study without propagators
    mean: Array  # (output, time) exact
    std: Array  # (output, time) exact
    exact: Callable[[Array], Array]  # maps inputs (K, input), in the order of the study, to outputs (K, output, time)
    sobol_first: Array | None = None  # (input, output, time) first-order Sobol' indices; NaN without variance

    @cached_property
    def population(self) -> Array:
        """Return outputs (N, output, time) at a regular grid of equally probable values of the inputs."""
        joint = self.study.mechanism.inputs
        side = round(POPULATION ** (1 / len(joint)))
        middle = (np.arange(side) + 0.5) / side
        grid = np.stack(np.meshgrid(*[middle] * len(joint), indexing="ij"), axis=-1).reshape(-1, len(joint))
        return self.exact(joint.from_uniform(grid))


@cache
def stone() -> ReferenceSolution:
    """Return a stone thrown upwards with random speed and gravity: ``z = v t - g t^2 / 2``, linear in both.

    >>> print(stone().mean[0, -1].round(6), stone().std[0, -1].round(6))  # 3 - 9.81 / 2; sqrt(0.2^2 / 3 + 0.25^2 / 3)
    -1.905 0.184842
    """
    speed = uniform_variable("launch speed", 2.8, 3.2, "m/s")
    pull = uniform_variable("gravity", GRAVITY - 0.5, GRAVITY + 0.5, "m/s^2")
    mechanism = Mechanism("stone", Translational(gravity=(0, -pull)))
    body = mechanism.body("stone", mass=2, velocity=(0, speed))
    mechanism.output("height of the stone", body.position[1], units="m")
    mechanism.output("rise", body.velocity[1], units="m/s")
    t = np.linspace(0, 1, 6)
    variances = np.array([0.5, 0.2])[:, None, None] ** 2 / 3  # in the order of the names: gravity, launch speed
    parts = variances * np.array([[t**2 / 2, t], [t, t**0]]) ** 2
    total = parts.sum(axis=0)
    mean = np.array([3 * t - GRAVITY * t**2 / 2, 3 - GRAVITY * t])
    first = parts / np.where(total > 0, total, np.nan)

    def exact(values: Array) -> Array:
        g, v = values.T[:, :, None]
        return np.stack([v * t - g * t**2 / 2, v - g * t], axis=1)

    return ReferenceSolution(Study("stone", mechanism, t, rtol=RTOL), mean, np.sqrt(total), exact, first)


@cache
def oscillator() -> ReferenceSolution:
    """Return 1 kg released at 1 m on a spring of random stiffness k: ``x = cos(sqrt(k) t)``.

    The moments are closed-form integrals over ``sqrt(k)``.

    >>> print(f"{oscillator().mean[0, -1]:.12f} {oscillator().std[0, -1] ** 2:.12f}")  # at 1 s
    -0.711691650930 0.086589399409
    """
    low, high = 80.0, 120.0
    stiffness = uniform_variable("stiffness", low, high, "N/m")
    mechanism = Mechanism("oscillator", Translational())
    mass = mechanism.body("mass", mass=1, position=(1, 0))
    mechanism.add(Spring("spring", mechanism.ground, mass, stiffness=stiffness))
    mechanism.output("x", mass.position[0], units="m")
    t = np.linspace(0, 1, 5)

    def expected_cosine(time: Array) -> Array:
        """Return E[cos(w t)] for uniform w^2."""
        w = np.sqrt([[low], [high]]) * time
        lower, upper = 2 * (w * np.sin(w) + np.cos(w)) / (high - low)
        return np.where(time > 0, (upper - lower) / np.where(time > 0, time, 1.0) ** 2, 1.0)

    mean = expected_cosine(t)
    square = (1 + expected_cosine(2 * t)) / 2
    std = np.sqrt(np.maximum(square - mean**2, 0) * (t > 0))
    study = Study("oscillator", mechanism, t, rtol=RTOL)
    return ReferenceSolution(study, mean[None], std[None], lambda k: np.cos(np.sqrt(k[:, :, None]) * t))


@cache
def pendulum() -> ReferenceSolution:
    """Return a rod of random length and spin, pinned at one end: ``angle'' = -3 g cos(angle) / (2 length)``.

    The moments are a Gauss quadrature (12 x 12 nodes) of this equation, integrated by SciPy.

    >>> bool((pendulum().std[:, 1:] > 0.01).all())
    True
    """
    from scipy.integrate import solve_ivp

    length = uniform_variable("length", 0.9, 1.1, "m")
    spin = uniform_variable("spin", -0.5, 0.5, "rad/s")
    mechanism = Mechanism("pendulum", Planar(gravity=(0, -GRAVITY)))
    rod = mechanism.body(
        "rod", mass=2, inertia=2 * length**2 / 12, position=(length / 2, 0), angle=0, angular_velocity=spin
    )
    mechanism.add(Pin("pin", mechanism.ground, rod, point=(-length / 2, 0)))
    mechanism.output("angle", rod.angle, units="rad")
    mechanism.output("tip", rod.point((length / 2, 0))[0], units="m")
    t = np.linspace(0, 0.6, 5)
    nodes, weights = np.polynomial.legendre.leggauss(12)
    weight = np.outer(weights, weights).ravel() / 4

    def exact(values: Array) -> Array:
        a, w = values.T

        def rates(_: float, y: Array) -> Array:
            return np.concatenate([y[len(a) :], -1.5 * GRAVITY / a * np.cos(y[: len(a)])])

        found = solve_ivp(rates, (0, t[-1]), np.concatenate([0 * a, w]), "DOP853", t, rtol=1e-10, atol=1e-12)
        angle = found.y[: len(a)]
        return np.stack([angle, a[:, None] * np.cos(angle)], axis=1)

    grid = np.stack(np.meshgrid(1 + 0.1 * nodes, 0.5 * nodes, indexing="ij"), axis=-1).reshape(-1, 2)
    outputs = exact(grid)
    mean = np.einsum("k,kot->ot", weight, outputs)
    variance = np.einsum("k,kot->ot", weight, (outputs - mean) ** 2)
    study = Study("pendulum", mechanism, t, rtol=RTOL)
    return ReferenceSolution(study, mean, np.sqrt(variance), exact)


CASES: dict[str, Callable[[], ReferenceSolution]] = {"stone": stone, "oscillator": oscillator, "pendulum": pendulum}
"""Functions that return reference solutions, by name."""


@cache
def fragile(shortest: float, longest: float) -> Study:
    """Return a study of a bob between two equal rods of random length from posts 1.8 m apart.

    Rods shorter than 0.9 m do not reach each other: these realisations cannot be assembled.
    """
    length = uniform_variable("length", shortest, longest, "m")
    mechanism = Mechanism("fragile", Translational())
    bob = mechanism.body("bob", mass=1, position=(0, sympy.Rational(1, 2)))
    for name, x in (("left", -0.9), ("right", 0.9)):
        mechanism.add(Rod(name, mechanism.ground, bob, post=(x, 0), length=length))
    mechanism.output("y", bob.position[1], units="m")
    return Study("fragile", mechanism, [0, 0.05, 0.1])


@cache
def certain() -> Study:
    """Return a study without random inputs."""
    mechanism = Mechanism("certain", Translational(gravity=(0, -GRAVITY)))
    stone: Any = mechanism.body("stone", mass=1)
    mechanism.output("height", stone.position[1], units="m")
    return Study("certain", mechanism, [0, 0.1])
