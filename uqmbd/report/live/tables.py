"""Tables of inputs for the scripts of a page: maps from germs to values and back, and cumulative probabilities.

A slider moves a germ. Germs are independent, and the surrogate is a function of the germs. If inputs are independent,
germ and value of an input are functions of each other. If a Gaussian copula couples inputs, each value depends on its
own germ and on the germs of the preceding inputs in the group. A slider then also changes the values of the following
inputs. A page does not evaluate general joint distributions: it shows the levels of the germs, and the reason for
missing values.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from uqmbd.randomness import Germ, GermSpace, cumulated
from uqmbd.randomness.space import CorrelatedTransform, Marginal
from uqmbd.report.charts import packed
from uqmbd.results.schema import Labels
from uqmbd.typing import Array
from uqmbd.wording import typeset_units

__all__ = ["germ_data", "input_data"]


KNOTS = 257
"""Number of knots of a table."""

BETWEEN = np.arange(1, 16) / 16
"""Relative positions between two knots for the measurement of the error of a table."""

SAFE = 1.1
"""Safety factor of the measured error, because the error between these positions may be larger."""

TAIL = 1e-3
"""Probability beyond each end of a slider, unless the end of the distribution is nearby."""

REMOTE = 1e-12
"""Probability beyond each end of the range of values that a page accepts."""

NEAR = 0.05
"""Maximum extension of a slider to a nearby end of the distribution, relative to the length of the slider."""

NODES = 40
"""Number of nodes of the Gauss rule for means; it is exact for inputs that are polynomials of their germs."""

GRID = 8.0
"""Largest standard normal value in the numerical integration of means from tables."""

UNKNOWN = (
    "This input depends on other inputs by a joint distribution that this page does not evaluate. Its slider shows "
    "the probability of lower values, given the preceding inputs."
)
"""Reason why an input has no values."""

FARTHEST = 6.0
"""Largest standard normal value in a table of quantiles."""


def germ_data(space: GermSpace, verified: Array | None) -> list[dict[str, Any]]:
    """Describe the germs.

    `verified` (V, d) are germ points of verification realisations. The keys of each germ are ``name``, ``support``
    (infinite ends are None), ``reach`` (ends of accepted values), ``range`` (of the slider) and ``start`` (the median).
    ``verified`` is the range in which the error is known, or None. A discrete germ has ``values`` and ``levels``; other
    germs have ``table``, the distribution function over the range.
    """
    return [_germ(germ, None if verified is None else verified[:, k]) for k, germ in enumerate(space.germs)]


def input_data(space: GermSpace, labels: Labels) -> list[dict[str, Any]]:
    """Describe the inputs.

    The keys of each input are ``name``, ``units``, ``description``, ``sum``, ``map`` and ``mean``. The standard
    variable of an input is a weighted sum of germs: ``sum`` contains the germs and their weights. ``map`` maps this
    variable to the value of the input. If there is no map, ``reason`` states why.
    """
    found: list[dict[str, Any]] = [
        {
            "name": i.name,
            "units": typeset_units(i.units),
            "description": i.description,
            "sum": [],
            "map": None,
            "mean": None,
            "reason": "",
        }
        for i in labels.inputs
    ]
    for group in space.groups:
        for row, column in enumerate(group.columns):
            if not isinstance(group, CorrelatedTransform):
                found[column]["reason"] = UNKNOWN
                continue
            weights = [(group.columns[k], float(group.factor[row, k])) for k in group.order if group.factor[row, k]]
            marginal = group.marginals[row]
            mean = _mean(marginal, space.germs[column])
            found[column] |= {"sum": [list(pair) for pair in weights], "map": _map(marginal), "mean": mean}
    return found


def _germ(germ: Germ, verified: Array | None) -> dict[str, Any]:
    low, high = (float(x) for x in germ.from_uniform([TAIL, 1 - TAIL]))
    margin = NEAR * (high - low)
    begin = germ.bounds[0] if germ.bounds[0] >= low - margin else low
    end = germ.bounds[1] if germ.bounds[1] <= high + margin else high
    found: dict[str, Any] = {
        "name": germ.name,
        "support": [_finite(x) for x in germ.bounds],
        "reach": _reach(germ),
        "range": [begin, end],
        "start": float(germ.from_uniform([0.5])[0]),
        "verified": None if verified is None else [float(verified.min()), float(verified.max())],
        "values": None,
        "levels": None,
        "table": None,
    }
    if germ.values is not None and germ.table is not None:
        found |= {"range": list(germ.bounds), "levels": packed(germ.table[0]), "values": packed(germ.table[1])}
        return found
    return found | {"table": _table(lambda x: cumulated(germ, x), begin, end)}


def _reach(germ: Germ) -> list[float]:
    """Return the ends of the support; quantiles with the probability `REMOTE` beyond them replace infinite ends."""
    ends = zip(germ.bounds, germ.from_uniform([REMOTE, 1 - REMOTE]).tolist(), strict=True)
    return [float(bound if np.isfinite(bound) else remote) for bound, remote in ends]


def _mean(marginal: Marginal, germ: Germ) -> float | None:
    """Return the mean of an input; the distribution of its standard variable equals that of its germ."""
    if marginal.kind == "quantile":
        # the standard variable is normal; a grid replaces a Gauss rule, because the map may have kinks
        nodes = np.linspace(-GRID, GRID, 4001)
        weights = np.exp(-(nodes**2) / 2)
        return _finite(float(weights @ marginal.to_input(nodes) / weights.sum()))
    nodes, weights = germ.gauss(NODES if germ.values is None else min(germ.values, NODES))
    return _finite(float(weights @ marginal.to_input(nodes)))


def _map(marginal: Marginal) -> dict[str, Any]:
    bounds = [_finite(x) for x in marginal.bounds]
    if marginal.kind == "affine":
        return {"kind": "affine", "bounds": bounds, "shift": marginal.shift, "scale": marginal.scale}
    if marginal.kind == "exponential":
        numbers = {name: float(getattr(marginal, name)) for name in ("shift", "scale", "mu", "sigma")}
        return {"kind": "exponential", "bounds": bounds, **numbers}
    return {"kind": "table", "bounds": bounds, "table": _table(marginal.to_input, -FARTHEST, FARTHEST)}


def _table(function: Callable[[Array], Array], begin: float, end: float) -> dict[str, Any]:
    """Tabulate a monotonic function: values and slopes of a monotonic interpolation, and its largest error."""
    from scipy.interpolate import PchipInterpolator

    knots = np.linspace(begin, end, KNOTS)
    values = np.maximum.accumulate(function(knots))
    curve = PchipInterpolator(knots, values)
    between = (knots[:-1, None] + BETWEEN * np.diff(knots)[:, None]).ravel()
    return {
        "begin": begin,
        "end": end,
        "values": packed(values),
        "slopes": packed(curve.derivative()(knots)),
        "error": SAFE * float(np.abs(curve(between) - function(between)).max()),
    }


def _finite(x: float) -> float | None:
    return float(x) if np.isfinite(x) else None
