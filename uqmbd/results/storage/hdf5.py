"""Provide HDF5 files that can be closed after a failed write, and that cache their objects by path.

h5netcdf looks up an object by its path at each access: 43 times to write one variable. These searches take half of the
time to write (152 small variables: 1.0 of 2.0 s) or read results. The classes in this module find each object once.

Files have the format of HDF5 1.10 (2016). All structures of this format have checksums, and a variable of one chunk
needs no index, which would take 2 kB.
"""

from __future__ import annotations

import functools
import io
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, BinaryIO

from uqmbd.files import no_link

__all__ = ["NetcdfFile", "WriteError", "netcdf_file", "remembering"]


class WriteError(OSError):
    """A file could not be written to the disk."""


class _Handle(io.RawIOBase):
    """File object that records the first error of the disk instead of raising it, and discards later writes.

    HDF5 cannot close a file after a failed write; the process would then crash when it ends.
    """

    def __init__(self, file: BinaryIO) -> None:
        self._file = file
        self._place = 0
        self._end = 0
        self.problem: OSError | None = None

    def readable(self) -> bool:
        return True

    def writable(self) -> bool:
        return True

    def seekable(self) -> bool:
        return True

    def seek(self, offset: int, whence: int = io.SEEK_SET) -> int:
        self._place = offset + {io.SEEK_SET: 0, io.SEEK_CUR: self._place, io.SEEK_END: self._end}[whence]
        return self._place

    def tell(self) -> int:
        return self._place

    def readinto(self, buffer: Any) -> int:
        """Read bytes into a buffer; unwritten bytes are zero."""
        view = memoryview(buffer).cast("B")
        self._file.seek(self._place)
        data = self._file.read(len(view))
        view[: len(data)] = data
        view[len(data) :] = bytes(len(view) - len(data))
        self._place += len(view)
        return len(view)

    def write(self, buffer: Any) -> int:
        view = memoryview(buffer).cast("B")
        if self.problem is None:
            try:
                self._file.seek(self._place)
                written = 0
                while written < len(view):
                    written += self._file.write(view[written:])
            except OSError as error:
                self.problem = error
        self._place += len(view)
        self._end = max(self._end, self._place)
        return len(view)

    def truncate(self, size: int | None = None) -> int:
        self._end = self._place if size is None else size
        if self.problem is None:
            try:
                self._file.truncate(self._end)
            except OSError as error:
                self.problem = error
        return self._end

    def check(self) -> None:
        """Raise WriteError if an error of the disk was recorded."""
        if self.problem is not None:
            raise WriteError(self.problem.errno, self.problem.strerror or str(self.problem)) from self.problem


@functools.cache
def remembering() -> Any:
    """Return a subclass of `h5py.File` that looks up each object once."""
    import h5py

    class RememberingGroup(h5py.Group):  # type: ignore[misc]  # h5py has no types
        def __init__(self, identifier: Any, known: dict[str, Any]) -> None:
            super().__init__(identifier)
            self._known = known

        def __delitem__(self, name: str) -> None:
            path = f"{self.name.rstrip('/')}/{name}"
            super().__delitem__(name)
            _forget(self._known, path)

    class RememberingFile(h5py.File):  # type: ignore[misc]  # h5py has no types
        def __init__(self, place: Any, mode: str) -> None:
            self._known: dict[str, Any] = {}
            # netCDF lists objects in order of creation
            written = {"track_order": True, "libver": ("v110", "v110")} if mode == "w" else {}
            super().__init__(place, mode, **written)

        def __getitem__(self, name: Any) -> Any:
            if not isinstance(name, str):
                return super().__getitem__(name)
            if name not in self._known:
                found = super().__getitem__(name)
                group = isinstance(found, h5py.Group)
                self._known[name] = RememberingGroup(found.id, self._known) if group else found
            return self._known[name]

        def __delitem__(self, name: str) -> None:
            super().__delitem__(name)
            _forget(self._known, f"/{name.strip('/')}")

    return RememberingFile


def _forget(known: dict[str, Any], path: str) -> None:
    """Remove the cached objects at an absolute path and below it."""
    for name in [name for name in known if f"/{name.strip('/')}/".startswith(f"{path}/")]:
        del known[name]


class NetcdfFile:
    """NetCDF file that h5netcdf writes; `check` raises the recorded error of the disk."""

    def __init__(self, file: Any, inner: Any, handle: _Handle) -> None:
        self.file = file
        self.check = handle.check
        self._inner = inner

    def chunks(self, names: Iterable[str]) -> list[tuple[int, int]]:
        """Return the offsets and sizes (bytes) of the chunks of variables; names are paths from the root."""
        self._inner.flush()
        found = []
        for name in names:
            variable = self._inner[name].id
            chunks = map(variable.get_chunk_info, range(variable.get_num_chunks()))
            found += [(chunk.byte_offset, chunk.size) for chunk in chunks]
        return found


@contextmanager
def netcdf_file(path: Path) -> Iterator[NetcdfFile]:
    """Create a netCDF file, which is closed after any exception.

    Raise WriteError if the file could not be written, also in place of an exception of the context. Other exceptions of
    the context are passed on.

    >>> import tempfile, xarray
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     with netcdf_file(Path(folder) / "a.nc") as made:
    ...         made.file.attrs["title"] = "x"
    ...     xarray.load_dataset(Path(folder) / "a.nc", engine="h5netcdf").attrs["title"]
    'x'
    """
    import h5netcdf

    with open(path, "w+b", buffering=0, opener=no_link) as raw:
        handle = _Handle(raw)
        try:
            with remembering()(handle, "w") as inner, h5netcdf.File(inner, "w") as file:
                yield NetcdfFile(file, inner, handle)
                handle.check()
        except Exception:
            handle.check()  # replace the exception of HDF5, whose type varies, by the error of the disk
            raise
        handle.check()
