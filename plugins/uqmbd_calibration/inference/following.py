"""How well a surrogate follows outputs over time."""

from __future__ import annotations

import warnings
from collections.abc import Iterable

import numpy as np
import xarray as xr

import uqmbd
from uqmbd.results import surrogate

__all__ = ["followed"]


def followed(node: xr.DataTree, outputs: Iterable[str]) -> float:
    """Return the error of a surrogate at its verification realisations, over the largest deviation of an output.

    Root mean square over time, of the output that is followed worst; infinite where it is not known.
    """
    worst = 0.0
    for output in outputs:
        chaos = surrogate(node, output)
        if chaos.verification_response is None:
            return np.inf
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            error = np.sqrt(np.mean(uqmbd.extend.errors_over_largest(chaos) ** 2))
        worst = max(worst, float(error) if np.isfinite(error) else np.inf)
    return worst
