"""Poses of a mechanism's bodies as functions of the germs, for its player: `pose_surrogate`, `packed_poses`.

The method whose surrogate is in the page runs once more, at the frames of the motion, with every coordinate of the
bodies as an output: poses have the same germs and the same kind of surrogate, follow the same events and phases, and
state their error.  It costs the realisations of that method again.  A regression on the stored realisations of the
motion would cost none, and is no alternative: some twenty do not determine the 28 terms of order 2 of six inputs.

Points in the frames of bodies are functions of the inputs, too.  Polynomials are fitted to them, without realisations.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import xarray as xr

from uqmbd.errors import StudyError
from uqmbd.report.live.surrogates import NO_SURROGATE, live_method, packed_surrogate
from uqmbd.report.mechanisms import marked_points, observed_bodies
from uqmbd.results import (
    PolynomialChaos,
    labels,
    least_squares,
    surrogate,
    surrogate_parts,
)
from uqmbd.results.chaos import Surrogate, random_germs, spread_germs
from uqmbd.typing import Array, Index

if TYPE_CHECKING:
    from uqmbd.propagation import Study
    from uqmbd.randomness import GermSpace

__all__ = ["packed_poses", "pose_surrogate", "with_poses"]


BUDGET = 4.0
"""Seconds that a run may spend on realisations that are for poses only."""

FRAMES = 60
"""Times of a motion, unless another number is given."""

ORDER = 6
"""Highest order of the polynomials of points; lower with many inputs."""

TERMS = 500
"""Most terms of them."""

CHECKS = 32
"""Realisations of points by which their error is stated."""


def pose_surrogate(study: Study, method: str, frames: int = FRAMES) -> xr.DataTree:
    """Make surrogates of the poses of a study's bodies.

    Parameters
    ----------
    study : Study
    method : str
        Label of one of its methods, which makes a surrogate.
    frames : int
        Times, evenly over those of the study.

    Returns
    -------
    xarray.DataTree
        With the children ``coordinates`` and ``points``, each of which `uqmbd.results.surrogate` reads; what
        `packed_poses` takes.

    Raises
    ------
    StudyError
        If the method makes no surrogate, or not of all coordinates at all frames.
    """
    node, names = observed_bodies(study, frames, method)
    if not surrogate_parts(node):
        raise StudyError(f"The method {method!r} makes no surrogate, hence none of poses; collocation and Galerkin do.")
    found = xr.DataTree(name="pose_surrogate")
    found.attrs |= {
        "method": method,
        "bodies": list(study.mechanism.bodies),
        "dimension": study.mechanism.space.dimension,
        "size": study.mechanism.space.size,
        "upright": int(study.mechanism.space.dimension == 1 and not study.mechanism.space.gravity[0].is_zero),
        "realisations": int(node.attrs["realisations"]),
    }
    for part, (kind, data) in surrogate_parts(node).items():
        own = data.to_dataset()
        rows = [k for k, name in enumerate(own["output"].values) if name in names]
        if rows:
            found[f"coordinates/composed/{part}/{kind}" if part else f"coordinates/{kind}"] = xr.DataTree(
                own.isel(output=rows)
            )
    coordinates = surrogate(found.children["coordinates"])
    if [o.name for o in coordinates.labels.outputs] != names:
        raise StudyError(f"The method {method!r} has no surrogate of all coordinates.")
    if len(np.asarray(coordinates.labels.times)) < frames:
        raise StudyError(f"The surrogates of {method!r} end before the last frame.")
    if marks := _points(study, coordinates):
        found["points/chaos"] = xr.DataTree(marks.to_dataset())
    return found


def with_poses(tree: xr.DataTree, study: Study) -> tuple[xr.DataTree, str]:
    """Add surrogates of poses to results with a motion, as the node ``pose_surrogate``.

    Nothing that goes wrong here ends a run.

    Parameters
    ----------
    tree : xarray.DataTree
        The result of a study.
    study : Study
        That study.

    Returns
    -------
    tree : xarray.DataTree
        With the node, if it could be made.
    note : str
        Why it could not, or empty.
    """
    method = live_method(tree)
    if "motion" not in tree.children:
        return tree, "The motion of the mechanism is not known."
    if not method:
        return tree, NO_SURROGATE
    if (cost := float(tree.children[method].attrs.get("wall_time", np.inf))) > BUDGET:
        return tree, f"The poses take the realisations of {method} again, {cost:.3g} s; up to {BUDGET:g} s are spent."
    try:
        made = pose_surrogate(study, method, tree.children["motion"].sizes["time"])
        extended = tree.copy()
        extended["pose_surrogate"] = made
    except Exception as error:  # noqa: BLE001 - studies and plugins may raise anything; the results must stand
        return tree, f"{type(error).__name__}: {error}"
    return extended, ""


def packed_poses(node: xr.DataTree) -> dict[str, Any]:
    """Return surrogates of poses as data of a page, which `poses.js` evaluates.

    Parameters
    ----------
    node : xarray.DataTree
        Of `pose_surrogate`.

    Returns
    -------
    dict
        ``bodies``, their names; ``size``, numbers of a body's pose, the first ``dimension`` of which are its position,
        the others a quaternion (in the plane the cosine and sine of an angle); ``upright``; ``coordinates`` and
        ``points``, each as of `packed_surrogate`, the latter None where nothing is drawn but bodies.
    """
    return {
        "bodies": [str(name) for name in np.atleast_1d(node.attrs["bodies"])],
        **{name: int(node.attrs[name]) for name in ("dimension", "size", "upright")},
        "coordinates": packed_surrogate(surrogate(node.children["coordinates"])),
        "points": packed_surrogate(surrogate(node.children["points"])) if "points" in node.children else None,
    }


def _points(study: Study, coordinates: Surrogate) -> PolynomialChaos | None:
    """Fit polynomials of the germs to points in the frames of bodies, and to radii; None where there are none."""
    space = coordinates.space
    terms = _terms(space)
    germs = spread_germs(space, max(2 * len(terms), 4), 0)
    checks = random_germs(space, CHECKS, 1)
    values = [_numbers(study, space, at) for at in (germs, checks)]
    if not values[0].shape[1]:
        return None
    fitted = least_squares(values[0], space.evaluate(germs, terms)).coefficients
    axes = labels([f"number {k}" for k in range(values[0].shape[1])], list(space.inputs), None)
    return PolynomialChaos(fitted, terms, space, axes, checks, values[1])


def _numbers(study: Study, space: GermSpace, germs: Array) -> Array:
    """Return coordinates and radii (K, N (axes + 1)) of the points, in m."""
    inputs = space.to_inputs(germs)
    order = [list(space.inputs).index(name) for name in study.mechanism.inputs.names]
    points, radii = marked_points(study, inputs[:, order])
    return np.concatenate([points, radii[..., None]], axis=-1).reshape(len(germs), -1)


def _terms(space: GermSpace) -> Index:
    order = next((n for n in range(ORDER, 1, -1) if len(space.basis(n)) <= TERMS), 1)
    return space.basis(order)
