"""Conversion of states at equal phases to outputs in normalised time between markers."""

from __future__ import annotations

import numpy as np
from numpy.polynomial import chebyshev

import uqmbd
from uqmbd.extend import AlignedElement
from uqmbd.typing import Array

__all__ = ["PER_TURN", "POINTS", "in_segments", "points_of"]


PER_TURN = 4
"""Number of segments of a turn."""

POINTS = 32
"""Number of Chebyshev points with states in a segment (a quarter of a turn)."""

IN_TIME = 20
"""Number of Chebyshev points with outputs in the normalised time of a segment."""

NEWTON = 8
"""Number of Newton steps to find the phase of a time."""


def points_of(edges: Array) -> Array:
    """Return the points (S, N) of segments between edges (S + 1,)."""
    return np.asarray(edges[:-1, None] + AlignedElement.points(POINTS) * np.diff(edges)[:, None])


def in_segments(
    projected: uqmbd.extend.ProjectedEnsemble, coefficients: Array, outputs: int
) -> tuple[Array, Array, float]:
    """Return the first `outputs` outputs at the points of segments in the normalised time of each node.

    `coefficients` (P, S, N, width + 1): coefficients of states and time at the N Chebyshev points in phase of each
    segment. Return the times (K, S + 1) of the markers in s, and the outputs (K, S, O, N) at the Chebyshev points of
    the segments. Return also the largest interpolation error, relative to the range of an output.
    """
    terms, segments, count, width = coefficients.shape
    flat = coefficients.reshape(terms, -1)
    edges = np.empty((len(projected.weights), segments + 1))
    response = np.empty((len(edges), segments, outputs, IN_TIME))
    error = 0.0
    # convert nodes one by one to limit the memory of states
    for k, basis in enumerate(projected.psi):
        whole = (basis @ flat).reshape(segments, count, width)
        times, states = whole[..., -1], whole[..., :-1].reshape(1, -1, width - 1)
        one = projected.ensemble.select(np.array([k]))
        values = one.outputs(times.reshape(1, -1), states)[0, :outputs].reshape(outputs, segments, count)
        edges[k] = np.append(times[:, 0], times[-1, -1])
        response[k], wrong = _in_time(times, values.transpose(1, 0, 2))
        error = max(error, wrong)
    return edges, response, error


def _in_time(times: Array, values: Array) -> tuple[Array, float]:
    """Interpolate values (S, O, N) at points in phase, which have the times (S, N), at points in time (S, O, IN_TIME).

    Return also the estimated interpolation error, relative to the range of an output.
    """
    count, where = times.shape[1], AlignedElement.points(IN_TIME)
    clock, found = times @ _to_coefficients(count), values @ _to_coefficients(count)
    pace = chebyshev.chebder(clock, axis=1)
    wanted: Array = times[:, :1] + where * (times[:, -1:] - times[:, :1])
    at: Array = np.broadcast_to(2 * where - 1, wanted.shape)
    for _ in range(NEWTON):
        polynomials = chebyshev.chebvander(at, count - 1)
        now = np.einsum("snc,sc->sn", polynomials, clock)
        slope = np.einsum("snc,sc->sn", polynomials[..., :-1], pace)
        at = np.asarray(np.clip(at - (now - wanted) / np.where(slope > 0, slope, np.inf), -1.0, 1.0), dtype=np.float64)
    result = np.einsum("snc,soc->son", chebyshev.chebvander(at, count - 1), found)
    size = np.ptp(values, axis=(0, 2))
    # coefficients decrease geometrically, in phase and in time, so omitted ones are about as large as the last ones
    last = np.concatenate([found[..., -2:], (result @ _to_coefficients(IN_TIME))[..., -2:]], axis=2)
    return result, float((np.abs(last).max(axis=(0, 2)) / np.where(size > 0, size, 1.0)).max(initial=0.0))


def _to_coefficients(count: int) -> Array:
    """Return the matrix (N, N) that converts rows of values at Chebyshev points to rows of coefficients."""
    vander = chebyshev.chebvander(2 * AlignedElement.points(count) - 1, count - 1)
    return np.asarray(np.linalg.inv(vander).T, dtype=np.float64)
