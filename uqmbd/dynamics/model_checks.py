"""Checks of an assembled mechanism; the checks run once, and the model stores their findings.

A new check is a function from `Assembled` to findings, listed in `CHECKS`.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import sympy

from uqmbd.dynamics.assembly import dropped_in_dead_centre, positions
from uqmbd.dynamics.control import unused_commands
from uqmbd.dynamics.drawn_pose import apart, drawn_points, extent_of, moved
from uqmbd.dynamics.equations import TIME, Instance, Model, ParameterMap, first_coordinates, plain
from uqmbd.dynamics.margins import undetermined_margins
from uqmbd.errors import Finding, RedundantConstraintWarning, Severity
from uqmbd.mechanism import (
    AngleSymbol,
    Component,
    Mark,
    Mechanism,
    angles_in,
    find_unit_problems,
    joint_frames,
    nominal,
    relative_quaternion,
    t,
)
from uqmbd.typing import Array

__all__ = ["Assembled", "inputs_of_notices", "model_findings"]


FAR = 1.0
"""Displacement of a body by assembly, relative to the size of the mechanism, above which a note becomes a warning."""

TURNED = np.pi / 4
"""Rotation in rad of a body by the assembly, above which a note becomes a warning."""

DEEP = 0.1
"""Depth of a contact of points, in sizes of the mechanism, above which a note becomes a warning."""

REALISATIONS = 256
"""Number of realisations checked for drivers with initial angles over half a turn from the given pose."""

LEAST = 1.0
"""Least assumed size of a mechanism, m."""

SPREAD = 10.0
"""Largest plausible radius of gyration of a body, in extents of the body; a dumb-bell has 0.5."""

SCALES = 1e4
"""Largest plausible ratio of two lengths of a mechanism."""

NAMED = 40
"""Largest number of redundant equations in a finding; `uqmbd.check` lists all of them."""


@dataclass(frozen=True)
class Assembled:
    """Assembled mechanism at the means of its inputs."""

    mechanism: Mechanism
    model: Model
    instances: Sequence[Instance]  # components, in the order of the parameters
    parameters: Array  # (1, parameter)
    drawn: Array  # (1, coordinate): given pose
    pose: Array  # (1, coordinate): at the start of the motion

    @cached_property
    def first(self) -> dict[str, int]:
        """Index of the first coordinate of each body and component, by name."""
        return first_coordinates(self.mechanism)

    @cached_property
    def places(self) -> dict[str, list[tuple[Mark, Array]]]:
        """Known points of each body in the given pose, world frame, m."""
        return drawn_points(self.mechanism)

    @cached_property
    def size(self) -> float:
        """Largest extent of the given pose, m."""
        return extent_of([place for found in self.places.values() for _, place in found])

    def values(self) -> Iterator[tuple[Instance, list[float]]]:
        """Yield each component with its parameters."""
        first = 0
        for instance in self.instances:
            chosen = self.parameters[0, first : first + len(instance.parameters)]
            first += len(instance.parameters)
            yield instance, chosen.tolist()


def model_findings(assembled: Assembled) -> tuple[Finding, ...]:
    """Return the findings of all checks of an assembled mechanism."""
    return tuple(finding for check in CHECKS for finding in check(assembled))


def _redundant(a: Assembled) -> Iterator[Finding]:
    """Yield equations that depend on others, in every pose or only in the given pose."""
    model = a.model
    redundant = np.setdiff1d(np.arange(model.layout.constraints), model.layout.kept)
    if not len(redundant):
        return
    names = ", ".join(repr(model.equations[k]) for k in redundant[:NAMED])
    more = f" and {len(redundant) - NAMED} more" if len(redundant) > NAMED else ""
    effect = dropped_in_dead_centre(model, a.parameters, model.time)
    effect = effect or "The motion is not affected; some reactions are not unique (`uqmbd check` names them)."
    message = (
        f"mechanism {model.name!r}: {len(redundant)} of {model.layout.constraints} constraint equations "
        f"are redundant and omitted: {names}{more}"
    )
    where = f"mechanism {model.name!r}"
    yield Finding(Severity.WARNING, where, message, effect.removesuffix("."), RedundantConstraintWarning)


def _moved(a: Assembled) -> Iterator[Finding]:
    """Yield bodies that assembly moved from the given pose, with a warning for large moves and a note for others."""
    found = [m for m in moved(a.mechanism, a.model, a.size) if not m.coordinate]
    far = [m for m in found if m.turn > TURNED or m.distance > FAR * a.size + 1e-9]
    near = [m for m in found if m not in far]
    for severity, some in ((Severity.WARNING, far), (Severity.NOTE, near)):
        if some:
            bodies, its = ("bodies", "their given poses") if len(some) > 1 else ("body", "its given pose")
            yield Finding(
                severity,
                f"{bodies} {', '.join(repr(m.body) for m in some)}",
                f"mechanism {a.mechanism.name!r}: assembly moved {bodies} {', '.join(map(str, some))} from {its}",
                "Change position= and angle= towards the intended pose (uqmbd check --figure shows the mechanism)",
            )


def _changed_coordinates(a: Assembled) -> Iterator[Finding]:
    """Yield coordinates of components whose stated initial values the assembly changed."""
    if a.model.own and (found := [m for m in moved(a.mechanism, a.model, a.size) if m.coordinate]):
        several = len(found) > 1
        yield Finding(
            Severity.WARNING,
            f"coordinate{'s' * several} {', '.join(repr(m.body) for m in found)}",
            f"mechanism {a.mechanism.name!r}: assembly changed the initial value{'s' * several} of coordinate"
            f"{'s' * several} {', '.join(map(str, found))}",
            "State initial values that satisfy the constraints and start conditions",
        )


SPUN, PARTS = 2.0, 24
"""Number of turns below which an angle is only a note; multiples of 1/PARTS of a turn are also only notes."""


def _turned(a: Assembled) -> Iterator[Finding]:
    """Yield bodies with given angles over one turn, for example because of degrees instead of radians."""
    for name, body in a.mechanism.bodies.items():
        angle = body.pose.angle
        if not getattr(angle, "is_number", True) or abs(float(angle)) <= 2 * math.pi:
            continue
        shown, turns = f"{float(angle):g}", abs(float(angle)) / (2 * math.pi)
        # a number intended in radians is small or a simple fraction of a turn
        meant = turns < SPUN or abs(PARTS * turns - round(PARTS * turns)) < 1e-6
        yield Finding(
            Severity.NOTE if meant else Severity.WARNING,
            f"body {name!r}",
            f"body {name!r} has the angle {shown} rad, {turns:.3g} turns",
            f"Write degrees as math.radians({shown})",
        )


def _apart(a: Assembled) -> Iterator[Finding]:
    """Yield bodies without a connection to the ground, if there are components."""
    for names in apart(a.mechanism) if a.mechanism.components else ():
        every = ", ".join(map(repr, names))
        if len(names) == 1:
            message = f"body {every} is not connected: no component connects it to another body or to the ground"
        else:
            message = f"bodies {every} are connected with each other, but not with the ground"
        yield Finding(Severity.NOTE, f"{'body' if len(names) == 1 else 'bodies'} {every}", message)


def _spread(a: Assembled) -> Iterator[Finding]:
    """Yield bodies with a radius of gyration above all known extents, for example by wrong units of the inertia."""
    for name, body in a.mechanism.bodies.items():
        known = a.places.get(name, [])
        reach = max((abs(float(nominal(mark.radius))) for mark, _ in known), default=0.0)
        extent = max(extent_of([place for _, place in known]), 2 * reach)
        mass, *moments = (float(nominal(x)) for x in (body.terms.values["mass"], *(body.terms.values["inertia"] or ())))
        if not extent or not moments or mass <= 0:
            continue
        gyration = math.sqrt(max(0.0, *moments[:3]) / mass)
        # points of a body, such as axle and centre of mass of a rotor, may be close compared with the mechanism
        if gyration > max(SPREAD * extent, a.size):
            yield Finding(
                Severity.NOTE,
                f"body {name!r}",
                f"body {name!r} has a radius of gyration of {gyration:.3g} m, {gyration / extent:.2g} times the extent "
                f"of the points that are given for it, {extent:.3g} m",
                "Check the units of its mass (kg), inertia (kg m^2) and points (m)",
            )


def _scales(a: Assembled) -> Iterator[Finding]:
    """Yield lengths that differ by orders of magnitude, for example because of millimetres instead of metres."""
    lengths = {f"body {name!r}": extent_of([place for _, place in found]) for name, found in a.places.items()}
    lengths = {name: length for name, length in lengths.items() if length > 0}
    lengths |= {f"mechanism {a.mechanism.name!r}": a.size} if a.size > 0 else {}
    if not lengths:
        return
    (short, least), (long, most) = (pick(lengths.items(), key=lambda x: x[1]) for pick in (min, max))
    if most > SCALES * least:
        yield Finding(
            Severity.NOTE,
            short,
            f"the points given for {short} extend over {least:.3g} m, and the points given for {long} over "
            f"{most:.3g} m. These lengths differ by more than a factor of {SCALES:g}",
            "Check the units of its points: all lengths are in metres",
        )


def _units(a: Assembled) -> Iterator[Finding]:
    """Yield inconsistent units, for which declarations have already warned."""
    for sentence in find_unit_problems(a.mechanism):
        yield Finding(Severity.WARNING, sentence.partition(": ")[0], sentence.removesuffix("."), category=None)


def _uncounted_turns(a: Assembled) -> Iterator[Finding]:
    """Yield drivers with initial angles that differ from counted angles by whole turns.

    Counted angles start within half a turn of the given pose.  A driver with an angle as a function of time starts at
    the value of the function. A driver that follows other joints starts at its value in the assembled pose.
    """
    mechanism, model = a.mechanism, a.model
    seen = [x for o in mechanism.outputs.values() for x in o.expression.free_symbols]
    if not (model.layout.states or any(isinstance(x, AngleSymbol) for x in seen)):
        return
    drivers = [x for x in mechanism.all_components() if x.prescribed_angle and not _turns_are_stated(mechanism, x)]
    starts = [(x, *angles) for x, angles in zip(drivers, _starts(mechanism, model, drivers), strict=True)]
    for component, angles, poses in starts:
        far = np.abs(angles - poses) > np.pi * (1 + 1e-9)
        if not far.any():
            continue
        share = "" if far.all() else f" in {100 * far.mean():.2g} % of the realisations"
        advice = "Give the body this angle, or state" if model.dimension == 2 else "State"
        followed = " and ".join(map(str, _followed(component)))
        others = f". State {followed} as well, which the driver follows" if followed else ""
        yield Finding(
            Severity.WARNING,
            f"driver {component.name!r}",
            f"mechanism {mechanism.name!r}: driver {component.name!r} starts at {angles[far][0]:.4g} rad{share}, more "
            f"than half a turn from the angle of the given pose, {poses[far][0]:.4g} rad; angles of bodies and joints, "
            "and springs, do not count the whole turns between these two angles",
            f"{advice} the turns by mechanism.start(joint.angle, value), with the value at which the driver starts"
            f"{others}",
        )


def _turns_are_stated(mechanism: Mechanism, component: Component) -> bool:
    """Return whether start conditions contain an angle of the driven bodies, and all angles that the driver follows.

    A condition on a follower alone is not sufficient, because it moves the followed body.
    """
    conditions = [c for c in mechanism.conditions.values() if not c.of_velocities]
    stated, followed = angles_in([c.residual for c in conditions]), _followed(component)
    bodies = [component.attached[role] for role in ("body_i", "body_j")]
    driven = [x for x in stated if x not in followed and any(getattr(s, "owner", None) in bodies for s in x.states)]
    return bool(driven) and all(x in stated for x in followed)


def _followed(component: Component) -> list[AngleSymbol]:
    """Return the counted angles in the expression of a driver's angle."""
    return angles_in([component.values[component.prescribed_angle]])


def _starts(mechanism: Mechanism, model: Model, drivers: Sequence[Component]) -> list[tuple[Array, Array]]:
    """Return the initial and the given angles of drivers in rad, in the checked realisations."""
    if not drivers:
        return []
    rows = inputs_of_notices(mechanism)
    places = [x for one in mechanism.coordinate_owners() for x in one.q]
    expressions = [(_angle_at_start(x, model.time), plain(_drawn_angle(x))) for x in drivers]
    symbols, known = list(mechanism.inputs.variables), rows
    if any(start.free_symbols & set(places) for start, _ in expressions):
        parameters = model.parameters(rows)
        # omit start conditions: they move followed joints and their followers together, with counted turns
        drawn, free = parameters[:, model.drawn], replace(model, conditions=None)
        q, messages = positions(free, drawn, model.time, parameters, model.layout.independent_holonomic)
        assembled = np.flatnonzero([not message for message in messages])
        symbols, known = [*symbols, *places], np.concatenate([rows, q], axis=1)[assembled]
    values = [ParameterMap.of(pair, symbols)(known) for pair in expressions]
    return [(x[:, 0], x[:, 1]) for x in values]


def _angle_at_start(component: Component, time: float) -> sympy.Expr:
    """Return the initial angle of a driver in rad, from inputs, coordinates and initial values of followed angles."""
    counted = {
        x: x.angle.at_start(x.angle.whole(x.angle.cosine), x.angle.whole(x.angle.sine), x.angle.near)
        for x in _followed(component)
    }
    angle = plain(component.values[component.prescribed_angle]).xreplace(counted)
    return plain(angle.xreplace({t: sympy.Float(time)}))


def inputs_of_notices(mechanism: Mechanism) -> Array:
    """Return the input values for checks of the mechanism, shape (K, input): the means, and further points.

    Further points, spread over the inputs, are included only if a component prescribes an angle.
    """
    inputs = mechanism.inputs
    means = inputs.means[None, :]
    if not len(inputs) or not any(component.prescribed_angle for component in mechanism.all_components()):
        return means
    from scipy.stats import qmc

    points = qmc.Halton(len(inputs), scramble=False).random(REALISATIONS + 1)[1:]
    return np.concatenate([means, inputs.from_uniform(points)])


def _drawn_angle(component: Component) -> sympy.Expr:
    """Return the given angle between two bodies in rad, defined as by rotation drivers; in space, at the means."""
    i, j = (component.drawn_frame(body) for body in ("body_i", "body_j"))
    if i.space.dimension == 2:
        return component.drawn_angle()
    frames = joint_frames(component.values["axis_i"], component.values["axis_j"])
    r = relative_quaternion(*(f.attitude(x) for f, x in zip((i, j), frames, strict=True)))
    half = float(np.arctan2(float(nominal(r[-1])), float(nominal(r[0]))))
    return sympy.Float((2 * half + np.pi) % (2 * np.pi) - np.pi)


def _deep_contacts(a: Assembled) -> Iterator[Finding]:
    """Yield contacts with a large initial depth."""
    if not any(instance.type.gaps for instance in a.instances):
        return
    model, size = a.model, max(LEAST, a.size)
    order = a.first
    for instance, numbers in a.values():
        if not instance.type.gaps:
            continue
        local = np.concatenate([a.pose[0][order[x.name] :][: len(x.q)] for x in instance.owners])
        values = {sympy.Symbol(f"_p{k}", real=True): sympy.Float(x) for k, x in enumerate(numbers)}
        values |= {sympy.Symbol(f"_q{k}", real=True): sympy.Float(x) for k, x in enumerate(local.tolist())}
        values[TIME] = sympy.Float(model.time)
        for gap, reach in instance.type.gaps:
            depth, usual = (_number(instance.type.whole(e).xreplace(values)) for e in (-gap, reach))
            usual = min(usual, DEEP * size) if usual > 0 else DEEP * size
            if depth > usual:
                where = f"{type(instance.component).__name__} {instance.component.name!r}"
                yield Finding(
                    Severity.WARNING,
                    where,
                    f"{where} starts {depth:.3g} m deep: bodies overlap at the start, so the contact force pushes "
                    "them apart",
                    "Check its points, normal and radii, and the position and angle of the bodies",
                )


def _undetermined(a: Assembled) -> Iterable[Finding]:
    """Yield requirements on quantities undetermined by redundant constraints."""
    if a.model.layout.constraints == a.model.layout.rank:
        return ()
    return undetermined_margins(a.model, a.pose[0], a.model.time, a.parameters[0])


def _number(value: sympy.Expr) -> float:
    """Return the value of an expression; NaN if it has none, for example for a gap with separate auxiliary states."""
    try:
        return float(value.doit())
    except TypeError:
        return float("nan")


CHECKS = (
    _redundant,
    _moved,
    _changed_coordinates,
    _uncounted_turns,
    _deep_contacts,
    lambda a: unused_commands(a.mechanism),
    _undetermined,
    _turned,
    _apart,
    _spread,
    _scales,
    _units,
)
"""All checks, in the order of their findings."""
