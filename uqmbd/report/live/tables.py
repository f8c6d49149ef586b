"""The inputs as a page's script maps them: from germs to values and back, and how probable lower ones are.

A slider moves a germ.  Germs are independent, and the surrogate is a function of them.  Where inputs are independent,
germ and value of an input are functions of each other.  Where a Gaussian copula couples inputs, all germs of the group
together give the values: a slider moves what its own germ adds to the inputs before it, and those behind it follow.  A
general joint distribution is not evaluated in a page: no values are shown, with the reason; the levels of germs are.
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
"""Of a table."""

BETWEEN = np.arange(1, 16) / 16
"""Where between two knots the error of a table is measured."""

SAFE = 1.1
"""Factor of that error, for what lies between these points."""

TAIL = 1e-3
"""Probability of what lies beyond each end of a slider, where the distribution has no near end."""

REMOTE = 1e-12
"""Probability of what lies beyond each end of the values that a page accepts."""

NEAR = 0.05
"""Part of a slider's length by which it is extended to the end of a distribution."""

NODES = 40
"""Of the Gauss rule for means: exact for inputs that are linear or polynomial in their germs."""

GRID = 8.0
"""Standard normal up to which means of tables are summed."""

UNKNOWN = (
    "It depends on other inputs by a joint distribution that this page does not evaluate. Its slider shows the "
    "probability of lower values, given the inputs before it."
)
"""Why an input has no values."""

FARTHEST = 6.0
"""Standard normal up to which a table of quantiles reaches."""


def germ_data(space: GermSpace, verified: Array | None) -> list[dict[str, Any]]:
    """Describe the germs.

    `verified` (V, d): germ points of verification realisations. Return for each germ ``name``; ``support``, ends of
    which are None where there is none; ``reach``, ends of what a page accepts; ``range``, that of its slider;
    ``start``, the median; ``verified``, the range in which its error is known, or None; ``values`` and ``levels`` of a
    germ that takes few values; else ``table``, the distribution function over the range.
    """
    return [_germ(germ, None if verified is None else verified[:, k]) for k, germ in enumerate(space.germs)]


def input_data(space: GermSpace, labels: Labels) -> list[dict[str, Any]]:
    """Describe the inputs.

    Return for each input ``name``, ``units``, ``description``; ``sum``, the germs and weights of its standard
    variable; ``map`` of that to its value, and its ``mean``; or ``reason``, why there is no map.
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
    """Return the ends of the support, or where it has none, those of all but a share `REMOTE` of the realisations."""
    ends = zip(germ.bounds, germ.from_uniform([REMOTE, 1 - REMOTE]).tolist(), strict=True)
    return [float(bound if np.isfinite(bound) else remote) for bound, remote in ends]


def _mean(marginal: Marginal, germ: Germ) -> float | None:
    """Return the mean of an input: its standard variable is distributed as its germ, whatever it depends on."""
    if marginal.kind == "quantile":
        # its standard variable is normal; the map may have kinks, for which Gauss rules are no good
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
    """Tabulate a function that does not fall, with slopes that keep it so, and the largest error, measured between."""
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
