"""Small mechanisms with closed-form motions, as references for integrators."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache
from typing import Any

import numpy as np
import sympy

from uqmbd.dynamics import Ensemble, Model, build
from uqmbd.mechanism import Controller, Mechanism, Planar, Translational, t
from uqmbd.randomness import uniform_variable
from uqmbd.testing.solutions.parts import Floor, Pin, Push, Spring, Strip
from uqmbd.typing import Array

__all__ = ["ACCURACY", "ClosedForm", "ball", "fading", "impacts", "oscillator", "pendulum", "pulse", "stone", "strip"]


GRAVITY = 9.81
BOUNCE = 0.8
"""Coefficient of restitution."""
MARK = 0.3
"""Height of the marker of the falling ball, m."""
SAMPLES, GAIN = 7.0, 2.0
"""Samples per second of the controller that drives the ball, and the gain of the controller in N s/m."""


@dataclass(frozen=True, eq=False)
class ClosedForm:
    """Mechanism with one random number, and its exact motion."""

    name: str  # name in messages
    model: Model  # compiled model
    times: Array  # (T,) times, s
    values: Array  # (K,) values of the random number
    exact: Callable[[Array, Array], Array]  # maps values (K, 1) and times (T,) to outputs (K, output, T)

    def ensemble(self, values: Array | None = None) -> Ensemble:
        """Return realisations of given values, by default the values of the case."""
        return Ensemble(self.model, np.asarray(self.values if values is None else values, dtype=float)[:, None])

    def expected(self, values: Array | None = None, times: Array | None = None) -> Array:
        """Return the outputs, shape (K, output, T)."""
        return self.exact((self.values if values is None else values)[:, None], self.times if times is None else times)


def _form(mechanism: Mechanism, times: Any, values: Any, exact: Callable[[Array, Array], Any]) -> ClosedForm:
    times = np.array(times, dtype=float)
    times.setflags(write=False)

    def stacked(x: Array, at: Array) -> Array:
        return np.stack(np.broadcast_arrays(*exact(x, at)), axis=1)

    model = build(mechanism, float(times[0]))
    return ClosedForm(mechanism.name, model, times, np.array(values, dtype=float), stacked)


@cache
def stone() -> ClosedForm:
    """Return a stone that is thrown at 0.25 s, with a time-dependent lateral force.

    >>> print(stone().expected()[:, 0, -1])
    [-2.2340625 -2.0465625 -1.6715625]
    """
    speed = uniform_variable("speed", 0, 10, "m/s")
    mechanism = Mechanism("stone", Translational(gravity=(0, -GRAVITY)))
    body = mechanism.body("stone", mass=2, velocity=(0, speed))
    mechanism.add(Push("push", body, force=12 * sympy.sin(3 * t)))
    mechanism.output("y", body.position[1], units="m")
    mechanism.output("rate of x", body.velocity[0], units="m/s")
    begin = 0.25

    def exact(v: Array, at: Array) -> tuple[Array, ...]:
        flight = at - begin
        return v * flight - GRAVITY * flight**2 / 2, 0 * v + 2 * (np.cos(3 * begin) - np.cos(3 * at))

    return _form(mechanism, [begin, 0.3, 0.61, 0.62, 1.0], [0.7, 0.95, 1.45], exact)


@cache
def oscillator() -> ClosedForm:
    """Return a mass of 1 kg that is released at 1 m on a spring of random stiffness."""
    stiffness = uniform_variable("stiffness", 50, 150, "N/m")
    mechanism = Mechanism("oscillator", Translational())
    mass = mechanism.body("mass", mass=1, position=(1, 0))
    mechanism.add(Spring("spring", mechanism.ground, mass, stiffness=stiffness))
    mechanism.output("x", mass.position[0], units="m")
    mechanism.output("rate of x", mass.velocity[0], units="m/s")

    def exact(k: Array, at: Array) -> tuple[Array, ...]:
        w = np.sqrt(k)
        return np.cos(w * at), -w * np.sin(w * at)

    return _form(mechanism, [0, 0.1, 0.13, 0.5, 0.77, 1.0], [60.0, 100.0, 140.0], exact)


@cache
def pendulum() -> ClosedForm:
    """Return a rod of random length, pinned at one end and released from the horizontal: Jacobi's elliptic functions.

    With ``k = sin(pi / 4)`` the angle from the vertical is ``2 arcsin(k cd(w t, k^2))``, ``w^2 = 3 g / (2 length)``.

    >>> bool(np.allclose(pendulum().expected()[:, 0, 0], 0))
    True
    """
    from scipy.special import ellipj

    length = uniform_variable("length", 0.5, 1.5, "m")
    mechanism = Mechanism("pendulum", Planar(gravity=(0, -GRAVITY)))
    rod = mechanism.body("rod", mass=2, inertia=2 * length**2 / 12, position=(length / 2, 0), angle=0)
    mechanism.add(Pin("pin", mechanism.ground, rod, point=(-length / 2, 0)))
    mechanism.output("angle", rod.angle, units="rad")
    mechanism.output("height", rod.position[1], units="m")

    def exact(size: Array, at: Array) -> tuple[Array, ...]:
        sn, cn, dn, _ = ellipj(np.sqrt(1.5 * GRAVITY / size) * at, 0.5)
        angle = 2 * np.arcsin(np.sqrt(0.5) * cn / dn) - np.pi / 2
        return angle, size / 2 * np.sin(angle)

    return _form(mechanism, [0, 0.2, 0.45, 0.5, 1.0], [0.6, 1.0, 1.4], exact)


@cache
def fading() -> ClosedForm:
    """Return bodies with a force that is undefined after some time: ``F = 1.5 sqrt(end - t)``."""
    end = uniform_variable("end", 0.1, 5, "s")
    mechanism = Mechanism("fading", Translational())
    body = mechanism.body("body", mass=1)
    mechanism.add(Push("push", body, force=1.5 * sympy.sqrt(end - t)))
    mechanism.output("speed", body.velocity[0], units="m/s")

    def exact(a: Array, at: Array) -> tuple[Array, ...]:
        return (np.where(at <= a, a**1.5 - np.maximum(a - at, 0) ** 1.5, np.nan),)

    return _form(mechanism, [0, 0.2, 0.3, 0.7, 1.0], [1.5, 0.5, 3.0], exact)


@cache
def ball() -> ClosedForm:
    """Return a ball that bounces on a floor with 0.8 of its speed; from the largest height it does not reach the floor.

    >>> print(impacts(np.array([1.0]), 2.5)[0].round(6))
    [0.451524 1.173961 1.751912 2.214272]
    """
    height = uniform_variable("height", 0.5, 50, "m")
    mechanism = Mechanism("ball", Translational(gravity=(0, -GRAVITY)))
    body = mechanism.body("ball", mass=1, position=(0, height))
    mechanism.add(Floor("floor", body, restitution=BOUNCE, mark=MARK))
    mechanism.output("height", body.position[1], units="m")

    def exact(h: Array, at: Array) -> tuple[Array, ...]:
        begins = impacts(h[:, 0], float(at[-1]))
        y = h - GRAVITY * at**2 / 2
        for k in range(begins.shape[1]):
            flight, speed = at - begins[:, k, None], BOUNCE ** (k + 1) * np.sqrt(2 * GRAVITY * h)
            y = np.where(flight >= 0, speed * flight - GRAVITY * flight**2 / 2, y)
        return (y,)

    return _form(mechanism, [0, 0.3, 0.5, 0.9, 1.2, 1.7, 2.0], [0.9, 1.0, 25.0, 1.1], exact)


@cache
def driven_ball(floor: bool = True) -> ClosedForm:
    """Return the ball of `ball`, driven horizontally by a sampled controller; without `floor`, the ball falls freely.

    Impacts do not affect the controller.
    """
    height = uniform_variable("height", 0.5, 50, "m")
    mechanism = Mechanism("driven ball" if floor else "driven body", Translational(gravity=(0, -GRAVITY)))
    body = mechanism.body("ball", mass=1, position=(0, height))
    loop = Controller("loop", measured=[body.velocity[0]], commanded=["force"], rate=SAMPLES, function=_force_command)
    mechanism.add(loop)
    if floor:
        mechanism.add(Floor("floor", body, restitution=BOUNCE, mark=MARK))
    mechanism.add(Push("push", body, force=loop.command()))
    mechanism.output("height", body.position[1], units="m")
    mechanism.output("speed", body.velocity[0], units="m/s")

    def exact(h: Array, at: Array) -> tuple[Array, ...]:
        last = np.floor(at * SAMPLES + 1e-9)
        left = (1 - GAIN / SAMPLES) ** last  # remaining part of the speed difference
        height = ball().exact(h, at)[:, 0] if floor else h - GRAVITY * at**2 / 2
        return height, 1 - left * (1 - GAIN * (at - last / SAMPLES)) + 0 * h

    return _form(mechanism, [0, 0.3, 0.5, 0.9, 1.2, 1.7, 2.0], [0.9, 1.0, 25.0, 1.1], exact)


def _force_command(time: float, measured: Array) -> Array:
    """Return a force command that controls the speed to 1 m/s."""
    return GAIN * (1 - measured)


def impacts(heights: Array, end: float) -> Array:
    """Return the times of the impacts of the ball in s, shape (K, impact); NaN after the last one."""
    first = np.sqrt(2 * heights[:, None] / GRAVITY)
    flights = 2 * BOUNCE ** np.arange(1, 40)
    found: Array = first * np.concatenate([[1.0], 1.0 + np.cumsum(flights)])
    found[found > end] = np.nan
    return found[:, np.isfinite(found).any(axis=0)]


@cache
def pulse(breaks: bool = False) -> ClosedForm:
    """Return a body with a pulse of force of about 1 ms; with `breaks`, with a force that is switched on.

    The intervals of ``Ensemble.pace`` resolve the force.
    """
    size = uniform_variable("size", 0.5, 1.5)
    mechanism = Mechanism("switch" if breaks else "pulse", Translational())
    body = mechanism.body("body", mass=1)
    begin, width = 4.1, 1e-3
    x = (t - begin) / width
    gaussian = sympy.exp(-(x**2) / 2) / (width * sympy.sqrt(2 * sympy.pi))
    force = sympy.Piecewise((0, t < begin), (1, True)) if breaks else gaussian
    mechanism.add(Push("push", body, force=size * force))
    mechanism.output("speed", body.velocity[0], units="m/s")

    def exact(s: Array, at: Array) -> tuple[Array, ...]:
        return (s * (np.maximum(at - begin, 0) if breaks else at > begin),)

    return _form(mechanism, [0, 3.0, 6.0, 10.0], [0.6, 1.0], exact)


@cache
def strip(longest: float = 2e-3) -> ClosedForm:
    """Return a body that crosses a narrow strip, which only short steps resolve."""
    work = uniform_variable("work", 0.5, 1.5, "J")
    mechanism = Mechanism("strip", Translational())
    body = mechanism.body("body", mass=1, velocity=(1, 0))
    mechanism.add(Strip("strip", body, place=0.61, width=longest, work=work))
    mechanism.output("speed", body.velocity[0], units="m/s")

    def exact(w: Array, at: Array) -> tuple[Array, ...]:
        return (np.where(at < 0.61, 1.0, np.sqrt(1 + 2 * w)),)

    form = _form(mechanism, [0, 0.3, 1.0], [0.6, 1.0], exact)
    return replace(form, model=replace(form.model, max_step=longest))


ACCURACY: tuple[Callable[[], ClosedForm], ...] = (stone, oscillator, pendulum)
