"""Values of a component's parameters: checks, and conversion to a common form.

The module also finds values that equal 1 or 2.  SymPy removes a factor 1 from a product, and a factor 2 from half a
product.  The check of dimensions cannot see the units of such a factor.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Any

import sympy

from uqmbd.errors import StudyError
from uqmbd.mechanism.components.component import Component, Parameter
from uqmbd.mechanism.components.coordinates import declared_coordinates
from uqmbd.mechanism.components.world_pose import KEYWORDS, localised, replaced
from uqmbd.mechanism.expressions import check_dimensions, flatten, numbers, shown
from uqmbd.mechanism.geometry import Space, nominal, quaternion_of_matrix, unit
from uqmbd.plugins import unusable
from uqmbd.randomness import RandomVariable
from uqmbd.units import Dimension, read_units, without_quantities

__all__ = ["settle", "stated_in_bodies", "unseen_in"]

VANISHING = (1, -1, 2, -2, sympy.Rational(1, 2), sympy.Rational(-1, 2))
"""Values that SymPy removes from a product, alone or with the factor 1/2 of an energy; a float 2.0 leaves 1.0."""


def unseen_in(components: Iterable[Component]) -> Callable[[], set[Dimension]]:
    """Return the function `unseen` of `check_dimensions`: it returns the dimensions of all values in `VANISHING`.

    >>> import uqmbd
    >>> mechanism = uqmbd.Mechanism("fall", uqmbd.Line(gravity=-9.81))
    >>> stone = mechanism.body("stone", mass=1)
    >>> unseen_in(mechanism.all_components())() == {read_units("kg").dimension}
    True
    """

    def dimensions() -> set[Dimension]:
        found: set[Dimension] = set()
        for component in components:
            for key, parameter in component.parameters().items():
                unit = read_units(parameter.units) if parameter.kind != "option" else None
                values = flatten(component.values.get(key, ())) if unit is not None else []
                if unit is not None and any(x in VANISHING for x in values):
                    found.add(unit.dimension)
        return found

    return dimensions


def settle(where: str, component: Component, space: Space) -> dict[str, Any]:
    """Return the values of a component: its parameters, then the values from its method `prepare`.

    A scalar becomes an expression, a vector becomes a tuple of expressions, and an option remains unchanged.  The
    function fills ``values`` of the component before it calls `prepare`.  It raises `uqmbd.StudyError` if a parameter
    is missing, or if a value contradicts the declaration of its parameter.
    """
    given = localised(where, component, space)
    unseen = unseen_in([component, *_holders(component)])
    for key, parameter in component.parameters().items():
        left_out = parameter.kind == "turning_axis" and parameter.size(space) == 0
        if key not in given and parameter.required and not left_out:
            units = f", {parameter.units}" if parameter.units else ""
            other = [word for word in KEYWORDS if key in replaced(type(component), word)]
            raise StudyError(
                f"{where}: {key!r} is missing ({parameter.description}{units}). "
                f"Usage: {type(component).__name__}{component.signature()}"
                + (f", or {other[0]}= in world axes, for the given pose." if other else ".")
            )
        value = given.get(key, None if parameter.required else parameter.default)
        try:
            component.values[key] = _value(where, key, parameter, value, space, unseen, stated=key in given)
        except StudyError as error:
            # functions for axes and rotations cannot add the component's name to their messages
            raise StudyError(str(error) if str(error).startswith(where) else f"{where}: {key}: {error}") from None
    component.settled_space = space
    known = [(x, set(x.read)) for x in (component, *_holders(component))]
    component.read = set()
    try:
        prepared = dict(component.prepare())
        component.prepared_from = frozenset(component.read)
        component.values.update({key: _prepared(where, key, value) for key, value in prepared.items()})
        component.coordinate_set = declared_coordinates(where, component)
    except StudyError as error:
        raise StudyError(f"{where}: {error}") from None
    finally:
        for holder, read in known:  # exclude values that `prepare` reads, because it runs again when they change
            holder.read = read
    component.settled += 1
    vars(component).pop("_quantities", None)  # stored motion quantities contain the old values
    return component.values


def _holders(component: Component) -> list[Component]:
    """Return the components that store mass and inertia of the bodies of a component."""
    return [
        terms for body in component.attached.values() if isinstance(terms := getattr(body, "terms", None), Component)
    ]


def stated_in_bodies(component: Component, key: str) -> None:
    """Convert all parameters given by the same keyword (``at`` or ``axis``) as the parameter `key` to body frames."""
    for word in [word for word in component.world_pose if key in replaced(type(component), word)]:
        component.given.update({name: component.values[name] for name in replaced(type(component), word)})
        del component.world_pose[word]


def _value(
    where: str,
    key: str,
    parameter: Parameter,
    value: Any,
    space: Space,
    unseen: Callable[[], set[Dimension]],
    *,
    stated: bool,
) -> Any:
    units = "rad" if parameter.kind == "rotation" and space.dimension == 2 else parameter.units
    value = without_quantities(f"{where}: {key}", value, units)
    size = parameter.size(space)
    hint = ", ".join(filter(None, (parameter.description, parameter.units)))
    if stated and not parameter.fits(space) and not (isinstance(value, (int, float)) and value == parameter.default):
        raise StudyError(
            f"{where}: {key} is {shown(value)}, but it has no effect in {type(space).__name__} space, which has "
            f"{space.dimension} dimension{'s' * (space.dimension != 1)}; omit it ({hint})."
        )
    if parameter.kind == "option":
        if not parameter.offers(value):
            choices = [*parameter.words, *parameter.names_of_plugins()]
            choices += [x for x in parameter.choices if isinstance(x, type)]
            listed = ", ".join(x.__name__ if isinstance(x, type) else repr(x) for x in choices)
            unloaded = f" {unusable()}" if parameter.registered and unusable() else ""
            raise StudyError(f"{where}: {key} is {shown(value)}; expected one of {listed}.{unloaded}")
        _require_usable(where, key, value)
        if isinstance(value, sympy.Expr):  # a law, whose result has the units of the parameter
            check_dimensions(f"{where}: {key}", value, parameter.units, unseen)
        return value
    if parameter.kind == "turning_axis" and size == 0:
        if stated and value is not None and flatten(value):
            raise StudyError(f"{where}: {key} is given, but in planar space all rotations have the same axis; omit it.")
        return ()
    if value is None and not parameter.required and parameter.default is None:
        return None
    if parameter.kind == "rotation":
        return _rotation(where, key, value, space, hint)
    count = size if parameter.kind != "numbers" else len(flatten(value))
    entries = numbers(where, key, value, count, hint, scalar=parameter.kind == "scalar")
    if parameter.kind not in ("axis", "turning_axis"):
        for entry in entries:
            check_dimensions(f"{where}: {key}", entry, parameter.units, unseen)
    if parameter.ranged:
        _require_range(f"{where}: {key}", parameter, entries, hint)
    if parameter.kind in ("axis", "turning_axis"):
        return unit(entries)
    return entries[0] if parameter.kind == "scalar" else tuple(entries)


def _require_range(what: str, parameter: Parameter, entries: list[sympy.Expr], hint: str) -> None:
    """Raise if a number, or an expression at the means of random variables, is outside the range of a parameter."""
    for entry in entries:
        if not all(isinstance(s, RandomVariable) for s in entry.free_symbols):
            continue
        try:
            value = nominal(entry)
        except StudyError:  # the assembly reports numbers that are not finite at the means
            continue
        if not parameter.allows(value):
            at_means = "" if entry.is_number else f" at the means of the random variables ({shown(entry)})"
            raise StudyError(f"{what} is {value:g}{at_means}; expected {parameter.range_text} ({hint}).")


def _rotation(where: str, key: str, value: Any, space: Space, hint: str) -> tuple[sympy.Expr, ...]:
    """Return the quaternion of a relative rotation; a half-angle pair in planar space."""
    if not space.turns:
        raise StudyError(f"{where}: {key} is given, but bodies in {type(space).__name__} space do not rotate; omit it.")
    parts = flatten(value)
    if space.dimension == 2:
        angle = numbers(where, key, value, 1, f"{hint}: the angle in rad")[0]
        check_dimensions(f"{where}: {key}", angle, "rad")
        half = angle / 2
        return (sympy.cos(half), sympy.sin(half))
    if len(parts) not in (4, 9):
        raise StudyError(
            f"{where}: {key} is {shown(value)}; expected a quaternion (e0, e1, e2, e3) or a 3 x 3 matrix ({hint})."
        )
    entries = numbers(where, key, parts, len(parts), hint)
    return unit(entries) if len(entries) == 4 else quaternion_of_matrix(value)


def _require_usable(where: str, key: str, value: Any) -> None:
    """Raise if an option contains an expression that is not a number or cannot be computed."""
    for part in flatten(value):
        if isinstance(part, (sympy.Expr, int, float, complex)) and not isinstance(part, bool):
            numbers(where, key, part, 1)


def _prepared(where: str, key: str, value: Any) -> Any:
    """Return the result of `Component.prepare` as an expression or a tuple of expressions."""
    parts = [numbers(where, key, x, 1)[0] for x in flatten(value)]
    scalar = len(parts) == 1 and isinstance(value, (int, float, sympy.Expr))
    return parts[0] if scalar else tuple(parts)
