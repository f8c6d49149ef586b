"""Boxes that fill the germ space, verification realisations in them, and the datasets of both."""

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
"""Names of the ends of boxes."""

FACE_SAMPLES = 128
"""Points of each plane between elements at which neighbouring elements are compared."""

SLIVER = 0.25
"""Mean square in the gap between a face and the next nodes, over that of the difference at the face: a jump at any
place of the gap, or a kink, has this one to a factor of four in most cases."""

ROUNDING = 1e-12
"""Difference of the sum of stored weights from 1 that counts as rounding."""


def check_filled(boxes: Sequence[GermBox]) -> None:
    """Raise a StudyError if the boxes do not fill the germ space."""
    total = sum(box.probability for box in boxes)
    if abs(total - 1) > 1e-9:
        raise StudyError(f"The boxes must fill the germ space; their probabilities sum to {total:.12g}.")


def rows_of_boxes(boxes: Sequence[GermBox], germs: Array) -> list[NDArray[np.intp]]:
    """Return the numbers of the germ points (K, d) in each box; raise a StudyError if a point is in none."""
    from uqmbd.randomness import located

    where = located(boxes, germs)
    if np.any(where < 0):
        raise StudyError(f"The germ point {germs[int(where.argmin())].tolist()} lies in none of the elements.")
    return [np.flatnonzero(where == k) for k in range(len(boxes))]


def face_mean_squares(boxes: Sequence[GermBox], evaluate: Callable[[Array], Array], known: Sequence[int]) -> Array:
    """Return the mean square (...) of errors by faces of boxes, from how neighbours differ there: (K, d) to (K, ...).

    `known` are numbers of points in each box, of which none needs to be nearer to a face than the inverse.

    A jump or kink between a face and the nodes next to it enters neither a fit nor a verification realisation. The
    element beyond the face has the other branch, so that both differ at the face by what is missed.
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
            # where one is not known, nothing is known of the difference
            difference = np.nan_to_num(evaluate(above[apart]) - evaluate(below[apart]))
            share = sum(gaps[side[apart], k] for side in sides) / len(sides) / len(germs)
            total = total + np.tensordot(share, difference**2, axes=1)
    return total


def terms_of_all(chaoses: Sequence[Any]) -> tuple[Index, list[list[int]]]:
    """Return the terms (P, d) that any of the chaoses has, by their degree, and the numbers of each chaos's own."""
    every = {tuple(row) for chaos in chaoses for row in chaos.multi_index.tolist()}
    terms = sorted(every, key=lambda row: (sum(row), [-k for k in row]))
    place = {row: k for k, row in enumerate(terms)}
    rows = [[place[tuple(row)] for row in chaos.multi_index.tolist()] for chaos in chaoses]
    return np.array(terms, dtype=np.int64), rows


def verification_of_all(chaoses: Sequence[Any], probabilities: Sequence[float]) -> dict[str, Array | None]:
    """Return the verification realisations of the chaoses of all elements: germ points (V, d), responses, weights.

    Each element counts by its probability, however many of the realisations are in it.  None where none has any.
    """
    pairs = [(c, p) for c, p in zip(chaoses, probabilities, strict=True) if c.verification_germs is not None]
    if not pairs:
        return dict.fromkeys(VERIFICATION)
    parts = [[getattr(c, name) for c, _ in pairs] for name in VERIFICATION[:2]]
    weights = np.concatenate([p * np.asarray(c.verification_weights) for c, p in pairs])
    return dict(zip(VERIFICATION, (*map(np.concatenate, parts), weights / weights.sum()), strict=True))


def checked_weights(weights: Array | None, germs: Array | None, boxes: Sequence[GermBox] = ()) -> Array | None:
    """Return weights (V,) of realisations at germ points (V, d) so that they sum to 1; None: none are known."""
    # without weights they are spread like the inputs, within each of the boxes, which count by their probability
    if germs is None:
        if weights is not None:
            raise StudyError("'verification_weights' are given without 'verification_germs'; they belong together.")
        return None
    if weights is None:
        found = np.ones(len(germs))
        for box, rows in zip(boxes, rows_of_boxes(boxes, germs) if boxes else (), strict=True):
            found[rows] = box.probability / max(len(rows), 1)
    else:
        found = np.array(weights, dtype=float)
    if found.shape != (len(germs),) or not (np.isfinite(found).all() and (found >= 0).all() and found.sum() > 0):
        raise StudyError(
            f"'verification_weights' must be one number, not negative, for each of {len(germs)} verification points; "
            f"{found.tolist()} was given."
        )
    if abs(found.sum() - 1) > ROUNDING:
        found /= found.sum()
    found.setflags(write=False)
    return found


def surrogate_dataset(
    space: GermSpace, labels: Labels, variables: Mapping[str, Any], known: Mapping[str, Array]
) -> xr.Dataset:
    """Add the germ space, the meaning of the axes, and known verification realisations to variables."""
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
    """Check that variables are present, all but the degrees with a dimension, and read axes and germ space."""
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


def verification_of(data: xr.Dataset) -> dict[str, Any]:
    """Return the verification realisations of a dataset by their names; none: empty."""
    # results of earlier versions have no weights: their realisations are spread like the inputs
    return {name: data[name].values for name in VERIFICATION if name in data}


def box_variables(boxes: Sequence[GermBox], about: Mapping[str, str]) -> dict[str, Any]:
    """Return ends (E, d) and probabilities (E,) of boxes as variables; `about` are attributes of the latter."""
    note = "in the coordinates of the germs; an element holds its upper end, not its lower one"
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
