"""Records against the study that they are to be records of."""

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
    """Raise `uqmbd.StudyError` unless these are outputs of a study."""
    if not isinstance(study, uqmbd.Study):
        raise uqmbd.StudyError(f"record {name!r}: it is checked against {study!r}; expected a uqmbd.Study.")
    for one in series:
        _check_output(f"record {name!r}, output {one.output!r}", one, study)
        _check_size(f"record {name!r}, output {one.output!r}", one)
    inputs = study.mechanism.inputs
    for key, value in known.items():
        if key not in inputs.names:
            raise uqmbd.StudyError(
                f"record {name!r}: the known input {key!r} is none of the study{near(key, inputs.names)} "
                f"It has {listed(inputs.names)}."
            )
        variable = inputs.variables[inputs.names.index(key)]
        lower, upper = map(float, variable.joint.bounds[variable.component])
        if not lower <= value <= upper:
            raise uqmbd.StudyError(
                f"record {name!r}: the known input {key!r} is {value:g}, and its distribution is from {lower:g} to "
                f"{upper:g}; give it a distribution that holds this value."
            )


LARGEST = 1e100
"""Size of numbers, and of one over the noise, beyond which their squares leave the range of 64 bits."""


def check_size(where: str, what: str, value: float) -> None:
    """Raise unless a number can be squared."""
    if not abs(value) <= LARGEST:
        raise uqmbd.StudyError(
            f"{where}: {what} is {value:g}, which is too large to compute with; expected at most {LARGEST:g}."
        )


def _check_size(where: str, series: Series) -> None:
    """Raise unless values and noise can be computed with."""
    largest = int(np.argmax(np.abs(series.values)))
    place = f"no. {largest + 1}" if series.timeless else f"at {series.times[largest]:g} s"
    check_size(where, f"the value {place}", float(series.values[largest]))
    # of most values: one that is far from the others is another fault
    rounding = np.spacing(max(float(np.median(np.abs(series.values))), 1 / LARGEST))
    if series.noise is None:
        return
    check_size(where, "its noise", series.noise)
    if series.noise < 10 * rounding:
        raise uqmbd.StudyError(
            f"{where}: its noise is {series.noise:g}, which is not more than the rounding errors of its values in 64 "
            f"bits ({rounding:.2g}); state the standard deviation of the errors of the measurement."
        )


def _check_output(where: str, series: Series, study: uqmbd.Study) -> None:
    """Raise unless one output of a record is one of the study."""
    mechanism = study.mechanism
    declared = {**mechanism.outputs, **mechanism.scalars}
    if series.output not in declared:
        raise uqmbd.StudyError(
            f"{where}: the study has no such output{near(series.output, declared)} It has {listed(declared)}."
        )
    output = declared[series.output]
    if not same_units(series.units, output.units):
        raise uqmbd.StudyError(
            f"{where}: the record is in {series.units!r}, the study in {output.units!r}. Values are not converted: "
            f"convert those of the record, or let the study record this output in {series.units!r}."
        )
    if series.timeless and series.output in mechanism.outputs:
        raise uqmbd.StudyError(
            f"{where}: the record has no times for it, and in the study it is an output over time; give each value its "
            "time (CSV: a column 'time [s]'; netCDF: a coordinate)."
        )
    if not series.timeless and series.output in mechanism.scalars:
        raise uqmbd.StudyError(
            f"{where}: the record has times for it, and in the study it has none; give its values in a file of their "
            "own, without a column 'time' (netCDF: without a coordinate)."
        )
    start = float(study.times[0])
    if not series.timeless and series.times[0] < start:
        raise uqmbd.StudyError(
            f"{where}: its first time is {series.times[0]:.10g} s, before the study starts at {start:.10g} s; shift "
            "the times of the record, or let the study start earlier."
        )
    if output.turn and not series.timeless and series.values.size > 1:
        span = float(np.ptp(series.values))
        jump = float(np.max(np.abs(np.diff(series.values))))
        if span <= 1.01 * output.turn and jump > 0.5 * output.turn:
            warnings.warn(
                f"{where}: it jumps by {jump:.3g} {output.units} within one turn, and the study counts turns; if these "
                "are angles within a turn, unwrap them (numpy.unwrap).",
                uqmbd.StudyWarning,
                stacklevel=4,
            )
