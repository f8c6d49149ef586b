"""Construction of a model: derivation, compilation, assembly at the means, and choice of independent equations."""

from __future__ import annotations

import math
import warnings
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
import sympy

from uqmbd.compiled import cached
from uqmbd.dynamics.assembly import (
    independent_rows,
    not_unique,
    positions,
    reaction_symbols,
    require_conditions,
)
from uqmbd.dynamics.control import loops_of, require_controllers
from uqmbd.dynamics.digest import digest_of
from uqmbd.dynamics.drawn_pose import size_of
from uqmbd.dynamics.equations import (
    FUSED_LIMIT,
    TIME,
    Blocks,
    Evaluators,
    Instance,
    Later,
    Layout,
    Model,
    ParameterMap,
    Statement,
    acting,
    angle_counters,
    break_times,
    compiled_conditions,
    excitations_of,
    first_coordinates,
    inputs_of_conditions,
    instances_of,
    limits_of,
    links,
    output_map,
    path_families,
    state_arguments,
)
from uqmbd.dynamics.integration import Prescribed, prescribed_by, timed, timed_tables
from uqmbd.dynamics.linear import index1_system, massless_direction
from uqmbd.dynamics.margins import margin_map
from uqmbd.dynamics.model_checks import Assembled, inputs_of_notices, model_findings
from uqmbd.dynamics.model_key import compute_model_key
from uqmbd.dynamics.observation import prepare
from uqmbd.dynamics.statics import scalar_map
from uqmbd.dynamics.undefined_parameter import not_finite
from uqmbd.errors import AssemblyError, RedundantConstraintWarning, StudyError
from uqmbd.mechanism import (
    Component,
    CoordinateSet,
    HeldStates,
    Mechanism,
    Output,
    Spline,
    carrier_name,
    names_of_motion,
)
from uqmbd.typing import Array, Index

__all__ = ["build", "kinematic_model"]


def kinematic_model(mechanism: Mechanism, time: float = 0.0) -> Model:
    """Return the part of a model for assembly, with independent equations chosen at the means; `time` in s.

    The model has no residual, Jacobian or outputs.  Raises `uqmbd.AssemblyError` if the mechanism cannot be assembled
    at the means.
    """
    return _kinematics(mechanism, time, ("acceleration",))[0]


def constraining(mechanism: Mechanism) -> tuple[str, ...]:
    """Return the names of components with constraints, even if the mechanism cannot be assembled."""
    instances = instances_of(_all(mechanism), mechanism.space)
    return tuple(i.component.name for i in instances if i.type.labels)


def _all(mechanism: Mechanism) -> list[Component]:
    """Return all objects with terms: bodies, components, counters of turns, and values of controllers."""
    held = [HeldStates(controller) for controller in mechanism.controllers.values()]
    return [*mechanism.all_components(), *angle_counters(mechanism), *held]


def reactions_not_unique(mechanism: Mechanism, time: float = 0.0) -> tuple[str, ...]:
    """Return reactions undetermined by redundant constraints at the means, such as ``A.reaction_force[0]``."""
    model, instances, blocks = _kinematics(mechanism, time)
    layout = model.layout
    if layout.constraints == layout.rank:
        return ()
    reactions = [Output(str(s), s, "") for s in reaction_symbols(mechanism, set(model.owners))]
    outputs = output_map(reactions, *_places(mechanism, layout, instances, blocks))
    parameters = model.parameters(mechanism.inputs.means[None, :])
    q, _ = positions(model, parameters[:, model.drawn], time, parameters)
    return not_unique(model, outputs, q[0], time, parameters[0])


def _places(mechanism: Mechanism, layout: Layout, instances: list[Instance], blocks: Blocks) -> tuple[Any, ...]:
    """Return the data for the compilation of outputs, except the outputs."""
    order = first_coordinates(mechanism)
    sizes = (layout.coordinates, layout.states, layout.constraints)
    return instances, list(blocks.places), order, mechanism.inputs.variables, sizes


def _kinematics(
    mechanism: Mechanism, time: float, others: tuple[str, ...] = ()
) -> tuple[Model, list[Instance], Blocks]:
    """Return the objects for assembly; include acceleration and drift only with start conditions or `others`."""
    movable = mechanism.coordinate_owners()
    if not movable:
        raise StudyError(f"mechanism {mechanism.name!r} has no bodies; add one with mechanism.body(...).")
    require_controllers(mechanism)
    instances = instances_of(_all(mechanism), mechanism.space)
    order, numbers = first_coordinates(mechanism), {name: k for k, name in enumerate(mechanism.bodies)}
    inputs = mechanism.inputs
    size, n = mechanism.space.size, sum(len(x.q) for x in movable)
    sets = [x for x in movable if isinstance(x, CoordinateSet)]
    equations = tuple(f"{i.component.name}: {label}" for i in instances for label in i.type.labels)
    owners = tuple(i.component.name for i in instances for _ in i.type.labels)
    nonholonomic = np.flatnonzero([not holonomic for i in instances for holonomic in i.type.holonomic])
    norms = np.flatnonzero([i.type.owns for i in instances for _ in i.type.labels])
    cosines = tuple(f"{i.component.name}: {label}" for i in instances for label in i.type.cosine_labels)

    expressions: list[sympy.Expr] = [p for i in instances for p in i.parameters]
    count = len(expressions)
    expressions += [x for body in mechanism.bodies.values() for x in body.pose.q]
    expressions += [x for one in sets for x in one.initial]
    drawn = np.arange(count, count + n)
    statements: list[Statement] = []
    held: list[int] = []
    for k, body in enumerate(mechanism.bodies.values()):
        if body.pose.hold:
            held += range(k * size, (k + 1) * size)
        d = mechanism.space.dimension
        parts = (
            ("velocity", body.pose.velocity, range(d)),
            ("angular_velocity", body.pose.angular_velocity, range(d, size)),
        )
        for quantity, stated, coordinates in parts:
            if stated is not None:
                where = np.arange(len(expressions), len(expressions) + len(stated))
                statements.append(Statement(body.name, quantity, np.array(coordinates) + k * size, where))
                expressions += stated
    for one in sets:
        for k, (name, declared) in enumerate(one.declared.items()):
            if declared.rate is not None:
                at, place = np.array([order[one.name] + k]), np.array([len(expressions)])
                statements.append(Statement(f"{one.name}: {name}", "velocity", at, place))
                expressions.append(declared.rate)
    breaks = np.arange(len(expressions), len(expressions) + len(_breaks(instances)))
    expressions += _breaks(instances)
    of_conditions = inputs_of_conditions(mechanism)
    conditioned = np.arange(len(expressions), len(expressions) + len(of_conditions))
    expressions += of_conditions
    limits, tensors = limits_of(mechanism, expressions)

    none = np.zeros(0, dtype=np.int64)
    every = np.arange(len(equations), dtype=np.int64)
    layout = Layout(
        coordinates=n,
        states=sum(len(i.type.states) for i in instances),
        constraints=len(equations),
        kept=every,
        frozen=none,
        active=every,
        nonholonomic=nonholonomic,
        held=sum(len(i.type.states) for i in instances if isinstance(i.component, HeldStates)),
    )
    conditioned_kinds = ("acceleration", "drift") if mechanism.conditions else ()
    kinds = dict.fromkeys(("position", "velocity", "initial", *others, *conditioned_kinds))
    blocks = Blocks.of(instances, order)
    model = Model(
        name=mechanism.name,
        time=time,
        layout=layout,
        bodies=tuple(mechanism.bodies),
        size=size,
        dimension=mechanism.space.dimension,
        equations=equations,
        owners=owners,
        norms=norms,
        cosines=cosines,
        inputs=inputs.names,
        parameters=ParameterMap.of(expressions, inputs.variables),
        drawn=drawn,
        statements=tuple(statements),
        held=np.array(held, dtype=np.int64),
        breaks=breaks,
        links=links(instances, numbers),
        acting=acting(instances, numbers),
        turned=tuple(i.component.name for i in instances if i.component.prescribed_angle),
        length=size_of(mechanism) or 1.0,
        own=tuple((one.name, name, declared.units) for one in sets for name, declared in one.declared.items()),
        largest=tuple(math.inf if x.largest is None else x.largest for one in sets for x in one.declared.values()),
        fastest=tuple(
            (i.component.name, numbers[carrier], float(bound))
            for i in instances
            for role, bound in i.component.largest_speeds().items()
            if (carrier := str(carrier_name(i.component.attached[role]))) in numbers  # the ground does not turn
        ),
        limits=limits,
        tensors=tensors,
        evaluators=Evaluators({kind: blocks.evaluator(kind, layout, count, fuse=False) for kind in kinds}),
    )
    parameters = model.parameters(inputs.means[None, :])
    if not np.isfinite(parameters).all():
        raise StudyError(
            f"mechanism {mechanism.name!r}: {not_finite(mechanism, model, instances, expressions, parameters[0])}. "
            "Expected a finite number there; check the expression and the distributions of its inputs."
        )
    q, messages = positions(model, parameters[:, drawn], time, parameters)
    if messages[0]:
        raise AssemblyError(f"mechanism {mechanism.name!r} cannot be assembled: {messages[0]}")
    state = state_arguments(time, q, np.zeros((1, layout.states)), np.zeros_like(q))
    gradient = model.evaluate("position", state, parameters)["phi_q"][0]
    gradient[nonholonomic] = model.evaluate("velocity", state, parameters)["d"][0][nonholonomic]
    kept, _ = independent_rows(gradient, model.norms, nonholonomic)
    frozen, holding = _frozen(model, instances, kept, gradient)
    active = np.setdiff1d(kept, holding)
    model = replace(model, layout=replace(layout, kept=kept, frozen=frozen, active=active))
    if mechanism.conditions:
        sizes = (layout.coordinates, layout.states, layout.constraints)
        conditions = compiled_conditions(mechanism, instances, list(blocks.places), order, sizes, conditioned)
        model = replace(model, conditions=conditions)
        require_conditions(f"mechanism {mechanism.name!r}", model, time, parameters)
    return model, instances, blocks


def _frozen(model: Model, instances: list[Instance], kept: Index, gradient: Array) -> tuple[Index, Index]:
    """Find coordinates that constraints fix at one value, and the equations of these constraints.

    An equation fixes a coordinate if it contains no time, no auxiliary state and no other coordinate that is not yet
    fixed. Only the structure of the equations is used; the equation must be independent at the means.
    """
    contains: dict[int, set[int]] = {int(k): set() for k in kept}
    for target in model.evaluators["position"].targets:
        if target[0] == "phi_q" and target[1] in contains:
            contains[target[1]].add(target[2])
    moving = {x[1] for x in model.evaluators["velocity"].targets if x[0] == "phi_t"}
    first = 0
    for instance in instances:
        count = len(instance.type.constraints)
        if instance.type.states:
            moving |= set(range(first, first + count))
        first += count
    frozen: dict[int, int] = {}
    while True:
        found = {
            row: next(iter(left))
            for row, columns in contains.items()
            if row not in frozen.values() and row not in moving and len(left := columns - set(frozen)) == 1
        }
        found = {row: column for row, column in found.items() if abs(gradient[row, column]) > 1e-6}
        if not found:
            break
        row, column = min(found.items())
        frozen[column] = row
    held = sorted(frozen)
    return np.array(held, dtype=np.int64), np.array(sorted(frozen.values()), dtype=np.int64)


def _breaks(instances: list[Instance]) -> list[sympy.Expr]:
    found: list[sympy.Expr] = []
    for instance in instances:
        block = instance.type
        timed = [e for e in block.expressions if e.has(sympy.Piecewise, Spline) and (e.has(TIME) or block.quantities)]
        values = {sympy.Symbol(f"_p{k}", real=True): p for k, p in enumerate(instance.parameters)}
        for root in break_times(timed, TIME, block.whole):
            value = root.xreplace(values)
            if value not in found and not any(str(s).startswith("_") for s in value.free_symbols):
                found.append(value)
    return found


def _corners(instance: Instance) -> bool:
    """Return whether forces of an instance have corners that depend on its state instead of time only."""
    block = instance.type
    kinds = (sympy.Piecewise, sympy.Max, sympy.Min, sympy.Abs, sympy.sign, sympy.Heaviside)
    corners = [x for e in block.expressions if e.has(*kinds) for x in e.atoms(*kinds)]
    corners += [x for e in block.expressions for x in e.atoms(Spline) if x.table.corners]
    moving = {"_q", "_v", "_s"}
    named = {
        s for s, kind, e in block.quantities if kind == "rate" or any(x.name[:2] in moving for x in e.free_symbols)
    }
    for s, _, e in block.quantities:
        if e.free_symbols & named:
            named.add(s)
    return any(s.name[:2] in moving or s in named for x in corners for s in x.free_symbols)


def build(mechanism: Mechanism, time: float = 0.0, *, fuse: bool | None = None, quiet: bool = False) -> Model:
    """Return the complete model of a mechanism at an initial time in s, from the cache if possible.

    The cache stores models by the digest of their parts.  With `fuse`, residual and Jacobian are one kernel each; this
    is the default up to `FUSED_LIMIT` unknowns.  A `uqmbd.RedundantConstraintWarning` names dependent equations; with
    `quiet` the model only contains a finding for the caller.  Raises `uqmbd.AssemblyError` or `uqmbd.StudyError` if the
    mechanism cannot be assembled at the means, or no force can accelerate a body.
    """
    key = compute_model_key(mechanism, time, fuse, rows=inputs_of_notices(mechanism))
    make = partial(_built, mechanism, time, fuse)
    model: Model = make() if key is None else cached(("model", key), make)
    for finding in () if quiet else model.findings:
        if finding.category is RedundantConstraintWarning:
            warnings.warn(f"{finding.text}.", RedundantConstraintWarning, stacklevel=3)
    prepare(model)
    return model


def _built(mechanism: Mechanism, time: float, fuse: bool | None) -> Model:
    """Return the complete model of a mechanism from the terms of its components."""
    model, instances, blocks = _kinematics(mechanism, time)
    layout = model.layout
    count = model.block_parameters
    fuse = layout.unknowns <= FUSED_LIMIT if fuse is None else fuse
    events = tuple((i.component.name, e.label, len(e.directions)) for i in instances for e in i.type.events)
    _require_no_motion(mechanism, instances)
    kinds = ("acceleration", "drift", *(("contact",) if events else ()))
    made = {kind: blocks.evaluator(kind, layout, count, fuse=fuse) for kind in kinds}
    evaluators = Evaluators({**model.evaluators.made, **made}, Later.of(blocks, layout, count, fuse=fuse))
    places = _places(mechanism, layout, instances, blocks)
    outputs, controls = output_map(list(mechanism.outputs.values()), *places), loops_of(mechanism, *places)
    model = replace(
        model,
        rough=any(_corners(i) for i in instances),
        excitations=len(excitations_of(instances)),
        paths=path_families(instances, mechanism.inputs.variables),
        digest=digest_of(mechanism, instances, [loop.digest for loop in controls]),
        evaluators=evaluators,
        events=events,
        given_loads=tuple(e.dry for i in instances for e in i.type.events),
        prescribed=_prescribed(mechanism, model),
        timed=timed(instances, mechanism.inputs.variables),
        tables=timed_tables(instances, mechanism.inputs.variables),
        outputs=outputs,
        controls=controls,
        speeds_commanded=any(i.type.held > i.type.coupled and i.type.constraints for i in instances),
        scalars=scalar_map(list(mechanism.scalars.values()), *places),
        margins=margin_map(mechanism, places),
    )
    parameters = model.parameters(mechanism.inputs.means[None, :])
    drawn = parameters[:, model.drawn]
    q, _ = positions(model, drawn, time, parameters, layout.independent_holonomic)
    model = replace(model, system=index1_system(model, _typical_poses(model, q, time, parameters)))
    if layout.constraints > layout.rank:
        unsettled = not_unique(model, outputs, q[0], time, parameters[0])
        model = replace(model, outputs=replace(outputs, not_unique=unsettled))
    loose = massless_direction(model, q, np.zeros((1, layout.states)), time, parameters)
    if loose:
        remedy = "Give it mass and inertia, or hold it with a joint."
        if not loose.startswith("body"):
            remedy = "Add its kinetic energy to the terms of the component."
        raise StudyError(
            f"{loose} can be accelerated without any force: its mass or inertia is zero in a direction "
            f"in which it is free to move. {remedy}"
        )
    return replace(model, findings=model_findings(Assembled(mechanism, model, instances, parameters, drawn, q)))


def _require_no_motion(mechanism: Mechanism, instances: list[Instance]) -> None:
    """Raise if outputs or requirements need a motion, and an excitation has no values over time."""
    sampled = {path.source for i in instances for path in i.paths.values()}
    excited = [(i.component, c) for i in instances for c in i.excitations if c.source not in sampled]
    if not excited:
        return
    component, coefficient = excited[0]
    moving = names_of_motion(mechanism)
    if moving:
        raise StudyError(
            f"output {moving[0]!r} requires a simulated motion, but {type(component).__name__} {component.name!r} "
            f"contains {coefficient.source.source.name}({coefficient.argument}), a random process without sampled "
            "paths. Use outputs of the stationary response, such as a standard deviation, or replace the process by "
            "a function of uqmbd.t."
        )


def _prescribed(mechanism: Mechanism, model: Model) -> Prescribed | None:
    """Find the functions of time in parameters of components with constraints."""
    if not model.rheonomic:
        return None
    owners = set(model.owners)
    return prescribed_by([c for c in mechanism.all_components() if c.name in owners], mechanism.inputs.variables)


def _typical_poses(model: Model, q: Array, time: float, parameters: Array) -> tuple[Array, Array]:
    """Return arguments and parameters at the pose and near it, where no entry vanishes by chance."""
    shift = np.random.default_rng(0).uniform(0.1, 0.3, (2, *q.shape))
    near = np.concatenate([q, q + shift[0]])
    states = state_arguments(time, near, np.zeros((2, model.layout.states)), np.tile(shift[1], (2, 1)))
    return states, np.repeat(parameters, 2, axis=0)
