"""Results as Zarr folders, as earlier versions of uqmbd wrote them."""

from __future__ import annotations

from pathlib import Path
from typing import Literal

import pytest
import xarray as xr

from uqmbd.results import save
from uqmbd.results.storage.encoding import encode_tree

__all__ = ["stored", "stored_as_zarr"]


def stored(tree: xr.DataTree, path: Path) -> Path:
    """Write a result as the ending of the path says."""
    return stored_as_zarr(tree, path) if path.suffix == ".zarr" else save(tree, path)


def stored_as_zarr(tree: xr.DataTree, path: Path, zarr_format: Literal[2, 3] = 2) -> Path:
    """Write a result to a Zarr folder, with what netCDF does not know as JSON, and the order of the methods."""
    pytest.importorskip("zarr")
    encoded = encode_tree(tree)
    # the specification of format 3 has no text of fixed width and no consolidated metadata
    texts = {
        node.path: {
            str(name): {"dtype": "O"}
            for name, variable in node.to_dataset(inherit=False).variables.items()
            if variable.dtype.kind == "U" and zarr_format == 3
        }
        for node in encoded.subtree
    }
    encoded.to_zarr(path, zarr_format=zarr_format, encoding=texts, consolidated=zarr_format == 2, mode="w")
    return path
