"""Open results as Dask arrays, which are read on use; the separate store provides samples beyond `keep`."""

from __future__ import annotations

import os
import warnings
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from uqmbd.arguments import typechecked
from uqmbd.errors import StudyError, StudyWarning
from uqmbd.packages import require_package
from uqmbd.results.schema import fixed_width
from uqmbd.results.storage.reading import NUMBERS
from uqmbd.results.storage.sample_store import KINDS, SampleStore
from uqmbd.results.storage.storage import load_with

__all__ = ["open"]

AT_ONCE = 1 << 25
"""Approximate number of bytes of a variable that Dask reads at once."""

COMPARED = 64
"""Number of samples of the store that are compared with the samples in the result."""


@typechecked
def open(path: str | os.PathLike[str]) -> xr.DataTree:
    """Open a result without reading its arrays; Dask arrays read the data on use.

    If a method has more samples than `keep`, its node ``samples`` has all of them, from the store next to the result.
    Like :func:`uqmbd.results.load`, the function executes no content of the file.

    Parameters
    ----------
    path : path-like
        Path of a netCDF file (``.nc``) or a Zarr folder (``.zarr``), as for :func:`uqmbd.results.load`.

    Returns
    -------
    xarray.DataTree
        Result; its file stays open until `close` of the tree is called or the tree is deleted.

    Raises
    ------
    StudyError
        In the cases of :func:`uqmbd.results.load`. If the samples are damaged or have other codecs, or if Dask is not
        installed.

    Warns
    -----
    uqmbd.StudyWarning
        If the store of samples of a method is not next to the result, or belongs to another run. The node then has the
        samples that are in the result.

    Examples
    --------
    >>> import tempfile, uqmbd.results
    >>> tree = xr.DataTree.from_dict({"a/statistics": xr.Dataset({"mean": ("time", np.arange(4.0))})})
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     path = uqmbd.results.save(tree, folder + "/results.nc")
    ...     with uqmbd.results.open(path) as found:
    ...         mean = found["a/statistics"]["mean"]
    ...         print(type(mean.data).__module__, float(mean.sum()))
    dask.array.core 6.0
    """
    require_package("dask.array", "uqmbd.results.open (unlike uqmbd.results.load)", "uqmbd[distributed]")
    source = Path(path)
    tree = load_with(source, _unread)
    for node in [node for node in tree.subtree if "all_samples" in node.attrs]:
        found = _all_samples(source.parent, str(node.attrs["all_samples"]), node)
        if found is not None:
            node["samples"] = xr.DataTree(found)
    return tree


def _unread(tree: xr.DataTree, source: Path) -> xr.DataTree:
    """Return a tree of Dask arrays, which are read on use; coordinates are read at once."""
    sets = {node.path: _as_dask(node.to_dataset(inherit=False), source, node.path) for node in tree.subtree}
    # make a new tree: an opened tree loses its `close` if a dataset in it is replaced
    made = xr.DataTree.from_dict(sets)
    made.set_close(tree.close)
    return made


def _as_dask(data: xr.Dataset, source: Path, path: str) -> xr.Dataset:
    """Return a dataset with Dask arrays for its numbers; coordinates are read at once."""
    import dask.array as da
    from dask.base import tokenize

    made = {}
    for name, variable in data.variables.items():
        if name in data.coords or variable.dtype.kind not in NUMBERS:
            continue
        given = variable.encoding.get("preferred_chunks", {})
        token = tokenize(str(source.resolve()), source.stat().st_mtime_ns, path, name)
        array: Any = da.from_array(
            _Unread(variable, f"{str(source)!r}: {path}/{name}"),
            chunks=tuple(given.get(dim, -1) for dim in variable.dims),
            name=f"{name}-{token}",
            asarray=False,
            fancy=False,
            meta=np.empty((0,) * variable.ndim, dtype=variable.dtype),
        )
        made[name] = xr.Variable(variable.dims, array, variable.attrs, variable.encoding)
    return data.assign(made).assign_coords({name: data[name].load() for name in data.coords})


class _Unread:
    """Variable of a file that is read in parts; errors name the file and the variable."""

    def __init__(self, variable: xr.Variable, where: str) -> None:
        self.variable, self.where = variable, where
        self.shape, self.dtype, self.ndim = variable.shape, variable.dtype, variable.ndim

    def __getitem__(self, key: Any) -> NDArray[Any]:
        try:
            found: NDArray[Any] = self.variable[key].values
        except Exception as error:
            raise StudyError(
                f"{self.where} cannot be read: {error}. The file may be damaged, closed or unreachable."
            ) from error
        return found


def _all_samples(folder: Path, name: str, node: xr.DataTree) -> xr.Dataset | None:
    """Open all samples of a method from its store; None if the store is missing or belongs to another run."""
    place = folder / name
    if Path(name).name != name or name in ("", ".", ".."):
        raise StudyError(f"{node.path}: all_samples is {name!r}; expected the name of a store next to the result.")
    if not place.exists():
        warnings.warn(
            f"{node.path}: the sample store {name} is not in the folder of the result, so only the samples in the "
            "result are used. Move the store to this folder. If it no longer exists, uqmbd.results.load reads the "
            "samples in the result without this warning.",
            StudyWarning,
            stacklevel=3,
        )
        return None
    first = node.children["samples"].to_dataset(inherit=False) if "samples" in node.children else xr.Dataset()
    if place.suffix == ".nc":  # written by uqmbd 0.1
        data = load_with(place, _unread).to_dataset()
    else:
        data = _stored(SampleStore.open(place.resolve()))
    data = data.drop_attrs(deep=False)
    if "time" not in first.dims and data.sizes.get("time") == 1:
        data = data.isel(time=0, drop=True)
    texts = {
        str(key): (data[key].dims, fixed_width(data[key].values), data[key].attrs)
        for key in data.coords
        if data[key].dtype.kind in "OT"
    }
    data = data.assign_coords(texts)
    try:
        same = node.attrs.get("all_samples_count", data.sizes["sample"]) == data.sizes["sample"]
        same = same and _begins_with(data, first)
    except (OSError, ValueError, RuntimeError) as error:
        raise StudyError(f"The sample store {str(place)!r} is damaged: {error}") from error
    if not same:
        warnings.warn(
            f"{node.path}: the sample store {name} in the folder of the result belongs to another run, "
            "so only the samples in the result are used. Replace it by the store of the run that wrote the result, and "
            "write each run to a separate folder.",
            StudyWarning,
            stacklevel=3,
        )
        return None
    for key in set(data.variables) & set(first.variables):
        data[key].attrs = first[key].attrs
    return data.assign_attrs(first.attrs)


def _stored(store: SampleStore) -> xr.Dataset:
    """Return a store as a dataset of Dask arrays.

    `SampleStore` reads the chunks instead of Zarr, which does not name the file of a damaged chunk, and reads a missing
    chunk as NaN.
    """
    import dask.array as da
    from dask.base import tokenize

    with xr.open_zarr(store.folder, chunks=None, consolidated=True) as found:
        data: xr.Dataset = found.coords.to_dataset().load()
    row = max(np.dtype(kind).itemsize * int(np.prod(store.shapes(name)[0][1:])) for name, kind in KINDS.items())
    # a Dask block consists of whole chunks of all variables, or, for long responses, of whole chunks of responses only
    rows = AT_ONCE // row
    whole = store.block if rows >= store.block else store.size
    rows = max(1, rows // whole) * whole
    samples = tuple(min(rows, store.count - first) for first in range(0, store.count, rows))
    token = tokenize(str(store.folder), store.folder.stat().st_mtime_ns)
    for name, kind in KINDS.items():
        shape, _ = store.shapes(name)
        array: Any = da.map_blocks(
            partial(_rows, store, name),
            name=f"{name}-{token}",
            chunks=(samples, *((n,) for n in shape[1:])),
            dtype=kind,
            meta=np.empty((0,) * len(shape), dtype=kind),
        )
        data[name] = store.dims(name), array
    return data


def _rows(store: SampleStore, name: str, block_info: Any = None) -> NDArray[Any]:
    """Read the values of a variable in a Dask block."""
    (first, last), *_ = block_info[None]["array-location"]
    _, (size, *_) = store.shapes(name)
    return np.concatenate([store.read(name, k, min(k + size - k % size, last)) for k in _starts(first, last, size)])


def _starts(first: int, last: int, size: int) -> list[int]:
    """Split samples `first` to `last` (excluded) at the chunks of `size` samples; return the first index of each part.

    >>> _starts(6, 13, 4)
    [6, 8, 12]
    """
    return [first, *range(first - first % size + size, last, size)]


def _begins_with(data: xr.Dataset, first: xr.Dataset) -> bool:
    """Return whether the store `data` begins with the samples `first` in the result, bit by bit."""
    count = min(first.sizes.get("sample", 0), COMPARED)
    for name in ("inputs", "response"):
        if name in first:
            found, expected = (one[name].isel(sample=slice(count)) for one in (data, first))
            if found.dims != expected.dims or not np.array_equal(found.values, expected.values, equal_nan=True):
                return False
    return True
