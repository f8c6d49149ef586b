"""Values of a surrogate as a labelled array."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import xarray as xr

from uqmbd.results.chaos.labelled.points import Points
from uqmbd.results.schema import Labels, units_of
from uqmbd.typing import Array

__all__ = ["DERIVATIVE", "VALUE", "labelled_array"]

VALUE: Mapping[str, str] = {"name": "response", "long_name": "response"}
DERIVATIVE: Mapping[str, str] = {"name": "gradient", "long_name": "derivative with respect to the input"}


def labelled_array(values: Array, points: Points, labels: Labels, about: Mapping[str, str]) -> xr.DataArray:
    """Give values the dimensions of the points, and those of the outputs.

    Parameters
    ----------
    values : array, shape (K, O, T), or (K, d, O, T) of derivatives
    points : Points
    labels : Labels
    about : mapping
        `VALUE` or `DERIVATIVE`: what they are.

    Returns
    -------
    xarray.DataArray
        With ``units`` where they are one.

    Examples
    --------
    >>> import numpy as np
    >>> from uqmbd.extend import labels
    >>> from uqmbd.results.chaos.labelled.points import points_of
    >>> axes = labels([("x", "m")], [("k", "N/m")], [0.0, 0.5])
    >>> found = labelled_array(np.zeros((3, 1, 2)), points_of(None, {"k": [1, 2, 3]}, axes.inputs), axes, VALUE)
    >>> found.dims, found.attrs["units"], found["k"].values.tolist()
    (('point', 'output', 'time'), 'm', [1.0, 2.0, 3.0])
    """
    shape = (*points.sizes.values(), *values.shape[1:])
    between = ("input",) * (values.ndim - 1 - len(labels.dims))
    coords: dict[str, Any] = {**points.coords, **labels.output_coords(), **(labels.input_coords() if between else {})}
    dims = (*points.sizes, *between, *labels.dims)
    found = xr.DataArray(values.reshape(shape), coords, dims, about["name"], {"long_name": about["long_name"]})
    if units := units_of(found):
        found.attrs["units"] = units
    return found
