"""Additional results of a collocation: datasets of nodes."""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from typing import Any

import numpy as np
import xarray as xr

import uqmbd
from uqmbd.extend import Labels
from uqmbd.results import Status
from uqmbd.typing import Array, Index
from uqmbd_collocation.fitting import Fit
from uqmbd_collocation.runs import CollocationRuns

__all__ = ["nodes_dataset", "nodes_of", "nodes_of_elements", "warn_of_failures"]


def nodes_of(
    labels: Labels, names: Sequence[str], inputs: Array, germs: Array, status: Index, messages: list[str], purpose: Any
) -> xr.Dataset:
    """Return the dataset `nodes`: inputs and germs (K, d), status, message and purpose of each realisation."""
    data = {
        "inputs": (("node", "input"), inputs),
        "germs": (("node", "germ"), germs),
        "status": (
            "node",
            status.astype(np.int32),
            {"comment": "0 if the realisation succeeded; other values have the meaning of 'status' of samples"},
        ),
        "message": ("node", np.array(messages, dtype=str)),
        "purpose": ("node", purpose),
    }
    return xr.Dataset(data, coords={**labels.input_coords(), "germ": np.array([str(name) for name in names])})


def nodes_of_elements(
    labels: Labels, names: Sequence[str], runs: Sequence[tuple[CollocationRuns, CollocationRuns]]
) -> xr.Dataset:
    """Return the dataset `nodes` of elements, from pairs of realisations: fit, verification (may be empty)."""
    parts = [(fit, "fit") for fit, _ in runs] + [(other, "verification") for _, other in runs if len(other)]
    return nodes_of(
        labels,
        names,
        np.concatenate([one.values for one, _ in parts]),
        np.concatenate([one.germs for one, _ in parts]),
        np.concatenate([one.status for one, _ in parts]),
        [message for one, _ in parts for message in one.messages],
        np.concatenate([np.full(len(one), purpose, dtype="<U12") for one, purpose in parts]),
    )


def nodes_dataset(runs: CollocationRuns, verification: Index, fit: Fit) -> xr.Dataset:
    """Return the dataset `nodes` of a collocation on the whole germ space.

    `purpose` is ``fit``, ``verification``, ``fit, verification`` (for germs of few values), or ``refinement``. A
    ``refinement`` realisation was computed by an earlier step, or to find unused inputs. If the fit uses a quadrature,
    `weight` contains its weights.
    """
    names = np.array(["refinement", "fit", "verification", "fit, verification"])
    used = np.zeros(len(runs), dtype=np.int64)
    used[fit.where] = 1
    used[verification] += 2
    if fit.failed:
        # a failed node counts as a node of the fit, although the fit omits it
        used[(runs.status != Status.OK) & (used == 0)] = 1
    about = (runs.problem.labels, runs.space.names, runs.values, runs.germs, runs.status, runs.messages)
    found = nodes_of(*about, names[used])
    if fit.weights is not None:
        weights = np.zeros(len(runs))
        np.add.at(weights, fit.where, fit.weights)
        found["weight"] = ("node", weights, {"long_name": "weight of the quadrature"})
    return found


def warn_of_failures(verification: uqmbd.extend.Verification, label: str) -> None:
    """Warn of verification realisations that failed."""
    if verification.failures:
        warnings.warn(
            f"{label}: {verification.failures} of {verification.asked} verification realisations failed; the stated "
            "error is based on the successful realisations. The failed realisations represent about "
            f"{max(verification.lost, 1e-6):.1g} of the probability. Reason of the failure: {verification.reason}",
            stacklevel=3,
        )
