"""Record: measurements of a machine."""

from __future__ import annotations

import os
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

import uqmbd
from uqmbd.extend import typechecked
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


@typechecked(values=False)
@dataclass(frozen=True, init=False)
class Record:
    """Measurements of one machine in one run: outputs of a study with their times.

    Parameters
    ----------
    name : str
        Name of the record in tables and reports.
    series : sequence of Series
        Measured values, one series for each output.
    known : mapping of str to float, optional
        Inputs of the study with known values in this record, in their units, such as a set speed.
    machine : str, optional
        Name of the machine, for records of several machines. Default: empty, which means that all records are from one
        machine.

    Raises
    ------
    uqmbd.StudyError
        If an argument is invalid; the message names the argument and the expected value.

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
            raise uqmbd.StudyError(f"{where}: series is empty; expected at least one Series.")
        outputs = [one.output for one in series]
        for output in outputs:
            if outputs.count(output) > 1:
                raise uqmbd.StudyError(
                    f"{where}: series contains the output {output!r} twice; expected each output once."
                )
        if not isinstance(machine, str) or not machine.isprintable():
            raise uqmbd.StudyError(f"{where}: machine is {short(machine)}; expected a string such as 'rig 2'.")
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
        r"""Return the record in a CSV or netCDF file.

        Parameters
        ----------
        path : path-like
            CSV (``.csv``, ``.tsv``, ``.txt``): a header contains the names of the columns, with units in brackets, as
            ``time [s],angle [rad]``. Empty cells and ``nan`` are gaps. Lines that begin with ``#`` are ignored. Without
            a column ``time``, all columns are scalar outputs, and each line is one repeated measurement.
            NetCDF (``.nc``): each output is a variable with the attribute ``units``, and ``noise`` if it is known. The
            coordinate of its dimension, if present, contains the times; see `of`.
        units : mapping of str to str, optional
            Units by output, if the file does not contain them.
        noise : mapping of str to float, optional
            Standard deviation of the errors by output, in the units of the output; replaces the noise in the file.
        known, machine, name : optional
            Same as for the class; these replace the values in the file. Default name for CSV: name of the file.
        outputs : collection of str, optional
            Names of the outputs to read. Default: all outputs.

        Returns
        -------
        Record

        Raises
        ------
        uqmbd.StudyError
            If the file cannot be read or used; the message names the file, the line of a CSV file, and the expected
            content.

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
        """Return the record in an xarray dataset.

        Parameters
        ----------
        dataset : xarray.Dataset
            Dataset with a variable for each output, with the attribute ``units``, and ``noise`` if it is known. The
            coordinate of its dimension contains the times, s. A variable is a scalar output if its dimension has no
            coordinate or is named ``repetition``. The attributes ``name``, ``machine`` and ``known`` (JSON, or a
            mapping) of the dataset describe the record.
        units, noise, known, machine, name, outputs : optional
            Same as for `read`.

        Returns
        -------
        Record
            Record with a series for each variable.

        Raises
        ------
        uqmbd.StudyError
            If the dataset cannot be used.

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
            raise uqmbd.StudyError(
                f"{where}: the type of dataset is {type(dataset).__name__}; expected xarray.Dataset."
            )
        given: Any = {"units": units, "noise": noise, "known": known, "machine": machine, "outputs": outputs}
        about = {"name": "record", **dataset_attributes(dataset, where)}
        return _make_record(dataset_columns(dataset, where), about, name, where, **given)

    def write(self, path: str | os.PathLike[str]) -> Path:
        """Write the record to a netCDF file, completely or not at all; `read` reads it again.

        Parameters
        ----------
        path : path-like
            Path that ends in ``.nc``.

        Returns
        -------
        pathlib.Path
            Path of the written file.

        Raises
        ------
        uqmbd.StudyError
            If the path has another ending, or the file cannot be written.

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
                f"record {self.name!r}: write: path is {short(path)}; expected a path that ends in .nc. A CSV file "
                "cannot contain noise, known inputs and the machine."
            )
        return save(xr.DataTree(self.to_dataset()), path)

    def to_dataset(self) -> xr.Dataset:
        """Return the record as a dataset that `of` accepts.

        Returns
        -------
        xarray.Dataset
            Dataset with a variable for each output; outputs with equal times share a dimension.
        """
        return dataset_of(self.name, self.machine, self.known, self.series)

    @property
    def outputs(self) -> tuple[str, ...]:
        """Names of the outputs, in order."""
        return tuple(one.output for one in self.series)

    @property
    def times(self) -> Array:
        """Times of all outputs, s, sorted and without duplicates; shape ``(T,)``, empty if all are scalar outputs."""
        return np.unique(np.concatenate([one.times for one in self.series]))

    def __getitem__(self, output: str) -> Series:
        for one in self.series:
            if one.output == output:
                return one
        raise uqmbd.StudyError(
            f"record {self.name!r} has no output {output!r}{near(output, self.outputs)} Its outputs are "
            f"{listed(self.outputs)}."
        )

    def checked_against(self, study: uqmbd.Study) -> Record:
        """Return this record if it agrees with a study; otherwise raise an error.

        Parameters
        ----------
        study : uqmbd.Study
            Study with the outputs and inputs of the record.

        Returns
        -------
        Record

        Raises
        ------
        uqmbd.StudyError
            If the study lacks an output or a known input of the record, or units differ. If an output has times in the
            record but not in the study, or vice versa. If times precede the start of the study, or a known value is
            outside the distribution of its input. If values are too large for computations, or the noise is below their
            rounding errors.

        Warns
        -----
        uqmbd.StudyWarning
            If measured angles seem to be limited to one turn, while the study counts turns.
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
    """Return the record of columns and arguments; error messages contain `where`."""
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
