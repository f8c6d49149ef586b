"""The datasets of a chaos in a propagator's node, and the way back: plain arrays and texts."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any, get_args

import numpy as np
import xarray as xr

from uqmbd.errors import StudyError
from uqmbd.results.chaos.aligned_element import AlignedElement, Landmarks
from uqmbd.results.chaos.boxes import VERIFICATION, rows_of_boxes
from uqmbd.results.chaos.interface import Surrogate
from uqmbd.results.chaos.quasi_periodic_element import QuasiPeriodicElement
from uqmbd.results.schema import InputInfo, Labels, fixed_width, output_infos, united
from uqmbd.typing import Array, Index, Mask

if TYPE_CHECKING:
    from uqmbd.randomness import GermBox, GermSpace

__all__ = [
    "aligned_arguments",
    "aligned_dataset",
    "chaos_arguments",
    "chaos_dataset",
    "piecewise_arguments",
    "piecewise_dataset",
    "quasi_periodic_arguments",
    "quasi_periodic_dataset",
]

BOUNDS = ("lower", "upper")
_DEGREES = "degrees of each polynomial"


def chaos_dataset(chaos: Surrogate, coefficients: Array) -> xr.Dataset:
    """Store a chaos of coefficients (P, O, T)."""
    order = "column k belongs to germ k"
    if not chaos.space.independent:
        order += ", which is not input k alone: inputs are dependent"
    variables: dict[str, Any] = {
        "coefficients": (
            ("term", *chaos.labels.dims),
            coefficients,
            {"long_name": "coefficients of the orthonormal polynomials", "comment": "in the units of the outputs"},
        ),
        "multi_index": (("term", "input"), chaos.multi_index, {"long_name": _DEGREES, "comment": order}),
    }
    if chaos.verification_germs is not None:
        about = {
            "long_name": "stated error of the surrogate",
            "comment": "root mean square at weighted realisations that no node uses, over the standard deviation",
        }
        variables |= _verification(chaos) | {
            "verification_error": (chaos.labels.dims, chaos.verification_error(), about)
        }
    return _dataset(chaos, variables)


def chaos_arguments(dataset: xr.Dataset | xr.DataTree) -> dict[str, Any]:
    """Return the arguments of `PolynomialChaos` that a dataset was made from."""
    data, labels, space = _read(dataset, "chaos", ("coefficients", "multi_index"))
    if "element" in data["coefficients"].dims:
        raise StudyError("This chaos has elements; read it by uqmbd.results.PiecewiseChaos, or chaos_from_dataset.")
    return {
        "coefficients": data["coefficients"].transpose("term", *labels.dims).values,
        "multi_index": data["multi_index"].transpose("term", "input").values,
        "space": space,
        "labels": labels,
    } | _verified(data)


def piecewise_dataset(
    chaos: Surrogate,
    boxes: Sequence[GermBox],
    coefficients: Array,
    has_term: Mask,
    element_errors: Callable[[], Array],
) -> xr.Dataset:
    """Store a chaos of elements: boxes (E), coefficients (E, P, O, T), terms (E, P) and stated errors (E, O, T)."""
    variables: dict[str, Any] = {
        "coefficients": (
            ("element", "term", *chaos.labels.dims),
            coefficients,
            {
                "long_name": "coefficients of the orthonormal polynomials of each element",
                "comment": "in the units of the outputs; 0 where an element does not have a term",
            },
        ),
        "multi_index": (
            ("term", "input"),
            chaos.multi_index,
            {"long_name": _DEGREES, "comment": "column k belongs to germ k"},
        ),
        "has_term": (
            ("element", "term"),
            has_term.astype(np.int8),
            {"long_name": "whether an element has a term", "comment": "1: it has"},
        ),
        **_ends(boxes),
        "probability": (
            "element",
            np.array([box.probability for box in boxes]),
            {"long_name": "probability of the element"},
        ),
    }
    if chaos.verification_germs is not None:
        note = "root mean square at realisations in the element that no node uses, over the whole standard deviation"
        about = {"long_name": "stated error of the surrogate within the element", "comment": note}
        errors = (("element", *chaos.labels.dims), element_errors(), about)
        variables |= _verification(chaos) | {"verification_error": errors}
    return _dataset(chaos, variables)


def piecewise_arguments(dataset: xr.Dataset | xr.DataTree) -> tuple[tuple[GermBox, ...], list[dict[str, Any]]]:
    """Return the boxes that a dataset was made from, and the arguments of the `PolynomialChaos` in each."""
    data, labels, space = _read(dataset, "chaos", ("coefficients", "multi_index", *BOUNDS), "element")
    boxes = _boxes(data, space)
    coefficients = data["coefficients"].transpose("element", "term", *labels.dims).values
    multi_index = data["multi_index"].transpose("term", "input").values
    verified = _verified(data)
    rows = (
        rows_of_boxes(boxes, verified["verification_germs"]) if verified else [np.zeros(0, dtype=np.intp)] * len(boxes)
    )
    elements = []
    for k, (box, own) in enumerate(zip(boxes, rows, strict=True)):
        # a part of a discrete germ has fewer polynomials
        highest = [germ.values - 1 if germ.values is not None else np.inf for germ in box.local.germs]
        kept = (multi_index <= highest).all(axis=1)
        if "has_term" in data:
            kept &= data["has_term"].values[k] != 0
        element = {
            "coefficients": coefficients[k][kept],
            "multi_index": multi_index[kept],
            "space": box.local,
            "labels": labels,
        }
        elements.append(element | ({name: verified[name][own] for name in verified} if len(own) else {}))
    return boxes, elements


def aligned_dataset(chaos: Surrogate, elements: Sequence[AlignedElement]) -> xr.Dataset:
    """Store an aligned chaos."""
    terms = len(chaos.multi_index)
    most, powers = (max(e.segments.shape[k] for e in elements) for k in (1, 3))
    edges = np.full((len(elements), terms, most + 1), np.nan)
    segments = np.full((len(elements), terms, most, len(chaos.labels.outputs), powers), 0.0)
    events = [["" for _ in range(most)] for _ in elements]
    for k, e in enumerate(elements):
        count = e.segments.shape[1]
        edges[k, :, : count + 1], segments[k, :, :count, :, : e.segments.shape[3]] = e.edges, e.segments
        events[k][:count] = e.events
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
        "multi_index": (("term", "input"), chaos.multi_index, {"long_name": _DEGREES}),
        "event": (("element", "segment"), fixed_width(np.array(events).ravel()).reshape(len(elements), most)),
        "landmarks": (
            "element",
            np.array([e.landmarks for e in elements], dtype=np.str_),
            {"long_name": "what ends segments"},
        ),
        "segments": ("element", np.array([e.segments.shape[1] for e in elements]), {"long_name": "number of segments"}),
        "probability": ("element", np.array([e.box.probability for e in elements]), {"units": "1"}),
        **_ends([e.box for e in elements]),
    }
    if chaos.verification_germs is not None:
        variables |= _verification(chaos)
    return _dataset(chaos, variables)


def aligned_arguments(dataset: xr.Dataset | xr.DataTree) -> dict[str, Any]:
    """Return the arguments of `AlignedChaos` that a dataset was made from."""
    needed = ("edge_coefficients", "segment_coefficients", "multi_index", *BOUNDS)
    data, labels, space = _read(dataset, "aligned", needed)
    segments = data["segment_coefficients"].transpose("element", "term", "segment", "output", "power").values
    elements = [
        AlignedElement(
            box,
            tuple(str(x) for x in data["event"].values[k, :count]),
            data["edge_coefficients"].values[k, :, : count + 1],
            segments[k, :, :count],
            *((_landmarks(str(data["landmarks"].values[k])),) if "landmarks" in data else ()),
        )
        for k, (box, count) in enumerate(zip(_boxes(data, space), data["segments"].values.tolist(), strict=True))
    ]
    return {"elements": elements, "multi_index": data["multi_index"].values, "labels": labels} | _verified(data)


def quasi_periodic_dataset(
    chaos: Surrogate, elements: Sequence[QuasiPeriodicElement], lattice: Index, origin: float
) -> xr.Dataset:
    """Store a quasi-periodic chaos: multiples (H, M) of its base frequencies, and the time from which phases count."""
    of_output, of_wave = ("element", "term", "output"), ("element", "term", "output", "harmonic")
    variables: dict[str, Any] = {
        "frequency_coefficients": (
            ("element", "term", "base"),
            np.array([e.frequencies for e in elements]),
            {"long_name": "coefficients of the base frequencies", "units": "rad/s"},
        ),
        "constant_coefficients": (
            of_output,
            np.array([e.constants for e in elements]),
            {"long_name": "coefficients of what is constant", "comment": "in the units of the outputs"},
        ),
        "drift_coefficients": (
            of_output,
            np.array([e.drifts for e in elements]),
            {"long_name": "coefficients of mean rates", "comment": "in the units of the outputs, per second"},
        ),
        "cosine_coefficients": (
            of_wave,
            np.array([e.waves.real for e in elements]),
            {"long_name": "coefficients of the cosines", "comment": "in the units of the outputs"},
        ),
        "sine_coefficients": (
            of_wave,
            np.array([-e.waves.imag for e in elements]),
            {"long_name": "coefficients of the sines", "comment": "in the units of the outputs"},
        ),
        "harmonics": (("harmonic", "base"), lattice, {"long_name": "multiples of the base frequencies"}),
        "origin": ((), origin, {"long_name": "time from which phases count", "units": "s"}),
        "multi_index": (("term", "input"), chaos.multi_index, {"long_name": _DEGREES}),
        "probability": ("element", np.array([e.box.probability for e in elements]), {"units": "1"}),
        **_ends([e.box for e in elements]),
    }
    if chaos.verification_germs is not None:
        variables |= _verification(chaos)
    return _dataset(chaos, variables)


def quasi_periodic_arguments(dataset: xr.Dataset | xr.DataTree) -> dict[str, Any]:
    """Return the arguments of `QuasiPeriodicChaos` that a dataset was made from."""
    parts = ("frequency", "constant", "drift", "cosine", "sine")
    needed = (*(f"{part}_coefficients" for part in parts), "harmonics", "origin", "multi_index", *BOUNDS)
    data, labels, space = _read(dataset, "quasi_periodic", needed)
    last = ("base", "output", "output", "output", "output")
    dims: list[tuple[str, ...]] = [("element", "term", name) for name in last]
    dims[3:] = [(*row, "harmonic") for row in dims[3:]]
    found = [data[f"{part}_coefficients"].transpose(*row).values for part, row in zip(parts, dims, strict=True)]
    elements = [
        QuasiPeriodicElement(box, found[0][k], found[1][k], found[2][k], found[3][k] - 1j * found[4][k])
        for k, box in enumerate(_boxes(data, space))
    ]
    return {
        "elements": elements,
        "lattice": data["harmonics"].transpose("harmonic", "base").values,
        "origin": float(data["origin"]),
        "multi_index": data["multi_index"].transpose("term", "input").values,
        "labels": labels,
    } | _verified(data)


def _landmarks(text: str) -> Landmarks:
    for known in get_args(Landmarks):
        if text == known:
            found: Landmarks = known
            return found
    raise StudyError(f"Landmarks of an aligned chaos are {text!r}; expected one of {', '.join(get_args(Landmarks))}.")


def _dataset(chaos: Surrogate, variables: dict[str, Any]) -> xr.Dataset:
    """Put variables beside the germ space and the meaning of the axes."""
    coords = {**chaos.labels.output_coords(), **chaos.labels.input_coords()}
    return united(chaos.space.to_dataset().assign(variables).assign_coords(coords))


def _read(
    dataset: xr.Dataset | xr.DataTree, name: str, needed: Sequence[str], dim: str = ""
) -> tuple[xr.Dataset, Labels, GermSpace]:
    """Check that variables are there, all but the degrees with a dimension, and read axes and germ space."""
    from uqmbd.randomness import GermSpace

    data = dataset.to_dataset() if isinstance(dataset, xr.DataTree) else dataset
    for variable in needed:
        if variable not in data or (dim and dim not in data[variable].dims and variable != "multi_index"):
            of = f"'{name}' of elements" if dim else f"'{name}'"
            the = f"the variable {variable!r}" + (" with its dimensions" if dim else "")
            raise StudyError(f"A dataset {of} needs {the}; found {sorted(map(str, data.data_vars))}.")
    for coord in ("output", "output_units", "input", "input_units", "input_description"):
        if coord not in data.coords:
            raise StudyError(
                f"A dataset '{name}' needs the coordinate {coord!r}; found {sorted(map(str, data.coords))}."
            )
    inputs = zip(*(data[x].values for x in ("input", "input_units", "input_description")), strict=True)
    labels = Labels(
        outputs=output_infos(data),
        inputs=tuple(InputInfo(*map(str, texts)) for texts in inputs),
        times=np.array(data["time"].values, dtype=float) if "time" in data.coords else None,
    )
    return data, labels, GermSpace.from_dataset(data)


def _verification(chaos: Surrogate) -> dict[str, Any]:
    dims = (("verification", "germ"), ("verification", *chaos.labels.dims), ("verification",))
    return {name: (dim, getattr(chaos, name)) for name, dim in zip(VERIFICATION, dims, strict=True)}


def _verified(data: xr.Dataset) -> dict[str, Any]:
    # results of earlier versions have no weights: their realisations are spread like the inputs
    return {name: data[name].values for name in VERIFICATION if name in data}


def _ends(boxes: Sequence[GermBox]) -> dict[str, Any]:
    about = "in the coordinates of the germs; an element holds its upper end, not its lower one"
    return {
        name: (
            ("element", "input"),
            np.array([getattr(box, name) for box in boxes]).reshape(len(boxes), -1),
            {"long_name": f"{name} end", "comment": about},
        )
        for name in BOUNDS
    }


def _boxes(data: xr.Dataset, space: GermSpace) -> tuple[GermBox, ...]:
    from uqmbd.randomness import GermBox

    ends = (data[name].transpose("element", "input").values.tolist() for name in BOUNDS)
    return tuple(GermBox(space, tuple(low), tuple(high)) for low, high in zip(*ends, strict=True))
