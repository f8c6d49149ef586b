"""Order statistics of rows are those of a sort, to the bit, for numbers of every kind."""

from __future__ import annotations

import functools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from uqmbd.compiled import order_statistics
from uqmbd.compiled.driver import load_driver


@pytest.fixture(autouse=True, params=["compiled", "sorted"])
def driver(request, monkeypatch):
    """The driver as it is loaded, or not yet loaded."""
    load_driver()
    if request.param == "sorted":
        monkeypatch.setattr("uqmbd.compiled.ranks.load_driver", functools.cache(load_driver))


KINDS = {
    "normal": lambda r, n: r.standard_normal(n),
    "heavy tails": lambda r, n: r.standard_cauchy(n),
    "many magnitudes": lambda r, n: np.exp(60 * r.standard_normal(n)) * r.choice([-1, 1], n),
    "ties": lambda r, n: r.integers(-3, 4, n).astype(float),
    "nearly equal": lambda r, n: 1e5 + np.spacing(1e5) * r.integers(0, 100, n),
    "denormal": lambda r, n: 5e-324 * r.integers(0, 50, n),
    "largest": lambda r, n: np.finfo(float).max * r.uniform(-1, 1, n),
    "infinite": lambda r, n: np.where(r.random(n) < 0.1, np.inf * r.choice([-1, 1], n), r.standard_normal(n)),
    "ascending": lambda r, n: np.sort(r.standard_normal(n)),
    "descending": lambda r, n: -np.sort(r.standard_normal(n)),
    "one outlier": lambda r, n: np.where(np.arange(n) == n // 2, 1e300, r.random(n)),
    "nested scales": lambda r, n: 10.0 ** -(8.0 * r.integers(0, 30, n)) * (1 + r.random(n)),
    "equal": lambda r, n: np.full(n, r.standard_normal()),
}


@pytest.mark.parametrize("examples", [300, pytest.param(10_000, marks=pytest.mark.slow)])
def test_ranks_of_rows_are_those_of_a_sort(examples):
    @settings(max_examples=examples, deadline=None, database=None)
    @given(
        kinds=st.lists(st.sampled_from(sorted(KINDS)), min_size=1, max_size=4),
        count=st.one_of(st.integers(1, 130), st.sampled_from([511, 4096, 8192, 20_000])),
        seed=st.integers(0, 2**32),
        wanted=st.integers(0, 70),
    )
    def check(kinds, count, seed, wanted):
        random = np.random.default_rng(seed)
        rows = np.stack([KINDS[kind](random, count) for kind in kinds])
        ranks = np.sort(random.integers(0, count, wanted))
        expected = np.sort(rows, axis=1)[:, ranks]
        assert np.array_equal(order_statistics(rows.copy(), ranks), expected)

    check()


@pytest.mark.parametrize("count", [1, 7, 8, 50, 8192])
def test_a_row_with_nan_has_none(count):
    rows = np.random.default_rng(0).random((9, count))
    expected = np.sort(rows, axis=1)[:, [0, count - 1]]
    for k in range(1, 9):
        rows[k, min(k, count - 1)] = np.nan
    found = order_statistics(rows, np.array([0, count - 1]))
    assert np.array_equal(found[0], expected[0])
    assert np.isnan(found[1:]).all()


@pytest.mark.parametrize("ranks", [[-1], [5], [3, 2], [[0]]])
def test_impossible_ranks_are_refused(ranks):
    with pytest.raises(ValueError, match="ranks are"):
        order_statistics(np.zeros((2, 5)), np.array(ranks))


@pytest.mark.parametrize("rows", [np.zeros(5), np.zeros((4, 5))[:, ::2], np.zeros((4, 5), dtype=np.float32)])
def test_rows_that_are_no_rows_of_numbers_are_refused(rows):
    with pytest.raises(ValueError, match="rows have shape"):
        order_statistics(rows, np.array([0]))
