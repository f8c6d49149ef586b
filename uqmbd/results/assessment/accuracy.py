"""Define accuracy, the measure of stated errors for runs with ``accuracy=``."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Annotated, Literal

import numpy as np
import xarray as xr

from uqmbd.arguments import Bounds, NotNegativeOrInfinite, typechecked
from uqmbd.errors import StudyError
from uqmbd.results.assessment.own_errors import OwnError, own_error
from uqmbd.results.requirements import answers
from uqmbd.results.statistics import divisor, over_time
from uqmbd.typing import Array

__all__ = ["StatedAccuracy", "accuracies", "stated_accuracy"]

TWO_SIDED = 1.96
"""Half-width of a two-sided 95 % confidence interval, in standard errors."""


@typechecked
@dataclass(frozen=True)
class StatedAccuracy:
    """Stated accuracy of a result.

    Attributes
    ----------
    value : float
        Largest half-width, relative to its scale; infinite if no error is stated.
    quantity : str
        Quantity with the largest half-width, or the reason why no error is stated.
    kind : {"mean", "std", "probability", ""}
        Kind of this quantity; empty if no error is stated.

    Raises
    ------
    uqmbd.StudyError
        If the value is negative or NaN.

    Examples
    --------
    >>> StatedAccuracy(0.0123, "mean of x at 0.5 s").words
    '1.2 % (mean of x at 0.5 s)'
    """

    value: NotNegativeOrInfinite
    quantity: str
    kind: Literal["mean", "std", "probability", ""] = ""

    def __post_init__(self) -> None:
        if not self.value >= 0:
            raise StudyError(
                f"StatedAccuracy: value is {self.value!r}; expected a number, 0 or more; use infinity if no error is "
                "stated."
            )

    @property
    def words(self) -> str:
        """Return value and quantity as a text."""
        return f"{100 * self.value:.2g} % ({self.quantity})" if math.isfinite(self.value) else self.quantity


@typechecked
def stated_accuracy(
    node: xr.DataTree,
    *,
    rtol: Annotated[float, Bounds(0)] = 0.0,
    of: Literal["moments", "probabilities"] = "moments",
    usual: bool = False,
) -> StatedAccuracy:
    """Return the stated accuracy of a result, with 95 % confidence.

    Parameters
    ----------
    node : xarray.DataTree
        Node of a propagator.
    rtol : float
        Relative tolerance of the integration, which decides which outputs vary.
    of : {"moments", "probabilities"}
        ``moments``: half-widths of the mean and of the standard deviation of each output at each time. The half-widths
        are relative to the largest standard deviation of that output over time. For a scalar output they are relative
        to its standard deviation. For samples, the half-width is 1.96 stated standard errors. The stated standard
        errors of replicates include the factor of Student's t. For a surrogate, the half-width is the root mean square
        error of single realisations, from its verification. The errors of mean and standard deviation do not exceed
        this root mean square (Cauchy-Schwarz inequality), and are usually a fifth of it. Outputs that do not vary are
        ignored. The integration error, which more realisations do not reduce, is stated separately.

        ``probabilities``: the longer side of the 95 % interval of each probability of violation, relative to that
        probability.
    usual : bool
        Whether to use the usual standard errors, which are inversely proportional to the square root of the number of
        samples. The stated standard errors are larger for few independent samples.

    Returns
    -------
    StatedAccuracy
        Accuracy of the least accurate quantity.

    Examples
    --------
    >>> from uqmbd.results import propagator_node
    >>> from uqmbd.extend import labels, statistics_dataset
    >>> axes = labels(["x"], [], [0.0, 1.0])
    >>> statistics = statistics_dataset(axes, mean=[[0.0, 0.0]], std=[[1.0, 2.0]], std_error_mean=[[0.1, 0.1]],
    ...                                 std_error_std=[[0.05, 0.2]])
    >>> node = propagator_node("a", statistics, propagator="p", realisations=100, wall_time=0.0)
    >>> stated_accuracy(node).words
    '20 % (standard deviation of x at 1 s)'
    """
    if of == "probabilities":
        return _of_probabilities(node)
    found = [_of_moments(one, rtol, usual=usual) for one in (node, *_scalars(node))]
    return max(found, key=lambda one: one.value)


def _scalars(node: xr.DataTree) -> list[xr.DataTree]:
    return [node.children["scalars"]] if "scalars" in node.children else []


def _of_moments(node: xr.DataTree, rtol: float, *, usual: bool) -> StatedAccuracy:
    statistics = node.children["statistics"].to_dataset()
    own = own_error(node, rtol, dependence=False)
    names = [str(name) for name in statistics["output"].values]
    # an output without statistics (its event may not occur) has a separate message
    rows = np.flatnonzero(own.varies & np.isfinite(own.std).any(axis=1))
    if not len(rows):
        return StatedAccuracy(0.0, "no output varies")
    noisy = {"std_error_mean", "std_error_std"} <= set(statistics.data_vars)
    if not (noisy and (own.drawn or not own.surrogate)) and np.isnan(own.stated[rows]).any():
        name = names[rows[int(np.argmax(np.isnan(own.stated[rows])))]]
        return StatedAccuracy(np.inf, f"{name} has no stated error")
    times = np.asarray(statistics["time"].values, dtype=float) if "time" in statistics["mean"].dims else None
    worst = StatedAccuracy(0.0, "no output varies")
    kinds: tuple[tuple[Literal["mean", "std"], str], ...] = (("mean", "mean"), ("std", "standard deviation"))
    for kind, words in kinds:
        widths = _half_widths(statistics, own, kind, usual=usual)
        for row in rows.tolist():
            found = _largest(widths[row], own.std[row], getattr(own, kind)[row])
            if found[0] > worst.value:
                at = "" if times is None else f" at {times[found[1]]:g} s"
                unknown = "" if math.isfinite(found[0]) else " is unknown"
                worst = StatedAccuracy(found[0], f"{words} of {names[row]}{at}{unknown}", kind)
    return worst


def accuracies(node: xr.DataTree, own: OwnError) -> Array:
    """Return the largest half-width (O,) of mean and standard deviation over the largest standard deviation.

    The half-width is infinite if no error is stated, and 0 for outputs that do not vary.
    """
    statistics = node.children["statistics"].to_dataset()
    widths = np.maximum(*(_half_widths(statistics, own, kind) for kind in ("mean", "std")))
    largest = np.where(np.isnan(widths), np.inf, widths).max(axis=-1, initial=0.0)
    found = largest / divisor(np.nan_to_num(own.std).max(axis=-1, initial=0.0))
    stated = own.drawn | (own.samples > 0) | np.isfinite(own.stated)
    return np.where(own.varies, np.where(stated, found, np.inf), 0.0)


def _half_widths(statistics: xr.Dataset, own: OwnError, kind: str, *, usual: bool = False) -> Array:
    """Return half-widths (O, T) of the mean or of the standard deviation, in the units of the outputs."""
    noisy = {"std_error_mean", "std_error_std"} <= set(statistics.data_vars)
    noise = over_time(statistics[f"std_error_{kind}"].values) if noisy else np.zeros_like(own.std)
    if usual and noisy and own.freedom >= own.samples - 1:
        noise = getattr(own, f"noise_{kind}")
    return TWO_SIDED * noise + own.missed


def _largest(widths: Array, std: Array, values: Array) -> tuple[float, int]:
    """Return the largest of the half-widths (T,), relative to the largest standard deviation, and its index."""
    unknown = ~(np.isfinite(widths) & np.isfinite(std) & np.isfinite(values))
    if unknown.any():
        return np.inf, int(np.argmax(unknown))
    k, scale = int(np.argmax(widths)), float(std.max())
    return (float(widths[k]) / scale if scale > 0 else 0.0), k


def _of_probabilities(node: xr.DataTree) -> StatedAccuracy:
    if "requirements" not in node.children:
        return StatedAccuracy(np.inf, "there are no requirements")
    worst = StatedAccuracy(0.0, "no probability")
    for name, found in answers({"": node}).items():
        one = found[""]
        if not one.probability > 0:
            return StatedAccuracy(np.inf, f"no violation of {name} was found")
        if one.relative_width > worst.value:
            worst = StatedAccuracy(one.relative_width, f"probability of {name}", "probability")
    return worst
