"""The four-bar linkage with tolerances against its closed form: realisations, and the yield of a million linkages."""

from __future__ import annotations

import runpy
from pathlib import Path

import numpy as np
import pytest

import uqmbd
from uqmbd_montecarlo import MonteCarlo
from uqmbd_reliability import allocate

SCRIPT = Path(__file__).parents[2] / "studies" / "tolerances.py"


@pytest.fixture(scope="module")
def script():
    return runpy.run_path(str(SCRIPT))


def positions(sizes, angle):
    """Height of the roller's lower edge and angle of the rocker, by the cosine rule."""
    crank, coupler, rocker, frame = (sizes[name] for name in ("crank", "coupler", "rocker", "frame"))
    x, y = crank * np.cos(angle), crank * np.sin(angle)
    diagonal = np.hypot(frame - x, y)
    towards = np.arctan2(-y, frame - x)
    opening = np.arccos((coupler**2 + diagonal**2 - rocker**2) / (2 * coupler * diagonal))
    joint_x, joint_y = x + coupler * np.cos(towards + opening), y + coupler * np.sin(towards + opening)
    middle = (y + joint_y) / 2 + 0.060 * np.cos(towards + opening)
    return middle - sizes["roller"] / 2, np.arctan2(joint_y, joint_x - frame)


def extreme(function, angles, sign):
    """Largest value of ``sign * function`` on a circle: a parabola through the largest of some points and its neighbours."""
    values = sign * np.stack([function(angle) for angle in angles])
    top = np.clip(values.argmax(axis=0), 1, len(angles) - 2)
    low, middle, high = (np.take_along_axis(values, (top + k)[None], axis=0)[0] for k in (-1, 0, 1))
    return middle + (high - low) ** 2 / (16 * middle - 8 * low - 8 * high)


def margins(sizes):
    """Margins of both requirements, at all angles of the crank."""
    edge = -extreme(lambda angle: positions(sizes, angle)[0], 2 * np.pi * np.linspace(0.72, 0.82, 21), -1)
    swing = extreme(lambda angle: positions(sizes, angle)[1], 2 * np.pi * np.linspace(0.59, 0.69, 21), 1)
    return np.column_stack([edge - 0.0306, np.deg2rad(128.75) - swing])


@pytest.mark.thorough
def test_margins_are_those_of_the_closed_form(script):
    study = script["study"]
    problem = study.problem(MonteCarlo(samples=10, seed=1))
    values = problem.inputs.from_uniform(np.random.default_rng(5).random((40, len(problem.inputs))))
    sizes = dict(zip(problem.inputs.names, values.T, strict=True))
    found = problem.margins(values).values
    exact = margins(sizes)
    spread = exact.std(axis=0)
    # located between the output times, or at the nearest of them
    assert (np.abs(found - exact).max(axis=0) < 0.03 * spread).all()
    everywhere = 2 * np.pi * np.linspace(0, 1, 721)
    edges, swings = zip(*(positions(sizes, angle) for angle in everywhere), strict=True)
    assert np.min(edges, axis=0) - 0.0306 == pytest.approx(exact[:, 0], abs=1e-6)
    assert np.deg2rad(128.75) - np.max(swings, axis=0) == pytest.approx(exact[:, 1], abs=1e-4)


@pytest.mark.slow
def test_a_million_linkages_with_the_allocated_tolerances_have_the_yield(script):
    """99 % within 0.1 percentage points, by the closed form; and no cheaper allocation is near."""
    study, prices = script["study"], script["COSTS"]
    found = allocate(study, None, script["ALLOWED"], cost={name: 1e-4 * price for name, price in prices.items()})
    generator = np.random.default_rng(11)
    centres = {v.name: uqmbd.extend.stated_tolerance(v.distribution).mean for v in study.mechanism.inputs.variables}

    def share(widths, count):
        violated = 0
        for _ in range(count // 50_000):
            z = generator.standard_normal((len(widths), 50_000))
            sizes = {name: centres[name] + z[k] * widths[name] / 3 for k, name in enumerate(widths)}
            violated += int((margins(sizes).min(axis=1) < 0).sum())
        return violated / count

    after = dict(zip(found.inputs, found.after, strict=True))
    real = share(after, 1_000_000)
    assert abs(real - script["ALLOWED"]) < 1e-3
    assert found.lower <= real <= found.upper
    assert found.cost_after < 0.95 * found.cost_alike
    # with the same cost, a tolerance wider by a tenth and another tighter: more linkages violate a limit
    cost = sum(prices[n] / w for n, w in after.items())
    for name in after:
        for factor in (0.9, 1.1):
            changed = {**after, name: after[name] * factor}
            rest = sum(prices[n] / changed[n] for n in after if n != name)
            other = (cost - prices[name] / changed[name]) / rest
            moved = {n: w if n == name else w / other for n, w in changed.items()}
            assert share(moved, 200_000) > real - 5e-4
