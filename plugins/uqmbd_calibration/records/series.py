"""Values of one output of a record, with or without times."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

import uqmbd
from uqmbd.extend import typechecked
from uqmbd.typing import Array
from uqmbd_calibration.records.wording import check_name, check_units, number, numbers

__all__ = ["Series"]


@typechecked(values=False)
@dataclass(frozen=True, init=False, eq=False)
class Series:
    """Measurements of one output.

    Values that are nan are gaps; they are removed together with their times.

    Parameters
    ----------
    output : str
        Name of the output of the study.
    times : array_like, shape (T,)
        Times of the values, s, strictly increasing; empty for a scalar output, such as a frequency.
    values : array_like, shape (T,) or (R,)
        A value at each time, or the `R` values of repeated measurements of a scalar output.
    units : str
        Units of the values; empty for a number without units.
    noise : float, optional
        Standard deviation of the errors of the values, in `units`. Default: unknown.

    Raises
    ------
    uqmbd.StudyError
        If an argument is not a number, infinite, empty, of the wrong length, or not increasing in time.

    Examples
    --------
    >>> series = Series("angle", [0.0, 0.1, 0.2], [1.0, float("nan"), 0.9], "rad", noise=0.01)
    >>> series.times, series.values
    (array([0. , 0.2]), array([1. , 0.9]))
    """

    output: str
    times: Array
    values: Array
    units: str
    noise: float | None = None

    def __init__(
        self, output: str, times: ArrayLike, values: ArrayLike, units: str, noise: float | None = None
    ) -> None:
        where = f"output {check_name(output, 'output of a record')!r}"
        values = numbers(values, where, "its values")
        times = numbers(times, where, "its times")
        check_units(units, where)
        noise = None if noise is None else number(noise, where, "its noise", positive=True)
        if times.size and times.size != values.size:
            raise uqmbd.StudyError(
                f"{where}: the series has {values.size} values at {times.size} times. Expected one value at each "
                "time, or no times for a scalar output."
            )
        if not np.isfinite(times).all():
            place = _first(~np.isfinite(times))
            raise uqmbd.StudyError(f"{where}: time no. {place} is not a finite number; expected times in s.")
        if np.isinf(values).any():
            raise uqmbd.StudyError(
                f"{where}: value no. {_first(np.isinf(values))} is infinite. Omit missing values, or "
                "replace them by nan."
            )
        there = np.isfinite(values)
        if not there.any():
            raise uqmbd.StudyError(f"{where}: the series has no values; remove this output.")
        if times.size:
            times = times[there]
            late = np.diff(times) <= 0
            if late.any():
                at = _first(late)
                raise uqmbd.StudyError(
                    f"{where}: the times do not increase: {times[at - 1]:.10g} s precedes {times[at]:.10g} s. Sort "
                    "the values by time, and give each time once."
                )
        held = {"output": output, "times": times, "values": values[there], "units": units, "noise": noise}
        for name, value in held.items():
            if isinstance(value, np.ndarray):
                value.setflags(write=False)
            object.__setattr__(self, name, value)

    @property
    def timeless(self) -> bool:
        """Whether the output is a scalar output, without times."""
        return self.times.size == 0

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Series) and (
            (self.output, self.units, self.noise) == (other.output, other.units, other.noise)
            and np.array_equal(self.times, other.times)
            and np.array_equal(self.values, other.values)
        )

    __hash__ = None  # type: ignore[assignment]  # the attributes are arrays

    def __repr__(self) -> str:
        count = f"{self.values.size} value{'s' if self.values.size > 1 else ''}"
        span = "" if self.timeless else f" from {self.times[0]:g} s to {self.times[-1]:g} s"
        noise = "noise unknown" if self.noise is None else f"noise {self.noise:g}"
        return f"<{self.output!r} [{self.units}]: {count}{span}, {noise}>"


def _first(where: np.ndarray) -> int:
    """Return the position of the first true element, counted from one."""
    return int(np.argmax(where)) + 1
