"""Check boxes that fill the germ space, and store boxes and verification realisations in datasets."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from uqmbd.errors import StudyError
from uqmbd.results.chaos.sampling import spread_germs
from uqmbd.results.schema import InputInfo, Labels, output_infos, united
from uqmbd.typing import Array, Index

if TYPE_CHECKING:
    from uqmbd.randomness import GermBox, GermSpace

__all__ = [
    "BOUNDS",
    "VERIFICATION",
    "box_variables",
    "boxes_of",
    "check_filled",
    "checked_weights",
    "degrees",
    "face_mean_squares",
    "read_surrogate",
    "rows_of_boxes",
    "surrogate_dataset",
    "terms_of_all",
    "verification_of",
    "verification_of_all",
]


VERIFICATION = ("verification_germs", "verification_response", "verification_weights")
"""Names of the variables of verification realisations of a surrogate."""

BOUNDS = ("lower", "upper")
"""Names of the variables of the bounds of boxes."""

FACE_SAMPLES = 128
"""Number of points on each plane between elements, at which neighbouring elements are compared."""

SLIVER = 0.25
"""Mean square error between a face and the nearest nodes, divided by the mean square difference at the face.

For a jump or a kink in this gap, the ratio is correct to a factor of four in most cases.
"""

ROUNDING = 1e-12
"""Maximum deviation of the sum of stored weights from 1 due to rounding."""


def check_filled(boxes: Sequence[GermBox]) -> None:
    """Raise a StudyError if the boxes do not fill the germ space."""
    total = sum(box.probability for box in boxes)
    if abs(total - 1) > 1e-9:
        raise StudyError(
            f"The sum of the probabilities of the boxes is {total:.12g}; expected 1, for boxes that "
            "fill the germ space."
        )


def rows_of_boxes(boxes: Sequence[GermBox], germs: Array) -> list[NDArray[np.intp]]:
    """Return the indices of the germ points (K, d) in each box; raise a StudyError if a point is outside all boxes."""
    from uqmbd.randomness import located

    where = located(boxes, germs)
    if np.any(where < 0):
        raise StudyError(
            f"The germ point {germs[int(where.argmin())].tolist()} is outside all elements; expected "
            "points in the germ space."
        )
    return [np.flatnonzero(where == k) for k in range(len(boxes))]


def face_mean_squares(boxes: Sequence[GermBox], evaluate: Callable[[Array], Array], known: Sequence[int]) -> Array:
    """Return the mean square error (...) near the faces of boxes, from differences of neighbouring elements.

    `evaluate`: function of germ points, (K, d) to (K, ...); `known`: number of points in each box. The probability
    between a face and the nearest point may be up to the inverse of this number.

    A jump or kink between a face and the nearest nodes affects neither a fit nor a verification realisation. The
    element beyond the face represents the response beyond the jump. The difference of both elements at the face is
    therefore the error that verification misses.
    """
    from uqmbd.randomness import located

    space = boxes[0].space
    germs = spread_germs(space, FACE_SAMPLES, 0)
    gaps = SLIVER * np.array([box.probabilities for box in boxes]) / np.array(known)[:, None]
    total: Array = np.zeros(evaluate(germs[:1]).shape[1:])
    for k, germ in enumerate(space.germs):
        if germ.values is not None:
            continue
        for cut in sorted({end for box in boxes for end in (box.lower[k], box.upper[k])} - set(germ.bounds)):
            below, above = germs.copy(), germs.copy()
            below[:, k], above[:, k] = cut, np.nextafter(cut, np.inf)
            sides = [located(boxes, side) for side in (below, above)]
            apart = sides[0] != sides[1]
            if not apart.any():
                continue
            # unknown differences count as 0
            difference = np.nan_to_num(evaluate(above[apart]) - evaluate(below[apart]))
            share = sum(gaps[side[apart], k] for side in sides) / len(sides) / len(germs)
            total = total + np.tensordot(share, difference**2, axes=1)
    return total


def terms_of_all(chaoses: Sequence[Any]) -> tuple[Index, list[list[int]]]:
    """Return the terms (P, d) of all chaoses, sorted by degree, and for each chaos the indices of its terms."""
    every = {tuple(row) for chaos in chaoses for row in chaos.multi_index.tolist()}
    terms = sorted(every, key=lambda row: (sum(row), [-k for k in row]))
    place = {row: k for k, row in enumerate(terms)}
    rows = [[place[tuple(row)] for row in chaos.multi_index.tolist()] for chaos in chaoses]
    return np.array(terms, dtype=np.int64), rows


def verification_of_all(chaoses: Sequence[Any], probabilities: Sequence[float]) -> dict[str, Array | None]:
    """Return the verification realisations of the chaoses of all elements: germ points (V, d), responses, weights.

    The total weight of an element is its probability, for any number of realisations. All values are None if no
    element has verification realisations.
    """
    pairs = [(c, p) for c, p in zip(chaoses, probabilities, strict=True) if c.verification_germs is not None]
    if not pairs:
        return dict.fromkeys(VERIFICATION)
    parts = [[getattr(c, name) for c, _ in pairs] for name in VERIFICATION[:2]]
    weights = np.concatenate([p * np.asarray(c.verification_weights) for c, p in pairs])
    return dict(zip(VERIFICATION, (*map(np.concatenate, parts), weights / weights.sum()), strict=True))


def checked_weights(weights: Array | None, germs: Array | None, boxes: Sequence[GermBox] = ()) -> Array | None:
    """Return weights (V,), with sum 1, of realisations at germ points (V, d); None without realisations."""
    # without given weights, realisations in a box have equal weights, whose sum is the probability of the box
    if germs is None:
        if weights is not None:
            raise StudyError("'verification_weights' are given without 'verification_germs'; expected both or neither.")
        return None
    if weights is None:
        found = np.ones(len(germs))
        for box, rows in zip(boxes, rows_of_boxes(boxes, germs) if boxes else (), strict=True):
            found[rows] = box.probability / max(len(rows), 1)
    else:
        found = np.array(weights, dtype=float)
    if found.shape != (len(germs),) or not (np.isfinite(found).all() and (found >= 0).all() and found.sum() > 0):
        raise StudyError(
            f"'verification_weights' is {found.tolist()}; expected one number of 0 or more for each of the "
            f"{len(germs)} verification points."
        )
    if abs(found.sum() - 1) > ROUNDING:
        found /= found.sum()
    found.setflags(write=False)
    return found


def surrogate_dataset(
    space: GermSpace, labels: Labels, variables: Mapping[str, Any], known: Mapping[str, Array]
) -> xr.Dataset:
    """Build a dataset from variables, the germ space, the labels of the axes, and verification realisations."""
    dims = (("verification", "germ"), ("verification", *labels.dims), ("verification",))
    verified = {name: (dim, known[name]) for name, dim in zip(VERIFICATION, dims, strict=True) if known}
    coords = {**labels.output_coords(), **labels.input_coords()}
    return united(space.to_dataset().assign({**variables, **verified}).assign_coords(coords))


def degrees(multi_index: Index, comment: str = "") -> dict[str, Any]:
    """Return the degrees (P, d) of terms as a variable."""
    about = {"long_name": "degrees of each polynomial", **({"comment": comment} if comment else {})}
    return {"multi_index": (("term", "input"), multi_index, about)}


def read_surrogate(
    dataset: xr.Dataset | xr.DataTree, name: str, needed: Sequence[str], dim: str = ""
) -> tuple[xr.Dataset, Labels, GermSpace]:
    """Check variables, and their dimension `dim` except for the degrees; read labels and germ space."""
    from uqmbd.randomness import GermSpace

    data = dataset.to_dataset() if isinstance(dataset, xr.DataTree) else dataset
    for variable in needed:
        if variable not in data or (dim and dim not in data[variable].dims and variable != "multi_index"):
            of = f"'{name}' of elements" if dim else f"'{name}'"
            the = f"the variable {variable!r}" + (" with its dimensions" if dim else "")
            raise StudyError(
                f"A dataset {of} needs {the}; this dataset has the variables {sorted(map(str, data.data_vars))}."
            )
    for coord in ("output", "output_units", "input", "input_units", "input_description"):
        if coord not in data.coords:
            raise StudyError(
                f"A dataset '{name}' needs the coordinate {coord!r}; this dataset has the coordinates "
                f"{sorted(map(str, data.coords))}."
            )
    inputs = zip(*(data[x].values for x in ("input", "input_units", "input_description")), strict=True)
    labels = Labels(
        outputs=output_infos(data),
        inputs=tuple(InputInfo(str(name), str(units), str(text)) for name, units, text in inputs),
        times=np.array(data["time"].values, dtype=float) if "time" in data.coords else None,
    )
    return data, labels, GermSpace.from_dataset(data)


def verification_of(data: xr.Dataset) -> dict[str, Any]:
    """Return the verification realisations of a dataset by variable name, or an empty mapping."""
    # results of earlier versions have no weights; their realisations are distributed like the inputs
    return {name: data[name].values for name in VERIFICATION if name in data}


def box_variables(boxes: Sequence[GermBox], about: Mapping[str, str]) -> dict[str, Any]:
    """Return bounds (E, d) and probabilities (E,) of boxes as variables; `about`: attributes of the probabilities."""
    note = "in the coordinates of the germs; an element includes its upper bound, but not its lower bound"
    ends = {
        name: (
            ("element", "input"),
            np.array([getattr(box, name) for box in boxes]).reshape(len(boxes), -1),
            {"long_name": f"{name} end", "comment": note},
        )
        for name in BOUNDS
    }
    return {"probability": ("element", np.array([box.probability for box in boxes]), about), **ends}


def boxes_of(data: xr.Dataset, space: GermSpace) -> tuple[GermBox, ...]:
    """Return the boxes of a dataset."""
    from uqmbd.randomness import GermBox

    ends = (data[name].transpose("element", "input").values.tolist() for name in BOUNDS)
    return tuple(GermBox(space, tuple(low), tuple(high)) for low, high in zip(*ends, strict=True))
