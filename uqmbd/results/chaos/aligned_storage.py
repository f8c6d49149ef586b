"""The dataset `aligned` of an event-aligned chaos, and the way back."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import xarray as xr

from uqmbd.errors import StudyError
from uqmbd.results.chaos.storage import stored_labels
from uqmbd.results.schema import fixed_width

if TYPE_CHECKING:
    from uqmbd.results.chaos.aligned import AlignedChaos

__all__ = ["aligned_arguments", "aligned_dataset"]

BOUNDS = ("lower", "upper")


def aligned_dataset(chaos: AlignedChaos) -> xr.Dataset:
    """Store an event-aligned chaos as plain arrays and texts."""
    labels, elements = chaos.labels, chaos.elements
    terms, d = chaos.multi_index.shape
    most, powers = (max(e.segments.shape[k] for e in elements) for k in (1, 3))
    edges = np.full((len(elements), terms, most + 1), np.nan)
    segments = np.full((len(elements), terms, most, len(labels.outputs), powers), 0.0)
    events = [["" for _ in range(most)] for _ in elements]
    for k, e in enumerate(elements):
        count = e.segments.shape[1]
        edges[k, :, : count + 1], segments[k, :, :count, :, : e.segments.shape[3]] = e.edges, e.segments
        events[k][:count] = e.events
    about = "in the coordinates of the germs; an element holds its upper end, not its lower one"
    variables: dict[str, Any] = {
        "edge_coefficients": (
            ("element", "term", "edge"),
            edges,
            {"long_name": "coefficients of the times at which segments begin and end", "units": "s"},
        ),
        "segment_coefficients": (
            ("element", "term", "segment", "output", "power"),
            segments,
            {"long_name": "coefficients of the outputs at Chebyshev polynomials of each segment's normalised time"},
        ),
        "multi_index": (("term", "input"), chaos.multi_index, {"long_name": "degrees of each polynomial"}),
        "event": (("element", "segment"), fixed_width(np.array(events).ravel()).reshape(len(elements), most)),
        "segments": ("element", np.array([e.segments.shape[1] for e in elements]), {"long_name": "number of segments"}),
        "probability": ("element", np.array([e.box.probability for e in elements])),
    }
    for name in BOUNDS:
        ends = np.array([getattr(e.box, name) for e in elements]).reshape(len(elements), d)
        variables[name] = (("element", "input"), ends, {"long_name": f"{name} end", "comment": about})
    if chaos.verification_germs is not None and chaos.verification_response is not None:
        variables["verification_germs"] = (("verification", "germ"), chaos.verification_germs)
        variables["verification_response"] = (("verification", *labels.dims), chaos.verification_response)
    coords = {**labels.output_coords(), **labels.input_coords()}
    return chaos.space.to_dataset().assign(variables).assign_coords(coords)


def aligned_arguments(dataset: xr.Dataset | xr.DataTree) -> dict[str, Any]:
    """Return the arguments of `AlignedChaos` that a dataset was made from."""
    from uqmbd.randomness import GermBox, GermSpace
    from uqmbd.results.chaos.aligned import AlignedElement

    data = dataset.to_dataset() if isinstance(dataset, xr.DataTree) else dataset
    for name in ("edge_coefficients", "segment_coefficients", "multi_index", *BOUNDS):
        if name not in data:
            raise StudyError(
                f"A dataset 'aligned' needs the variable {name!r}; found {sorted(map(str, data.data_vars))}."
            )
    space = GermSpace.from_dataset(data)
    elements = []
    for k, count in enumerate(data["segments"].values.tolist()):
        box = GermBox(space, *(tuple(data[name].values[k].tolist()) for name in BOUNDS))
        elements.append(
            AlignedElement(
                box,
                tuple(str(x) for x in data["event"].values[k, :count]),
                data["edge_coefficients"].values[k, :, : count + 1],
                data["segment_coefficients"]
                .transpose("element", "term", "segment", "output", "power")
                .values[k, :, :count],
            )
        )
    found: dict[str, Any] = {
        "elements": elements,
        "multi_index": data["multi_index"].values,
        "labels": stored_labels(data),
    }
    if "verification_germs" in data:
        found |= {x: data[x].values for x in ("verification_germs", "verification_response")}
    return found
