"""A record: measurements of a machine."""

from __future__ import annotations

import os
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

import uqmbd
from uqmbd.typing import Array
from uqmbd_calibration.records.agreement import check_against
from uqmbd_calibration.records.columns import OutputColumn, series_of
from uqmbd_calibration.records.datasets import dataset_attributes, dataset_columns, dataset_of
from uqmbd_calibration.records.reading import read_columns
from uqmbd_calibration.records.series import Series
from uqmbd_calibration.records.wording import check_mapping, check_name, listed, near, number, short

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["Record"]


@dataclass(frozen=True, init=False)
class Record:
    """Measurements of one machine in one run: outputs of a study, each at its own times.

    Parameters
    ----------
    name : str
        Names it in tables and reports.
    series : sequence of Series
        What was measured, an entry for each output.
    known : mapping of str to float, optional
        Inputs of the study whose values are known in this record, in their units, such as the speed that was set.
    machine : str, optional
        Which machine it is of, where records of several machines are used; empty: all records are of one.

    Raises
    ------
    uqmbd.StudyError
        If something cannot be used: the message says what, and what was expected.

    Examples
    --------
    >>> record = Record("run 3", [Series("angle", [0.0, 0.1], [1.0, 0.9], "rad", noise=0.01)], known={"speed": 10})
    >>> record
    <record 'run 3' with speed = 10: <'angle' [rad]: 2 values from 0 s to 0.1 s, noise 0.01>>
    >>> record["angle"].values
    array([1. , 0.9])
    """

    name: str
    series: tuple[Series, ...]
    known: Mapping[str, float]
    machine: str

    def __init__(
        self, name: str, series: Sequence[Series], known: Mapping[str, float] | None = None, machine: str = ""
    ) -> None:
        where = f"record {check_name(name, 'record')!r}"
        if not isinstance(series, Sequence) or not all(isinstance(one, Series) for one in series):
            raise uqmbd.StudyError(f"{where}: series is {short(series)}; expected a list of Series.")
        if not series:
            raise uqmbd.StudyError(f"{where}: it holds no output; expected at least one.")
        outputs = [one.output for one in series]
        for output in outputs:
            if outputs.count(output) > 1:
                raise uqmbd.StudyError(f"{where}: the output {output!r} is there twice; expected once.")
        if not isinstance(machine, str) or not machine.isprintable():
            raise uqmbd.StudyError(f"{where}: machine is {short(machine)}; expected a text, such as 'rig 2'.")
        values = check_mapping(known, None, "known", "{'speed': 10.0}", where)
        held = {
            "name": name,
            "series": tuple(series),
            "known": {key: number(value, where, f"the known {key!r}") for key, value in values.items()},
            "machine": machine,
        }
        for key, value in held.items():
            object.__setattr__(self, key, value)

    @classmethod
    def read(
        cls,
        path: str | os.PathLike[str],
        *,
        units: Mapping[str, str] | None = None,
        noise: Mapping[str, float] | None = None,
        known: Mapping[str, float] | None = None,
        machine: str | None = None,
        name: str | None = None,
        outputs: Collection[str] | None = None,
    ) -> Record:
        r"""Read a record from a CSV or a netCDF file.

        Parameters
        ----------
        path : path-like
            CSV (``.csv``, ``.tsv``, ``.txt``): a header names the columns, with units in brackets, as ``time [s],angle
            [rad]``; cells that are empty or ``nan`` are gaps; lines that begin with ``#`` are left out.  Without a
            column ``time`` all columns are outputs without a time, and each line is one more measurement.
            NetCDF (``.nc``): a variable for each output with the attribute ``units``, and ``noise`` where it is known;
            its dimension has the times as its coordinate, or none; see `of`.
        units : mapping of str to str, optional
            Units by output, where the file does not state them.
        noise : mapping of str to float, optional
            Standard deviation of the errors by output, in the units of the output.  Takes the place of the file's.
        known, machine, name : optional
            As of the class.  They take the place of what the file says; the name of a CSV file is that of the record.
        outputs : collection of str, optional
            What to read of the file; by default all.

        Returns
        -------
        Record

        Raises
        ------
        uqmbd.StudyError
            If the file cannot be read or used; the message names the file, the line of a CSV, and what was expected.

        Examples
        --------
        >>> import pathlib, tempfile
        >>> with tempfile.TemporaryDirectory() as folder:
        ...     path = pathlib.Path(folder) / "run3.csv"
        ...     _ = path.write_text("time [s],angle [rad],force\n0,1.0,\n0.1,0.9,12\n")
        ...     Record.read(path, units={"force": "N"}, noise={"angle": 0.01})
        <record 'run3': <'angle' [rad]: 2 values from 0 s to 0.1 s, noise 0.01>, <'force' [N]: 1 value from 0.1 s to
        0.1 s, noise unknown>>
        """
        given: Any = {"units": units, "noise": noise, "known": known, "machine": machine, "outputs": outputs}
        source, found, about = read_columns(path)
        return _make_record(found, {"name": source.stem, **about}, name, str(source), **given)

    @classmethod
    def of(
        cls,
        dataset: xr.Dataset,
        *,
        units: Mapping[str, str] | None = None,
        noise: Mapping[str, float] | None = None,
        known: Mapping[str, float] | None = None,
        machine: str | None = None,
        name: str | None = None,
        outputs: Collection[str] | None = None,
    ) -> Record:
        """Return the record of a dataset of xarray.

        Parameters
        ----------
        dataset : xarray.Dataset
            A variable for each output, with the attribute ``units``, and ``noise`` where it is known.  The coordinate
            of its one dimension is its times, s; a dimension without a coordinate, or one that is called
            ``repetition``, is that of the values of an output without a time.  The attributes ``name``, ``machine``
            and ``known`` (JSON, or a mapping) of the dataset are those of the record.
        units, noise, known, machine, name, outputs : optional
            As of `read`.

        Returns
        -------
        Record
            With a series for each variable.

        Raises
        ------
        uqmbd.StudyError
            If it cannot be used.

        Examples
        --------
        >>> import xarray
        >>> data = xarray.Dataset({"frequency": ("repetition", [1.02, 1.03, 0.99], {"units": "Hz"})})
        >>> Record.of(data, name="tap test")
        <record 'tap test': <'frequency' [Hz]: 3 values, noise unknown>>
        """
        import xarray as xr

        where = "Record.of"
        if not isinstance(dataset, xr.Dataset):
            raise uqmbd.StudyError(f"{where}: it is given {type(dataset).__name__}; expected an xarray.Dataset.")
        given: Any = {"units": units, "noise": noise, "known": known, "machine": machine, "outputs": outputs}
        about = {"name": "record", **dataset_attributes(dataset, where)}
        return _make_record(dataset_columns(dataset, where), about, name, where, **given)

    def write(self, path: str | os.PathLike[str]) -> Path:
        """Write the record to a netCDF file, completely or not at all; `read` restores it.

        Parameters
        ----------
        path : path-like
            Ends in ``.nc``.

        Returns
        -------
        pathlib.Path
            The path.

        Raises
        ------
        uqmbd.StudyError
            If the ending is another one, or the file cannot be written.

        Examples
        --------
        >>> import tempfile
        >>> record = Record("tap test", [Series("frequency", [], [1.02, 1.03], "Hz")])
        >>> with tempfile.TemporaryDirectory() as folder:
        ...     Record.read(record.write(folder + "/tap.nc")) == record
        True
        """
        import xarray as xr

        from uqmbd.results import save

        if not isinstance(path, (str, os.PathLike)) or Path(path).suffix != ".nc":
            raise uqmbd.StudyError(
                f"record {self.name!r}: it is to be written to {short(path)}; expected a path that ends in .nc: a CSV "
                "file does not hold noise, known inputs and the machine."
            )
        return save(xr.DataTree(self.to_dataset()), path)

    def to_dataset(self) -> xr.Dataset:
        """Return the record as a dataset, as `of` takes it.

        Returns
        -------
        xarray.Dataset
            A variable for each output; those that were measured at the same times share their dimension.
        """
        return dataset_of(self.name, self.machine, self.known, self.series)

    @property
    def outputs(self) -> tuple[str, ...]:
        """Names of the outputs, in order."""
        return tuple(one.output for one in self.series)

    @property
    def times(self) -> Array:
        """Times of all outputs together, s, each once, increasing; shape ``(T,)``, empty if none has a time."""
        return np.unique(np.concatenate([one.times for one in self.series]))

    def __getitem__(self, output: str) -> Series:
        for one in self.series:
            if one.output == output:
                return one
        raise uqmbd.StudyError(
            f"record {self.name!r}: there is no output {output!r}{near(output, self.outputs)} It has "
            f"{listed(self.outputs)}."
        )

    def checked_against(self, study: uqmbd.Study) -> Record:
        """Return this record if it is one of the outputs of a study, else raise.

        Parameters
        ----------
        study : uqmbd.Study
            Whose outputs and inputs the record names.

        Raises
        ------
        uqmbd.StudyError
            If the study has no such output or known input, units differ, or an output has times in one of them only.
            Also if times precede the start of the study. Also if a known value is impossible for its input, values are
            too large to compute with, or the noise is below their rounding errors.

        Warns
        -----
        uqmbd.StudyWarning
            If an angle looks as if it was measured within one turn, while the study counts turns.
        """
        check_against(self.name, self.series, self.known, study)
        return self

    def __repr__(self) -> str:
        machine = f" of {self.machine!r}" if self.machine else ""
        known = ", ".join(f"{name} = {value:g}" for name, value in self.known.items())
        return (
            f"<record {self.name!r}{machine}{f' with {known}' if known else ''}: {', '.join(map(repr, self.series))}>"
        )


def _make_record(
    columns: Sequence[OutputColumn],
    about: Mapping[str, Any],
    name: str | None,
    where: str,
    *,
    known: Mapping[str, float] | None,
    machine: str | None,
    **given: Any,
) -> Record:
    """Return the record of columns and arguments; errors state the place."""
    series = series_of(columns, given["units"], given["noise"], given["outputs"], where)
    try:
        return Record(
            about["name"] if name is None else name,
            series,
            about.get("known", {}) if known is None else known,
            about.get("machine", "") if machine is None else machine,
        )
    except uqmbd.StudyError as error:
        raise uqmbd.StudyError(f"{where}: {error}") from None
