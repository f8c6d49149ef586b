"""Errors that methods state are taken where they are known, and only standard errors of samples count their samples."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
import xarray as xr
from hypothesis import given, settings
from hypothesis import strategies as st

from uqmbd.extend import StatedError, labels, statistics_dataset
from uqmbd.results import propagator_node
from uqmbd.results.assessment.own_errors import own_error

SIZES: dict[str, Any] = {"realisations": 100, "wall_time": 0.0}


def node(std: Any, error: Any, *, kind: str, times: Any, options: dict[str, Any] | None = None) -> xr.DataTree:
    """Return a node of a method that states errors of the standard deviation."""
    axes = labels([f"x{k}" for k in range(len(std))], [], times)
    mean = np.where(np.isnan(std), np.nan, 0.0)
    if kind == "noise":
        noise = np.where(np.isnan(std), np.nan, error)
        stated: dict[str, Any] = {"std_error_mean": noise, "std_error_std": noise}
    else:
        stated = {"stated_error": StatedError(error, "absolute", "leave-one-out error")}
    statistics = statistics_dataset(axes, mean=mean, std=std, **stated)
    return propagator_node("a", statistics, propagator="p", options=options or {}, **SIZES)


@pytest.mark.thorough
@pytest.mark.parametrize("kind", ["noise", "stated"])
@settings(deadline=None, max_examples=40)
@given(data=st.data())
def test_unknown_times_do_not_make_a_stated_error_smaller(kind: str, data: st.DataObject) -> None:
    """Errors are a constant share of the standard deviation where both are known: so is the error over time."""
    count, outputs = data.draw(st.integers(1, 6)), data.draw(st.integers(1, 3))
    known = np.array(data.draw(st.lists(st.booleans(), min_size=count * outputs, max_size=count * outputs)))
    known = known.reshape(outputs, count)
    share = data.draw(st.floats(0.001, 0.5))
    level = np.array(data.draw(st.lists(st.floats(0.1, 10.0), min_size=outputs, max_size=outputs)))
    std = np.where(known, level[:, None] * np.ones(count), np.nan)
    error = np.where(known, share * std, np.nan)
    found = own_error(node(std, error, kind=kind, times=np.linspace(0.0, 1.0, count)))
    expected = (1.96 if kind == "noise" else 1.0) * share
    # a single time without neighbours has no length
    enough = known.sum(axis=1) > 0
    np.testing.assert_allclose(found.stated[enough], expected, rtol=1e-9)
    assert np.isnan(found.stated[~enough]).all()
    assert not found.drawn


def test_an_unknown_error_of_a_known_standard_deviation_is_unknown_over_time() -> None:
    """Nothing that varies has the error 0 because a time of it is unknown."""
    times = [0.0, 1.0, 2.0]
    found = own_error(node([[1.0, 1.0, np.nan]], [[0.3, 0.3, np.nan]], kind="noise", times=times))
    assert found.relative(np.array(times)) == pytest.approx([1.96 * 0.3])
    unknown = own_error(node([[np.nan] * 3], [[np.nan] * 3], kind="noise", times=times))
    assert np.isnan(unknown.stated).all()


def test_only_samples_have_degrees_of_freedom_and_learn_from_others() -> None:
    given: dict[str, Any] = {"std": [[1.0, 1.0]], "error": [[0.1, 0.1]], "kind": "noise", "times": [0.0, 1.0]}
    stated, drawn = own_error(node(**given)), own_error(node(**given, options={"samples": 100}))
    assert (stated.drawn, stated.freedom, drawn.drawn, drawn.freedom) == (False, np.inf, True, 99.0)
    stated, drawn = (replace(one, kurtosis=np.full((1, 2), 3.0)) for one in (stated, drawn))
    rare = replace(stated, kurtosis=np.full((1, 2), 50.0))
    np.testing.assert_array_equal(stated.informed(rare).noise_std, [[0.1, 0.1]])
    assert (drawn.informed(rare).noise_std > 0.1).all()
