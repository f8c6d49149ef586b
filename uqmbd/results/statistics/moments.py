"""Accumulate moments of samples chunk by chunk, and determine scales of outputs and whether outputs vary.

An output varies if its variation exceeds the integration error, or rounding if this error is unknown.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Any

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike, NDArray

from uqmbd.arguments import Bounds, Size, shown, typechecked
from uqmbd.errors import StudyError
from uqmbd.names import did_you_mean
from uqmbd.typing import Array, Mask

__all__ = [
    "Moments",
    "NORMAL",
    "divisor",
    "independent_errors",
    "integration_error",
    "over_time",
    "relative",
    "rtol_of",
    "settled",
    "usual_errors",
    "varies",
    "varying",
]

NORMAL = 1.959963984540054
"""Half-width of a 95 % interval of a normal distribution, in standard errors."""

RAISED = 3.0
"""Multiple of the relative standard error of the variance by which the kurtosis is increased."""


@typechecked
@dataclass(frozen=True)
class Moments:
    """Number, mean and central sums of samples, which can be merged with the moments of other samples.

    Attributes
    ----------
    count : int
        Number of samples.
    mean : array, shape (...)
        Mean of the samples.
    second, third, fourth : array, shape (...)
        Sums of powers of the differences from the mean.

    References
    ----------
    P. Pebay, Formulas for robust, one-pass parallel computation of covariances and arbitrary-order statistical
    moments, Sandia report SAND2008-6212 (2008).

    Examples
    --------
    >>> whole = Moments.of([[1.0], [2.0], [6.0], [7.0]])
    >>> merged = Moments.of([[1.0], [2.0]]).merge(Moments.of([[6.0], [7.0]]))
    >>> bool(np.isclose(whole.fourth, merged.fourth).all())
    True
    """

    count: Size
    mean: Array
    second: Array
    third: Array
    fourth: Array

    @classmethod
    def of(cls, samples: ArrayLike) -> Moments:
        """Compute the moments of samples, shape (S, ...); S may be zero.

        Raises
        ------
        uqmbd.StudyError
            If the samples are a single number without an axis.
        """
        x = np.asarray(samples, dtype=float)
        if not x.ndim:
            raise StudyError(f"Moments.of: samples is {shown(samples)}; expected samples of the shape (S, ...).")
        if not len(x):
            zero = np.zeros(x.shape[1:])
            return cls(0, zero, zero, zero, zero)
        # shift by the first sample, to avoid cancellation for a small spread about a large mean
        mean = x[0] + (x - x[0]).mean(axis=0)
        d = x - mean
        square = d * d
        return cls(len(x), mean, square.sum(axis=0), (square * d).sum(axis=0), (square * square).sum(axis=0))

    def merge(self, other: Moments) -> Moments:
        """Return the moments of the samples of both objects."""
        if not self.count or not other.count:
            return other if not self.count else self
        a, b = self.count, other.count
        n = a + b
        d = other.mean - self.mean
        second = self.second + other.second + d**2 * a * b / n
        third = (
            self.third + other.third + d**3 * a * b * (a - b) / n**2 + 3 * d * (a * other.second - b * self.second) / n
        )
        fourth = (
            self.fourth
            + other.fourth
            + d**4 * a * b * (a * a - a * b + b * b) / n**3
            + 6 * d**2 * (a * a * other.second + b * b * self.second) / n**2
            + 4 * d * (a * other.third - b * self.third) / n
        )
        return Moments(n, self.mean + d * b / n, second, third, fourth)

    def statistics(self, independent: bool = True) -> dict[str, Array]:
        """Compute the statistics of `uqmbd.results.sample_statistics`, except quantiles.

        Parameters
        ----------
        independent : bool
            Whether the samples are independent, as for `uqmbd.results.sample_statistics`.

        Returns
        -------
        dict
            ``mean, std, variance, skewness, kurtosis, std_error_mean, std_error_std``, each of shape (...).

        Raises
        ------
        uqmbd.StudyError
            If there are fewer than two samples.
        """
        n = self.count
        if n < 2:
            raise StudyError(f"Statistics need at least two successful samples; the number is {n}.")
        variance = self.second / (n - 1 if independent else n)
        m2, m3, m4 = self.second / n, self.third / n, self.fourth / n
        constant = m2 <= (32 * np.finfo(float).eps * np.abs(self.mean)) ** 2
        safe = np.where(constant, 1.0, m2)
        std = np.sqrt(variance)
        skewness, kurtosis = np.where(constant, 0.0, m3 / safe**1.5), np.where(constant, 3.0, m4 / safe**2)
        unknown = np.full_like(std, np.nan)
        errors = independent_errors(std, skewness, kurtosis, n) if independent else (unknown, unknown.copy())
        return {
            "mean": self.mean,
            "std": std,
            "variance": variance,
            "skewness": skewness,
            "kurtosis": kurtosis,
            "std_error_mean": errors[0],
            "std_error_std": errors[1],
        }


def independent_errors(std: Array, skewness: Array, kurtosis: Array, count: Any) -> tuple[Array, Array]:
    """Return standard errors of mean and standard deviation of independent samples; 1.96 of them give 95 % intervals.

    `std`: from the unbiased variance, in any units; `skewness`, `kurtosis`: of the samples (divisor `count`; 3 for a
    normal distribution); `count`: number n of samples, two at least. The results are in the units of `std`; they are 0
    without variation.

    Let s be `std`, g `skewness`, k `kurtosis`, and t the 97.5 % quantile of Student's t with n - 1 degrees of freedom.

    The mean has the 95 % interval of Student's t with Johnson's term for the skewness [1]_. The error is the longer
    side of the interval, divided by 1.96: ``s / sqrt(n) (t + |g| (1 + 2 t^2) / (6 sqrt(n))) / 1.96``.

    The variance is approximated by a multiple of chi-square with ``2 / v`` degrees of freedom, at least one [2]_. Here
    v is the relative variance of the estimated variance, from the kurtosis with the divisor of the variance [3]_. For
    normal samples, the interval would be exact with the kurtosis 3 and without the increase of the kurtosis below. The
    error is the upper side of the 95 % interval of s, divided by 1.96. The upper side is used because the true
    deviation is above s more often than below.

    The kurtosis of few samples of a long tail is too small, mostly if s is also too small. Kurtosis minus one is
    therefore multiplied by ``1 + 3 sqrt((k - 1 + g^2) / n)``. The factor of three comes from experiments. With a factor
    of two, intervals for ``z^2`` and ``exp(z / 2)`` of 30 normal samples z contain the true value in less than 93 % of
    cases.

    .. [1] N. J. Johnson, Journal of the American Statistical Association 73 (1978) 536-544.
    .. [2] G. E. P. Box, Biometrika 40 (1953) 318-335.
    .. [3] D. G. Bonett, Computational Statistics and Data Analysis 50 (2006) 775-782.
    """
    from scipy.special import chdtri, stdtrit

    n = np.asarray(count, dtype=float)
    t = stdtrit(n - 1.0, 0.975)
    of_mean = std / np.sqrt(n) * (t + np.abs(skewness) * (1.0 + 2.0 * t**2) / (6.0 * np.sqrt(n)))
    raised = 1.0 + RAISED * np.sqrt((kurtosis - 1.0 + skewness**2) / n)
    # the kurtosis with the divisor of the variance avoids cancellation if the kurtosis is near 1, as for two values
    excess = np.maximum(kurtosis * (n / (n - 1.0)) ** 2 - 1.0, 0.0)
    relative = (excess * raised + 2.0 / (n - 1.0)) / n
    # chi-square has at least one degree of freedom
    freedom = np.maximum(2.0 / relative, 1.0)
    of_std = std * (np.sqrt(freedom / chdtri(freedom, 0.975)) - 1.0)
    return np.asarray(of_mean / NORMAL), np.asarray(of_std / NORMAL)


def usual_errors(std: Array, kurtosis: Array, count: Any) -> tuple[Array, Array]:
    """Return the usual standard errors of mean and standard deviation of independent samples, which are not widened.

    The errors of mean and variance are exact for any distribution. For many samples with short tails, 1.96 of them give
    95 % intervals. `std`, `kurtosis`, `count`: as for `independent_errors`.
    """
    n = np.asarray(count, dtype=float)
    excess = np.maximum(kurtosis * (n / (n - 1.0)) ** 2 - 1.0, 0.0)
    return np.asarray(std / np.sqrt(n)), np.asarray(std * np.sqrt((excess + 2.0 / (n - 1.0)) / n) / 2.0)


FACTOR = 3.0
"""Ratio of standard deviation to integration error up to which an output is constant.

The ratio exceeds one, because the integration error is estimated from few realisations.
"""

LONG = 0.1
"""Fraction of times with variation above which an output varies, independent of the error at the other times."""

ROUNDING, ALIKE, ANY = 1e-12, 1e-13, 1e-15
"""Rounding errors, relative to the largest mean of the output, of outputs in the same units, and of all outputs.

The last one applies only to outputs that are zero except for rounding.
"""

OF_TOLERANCE = 0.1
"""Integration error that is assumed if it was not measured, relative to the tolerance times the largest mean."""

SETTLED = {"skewness": 0.0, "kurtosis": 3.0, "verification_error": 0.0, "verification_factor": 1.0}
"""Statistics of an output without variation, except Sobol' indices, which are 0."""


def divisor(scale: Array) -> Array:
    """Return a divisor: the scale if it is positive, else 1; NaN remains NaN.

    >>> divisor(np.array([2.0, 0.0, np.nan])).tolist()
    [2.0, 1.0, nan]
    """
    return np.where(scale <= 0, 1.0, scale)


def over_time(values: Any) -> Array:
    """Return values (O, T) of a statistic (output, time), or (O, 1) of a statistic without time."""
    array = np.asarray(values, dtype=float)
    return array if array.ndim == 2 else array.reshape(len(array), 1)


def relative(values: Array, scale: Array, unknown: float) -> Array:
    """Return values over a scale: NaN for an unknown scale, `unknown` for a zero scale, and 0 for zero values."""
    return np.where(~(scale <= 0), values / divisor(scale), np.where(values > 0, unknown, values))


@typechecked
def varying(statistics: xr.Dataset, rtol: Annotated[float, Bounds(0)] = 0.0) -> NDArray[np.bool_]:
    """Return a mask of varying outputs.

    An output varies if its standard deviation exceeds three times the integration error. This condition must be met by
    the root mean squares over time, or at more than a tenth of the times. The error is ``integration_error_rms``, the
    root mean square over realisations, or ``integration_error`` in results without it. If both are unknown, a tenth of
    the tolerance, relative to the largest mean, is used.

    Parameters
    ----------
    statistics : xarray.Dataset
        Statistics of a method: ``mean``, ``std`` and, if known, ``integration_error``, with or without times.
    rtol : float
        Relative tolerance of the integration; 0 if unknown.

    Returns
    -------
    array of bool, shape (O,)
        Whether each output varies.

    Examples
    --------
    >>> from uqmbd.extend import labels, statistics_dataset
    >>> axes = labels(["driven", "free"], [], [0.0, 1.0])
    >>> varying(statistics_dataset(axes, mean=np.ones((2, 2)), std=[[1e-14, 3e-14], [0.0, 0.1]])).tolist()
    [False, True]
    """
    mean, std = (over_time(statistics.variables[name].values) for name in ("mean", "std"))
    if not std.size:
        return np.zeros(len(std), dtype=bool)
    known = np.isfinite(mean) & np.isfinite(std)
    error, rounding = _errors(statistics, rtol)
    limit = np.maximum(FACTOR * error, rounding)
    std, limit = np.where(known, std, 0.0), np.where(known, limit, 0.0)
    count = np.maximum(known.sum(axis=1), 1)
    scale = np.maximum(np.maximum(std, limit).max(axis=1, keepdims=True), np.finfo(float).tiny)
    whole = ((std / scale) ** 2).sum(axis=1) > ((limit / scale) ** 2).sum(axis=1)
    often = ((std > limit) & known).sum(axis=1) > LONG * count
    return np.asarray(whole | often)


@typechecked
def varies(node: xr.DataTree, output: str) -> bool:
    """Return whether an output of a method varies; see :func:`varying`.

    Parameters
    ----------
    node : xarray.DataTree
        Node of a propagator.
    output : str
        Name of the output.

    Raises
    ------
    StudyError
        If there is no such output.

    Examples
    --------
    >>> import numpy as np
    >>> from uqmbd.results import propagator_node, varies
    >>> from uqmbd.extend import labels, statistics_dataset
    >>> def node(outputs, times, values):
    ...     axes = labels(outputs, [], times)
    ...     statistics = statistics_dataset(axes, mean=values, std=np.zeros_like(values))
    ...     return propagator_node("mine", statistics, propagator="perturbation", realisations=1, wall_time=0.1)
    >>> varies(node(["height"], [0.0, 1.0], [[0.0, 3.0]]), "height")  # its standard deviation is zero
    False
    """
    statistics = node.children["statistics"].to_dataset()
    names = [str(n) for n in statistics["output"].values]
    if output not in names:
        near = did_you_mean(output, names) or "."
        raise StudyError(f"varies: the dataset has no output {output!r}{near} Its outputs are: {', '.join(names)}.")
    return bool(varying(statistics, rtol_of(node))[names.index(output)])


def settled(statistics: xr.Dataset, rtol: float = 0.0, verified: Array | None = None) -> xr.Dataset:
    """Replace Sobol' indices, shape and stated error of outputs without variation by neutral values.

    For these outputs, Sobol' indices, the stated error of a surrogate and the skewness are 0. The kurtosis is 3, and
    the uncertainty factor of the stated error is 1. Mean and standard deviation are unchanged.

    `statistics`: statistics of a method; `rtol`: tolerance of the integration, 0 if unknown; `verified` (O, T):
    standard deviation of the verification realisations of a surrogate. An output that varies in these realisations
    counts as varying for any statistics of the surrogate.
    """
    moves = varying(statistics, rtol)
    if verified is not None:
        moves = moves | _varies_where_verified(statistics, verified, rtol)
    if moves.all():
        return statistics
    found = statistics.copy()
    for name, variable in found.variables.items():
        settles = str(name).startswith("sobol_") or name in SETTLED
        if settles and "output" in variable.dims:
            mask = moves.reshape([-1 if dim == "output" else 1 for dim in variable.dims])
            still = SETTLED.get(str(name), 0.0)
            variable.data = np.where(mask | np.isnan(variable.values), variable.values, still)
    return found


def _varies_where_verified(statistics: xr.Dataset, verified: Array, rtol: float) -> Mask:
    """Return a mask (O,) of outputs that vary in the verification realisations, of standard deviation (O, T)."""
    # the integration of these realisations has its own steps, so errors of other realisations may not apply
    seen = statistics.assign(std=statistics["std"].copy(data=verified))
    unmeasured = seen.drop_vars(["integration_error_rms", "integration_error"], errors="ignore")
    return np.asarray(varying(seen, rtol) & varying(unmeasured, rtol))


def rtol_of(node: xr.DataTree) -> float:
    """Return the tolerance of the integration from the study of a node; 0 if unknown."""
    return float(node.attrs.get("rtol", node.root.attrs.get("rtol", 0.0)))


def integration_error(statistics: xr.Dataset, rtol: float = 0.0) -> Array:
    """Return the integration error (O, T), stated or estimated from the tolerance, or rounding if this is larger.

    `statistics`: statistics of a method; `rtol`: tolerance of the integration, 0 if unknown.
    """
    return np.maximum(*_errors(statistics, rtol))


def _errors(statistics: xr.Dataset, rtol: float) -> tuple[Array, Array]:
    """Return the errors (O, T) of the integration and of rounding."""
    variables = statistics.variables
    mean = over_time(variables["mean"].values)
    if not mean.size:
        return np.zeros(mean.shape), np.zeros(mean.shape)
    size = np.where(np.isfinite(mean), np.abs(mean), 0.0).max(axis=1)
    units = variables["output_units"].values if "output_units" in variables else np.full(len(size), "")
    kinds, kind = np.unique(units.astype(str), return_inverse=True)
    of_kind = np.zeros(len(kinds))
    np.maximum.at(of_kind, kind, size)
    alike = of_kind[kind]
    largest = size.max()
    rounding = np.maximum(ROUNDING * size, ALIKE * alike)
    stated = np.full(mean.shape, np.nan)
    # prefer the root mean square to the bound of the largest error, which is larger
    named = next((name for name in ("integration_error_rms", "integration_error") if name in variables), "")
    if named:
        stated = over_time(variables[named].values)
    # outputs in other units determine the rounding error only if the integration error is unknown
    unknown = ~np.isfinite(stated).any(axis=1) & (size <= ANY * largest)
    rounding = np.where(unknown, np.maximum(rounding, ANY * largest), rounding)
    error = np.where(np.isfinite(stated), stated, (OF_TOLERANCE * rtol * size)[:, None])
    return error, np.broadcast_to(rounding[:, None], mean.shape)
