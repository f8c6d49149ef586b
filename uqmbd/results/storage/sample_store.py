"""Samples in a separate Zarr folder, which is read and written chunk by chunk.

The layout is that of Zarr's format 2, which `xarray.open_zarr` reads.  The files of chunks are read and written by
`chunk_file`, with checksums.

Length: what is public tells its parameters, and has an example.
"""

from __future__ import annotations

import json
import os
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from uqmbd.arguments import Count, Size, typechecked
from uqmbd.errors import StudyError
from uqmbd.files import replacing
from uqmbd.packages import require_package
from uqmbd.results.schema import SCHEMA_VERSION, Labels, check_version, labels, output_infos
from uqmbd.results.storage.chunk_file import check_file, codecs, decoded, encoded, same_codecs, write_file
from uqmbd.results.storage.zarr_check import check_folder
from uqmbd.status import Status
from uqmbd.typing import Array, Mask

__all__ = [
    "KINDS",
    "MESSAGE",
    "SampleChunk",
    "SampleStore",
    "SampleStoreChunks",
]

BLOCK = 8192
"""Samples of a chunk of inputs, status and messages, about: these are small."""

MESSAGE = 500
"""Letters of a message at most."""

KINDS = {"response": "<f8", "inputs": "<f8", "status": "<i4", "message": f"<U{MESSAGE}"}
"""Variables, and the types of their values."""

_DAMAGED = (OSError, LookupError, TypeError, ValueError, RuntimeError)
"""Exceptions on reading a damaged store."""


@typechecked
@dataclass(frozen=True, eq=False)
class SampleChunk:
    """Some consecutive samples.

    `first`: index of the first of them; `response` (K, output, time): naN where a realisation failed; `good` (K,):
    which succeeded, with outputs that are all finite.

    >>> import numpy as np
    >>> from uqmbd.results.storage import SampleChunk
    >>> chunk = SampleChunk(first=100, response=np.zeros((50, 2, 11)), good=np.ones(50, dtype=bool))
    >>> chunk.first + len(chunk.response)  # where the next one begins
    150
    """

    first: int
    response: Array
    good: Mask


@typechecked
@dataclass(frozen=True, eq=False)
class SampleStoreChunks:
    """The chunks of a store, in order; they can be iterated repeatedly, with one in memory at a time.

    Attributes
    ----------
    store : SampleStore
        Where they are.
    columns : tuple of int, optional
        Only these outputs.

    Examples
    --------
    >>> import tempfile
    >>> from pathlib import Path
    >>> import numpy as np
    >>> from uqmbd.results import SampleStore
    >>> from uqmbd.extend import labels, sample_dataset
    >>> samples = sample_dataset(np.ones((5, 1, 2)), np.zeros((5, 1)), labels(["x"], ["k"], [0.0, 1.0]))
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     chunks = SampleStore.write(Path(folder) / "a-samples.zarr", samples, size=2).chunks()
    ...     print(len(chunks), [len(chunk.response) for chunk in chunks], chunks[2].first)
    3 [2, 2, 1] 4
    """

    store: SampleStore
    columns: tuple[int, ...] | None = None

    def __len__(self) -> int:
        return -(-self.store.count // self.store.size)

    def __iter__(self) -> Iterator[SampleChunk]:
        for number in range(len(self)):
            yield self[number]

    def __getitem__(self, number: int) -> SampleChunk:
        if not 0 <= number < len(self):
            raise IndexError(f"there are {len(self)} chunks")
        store = self.store
        first = number * store.size
        response = store.read("response", first, min(first + store.size, store.count))
        if self.columns is not None:
            response = response[:, list(self.columns)]
        fine = store.read("status", first, first + len(response)) == Status.OK
        good = fine & np.isfinite(response.reshape(len(response), -1)).all(axis=1)
        return SampleChunk(first, response, good)


@typechecked
@dataclass(frozen=True, eq=False)
class SampleStore:
    """Samples in a folder, ``LABEL-samples.zarr`` of a run, which are read a chunk at a time.

    Attributes
    ----------
    folder : Path
    count : int
        All samples.
    size : int
        Samples of a chunk.
    labels : Labels
        Meaning of the axes.

    Examples
    --------
    >>> import tempfile
    >>> from uqmbd.extend import labels, sample_dataset
    >>> samples = sample_dataset(np.arange(10.0).reshape(5, 1, 2), np.zeros((5, 1)), labels(["x"], ["k"], [0.0, 1.0]))
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     store = SampleStore.write(Path(folder) / "a-samples.zarr", samples, size=2)
    ...     print(len(store), [(part.first, float(part.response.sum())) for part in store.chunks()])
    5 [(0, 6.0), (2, 22.0), (4, 17.0)]
    """

    folder: Path
    count: Size
    size: Size
    labels: Labels

    def __len__(self) -> int:
        return self.count

    def chunks(self, outputs: Sequence[str] | None = None) -> SampleStoreChunks:
        """Return the chunks, in order; they can be iterated repeatedly.

        Parameters
        ----------
        outputs : sequence of str, optional
            Those that are read; by default all.

        Raises
        ------
        StudyError
            If there is no such output; while they are read, if a file is damaged.
        """
        if outputs is None:
            return SampleStoreChunks(self)
        names = [o.name for o in self.labels.outputs]
        if unknown := [name for name in outputs if name not in names]:
            raise StudyError(f"{self.folder} has no output {unknown[0]!r}; there are {', '.join(names)}.")
        return SampleStoreChunks(self, tuple(names.index(name) for name in outputs))

    @staticmethod
    def open(path: str | os.PathLike[str]) -> SampleStore:
        """Open a store that is complete; nothing in it is executed.

        Raises
        ------
        StudyError
            If there is none, it is damaged, or has codecs that are not written here.
        """
        folder = Path(path)
        if not folder.is_dir():
            raise StudyError(
                f"There are no samples at {str(folder)!r}; expected a folder, LABEL-samples.zarr of a run."
            )
        try:
            about, coords = _opened(folder)
            infos = [str(name) for name in coords["input"].values]
            times = coords["time"].values if "time" in coords.coords else None
            axes = labels(output_infos(coords), infos, times)
            store = SampleStore(folder, about["response"]["shape"][0], about["response"]["chunks"][0], axes)
            complete = all(store._fits(name, found) for name, found in about.items()) and store._complete()
        except StudyError:
            raise
        except _DAMAGED as error:
            names_it = isinstance(error, (KeyError, FileNotFoundError)) and len(error.args) == 1
            reason = f"{error.args[0]} is missing" if names_it else error
            raise StudyError(f"{str(folder)!r} cannot be read as samples; it is damaged or none: {reason}") from error
        if not complete:
            raise StudyError(
                f"{str(folder)!r} cannot be read as samples: some of its chunks are missing, or of another layout."
            )
        return store

    def fits(self) -> bool:
        """Return whether the folder has this layout and these axes, and can be opened."""
        try:
            about, coords = _opened(self.folder)
            return coords.equals(_coordinates(self.labels)) and all(self._fits(*found) for found in about.items())
        except (StudyError, *_DAMAGED):
            return False

    def _fits(self, name: str, found: dict[str, Any]) -> bool:
        """Return whether a variable has the layout that is written here."""
        shape, chunk = self.shapes(name)
        layout = {"shape": list(shape), "chunks": list(chunk), "dtype": KINDS[name], "order": "C"}
        return found | layout == found and same_codecs(found, KINDS[name], chunk)

    def _complete(self) -> bool:
        # what is missing others read as NaN
        for name in ("response", "inputs"):
            shape, chunk = self.shapes(name)
            number = -(-shape[0] // chunk[0])
            with os.scandir(self.folder / name) as entries:
                found = {entry.name for entry in entries if not entry.name.startswith(".")}
            if len(found) != number or not all(self.place(name, k).name in found for k in range(number)):
                return False
        return True

    @staticmethod
    def write(path: str | os.PathLike[str], samples: xr.Dataset, size: Count = 512) -> SampleStore:
        """Write the dataset ``samples`` of a method as a store, completely or not at all.

        Parameters
        ----------
        path : path-like
            Of the folder.
        samples : xarray.Dataset
            From :func:`uqmbd.extend.sample_dataset`.
        size : int
            Samples of a chunk.

        Returns
        -------
        SampleStore
            Complete.

        Raises
        ------
        uqmbd.StudyError
            If the path names no folder.
        OSError
            If it cannot be written.
        """
        target = Path(path)
        if not target.name:
            raise StudyError(f"SampleStore.write: path is {str(path)!r}; expected the name of a folder that is made.")
        names, units = samples["input"].values, samples["input_units"].values
        inputs = [(str(n), str(u)) for n, u in zip(names, units, strict=True)]
        axes = labels(output_infos(samples), inputs, samples["time"].values if "time" in samples.coords else None)
        with replacing(target) as part:
            made = SampleStore.create(part, samples.sizes["sample"], size, axes)
            made.put("response", 0, samples["response"].values)
            for name in ("inputs", "status", "message"):
                made.put(name, 0, samples[name].values)
        return SampleStore.open(target)

    @staticmethod
    def create(
        folder: Path, count: Size, size: Size, axes: Labels, attrs: Mapping[str, str] | None = None
    ) -> SampleStore:
        """Make a store without chunks, in a new folder, with attributes.

        Parameters
        ----------
        folder : pathlib.Path
            Where.
        count : int
            Samples of the whole.
        size : int
            Samples of a chunk.
        axes : Labels
            Of the outputs, the inputs and the times.
        attrs : mapping of str to str, optional
            Attributes.

        Returns
        -------
        SampleStore
            Empty.
        """
        zarr = require_package("zarr", "the store of many samples", "uqmbd[samples]")
        coords = _coordinates(axes)
        coords.attrs = {"schema_version": SCHEMA_VERSION, **(attrs or {})}
        checked = {str(key): codecs(str(one.dtype.str), one.shape) for key, one in coords.coords.items()}
        coords.to_zarr(folder, zarr_format=2, consolidated=False, encoding=checked)
        group = zarr.open_group(folder, mode="a", zarr_format=2)
        store = SampleStore(folder, count, size, axes)
        for name, kind in KINDS.items():
            shape, chunk = store.shapes(name)
            group.create_array(
                name,
                shape=shape,
                chunks=chunk,
                dtype=kind,
                fill_value=np.nan if kind == "<f8" else None,  # xarray masks what equals it
                attributes={"_ARRAY_DIMENSIONS": store.dims(name)},
                **codecs(kind, chunk),
            )
        zarr.consolidate_metadata(folder, zarr_format=2)
        return store

    @staticmethod
    def attribute(folder: Path, name: str) -> str | None:
        """Return an attribute of a store; nothing where there is none.

        Parameters
        ----------
        folder : pathlib.Path
            Of a store.
        name : str
            Of the attribute.
        """
        try:
            found = json.loads((folder / ".zattrs").read_bytes()).get(name)
        except (OSError, ValueError, AttributeError):
            return None
        return found if isinstance(found, str) else None

    def dims(self, name: str) -> list[str]:
        """Return the dimensions of a variable."""
        return ["sample", *{"response": self.labels.dims, "inputs": ("input",)}.get(name, ())]

    def shapes(self, name: str) -> tuple[tuple[int, ...], tuple[int, ...]]:
        """Return the shape of a variable, and that of its chunks."""
        rest = {"response": self.labels.shape, "inputs": (len(self.labels.inputs),)}.get(name, ())
        chunk = self.size if name == "response" else self.block
        return (self.count, *rest), (chunk, *(max(n, 1) for n in rest))

    @cached_property
    def block(self) -> int:
        """Samples of a chunk of inputs, status and messages."""
        return self.size * max(1, BLOCK // self.size)

    def place(self, name: str, number: Size) -> Path:
        """Return the file of a chunk of a variable.

        Parameters
        ----------
        name : str
            Of a variable, as ``response``.
        number : int
            Of the chunk.
        """
        return self.place_in(self.folder, name, number)

    def place_in(self, folder: Path, name: str, number: Size) -> Path:
        """Return the file of a chunk of a variable in another folder.

        Parameters
        ----------
        folder : pathlib.Path
            Of a store.
        name : str
            Of a variable, as ``response``.
        number : int
            Of the chunk.
        """
        return folder / name / ".".join([str(number), *"0" * (len(self.dims(name)) - 1)])

    def put(self, name: str, first: Size, values: NDArray[Any]) -> None:
        """Write a variable, from the index of a sample on at which a chunk begins; empty variables have no file.

        Parameters
        ----------
        name : str
            Of a variable, as ``response``.
        first : int
            Index of the first of the samples.
        values : array, shape (K, ...)
            Of the samples.
        """
        _, chunk = self.shapes(name)
        for k in range(0, len(values), chunk[0]):
            part = values[k : k + chunk[0]]
            if name in ("response", "inputs") or (part != part.dtype.type()).any():
                write_file(self.place(name, (first + k) // chunk[0]), encoded(part, KINDS[name], chunk))
            else:
                self.place(name, (first + k) // chunk[0]).unlink(missing_ok=True)  # of an earlier run

    def read(self, name: str, first: Size, last: Size) -> NDArray[Any]:
        """Read a variable of some samples, all of one chunk.

        Parameters
        ----------
        name : str
            Of a variable, as ``response``.
        first, last : int
            From the first to before the last.

        Returns
        -------
        array, shape (last - first, ...)
            NaN where nothing was written.

        Raises
        ------
        StudyError
            If the file is damaged.
        """
        _, chunk = self.shapes(name)
        number = first // chunk[0]
        found = decoded(self.place(name, number), KINDS[name], chunk)
        begin = number * chunk[0]
        return found[first - begin : last - begin]


def _coordinates(axes: Labels) -> xr.Dataset:
    return xr.Dataset(coords={**axes.output_coords(), **axes.input_coords()})


def _opened(folder: Path) -> tuple[dict[str, dict[str, Any]], xr.Dataset]:
    """Return the layout of a store's variables, and its coordinates; nothing in it is executed."""
    check_folder(folder, unread=KINDS)
    _check_coordinates(folder)
    with xr.open_zarr(folder, chunks=None, consolidated=True) as data:
        check_version(data.attrs, str(folder))
        return _layout(folder), data.coords.to_dataset().load()


def _check_coordinates(folder: Path) -> None:
    """Raise an error that names a file of a coordinate, which Zarr's own does not."""
    with os.scandir(folder) as entries:
        names = [entry.name for entry in entries if entry.is_dir() and entry.name not in KINDS]
    for name in names:
        for file in (folder / name).glob("[0-9]*"):
            check_file(file)


def _layout(folder: Path) -> dict[str, dict[str, Any]]:
    return {name: json.loads((folder / name / ".zarray").read_bytes()) for name in KINDS}
