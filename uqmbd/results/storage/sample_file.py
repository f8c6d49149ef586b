"""Samples in a file of their own, written chunk by chunk."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from uqmbd.errors import StudyError
from uqmbd.files import replacing
from uqmbd.results.schema import SCHEMA_VERSION, Labels
from uqmbd.results.storage.hdf5 import NetcdfFile, WriteError, netcdf_file
from uqmbd.results.storage.unfinished import how_to_go_on
from uqmbd.typing import Array

__all__ = ["SampleFile", "sample_file"]


class SampleFile:
    """An open file of samples, in the layout of the dataset ``samples`` (netCDF-4)."""

    def __init__(self, made: NetcdfFile) -> None:
        self._file = made.file
        self._check = made.check

    def write(
        self, first: int, values: Array, response: Array, status: NDArray[np.int64], messages: Sequence[str]
    ) -> None:
        """Write samples from index `first` on.

        Parameters
        ----------
        first : int
            Index of the first of them.
        values : array, shape (K, input)
        response : array, shape (K, output, time)
        status : array of int, shape (K,)
        messages : sequence of str
        """
        part = slice(first, first + len(values))
        self._file["inputs"][part] = values
        self._file["response"][part] = response
        self._file["status"][part] = status
        for k, message in enumerate(messages):
            if message:
                self._file["message"][first + k] = message
        self._check()


@contextmanager
def sample_file(path: Path, count: int, labels: Labels, chunk: int = 64) -> Iterator[SampleFile]:
    """Create a file for `count` samples; it gets its name when all are written.

    Parameters
    ----------
    path : Path
        Where to.
    count : int
        Number of samples.
    labels : Labels
        Meaning of the axes.
    chunk : int
        Samples of a stored chunk.

    Raises
    ------
    StudyError
        If it cannot be written.

    Examples
    --------
    >>> import tempfile, xarray
    >>> from uqmbd.results import labels
    >>> path = Path(tempfile.mkdtemp()) / "samples.nc"
    >>> with sample_file(path, 2, labels(["x"], ["k"], [0.0, 1.0])) as file:
    ...     file.write(0, np.ones((2, 1)), np.ones((2, 1, 2)), np.zeros(2, int), ["", ""])
    >>> float(xarray.load_dataset(path, engine="h5netcdf")["response"].sum())
    4.0
    """
    size = min(chunk, count)
    times = labels.times if labels.times is not None else np.zeros(1)
    try:
        with replacing(path) as part, netcdf_file(part) as made:
            file = made.file
            shape = {"sample": count, "output": len(labels.outputs), "input": len(labels.inputs), "time": len(times)}
            file.attrs["schema_version"] = SCHEMA_VERSION
            file.dimensions = shape
            file.create_variable("time", ("time",), float, data=times).attrs["units"] = "s"
            for name, infos in (("output", labels.outputs), ("input", labels.inputs)):
                for suffix, texts in (("", [i.name for i in infos]), ("_units", [i.units for i in infos])):
                    variable = file.create_variable(f"{name}{suffix}", (name,), _text())
                    for k, text in enumerate(texts):
                        variable[k] = text
            if np.any(labels.turns):
                file.create_variable("output_angle", ("output",), float, data=np.asarray(labels.turns))
            cube = (size, shape["output"], shape["time"])
            file.create_variable(
                "response", ("sample", "output", "time"), float, chunks=cube, compression="gzip", compression_opts=1
            )
            file.create_variable("inputs", ("sample", "input"), float)
            file.create_variable("status", ("sample",), np.int32)
            file.create_variable("message", ("sample",), _text())
            yield SampleFile(made)
    except WriteError as error:
        remedy = how_to_go_on(path.parent)
        raise StudyError(f"{path} cannot be written: {error.strerror}.{remedy}") from error


def _text() -> Any:
    import h5py

    return h5py.string_dtype("utf-8")
