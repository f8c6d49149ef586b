"""The dataset `chaos` of a propagator's node, and the way back."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import xarray as xr

from uqmbd.errors import StudyError
from uqmbd.results.schema import InputInfo, Labels, output_infos

if TYPE_CHECKING:
    from uqmbd.results.chaos.chaos import PolynomialChaos

__all__ = ["chaos_arguments", "chaos_dataset", "stored_labels"]


def chaos_dataset(chaos: PolynomialChaos) -> xr.Dataset:
    """Store a chaos as plain arrays and texts."""
    labels, dims = chaos.labels, chaos.labels.dims
    order = "column k belongs to germ k"
    if not chaos.space.independent:
        order += ", which is not input k alone: inputs are dependent"
    variables: dict[str, Any] = {
        "coefficients": (
            ("term", *dims),
            chaos.coefficients,
            {"long_name": "coefficients of the orthonormal polynomials", "comment": "in the units of the outputs"},
        ),
        "multi_index": (
            ("term", "input"),
            chaos.multi_index,
            {"long_name": "degrees of each polynomial", "comment": order},
        ),
    }
    if chaos.verification_germs is not None:
        variables |= {
            "verification_germs": (("verification", "germ"), chaos.verification_germs),
            "verification_response": (("verification", *dims), chaos.verification_response),
            "verification_error": (
                dims,
                chaos.verification_error(),
                {
                    "long_name": "stated error of the surrogate",
                    "comment": "root mean square at realisations that no node uses, over the standard deviation",
                },
            ),
        }
    coords = {**labels.output_coords(), **labels.input_coords()}
    return chaos.space.to_dataset().assign(variables).assign_coords(coords)


def chaos_arguments(dataset: xr.Dataset | xr.DataTree) -> dict[str, Any]:
    """Return the arguments of `PolynomialChaos` that a dataset was made from."""
    from uqmbd.randomness import GermSpace

    data = dataset.to_dataset() if isinstance(dataset, xr.DataTree) else dataset
    for name in ("coefficients", "multi_index"):
        if name not in data:
            raise StudyError(
                f"A dataset 'chaos' needs the variable {name!r}; found {sorted(map(str, data.data_vars))}."
            )
    if "element" in data["coefficients"].dims:
        raise StudyError("This chaos has elements; read it by uqmbd.results.PiecewiseChaos, or chaos_from_dataset.")
    labels = stored_labels(data)
    verified = "verification_germs" in data
    return {
        "coefficients": data["coefficients"].transpose("term", *labels.dims).values,
        "multi_index": data["multi_index"].transpose("term", "input").values,
        "space": GermSpace.from_dataset(data),
        "labels": labels,
        "verification_germs": data["verification_germs"].values if verified else None,
        "verification_response": data["verification_response"].values if verified else None,
    }


def stored_labels(data: xr.Dataset) -> Labels:
    """Read the meaning of the axes from a dataset `chaos`."""
    for name in ("output", "output_units", "input", "input_units", "input_description"):
        if name not in data.coords:
            raise StudyError(f"A dataset 'chaos' needs the coordinate {name!r}; found {sorted(map(str, data.coords))}.")
    timed = "time" in data.coords
    inputs = zip(*(data[name].values for name in ("input", "input_units", "input_description")), strict=True)
    return Labels(
        outputs=output_infos(data),
        inputs=tuple(InputInfo(*map(str, texts)) for texts in inputs),
        times=np.array(data["time"].values, dtype=float) if timed else None,
    )
