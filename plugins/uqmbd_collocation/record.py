"""What a collocation leaves in its results beside statistics and chaos."""

from __future__ import annotations

import warnings
from typing import Any

import numpy as np
import xarray as xr

import uqmbd
from uqmbd.results import Status
from uqmbd.typing import Index
from uqmbd_collocation.fitting import Fit
from uqmbd_collocation.runs import Runs

__all__ = ["nodes_dataset", "warn_of_idle_inputs"]


IDLE = 1e-13
"""Share of the largest coefficient of an output below which terms are rounding."""
SAME = 1e-12
"""Difference of two realisations, over the largest value over time, below which they are the same."""


def nodes_dataset(runs: Runs, verification: Index, fit: Fit) -> xr.Dataset:
    """Return the dataset `nodes` of a node: where the realisations were, what for, and what became of them.

    `purpose` is ``fit``, ``verification``, both (germs of few values meet), or ``refinement``: what an earlier step
    needed and the last one did not, and the search for idle inputs.  `weight` is that of the quadrature,
    where there is one.
    """
    names = np.array(["refinement", "fit", "verification", "fit, verification"])
    used = np.zeros(len(runs), dtype=np.int64)
    used[fit.where] = 1
    used[verification] += 2
    if fit.failed:
        # a failed node was meant for the fit, though it is not in it
        used[(runs.status != Status.OK) & (used == 0)] = 1
    data: dict[str, Any] = {
        "inputs": (("node", "input"), runs.values),
        "germs": (("node", "germ"), runs.germs),
        "status": ("node", runs.status.astype(np.int32), {"comment": "0: fine; others as of samples"}),
        "message": ("node", np.array(runs.messages, dtype=str)),
        "purpose": ("node", names[used]),
    }
    if fit.weights is not None:
        weights = np.zeros(len(runs))
        np.add.at(weights, fit.where, fit.weights)
        data["weight"] = ("node", weights, {"long_name": "weight of the quadrature"})
    germs = np.array([str(name) for name in runs.space.names])
    return xr.Dataset(data, coords={**runs.problem.labels.input_coords(), "germ": germs})


def warn_of_idle_inputs(runs: Runs, fit: Fit, label: str) -> None:
    """Warn of germs that no output depends on.

    Those of which no coefficient says anything are suspects: they are changed alone, from one point, and the responses
    compared, for a fit can be blind (an interaction without main effects, a sparse regression on few samples).
    """
    candidates = fit.multi_index if fit.candidates is None else fit.candidates
    size = np.abs(fit.coefficients).max(axis=(0, 2))[:, None]
    suspects = []
    for k in range(runs.space.dimension):
        energy = np.sqrt(np.sum(fit.coefficients[fit.multi_index[:, k] > 0] ** 2, axis=0))
        # an order of zero raises no suspicion
        if candidates[:, k].any() and bool((energy <= IDLE * size).all()):
            suspects.append(k)
    if not suspects:
        return
    # one stack, so that equal realisations have equal bits
    points = runs.space.from_uniform(np.full((1 + len(suspects), runs.space.dimension), 0.3819660113))
    changed = runs.space.from_uniform(np.full((1, runs.space.dimension), 0.7236067977))[0]
    for row, k in enumerate(suspects, start=1):
        points[row, k] = changed[k]
    where = runs.at(points)
    first, *others = runs.response[where]
    largest = np.abs(first).max(axis=-1, keepdims=True)
    for k, other in zip(suspects, others, strict=True):
        # a failed realisation compares as different
        if bool((np.abs(other - first) <= SAME * largest).all()):
            warnings.warn(
                f"{label}: no output depends on the random input {runs.space.names[k]!r}; it costs realisations and "
                "changes nothing. Leave it out, or observe what it changes.",
                uqmbd.UnusedInputWarning,
                stacklevel=2,
            )
