"""Random drops with friction and restitution, some grazing: none hangs, none is lost silently, energy never grows."""

from __future__ import annotations

import numpy as np
import pytest

TIMES = np.linspace(0, 1.5, 31)


def check(dropped, falling, name, count, seed=1, times=TIMES, only=None):
    mechanism = falling(name)
    inputs = mechanism.inputs
    values = inputs.from_uniform(np.random.default_rng(seed).uniform(size=(count, len(inputs))))
    if only is not None:
        values, count = values[only], len(only)
    found, energy = dropped(mechanism, values, times)
    assert list(found.messages) == [""] * count
    assert np.isfinite(found.states).all()
    assert found.counters.events > count / 2
    assert found.counters.integrations < 150 * count, "bodies come to rest: what happens does not go on without end"
    scale = np.abs(energy).max(axis=1, keepdims=True)
    growth = (np.diff(energy, axis=1) / scale).max()
    # errors of flights at rtol 1e-6 add up to some fifteen tolerances where a ball spins; at 1e-8 they are 3e-8
    assert growth < 3e-5, (
        f"energy grows by {growth:.2g} in realisation {np.argmax((np.diff(energy) / scale).max(axis=1))}"
    )


EVERY = ["disc", "rod", "corner", "ball", "ceiling", "groove"]


@pytest.mark.parametrize("name", [*EVERY[:-1], pytest.param("groove", marks=pytest.mark.thorough)])
def test_drops(dropped, falling, name):
    check(dropped, falling, name, 3, times=TIMES[:11])


@pytest.mark.thorough
def test_discs_that_come_to_rest_in_the_corner(dropped, falling):
    """Two contacts stick whose least forces are more than friction holds, or slide the other way than what is left."""
    check(dropped, falling, "corner", 200, seed=7, only=[36, 41, 80])


@pytest.mark.slow
@pytest.mark.parametrize("name", EVERY)
def test_a_thousand_drops(dropped, falling, name):
    check(dropped, falling, name, 200, seed=7)
