"""Results on disk: netCDF, written at once or not at all, read back as they were; Zarr of before is read.

Every variable has HDF5's checksum, where HDF5 has one, and every file a digest.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr
from xarray.backends import H5NetCDFStore

from uqmbd.arguments import typechecked
from uqmbd.errors import StudyError, UqmbdError
from uqmbd.files import regular, replacing
from uqmbd.logs import results
from uqmbd.packages import require_package
from uqmbd.results.schema import check_version, validate
from uqmbd.results.storage.chunks import chunks_of
from uqmbd.results.storage.digest import CHECKSUM, add_digest, check_digest
from uqmbd.results.storage.encoding import decode, decode_tree, drop_own, encode_tree
from uqmbd.results.storage.hdf5 import netcdf_file
from uqmbd.results.storage.manifest import has_manifest, in_manifest, is_ours, record
from uqmbd.results.storage.reading import PLAIN, check_memory, opened_netcdf
from uqmbd.results.storage.unfinished import resume_hint, saved, unsaved
from uqmbd.results.storage.zarr_check import check_folder

__all__ = ["errors_of_files", "load", "load_with", "not_verified", "read_root", "save"]

_NETCDF = (".nc", ".nc4")
_COMPRESS_FROM = 10_000  # numbers; below, compression costs more than it saves


@typechecked
def save(tree: xr.DataTree, path: str | os.PathLike[str]) -> Path:
    """Write a result to a netCDF file, with the version of its schema and a digest.

    It is written next to the target and then replaces it. So a reader never sees half a result, and an interrupted run
    does not change the old one. What `Study.run` keeps beside the target, to go on with, is removed when its results
    are there.

    Parameters
    ----------
    tree : xarray.DataTree
        A result; any tree of numbers and text will do.
    path : path-like
        Ends in ``.nc``; folders on the way are made.  Zarr is written by `to_zarr` of the tree.

    Returns
    -------
    pathlib.Path
        The path.

    Raises
    ------
    StudyError
        If the ending is another one, a variable or an attribute cannot be stored, or the folder cannot be written.

    Examples
    --------
    >>> import tempfile, xarray
    >>> tree = xarray.DataTree(xarray.Dataset({"x": ("sample", [1.0, 2.0])}, attrs={"study": "crank"}))
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     load(save(tree, folder + "/results.nc")).identical(tree)
    True
    """
    target = Path(path)
    if target.suffix != ".nc":
        zarr = f" For Zarr use xarray: tree.to_zarr({str(target)!r})." if target.suffix == ".zarr" else ""
        raise StudyError(f"A result is stored as netCDF, in a file that ends in .nc; {str(target)!r} does not.{zarr}")
    encoded = encode_tree(tree)
    try:
        target.parent.mkdir(parents=True, exist_ok=True)
        with replacing(target) as written:
            _write(encoded, written)
            if has_manifest(target.parent):
                record(target.parent, [target.name], [written])
    except OSError as error:
        unsaved(target.parent, tree.attrs)
        remedy = resume_hint(target.parent)
        raise StudyError(
            f"The result cannot be written to {str(target)!r}: {error.strerror or error}.{remedy}"
        ) from error
    saved(target.parent, tree.attrs)
    return target


@typechecked
def load(path: str | os.PathLike[str]) -> xr.DataTree:
    """Read a result into memory and close its file.

    Nothing that is read is executed: a Zarr folder with codecs that :func:`save` did not write is refused, and netCDF
    holds no code.

    Parameters
    ----------
    path : path-like
        A netCDF file (``.nc``), or a Zarr folder (``.zarr``) of format 2 or 3, written by :func:`save`, or by
        `to_netcdf` or `to_zarr` of the result.

    Returns
    -------
    xarray.DataTree
        As it was saved.  Its ``encoding["digest"]`` is ``"verified"`` where the file has the digest that :func:`save`
        wrote, and ``"not verified"`` where it has none, as files of other programs.

    Raises
    ------
    StudyError
        If it does not exist, is no regular file, has another ending or is damaged. Also if it declares more numbers
        than it can hold or the memory can, or has codecs of its own or a later schema. Also if Zarr is missing.

    Examples
    --------
    >>> load("nowhere.nc")
    Traceback (most recent call last):
        ...
    uqmbd.errors.StudyError: There is no result at 'nowhere.nc'.
    """
    return load_with(Path(path), _read)


def _read(tree: xr.DataTree, source: Path) -> xr.DataTree:
    with tree:
        check_memory(sum(node.dataset.nbytes for node in tree.subtree), source)
        return tree.load()


@typechecked
def read_root(path: str | os.PathLike[str]) -> xr.Dataset:
    """Read the variables in the root of a netCDF file of any program, such as measurements, into memory.

    It is read as :func:`load` reads results, but need not be one: groups, and versions of schemas, are left alone.

    Parameters
    ----------
    path : path-like
        A netCDF file (``.nc``, ``.nc4``).

    Returns
    -------
    xarray.Dataset
        Times are numbers, whatever their units resemble.  Its ``encoding["digest"]`` is as that of :func:`load`.

    Raises
    ------
    StudyError
        If it does not exist, is no regular file, is damaged, or declares more numbers than it can hold or the memory
        can.

    Examples
    --------
    >>> import tempfile, xarray
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     data = xarray.Dataset({"x": ("sample", [1.0, 2.0])})
    ...     _ = data.to_netcdf(folder + "/measured.nc", engine="h5netcdf")
    ...     read_root(folder + "/measured.nc").equals(data)
    True
    """
    source = Path(path)
    if source.suffix.lower() not in _NETCDF:
        raise StudyError(f"Variables are read from .nc or .nc4 (netCDF); {str(source)!r} ends in neither.")

    def variables(tree: xr.DataTree) -> xr.DataTree:
        found = _read(tree, source).to_dataset()
        drop_own(found.attrs)
        return xr.DataTree(decode(found, source))

    return _gated(source, variables, "netCDF file", whole=True, below=False).to_dataset()


def load_with(source: Path, read: Callable[[xr.DataTree, Path], xr.DataTree]) -> xr.DataTree:
    """Open a result without executing any of its content, and read it by a function.

    The function `_read` reads all; with another one the large chunks are not compared with their digests.
    """
    suffix = source.suffix.lower()
    if suffix not in (*_NETCDF, ".zarr"):
        raise StudyError(f"A result is read from .nc (netCDF) or .zarr (Zarr); {str(source)!r} ends in neither.")
    if (source / "response" / ".zarray").is_file():
        raise StudyError(
            f"{str(source)!r} holds samples of a method, and is no result: uqmbd.results.open reads the result beside "
            "it (results.nc), with all samples, and uqmbd.results.SampleStore.open the samples alone."
        )

    def result(tree: xr.DataTree) -> xr.DataTree:
        tree = read(tree, source)
        check_version(tree.attrs, str(source))
        drop_own(tree.attrs)
        return decode_tree(tree, source, ordered=suffix != ".zarr")

    return _gated(source, result, "result", whole=read is _read)


def _gated(
    source: Path, decode: Callable[[xr.DataTree], xr.DataTree], what: str, *, whole: bool, below: bool = True
) -> xr.DataTree:
    """Open a file or a folder after its checks, with or without groups below the root, and convert it."""
    if not source.exists():
        raise StudyError(f"There is no {what} at {str(source)!r}.")
    tree, verified = None, False
    try:
        if source.suffix.lower() == ".zarr":
            check_folder(source)
            # the specification of format 3 has no consolidated metadata
            old = (source / ".zmetadata").is_file() and not (source / "zarr.json").is_file()
            require_package("zarr", f"{source}, a Zarr folder,", "uqmbd[samples]")
            tree = xr.open_datatree(source, engine="zarr", consolidated=old, chunks=None, cache=False, **PLAIN)
        else:
            verified = _verified(source, whole=whole)
            tree = opened_netcdf(source, below=below)
        close = tree.close
        found = decode(tree)
    # whatever the packages that read it raise of what somebody else wrote
    except Exception as error:
        if tree is not None:
            tree.close()
        if isinstance(error, StudyError):
            raise
        reason = " ".join(str(error).split())[:300] or type(error).__name__
        raise StudyError(f"{str(source)!r} cannot be read as a {what}; it is damaged or no {what}: {reason}") from error
    found.set_close(close)
    found.encoding = {"source": str(source), "digest": "verified" if verified else "not verified"}
    if not verified:
        results.info("%s is not verified: it has no digest of uqmbd", source)
    return found


def _verified(source: Path, *, whole: bool) -> bool:
    """Return whether a file is unchanged since uqmbd wrote it, by its digest or the manifest; refuse a damaged one."""
    with regular(source) as file:
        if check_digest(file, whole=whole):
            return True
    if source.name not in in_manifest(source.parent) or not whole:
        return False
    if is_ours(source.parent, source.name):
        return True
    raise StudyError(
        f"{str(source)!r} is not what uqmbd wrote there, by the manifest of the folder, and has no digest: it "
        "is damaged, or another program changed it. If that is meant, rename it: then it is read, as not verified."
    )


def not_verified(tree: xr.DataTree) -> bool:
    """Return whether a result was read from a file, or a folder, without a digest."""
    return bool(tree.encoding.get("digest") == "not verified")


@contextmanager
def errors_of_files(*trees: xr.DataTree) -> Iterator[None]:
    """Add the names of files, and their violations of the schema, to errors with results that were read from them.

    >>> tree = xr.DataTree(xr.Dataset(attrs={"study": "crank"}))
    >>> tree.encoding = {"source": "results.nc", "digest": "not verified"}
    >>> with errors_of_files(tree):
    ...     tree["comparison"]
    Traceback (most recent call last):
        ...
    uqmbd.errors.StudyError: 'results.nc' cannot be used: /: attribute 'mechanism' is missing; expected a text.
    """
    try:
        yield
    except (UqmbdError, OSError, Warning):
        raise
    except Exception as error:
        read = [tree for tree in trees if "digest" in tree.encoding]
        for tree in read:
            try:
                validate(tree)
            except Exception as found:
                reason = str(found) if isinstance(found, StudyError) else f"{type(found).__name__}: {found}"
                raise StudyError(f"{tree.encoding['source']!r} cannot be used: {reason}") from error
        if not read:
            raise
        files = ", ".join(repr(tree.encoding["source"]) for tree in read)
        raise StudyError(
            f"{files}: what was read cannot be used: {type(error).__name__}: {error}. Another program may have changed "
            "it. If not, this is a mistake in uqmbd, or in the plugin that computed it."
        ) from error


def _write(tree: xr.DataTree, path: Path) -> None:
    """Write a tree; of variables that are compressed, the digest of the rest does not cover the numbers."""
    light = {"zlib": True, "complevel": 1, "shuffle": True}
    large: list[str] = []
    with netcdf_file(path) as made:
        for node in tree.subtree:
            group = made.file if node is tree else made.file.create_group(node.relative_to(tree))
            variables: dict[Any, xr.Variable] = {}
            encoding: dict[Any, dict[str, Any]] = {}
            dataset = node.to_dataset(inherit=False).compute()  # what was opened lazily
            for name, given in dataset.variables.items():
                if not given.shape or not given.size or given.dtype.kind == "S":
                    continue  # HDF5 has no checksums for these
                variable, letters = _characters(given) if given.dtype.kind == "U" else (given, {})
                variables[name] = variable
                encoding[name] = {"fletcher32": True, "chunksizes": (*chunks_of(variable), *letters.values())}
                if letters:
                    encoding[name]["char_dim_name"] = next(iter(letters))
                    # h5netcdf writes no coordinate of two dimensions that has one of them from a group above
                    own = letters | ({name: given.size} if name in given.dims else {})
                    for dim in own.keys() - set(group.dimensions):
                        group.dimensions[dim] = own[dim]
                if variable.nbytes >= 8 * _COMPRESS_FROM:
                    encoding[name] |= light
                    large.append(f"{node.path.rstrip('/')}/{name}")
            coords = {name: variables.pop(name) for name in dataset.coords if name in variables}
            dataset = dataset.assign(variables).assign_coords(coords)
            dataset.dump_to_store(H5NetCDFStore(group), encoding=encoding)
            made.check()
        spans = made.chunks(large)
    # a chunk ends with HDF5's checksum
    add_digest(path, [(begin, count - CHECKSUM) for begin, count in spans])


def _characters(variable: xr.Variable) -> tuple[xr.Variable, dict[str, int]]:
    """Turn text to characters, with the dimension of these: of text of any width HDF5 has no checksums."""
    try:
        values = np.char.encode(variable.values, "utf-8")
    except UnicodeEncodeError as error:
        raise StudyError(
            f"A text cannot be stored as UTF-8: {error.object!r:.100}; expected whole characters."
        ) from None
    # few widths, for each is a dimension
    width = 1 << max(3, (values.dtype.itemsize - 1).bit_length())
    attrs = {**variable.attrs, "_Encoding": "utf-8"}
    return xr.Variable(variable.dims, values.astype(f"S{width}"), attrs), {f"_uqmbd_characters_{width}": width}
