"""Number of realisations of a control model for each sample, and the variance reduction on an equal budget."""

from __future__ import annotations

import numpy as np

__all__ = ["MOST", "equal_budget", "optimum"]


MOST = 1000.0
"""Largest number of realisations of the low-cost model for a sample."""


def equal_budget(left: float, ratio: float, cost: float) -> float:
    """Return the ratio of variances of plain Monte Carlo and of Monte Carlo with a low-cost model, on an equal budget.

    Let l = `left` be the share of the variance that the control leaves (one minus the squared correlation). Let r =
    `ratio` be the number of control realisations for each sample, including the control realisation at the sample. Let
    w = `cost` be the cost of a control realisation divided by the cost of a sample. The result is 1 / ((l + (1 - l) /
    r) (1 + w r)): Peherstorfer, Willcox and Gunzburger, SIAM Journal on Scientific Computing 38 (2016) A3163-A3194.
    """
    return 1.0 / ((left + (1.0 - left) / ratio) * (1.0 + cost * ratio))


def optimum(left: float, cost: float) -> float:
    """Return the ratio sqrt((1 - l) / (w l)) that minimises variance times cost, limited to the range from 1 to `MOST`.

    See `equal_budget`. The ratio is 1, without further control realisations, if plain Monte Carlo is as efficient.
    """
    ratio = float(np.clip(np.sqrt(max(1.0 - left, 0.0) / max(cost * left, 1e-300)), 1.0, MOST))
    return ratio if equal_budget(left, ratio, cost) > 1.0 else 1.0
