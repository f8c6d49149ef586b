"""Compute Wasserstein and Kolmogorov-Smirnov distances of distributions between two methods.

:func:`scipy.stats.wasserstein_distance` and :func:`scipy.stats.ks_2samp` take four times as long for the same numbers:
each function sorts the samples again, and the latter computes a p-value that is not needed.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from uqmbd.errors import UqmbdError
from uqmbd.results.assessment.own_errors import OwnError
from uqmbd.results.chaos import spread_germs, surrogate, surrogate_parts
from uqmbd.status import Status
from uqmbd.typing import Array

__all__ = ["distributions", "sample_distances", "ks_by_chance"]


SURROGATE_SAMPLES = 4096


def distributions(
    nodes: Mapping[str, xr.DataTree], chosen: str, times: Array, base: OwnError, level: float
) -> dict[str, Any]:
    """Return distances of distributions from a reference at up to four times; empty if it has no distributions."""
    fine = np.flatnonzero(np.isfinite(base.std).all(axis=0))
    if not len(fine) or not len(base.std):
        return {}
    where = _comparison_times(times, base, fine)
    expected = _realisations_at(nodes[chosen], where)
    if expected is None:
        return {}
    outputs = len(base.std)
    wasserstein, ks = (np.full((len(nodes), outputs, len(where)), np.nan) for _ in range(2))
    chance = np.full(len(nodes), np.nan)
    for m, node in enumerate(nodes.values()):
        found = _realisations_at(node, where)
        if found is None:
            continue
        counts = [expected[1], found[1]]
        chance[m] = ks_by_chance(counts, level / (outputs * len(where) * max(len(nodes) - 1, 1)))
        for o in range(outputs):
            for k in range(len(where)):
                pair = [values[0][:, o, k] for values in (found, expected)]
                if all(np.isfinite(p).all() for p in pair):
                    wasserstein[m, o, k], ks[m, o, k] = sample_distances(*pair)
    dims = ("method", "output", "comparison_time")
    return {
        "comparison_time": xr.DataArray(times[where], dims="comparison_time", attrs={"units": "s"}),
        "wasserstein": (dims, wasserstein, {"long_name": "Wasserstein distance"}),
        "ks": (dims, ks, {"long_name": "Kolmogorov-Smirnov distance"}),
        "ks_by_chance": (
            "method",
            chance,
            {"long_name": "distance that samples of equal distributions exceed with the probability of the test level"},
        ),
    }


def sample_distances(first: Array, second: Array) -> tuple[float, float]:
    r"""Return the Wasserstein and the Kolmogorov-Smirnov distance of two samples.

    `first`, `second` (K,) and (L,). Return :math:`\int |F - G|\,dx`, in the units of the samples. Return :math:`\max
    |F - G|`, from 0 to 1.

    >>> sample_distances(np.array([0.0, 1.0]), np.array([0.5, 1.5, 1.5, 1.5]))
    (0.75, 0.75)
    """
    points = np.sort(np.concatenate([first, second]))
    gap = np.abs(
        np.searchsorted(np.sort(first), points, side="right") / len(first)
        - np.searchsorted(np.sort(second), points, side="right") / len(second)
    )
    return float((gap[:-1] * np.diff(points)).sum()), float(gap.max())


def ks_by_chance(counts: Sequence[float], level: float) -> float:
    """Return the Kolmogorov-Smirnov distance that samples of equal distributions exceed with probability <= `level`.

    `counts`: number of independent samples of each; infinite for a known distribution.

    One sample: P. Massart, Annals of Probability 18 (1990) 1269-1283; two samples: asymptotic (Smirnov).

    >>> round(ks_by_chance([100, np.inf], 0.05), 4)
    0.1358
    """
    return float(np.sqrt(-0.5 * np.log(0.5 * level) * sum(1.0 / n for n in counts)))


def _realisations_at(node: xr.DataTree, where: Sequence[int]) -> tuple[Array, float] | None:
    """Return realisations (K, O, N) of a method at N of its times, from its samples or by sampling its chaos.

    The second value is the equivalent number of independent realisations, which is infinite for a chaos. The result is
    None if a method stored neither samples nor a chaos.
    """
    if "samples" in node.children:
        data = node.children["samples"].to_dataset()
        if _reaches(data, where):
            data = data.isel(time=list(where)) if "time" in data.sizes else data
            response = data["response"].isel(sample=np.flatnonzero(data["status"].values == Status.OK)).values
            if len(response):
                return response.reshape(*response.shape[:2], -1), float(len(response))
    datasets = [data.to_dataset() for _, data in surrogate_parts(node).values()]
    if not datasets or not all(_reaches(data, where) for data in datasets):
        return None
    try:
        chaos = surrogate(node, times=where)
    except (UqmbdError, KeyError, ValueError):  # other surrogates have no distances
        return None
    values = chaos.evaluate_germs(spread_germs(chaos.space, SURROGATE_SAMPLES, 0))
    return values.reshape(*values.shape[:2], -1), np.inf


def _reaches(data: xr.Dataset, where: Sequence[int]) -> bool:
    """Return whether results exist at all selected times, which is false for a method that ended early."""
    return "time" not in data.sizes or max(where, default=0) < data.sizes["time"]


def _comparison_times(times: Array, base: OwnError, fine: NDArray[np.intp]) -> list[int]:
    """Choose up to four times: 1/3 and 2/3 of the times, the end, and the largest std of the first output."""
    chosen = {int(fine[-1]), int(fine[base.std[0, fine].argmax()])}
    for share in (1 / 3, 2 / 3):
        chosen.add(int(fine[round(share * (len(fine) - 1))]))
    return sorted(chosen)
