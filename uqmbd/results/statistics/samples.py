"""Compute statistics of samples, with standard errors, without loss of digits and with a check for failures."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from functools import partial
from itertools import accumulate
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike, NDArray

from uqmbd.arguments import typechecked
from uqmbd.errors import StudyError
from uqmbd.results.schema import DEFAULT_PROBABILITIES, InputInfo, Labels, output_infos, statistics_dataset
from uqmbd.results.statistics.circular import circular_of_samples
from uqmbd.results.statistics.moments import Moments, divisor, independent_errors
from uqmbd.results.statistics.quantile_intervals import interval_of_ranks, interval_of_replicates
from uqmbd.results.statistics.quantiles import NOT_FINITE, interpolated, levels_of, ranks_of
from uqmbd.results.statistics.replicates import replicate_errors
from uqmbd.status import Status

__all__ = ["replicate_statistics", "running_statistics", "sample_statistics", "statistics_of_samples"]

# Spread, relative to the size of the values, below which differences are rounding errors without a meaningful shape.
_ROUNDING = 32.0 * np.finfo(float).eps

BLOCK_NUMBERS = 200_000
"""Number of samples (8 bytes each) of a block of columns, with two more such arrays; 4 MB took 50 % longer."""

LEAST_COLUMNS = 8
"""Minimum number of columns of a block; columns in the same cache line are read together."""


@typechecked
def sample_statistics(
    response: ArrayLike,
    probabilities: Sequence[float] = DEFAULT_PROBABILITIES,
    *,
    status: ArrayLike | None = None,
    independent: bool = True,
    replicates: Sequence[int] | None = None,
    each: Callable[..., Iterable[Any]] = map,
) -> dict[str, NDArray[np.float64]]:
    r"""Compute the statistics of samples.

    For :math:`n` independent samples, 1.96 standard errors to either side of an estimate contain the true value in 95 %
    of runs. The estimates are the mean and the standard deviation. This includes few samples of a skewed output. For
    many samples with short tails, the errors equal the usual errors: :math:`s / \sqrt{n}` and :math:`\sqrt{\left(m_4 -
    \frac{n-3}{n-1} s^4\right) / n} \, / \, (2 s)`. Here :math:`s^2` is the unbiased variance and :math:`m_4` the fourth
    central moment (divisor :math:`(n-1)^2 / n`). The second error follows from the exact variance of :math:`s^2` for
    any distribution ([1]_, section 2.3). For fewer samples, the errors are larger. The error of the mean includes
    Student's t and a term for the skewness [2]_. The error of :math:`s` is :math:`(u - s) / 1.96` with the upper end
    :math:`u` of the interval of chi-square. The degrees of freedom follow from the kurtosis [3]_. The kurtosis is
    increased first, because few samples of a long tail have too small a kurtosis.

    The divisor :math:`n - 1` of :math:`s^2` compensates for the variance :math:`\sigma^2 / n` of the mean of
    independent samples. The mean over points of a design (Latin hypercube, Sobol', Halton) is much more accurate: their
    divisor is :math:`n`, and their standard errors come from replicates (`replicate_errors`).

    Parameters
    ----------
    response : array_like, shape (S, ...)
        Samples along the first axis; commonly (S, O, T).
    probabilities : sequence of float
        Probabilities of the P quantiles, increasing, between 0 and 1.
    status : array_like of int, shape (S,), optional
        Status of each sample. Samples whose status is not 0 are excluded. Default: all samples are used.
    independent : bool
        Whether the samples are independent; otherwise they are the points of a design.
    replicates : sequence of int, optional
        Numbers of samples of the independent replicates of a design, which follow each other; their sum is S.
    each : callable, optional
        Function like ``map``, the default, that applies a function to blocks of columns. The ``map`` of an executor of
        threads, and ``problem.runner.each``, process several blocks at once, with the same results.

    Returns
    -------
    dict of str to numpy.ndarray
        ``mean``, ``std``, ``variance``, ``skewness``, ``kurtosis`` (3 for a normal distribution), ``std_error_mean``,
        ``std_error_std``, ``smallest`` and ``largest``, each of shape (...). ``quantile`` of shape (P, ...), by linear
        interpolation, and ``probability`` (P,). Pass them as ``statistics_dataset(labels, **it)``. The standard errors
        of a design are NaN, because one set of points has no spread. If all samples agree to rounding, the skewness is
        0 and the kurtosis 3.

        For independent samples, the result also contains ``quantile_interval``, shape (2, P, ...): samples whose ranks
        enclose each quantile in at least 95 % of runs [4]_. An end is infinite if there are too few samples for it.
        With `replicates`, the interval contains the values at which the share of smaller samples agrees with the
        probability of the quantile. The test uses Student's t of the shares of the replicates.

    Raises
    ------
    StudyError
        If fewer than two samples remain, one of these is not finite, or the probabilities are invalid.

    References
    ----------
    .. [1] E. L. Lehmann and G. Casella, Theory of Point Estimation, 2nd edition, Springer, 1998.
    .. [2] N. J. Johnson, Journal of the American Statistical Association 73 (1978) 536-544.
    .. [3] G. E. P. Box, Biometrika 40 (1953) 318-335.
    .. [4] H. A. David and H. N. Nagaraja, Order Statistics, 3rd edition, Wiley, 2003, section 7.1.

    Examples
    --------
    >>> found = sample_statistics([[1.0], [2.0], [3.0], [4.0]], probabilities=[0.5])
    >>> found["mean"].tolist(), round(float(found["std"][0]), 6), found["quantile"].tolist()
    ([2.5], 1.290994, [[2.5]])
    """
    samples = np.asarray(response, dtype=float)
    if samples.ndim == 0:
        raise StudyError("The samples are a single number; expected samples along the first axis.")
    if status is not None:
        ok = np.asarray(status) == Status.OK
        if ok.shape != samples.shape[:1]:
            raise StudyError(
                f"'status' has the shape {ok.shape}; expected one number for each of the {len(samples)} samples."
            )
        # copy only if samples failed, so that memory contains a large response once
        samples = samples if ok.all() else samples[ok]
    levels = levels_of(probabilities)
    n = len(samples)
    if n < 2:
        raise StudyError(
            f"Statistics need at least two successful samples; only {n} of {len(np.asarray(response))} succeeded. "
            "Check the messages of the failed samples, or use more samples."
        )
    shape = samples.shape[1:]
    if not samples.size:
        raise StudyError(f"Statistics need at least one output; the response has the shape {samples.shape}.")
    # process columns in blocks, so that a large response needs little additional memory
    columns = samples.reshape(n, -1)
    width = max(LEAST_COLUMNS, BLOCK_NUMBERS // n)
    blocks = [columns[:, k : k + width] for k in range(0, columns.shape[1], width)]
    if replicates is not None:
        ends = np.cumsum(replicates, dtype=np.int64)
        if independent or not len(ends) or ends[-1] != len(np.asarray(response)) or min(replicates) < 0:
            raise StudyError(
                f"'replicates' is {list(replicates)}; expected the numbers of samples of the replicates of a design "
                f"(independent=False), with the sum {len(np.asarray(response))}."
            )
        fine = np.ones(ends[-1], dtype=bool) if status is None else np.asarray(status) == Status.OK
        replicates = [int(np.count_nonzero(part)) for part in np.split(fine, ends[:-1])]
    about: dict[str, Any] = {"levels": levels, "independent": independent, "replicates": replicates}
    parts = list(each(partial(_block_statistics, **about), blocks))
    found = {name: np.concatenate([part[name] for part in parts], axis=-1) for name in parts[0]}
    found = {name: x.reshape((*x.shape[:-1], *shape)) for name, x in found.items()}
    found["probability"] = levels
    return found


def _block_statistics(
    block: NDArray[np.float64], levels: NDArray[np.float64], independent: bool, replicates: Sequence[int] | None
) -> dict[str, NDArray[np.float64]]:
    """Compute statistics of samples (S, C) for each of the C columns."""
    n = len(block)
    # One sort of contiguous rows (one for each column) gives quantiles, extremes and the median, which is the shift.
    x = np.sort(np.ascontiguousarray(block.T), axis=1)
    if not (np.all(np.isfinite(x[:, 0])) and np.all(np.isfinite(x[:, -1]))):
        raise StudyError(NOT_FINITE)
    below, part = ranks_of(levels, n)
    quantile = interpolated(x[:, below].T, x[:, below + 1].T, part)
    interval = {}
    if independent:
        interval = {"quantile_interval": interval_of_ranks(x, levels)}
    elif replicates is not None:
        rows = np.ascontiguousarray(block.T)
        interval = {"quantile_interval": interval_of_replicates(rows, replicates, levels)}
    smallest, largest = x[:, 0].copy(), x[:, -1].copy()

    reach = np.maximum(np.abs(x[:, 0]), np.abs(x[:, -1]))
    spread = x[:, -1] - x[:, 0]
    centre = x[:, n // 2].copy()
    # Shift by a sample and scale by the spread, to avoid cancellation for 1e5 + 1e-3 noise and underflow for 1e-100.
    unit = divisor(spread)
    x -= centre[:, None]
    x /= unit[:, None]
    shift = x.mean(axis=1)
    x -= shift[:, None]
    square = x * x
    m2 = square.mean(axis=1)
    m3 = np.einsum("cs,cs->c", square, x) / n
    m4 = np.einsum("cs,cs->c", square, square) / n
    variance = m2 * n / (n - 1) if independent else m2
    std = np.sqrt(variance)
    unknown = np.full_like(std, np.nan)

    shapeless = (spread <= _ROUNDING * reach) | (m2 == 0)
    safe = np.where(shapeless, 1.0, m2)
    skewness, kurtosis = np.where(shapeless, 0.0, m3 / safe**1.5), np.where(shapeless, 3.0, m4 / safe**2)
    errors = independent_errors(unit * std, skewness, kurtosis, n) if independent else (unknown, unknown.copy())
    return {
        "mean": centre + unit * shift,
        "std": unit * std,
        "variance": (unit * std) ** 2,
        "skewness": skewness,
        "kurtosis": kurtosis,
        "std_error_mean": errors[0],
        "std_error_std": errors[1],
        "quantile": quantile,
        "smallest": smallest,
        "largest": largest,
        **interval,
    }


def running_statistics(values: ArrayLike, counts: ArrayLike) -> dict[str, NDArray[np.float64]]:
    """Compute mean and standard deviation, with standard errors, of the first n samples for several numbers n.

    `values` (S,): independent samples, in the order in which they were drawn; `counts` (N,): numbers of samples, each
    from 2 to S. Return ``mean``, ``std``, ``std_error_mean`` and ``std_error_std``, each of shape (N,), as from
    :func:`sample_statistics` of ``values[:n]``. Raise StudyError if a number is below 2 or above S.

    >>> found = running_statistics([1.0, 2.0, 3.0, 4.0], [2, 4])
    >>> found["mean"].tolist(), found["std"].round(6).tolist()
    ([1.5, 2.5], [0.707107, 1.290994])
    """
    x = np.asarray(values, dtype=float)
    n = np.asarray(counts, dtype=int)
    if x.ndim != 1 or np.any(n < 2) or np.any(n > len(x)):
        raise StudyError(
            f"The sample numbers of running statistics are {n.tolist()}; expected numbers from 2 to {x.size}."
        )
    # Shift by the median and scale by the spread, as in `sample_statistics`.
    centre, spread = float(np.median(x)), float(np.ptp(x))
    scaled = (x - centre) / (spread or 1.0)
    m1, r2, r3, r4 = (np.cumsum(scaled**k)[n - 1] / n for k in (1, 2, 3, 4))
    m2 = np.maximum(r2 - m1**2, 0.0)
    m3 = r3 - 3 * m1 * r2 + 2 * m1**3
    m4 = np.maximum(r4 - 4 * m1 * r3 + 6 * m1**2 * r2 - 3 * m1**4, 0.0)
    std = spread * np.sqrt(m2 * n / (n - 1))
    safe = divisor(m2)
    errors = independent_errors(std, m3 / safe**1.5, np.maximum(m4 / safe**2, 1.0), n)
    return {"mean": centre + spread * m1, "std": std, "std_error_mean": errors[0], "std_error_std": errors[1]}


def replicate_statistics(parts: Sequence[ArrayLike]) -> dict[str, NDArray[np.float64]]:
    r"""Compute mean and standard deviation, with their standard errors, from independent replicates of a design.

    The points of a Latin hypercube or of a Sobol' set depend on one another, so the variance has the divisor n.
    Standard errors come from leaving out one of the R replicates at a time (`replicate_errors`).

    `parts` (S_r,): samples of each replicate; empty replicates are ignored. Return ``mean``, ``std``,
    ``std_error_mean`` and ``std_error_std``, each of shape (R,), for the first 1, 2, ... R replicates. The errors of a
    single replicate are unknown, NaN. Raise StudyError if the first replicate that is not empty has fewer than two
    samples.

    >>> found = replicate_statistics([[0.0, 1.0], [2.0, 3.0]])
    >>> found["mean"].tolist(), found["std_error_mean"].round(3).tolist()
    ([0.5, 1.5], [nan, 6.483])
    """
    given = [Moments.of(np.ravel(part)) for part in parts if np.size(part)]
    if not given or given[0].count < 2:
        first = given[0].count if given else 0
        raise StudyError(f"replicate_statistics: the first replicate has {first} samples; expected two or more.")
    so_far = list(accumulate(given, Moments.merge))
    errors = [replicate_errors(given[: last + 1]) for last in range(len(given))]
    return {
        "mean": np.array([float(m.mean) for m in so_far]),
        "std": np.array([np.sqrt(float(m.second) / m.count) for m in so_far]),
        "std_error_mean": np.array([float(e[0]) for e in errors]),
        "std_error_std": np.array([float(e[1]) for e in errors]),
    }


@typechecked
def statistics_of_samples(
    samples: xr.Dataset,
    probabilities: Sequence[float] = DEFAULT_PROBABILITIES,
    *,
    independent: bool = True,
    replicates: Sequence[int] | None = None,
    each: Callable[..., Iterable[Any]] = map,
) -> xr.Dataset:
    """Build the dataset ``statistics`` from a dataset ``samples`` without its failed samples.

    Parameters
    ----------
    samples : xarray.Dataset
        Samples from :func:`uqmbd.extend.sample_dataset`.
    probabilities : sequence of float
        Probabilities of the quantiles.
    independent : bool
        Whether the samples are independent, as for :func:`sample_statistics`.
    replicates : sequence of int, optional
        Numbers of samples of the replicates of a design, as for :func:`sample_statistics`.
    each : callable, optional
        Function like ``map``, as for :func:`sample_statistics`.

    Returns
    -------
    xarray.Dataset
        Statistics as from :func:`uqmbd.extend.statistics_dataset`, with ``circular_mean`` and ``circular_std`` for
        angles.

    Raises
    ------
    StudyError
        If fewer than two samples succeeded.

    Examples
    --------
    >>> from uqmbd.extend import labels, sample_dataset
    >>> axes = labels([("x", "m")], ["k"], [0.0])
    >>> samples = sample_dataset([[[1.0]], [[3.0]], [[float("inf")]]], [[0.0], [1.0], [2.0]], axes)
    >>> statistics_of_samples(samples)["mean"].item()
    2.0
    """
    variables = samples.variables
    axes = Labels(
        outputs=output_infos(samples),
        inputs=tuple(InputInfo(str(n)) for n in variables["input"].values),
        times=variables["time"].values if "time" in samples.dims else None,
    )
    response, status = variables["response"].values, variables["status"].values
    about: dict[str, Any] = {"status": status, "independent": independent, "replicates": replicates, "each": each}
    found: dict[str, Any] = dict(sample_statistics(response, probabilities, **about))
    if np.any(axes.turns):
        fine = status == Status.OK
        found |= circular_of_samples(response if fine.all() else response[fine], axes.turns)
    return statistics_dataset(axes, **found)
