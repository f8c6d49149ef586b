"""Samples that are expanded from landmark to landmark, against NumPy's Chebyshev polynomials."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from uqmbd.compiled import segment_table, segment_values


def by_numpy(segments, edges, basis, times):
    """Evaluate one value after the other."""
    found = np.full((len(basis), segments.shape[2], len(times)), np.nan)
    for k, own in enumerate(edges):
        for j, time in enumerate(times):
            if time > own[-1]:
                continue
            s = min(max(int(np.searchsorted(own, time, side="right")) - 1, 0), len(own) - 2)
            length = own[s + 1] - own[s]
            x = -1.0 if length == 0 else max(2 * (time - own[s]) / length - 1, -1.0)
            for o in range(segments.shape[2]):
                found[k, o, j] = np.polynomial.chebyshev.chebval(x, basis[k] @ segments[:, s, o])
    return found


@given(st.integers(0, 2**32 - 1))
@settings(max_examples=150, deadline=None)
def test_values(seed):
    random = np.random.default_rng(seed)
    samples, segments, outputs, terms, powers, count = random.integers(1, (70, 9, 4, 6, 20, 40))
    edges = np.sort(random.uniform(0, 10, (samples, segments + 1)), axis=1)
    if random.random() < 0.3:
        # a segment of no length
        edges[:, segments // 2] = edges[:, segments // 2 + 1]
    coefficients = random.normal(size=(terms, segments, outputs, powers))
    basis, times = random.normal(size=(samples, terms)), np.sort(random.uniform(-1, 11, count))
    if random.random() < 0.3:
        # a time at an edge, and at the last one
        times = np.sort(np.append(times, [edges[0, 0], edges[0, -1]]))
    found = segment_values(segment_table(coefficients), edges, basis, times)
    expected = by_numpy(coefficients, edges, basis, times)
    scale = np.abs(basis) @ np.abs(coefficients).sum(axis=3).max(axis=(1, 2))
    np.testing.assert_allclose(found / scale[:, None, None], expected / scale[:, None, None], rtol=0, atol=1e-12)


def test_shapes_that_do_not_fit_are_refused():
    table = segment_table(np.zeros((2, 3, 1, 4)))
    for edges, basis in (((5, 3), (5, 2)), ((5, 4), (5, 3)), ((4, 4), (5, 2))):
        with pytest.raises(ValueError, match="was given edges"):
            segment_values(table, np.zeros(edges), np.zeros(basis), np.zeros(3))
