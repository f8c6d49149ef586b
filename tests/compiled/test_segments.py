"""Samples that are expanded from landmark to landmark, against NumPy's Chebyshev polynomials."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from uqmbd.compiled import SegmentTable


def by_numpy(segments, edges, basis, times):
    """Evaluate one sample after the other."""
    found = np.full((len(basis), segments.shape[2], len(times)), np.nan)
    for k, own in enumerate(edges):
        which = np.clip(np.searchsorted(own, times, side="right") - 1, 0, len(own) - 2)
        for s in np.unique(which):
            there = (which == s) & (times <= own[-1])
            length = own[s + 1] - own[s]
            x = -np.ones(there.sum()) if length == 0 else np.maximum(2 * (times[there] - own[s]) / length - 1, -1.0)
            for o in range(segments.shape[2]):
                found[k, o, there] = np.polynomial.chebyshev.chebval(x, basis[k] @ segments[:, s, o])
    return found


def evaluated(table, basis, times, outputs=slice(None)):
    """Evaluate samples in turn."""
    count = len(range(*outputs.indices(table.used.shape[1])))
    found = np.full((len(basis), count, len(times)), np.inf)
    table.evaluate(basis, times, outputs, found, np.arange(len(basis)))
    return found


@pytest.mark.thorough
@given(st.integers(0, 2**32 - 1))
@settings(max_examples=100, deadline=None)
def test_values(seed):
    random = np.random.default_rng(seed)
    samples, segments, outputs, terms, powers = random.integers(1, (70, 9, 4, 6, 20))
    count = random.integers(1, random.choice([3, 40, 600]))
    coefficients = random.normal(size=(terms, segments, outputs, powers))
    if random.random() < 0.5:
        # coefficients that vanish, as those of higher terms and of higher degrees do, and others
        coefficients *= random.random((terms, segments, outputs, 1)) < 0.6
        coefficients *= np.arange(powers) <= random.integers(0, powers, (segments, outputs, 1))
    basis, at = random.normal(size=(samples, terms)), random.normal(0, 0.3, (terms, segments + 1))
    basis[:, 0], at[0] = 1.0, np.sort(random.uniform(0, 10, segments + 1))
    table = SegmentTable.of(at, coefficients)
    edges = table.edges_at(basis)
    np.testing.assert_allclose(edges, np.maximum.accumulate(basis @ at, axis=1), rtol=0, atol=1e-12)
    times = np.sort(random.uniform(-1, 11, count))
    if random.random() < 0.5:
        times = np.linspace(*times[[0, -1]], count)
    if random.random() < 0.3:
        # a time at an edge, and at the last one
        times = np.sort(np.append(times, [edges[0, 0], edges[0, -1]]))
    found = evaluated(table, basis, times)
    expected = by_numpy(coefficients, edges, basis, times)
    scale = np.abs(basis) @ np.abs(coefficients).sum(axis=3).max(axis=(1, 2)) + 1e-300
    np.testing.assert_allclose(found / scale[:, None, None], expected / scale[:, None, None], rtol=0, atol=1e-12)
    # to the bit: a sample without the others, an output, and times in parts
    k, o, parts = random.integers(samples), random.integers(outputs), np.sort(random.integers(0, len(times) + 1, 2))
    np.testing.assert_array_equal(evaluated(table, basis[k : k + 1], times), found[k : k + 1])
    np.testing.assert_array_equal(evaluated(table, basis, times, slice(o, o + 1)), found[:, o : o + 1])
    for part in (slice(0, parts[0]), slice(*parts), slice(parts[1], None)):
        np.testing.assert_array_equal(evaluated(table, basis, times[part]), found[..., part])
    # samples in rows of their own, others stay
    rows, more = random.permutation(samples + 2)[:samples], np.full((samples + 2, *found.shape[1:]), 7.0)
    table.evaluate(basis, times, slice(None), more, rows)
    np.testing.assert_array_equal(more[rows], found)
    assert (np.delete(more, rows, axis=0) == 7.0).all()


def test_samples_without_edges_have_no_values():
    table = SegmentTable.of(np.array([[0.0, 1.0, 2.0], [0.0, 1.0, np.nan]]), np.ones((2, 2, 1, 3)))
    basis, times = np.array([[1.0, 0.0], [np.nan, 1.0], [1.0, np.inf]]), np.linspace(0, 2, 9)
    assert np.isnan(evaluated(table, basis, times)[1:]).all()


def test_shapes_that_do_not_fit_are_refused():
    table = SegmentTable.of(np.zeros((2, 4)), np.zeros((2, 3, 1, 4)))
    with pytest.raises(ValueError, match="edges have the shape"):
        SegmentTable.of(np.zeros((2, 3)), np.zeros((2, 3, 1, 4)))
    with pytest.raises(ValueError, match="the basis has the shape"):
        table.edges_at(np.zeros((5, 3)))
    for room in (np.zeros((5, 1, 4)), np.zeros((5, 2, 3)), np.zeros((5, 1, 6))[..., ::2]):
        with pytest.raises(ValueError, match="the array for outputs"):
            table.evaluate(np.zeros((5, 2)), np.zeros(3), slice(None), room, np.arange(5))
    for rows in (np.arange(4), np.arange(1, 6), np.arange(-1, 4)):
        with pytest.raises(ValueError, match="were given rows"):
            table.evaluate(np.zeros((5, 2)), np.zeros(3), slice(None), np.zeros((5, 1, 3)), rows)
