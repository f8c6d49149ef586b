"""Stated errors of methods, absolute and relative."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import uqmbd
from uqmbd.extend import StatedError, labels, statistics_dataset

AXES = labels([("x", "m"), ("F", "N")], [], [0.0, 1.0, 2.0])
NUMBERS = st.lists(st.floats(0, 1e6), min_size=6, max_size=6).map(lambda x: np.array(x).reshape(2, 3))


@settings(max_examples=20)
@given(error=NUMBERS, std=NUMBERS)
def test_both_kinds_state_the_same_error(error, std):
    """Relative errors are of the standard deviation, or of 1 % of its maximum over time."""
    scale = np.array([[max(x, 0.01 * max(row)) for x in row] for row in std.tolist()])
    one, other = (
        statistics_dataset(AXES, mean=0 * std, std=std, stated_error=StatedError(values, kind, "fold error"))
        for values, kind in ((error, "relative"), (error * scale, "absolute"))
    )
    np.testing.assert_allclose(one["stated_error"], error * scale)
    np.testing.assert_allclose(other["stated_error"], error * scale)
    there = (scale > 1e-280) & (error * scale > 1e-280)
    np.testing.assert_allclose(other["verification_error"].values[there], error[there])
    assert list(one["stated_error"].output_units.values) == ["m", "N"]


def test_an_absolute_error_of_what_does_not_vary_is_all_of_it():
    found = statistics_dataset(
        AXES,
        mean=np.zeros((2, 3)),
        std=np.zeros((2, 3)),
        stated_error=StatedError([[1, 0, 2], [0, 0, 0]], "absolute", "e"),
    )
    assert found["verification_error"].values.tolist() == [[1, 0, 1], [0, 0, 0]]
    assert found["stated_error"].values.tolist() == [[1, 0, 2], [0, 0, 0]]


@pytest.mark.parametrize(
    ("values", "name", "words"),
    [
        ([[-1.0]], "e", "-1"),
        ([[np.inf]], "e", "inf"),
        ([[1.0]], " ", "name is empty"),
        ([["a"]], "e", "expected real numbers"),
    ],
)
def test_impossible_errors_are_refused(values, name, words):
    with pytest.raises(uqmbd.StudyError, match=words):
        StatedError(values, "absolute", name)


def test_another_shape_is_refused():
    with pytest.raises(uqmbd.StudyError, match="stated_error"):
        statistics_dataset(
            AXES, mean=np.zeros((2, 3)), std=np.ones((2, 3)), stated_error=StatedError([1.0], "relative", "e")
        )


@settings(max_examples=20)
@given(unknown=st.lists(st.integers(0, 3), min_size=6, max_size=6), kind=st.sampled_from(["relative", "absolute"]))
def test_every_unknown_error_has_a_reason(unknown, kind):
    """Where the error, the standard deviation or both are NaN: of both variables, in exactly the case of a NaN."""
    state = np.array(unknown).reshape(2, 3)
    std = np.where(state & 1, np.nan, 1.0)
    error = np.where(state & 2, np.nan, 0.1)
    found = statistics_dataset(
        AXES, mean=np.where(state & 1, np.nan, 0.0), std=std, stated_error=StatedError(error, kind, "fold error")
    )
    for name in ("stated_error", "verification_error"):
        assert ("unknown" in found[name].attrs) == bool(np.isnan(found[name].values).any()), name
    absolute = np.isnan(error) | (np.isnan(std) if kind == "relative" else False)
    np.testing.assert_array_equal(np.isnan(found["stated_error"].values), absolute)
