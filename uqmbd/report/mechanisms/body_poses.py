"""Compute poses of bodies, of an assembled mechanism or in realisations of a motion, for pictures and animations.

The resulting dataset contains all data of the drawing. It can therefore be stored with results, and drawn without the
mechanism::

    pose (realisation, time, body, coordinate)   positions (m) and unit quaternions; realisation 0: at the means
    local (realisation, point, axis)             points in the frames of their bodies, m, and directions
    displacement (realisation, time, moved, axis)  of points that move in their bodies, m; moved_point (moved): indices
    inputs (realisation, input)                  values of the random variables
    point_kind, point_body, point_component, point_role (point)
    component_type, component_symbol, component_bodies (component)
"""

from __future__ import annotations

import copy
import json
import warnings
from collections.abc import Collection, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from uqmbd.errors import AssemblyError, RedundantConstraintWarning, StudyError, StudyWarning
from uqmbd.propagation import build_observed_model, input_point
from uqmbd.report.mechanisms.deformation import (
    coordinate_sets,
    displaced_points,
    displacement_entries,
    in_the_plane,
    rest_points,
)
from uqmbd.report.mechanisms.named_realisations import NamedRealisation
from uqmbd.report.mechanisms.pose_data import PoseData
from uqmbd.report.mechanisms.solids import collect_solids
from uqmbd.status import Status
from uqmbd.threads import one_thread
from uqmbd.typing import Array

if TYPE_CHECKING:
    import xarray as xr

    from uqmbd.dynamics import Model
    from uqmbd.mechanism import Body, Component, Mechanism, Space
    from uqmbd.propagation import Study

__all__ = [
    "coordinate_names",
    "displacement_names",
    "drawn_pose",
    "integrated",
    "marked_points",
    "motion",
    "motion_at",
    "observed_bodies",
    "stated_pose",
]


def drawn_pose(mechanism: Mechanism, values: Mapping[str, float] | None = None, time: float = 0.0) -> PoseData:
    """Return the pose of an assembled mechanism, or the given pose with the reason why the assembly failed.

    `mechanism` has at least one body. `values` are values of random variables by name; other variables are at their
    means. `time` is the initial time, s. The module describes the result, which has one realisation and one time. The
    attribute ``note`` states the reason if the mechanism is not assembled. Raise StudyError without a body, or for an
    invalid value.

    >>> import uqmbd
    >>> from uqmbd_joints import Revolute
    >>> mechanism = uqmbd.Mechanism("pendulum", uqmbd.Planar())
    >>> rod = mechanism.body("rod", mass=1, inertia=1, position=(0.6, 0))
    >>> pivot = mechanism.add(Revolute("pivot", mechanism.ground, rod, (0, 0), (-0.5, 0)))
    >>> [round(float(x), 6) for x in drawn_pose(mechanism).to_dataset()["pose"].sel(body="rod").squeeze()]
    [0.5, 0.0, 1.0, 0.0]
    """
    from uqmbd.dynamics import positions

    if not mechanism.bodies:
        raise StudyError(f"mechanism {mechanism.name!r} has no bodies to draw; add one with mechanism.body(...).")
    point = np.array([list(input_point(f"mechanism {mechanism.name!r}", mechanism, values).values())])
    model, owners = _kinematics(mechanism, time)
    q, note = _stated(mechanism, point), model if isinstance(model, str) else ""
    if not isinstance(model, str):
        parameters, equations = model.parameters(point), model.layout.independent_holonomic
        try:
            q, messages = positions(model, parameters[:, model.drawn], time, parameters, equations)
            note = messages[0]
        except AssemblyError as error:
            note = str(error)
    return _pose_data(mechanism, q[:, None, :], point, [time], owners, {"method": "", "note": note})


def stated_pose(mechanism: Mechanism, values: Mapping[str, float] | None = None, time: float = 0.0) -> PoseData:
    """Return the pose of a mechanism before the assembly, as stated in the definitions of its bodies.

    The arguments and the result are those of `drawn_pose`.

    >>> import uqmbd
    >>> mechanism = uqmbd.Mechanism("stone", uqmbd.Planar())
    >>> stone = mechanism.body("stone", mass=1, inertia=1, position=(0.6, 0))
    >>> pose = stated_pose(mechanism).to_dataset()["pose"].sel(body="stone", coordinate="x")  # single precision
    >>> round(float(pose.squeeze()), 6)
    0.6
    """
    point = np.array([list(input_point(f"mechanism {mechanism.name!r}", mechanism, values).values())])
    known, (_, owners) = {"method": "", "note": "given pose"}, _kinematics(mechanism, time)
    return _pose_data(mechanism, _stated(mechanism, point)[:, None, :], point, [time], owners, known)


def _kinematics(mechanism: Mechanism, time: float) -> tuple[Model | str, tuple[str, ...]]:
    """Return the model for assembly, or the reason why there is none, and the components with constraints.

    Poses of a mechanism share them, because their derivation takes half of the time of a pose.
    """
    from uqmbd.dynamics import constraining, kinematic_model

    def make() -> tuple[Model | str, tuple[str, ...]]:
        try:
            model = mechanism.remembered(("kinematics", time), lambda: kinematic_model(mechanism, time))
        except AssemblyError as error:
            return str(error), constraining(mechanism)
        return model, model.owners

    return mechanism.remembered(("drawn kinematics", time), make)


def _stated(mechanism: Mechanism, point: Array) -> Array:
    """Return the coordinates (K, coordinate) before the assembly at inputs (K, input)."""
    from uqmbd.dynamics import ParameterMap

    drawn = [x for body in mechanism.bodies.values() for x in body.pose.q]
    drawn += [x for one in coordinate_sets(mechanism) for x in one.initial]
    return ParameterMap.of(drawn, mechanism.inputs.variables)(point)


def motion_at(study: Study, values: Mapping[str, float] | None = None, frames: int = 60) -> PoseData:
    """Compute one motion of the bodies of a study, at values of random variables by name; others are at their means.

    The module describes the result, which has one realisation and `frames` times, evenly spread over the study. Raise
    AssemblyError if nothing can be drawn, with the reason.
    """
    mechanism = study.mechanism
    times = np.linspace(study.times[0], study.times[-1], frames)
    point = np.array([list(input_point(f"mechanism {mechanism.name!r}", mechanism, values).values())])
    with warnings.catch_warnings():
        # the check of the study reports this warning
        warnings.simplefilter("ignore", RedundantConstraintWarning)
        warnings.simplefilter("ignore", StudyWarning)
        q, message = integrated(study, times, point)
    if not np.isfinite(q).all(axis=-1).any():
        raise AssemblyError(f"mechanism {mechanism.name!r}: {message}")
    from uqmbd.dynamics import kinematic_model

    start = float(study.times[0])
    model = mechanism.remembered(("kinematics", start), lambda: kinematic_model(mechanism, start))
    return _pose_data(mechanism, q, point, times, model.owners, {"method": "", "note": "", "stopped": message})


def motion(
    study: Study,
    samples: int = 20,
    frames: int = 60,
    seed: int = 1,
    method: str | None = None,
    named: Sequence[NamedRealisation] = (),
) -> xr.Dataset:
    """Compute the motion of the bodies of a study at the means of the inputs and in further realisations.

    `study` has at least one output. `samples` is the number of realisations in addition to the means (0 without random
    inputs), and `seed` their seed. `frames` is the number of times, evenly spread over the study. `method` is the label
    of a propagator of the study. The first samples of the propagator, or samples of its polynomial chaos of all
    coordinates, are used. By default, realisations are integrated. `named` are realisations with a pose in the report.
    These realisations follow the means, and the attribute ``named`` lists them.

    The module describes the result. Failed realisations are omitted, and counted in the attribute ``failures``. Raise
    StudyError if a number is invalid, if the study lacks the method, or if it stores neither samples nor chaos. Raise
    AssemblyError or uqmbd.IntegrationError if the motion of every realisation fails.
    """
    for name, value, least in (("samples", samples, 0), ("frames", frames, 2)):
        if not isinstance(value, int) or isinstance(value, bool) or value < least:
            raise StudyError(f"motion of {study.name!r}: {name} is {value!r}; expected a whole number from {least} on.")
    if len(study.times) < 2:
        raise StudyError(f"motion of {study.name!r}: the study has no output times, so there is no motion.")
    times = np.linspace(study.times[0], study.times[-1], frames)
    means = study.mechanism.inputs.means[None, :]
    known = {"method": method or "", "seed": seed, "rtol": study.rtol, "integrator": study.integrator}
    with warnings.catch_warnings():
        # the run and the check of the study report this warning
        warnings.simplefilter("ignore", RedundantConstraintWarning)
        warnings.simplefilter("ignore", StudyWarning)
        if method is None or not len(study.mechanism.inputs):
            uniform = np.random.default_rng(seed).random((samples if means.size else 0, means.shape[1]))
            chosen = np.array([one.inputs for one in named]).reshape(len(named), means.shape[1])
            values = np.concatenate([means, chosen, study.mechanism.inputs.from_uniform(uniform)])
            q, message = integrated(study, times, values)
        else:
            at_means, message = integrated(study, times, means)
            values, q = _of_method(study, times, samples, seed, method)
            values, q = np.concatenate([means, values]), np.concatenate([at_means, q])
    good: NDArray[np.bool_] = np.asarray(np.isfinite(q).all(axis=(1, 2)))
    failures = int(np.count_nonzero(~good))
    good[0] = True  # the motion at the means is drawn up to the last computed time, even if it failed
    if not np.isfinite(q[good]).any():
        raise AssemblyError(f"mechanism {study.mechanism.name!r}: {message}")
    places = (np.cumsum(good) - 1).tolist()
    listed = [
        {"realisation": places[k], "name": one.name, "time": one.time, "pictured": one.pictured}
        for k, one in enumerate(named if method is None and means.size else (), 1)
        if good[k]
    ]
    if listed:
        known["named"] = json.dumps(listed)
    from uqmbd.dynamics import kinematic_model

    mechanism, start = study.mechanism, float(study.times[0])
    model = mechanism.remembered(("kinematics", start), lambda: kinematic_model(mechanism, start))
    found = _pose_data(mechanism, q[good], values[good], times, model.owners, {**known, "failures": failures})
    return found.to_dataset()


def integrated(study: Study, times: Array, values: Array) -> tuple[Array, str]:
    """Integrate coordinates (realisation, time, coordinate), NaN after failures; return also the first reason."""
    from uqmbd.dynamics import Ensemble, integrate

    model = build_observed_model(study.mechanism, float(study.times[0]), study.start, study.max_step, study.breaks)
    with one_thread():
        found = integrate(Ensemble(model, values), times, study.rtol, study.integrator)
    return found.states[..., : model.layout.coordinates], next((m for m in found.messages if m), "")


def _of_method(study: Study, times: Array, samples: int, seed: int, method: str) -> tuple[Array, Array]:
    """Return inputs (realisation, input) and coordinates (realisation, time, coordinate) from a method."""
    from uqmbd.results import surrogate
    from uqmbd.results.chaos import surrogate_parts

    coordinates = {name: x for body in study.mechanism.bodies.values() for name, x in _named_coordinates(study, body)}
    own = [x for one in coordinate_sets(study.mechanism) for x in one.q]
    coordinates |= {f"coordinate {k} of components, for pictures": x for k, x in enumerate(own)}
    node, names = _observed(study, times, method, coordinates), list(coordinates)
    if "samples" in node.children:
        data = node["samples"].to_dataset()
        data = data.isel(sample=np.flatnonzero(data["status"].values == Status.OK)[:samples])
        drawn = data["inputs"].sel(input=list(study.mechanism.inputs.names)).transpose("sample", "input")
        return drawn.values, data["response"].sel(output=names).transpose("sample", "time", "output").values
    if surrogate_parts(node):
        chaos = surrogate(node)
        inputs, response = chaos.sample(samples, seed)
        known = [output.name for output in chaos.labels.outputs]
        order = [i.name for i in chaos.labels.inputs]
        columns = [order.index(name) for name in study.mechanism.inputs.names]
        return inputs[:, columns], response[:, [known.index(name) for name in names], :].transpose(0, 2, 1)
    raise StudyError(
        f"study {study.name!r}: {method!r} stores neither samples nor a polynomial chaos; animate without --method."
    )


def observed_bodies(study: Study, times: Array, method: str) -> tuple[xr.DataTree, list[str]]:
    """Run a method of a study with coordinates of bodies and displacements of points as additional outputs.

    Return the result of the method, and the names of these outputs: `coordinate_names` of the bodies, then those of
    `displacement_names`.
    """
    mechanism = study.mechanism
    outputs = {name: x for body in mechanism.bodies.values() for name, x in _named_coordinates(study, body)}
    entries = displacement_entries(mechanism, float(study.times[0])).values()
    outputs |= dict(zip(displacement_names(mechanism, float(study.times[0])), entries, strict=True))
    return _observed(study, times, method, outputs), list(outputs)


def _named_coordinates(study: Study, body: Body) -> list[tuple[str, Any]]:
    return list(zip(coordinate_names(study.mechanism, body.name), body.q, strict=True))


def _observed(study: Study, times: Array, method: str, outputs: Mapping[str, Any]) -> xr.DataTree:
    """Return the result of a method of a study with additional outputs."""
    from uqmbd.propagation import Study

    propagators = {p.node_name: p for p in study.propagators}
    if method not in propagators:
        raise StudyError(f"study {study.name!r} has no method {method!r}; its methods are: {', '.join(propagators)}.")
    observed = copy.copy(study.mechanism)
    for name, expression in outputs.items():
        observed.output(name, expression)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # the run issues these warnings
        longest = study.max_step if np.isfinite(study.max_step) else None
        again = Study(
            study.name, observed, times, [], study.rtol, study.integrator, study.start, (), None, longest, study.breaks
        )
        return again.propagate(propagators[method])


def coordinate_names(mechanism: Mechanism, body: str) -> list[str]:
    """Return the output names for the coordinates of a body."""
    return [f"{name} of {body}, for pictures" for name in mechanism.space.coordinates]


def displacement_names(mechanism: Mechanism, time: float) -> list[str]:
    """Return the output names for the displacements of points that move in their bodies."""
    entries = displacement_entries(mechanism, time)
    return [f"displacement {axis} of point {n}, for pictures" for n, axis in entries]


def marked_points(mechanism: Mechanism, values: Array, time: float) -> tuple[Array, Array]:
    """Return the drawn points in body frames at inputs (K, d): points (K, N, axes) and radii (K, N), m.

    Points that move in their bodies are at zero coordinates of components.
    """
    from uqmbd.dynamics import ParameterMap
    from uqmbd.mechanism import collect_skeleton

    variables = mechanism.inputs.variables
    marks = collect_skeleton(mechanism, time)
    local = ParameterMap.of(rest_points(mechanism, marks), variables)(values)
    radii = ParameterMap.of([mark.radius for mark in marks], variables)(values)
    local = local.reshape(len(values), len(marks), mechanism.space.dimension)
    return in_the_plane(mechanism, local), radii.reshape(len(values), len(marks))


def _pose_data(
    mechanism: Mechanism,
    q: Array,
    values: Array,
    times: ArrayLike,
    owners: Collection[str],
    attrs: Mapping[str, Any],
) -> PoseData:
    """Store poses (realisation, time, coordinate) and properties of the bodies together."""
    from uqmbd.mechanism import carrier_name, collect_skeleton
    from uqmbd.results.schema import fixed_width

    space, inputs = mechanism.space, mechanism.inputs
    d, coordinates = space.dimension, list(space.coordinates)
    count = len(mechanism.bodies)
    pose = q[..., : count * space.size].reshape(*q.shape[:2], count, space.size).copy()
    if space.turns:
        pose[..., d:] /= np.linalg.norm(pose[..., d:], axis=-1, keepdims=True)
    marks = collect_skeleton(mechanism, float(np.asarray(times)[0]))
    local, radii = marked_points(mechanism, values, float(np.asarray(times)[0]))
    moved = displaced_points(mechanism, marks, q, values, local)
    components = list(mechanism.components.values())
    if d == 1:
        d, coordinates, pose = 2, ["x", "y"], in_the_plane(mechanism, pose)
    roles = {
        "point_kind": [m.kind for m in marks],
        "point_body": [m.body for m in marks],
        "point_component": [m.component for m in marks],
        "point_role": [m.role for m in marks],
    }
    kinds = {
        "component_type": [type(c).__name__ for c in components],
        "component_symbol": [symbol_of(c, space, constrains=c.name in owners) for c in components],
        "component_bodies": ["/".join(carrier_name(c.attached[b]) for b in c.bodies) for c in components],
    }  # names never contain a slash
    data: dict[str, Any] = {
        "pose": (
            ("realisation", "time", "body", "coordinate"),
            pose.astype(np.float32),
            {"comment": "position of the body frame's origin, m, and unit quaternion, body to world, scalar first"},
        ),
        "local": (("realisation", "point", "axis"), local, {"units": "m"}),
    }
    if any(mark.radius != 0 for mark in marks):
        data["point_radius"] = (("realisation", "point"), radii, {"units": "m"})
    data |= {name: ("point", fixed_width(texts)) for name, texts in roles.items()}
    data |= collect_solids(mechanism, marks) | moved
    if components:
        data |= {name: ("component", fixed_width(texts)) for name, texts in kinds.items()}
    coords: dict[str, Any] = {
        "time": ("time", np.asarray(times, dtype=float), {"units": "s"}),
        "body": list(mechanism.bodies),
        "coordinate": coordinates,
        "axis": list("xyz"[:d]),
    }
    if components:
        coords["component"] = list(mechanism.components)
    if len(inputs):
        data["inputs"] = (("realisation", "input"), values)
        coords |= {"input": list(inputs.names), "input_units": ("input", fixed_width(inputs.units))}
    return PoseData.of(data, coords, {"mechanism": mechanism.name, "space": space.name, **attrs})


def symbol_of(component: Component, space: Space, *, constrains: bool) -> str:
    """Return the symbol that a component defines, or a symbol derived from its parameters and attachments."""
    from uqmbd.mechanism import t

    found = component.symbol
    if found == "rod" and any(t in getattr(x, "free_symbols", ()) for x in component.values.values()):
        found = "driver"
    if found == "spring" and component.values.get("stiffness") == 0 and component.values.get("damping"):
        found = "damper"
    if found:
        # in a space without rotation, a weld is drawn as a hinge and a slide as a line
        found = found if space.turns else {"weld": "hinge", "slide": "line"}.get(found, found)
        return "hinge" if found == "ball" and space.dimension == 2 else found
    if constrains:
        return ""
    kinds = [parameter.kind for key, parameter in component.parameters().items() if key in component.values]
    if kinds.count("point") >= 2:
        return "spring"
    if len(component.bodies) == 1:
        return "torque" if "moment" in kinds else "force" if "vector" in kinds else ""
    return "coil" if "turning_axis" in kinds else ""
