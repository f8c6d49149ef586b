"""The dataset of the statistics of a surrogate."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import xarray as xr

from uqmbd.results.schema import Labels, fixed_width, statistics_dataset, united
from uqmbd.typing import Array

__all__ = ["StatedErrors", "surrogate_statistics"]


class StatedErrors(NamedTuple):
    """Stated error of a surrogate, over the standard deviation, and the factor by which it may be off: (O, T)."""

    error: Array
    factor: Array


def surrogate_statistics(
    labels: Labels,
    values: Mapping[str, Any],
    *,
    shape_samples: int,
    samples: int,
    wanted: int,
    terms: int,
    of_germs: tuple[Sequence[str], Array, Array] | None,
    stated: StatedErrors | None,
) -> xr.Dataset:
    """Build the dataset, and say what in it is of samples.

    Parameters
    ----------
    labels : Labels
    values : mapping
        Arguments of :func:`uqmbd.extend.statistics_dataset`.
    shape_samples : int
        Samples that skewness and kurtosis are of; 0: they are exact.
    samples, wanted : int
        Samples that quantiles are of, and that were asked for.
    terms : int
        Of the surrogate, which allow no more.
    of_germs : tuple, optional
        Names of germs, their first-order and total indices, where inputs depend on one another.
    stated : StatedErrors, optional
        Where there is verification data.
    """
    found = statistics_dataset(labels, **values)
    if shape_samples:
        for name in ("skewness", "kurtosis"):
            found[name].attrs |= {
                "samples": shape_samples,
                "comment": f"{found[name].attrs['comment']}; of {shape_samples} samples of the surrogate",
            }
    if samples < wanted:
        found["quantile"].attrs |= {
            "samples": samples,
            "comment": f"of {samples} samples of the surrogate: its {terms} terms allow no more",
        }
    if of_germs is not None:
        names, first, total = of_germs
        note = {"comment": "of germs: inputs depend on one another, so no share belongs to an input"}
        dims = ("germ", *labels.dims)
        found = found.assign(
            sobol_first_germ=(dims, first, {"long_name": "first-order Sobol' index"} | note),
            sobol_total_germ=(dims, total, {"long_name": "total Sobol' index"} | note),
        ).assign_coords(germ=("germ", fixed_width(names)))
    if stated is not None:
        note = {"long_name": "stated error of the surrogate, over the standard deviation"}
        about = {
            "long_name": "factor by which the stated error may be off",
            "comment": "two standard errors, from the scatter of the squared errors; above 2: raise verify",
        }
        found = found.assign(
            verification_error=(labels.dims, stated.error, note),
            verification_factor=(labels.dims, stated.factor, about),
        )
    return united(found)
