"""Arrangement of a study and its records: unknown inputs, operating points, and the records of each machine."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass
from typing import Any

import numpy as np

import uqmbd
from uqmbd.typing import Array
from uqmbd_calibration.inference import Bias, Block, Level, MachineRecords, OperatingPoint, UnknownInput, Unknowns
from uqmbd_calibration.records import Record, Series

__all__ = ["Arrangement", "arrange"]


TIME_TOLERANCE = 1e-10
"""Difference of two times, relative to the largest time, below which they count as equal."""


@dataclass(frozen=True, eq=False)
class Arrangement:
    """Unknowns of a calibration, and the data that inform them."""

    unknowns: Unknowns
    points: tuple[OperatingPoint, ...]  # each with the times of its records
    cases: tuple[MachineRecords, ...]  # machines at operating points

    def physical(self, vectors: Array) -> Array:
        """Return the unknown inputs (K, D), in their units, for vectors of unknowns (K, N)."""
        values = np.empty((len(vectors), len(self.unknowns.inputs)))
        for case in self.cases:
            inputs = case.point.inputs(case.normals(vectors))
            values[:, case.columns[case.free]] = inputs[:, case.free]
        return values


def arrange(
    study: uqmbd.Study,
    records: Sequence[Record],
    *,
    robust: bool,
    bias: Mapping[str, Bias],
    individual: Sequence[str],
    realisations: int,
    executor: Executor | None,
    progress: Any,
) -> Arrangement:
    """Return the unknowns, operating points and records of each machine.

    Raise StudyError if a dependent input is known, or if only some inputs of a dependent group are individual. Also
    raise it if an input does not exist, or if records do not fit the study.
    """
    inputs = study.mechanism.inputs
    _check_groups(study, records, individual)
    _check_bias(records, bias)
    groups: dict[tuple[tuple[tuple[str, float], ...], str], list[Record]] = {}
    for record in records:
        known = tuple(sorted(record.known.items()))
        groups.setdefault((known, record.machine if individual else ""), []).append(record)
    unknown = _unknown(inputs.names, groups, individual)
    levels = _levels(records)
    points: dict[tuple[tuple[str, float], ...], OperatingPoint] = {}
    for known in dict.fromkeys(known for known, _ in groups):
        own = [record for (k, _), them in groups.items() if k == known for record in them]
        machines = sum(k == known for k, _ in groups)
        points[known] = _point(study, dict(known), own, realisations * machines, executor, progress)
    cases, first = [], len(unknown)
    for (known, machine), own in groups.items():
        columns = np.full(len(inputs), -1)
        for at, one in enumerate(unknown):
            if inputs.names[one.input] not in dict(known) and one.machine in ("", machine):
                columns[one.input] = at
        blocks = []
        for record in own:
            for series in record.series:
                block = _block(points[known], record, series, levels, bias.get(series.output), robust, first)
                first += block.modes.shape[1] if robust else 0
                blocks.append(block)
        case = MachineRecords(points[known], columns, tuple(blocks))
        for column in case.free.tolist():
            if (values := points[known].space.germs[column].values) is not None:
                raise uqmbd.StudyError(
                    f"calibrate: input {inputs.names[column]!r} is discrete ({values} values), so its posterior has "
                    "no density. Replace it by a constant, or state its value in each record with known={...}."
                )
        cases.append(case)
    _check_levels(levels, cases, len(unknown))
    return Arrangement(Unknowns(unknown, first - len(unknown), levels), tuple(points.values()), tuple(cases))


def _unknown(names: Sequence[str], groups: Mapping[Any, Any], individual: Sequence[str]) -> tuple[UnknownInput, ...]:
    """Return the inputs that at least one record does not state; an individual input occurs once for each machine."""
    found = []
    for column, name in enumerate(names):
        own = [machine for known, machine in groups if name not in dict(known)]
        if name not in individual:
            found += [UnknownInput(name, column)] if own else []
        elif not own:
            raise uqmbd.StudyError(
                f"calibrate: individual contains {name!r}, whose value is known in all records. Remove it from "
                "individual, or from the known inputs."
            )
        else:
            found += [UnknownInput(f"{name}[{machine}]", column, machine) for machine in dict.fromkeys(own)]
    if not found:
        raise uqmbd.StudyError(
            "calibrate: all inputs are known in all records, so there is nothing to calibrate. Remove "
            "some of the known inputs."
        )
    return tuple(found)


def _check_groups(study: uqmbd.Study, records: Sequence[Record], individual: Sequence[str]) -> None:
    """Check that groups of dependent inputs are not split, individual inputs exist, and machines have names."""
    inputs = study.mechanism.inputs
    unknown = [name for name in individual if name not in inputs.names]
    if unknown:
        raise uqmbd.StudyError(
            f"calibrate: individual contains {unknown[0]!r}; expected names of inputs of the study, "
            f"{', '.join(inputs.names)}."
        )
    if individual and (nameless := [record.name for record in records if not record.machine]):
        raise uqmbd.StudyError(
            f"calibrate: individual={list(individual)!r} requires the machine of every record, but record "
            f"{nameless[0]!r} states no machine. State the machine of the record, e.g. machine='rig 2'."
        )
    for variable in inputs.variables:
        names = set(variable.joint.names)
        if len(names) == 1:
            continue
        for record in records:
            if names & set(record.known):
                wrong = ", ".join(sorted(names & set(record.known)))
                raise uqmbd.StudyError(
                    f"calibrate: record {record.name!r} states values of {wrong} in known. The inputs "
                    f"{', '.join(sorted(names))} depend on each other, and only independent inputs can be known; omit "
                    f"{wrong} from known."
                )
        if 0 < len(names & set(individual)) < len(names):
            raise uqmbd.StudyError(
                f"calibrate: individual contains only some of the dependent inputs {', '.join(sorted(names))}; "
                "expected all of them, or none."
            )


def _check_bias(records: Sequence[Record], bias: Mapping[str, Bias]) -> None:
    """Check that the records contain each output with a bias."""
    recorded = list(dict.fromkeys(name for record in records for name in record.outputs))
    for name in bias:
        if name not in recorded:
            raise uqmbd.StudyError(
                f"calibrate: bias has the key {name!r}, which is not an output of any record; expected some of "
                f"{', '.join(recorded)}."
            )


def _check_levels(levels: Sequence[Level], cases: Sequence[MachineRecords], inputs: int) -> None:
    """Raise StudyError if the values of an output are too few to estimate its noise level together with the inputs."""
    for number, level in enumerate(levels):
        different, predicted = 0, 0
        for case in cases:
            own = [block for block in case.blocks if block.noise is None and block.level == number]
            met = {pair for block in own for pair in zip(block.columns.tolist(), block.values.tolist(), strict=True)}
            # readings that are rounded to the same value contain no information about the noise
            different += len(met)
            predicted += len({column for column, _ in met})
        if different <= min(inputs, predicted):
            raise uqmbd.StudyError(
                f"calibrate: {different} different values of {level.output!r} are too few to estimate its noise "
                f"together with {inputs} input{'s' if inputs > 1 else ''}. State the noise, e.g. Record.read(..., "
                f"noise={{{level.output!r}: 0.01}}), or record more values."
            )


def _levels(records: Sequence[Record]) -> tuple[Level, ...]:
    """Return the unknown noise levels: one for each output whose noise is missing in a record."""
    found: dict[str, Level] = {}
    for record in records:
        for series in record.series:
            if series.noise is None and series.output not in found:
                own = [s for r in records for s in r.series if s.output == series.output and s.noise is None]
                values = np.concatenate([s.values for s in own])
                spread = float(values.std()) or 0.1 * float(np.abs(values).max()) or 1.0
                found[series.output] = Level(series.output, series.units, 0.1 * spread)
    return tuple(found.values())


def _point(
    study: uqmbd.Study,
    known: dict[str, float],
    records: Sequence[Record],
    most: int,
    executor: Executor | None,
    progress: Any,
) -> OperatingPoint:
    """Return the mechanism at an operating point, at the times of its records."""
    series = [one for record in records for one in record.series]
    moving, still = any(not one.timeless for one in series), any(one.timeless for one in series)
    times = _merged(study.times[:1], *(one.times for one in series))
    if still:
        if moving and times[-1] > study.times[-1] + TIME_TOLERANCE * abs(times[-1]):
            raise uqmbd.StudyError(
                f"calibrate: the records end at {times[-1]:g} s, but the study ends at {study.times[-1]:g} s. "
                "The records contain a scalar output of the whole motion, so they must not end after the study; extend "
                "the output times of the study."
            )
        times = _merged(times, study.times) if moving else study.times
    if moving and len(times) == 1:
        times = _merged(times, study.times)
    other = study if np.array_equal(times, study.times) else study.with_times(times)
    return OperatingPoint(other, known, moving=moving, still=still, most=most, executor=executor, progress=progress)


def _merged(*times: Array) -> Array:
    """Return all times, sorted; keep the first of times that differ only by rounding, such as 0.3 and 3 * 0.1."""
    found = np.unique(np.concatenate(times))
    return np.asarray(found[np.concatenate([[True], np.diff(found) > TIME_TOLERANCE * np.abs(found).max()])])


def _block(
    point: OperatingPoint,
    record: Record,
    series: Series,
    levels: tuple[Level, ...],
    bias: Bias | None,
    robust: bool,
    first: int,
) -> Block:
    """Return the values of one output as a block."""
    mechanism, count = point.study.mechanism, len(series.values)
    outputs = mechanism.scalars if series.timeless else mechanism.outputs
    columns = np.zeros(count, dtype=np.int64)
    if not series.timeless:
        # use the first of times that differ only by rounding
        columns = np.searchsorted(point.study.times, series.times, side="right") - 1
    level = -1
    if series.noise is None:
        level = [one.output for one in levels].index(series.output)
    modes: Array = np.zeros((count, 0))
    if bias is not None:
        modes = bias.modes(series.times if not series.timeless else np.zeros(count))
    return Block(
        record=record.name,
        output=series.output,
        units=series.units,
        times=series.times,
        values=series.values,
        row=list(outputs).index(series.output),
        columns=columns,
        noise=series.noise,
        level=level,
        modes=modes,
        robust=robust,
        first=first,
        variance=np.zeros(count),
    )
