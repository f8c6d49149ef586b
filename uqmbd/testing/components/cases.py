"""Mechanisms for tests of a component: random poses, and random values of all declared parameters."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import sympy

from uqmbd.mechanism import Body, Component, Mechanism, Parameter, Space, as_symbolic, effective_parameters, flatten, t
from uqmbd.randomness import uniform_variable

__all__ = ["ComponentCase", "component_cases", "moving_case", "name_of"]


@dataclass(frozen=True)
class ComponentCase:
    """Component in a mechanism."""

    title: str  # special feature of the case, for messages
    mechanism: Mechanism  # without gravity, except in `moving_case`
    component: Component  # component in the mechanism; random variables have the names of their parameters
    free: bool  # whether the component is attached only to bodies


def component_cases(
    component: type[Component], space: type[Space], given: Mapping[str, Any], rng: np.random.Generator
) -> Iterator[ComponentCase]:
    """Yield a component between bodies, at the ground, with all and with the fewest parameters, and with each option.

    `given` contains fixed values by parameter; `rng` draws poses and other values.
    """
    declared, chosen = _declared(component, space), set(given)
    examples = {k: p.example for k, p in declared.items() if p.example is not None}
    varied = {k: _varied(declared[k], x) for k, x in examples.items()}
    given = examples | dict(given)
    everything = set(declared)
    yield _case(
        "between bodies",
        component,
        space,
        given | varied | {k: given[k] for k in chosen},
        everything,
        rng,
        turning=True,
    )
    for k, role in enumerate(component.bodies if len(component.bodies) > 1 else ()):
        yield _case(f"with the ground as {role}", component, space, given, everything, rng, ground=k)
    yield _case("with time-dependent parameters", component, space, given, everything, rng, moving=True)
    if any(not p.required for p in declared.values()):
        required = {k for k, p in declared.items() if p.required}
        yield _case("with the defaults", component, space, given, required, rng)
    for key, parameter in declared.items():
        for choice in parameter.words if key not in chosen else ():
            title = f"with {key}={choice!r}"
            yield _case(title, component, space, {**given, key: choice}, everything, rng)


def moving_case(
    component: type[Component], space: type[Space], given: Mapping[str, Any], rng: np.random.Generator
) -> ComponentCase:
    """Return a component at the ground, under gravity, with few random parameters, for studies; see `component_cases`.

    The first two numbers of the component vary by 1 %; without numbers, the mass of the last body varies. Poses are
    random, so the assembly of the mechanism may be impossible.
    """
    declared = _declared(component, space)
    given = {k: p.example for k, p in declared.items() if p.example is not None} | dict(given)
    numeric = [k for k, p in declared.items() if p.kind not in ("option", "numbers", "rotation") and k not in given]
    numeric = [k for k in numeric if declared[k].size(space())][:2]
    mechanism = Mechanism("trial", space(gravity=(0.0,) * (space().dimension - 1) + (-9.81,)))
    count = len(component.bodies)
    bodies: list[Any] = [
        mechanism.ground if k == 0 and count > 1 else _body(mechanism, role, rng, heavy=not numeric and k == count - 1)
        for k, role in enumerate(component.bodies)
    ]
    values = {
        key: given[key]
        if key in given
        else _value(p, mechanism.space, rng, turning=key in numeric, moving=False, spread=0.01 * (key in numeric))
        for key, p in declared.items()
        if key in given or p.required or key in numeric
    }
    made = component("trial", **_arguments(component, bodies, values))
    return ComponentCase("in a study", mechanism, mechanism.add(made), free=False)


def name_of(component: type[Component], space: type[Space]) -> str:
    """Return the name of a component in a space, for messages."""
    return f"{component.__name__} in {space.__name__} space"


def _declared(component: type[Component], space: type[Space]) -> dict[str, Parameter]:
    """Return the parameters that apply in a space."""
    return {key: parameter for key, parameter in component.parameters().items() if parameter.fits(space())}


def _case(
    title: str,
    component: type[Component],
    space: type[Space],
    given: Mapping[str, Any],
    wanted: set[str],
    rng: np.random.Generator,
    *,
    ground: int = -1,
    turning: bool = False,
    moving: bool = False,
) -> ComponentCase:
    mechanism = Mechanism("trial", space())
    bodies: list[Any] = [
        mechanism.ground if k == ground else _body(mechanism, role, rng) for k, role in enumerate(component.bodies)
    ]
    declared = _declared(component, space)
    values = {
        key: given[key] if key in given else _value(parameter, mechanism.space, rng, turning=turning, moving=moving)
        for key, parameter in declared.items()
        if key in given or key in wanted
    }
    values = _with_effect(component, space, declared, values)
    made = component("trial", **_arguments(component, bodies, values))
    return ComponentCase(title, mechanism, mechanism.add(made), all(isinstance(b, Body) for b in bodies))


def _with_effect(
    component: type[Component], space: type[Space], declared: Mapping[str, Parameter], values: Mapping[str, Any]
) -> dict[str, Any]:
    """Omit optional values that have no effect with the given options, because they might be rejected."""
    if all(declared[key].required for key in values):
        return dict(values)
    mechanism, rng = Mechanism("trial", space()), np.random.default_rng(0)
    bodies = [_body(mechanism, role, rng) for role in component.bodies]
    kept = {key for key in values if declared[key].required or declared[key].words}
    probe = mechanism.add(component("trial", **_arguments(component, bodies, {key: values[key] for key in kept})))
    probe.values.update({key: values[key] for key in set(values) - kept if declared[key].default is None})
    effective = effective_parameters(probe, mechanism.space)
    return {key: x for key, x in values.items() if key in kept or key in effective}


def _arguments(component: type[Component], bodies: list[Any], values: Mapping[str, Any]) -> dict[str, Any]:
    """Return bodies and values by name; values of None are omitted."""
    return {**dict(zip(component.bodies, bodies, strict=True)), **{k: v for k, v in values.items() if v is not None}}


def _body(mechanism: Mechanism, name: str, rng: np.random.Generator, *, heavy: bool = False) -> Body:
    space = mechanism.space
    pose: dict[str, Any] = {"position": list(rng.uniform(-1, 1, space.dimension))}
    if space.turns and space.dimension == 2:
        pose |= {"angle": rng.uniform(-3, 3), "inertia": rng.uniform(0.5, 2)}
    elif space.turns:
        e = rng.normal(size=4)
        pose |= {"quaternion": e / np.linalg.norm(e), "inertia": (2, 1.5, 1, 0.1, 0.2, 0.3)}
    mass = rng.uniform(0.5, 2) * (1 + uniform_variable("mass", -0.01, 0.01) if heavy else 1)
    return mechanism.body(name, mass=mass, com=list(rng.uniform(-0.5, 0.5, space.dimension)), **pose)


def _value(
    parameter: Parameter, space: Space, rng: np.random.Generator, *, turning: bool, moving: bool, spread: float = 0.1
) -> Any:
    """Return a random value of a declared kind that depends on a random variable; None: omit the value."""
    u: Any = uniform_variable(parameter.name, -spread, spread, parameter.units) if spread else sympy.Integer(0)
    size = parameter.size(space)
    if parameter.kind in ("option", "numbers"):
        if parameter.required and not parameter.words:
            what = (
                "an option without declared choices"
                if parameter.kind == "option"
                else "a list of numbers without a fixed length"
            )
            raise AssertionError(
                f"parameter {parameter.name!r} is {what}, so the check cannot choose a value. Declare the parameter "
                "with example=..., or pass its value as given={...} to check_component."
            )
        return parameter.words[0] if parameter.required else None
    if parameter.kind == "scalar":
        value = sympy.Float(rng.uniform(0.5, 1.5)) * (1 + u)
        return _in_range(parameter, value + sympy.sin(t) / 5 if moving else value)
    if parameter.kind == "rotation":
        if not space.turns:
            return None
        size = 4 if space.dimension == 3 else 1
    if size == 0:
        return None
    start, change = rng.uniform(-1, 1, size), rng.uniform(-1, 1, size)
    if parameter.kind in ("axis", "turning_axis", "rotation"):
        # frames on a random axis are long expressions, so one random entry in one case is sufficient
        change = change * (np.arange(size) == 0) * turning
    entries = [sympy.Float(a) + sympy.Float(b) * u for a, b in zip(start, change, strict=True)]
    return tuple(_in_range(parameter, x + 2) if parameter.ranged else x for x in entries)


def _varied(parameter: Parameter, example: Any) -> Any:
    """Return an example whose entry k varies by at most 5 (1 + k) %, within its range; options and axes stay fixed."""
    if parameter.kind not in ("scalar", "point", "vector", "moment"):
        return example
    u: Any = uniform_variable(parameter.name, 0, 0.05)

    def around(x: Any, size: float) -> sympy.Expr:
        if not as_symbolic(x).is_number:
            return x
        size = min(size, *(abs(end - float(x)) for end in (parameter.minimum, parameter.maximum) if end != float(x)))
        return x + (-u if x >= parameter.maximum else u) * size

    numbers = flatten(example)
    made = tuple(around(x, (1 + k) * (abs(float(x)) or 1.0)) for k, x in enumerate(numbers))
    return made[0] if parameter.kind == "scalar" else made


def _in_range(parameter: Parameter, value: sympy.Expr) -> sympy.Expr:
    """Move a value between 0.2 and 3.2 into the range of a parameter."""
    low, high = parameter.minimum, parameter.maximum
    if math.isfinite(low) and math.isfinite(high):
        return low + (high - low) * value / 4
    if math.isfinite(high):
        return high - value
    return low + value if low > 0 else value
