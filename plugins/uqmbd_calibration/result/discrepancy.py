"""Test of a record against the model by its residuals, in total and by intervals of time."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy import stats

from uqmbd.typing import Array
from uqmbd_calibration.inference import FREEDOM, Block

__all__ = ["SIGNIFICANCE", "Residuals", "find_discrepancy", "residuals"]


SIGNIFICANCE = 1e-3
"""Significance level: a record with a smaller p-value contradicts the model or the stated noise."""

SEGMENTS, LEAST = 12, 8
"""Largest number of tested time intervals, and least number of values in each."""

FAR = 4.0
"""Standard deviations beyond which a value is an outlier."""

OUTLYING = 10.0
"""Outlier limit for unknown noise or many outliers, in standard deviations estimated from the median residual."""

FEW, SHOWN = 0.05, 10
"""Outliers are listed up to this share of the values (a single one always); largest length of the list."""


@dataclass(frozen=True, eq=False)
class Residuals:
    """Residuals of one output of a record."""

    block: Block  # measured values
    raw: Array  # (n,): values minus predictions and bias, divided by the standard deviation of the noise
    predicted: Array  # (n,): predictions plus bias
    # (n,): for robust noise, `raw` as quantiles of a standard normal distribution; otherwise equal to `raw`
    normal: Array
    taken: float  # degrees of freedom of a bias that the likelihood integrates over


def residuals(block: Block, prediction: Array, vector: Array, sigma: float) -> Residuals:
    """Return residuals for a vector of unknowns and a noise level `sigma`.

    `prediction` is (n,), or (K, n), whose residuals are averaged. The mean prediction can fit although the prediction
    at mean inputs does not, for example if the record determines only a product of inputs.
    """
    misfit = block.misfit(np.atleast_2d(prediction), np.atleast_2d(vector)).mean(axis=0, keepdims=True)
    level = np.array([sigma])
    rest = misfit - block.bias(misfit, level)
    raw = -rest[0] / np.sqrt(sigma**2 + block.variance)
    normal = stats.norm.ppf(np.clip(stats.t.cdf(raw, FREEDOM), 1e-15, 1 - 1e-15)) if block.robust else raw
    taken = 0.0
    if not block.robust and block.modes.shape[1]:
        # degrees of freedom of the bias: sum of the shares of its modes in the variance
        own = np.maximum(np.linalg.eigvalsh(block.modes.T @ block.modes), 0.0)
        taken = float((own / (sigma**2 + own)).sum())
    return Residuals(block, raw, block.values + rest[0], normal, taken)


def find_discrepancy(found: Residuals, parameters: float) -> dict[str, Any]:
    """Return the evidence of residuals against the model.

    `parameters`: number of unknowns fitted to these values. The mapping has the keys

    - ``record``, ``output``: names of the record and of the output
    - ``values``: number of values
    - ``robust``: whether the noise is robust (Student's t distribution)
    - ``chi_square``: probability of residuals that are at least as large; only for known noise
    - ``correlation``, ``correlation_p``: correlation of neighbouring residuals, and its probability
    - ``segments``: time intervals, each with its ends in s, its probability, and the `mean` and `size` of its residuals
    - ``p``: p-value, corrected for the number of tests
    - ``where``: times of unexplained segments
    - ``outliers``: number of outliers
    - ``outlier_values``: the largest outliers if they are few, each with its time in s or its number, its value and its
      deviations
    - ``largest``: largest absolute residual, in standard deviations of the noise
    - ``rejected``: whether the record contradicts the model
    """
    block, z = found.block, found.normal
    count = len(z)
    freedom = float(np.maximum(count - parameters - found.taken, 1.0))
    known = block.noise is not None
    test: dict[str, Any] = {"record": block.record, "output": block.output, "values": count, "robust": block.robust}
    tests: list[float] = []
    if known:
        test["chi_square"] = float(stats.chi2.sf(z @ z, freedom))
        tests.append(test["chi_square"])
    size = float(np.sqrt(z @ z / freedom))
    if not block.timeless and count >= 3 * LEAST:
        lag = float(z[1:] @ z[:-1]) / max(float(z @ z), 1e-300)
        test |= {"correlation": lag, "correlation_p": float(stats.norm.sf(lag * np.sqrt(count)))}
        tests.append(test["correlation_p"])
        parts = _segments(block.times, z, size, known=known)
        test["segments"] = parts
        tests.append(min(1.0, min(part["p"] for part in parts) * len(parts)))
    test["p"] = min(1.0, min(tests, default=1.0) * max(len(tests), 1))
    if parts := test.get("segments", []):
        strange = [part for part in parts if part["p"] * len(parts) < 0.01]
        worst = [min(parts, key=lambda part: float(part["p"]))] if test["p"] < SIGNIFICANCE else []
        test["where"] = _joined(strange or worst)
    away = np.abs(found.raw)
    few = max(FEW * count, 1)
    if not known or np.count_nonzero(away > FAR) > few:
        # outliers increase an estimated noise level and shift estimated inputs, so other deviations also become large
        usual = float(np.median(away)) / stats.norm.ppf(0.75)
        standing_out = away > OUTLYING * usual
        if not known:
            away = np.where(standing_out, away / usual, 0.0) if usual > 0 else np.zeros(count)
        elif 0 < np.count_nonzero(standing_out) <= few:
            away = np.where(standing_out, away, 0.0)
    test["outliers"] = int(np.count_nonzero(away > FAR))
    test["outlier_values"] = []
    if 0 < test["outliers"] <= few:
        test["outlier_values"] = [
            {
                **({"number": k + 1} if block.timeless else {"time": float(block.times[k])}),
                "value": float(block.values[k]),
                "deviations": float(away[k]),
            }
            for k in np.argsort(-away, kind="stable")[: test["outliers"]][:SHOWN].tolist()
        ]
    test["largest"] = float(np.abs(found.raw).max())
    test["rejected"] = bool(test["p"] < SIGNIFICANCE) or (not known and bool(test["outlier_values"]))
    return test


def _segments(times: Array, z: Array, size: float, *, known: bool) -> list[dict[str, float]]:
    """Return intervals of time, each with the p-value of the mean or size of its residuals."""
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
    """Return times (begin, end) of intervals; adjacent intervals are merged."""
    found: list[list[float]] = []
    last = -1.0
    for part in parts:
        if found and part["begin"] > found[-1][1] and part["begin"] - found[-1][1] <= last:
            found[-1][1] = part["end"]
        else:
            found.append([part["begin"], part["end"]])
        last = 0.2 * (part["end"] - part["begin"])
    return found
