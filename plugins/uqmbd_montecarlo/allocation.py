"""How many realisations of a cheaper model pay beside samples, and what they bring on an equal budget."""

from __future__ import annotations

import numpy as np

__all__ = ["MOST", "equal_budget", "optimum"]


MOST = 1000.0
"""Most realisations of the cheaper model for a sample."""


def equal_budget(left: float, ratio: float, cost: float) -> float:
    r"""Return the variance of plain Monte Carlo over that with a cheaper model, on an equal budget.

    With :math:`l` the share of the variance that the cheaper model leaves, :math:`r` its realisations for each sample
    and :math:`w` their cost, this is :math:`1 / ((l + (1 - l) / r) (1 + w r))` [1]_.

    Parameters
    ----------
    left : float
        One less the square of the correlation.
    ratio : float
        Realisations of the cheaper model for each sample, those at the samples included.
    cost : float
        Of a realisation of the cheaper model over that of a sample.

    References
    ----------
    .. [1] B. Peherstorfer, K. Willcox and M. Gunzburger, SIAM Journal on Scientific Computing 38 (2016) A3163-A3194.

    Examples
    --------
    >>> equal_budget(0.0, 10.0, 0.1), equal_budget(1.0, 1.0, 0.5)
    (5.0, 0.6666666666666666)
    """
    return 1.0 / ((left + (1.0 - left) / ratio) * (1.0 + cost * ratio))


def optimum(left: float, cost: float) -> float:
    r"""Return the ratio at which variance times cost is least, :math:`\sqrt{(1 - l) / (w l)}`, 1 to `MOST`.

    It is 1, no realisations beside those at the samples, where plain Monte Carlo would do as well.

    Parameters
    ----------
    left, cost : float
        As of `equal_budget`.

    Examples
    --------
    >>> round(optimum(0.01, 0.01), 6), optimum(0.0, 0.1), optimum(0.9, 0.1)
    (99.498744, 1000.0, 1.0)
    """
    ratio = float(np.clip(np.sqrt(max(1.0 - left, 0.0) / max(cost * left, 1e-300)), 1.0, MOST))
    return ratio if equal_budget(left, ratio, cost) > 1.0 else 1.0
