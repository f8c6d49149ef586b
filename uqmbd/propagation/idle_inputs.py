"""Random variables that no output depends on: one rule for all methods."""

from __future__ import annotations

import warnings
from typing import TYPE_CHECKING

import numpy as np

from uqmbd.isolation import ERRORS_AND_EXITS, Isolated
from uqmbd.propagation.execution import Kind, Packed, compute_chunk
from uqmbd.randomness import JointInput
from uqmbd.status import Status
from uqmbd.typing import Array

if TYPE_CHECKING:
    from uqmbd.dynamics import Model

__all__ = ["POINTS", "affordable", "idle_inputs"]

AT_LEAST = 8
"""As many realisations are computed together in hardly more time than one: they are always spent."""

SHARE = 20
"""Of more realisations at most this part of those that a method is to compute."""

POINTS = 6
"""From as many points an input is changed alone that changed nothing at the first: events may be rare."""

FAR = 1e-6
"""To these quantiles, of either end, it is changed from the first two: what happens rarely often does so there."""

SAME = 1e-12
"""Outputs that differ by less, as a part of their largest value over time, are the same."""


def affordable(inputs: int, planned: int) -> bool:
    """Whether so many inputs are looked at where so many realisations are planned.

    Examples
    --------
    >>> affordable(7, 10), affordable(20, 400), affordable(20, 420)
    (True, False, True)
    """
    return 0 < inputs < max(AT_LEAST, planned // SHARE)


def idle_inputs(model: Model, inputs: JointInput, times: Array, rtol: float, integrator: str) -> tuple[str, ...]:
    """Name the inputs of which no output depends, without or over time, nor a requirement.

    Each is changed alone, from one point; those that change nothing are changed at `POINTS` others, too.  Realisations
    that fail are different from others, so that nothing is said where one cannot tell.

    Parameters
    ----------
    model : Model
    inputs : JointInput
        With at least one variable.
    times : array, shape (T,)
        Output times, s.
    rtol : float
        Relative tolerance of the integration.
    integrator : str
        Its name.
    """
    size, everything = len(inputs), list(range(len(inputs)))
    packed = Packed.of(model)
    kind: Kind = "outputs" if model.outputs.names else "scalars" if model.scalars is not None else "requirements"

    def unchanged(suspects: list[int], points: Array, others: Array) -> list[int]:
        """Return the suspects that change nothing at any point, where they are moved to another."""
        rows = [points]
        for k in suspects:
            moved = points.copy()
            moved[:, k] = others[:, k]
            rows.append(moved)
        chunk = compute_chunk(packed, inputs.from_uniform(np.concatenate(rows)), times, rtol, integrator, kind)
        seen, status = [chunk.response], chunk.status
        if chunk.scalars is not None:
            seen.append(chunk.scalars.values[:, :, None])
            status = np.maximum(status, np.where(chunk.scalars.status == Status.CENSORED, 0, chunk.scalars.status))
        if chunk.margins is not None:
            seen.append(chunk.margins.values[:, :, None])
            status = np.maximum(status, chunk.margins.status)
        first, *changed = np.arange(len(status)).reshape(len(rows), len(points))
        return [
            k
            for k, row in zip(suspects, changed, strict=True)
            if not status[first].any() and not status[row].any() and all(_same(x[first], x[row]) for x in seen)
        ]

    found: list[int] = []
    with Isolated(*ERRORS_AND_EXITS), warnings.catch_warnings():
        # whatever is wrong is told by the methods
        warnings.simplefilter("ignore")
        suspects = unchanged(everything, np.full((1, size), 0.3819660113), np.full((1, size), 0.7236067977))
        if suspects:
            points, others = np.random.default_rng(0).uniform(0.01, 0.99, (2, POINTS, size))
            others[:2] = [[FAR], [1 - FAR]]
            found = unchanged(suspects, points, others)
    return tuple(inputs.names[k] for k in found)


def _same(one: Array, other: Array) -> bool:
    """Whether outputs (K, output, T) are the same but for rounding; what does not happen in both is."""
    if not one.size:
        return True
    with np.errstate(invalid="ignore"):
        largest = np.abs(one).max(axis=-1, keepdims=True)
        return bool(
            ((np.abs(other - one) <= SAME * largest) | (np.isnan(one) & np.isnan(other)) | (one == other)).all()
        )
