"""Poses of the bodies of a mechanism as functions of the germs, for the player: `pose_surrogate`, `packed_poses`.

The page contains the surrogate of one method; poses are functions of the same germs. If this surrogate is a single
polynomial chaos, the body coordinates at the frames of the motion are fitted by its terms (least squares). The fit uses
twice as many further realisations as there are terms, and another 16 realisations measure its error. The realisations
of the motion would be too few: twenty do not determine the 28 terms of order 2 of six inputs.

For other surrogates, the method runs once more with every body coordinate as an output. Poses then have the same
elements, events and phases as the surrogate, but the second run doubles the cost of the method. Poses are omitted if
their cost is a large part of the whole run.

Points in the frames of bodies are also functions of the inputs. Polynomials fit them without further realisations. The
displacements of points that move in their bodies, such as nodes of flexible bodies, are fitted with the poses.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import xarray as xr

from uqmbd.arguments import typechecked
from uqmbd.errors import StudyError
from uqmbd.plugins import InputTreatment, such_as
from uqmbd.report.charts import json_script
from uqmbd.report.live.surrogates import LARGEST, live_method, no_surrogate, packed_surrogate, with_surrogate
from uqmbd.report.mechanisms import integrated_poses, marked_points, moved_axes, observed_bodies, pose_names
from uqmbd.results import PolynomialChaos, propagator_nodes, surrogate
from uqmbd.results.chaos import Surrogate, least_squares, random_germs, spread_germs, surrogate_parts
from uqmbd.results.schema import labels
from uqmbd.typing import Array, Index

if TYPE_CHECKING:
    from uqmbd.propagation import Study
    from uqmbd.randomness import GermSpace

__all__ = ["live_poses", "packed_poses", "pose_surrogate", "with_poses"]


BUDGET = 1.0
"""Time that a run may always spend on realisations that only poses need, s."""

SHARE = 0.5
"""Largest ratio of the time for such realisations to the time of all methods; `BUDGET` applies if it is longer."""

FRAMES = 60
"""Default number of times of a motion."""

ORDER = 6
"""Maximum order of the polynomials of points; the order is lower with many inputs."""

TERMS = 500
"""Maximum number of terms of the polynomials of points."""

CHECKED = 16
"""Number of realisations that determine the stated error of poses."""

CHECKS = 32
"""Number of realisations that determine the stated error of points."""


def pose_surrogate(study: Study, method: str, frames: int = FRAMES, known: Surrogate | None = None) -> xr.DataTree:
    """Make surrogates of the poses of the bodies of a study, and of displacements of their points, for `packed_poses`.

    `method` is the label of a method with a surrogate. `frames` is the number of times, evenly spread over the study.
    `known` is the surrogate of the outputs. If it is a `PolynomialChaos`, the surrogates of poses have the same terms,
    and the method does not run again. Return a tree with the children ``coordinates`` and ``points``, which
    `uqmbd.results.surrogate` can read. Raise StudyError if the method makes no surrogate of all coordinates at all
    frames, or if realisations fail.
    """
    if isinstance(known, PolynomialChaos):
        chaos = _fitted(study, known, frames)
        parts, realisations = {"chaos": chaos.to_dataset()}, len(known.multi_index) * 2 + CHECKED
    else:
        parts, realisations = _fit_poses(study, method, frames)
    found = xr.DataTree(name="pose_surrogate")
    found.attrs |= {
        "method": method,
        "bodies": list(study.mechanism.bodies),
        "dimension": study.mechanism.space.dimension,
        "size": study.mechanism.space.size,
        "upright": int(study.mechanism.space.dimension == 1 and not study.mechanism.space.gravity[0].is_zero),
        "realisations": realisations,
    }
    count, moved = moved_axes(study)
    if moved:
        found.attrs |= {"moving": count, "moved_points": [n for n, _ in moved], "moved_axes": [k for _, k in moved]}
    for path, data in parts.items():
        found[f"coordinates/{path}"] = xr.DataTree(data)
    coordinates = surrogate(found.children["coordinates"])
    if [o.name for o in coordinates.labels.outputs] != pose_names(study):
        raise StudyError(f"The method {method!r} has no surrogate of all coordinates.")
    if len(np.asarray(coordinates.labels.times)) < frames:
        raise StudyError(f"The surrogates of {method!r} end before the last frame.")
    if marks := _points(study, coordinates):
        found["points/chaos"] = xr.DataTree(marks.to_dataset())
    return found


def _fitted(study: Study, known: PolynomialChaos, frames: int) -> PolynomialChaos:
    """Fit the terms of a polynomial chaos to poses and displacements in further realisations."""
    space, terms = known.space, known.multi_index
    germs = [spread_germs(space, _fit_size(terms), 2)[: _fit_size(terms)], random_germs(space, CHECKED, 3)]
    values = space.to_inputs(np.concatenate(germs))[:, _columns(study, space)]
    found, message = integrated_poses(study, frames, values)
    if not np.isfinite(found).all():
        failed = int((~np.isfinite(found).all(axis=(1, 2))).sum())
        raise StudyError(f"{failed} of {len(found)} realisations for poses failed: {message}")
    response = found.transpose(0, 2, 1)
    split = len(germs[0])
    coefficients = least_squares(response[:split], space.evaluate(germs[0], terms)).coefficients
    times = np.linspace(study.times[0], study.times[-1], frames)
    axes = labels(pose_names(study), list(known.labels.inputs), times)
    return PolynomialChaos(coefficients, terms, space, axes, germs[1], response[split:])


def _fit_size(terms: Index) -> int:
    return max(2 * len(terms), 4)


def _columns(study: Study, space: GermSpace) -> list[int]:
    """Return the indices of the inputs of a mechanism among the germs."""
    return [list(space.inputs).index(name) for name in study.mechanism.inputs.names]


def _fit_poses(study: Study, method: str, frames: int) -> tuple[dict[str, xr.Dataset], int]:
    """Run a method once more; return surrogates of the coordinates by node path, and the number of realisations."""
    node, names = observed_bodies(study, frames, method)
    if not surrogate_parts(node):
        raise StudyError(
            f"The method {method!r} has no surrogate, so there is no surrogate of the poses. Use a method that "
            f"computes one{such_as(InputTreatment.INTERPOLATE)}."
        )
    found = {}
    for part, (kind, data) in surrogate_parts(node).items():
        own = data.to_dataset()
        rows = [k for k, name in enumerate(own["output"].values) if name in names]
        if rows:
            found[f"composed/{part}/{kind}" if part else kind] = own.isel(output=rows)
    return found, int(node.attrs["realisations"])


@typechecked
def with_poses(tree: xr.DataTree, study: Study) -> tuple[xr.DataTree, str]:
    """Add surrogates of poses to results with a motion, as the node ``pose_surrogate``.

    Errors in this function do not end a run.

    Parameters
    ----------
    tree : xarray.DataTree
        Result of a study.
    study : Study
        The study.

    Returns
    -------
    tree : xarray.DataTree
        Result with the node, if it could be made.
    note : str
        Reason why the node is missing; otherwise empty.

    Examples
    --------
    >>> import chaospy, uqmbd
    >>> from uqmbd.report import with_motion
    >>> from uqmbd_collocation import Collocation
    >>> mechanism = uqmbd.Mechanism("stone", uqmbd.Line(gravity=uqmbd.RandomVariable("g", chaospy.Uniform(-10, -9))))
    >>> stone = mechanism.body("stone", mass=1)
    >>> mechanism.output("height", stone.position[0], units="m")
    >>> study = uqmbd.Study("falling", mechanism, [0, 1], [Collocation(order=1)])
    >>> tree, note = with_poses(with_motion(study.run(), study)[0], study)
    >>> note, tree["pose_surrogate"].attrs["bodies"]
    ('', ['stone'])
    """
    if "motion" not in tree.children:
        return tree, "The motion of the mechanism is unknown."
    extended = tree.copy()
    try:
        extended["pose_surrogate"] = _affordable(tree, study)
    except Exception as error:  # noqa: BLE001 - studies and plugins may raise anything; the results must remain
        note = str(error) if isinstance(error, StudyError) else f"{type(error).__name__}: {error}"
        extended["motion"].attrs["no_surrogate"] = note
        return extended, note
    return extended, ""


def _affordable(tree: xr.DataTree, study: Study) -> xr.DataTree:
    """Make the surrogates, or raise StudyError if they are impossible or would take too long."""
    method = live_method(tree)
    if not method:
        raise StudyError(no_surrogate())
    known = surrogate(with_surrogate(tree.children[method]))
    spent = {label: float(node.attrs.get("wall_time", np.inf)) for label, node in propagator_nodes(tree).items()}
    cost, allowed = spent[method], max(BUDGET, SHARE * sum(spent.values()))
    if isinstance(known, PolynomialChaos):
        cost *= (_fit_size(known.multi_index) + CHECKED) / max(float(tree.children[method].attrs["realisations"]), 1.0)
    if not cost <= allowed:
        raise StudyError(
            f"The realisations for the poses would take {cost:.3g} s; at most {allowed:.3g} s are allowed."
        )
    return pose_surrogate(study, method, tree.children["motion"].sizes["time"], known)


def live_poses(node: xr.DataTree, method: str, most: int = LARGEST) -> tuple[dict[str, Any] | None, str]:
    """Return surrogates of poses as data for the player of a page that has the sliders of `method`.

    `node` is the result of `pose_surrogate`; `method` is a label; `most` is the maximum number of characters of data.
    Return the data of `packed_poses` and an empty text. If the data are missing, return None and the reason.
    """
    if node.attrs.get("method") != method:
        return (
            None,
            f"The surrogates of the poses belong to {node.attrs.get('method')}; the page contains the surrogate of "
            f"{method}.",
        )
    try:
        data = packed_poses(node)
    except Exception as error:  # noqa: BLE001 - the node may come from anywhere; the mechanism is drawn without it
        return None, f"{type(error).__name__}: {error}"
    size = len(json_script(data))
    if size > most:
        return None, f"The surrogates of the poses take {size / 1e6:.1f} MB; the page has room for {most / 1e6:.1f} MB."
    return data, ""


def packed_poses(node: xr.DataTree) -> dict[str, Any]:
    """Return surrogates of poses as data of a page; `poses.js` evaluates them.

    `node` is the result of `pose_surrogate`. In the result, ``bodies`` contains names, and ``size`` is the length of
    the pose of a body. The first ``dimension`` numbers of a pose are the position, the others a quaternion (in the
    plane the cosine and sine of half the angle). ``upright`` is 1 for a line with gravity, which is drawn vertically;
    otherwise 0. ``moving`` is the number of points that move in their bodies. ``moved`` contains index and axis of each
    of their displacements, which follow the coordinates of the bodies. ``coordinates`` and ``points`` contain results
    of `packed_surrogate`; ``points`` is None if only bodies are drawn.
    """
    moved = [np.atleast_1d(node.attrs.get(name, [])) for name in ("moved_points", "moved_axes")]
    return {
        "bodies": [str(name) for name in np.atleast_1d(node.attrs["bodies"])],
        **{name: int(node.attrs[name]) for name in ("dimension", "size", "upright")},
        "moving": int(node.attrs.get("moving", 0)),
        "moved": [[int(n), int(axis)] for n, axis in zip(*moved, strict=True)],
        "coordinates": packed_surrogate(surrogate(node.children["coordinates"])),
        "points": packed_surrogate(surrogate(node.children["points"])) if "points" in node.children else None,
    }


def _points(study: Study, coordinates: Surrogate) -> PolynomialChaos | None:
    """Fit polynomials of the germs to points in the frames of bodies, and to radii; None without points."""
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
    points, radii = marked_points(study, inputs[:, _columns(study, space)])
    return np.concatenate([points, radii[..., None]], axis=-1).reshape(len(germs), -1)


def _terms(space: GermSpace) -> Index:
    order = next((n for n in range(ORDER, 1, -1) if len(space.basis(n)) <= TERMS), 1)
    return space.basis(order)
