"""Columns of outputs in a file or a dataset, before the checks of a record."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from typing import Any, NamedTuple

import uqmbd
from uqmbd_calibration.records.series import Series
from uqmbd_calibration.records.units import same_units
from uqmbd_calibration.records.wording import check_mapping, check_units, near

__all__ = ["OutputColumn", "series_of"]


class OutputColumn(NamedTuple):
    """Unchecked values of one output."""

    output: str
    times: Any
    values: Any
    units: str | None = None
    noise: Any = None


def series_of(
    columns: Sequence[OutputColumn],
    units: Mapping[str, str] | None,
    noise: Mapping[str, float] | None,
    outputs: Collection[str] | None,
    where: str,
) -> tuple[Series, ...]:
    """Return series from columns and the arguments of the caller.

    Units in the file and from the caller must agree. Noise given by the caller replaces the noise in the file.
    """
    found = [column.output for column in columns]
    units = check_mapping(units, found, "units", "{'angle': 'rad'}", where)
    noise = check_mapping(noise, found, "noise", "{'angle': 0.01}", where)
    if outputs is not None:
        row = isinstance(outputs, Collection) and not isinstance(outputs, str) and getattr(outputs, "ndim", 1) == 1
        if not row or not all(isinstance(name, str) for name in outputs):
            raise uqmbd.StudyError(f"{where}: outputs is {outputs!r}; expected a list of output names, e.g. ['angle'].")
        for name in outputs:
            if name not in found:
                raise uqmbd.StudyError(f"{where}: the file has no output {name!r}{near(name, found)}")
    series = []
    for column in columns:
        if outputs is not None and column.output not in outputs:
            continue
        name = column.output
        stated = _units(name, column.units, units.get(name), where)
        known = noise[name] if name in noise else column.noise
        try:
            series.append(Series(name, column.times, column.values, stated, known))
        except uqmbd.StudyError as error:
            raise uqmbd.StudyError(f"{where}: {error}") from None
    return tuple(series)


def _units(name: str, found: str | None, given: str | None, where: str) -> str:
    """Return the units from the file or the caller."""
    if given is not None:
        check_units(given, f"{where}: output {name!r}")
    if found is None and given is None:
        raise uqmbd.StudyError(
            f"{where}: the units of {name!r} are missing. State them in the file (CSV: 'name [m]' in the header; "
            f"netCDF: the attribute units), or with units={{{name!r}: 'm'}}; '' means a pure number."
        )
    if found is not None and given is not None and not same_units(found, given):
        raise uqmbd.StudyError(
            f"{where}: the units of {name!r} are {found!r} in the file and {given!r} in units=. Omit units=, or "
            "correct the file; uqmbd does not convert values."
        )
    return given if found is None or given is not None else found  # type: ignore[return-value]  # one of them is stated
