"""A study of an oscillator in closed form, with awkward names and planted failures."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
import xarray as xr

from uqmbd import results

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
    axes = results.labels(
        zip(NAMES, ("m", "N", "", "rad"), strict=True),
        [("k_1$", "N/m", "Normal(mu=40, sigma=2)"), ("<script>alert(1)", "kg", "Uniform(0.95, 1.05)")],
        times,
    )
    status = np.where(np.arange(samples) < failing, 2, 0)
    messages = ["step too small at 'pin' <img src=x>" if s else "" for s in status]
    data = results.sample_dataset(response, np.stack([stiffness, mass], axis=1), axes, status=status, messages=messages)
    return results.propagator_node(
        label,
        results.statistics_of_samples(data),
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
    axes = results.labels(zip(NAMES, ("m", "N", "", "rad"), strict=True), [], times)
    mean = np.stack([np.cos(6.3 * times), 1e5 + 0 * times, 0.15 + 0 * times, 0 * times])
    statistics = results.statistics_dataset(axes, mean=mean, std=0.01 * np.abs(mean) * (mean != 0.15))
    return results.propagator_node(label, statistics, propagator="galerkin", realisations=9, wall_time=0.01)


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
