"""Test whether a record may come from the model: its residuals, as a whole and by parts of the time."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy import stats

from uqmbd.typing import Array
from uqmbd_calibration.inference import FREEDOM, Block

__all__ = ["DOUBT", "Residuals", "find_discrepancy", "residuals"]


DOUBT = 1e-3
"""p-value of a record below which the model or the noise is doubtful."""

SEGMENTS, LEAST = 12, 8
"""Parts of the time that are tested, and the least number of values in each."""

FAR = 4.0
"""Standard deviations beyond which a value is called an outlier."""

STRAY = 10.0
"""The same for unknown noise or many outliers: deviations relative to the median of all."""

FEW, SHOWN = 0.05, 10
"""Share of the values, or one of them, up to which outliers are named, and how many are."""


@dataclass(frozen=True, eq=False)
class Residuals:
    """Residuals of one output of a record."""

    block: Block  # of which values
    raw: Array  # (n,): values minus predictions and bias, over the standard deviation of the noise
    predicted: Array  # (n,): prediction and bias
    # (n,): `raw` as quantiles of a standard normal distribution, where the noise is robust; else the same
    normal: Array
    taken: float  # how many values a bias that is integrated out is fitted to


def residuals(block: Block, prediction: Array, vector: Array, sigma: float) -> Residuals:
    """Return residuals from a prediction (n,) at a vector of unknowns, or the mean of several ones (K, n), and a level.

    The mean of predictions may be likely where that at the mean is not: of a product of inputs, all products are.
    """
    misfit = block.misfit(np.atleast_2d(prediction), np.atleast_2d(vector)).mean(axis=0, keepdims=True)
    level = np.array([sigma])
    rest = misfit - block.bias(misfit, level)
    raw = -rest[0] / np.sqrt(sigma**2 + block.variance)
    normal = stats.norm.ppf(np.clip(stats.t.cdf(raw, FREEDOM), 1e-15, 1 - 1e-15)) if block.robust else raw
    taken = 0.0
    if not block.robust and block.modes.shape[1]:
        # what the bias takes of the squares of residuals: of each of its own functions its part of the variance
        own = np.maximum(np.linalg.eigvalsh(block.modes.T @ block.modes), 0.0)
        taken = float((own / (sigma**2 + own)).sum())
    return Residuals(block, raw, block.values + rest[0], normal, taken)


def find_discrepancy(found: Residuals, parameters: float) -> dict[str, Any]:
    """Return the evidence of residuals against the model.

    `parameters`: how many unknowns were fitted to these values. Return ``record``, ``output``, ``values``;
    ``chi_square``, the probability of residuals that are at least as large, where the noise is known; ``correlation``
    of neighbours with the probability ``correlation_p``; ``segments``, each with its ends in s and its probability;
    ``p``, that of all, corrected for their number; ``where``, the times that are strange; ``outliers``, how many values
    are far away, and ``strays``, the farthest of them if they are few. Each has its time in s or number, its value and
    its deviations; ``doubted``.
    """
    block, z = found.block, found.normal
    count = len(z)
    freedom = float(np.maximum(count - parameters - found.taken, 1.0))
    known = block.noise is not None
    said: dict[str, Any] = {"record": block.record, "output": block.output, "values": count, "robust": block.robust}
    tests: list[float] = []
    if known:
        said["chi_square"] = float(stats.chi2.sf(z @ z, freedom))
        tests.append(said["chi_square"])
    size = float(np.sqrt(z @ z / freedom))
    if not block.timeless and count >= 3 * LEAST:
        lag = float(z[1:] @ z[:-1]) / max(float(z @ z), 1e-300)
        said |= {"correlation": lag, "correlation_p": float(stats.norm.sf(lag * np.sqrt(count)))}
        tests.append(said["correlation_p"])
        parts = _segments(block.times, z, size, known=known)
        said["segments"] = parts
        tests.append(min(1.0, min(part["p"] for part in parts) * len(parts)))
    said["p"] = min(1.0, min(tests, default=1.0) * max(len(tests), 1))
    if parts := said.get("segments", []):
        strange = [part for part in parts if part["p"] * len(parts) < 0.01]
        worst = [min(parts, key=lambda part: float(part["p"]))] if said["p"] < DOUBT else []
        said["where"] = _joined(strange or worst)
    away = np.abs(found.raw)
    few = max(FEW * count, 1)
    if not known or np.count_nonzero(away > FAR) > few:
        # a noise level, and inputs, that are found from the values are such that outliers make others large, too
        usual = float(np.median(away)) / stats.norm.ppf(0.75)
        standing_out = away > STRAY * usual
        if not known:
            away = np.where(standing_out, away / usual, 0.0) if usual > 0 else np.zeros(count)
        elif 0 < np.count_nonzero(standing_out) <= few:
            away = np.where(standing_out, away, 0.0)
    said["outliers"] = int(np.count_nonzero(away > FAR))
    said["strays"] = []
    if 0 < said["outliers"] <= few:
        said["strays"] = [
            {
                **({"number": k + 1} if block.timeless else {"time": float(block.times[k])}),
                "value": float(block.values[k]),
                "deviations": float(away[k]),
            }
            for k in np.argsort(-away, kind="stable")[: said["outliers"]][:SHOWN].tolist()
        ]
    said["largest"] = float(np.abs(found.raw).max())
    said["doubted"] = bool(said["p"] < DOUBT) or (not known and bool(said["strays"]))
    return said


def _segments(times: Array, z: Array, size: float, *, known: bool) -> list[dict[str, float]]:
    """Return parts of the time, each with the p-value of the mean or size of its residuals."""
    number = int(np.clip(len(z) // LEAST, 1, SEGMENTS))
    scale = 1.0 if known or size <= 0 else size
    found = []
    for rows in np.array_split(np.arange(len(z)), number):
        own = z[rows]
        mean = 2 * stats.norm.sf(abs(own.sum()) / np.sqrt(len(own)) / scale)
        large = stats.chi2.sf(own @ own / scale**2, len(own))
        found.append(
            {
                "begin": float(times[rows[0]]),
                "end": float(times[rows[-1]]),
                "mean": float(own.mean()),
                "size": float(np.sqrt(own @ own / len(own))),
                "p": float(min(1.0, 2 * min(mean, large))),
            }
        )
    return found


def _joined(parts: list[dict[str, float]]) -> list[list[float]]:
    """Return times (begin, end) of parts, joined where they follow one another."""
    found: list[list[float]] = []
    last = -1.0
    for part in parts:
        if found and part["begin"] > found[-1][1] and part["begin"] - found[-1][1] <= last:
            found[-1][1] = part["end"]
        else:
            found.append([part["begin"], part["end"]])
        last = 0.2 * (part["end"] - part["begin"])
    return found
