"""Checks of a record against its study."""

from __future__ import annotations

import warnings
from collections.abc import Mapping, Sequence

import numpy as np

import uqmbd
from uqmbd_calibration.records.series import Series
from uqmbd_calibration.records.units import same_units
from uqmbd_calibration.records.wording import listed, near

__all__ = ["check_against", "check_size"]


def check_against(name: str, series: Sequence[Series], known: Mapping[str, float], study: uqmbd.Study) -> None:
    """Raise `uqmbd.StudyError` if the series and known inputs do not agree with the study."""
    if not isinstance(study, uqmbd.Study):
        raise uqmbd.StudyError(f"record {name!r}: the argument 'study' is {study!r}; expected a uqmbd.Study.")
    for one in series:
        _check_output(f"record {name!r}, output {one.output!r}", one, study)
        _check_size(f"record {name!r}, output {one.output!r}", one)
    inputs = study.mechanism.inputs
    for key, value in known.items():
        if key not in inputs.names:
            raise uqmbd.StudyError(
                f"record {name!r}: the known input {key!r} is not an input of the study{near(key, inputs.names)} Its "
                f"inputs are {listed(inputs.names)}."
            )
        variable = inputs.variables[inputs.names.index(key)]
        lower, upper = map(float, variable.joint.bounds[variable.component])
        if not lower <= value <= upper:
            raise uqmbd.StudyError(
                f"record {name!r}: the known input {key!r} is {value:g}, outside its distribution from {lower:g} to "
                f"{upper:g}. Use a distribution that includes this value."
            )


LARGEST = 1e100
"""Limit of numbers, and of the inverse of the noise, such that squares do not overflow 64 bits."""


def check_size(where: str, what: str, value: float) -> None:
    """Raise `uqmbd.StudyError` if a number is too large to be squared."""
    if not abs(value) <= LARGEST:
        raise uqmbd.StudyError(
            f"{where}: {what} is {value:g}, too large for computations; expected a magnitude of at most {LARGEST:g}."
        )


def _check_size(where: str, series: Series) -> None:
    """Raise `uqmbd.StudyError` if values are too large, or noise is below the rounding error of the values."""
    largest = int(np.argmax(np.abs(series.values)))
    place = f"no. {largest + 1}" if series.timeless else f"at {series.times[largest]:g} s"
    check_size(where, f"the value {place}", float(series.values[largest]))
    # use the median, because one very large wrong value must not raise the limit
    rounding = np.spacing(max(float(np.median(np.abs(series.values))), 1 / LARGEST))
    if series.noise is None:
        return
    check_size(where, "its noise", series.noise)
    if series.noise < 10 * rounding:
        raise uqmbd.StudyError(
            f"{where}: the noise is {series.noise:g}, below the rounding errors of the values in 64 bits "
            f"({rounding:.2g}). State the standard deviation of the measurement errors."
        )


def _check_output(where: str, series: Series, study: uqmbd.Study) -> None:
    """Raise `uqmbd.StudyError` if an output of a record is not an output of the study."""
    mechanism = study.mechanism
    declared = {**mechanism.outputs, **mechanism.scalars}
    if series.output not in declared:
        raise uqmbd.StudyError(
            f"{where}: the study has no such output{near(series.output, declared)} Its outputs are {listed(declared)}."
        )
    output = declared[series.output]
    if not same_units(series.units, output.units):
        raise uqmbd.StudyError(
            f"{where}: the units are {series.units!r} in the record and {output.units!r} in the study. Convert the "
            f"values of the record, or define the output of the study in {series.units!r}."
        )
    if series.timeless and series.output in mechanism.outputs:
        raise uqmbd.StudyError(
            f"{where}: the record has no times for this output, but in the study it is an output over time. State a "
            "time for each value (CSV: a column 'time [s]'; netCDF: a coordinate)."
        )
    if not series.timeless and series.output in mechanism.scalars:
        raise uqmbd.StudyError(
            f"{where}: the record has times for this output, but in the study it is a scalar output. Store its "
            "values in a separate file without a column 'time' (netCDF: without a coordinate)."
        )
    start = float(study.times[0])
    if not series.timeless and series.times[0] < start:
        raise uqmbd.StudyError(
            f"{where}: the first time is {series.times[0]:.10g} s, before the start of the study at {start:.10g} s. "
            "Shift the times of the record, or start the study earlier."
        )
    if output.turn and not series.timeless and series.values.size > 1:
        span = float(np.ptp(series.values))
        jump = float(np.max(np.abs(np.diff(series.values))))
        if span <= 1.01 * output.turn and jump > 0.5 * output.turn:
            warnings.warn(
                f"{where}: the recorded angle jumps by {jump:.3g} {output.units}, but the study counts full turns. "
                "If the record contains angles within one turn, unwrap them (numpy.unwrap).",
                uqmbd.StudyWarning,
                stacklevel=4,
            )
