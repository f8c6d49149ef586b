"""Index sets: their numbers against binomials, their members against the definitions, their memory."""

from __future__ import annotations

import itertools
import tracemalloc
from math import comb

import numpy as np
import pytest

import uqmbd
from uqmbd.randomness import index_set


@pytest.mark.parametrize(("dimension", "order"), [(1, 0), (1, 7), (2, 5), (3, 10), (5, 4), (10, 3), (20, 3), (4, 0)])
def test_total_degree_has_a_binomial_number_of_terms(dimension, order):
    rows = index_set(dimension, order)
    assert rows.shape == (comb(dimension + order, order), dimension) and rows.dtype.kind == "i"
    assert not rows[0].any() and rows.sum(axis=1).max() == order
    assert len(np.unique(rows, axis=0)) == len(rows)


def definition(dimension, order, belongs):
    grid = itertools.product(range(order + 1), repeat=dimension)
    return {row for row in grid if belongs(np.array(row, dtype=float))}


SETS = {
    "total": ({}, lambda a: a.sum() <= 4),
    "tensor": ({"kind": "tensor"}, lambda a: a.max() <= 4),
    "hyperbolic": ({"kind": "hyperbolic"}, lambda a: (a**0.5).sum() ** 2 <= 4 + 1e-9),
    "hyperbolic, q": ({"kind": "hyperbolic", "q": 0.75}, lambda a: (a**0.75).sum() ** (1 / 0.75) <= 4 + 1e-9),
    "anisotropic": ({"weights": [1, 2, 1.5]}, lambda a: (a * [1, 2, 1.5]).sum() <= 4),
    "anisotropic tensor": ({"kind": "tensor", "weights": [1, 2, 4]}, lambda a: (a * [1, 2, 4]).max() <= 4),
    "anisotropic hyperbolic": ({"kind": "hyperbolic", "weights": [1, 2, 1]}, lambda a: ((a * [1, 2, 1]) ** 0.5).sum() ** 2 <= 4 + 1e-9),
}  # fmt: skip


@pytest.mark.parametrize(("options", "belongs"), SETS.values(), ids=SETS)
def test_members_and_order(options, belongs):
    rows = index_set(3, 4, **options)
    assert {tuple(row) for row in rows.tolist()} == definition(3, 4, belongs)
    keys = [(sum(row), *(-v for v in row)) for row in rows.tolist()]
    assert keys == sorted(keys)


def test_every_set_is_downward_closed():
    for options, _ in SETS.values():
        rows = {tuple(row) for row in index_set(3, 4, **options).tolist()}
        for row in rows:
            for k in range(3):
                assert row[k] == 0 or (*row[:k], row[k] - 1, *row[k + 1 :]) in rows


def test_memory_is_that_of_the_members():
    """The full tensor of 20 inputs has 4**20 = 1e12 rows."""
    tracemalloc.start()
    rows = index_set(20, 3)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert len(rows) == 1771 and peak < 10 * rows.nbytes
    assert len(index_set(60, 3, "hyperbolic")) == 1 + 60 * 3


WRONG = {
    "order": (lambda: index_set(2, -1), "order is -1; expected a whole number of at least 0"),
    "order, fraction": (lambda: index_set(2, 1.5), "order is 1.5"),
    "order, flag": (lambda: index_set(2, True), "order is True"),
    "dimension": (lambda: index_set(-1, 2), "dimension .* is -1"),
    "kind": (lambda: index_set(2, 2, "full"), "kind is 'full'; expected one of total, tensor, hyperbolic"),
    "weights": (lambda: index_set(2, 2, weights=[1]), "expected 2 positive numbers"),
    "weight of zero": (lambda: index_set(2, 2, weights=[1, 0]), "expected 2 positive numbers"),
    "q": (lambda: index_set(2, 2, "hyperbolic", q=0), "q is 0; expected a number above 0 and at most 1"),
}  # fmt: skip


@pytest.mark.parametrize(("make", "words"), WRONG.values(), ids=WRONG)
def test_what_is_no_index_set(make, words):
    with pytest.raises(uqmbd.StudyError, match=words):
        make()
