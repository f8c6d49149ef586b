"""The dataset `chaos` of a multi-element chaos, and the way back."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import xarray as xr

from uqmbd.errors import StudyError
from uqmbd.results.chaos.chaos import PolynomialChaos
from uqmbd.results.chaos.storage import stored_labels

if TYPE_CHECKING:
    from uqmbd.results.chaos.piecewise import PiecewiseChaos

__all__ = ["piecewise_arguments", "piecewise_dataset"]

BOUNDS = ("lower", "upper")


def piecewise_dataset(chaos: PiecewiseChaos) -> xr.Dataset:
    """Store a chaos of elements as plain arrays and texts."""
    labels, dims = chaos.labels, chaos.labels.dims
    ends = {name: np.array([getattr(box, name) for box in chaos.boxes]) for name in BOUNDS}
    about = "in the coordinates of the germs; an element holds its upper end, not its lower one"
    variables: dict[str, Any] = {
        "coefficients": (
            ("element", "term", *dims),
            chaos.coefficients,
            {
                "long_name": "coefficients of the orthonormal polynomials of each element",
                "comment": "in the units of the outputs; 0 where an element does not have a term",
            },
        ),
        "multi_index": (
            ("term", "input"),
            chaos.multi_index,
            {"long_name": "degrees of each polynomial", "comment": "column k belongs to germ k"},
        ),
        "has_term": (
            ("element", "term"),
            chaos.has_term.astype(np.int8),
            {"long_name": "whether an element has a term", "comment": "1: it has"},
        ),
        "lower": (("element", "input"), ends["lower"], {"long_name": "lower end", "comment": about}),
        "upper": (("element", "input"), ends["upper"], {"long_name": "upper end", "comment": about}),
        "probability": ("element", chaos.probabilities, {"long_name": "probability of the element"}),
    }
    if chaos.verification_germs is not None and chaos.verification_response is not None:
        note = "root mean square at realisations in the element that no node uses, over the whole standard deviation"
        variables |= {
            "verification_germs": (("verification", "germ"), chaos.verification_germs),
            "verification_response": (("verification", *dims), chaos.verification_response),
            "verification_error": (
                ("element", *dims),
                chaos.element_errors(),
                {"long_name": "stated error of the surrogate within the element", "comment": note},
            ),
        }
    coords = {**labels.output_coords(), **labels.input_coords()}
    return chaos.space.to_dataset().assign(variables).assign_coords(coords)


def piecewise_arguments(dataset: xr.Dataset | xr.DataTree) -> dict[str, Any]:
    """Return the arguments of `PiecewiseChaos` that a dataset was made from."""
    from uqmbd.randomness import GermBox, GermSpace, located

    data = dataset.to_dataset() if isinstance(dataset, xr.DataTree) else dataset
    for name in ("coefficients", "multi_index", *BOUNDS):
        if name not in data or ("element" not in data[name].dims and name != "multi_index"):
            raise StudyError(
                f"A dataset 'chaos' of elements needs the variable {name!r} with its dimensions; found "
                f"{sorted(map(str, data.data_vars))}."
            )
    labels = stored_labels(data)
    space = GermSpace.from_dataset(data)
    lower, upper = (data[name].transpose("element", "input").values for name in BOUNDS)
    boxes = tuple(GermBox(space, tuple(low), tuple(high)) for low, high in zip(lower, upper, strict=True))
    coefficients = data["coefficients"].transpose("element", "term", *labels.dims).values
    multi_index = data["multi_index"].transpose("term", "input").values
    germs = response = None
    where = np.zeros(0, dtype=np.int64)
    if "verification_germs" in data:
        germs, response = data["verification_germs"].values, data["verification_response"].values
        where = located(boxes, germs)
    elements = []
    for k, box in enumerate(boxes):
        # a part of a discrete germ has fewer polynomials
        highest = [germ.values - 1 if germ.values is not None else np.inf for germ in box.local.germs]
        kept = (multi_index <= highest).all(axis=1)
        if "has_term" in data:
            kept &= data["has_term"].values[k] != 0
        own = np.flatnonzero(where == k)
        elements.append(
            PolynomialChaos(
                coefficients[k][kept],
                multi_index[kept],
                box.local,
                labels,
                verification_germs=germs[own] if germs is not None and len(own) else None,
                verification_response=response[own] if response is not None and len(own) else None,
            )
        )
    return {"elements": tuple(elements), "boxes": boxes}
