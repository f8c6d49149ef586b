"""Realisations of a control model for each sample, and the gain on an equal budget."""

from __future__ import annotations

import numpy as np

__all__ = ["MOST", "equal_budget", "optimum"]


MOST = 1000.0
"""Most realisations of the cheaper model for a sample."""


def equal_budget(left: float, ratio: float, cost: float) -> float:
    """Return the variance of plain Monte Carlo over that with a low-cost control model, on an equal budget.

    Let l = `left` be the share of the variance that the control leaves (one less the squared correlation). Let r =
    `ratio` be its realisations for each sample (those at the samples included). Let w = `cost` be the cost of its
    realisation over that of a sample. The result is 1 / ((l + (1 - l) / r) (1 + w r)): Peherstorfer, Willcox and
    Gunzburger, SIAM Journal on Scientific Computing 38 (2016) A3163-A3194.
    """
    return 1.0 / ((left + (1.0 - left) / ratio) * (1.0 + cost * ratio))


def optimum(left: float, cost: float) -> float:
    """Return the ratio at which variance times cost is least, sqrt((1 - l) / (w l)), within 1 to `MOST`.

    See `equal_budget`. It is 1, no realisations except those at the samples, where plain Monte Carlo is as efficient.
    """
    ratio = float(np.clip(np.sqrt(max(1.0 - left, 0.0) / max(cost * left, 1e-300)), 1.0, MOST))
    return ratio if equal_budget(left, ratio, cost) > 1.0 else 1.0
