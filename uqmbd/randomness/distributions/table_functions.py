"""Distributions given as tables of quantiles, univariate or coupled."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from uqmbd.arguments import typechecked
from uqmbd.errors import StudyError

if TYPE_CHECKING:
    import chaospy

__all__ = ["tabulated"]


@typechecked
def tabulated(normal: ArrayLike, values: ArrayLike, correlation: ArrayLike | None = None) -> chaospy.Distribution:
    """Return the distribution of increasing functions of standard normal variables, given as tables.

    Parameters
    ----------
    normal : array_like, shape (N,)
        Values of the standard normal variable, increasing.
    values : array_like, shape (N,) or (N, d)
        Quantiles: non-decreasing values of one function, or of each of several functions, at `normal`. The
        interpolation between the values is monotone and smooth.
    correlation : array_like, shape (d, d), optional
        Correlation matrix of the standard normal variables; required for several functions.

    Returns
    -------
    chaospy.Distribution
        Distribution for `uqmbd.RandomVariable`, or joint distribution for `uqmbd.random_vector`.

    Raises
    ------
    uqmbd.StudyError
        If shapes do not fit, if a table does not increase, or if several functions have no correlation.

    Examples
    --------
    >>> import numpy as np, uqmbd
    >>> z = np.linspace(-8, 8, 401)
    >>> length = uqmbd.RandomVariable("length", tabulated(z, np.exp(0.1 * z)), units="m")
    >>> round(length.mean, 4)
    1.005
    """
    import chaospy

    from uqmbd.randomness.distributions.tabulated_distribution import TabulatedDistribution

    at, tables = np.asarray(normal, dtype=float), np.asarray(values, dtype=float)
    several = tables.ndim == 2
    if at.ndim != 1 or len(at) < 4 or tables.shape[:1] != at.shape or tables.ndim > 2:
        raise StudyError(
            f"tabulated: normal has shape {at.shape} and values {tables.shape}; expected (N,) and (N,) or (N, d)."
        )
    columns = tables if several else tables[:, None]
    if np.any(np.diff(at) <= 0) or np.any(np.diff(columns, axis=0) < 0) or np.any(columns[0] >= columns[-1]):
        raise StudyError("tabulated: the quantiles of a table do not increase; expected increasing values.")
    if not np.isfinite(at).all() or not np.isfinite(columns).all():
        raise StudyError("tabulated: a table contains a value that is not finite; expected finite quantiles.")
    marginals = [TabulatedDistribution(at, column) for column in columns.T]
    if not several:
        return marginals[0]
    coupled = np.asarray(correlation, dtype=float) if correlation is not None else np.zeros(0)
    if coupled.shape != (len(marginals), len(marginals)):
        raise StudyError(
            f"tabulated: the correlation has shape {coupled.shape}; expected {(len(marginals), len(marginals))}."
        )
    return chaospy.Nataf(chaospy.J(*marginals), coupled)
