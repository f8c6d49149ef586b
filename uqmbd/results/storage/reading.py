"""Open netCDF files of any origin, and check their objects before any number is read.

The caller converts exceptions of HDF5, h5netcdf and xarray to its own error; h5netcdf prints no traceback.
"""

from __future__ import annotations

import math
import os
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from uqmbd.errors import StudyError
from uqmbd.files import regular
from uqmbd.results.storage.hdf5 import remembering

__all__ = ["NUMBERS", "PLAIN", "check_declared", "check_memory", "check_text", "largest", "opened_netcdf"]

PLAIN: Mapping[str, Any] = {"decode_times": False, "decode_timedelta": False}
"""Options of xarray for opening files, with which times remain numbers for any units."""

_AT_LEAST = 1 << 28
"""Number of bytes that the variables of any file may declare, independent of its size."""

_RATIO = 1100
"""Largest accepted compression ratio of a file; deflate reaches 1032."""

NUMBERS = "biufc"
"""Codes of NumPy (`dtype.kind`) for numbers."""

_TEXTS = "SU"
_PLACEHOLDER = b"This is a netCDF dimension but not a netCDF variable"


def largest(size: int) -> int:
    """Return the largest possible uncompressed size (bytes) of a file of `size` bytes."""
    return max(_AT_LEAST, _RATIO * size)


def check_declared(declared: int, size: int, path: Path) -> None:
    """Refuse a file or a folder of `size` bytes that declares more bytes than it can contain."""
    if declared > largest(size):
        raise StudyError(
            f"{str(path)!r} is rejected: its variables declare {declared / 1e9:.3g} GB or more, which {size} bytes "
            "cannot contain. The file is damaged or malicious."
        )


def check_memory(declared: int, path: Path) -> None:
    """Refuse data that exceed the memory of this computer."""
    try:
        memory = os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
    except (AttributeError, OSError, ValueError):  # the system does not report its memory
        return
    if declared > memory > 0:
        raise StudyError(
            f"{str(path)!r} contains {declared / 1e9:.3g} GB, but this computer has {memory / 1e9:.3g} GB of memory. "
            "Use uqmbd.results.open, which reads only the required part."
        )


def check_text(letters: int, path: Path) -> None:
    """Refuse texts that need more memory than a file can contain or the computer has; a character needs four bytes."""
    size = path.stat().st_size if path.is_file() else sum(one.stat().st_size for one in path.rglob("*"))
    check_declared(4 * letters, size, path)
    check_memory(4 * letters, path)


def opened_netcdf(path: Path, *, below: bool = True) -> xr.DataTree:
    """Open a netCDF file and read only its attributes; the file stays open until `close` of the tree.

    If `below` is False, groups below the root are ignored.

    Raise StudyError if the file declares more bytes than it can contain, has unsupported objects, or links to files.
    """
    with regular(path) as file:
        classic = file.read(3) == b"CDF"
    if classic:
        engine: Any = "scipy"
        data = xr.open_dataset(path, engine=engine, cache=False, **PLAIN)
        found = xr.DataTree(data)
        found.set_close(data.close)
        try:
            check_declared(data.nbytes, path.stat().st_size, path)
        except StudyError:
            data.close()
            raise
        return found
    # the manager can reopen the file in another process
    manager = xr.backends.CachingFileManager(_opened, str(path.resolve()), mode="r", kwargs={"below": below})
    try:
        sets = {
            name: xr.open_dataset(xr.backends.H5NetCDFStore(manager, group=name, mode="r"), cache=False, **PLAIN)
            for name in (_groups(manager.acquire(), "/") if below else ["/"])
        }
        found = xr.DataTree.from_dict(sets)
    except BaseException:
        manager.close()
        raise
    found.set_close(manager.close)
    return found


def _opened(path: str, mode: str, *, below: bool) -> Any:
    """Open a netCDF-4 file by h5netcdf; closing the returned object closes the HDF5 file."""
    import h5netcdf

    class Reader(h5netcdf.File):  # type: ignore[misc]  # h5netcdf has no types
        def close(self) -> None:
            super().close()
            inner.close()

    inner = remembering()(path, mode)
    try:
        _check(inner, Path(path), below=below)
        # read the attributes before h5netcdf does: if it fails, its incomplete object prints a traceback when deleted
        dict(inner.attrs)
        return Reader(inner, mode, decode_vlen_strings=True, phony_dims="access")
    except BaseException:
        inner.close()
        raise


def _groups(group: Any, name: str) -> Iterator[str]:
    yield name
    for child, below in group.groups.items():
        yield from _groups(below, f"{name.rstrip('/')}/{child}")


def _check(file: Any, path: Path, *, below: bool) -> None:
    """Refuse links, cyclic groups, and variables that declare more bytes than the file can contain."""
    import h5py

    size, declared, seen = path.stat().st_size, 0, set()

    def look(group: Any) -> None:
        nonlocal declared
        for name in group:
            link = group.get(name, getlink=True)
            if not isinstance(link, h5py.HardLink):
                raise _refused(path, f"{name!r} in {group.name!r} is a link to another object or file")
            one = file[f"{group.name.rstrip('/')}/{name}"]
            address = h5py.h5o.get_info(one.id).addr
            if isinstance(one, h5py.Group):
                if address in seen:
                    raise _refused(path, f"several paths lead to the group {one.name!r}")
                seen.add(address)
                if below:
                    look(one)
            elif isinstance(one, h5py.Dataset):
                declared += _bytes_of(one, path, size)
                check_declared(declared, size, path)

    seen.add(h5py.h5o.get_info(file.id).addr)
    look(file)


def _bytes_of(variable: Any, path: Path, size: int) -> int:
    """Return the bytes of a variable in memory; 0 for the placeholder of a dimension, which is not read."""
    import h5py

    layout = variable.id.get_create_plist()
    here = layout.get_layout() in (h5py.h5d.COMPACT, h5py.h5d.CONTIGUOUS, h5py.h5d.CHUNKED)
    if not here or layout.get_external_count():
        raise _refused(path, f"{variable.name!r} stores its numbers in another file")
    kind, text = variable.dtype, h5py.check_string_dtype(variable.dtype)
    if kind.kind not in NUMBERS + _TEXTS and text is None:
        raise _refused(path, f"{variable.name!r} has the type {kind}; expected numbers or text")
    # count at least one whole chunk, because HDF5 reads whole chunks
    count = max(0 if shape is None else math.prod(shape) for shape in (variable.shape, variable.chunks))
    if kind.kind == "f" and bytes(np.bytes_(variable.attrs.get("NAME", b""))).startswith(_PLACEHOLDER):
        return 0
    if text is not None and text.length is None:
        check_declared(count * kind.itemsize, size, path)
        # all texts may refer to the same longest text of the file, so read few texts at a time
        at_once = max(largest(size) // (4 * size), 1)
        if count > at_once:
            _check_texts(variable, path, size, at_once)
    letter = 4 if kind.kind == "S" else 1  # bytes of a character in memory
    return int(count * kind.itemsize * letter)


def _check_texts(texts: Any, path: Path, size: int, at_once: int) -> None:
    """Refuse texts that need too much memory: four bytes for each character of the longest text, for each text."""
    longest = 0
    *outer, last = texts.shape
    for index in np.ndindex(*outer):
        for first in range(0, last, at_once):
            longest = max(longest, *map(len, texts[(*index, slice(first, first + at_once))]))
            check_declared(4 * longest * texts.size, size, path)


def _refused(path: Path, found: str) -> StudyError:
    return StudyError(f"{str(path)!r} is rejected: {found}, which uqmbd does not support.")
