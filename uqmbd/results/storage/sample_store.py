"""Store samples in a separate Zarr folder, which is read and written chunk by chunk.

The folder has the layout of Zarr format 2, so `xarray.open_zarr` can read it. The module `chunk_file` reads and writes
the chunk files, with checksums.

Length: more than 420 lines, because docstrings of public functions list parameters and errors, and have examples.
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
"""Approximate number of samples in a chunk of inputs, status and messages; their values need little memory."""

MESSAGE = 500
"""Maximum number of characters of a message."""

KINDS = {"response": "<f8", "inputs": "<f8", "status": "<i4", "message": f"<U{MESSAGE}"}
"""Names of the variables, with their data types."""

_DAMAGED = (OSError, LookupError, TypeError, ValueError, RuntimeError)
"""Exceptions that reading a damaged store can raise."""


@typechecked
@dataclass(frozen=True, eq=False)
class SampleChunk:
    """Consecutive samples of a store.

    `first`: index of the first sample; `response` (K, output, time): outputs, NaN for failed realisations; `good` (K,):
    True for successful realisations with finite outputs.

    >>> import numpy as np
    >>> from uqmbd.results.storage import SampleChunk
    >>> chunk = SampleChunk(first=100, response=np.zeros((50, 2, 11)), good=np.ones(50, dtype=bool))
    >>> chunk.first + len(chunk.response)  # first sample of the next chunk
    150
    """

    first: int
    response: Array
    good: Mask


@typechecked
@dataclass(frozen=True, eq=False)
class SampleStoreChunks:
    """Sequence of the chunks of a store; repeated iteration is possible, with one chunk in memory at a time.

    Attributes
    ----------
    store : SampleStore
        Store that contains the chunks.
    columns : tuple of int, optional
        Indices of the outputs to read. Default: all.

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
    """Samples in the folder ``LABEL-samples.zarr`` of a run, which are read chunk by chunk.

    Attributes
    ----------
    folder : Path
        Folder of the store.
    count : int
        Number of samples.
    size : int
        Number of samples in a chunk.
    labels : Labels
        Outputs, inputs and times of the axes.

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
        """Return the chunks as a sequence, which can be iterated repeatedly.

        Parameters
        ----------
        outputs : sequence of str, optional
            Names of the outputs to read. Default: all.

        Raises
        ------
        StudyError
            If the store has no output of that name. Reading a chunk raises it if the chunk file is damaged.
        """
        if outputs is None:
            return SampleStoreChunks(self)
        names = [o.name for o in self.labels.outputs]
        if unknown := [name for name in outputs if name not in names]:
            raise StudyError(f"{self.folder} has no output {unknown[0]!r}; its outputs are {', '.join(names)}.")
        return SampleStoreChunks(self, tuple(names.index(name) for name in outputs))

    @staticmethod
    def open(path: str | os.PathLike[str]) -> SampleStore:
        """Open a complete store without executing its content.

        Raises
        ------
        StudyError
            If the store does not exist, is damaged, or has codecs that uqmbd does not write.
        """
        folder = Path(path)
        if not folder.is_dir():
            raise StudyError(f"{str(folder)!r} is not a sample store; expected the folder LABEL-samples.zarr of a run.")
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
            is_missing = isinstance(error, (KeyError, FileNotFoundError)) and len(error.args) == 1
            reason = f"{error.args[0]} is missing" if is_missing else error
            raise StudyError(f"{str(folder)!r} is damaged, or is not a sample store: {reason}") from error
        if not complete:
            raise StudyError(
                f"The sample store {str(folder)!r} is incomplete: some of its chunks are missing or "
                "have another layout."
            )
        return store

    def fits(self) -> bool:
        """Return whether the folder can be opened and has the layout and the axes of this store."""
        try:
            about, coords = _opened(self.folder)
            return coords.equals(_coordinates(self.labels)) and all(self._fits(*found) for found in about.items())
        except (StudyError, *_DAMAGED):
            return False

    def _fits(self, name: str, found: dict[str, Any]) -> bool:
        """Return whether a variable has the layout that this class writes."""
        shape, chunk = self.shapes(name)
        layout = {"shape": list(shape), "chunks": list(chunk), "dtype": KINDS[name], "order": "C"}
        return found | layout == found and same_codecs(found, KINDS[name], chunk)

    def _complete(self) -> bool:
        # check the names of the chunk files, because Zarr reads missing chunks as NaN
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
        """Write the dataset ``samples`` of a method as a store, atomically.

        Parameters
        ----------
        path : path-like
            Path of the folder.
        samples : xarray.Dataset
            Samples from :func:`uqmbd.extend.sample_dataset`.
        size : int
            Number of samples in a chunk.

        Returns
        -------
        SampleStore
            Complete store.

        Raises
        ------
        uqmbd.StudyError
            If the path cannot be a folder.
        OSError
            If the store cannot be written.
        """
        target = Path(path)
        if not target.name:
            raise StudyError(f"SampleStore.write: path is {str(path)!r}; expected the path of a new folder.")
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
        """Create a store without chunks in a new folder.

        Parameters
        ----------
        folder : pathlib.Path
            Folder to create.
        count : int
            Total number of samples.
        size : int
            Number of samples in a chunk.
        axes : Labels
            Labels of the outputs, inputs and times.
        attrs : mapping of str to str, optional
            Attributes of the store.

        Returns
        -------
        SampleStore
            Empty store.
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
                fill_value=np.nan if kind == "<f8" else None,  # xarray masks values equal to it
                attributes={"_ARRAY_DIMENSIONS": store.dims(name)},
                **codecs(kind, chunk),
            )
        zarr.consolidate_metadata(folder, zarr_format=2)
        return store

    @staticmethod
    def attribute(folder: Path, name: str) -> str | None:
        """Return an attribute of a store, or None if the store has no such text attribute.

        Parameters
        ----------
        folder : pathlib.Path
            Folder of the store.
        name : str
            Name of the attribute.
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
        """Return the shape of a variable and the shape of its chunks."""
        rest = {"response": self.labels.shape, "inputs": (len(self.labels.inputs),)}.get(name, ())
        chunk = self.size if name == "response" else self.block
        return (self.count, *rest), (chunk, *(max(n, 1) for n in rest))

    @cached_property
    def block(self) -> int:
        """Number of samples in a chunk of inputs, status and messages."""
        return self.size * max(1, BLOCK // self.size)

    def place(self, name: str, number: Size) -> Path:
        """Return the file of a chunk of a variable.

        Parameters
        ----------
        name : str
            Name of the variable, such as ``response``.
        number : int
            Number of the chunk.
        """
        return self.place_in(self.folder, name, number)

    def place_in(self, folder: Path, name: str, number: Size) -> Path:
        """Return the file of a chunk of a variable in another folder.

        Parameters
        ----------
        folder : pathlib.Path
            Folder of the store.
        name : str
            Name of the variable, such as ``response``.
        number : int
            Number of the chunk.
        """
        return folder / name / ".".join([str(number), *"0" * (len(self.dims(name)) - 1)])

    def put(self, name: str, first: Size, values: NDArray[Any]) -> None:
        """Write values of a variable from the first sample of a chunk on; empty values get no file.

        Parameters
        ----------
        name : str
            Name of the variable, such as ``response``.
        first : int
            Index of the first sample, at which a chunk begins.
        values : array, shape (K, ...)
            Values of the samples.
        """
        _, chunk = self.shapes(name)
        for k in range(0, len(values), chunk[0]):
            part = values[k : k + chunk[0]]
            if name in ("response", "inputs") or (part != part.dtype.type()).any():
                write_file(self.place(name, (first + k) // chunk[0]), encoded(part, KINDS[name], chunk))
            else:
                self.place(name, (first + k) // chunk[0]).unlink(missing_ok=True)  # file of an earlier run

    def read(self, name: str, first: Size, last: Size) -> NDArray[Any]:
        """Read a variable for samples of a single chunk.

        Parameters
        ----------
        name : str
            Name of the variable, such as ``response``.
        first, last : int
            Index of the first sample, and index after the last one.

        Returns
        -------
        array, shape (last - first, ...)
            Values; NaN for samples that were not written.

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
    """Return the layout of the variables of a store and its coordinates, without executing its content."""
    check_folder(folder, unread=KINDS)
    _check_coordinates(folder)
    with xr.open_zarr(folder, chunks=None, consolidated=True) as data:
        check_version(data.attrs, str(folder))
        return _layout(folder), data.coords.to_dataset().load()


def _check_coordinates(folder: Path) -> None:
    """Raise StudyError if a file of a coordinate is damaged, with the name of the file, which Zarr does not state."""
    with os.scandir(folder) as entries:
        names = [entry.name for entry in entries if entry.is_dir() and entry.name not in KINDS]
    for name in names:
        for file in (folder / name).glob("[0-9]*"):
            check_file(file)


def _layout(folder: Path) -> dict[str, dict[str, Any]]:
    return {name: json.loads((folder / name / ".zarray").read_bytes()) for name in KINDS}
