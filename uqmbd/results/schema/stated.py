"""Define stated errors of mean and standard deviation, absolute or relative, with a name."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike

from uqmbd.arguments import typechecked
from uqmbd.errors import StudyError
from uqmbd.results.schema.axes import Labels
from uqmbd.results.schema.values import real_numbers
from uqmbd.typing import Array

__all__ = ["SPREAD_FLOOR", "StatedError", "reference_spread", "stated_variables"]

SPREAD_FLOOR = 0.01
"""Minimum reference of relative errors, as a fraction of the maximum standard deviation over time."""


def reference_spread(std: Array) -> Array:
    """Return the reference (O, T) of relative errors: the standard deviation, at least 1 % of its maximum over time."""
    # an error relative to the standard deviation is meaningless at times at which an output hardly varies (a common
    # start, a nodal point); a NaN makes the result NaN only at its time
    return np.asarray(np.maximum(std, SPREAD_FLOOR * np.fmax.reduce(std, axis=-1, keepdims=True, initial=0.0)))


@typechecked
@dataclass(frozen=True, eq=False)
class StatedError:
    """Error of mean and standard deviation that a method states, for `uqmbd.extend.statistics_dataset`.

    Parameters
    ----------
    values : array_like, shape (O, T)
        Root mean square error of the response, or another bound of the errors of mean and standard deviation. At least
        0; NaN if unknown.
    kind : {"absolute", "relative"}
        ``"absolute"`` errors are in the units of the outputs. ``"relative"`` errors are divided by the standard
        deviation, or by 1 % of its maximum over time if it is smaller.
    name : str
        Name of the error estimate, such as ``"leave-one-out error"``. Reports and verdicts print it.
    remedy : str
        Advice for reducing the error, such as ``"add training nodes"``. Warnings and verdicts print it. Default: none.

    Raises
    ------
    uqmbd.StudyError
        If a value is negative or infinite, or the name is empty.

    Examples
    --------
    >>> from uqmbd.extend import StatedError, labels, statistics_dataset
    >>> axes = labels([("x", "m")], [], [0.0, 1.0])
    >>> error = StatedError([[0.01, 0.02]], "absolute", "leave-one-out error", remedy="add training nodes")
    >>> found = statistics_dataset(axes, mean=[[0.0, 1.0]], std=[[0.1, 0.5]], stated_error=error)
    >>> found["stated_error"].values.tolist(), found["stated_error"].attrs["units"]
    ([[0.01, 0.02]], 'm')
    >>> found["verification_error"].values.round(4).tolist()  # relative to the standard deviation
    [[0.1, 0.04]]
    """

    values: ArrayLike
    kind: Literal["absolute", "relative"]
    name: str
    remedy: str = ""

    def __post_init__(self) -> None:
        """Check the values and the name."""
        values = real_numbers("stated_error", self.values)
        if bad := [x for x in values.ravel().tolist() if x < 0 or np.isinf(x)]:
            raise StudyError(f"StatedError: values contain {bad[0]:g}; expected finite numbers, 0 or more, or NaN.")
        if not self.name.strip():
            raise StudyError(
                "StatedError: name is empty; expected the name of the error estimate, such as 'leave-one-out error'."
            )


def stated_variables(labels: Labels, stated: StatedError, std: Array) -> Mapping[str, Any]:
    """Return the variables ``stated_error``, in the units of the outputs, and ``verification_error``, relative.

    `std` (O, T): standard deviation of the outputs, to which the relative error refers (see `reference_spread`).
    """
    values, spread = real_numbers("stated_error", stated.values), reference_spread(std)
    if values.shape != labels.shape:
        raise StudyError(
            f"'stated_error' has the shape {values.shape}; expected ({', '.join(labels.dims)}) = {labels.shape}."
        )
    none = spread <= 0
    if stated.kind == "relative":
        absolute, relative = values * spread, values
    else:
        # without spread, the relative error is 1 for any positive error: the error may be the whole variation
        absolute, relative = values, np.where(none, (values > 0) * 1.0, values / np.where(none, 1.0, spread))
    about = {"named": stated.name, "remedy": stated.remedy, "kind": stated.kind}
    relative = np.where(np.isnan(values), np.nan, relative)
    why = '{"*": "the method does not know its error there"}'
    reasons = [{"unknown": why} if np.isnan(one).any() else {} for one in (absolute, relative)]
    return {
        "stated_error": (labels.dims, absolute, {"long_name": f"stated error: {stated.name}"} | about | reasons[0]),
        "verification_error": (
            labels.dims,
            relative,
            {"long_name": f"stated error over the standard deviation: {stated.name}"} | about | reasons[1],
        ),
    }
