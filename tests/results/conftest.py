"""A study made without uqmbd: an oscillator with random stiffness and mass, in closed form, with planted failures."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
import xarray as xr

from uqmbd import extend, results


def oscillator_node(label: str, *, samples: int = 200, seed: int = 1, failing: int = 3) -> xr.DataTree:
    """Return samples of ``x = cos(w t)`` with random ``w = sqrt(k / m)``, the first ``failing`` of which failed."""
    rng = np.random.default_rng(seed)
    times = np.linspace(0.0, 2.0, 101)
    stiffness, mass = rng.normal(40.0, 2.0, samples), rng.uniform(0.95, 1.05, samples)
    rate = np.sqrt(stiffness / mass)[:, None]
    response = np.stack(
        [np.cos(rate * times), 1e4 * -(rate**2) * np.cos(rate * times), np.broadcast_to(0.15, (samples, times.size))],
        axis=1,
    )
    axes = extend.labels(
        [("slider_x", "m"), ("$F_{pin}$ & <b>", "N"), ("länge", "")],
        [("k_1", "N/m", "Normal(mu=40, sigma=2)"), ("mass", "kg", "Uniform(lower=0.95, upper=1.05)")],
        times,
    )
    status = np.where(np.arange(samples) < failing, 2, 0)
    messages = ["step too small at t = 0.4 s: 'pin' <singular> ü" if s else "" for s in status]
    drawn = np.stack([stiffness, mass], axis=1)
    data = extend.sample_dataset(response, drawn, axes, status=status, messages=messages)
    return results.propagator_node(
        label,
        extend.statistics_of_samples(data),
        data,
        propagator="monte-carlo",
        seed=seed,
        options={"samples": samples},
        realisations=samples,
        wall_time=1.25,
        solver_counters={"steps": 12345, "residuals": 23456},
    )


@pytest.fixture(scope="session")
def make_node() -> Callable[..., xr.DataTree]:
    """Return the function that makes the node of one method."""
    return oscillator_node


@pytest.fixture(scope="session")
def study() -> xr.DataTree:
    """Return a study of two methods."""
    nodes = [oscillator_node("monte-carlo"), oscillator_node("second", samples=50, seed=2, failing=0)]
    return results.study_tree(
        nodes,
        study="ösc",
        mechanism="oscillator",
        attrs={"rtol": 1e-6, "integrator": "ida", "command": "uqmbd run a.py"},
    )
