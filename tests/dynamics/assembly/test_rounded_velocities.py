"""Stated velocities that were rounded, as printed ones are, give way to the constraints, for every integrator alike."""

from __future__ import annotations

import numpy as np
import pytest

import uqmbd
from uqmbd.dynamics.ensemble import Ensemble
from uqmbd.dynamics.model_building import build
from uqmbd_joints import Prismatic, Revolute, Spherical

INTEGRATORS = ("auto", "dop853", "ida")
TIMES = [0, 0.005, 0.01]


def rounded(x, digits):
    return float(f"{x:.{digits - 1}e}")


def turned(rate, arm):
    return rate * np.array([-arm[1], arm[0]])


def planar(rng, kind, digits):
    """Four-bar or slider-crank with the velocities of its closed form, rounded; at least 0.5 rad from dead centres."""
    while True:
        crank, angle, rate = rng.uniform(0.1, 0.5), rng.uniform(0, 2 * np.pi), rng.uniform(1, 20)
        a = crank * np.array([np.cos(angle), np.sin(angle)])
        if kind == "slider-crank":
            rod = crank * rng.uniform(1.5, 4)
            tilt = -np.arcsin(a[1] / rod)
            b = a + rod * np.array([np.cos(tilt), np.sin(tilt)])
            second = -rate * a[0] / (rod * np.cos(tilt))
            pin = turned(rate, a)
            wrist = pin + turned(second, b - a)
            third, end, ground = 0.0, b, None
            break
        rod, rocker, base = crank * rng.uniform(1, 4, 3)
        ground = np.array([base, 0.0])
        far = np.linalg.norm(ground - a)
        if not 1.1 * abs(rod - rocker) < far < 0.9 * (rod + rocker):
            continue
        along, u = (rod**2 - rocker**2 + far**2) / (2 * far), (ground - a) / far
        b = a + along * u + np.sqrt(rod**2 - along**2) * np.array([-u[1], u[0]])
        pin = turned(rate, a)
        rates = np.array([-turned(1, b - a), turned(1, b - ground)]).T
        second, third = np.linalg.solve(rates, pin)
        wrist, end = turned(third, b - ground), (b + ground) / 2
        if max(abs(second), abs(third)) < 100:
            break
    mechanism = uqmbd.Mechanism(kind, uqmbd.Planar(gravity=(0, -9.81)))
    moving = (
        ("crank", a / 2, np.arctan2(*a[::-1]), pin / 2, rate),
        ("rod", (a + b) / 2, np.arctan2(*(b - a)[::-1]), (pin + wrist) / 2, second),
        ("last", end, 0.0, wrist if ground is None else wrist / 2, third),
    )
    bodies = [
        mechanism.body(
            name,
            mass=1,
            inertia=0.01,
            position=tuple(at),
            angle=float(turn),
            velocity=tuple(rounded(x, digits) for x in velocity),
            angular_velocity=rounded(spin, digits),
        )
        for name, at, turn, velocity, spin in moving
    ]
    mechanism.add(Revolute("O", mechanism.ground, bodies[0], at=(0, 0)))
    mechanism.add(Revolute("A", bodies[0], bodies[1], at=tuple(a)))
    mechanism.add(Revolute("B", bodies[1], bodies[2], at=tuple(b)))
    if ground is None:
        mechanism.add(Prismatic("guide", mechanism.ground, bodies[2], at=tuple(b), axis=(1, 0)))
    else:
        mechanism.add(Revolute("G", mechanism.ground, bodies[2], at=tuple(ground)))
    mechanism.output("x", bodies[1].position[0], units="m")
    return mechanism


def spatial(rng, digits):
    """Crank, coupler on ball joints that spins, rocker."""

    def unit():
        x = rng.normal(size=3)
        return x / np.linalg.norm(x)

    while True:
        axis, other, ground = unit(), unit(), rng.uniform(-1, 1, 3)
        a = np.cross(axis, unit()) * rng.uniform(0.2, 0.6)
        b = ground + np.cross(other, unit()) * rng.uniform(0.3, 0.8)
        d, rate = b - a, rng.uniform(1, 10)
        push, pin = np.cross(other, b - ground) @ d, np.cross(rate * axis, a)
        if np.linalg.norm(d) > 0.2 and abs(push) > 0.2 * np.linalg.norm(b - ground) * np.linalg.norm(d):
            break
    last = pin @ d / push
    wrist = np.cross(last * other, b - ground)
    spin = np.cross(d, wrist - pin) / (d @ d) + rng.uniform(-3, 3) * d / np.linalg.norm(d)
    mechanism = uqmbd.Mechanism("loop", uqmbd.Spatial(gravity=(0, 0, -9.81)))
    moving = (
        ("crank", a / 2, pin / 2, rate * axis),
        ("coupler", (a + b) / 2, (pin + wrist) / 2, spin),
        ("rocker", (b + ground) / 2, wrist / 2, last * other),
    )
    bodies = [
        mechanism.body(
            name,
            mass=1,
            inertia=(0.02, 0.02, 0.02),
            position=tuple(at),
            velocity=tuple(rounded(x, digits) for x in velocity),
            angular_velocity=tuple(rounded(x, digits) for x in rates),
        )
        for name, at, velocity, rates in moving
    ]
    mechanism.add(Revolute("O", mechanism.ground, bodies[0], at=(0, 0, 0), axis=tuple(axis)))
    mechanism.add(Spherical("A", bodies[0], bodies[1], at=tuple(a)))
    mechanism.add(Spherical("B", bodies[1], bodies[2], at=tuple(b)))
    mechanism.add(Revolute("G", mechanism.ground, bodies[2], at=tuple(ground), axis=tuple(other)))
    mechanism.output("x", bodies[1].position[0], units="m")
    return mechanism


def made(kind, digits, seed):
    rng = np.random.default_rng(seed)
    return spatial(rng, digits) if kind == "loop" else planar(rng, kind, digits)


def velocity_residual(mechanism):
    """Largest residual of the velocity constraints at the start, over the largest velocity."""
    model = build(mechanism)
    start = Ensemble(model, np.zeros((1, 0))).start
    assert start.messages == ("",)
    state = np.concatenate([start.q, start.s, start.v, np.zeros((1, 2))], axis=1)
    parameters = model.parameters(np.zeros((1, 0)))
    found = model.evaluate("velocity", state, parameters)
    residual = (found["d"] @ start.v[:, :, None])[:, :, 0] + found["phi_t"]
    return np.abs(residual).max() / np.abs(start.v).max()


def outcome(mechanism, integrator, rtol):
    try:
        return uqmbd.simulate(mechanism, TIMES, integrator=integrator, rtol=rtol, check=False)["x"].values, ""
    except uqmbd.UqmbdError as error:
        return None, f"{type(error).__name__}: {error}"


DIGITS = [3, 8, *(pytest.param(k, marks=pytest.mark.thorough) for k in (4, 5, 6, 7, 9, 10, 11, 12))]


@pytest.mark.parametrize("digits", DIGITS)
@pytest.mark.parametrize("kind", ["slider-crank", "four-bar", "loop"])
def test_all_integrators_begin_on_the_constraints_or_none_does(kind, digits):
    """Seven digits and fewer contradict each other by more than is put down to rounding, or not: for all alike."""
    seed = digits
    mechanism = made(kind, digits, seed)
    found = {name: outcome(mechanism, name, 1e-9) for name in INTEGRATORS}
    texts = {text for _, text in found.values()}
    assert len(texts) == 1, texts
    text = texts.pop()
    if digits >= 8:
        assert not text, text
    if digits <= 5:
        assert "contradict" in text and "velocity of body" in text, text
    if not text:
        assert velocity_residual(mechanism) < 1e-14
        values = np.array([x for x, _ in found.values()])
        np.testing.assert_allclose(values, values[:1].repeat(len(values), axis=0), rtol=0, atol=1e-7)
