"""Distances of distributions: those of Wasserstein and of Kolmogorov and Smirnov, between samples of two methods."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import xarray as xr

from uqmbd.errors import UqmbdError
from uqmbd.results.chaos import spread_germs
from uqmbd.status import Status
from uqmbd.typing import Array

__all__ = ["distances", "ks_by_chance", "realisations_at"]


SURROGATE_SAMPLES = 4096


def distances(first: Array, second: Array) -> tuple[float, float]:
    r"""Return the Wasserstein and the Kolmogorov-Smirnov distance of two samples.

    Parameters
    ----------
    first, second : array, shapes (K,) and (L,)

    Returns
    -------
    wasserstein : float
        :math:`\int |F - G|\,dx`, in the units of the samples.
    ks : float
        :math:`\max |F - G|`, from 0 to 1.

    Examples
    --------
    >>> distances(np.array([0.0, 1.0]), np.array([0.5, 1.5, 1.5, 1.5]))
    (0.75, 0.75)
    """
    points = np.sort(np.concatenate([first, second]))
    gap = np.abs(
        np.searchsorted(np.sort(first), points, side="right") / len(first)
        - np.searchsorted(np.sort(second), points, side="right") / len(second)
    )
    return float((gap[:-1] * np.diff(points)).sum()), float(gap.max())


def ks_by_chance(counts: Sequence[float], level: float) -> float:
    """Return the Kolmogorov-Smirnov distance that samples of one distribution exceed with a chance `level` at most.

    Parameters
    ----------
    counts : sequence of float
        Independent samples of both; infinite for a distribution that is known.
    level : float

    References
    ----------
    P. Massart, Annals of Probability 18 (1990) 1269-1283, for one sample; for two of them asymptotic (Smirnov).

    Examples
    --------
    >>> round(ks_by_chance([100, np.inf], 0.05), 4)
    0.1358
    """
    return float(np.sqrt(-0.5 * np.log(0.5 * level) * sum(1.0 / n for n in counts)))


def realisations_at(node: xr.DataTree, where: Sequence[int]) -> tuple[Array, float] | None:
    """Return realisations (K, O, N) of a method at N of its times, from its samples, or else by sampling its chaos.

    Parameters
    ----------
    node : xarray.DataTree
    where : sequence of int
        Indices of times; passed over where outputs have none.

    Returns
    -------
    tuple of array and float, or None
        The realisations, and how many of them count as independent: infinite for those of a chaos. None where a method
        kept neither.
    """
    from uqmbd.results.chaos import AlignedChaos, chaos_from_dataset

    for name in ("samples", "chaos", "aligned"):
        if name not in node.children:
            continue
        data = node.children[name].to_dataset()
        if "time" in data.sizes:
            if max(where, default=0) >= data.sizes["time"]:  # it ended early
                continue
            data = data.isel(time=list(where))
        if name == "samples":
            response = data["response"].isel(sample=np.flatnonzero(data["status"].values == Status.OK)).values
            if len(response):
                return response.reshape(*response.shape[:2], -1), float(len(response))
            continue
        try:
            chaos = AlignedChaos.from_dataset(data) if name == "aligned" else chaos_from_dataset(data)
        except (UqmbdError, KeyError, ValueError):  # of another kind, whose results stand without
            continue
        values = chaos.evaluate_germs(spread_germs(chaos.space, SURROGATE_SAMPLES, 0))
        return values.reshape(*values.shape[:2], -1), np.inf
    return None
