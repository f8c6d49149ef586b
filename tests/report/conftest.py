"""A study of an oscillator in closed form, with awkward names and planted failures."""

from __future__ import annotations

from collections.abc import Callable

import chaospy
import numpy as np
import pytest
import xarray as xr

from uqmbd import RandomVariable, extend, results
from uqmbd.randomness import GermSpace, JointInput, gauss_tensor, index_set, random_vector
from uqmbd.results.chaos.sampling import random_germs

NAMES = ("slider_x", r"$F_{pin} \frac <b>&", "constant 力", "zero")


def oscillator_node(
    label: str, *, samples: int = 60, seed: int = 1, failing: int = 2, options: dict[str, object] | None = None
) -> xr.DataTree:
    """Return samples of ``x = cos(w t)`` with random ``w``, the first ``failing`` of which failed."""
    rng = np.random.default_rng(seed)
    times = np.linspace(0.0, 2.0, 41)
    stiffness, mass = rng.normal(40.0, 2.0, samples), rng.uniform(0.95, 1.05, samples)
    x = np.cos(np.sqrt(stiffness / mass)[:, None] * times)
    response = np.stack([x, 1e5 + 1e-3 * x, 0.15 + 0.0 * x, 0.0 * x], axis=1)
    axes = extend.labels(
        zip(NAMES, ("m", "N", "", "rad"), strict=True),
        [("k_1$", "N/m", "Normal(mu=40, sigma=2)"), ("<script>alert(1)", "kg", "Uniform(0.95, 1.05)")],
        times,
    )
    status = np.where(np.arange(samples) < failing, 2, 0)
    messages = ["step too small at 'pin' <img src=x>" if s else "" for s in status]
    data = extend.sample_dataset(response, np.stack([stiffness, mass], axis=1), axes, status=status, messages=messages)
    return results.propagator_node(
        label,
        extend.statistics_of_samples(data, independent="sampling" not in (options or {})),
        data,
        propagator="monte-carlo",
        seed=seed,
        options={"samples": samples, **(options or {})},
        realisations=samples,
        wall_time=1.25,
        solver_counters={"residuals": 12345, "alone": 3, "seconds": 75.0, "my_counter": 1.5},
    )


def chaos_node(label: str) -> xr.DataTree:
    """Return a node without samples and quantiles, as a third-party method may give."""
    times = np.linspace(0.0, 2.0, 41)
    axes = extend.labels(zip(NAMES, ("m", "N", "", "rad"), strict=True), [], times)
    mean = np.stack([np.cos(6.3 * times), 1e5 + 0 * times, 0.15 + 0 * times, 0 * times])
    statistics = extend.statistics_dataset(axes, mean=mean, std=0.01 * np.abs(mean) * (mean != 0.15))
    return results.propagator_node(label, statistics, propagator="galerkin", realisations=9, wall_time=0.01)


def surrogate_node(
    label: str, order: int, *, verify: int = 8, dependent: bool = False, names: tuple[str, ...] = NAMES, nodes: int = 0
) -> xr.DataTree:
    """Return the chaos of the oscillator of `oscillator_node`, by projection on order + 1 (or more) nodes an input."""
    times = np.linspace(0.0, 2.0, 41)
    given = ["<script>alert(1)", "k_1$"]
    if dependent:
        inputs = random_vector(given, chaospy.MvNormal([1.0, 40.0], [[8e-4, 0.03], [0.03, 4.0]]), units=["kg", "N/m"])
    else:
        laws = [chaospy.Uniform(0.95, 1.05), chaospy.Normal(40, 2)]
        units = ["kg", "N/m"]
        inputs = [RandomVariable(n, law, units=u) for n, law, u in zip(given, laws, units, strict=True)]
    joint = JointInput.of(inputs)
    space = GermSpace.of(joint)
    columns = [space.inputs.index(name) for name in given]

    def model(germs: np.ndarray) -> np.ndarray:
        mass, stiffness = np.asarray(space.to_inputs(germs))[:, columns].T
        x = np.cos(np.sqrt(stiffness / mass)[:, None] * times)
        return np.stack([x, 1e5 + 1e-3 * x, 0.15 + 0.0 * x, 0.0 * x], axis=1)[:, : len(names)]

    rule, index = gauss_tensor(space, nodes or order + 1), index_set(2, order)
    coefficients = extend.project(model(rule.nodes), space.evaluate(rule.nodes, index), rule.weights)
    germs = random_germs(space, verify, 3) if verify else None
    axes = extend.labels(
        zip(names, ("m", "N", "", "rad"), strict=False),
        list(zip(joint.names, joint.units, joint.descriptions, strict=True)),
        times,
    )
    chaos = results.PolynomialChaos(
        coefficients, index, space, axes,
        verification_germs=germs, verification_response=None if germs is None else model(germs),
    )  # fmt: skip
    return results.propagator_node(
        label,
        chaos.statistics(samples=256),
        propagator="collocation",
        options={"order": order, "rule": "gauss"},
        realisations=len(rule.weights) + verify,
        wall_time=0.1,
        children={"chaos": chaos.to_dataset()},
    )


@pytest.fixture(scope="session")
def make_chaos() -> Callable[..., xr.DataTree]:
    """Return the function that makes the node of a method with a chaos."""
    return surrogate_node


@pytest.fixture(scope="session")
def orders() -> xr.DataTree:
    """Return a study by Monte Carlo and by surrogates of the orders 1 to 5."""
    nodes = [oscillator_node("monte-carlo", samples=200), *(surrogate_node(f"collocation-{n}", n) for n in range(1, 6))]
    return results.study_tree(nodes, study="crank <1>", mechanism="oscillator")


@pytest.fixture(scope="session")
def make_node() -> Callable[..., xr.DataTree]:
    """Return the function that makes the node of one method."""
    return oscillator_node


@pytest.fixture(scope="session")
def study() -> xr.DataTree:
    """Return a study of three methods."""
    nodes = [oscillator_node("monte-carlo"), oscillator_node("second", seed=2, failing=0), chaos_node("galerkin $3")]
    attrs = {"rtol": 1e-6, "integrator": "ida", "command": "uqmbd run 'a & b.py'"}
    return results.study_tree(nodes, study="crank <1>", mechanism="oscillator", attrs=attrs)
