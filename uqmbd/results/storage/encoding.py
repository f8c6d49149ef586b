"""Convert trees to and from their stored form: fixed-width text, other attributes as JSON, and the schema version."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from uqmbd.errors import StudyError
from uqmbd.results.schema import SCHEMA_VERSION
from uqmbd.results.storage.digest import MARK
from uqmbd.results.storage.reading import check_text

__all__ = ["decode", "decode_tree", "drop_own", "encode_tree"]

_JSON_ATTRIBUTES = "uqmbd_json_attributes"
_CHILDREN = "uqmbd_children"
_VERSION = "schema_version"
_VERSION_ADDED = "uqmbd_schema_version_added"
_INT64 = np.iinfo(np.int64)


def encode_tree(tree: xr.DataTree) -> xr.DataTree:
    """Return a tree in its stored form, with the schema version and the mark of a digest."""
    datasets = {}
    for node in tree.subtree:
        dataset = _encode(node.to_dataset(inherit=False))
        # store the order of the groups: reports show methods in the order of the study, but Zarr sorts groups by name
        order = {_CHILDREN: json.dumps(list(node.children))} if len(node.children) > 1 else {}
        datasets[node.relative_to(tree)] = dataset.assign_attrs(order)
    root = datasets["."]
    version = {} if _VERSION in root.attrs else {_VERSION: SCHEMA_VERSION, _VERSION_ADDED: 1}
    datasets["."] = root.assign_attrs({**version, MARK: 1})
    return xr.DataTree.from_dict(datasets, name=tree.name)


def decode_tree(tree: xr.DataTree, source: Path, *, ordered: bool) -> xr.DataTree:
    """Return the original tree; unless `ordered`, groups without a stored order are sorted by name."""
    dataset = tree.to_dataset(inherit=False)
    order = json.loads(dataset.attrs.pop(_CHILDREN, "[]"))
    names = tree.children if ordered else sorted(tree.children)
    names = sorted(names, key=lambda name: order.index(name) if name in order else len(order))
    children = {name: decode_tree(tree.children[name], source, ordered=ordered) for name in names}
    return xr.DataTree(decode(dataset, source), children=children)


def drop_own(attrs: dict[Any, Any]) -> None:
    """Remove the attributes of the root that `save` added."""
    if attrs.pop(_VERSION_ADDED, None) and attrs.get(_VERSION) == SCHEMA_VERSION:
        # a schema version that `save` did not add remains: results of an earlier version may lack variables
        del attrs[_VERSION]
    attrs.pop(MARK, None)


def _encode(dataset: xr.Dataset) -> xr.Dataset:
    """Convert text to fixed width, and attributes of types that netCDF does not support to JSON."""
    variables = {}
    for name, variable in dataset.variables.items():
        data = variable
        if variable.dtype.kind in "mM":
            raise StudyError(f"Variable {name!r} contains dates or durations; only numbers and text can be stored.")
        if variable.dtype.kind in "OT":
            values = variable.values
            if not all(isinstance(v, str) for v in values.ravel()):
                raise StudyError(f"Variable {name!r} contains Python objects; only numbers and text can be stored.")
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
            raise StudyError(
                f"Attribute {name!r} of {owner} is a {kind}; only numbers, text and JSON can be stored."
            ) from error
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
        # Zarr writes arrays as lists, and netCDF reads a list of one number as a number; JSON preserves both
        return value.ndim == 1 and value.size > 1 and value.dtype.kind in "if"
    return isinstance(value, (str, float))


def decode(dataset: xr.Dataset, source: Path) -> xr.Dataset:
    """Convert the content of a file to the original dataset."""
    variables = {}
    for name, variable in dataset.variables.items():
        # readers return fixed-width text as text of variable length, or as empty text
        values = _fixed(variable.values, str(name), source) if variable.dtype.kind in "OTU" else variable.data
        variables[name] = xr.Variable(variable.dims, values, _decode_attributes(variable.attrs))
    coords = {name: variables.pop(name) for name in dataset.coords}
    return xr.Dataset(variables, coords=coords, attrs=_decode_attributes(dataset.attrs))


def _fixed(values: NDArray[Any], name: str, source: Path) -> NDArray[np.str_]:
    """Convert text from a file to fixed width (four bytes for each character) after a check of its size."""
    if values.dtype.kind == "U":
        return values
    texts = values.ravel().tolist()
    if not all(isinstance(text, str) for text in texts):
        raise ValueError(f"variable {name!r} contains objects; expected numbers or text")
    check_text(len(texts) * max(map(len, texts), default=0), source)
    return _text(values)


def _decode_attributes(attrs: Mapping[Any, Any]) -> dict[str, Any]:
    packed = json.loads(attrs.get(_JSON_ATTRIBUTES, "[]"))
    decoded: dict[str, Any] = {}
    for name, value in attrs.items():
        if name in (_JSON_ATTRIBUTES, _CHILDREN):
            continue
        if name in packed:
            decoded[name] = json.loads(value)
        elif isinstance(value, np.generic):
            decoded[name] = value.item()
        else:
            decoded[name] = _array(value) if isinstance(value, list) else value
    return decoded


def _array(values: list[Any]) -> Any:
    """Convert a list of numbers to an array, because Zarr writes arrays as lists; return other lists unchanged."""
    try:
        found = np.array(values)
    except ValueError:  # ragged
        return values
    return found if found.dtype.kind in "iuf" else values


def _text(values: NDArray[Any]) -> NDArray[np.str_]:
    """Convert text to fixed width; NumPy converts variable-width text only via objects."""
    return values.astype(object).astype(np.str_)
