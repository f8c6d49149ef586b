"""Convert values and statistics of a surrogate to labelled data."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import xarray as xr

from uqmbd.results.chaos.labelled.points import Points
from uqmbd.results.schema import Labels, fixed_width, statistics_dataset, united, units_of
from uqmbd.typing import Array

__all__ = ["DERIVATIVE", "VALUE", "labelled_array", "surrogate_statistics"]

VALUE: Mapping[str, str] = {"name": "response", "long_name": "response"}
DERIVATIVE: Mapping[str, str] = {"name": "gradient", "long_name": "derivative with respect to the input"}


def labelled_array(values: Array, points: Points, labels: Labels, about: Mapping[str, str]) -> xr.DataArray:
    """Label values with the dimensions of the points and of the outputs.

    `values` (K, O, T); `about`: name of the quantity, `VALUE` or `DERIVATIVE`. The result has the attribute ``units``
    if all values have the same unit.

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


def surrogate_statistics(
    labels: Labels,
    values: Mapping[str, Any],
    *,
    shape_samples: int,
    samples: int,
    requested: int,
    terms: int,
    of_germs: tuple[Sequence[str], Array, Array] | None,
    stated: tuple[Array, Array] | None,
) -> xr.Dataset:
    """Build the dataset of statistics, with attributes for statistics from samples."""
    # `shape_samples`: number of samples for skewness and kurtosis, 0 if exact; `samples`: number of samples for
    # quantiles, less than `requested` if there are many `terms`; `of_germs`: names, first-order and total indices of
    # the germs, for dependent inputs; `stated`: stated error (O, T) and its uncertainty factor
    found = statistics_dataset(labels, **values)
    if shape_samples:
        for name in ("skewness", "kurtosis"):
            found[name].attrs |= {
                "samples": shape_samples,
                "comment": f"{found[name].attrs['comment']}; estimated from {shape_samples} samples of the surrogate",
            }
    if samples < requested:
        found["quantile"].attrs |= {
            "samples": samples,
            "comment": f"estimated from {samples} samples of the surrogate; its {terms} terms limit this number",
        }
    if of_germs is not None:
        names, first, total = of_germs
        note = {"comment": "index of a germ: the inputs are dependent, so shares cannot be attributed to inputs"}
        dims = ("germ", *labels.dims)
        found = found.assign(
            sobol_first_germ=(dims, first, {"long_name": "first-order Sobol' index"} | note),
            sobol_total_germ=(dims, total, {"long_name": "total Sobol' index"} | note),
        ).assign_coords(germ=("germ", fixed_width(names)))
    if stated is not None:
        note = {"long_name": "stated error of the surrogate, divided by the standard deviation"}
        about = {
            "long_name": "factor by which the stated error may be wrong",
            "comment": "from two standard errors of the mean squared error; if the factor exceeds 2, raise verify",
        }
        found = found.assign(
            verification_error=(labels.dims, stated[0], note),
            verification_factor=(labels.dims, stated[1], about),
        )
    return united(found)
