"""Write results to netCDF files atomically and without loss; read netCDF files and Zarr folders.

Every variable has a checksum if HDF5 supports one for its type. Every file has a digest.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

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
from uqmbd.results.storage.models import warn_of_absent_models
from uqmbd.results.storage.reading import PLAIN, check_memory, opened_netcdf
from uqmbd.results.storage.unfinished import resume_hint, saved, unsaved
from uqmbd.results.storage.zarr_check import check_folder

__all__ = ["errors_of_files", "load", "load_with", "not_verified", "read_root", "save"]

_NETCDF = (".nc", ".nc4")
_COMPRESS_FROM = 10_000  # numbers; compression of fewer numbers does not pay off


@typechecked
def save(tree: xr.DataTree, path: str | os.PathLike[str]) -> Path:
    """Write a result to a netCDF file, with the version of its schema and a digest.

    The function writes a temporary file next to the target, and then replaces the target by this file. A reader
    therefore never sees an incomplete result, and an interrupted run does not change the old file. After a complete
    write the function removes the chunks of this result that `Study.run` stored next to the target to resume the run.

    Parameters
    ----------
    tree : xarray.DataTree
        Result, or any tree of numbers and text.
    path : path-like
        Path that ends in ``.nc``; missing folders are created. To write Zarr, call `to_zarr` of the tree.

    Returns
    -------
    pathlib.Path
        Path of the file.

    Raises
    ------
    StudyError
        If the path has another ending, a variable or an attribute cannot be stored, or the folder cannot be written.

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
        zarr = f" For Zarr, use tree.to_zarr({str(target)!r}) of xarray." if target.suffix == ".zarr" else ""
        raise StudyError(f"The path of the result is {str(target)!r}; expected a path that ends in .nc (netCDF).{zarr}")
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

    The function executes no content of the file. It refuses Zarr folders with codecs that xarray and Zarr do not use
    for results; netCDF files contain no code.

    Parameters
    ----------
    path : path-like
        Path of a netCDF file (``.nc``) or of a Zarr folder (``.zarr``) of format 2 or 3. The file was written by
        :func:`save`, or by `to_netcdf` or `to_zarr` of the result.

    Returns
    -------
    xarray.DataTree
        The saved result. ``encoding["digest"]`` is ``"verified"`` if the digest, or the manifest of the folder,
        shows that the file is unchanged. Otherwise it is ``"not verified"``, as for files of other programs.

    Warns
    -----
    uqmbd.StudyWarning
        If no installed plugin registers the model of a surrogate; then only the numbers of the surrogate are loaded.
        The warning names the missing package.

    Raises
    ------
    StudyError
        If the path does not exist or has another ending. If the file is not a regular file, is damaged, or declares
        more numbers than the file or the memory can hold. If the file has other codecs or a later schema. If the
        package Zarr is not installed.

    Examples
    --------
    >>> load("nowhere.nc")
    Traceback (most recent call last):
        ...
    uqmbd.errors.StudyError: The result 'nowhere.nc' does not exist.
    """
    return load_with(Path(path), _read)


def _read(tree: xr.DataTree, source: Path) -> xr.DataTree:
    with tree:
        check_memory(sum(node.dataset.nbytes for node in tree.subtree), source)
        return tree.load()


@typechecked
def read_root(path: str | os.PathLike[str]) -> xr.Dataset:
    """Read the variables in the root group of any netCDF file, such as measurements, into memory.

    The function checks the file as :func:`load` does, but ignores groups and schema versions.

    Parameters
    ----------
    path : path-like
        Path of a netCDF file (``.nc``, ``.nc4``).

    Returns
    -------
    xarray.Dataset
        Variables; times remain numbers for any unit. ``encoding["digest"]`` has the same values as for :func:`load`.

    Raises
    ------
    StudyError
        If the file does not exist, is not a regular file or is damaged. If the file declares more numbers than the
        file or the memory can hold.

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
        raise StudyError(
            f"The path of the dataset is {str(source)!r}; expected a path that ends in .nc or .nc4 (netCDF)."
        )

    def variables(tree: xr.DataTree) -> xr.DataTree:
        found = _read(tree, source).to_dataset()
        drop_own(found.attrs)
        return xr.DataTree(decode(found, source))

    return _gated(source, variables, "netCDF file", whole=True, below=False).to_dataset()


def load_with(source: Path, read: Callable[[xr.DataTree, Path], xr.DataTree]) -> xr.DataTree:
    """Open a result, without executing content of its file, and read it with the function `read`.

    Large chunks are compared with their digests only if `read` is `_read`, which reads all data.
    """
    suffix = source.suffix.lower()
    if suffix not in (*_NETCDF, ".zarr"):
        raise StudyError(
            f"The path of the result is {str(source)!r}; expected a path that ends in .nc (netCDF) or .zarr (Zarr)."
        )
    if (source / "response" / ".zarray").is_file():
        raise StudyError(
            f"{str(source)!r} contains samples of a method, not a result. Use uqmbd.results.open for the result in "
            "the same folder (results.nc), or uqmbd.results.SampleStore.open for the samples."
        )

    def result(tree: xr.DataTree) -> xr.DataTree:
        tree = read(tree, source)
        check_version(tree.attrs, str(source))
        drop_own(tree.attrs)
        return decode_tree(tree, source, ordered=suffix != ".zarr")

    found = _gated(source, result, "result", whole=read is _read)
    warn_of_absent_models(found, str(source))
    return found


def _gated(
    source: Path, decode: Callable[[xr.DataTree], xr.DataTree], kind: str, *, whole: bool, below: bool = True
) -> xr.DataTree:
    """Check and open a file or a folder, and convert its tree by `decode`.

    `kind`: name of the content, for messages; `whole`: whether large chunks are compared with their digests; `below`:
    whether to read groups below the root.
    """
    if not source.exists():
        raise StudyError(f"The {kind} {str(source)!r} does not exist.")
    tree, verified = None, False
    try:
        if source.suffix.lower() == ".zarr":
            check_folder(source)
            # the specification of Zarr format 3 has no consolidated metadata
            old = (source / ".zmetadata").is_file() and not (source / "zarr.json").is_file()
            require_package("zarr", f"{source}, a Zarr folder,", "uqmbd[samples]")
            tree = xr.open_datatree(source, engine="zarr", consolidated=old, chunks=None, cache=False, **PLAIN)
        else:
            verified = _verified(source, whole=whole)
            tree = opened_netcdf(source, below=below)
        close = tree.close
        found = decode(tree)
    # xarray, h5py and zarr raise exceptions of any type for files of other programs
    except Exception as error:
        if tree is not None:
            tree.close()
        if isinstance(error, StudyError):
            raise
        reason = " ".join(str(error).split())[:300] or type(error).__name__
        raise StudyError(
            f"{str(source)!r} cannot be read as a {kind}; it is damaged, or is not a {kind}: {reason}"
        ) from error
    found.set_close(close)
    found.encoding = {"source": str(source), "digest": "verified" if verified else "not verified"}
    if not verified:
        results.info("%s is not verified: it has no digest of uqmbd", source)
    return found


def _verified(source: Path, *, whole: bool) -> bool:
    """Return whether the digest or the manifest shows that a file is unchanged; refuse damaged files."""
    with regular(source) as file:
        if check_digest(file, whole=whole):
            return True
    if source.name not in in_manifest(source.parent) or not whole:
        return False
    if is_ours(source.parent, source.name):
        return True
    raise StudyError(
        f"{str(source)!r} has no digest, and it differs from the file that the manifest of the folder describes. The "
        "file is damaged, or another program changed it. If the change is intended, rename the file; uqmbd then "
        "reads it without verification."
    )


def not_verified(tree: xr.DataTree) -> bool:
    """Return whether a result was read from a file or a folder whose content was not verified by a digest."""
    return bool(tree.encoding.get("digest") == "not verified")


@contextmanager
def errors_of_files(*trees: xr.DataTree) -> Iterator[None]:
    """Convert unexpected exceptions to StudyError with the name of the result file and its violation of the schema.

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
            f"{files}: the data cannot be used: {type(error).__name__}: {error}. Another program may have changed "
            "them. If not, this is an error in uqmbd, or in the plugin that computed them."
        ) from error


def _write(tree: xr.DataTree, path: Path) -> None:
    """Write a tree with a digest. Chunks of compressed variables have separate digests, which `load` compares."""
    light = {"zlib": True, "complevel": 1, "shuffle": True}
    large: list[str] = []
    with netcdf_file(path) as made:
        for node in tree.subtree:
            group = made.file if node is tree else made.file.create_group(node.relative_to(tree))
            variables: dict[Any, xr.Variable] = {}
            encoding: dict[Any, dict[str, Any]] = {}
            dataset = node.to_dataset(inherit=False).compute()  # loads lazy data
            for name, given in dataset.variables.items():
                if not given.shape or not given.size or given.dtype.kind == "S":
                    continue  # HDF5 has no checksums for scalars, empty variables and bytes
                variable, letters = _characters(given) if given.dtype.kind == "U" else (given, {})
                variables[name] = variable
                encoding[name] = {"fletcher32": True, "chunksizes": (*chunks_of(variable), *letters.values())}
                if letters:
                    encoding[name]["char_dim_name"] = next(iter(letters))
                    # h5netcdf cannot write a two-dimensional coordinate with a dimension of a parent group
                    own = letters | ({name: given.size} if name in given.dims else {})
                    for dim in own.keys() - set(group.dimensions):
                        group.dimensions[dim] = own[dim]
                if variable.nbytes >= 8 * _COMPRESS_FROM:
                    encoding[name] |= light
                    large.append(f"{node.path.rstrip('/')}/{name}")
            coords = {name: variables.pop(name) for name in dataset.coords if name in variables}
            dataset = dataset.assign(variables).assign_coords(coords)
            dataset.dump_to_store(xr.backends.H5NetCDFStore(group), encoding=encoding)
            made.check()
        spans = made.chunks(large)
    # exclude the checksum of HDF5 at the end of each chunk
    add_digest(path, [(begin, count - CHECKSUM) for begin, count in spans])


def _characters(variable: xr.Variable) -> tuple[xr.Variable, dict[str, int]]:
    """Convert text to characters and return their dimension: HDF5 has no checksums for variable-length text."""
    try:
        values = np.char.encode(variable.values, "utf-8")
    except UnicodeEncodeError as error:
        raise StudyError(
            f"The string {error.object!r:.100} cannot be stored as UTF-8; expected complete characters."
        ) from None
    # round the width up to a power of two, because each width needs a dimension in the file
    width = 1 << max(3, (values.dtype.itemsize - 1).bit_length())
    attrs = {**variable.attrs, "_Encoding": "utf-8"}
    return xr.Variable(variable.dims, values.astype(f"S{width}"), attrs), {f"_uqmbd_characters_{width}": width}
