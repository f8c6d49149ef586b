"""Surrogate over the prior, computed by a method of another plugin, as a predictor of records."""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import xarray as xr

import uqmbd
from uqmbd.results import surrogate
from uqmbd.typing import Array, Index
from uqmbd_calibration.inference.blocks import Block
from uqmbd_calibration.inference.points import OperatingPoint
from uqmbd_calibration.inference.searching import spread_over_prior

__all__ = ["PriorSurrogate", "default_methods", "read_prior_surrogates"]


ROWS = 4_000_000
"""Largest number of values in one evaluation."""

PREDICTED = 256
"""Number of points of the prior, at which predictions bound unknown errors."""

HIGHEST, OVER, VERIFY = 6, 1.5, 16
"""Default methods: highest order, number of realisations for each polynomial term, number of verification
realisations."""

SHARE = 0.62
"""Largest share of the realisations for surrogates over the prior."""


@dataclass(frozen=True, eq=False)
class PriorSurrogate:
    """Predictions at standard normal variables over the whole prior."""

    point: OperatingPoint  # operating point of the mechanism
    # for each block: its surrogate, the rows of its times in the surrogate, and the stated mean square errors
    parts: tuple[tuple[Any, Index, Array], ...]
    germs: bool

    def __call__(self, normals: Array) -> list[Array]:
        """Return predictions (K, n) of each block."""
        at = self.point.space.from_normal(normals) if self.germs else self.point.inputs(normals)
        found = []
        for chaos, rows, _ in self.parts:
            evaluate = chaos.evaluate_germs if self.germs else chaos.evaluate
            size = max(1, ROWS // max(len(rows), 1))
            parts = [evaluate(at[k : k + size])[:, 0][:, rows] for k in range(0, len(at), size)]
            found.append(np.concatenate(parts) if parts else np.zeros((0, len(rows))))
        return found

    @property
    def variances(self) -> list[Array]:
        """Stated mean square errors (n,) of each block."""
        return [variance for _, _, variance in self.parts]


def read_prior_surrogates(
    nodes: Sequence[xr.DataTree], point: OperatingPoint, blocks: Sequence[Block]
) -> PriorSurrogate:
    """Return predictors of the recorded values from surrogates.

    `nodes`: return value of `OperatingPoint.surrogates`; `point`: their operating point; `blocks`: recorded values.
    Raise StudyError if the method does not provide a surrogate.
    """
    parts: list[tuple[Any, Index, Array]] = []
    for block in blocks:
        node = nodes[-1] if block.timeless else nodes[0]
        wanted, rows = np.unique(block.columns, return_inverse=True)
        chaos = surrogate(node, block.output, times=wanted.tolist())
        # the error of a surrogate without verification realisations is unknown
        rms = np.full(len(wanted), np.nan)
        if chaos.verification_response is not None:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")
                rms = chaos.verification_rms()[0]
        parts.append((chaos, rows, rms[rows] ** 2))
    found = PriorSurrogate(point, tuple(parts), point.space.independent)
    if all(np.isfinite(square).all() for square in found.variances):
        return found
    predicted = found(spread_over_prior(point.space.dimension, PREDICTED, 0))
    complete = tuple(
        (chaos, rows, _with_bounds(square, own, block.values))
        for (chaos, rows, square), own, block in zip(parts, predicted, blocks, strict=True)
    )
    return replace(found, parts=complete)


def _with_bounds(squares: Array, predicted: Array, values: Array) -> Array:
    """Return mean square errors (n,) of predictions (K, n) of values (n,), with a bound for each unknown error.

    The bound is the mean square distance of the value from the predictions over the prior. It exceeds the variance of
    the predictions, so that a surrogate of unknown accuracy has little influence.
    """
    known = np.isfinite(squares)
    away = (predicted - values) ** 2
    there = np.isfinite(away)
    distance = np.where(there, away, 0.0).sum(axis=0) / np.maximum(there.sum(axis=0), 1)
    # 1e4: unknown next to known errors, as of a surrogate that ends early
    bound = 1e4 * np.max(squares[known], initial=0.0) + np.maximum(distance, np.ptp(values) ** 2)
    # predictions that are all equal to the value, or unknown, do not make an unknown error zero
    bound = np.where(bound > 0, bound, values**2)
    return np.where(known, squares, bound)


def default_methods(
    study: uqmbd.Study, *, moving: bool, known: Sequence[str], most: int
) -> tuple[uqmbd.extend.Propagator, ...]:
    """Return the default collocation methods, whose highest order needs at most the share `SHARE` of the realisations.

    The first method collocates at equal times. If its error for outputs over time is too large, methods aligned at
    events and at phases follow. These methods do not split the germ space: with splitting, a damped motion needed 2500
    realisations.
    """
    collocation = uqmbd.extend.propagator("collocation")
    inputs = study.mechanism.inputs
    free = len(inputs) - len(known)
    # weights exclude all terms of a known input
    weights = {"weights": tuple(1e3 if name in known else 1.0 for name in inputs.names)} if known else {}
    best: dict[str, Any] = {}
    for order in range(1, HIGHEST + 1):
        samples = int(np.ceil(OVER * len(uqmbd.extend.index_set(max(free, 1), order, "total"))))
        # an aligned collocation integrates its nodes up to three times
        cost = samples + VERIFY + (3 * samples + VERIFY if moving else 0)
        if order == 1 and cost > most:
            raise uqmbd.StudyError(
                f"calibrate: realisations is {most}, but the first surrogate needs {cost}. Increase realisations, e.g. "
                f"to {2 * cost}."
            )
        if order > 1 and cost > SHARE * most:
            break
        best = {"order": order, "method": "regression", "samples": samples, "verify": VERIFY, **weights}
    aligned = [*(["events"] if study.model.events else []), "phase"] if moving else []
    ways: list[dict[str, Any]] = [{}, *({"alignment": one, "max_elements": 1} for one in aligned)]
    return tuple(collocation(**best, **way) for way in ways)
