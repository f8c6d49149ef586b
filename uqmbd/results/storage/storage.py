"""Results on disk: netCDF (``.nc``) and Zarr (``.zarr``), written at once or not at all, read back as they were."""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path
from typing import Any, Literal

import numpy as np
import xarray as xr
from numpy.typing import NDArray
from xarray.backends import H5NetCDFStore

from uqmbd.errors import StudyError
from uqmbd.files import replacing
from uqmbd.results.schema import SCHEMA_VERSION, check_version
from uqmbd.results.storage.chunks import chunks_of
from uqmbd.results.storage.hdf5 import netcdf_file
from uqmbd.results.storage.manifest import has_manifest, record
from uqmbd.results.storage.unfinished import how_to_go_on, saved, unsaved
from uqmbd.results.storage.zarr_check import check_codecs

__all__ = ["load", "load_with", "save"]

_JSON_ATTRIBUTES = "uqmbd_json_attributes"
_CHILDREN = "uqmbd_children"
_VERSION = "schema_version"
_VERSION_ADDED = "uqmbd_schema_version_added"
_INT64 = np.iinfo(np.int64)
_COMPRESS_FROM = 10_000  # numbers; below, compression costs more than it saves


def save(tree: xr.DataTree, path: str | os.PathLike[str], *, zarr_format: Literal[2, 3] | None = None) -> Path:
    """Write a result to a netCDF file or a Zarr folder, with the version of its schema.

    It is written beside the target and then takes its place, so that a reader never meets half a result and an
    interrupted run leaves the old one as it was.  What `Study.run` keeps beside the target, to go on with, is removed
    when its results are there.

    Parameters
    ----------
    tree : xarray.DataTree
        A result; any tree of numbers and text will do.
    path : path-like
        Ends in ``.nc`` or ``.zarr``; folders on the way are made.
    zarr_format : {2, 3}, optional
        Of a Zarr folder; by default 2, which readers of both generations know.

    Returns
    -------
    pathlib.Path
        The path.

    Raises
    ------
    StudyError
        If the ending is another one, an attribute cannot be stored, the folder cannot be written, Zarr is missing, or
        `zarr_format` is neither 2 nor 3, or is given for netCDF.

    Examples
    --------
    >>> import tempfile, xarray
    >>> tree = xarray.DataTree(xarray.Dataset({"x": ("sample", [1.0, 2.0])}, attrs={"study": "crank"}))
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     load(save(tree, folder + "/results.nc")).identical(tree)
    True
    """
    target = Path(path)
    writer = _writer(target, zarr_format)
    encoded = _encode_tree(tree)
    try:
        target.parent.mkdir(parents=True, exist_ok=True)
        with replacing(target) as written:
            writer(encoded, written)
            if has_manifest(target.parent):
                record(target.parent, [target.name], [written])
    except OSError as error:
        unsaved(target.parent, tree.attrs)
        remedy = how_to_go_on(target.parent)
        raise StudyError(
            f"The result cannot be written to {str(target)!r}: {error.strerror or error}.{remedy}"
        ) from error
    saved(target.parent, tree.attrs)
    return target


def load(path: str | os.PathLike[str]) -> xr.DataTree:
    """Read a result into memory and close its file.

    Nothing that is read is executed: a Zarr folder with codecs that :func:`save` does not write is refused, and netCDF
    holds no code.

    Parameters
    ----------
    path : path-like
        A netCDF file (``.nc``), or a Zarr folder (``.zarr``) of format 2 or 3, written by :func:`save` or by
        `to_zarr` of the result.

    Returns
    -------
    xarray.DataTree
        As it was saved.

    Raises
    ------
    StudyError
        If it does not exist, has another ending, is damaged, has codecs of its own or a later schema,
        or Zarr is missing.

    Examples
    --------
    >>> load("nowhere.nc")
    Traceback (most recent call last):
        ...
    uqmbd.errors.StudyError: There is no result at 'nowhere.nc'.
    """
    return load_with(Path(path), _read)


def _read(source: Path, options: Mapping[str, Any]) -> xr.DataTree:
    with xr.open_datatree(source, **options) as opened:
        return opened.load()


def load_with(source: Path, read: Callable[[Path, Mapping[str, Any]], xr.DataTree]) -> xr.DataTree:
    """Read a result, of which nothing is executed, by a function of its path and the options of xarray's opening."""
    _writer(source)
    if not source.exists():
        raise StudyError(f"There is no result at {str(source)!r}.")
    if (source / "response" / ".zarray").is_file():
        raise StudyError(
            f"{str(source)!r} holds samples of a method, and is no result: uqmbd.results.open reads the result beside "
            "it (results.nc), with all samples, and uqmbd.results.SampleStore.open the samples alone."
        )
    options: dict[str, Any] = {"engine": "h5netcdf" if source.suffix == ".nc" else "zarr", "decode_timedelta": False}
    try:
        if source.suffix == ".zarr":
            check_codecs(source)
            # the specification of format 3 has no consolidated metadata
            old = (source / ".zmetadata").is_file() and not (source / "zarr.json").is_file()
            options["consolidated"] = old
        tree = read(source, options)
    except StudyError:
        raise
    except (OSError, LookupError, TypeError, ValueError, RuntimeError) as error:
        raise StudyError(f"{str(source)!r} cannot be read as a result; it is damaged or no result: {error}") from error
    check_version(tree.attrs, str(source))
    if tree.attrs.pop(_VERSION_ADDED, None) and tree.attrs[_VERSION] == SCHEMA_VERSION:
        # of an earlier version it stays, and says what the result need not have
        del tree.attrs[_VERSION]
    found = _decode_tree(tree, ordered=source.suffix == ".nc")
    found.set_close(tree.close)
    return found


def _writer(path: Path, zarr_format: object = None) -> Callable[[xr.DataTree, Path], None]:
    if zarr_format is not None and (path.suffix != ".zarr" or zarr_format not in (2, 3)):
        raise StudyError(
            f"zarr_format is {zarr_format!r} for {str(path)!r}; expected 2 or 3, for a path that ends in .zarr."
        )
    if path.suffix == ".nc":
        return _write_netcdf
    if path.suffix != ".zarr":
        raise StudyError(f"A result is stored as .nc (netCDF) or .zarr (Zarr); {str(path)!r} ends in neither.")
    from uqmbd.results.storage.zarr_writer import write_zarr

    return partial(write_zarr, zarr_format=3) if zarr_format == 3 else write_zarr


def _write_netcdf(tree: xr.DataTree, path: Path) -> None:
    light = {"zlib": True, "complevel": 1, "shuffle": True}
    with netcdf_file(path) as made:
        for node in tree.subtree:
            dataset = node.to_dataset(inherit=False)
            large = [n for n, v in dataset.data_vars.items() if v.dtype.kind == "f" and v.size >= _COMPRESS_FROM]
            group = made.file if node is tree else made.file.create_group(node.relative_to(tree))
            dataset.dump_to_store(
                H5NetCDFStore(group),
                encoding={n: {**light, "chunksizes": chunks_of(dataset.variables[n])} for n in large},
            )
            made.check()


def _encode_tree(tree: xr.DataTree) -> xr.DataTree:
    datasets = {}
    for node in tree.subtree:
        dataset = _encode(node.to_dataset(inherit=False))
        # Zarr lists its groups by the alphabet; methods are shown in the order of the study.
        order = {_CHILDREN: json.dumps(list(node.children))} if len(node.children) > 1 else {}
        datasets[node.relative_to(tree)] = dataset.assign_attrs(order)
    root = datasets["."]
    if _VERSION not in root.attrs:
        datasets["."] = root.assign_attrs({_VERSION: SCHEMA_VERSION, _VERSION_ADDED: 1})
    return xr.DataTree.from_dict(datasets, name=tree.name)


def _decode_tree(tree: xr.DataTree, *, ordered: bool) -> xr.DataTree:
    """Return a tree as it was; where groups come in no order (`ordered`), those whose order is not stored by name."""
    dataset = tree.to_dataset(inherit=False)
    order = json.loads(dataset.attrs.pop(_CHILDREN, "[]"))
    names = tree.children if ordered else sorted(tree.children)
    names = sorted(names, key=lambda name: order.index(name) if name in order else len(order))
    children = {name: _decode_tree(tree.children[name], ordered=ordered) for name in names}
    return xr.DataTree(_decode(dataset), children=children)


def _encode(dataset: xr.Dataset) -> xr.Dataset:
    """Turn text to fixed width, and attributes that netCDF does not know to JSON."""
    variables = {}
    for name, variable in dataset.variables.items():
        data = variable
        if variable.dtype.kind in "OT":
            values = variable.values
            if not all(isinstance(v, str) for v in values.ravel()):
                raise StudyError(f"Variable {name!r} holds Python objects; only numbers and text can be stored.")
            data = variable.copy(data=_text(values))
        variables[name] = xr.Variable(data.dims, data.data, _encode_attributes(variable.attrs, str(name)))
    coords = {name: variables.pop(name) for name in dataset.coords}
    return xr.Dataset(variables, coords=coords, attrs=_encode_attributes(dataset.attrs, "the dataset"))


def _encode_attributes(attrs: Mapping[Any, Any], owner: str) -> dict[str, Any]:
    encoded: dict[str, Any] = {}
    packed = []
    for name, value in attrs.items():
        plain = value.item() if isinstance(value, np.generic) else value
        if _is_native(plain):
            encoded[str(name)] = plain
            continue
        try:
            encoded[str(name)] = json.dumps(plain.tolist() if isinstance(plain, np.ndarray) else plain)
        except TypeError as error:
            kind = type(value).__name__
            raise StudyError(f"Attribute {name!r} of {owner} is a {kind}; only numbers, text and JSON fit.") from error
        packed.append(str(name))
    if packed:
        encoded[_JSON_ATTRIBUTES] = json.dumps(packed)
    return encoded


def _is_native(value: object) -> bool:
    if isinstance(value, bool):
        return False
    if isinstance(value, int):
        return bool(_INT64.min <= value <= _INT64.max)
    if isinstance(value, np.ndarray):
        # Zarr writes arrays as lists, and a list of one comes back from netCDF as a number: JSON keeps both.
        return value.ndim == 1 and value.size > 1 and value.dtype.kind in "if"
    return isinstance(value, (str, float))


def _decode(dataset: xr.Dataset) -> xr.Dataset:
    variables = {}
    for name, variable in dataset.variables.items():
        # An empty or optimised text type of the reader becomes the fixed width that was written.
        values = _text(variable.values) if variable.dtype.kind in "OT" else variable.data
        variables[name] = xr.Variable(variable.dims, values, _decode_attributes(variable.attrs))
    coords = {name: variables.pop(name) for name in dataset.coords}
    return xr.Dataset(variables, coords=coords, attrs=_decode_attributes(dataset.attrs))


def _decode_attributes(attrs: Mapping[Any, Any]) -> dict[str, Any]:
    packed = json.loads(attrs.get(_JSON_ATTRIBUTES, "[]"))
    decoded: dict[str, Any] = {}
    for name, value in attrs.items():
        if name == _JSON_ATTRIBUTES:
            continue
        if name in packed:
            decoded[name] = json.loads(value)
        elif isinstance(value, np.generic):
            decoded[name] = value.item()
        else:
            decoded[name] = _array(value) if isinstance(value, list) else value
    return decoded


def _array(values: list[Any]) -> Any:
    """Return the array that Zarr wrote as a list, which is of numbers; other lists are what was given to xarray."""
    try:
        found = np.array(values)
    except ValueError:  # ragged
        return values
    return found if found.dtype.kind in "iuf" else values


def _text(values: NDArray[Any]) -> NDArray[np.str_]:
    """Return text as text of fixed width; NumPy turns its own text of any width to it by way of objects only."""
    return values.astype(object).astype(np.str_)
