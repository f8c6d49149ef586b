"""Check for impossible values in each realisation: numbers outside their range, and unphysical inertia."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
import sympy
from numpy.typing import NDArray

from uqmbd.mechanism import Mechanism, Parameter, as_symbolic, flatten, is_tensor_of_body, nominal, range_text
from uqmbd.randomness import RandomVariable
from uqmbd.typing import Array, Index
from uqmbd.wording import format_number, format_quantity

__all__ = ["Limit", "Tensor", "impossible", "limits_of", "signs_of", "squares_of"]

Inputs = tuple[tuple[str, int], ...]

Ends = tuple[float, float, bool]

NO_LESS: Ends = (0.0, math.inf, False)
"""Range of masses and moments of inertia."""

NAMED = 6
"""Largest number of inputs in a message."""


@dataclass(frozen=True)
class Limit:
    """Parameter with a range."""

    name: str  # quantity and owner, such as "mass of body 'rod'"
    index: int  # index among the parameters of the model
    units: str = ""
    minimum: float = 0.0  # in these units
    maximum: float = math.inf  # in these units
    exclusive: bool = False  # whether the ends are excluded
    inputs: Inputs = ()  # for each random variable in it: name, and index among the model parameters
    constant: str = ""  # effect of a constant equal to the minimum; a random number must be above the minimum

    @property
    def expected(self) -> str:
        """Range in words."""
        if self.constant:
            return f"a distribution above {self.minimum:g} (with the constant {self.minimum:g}, {self.constant})"
        return range_text(self.minimum, self.maximum, exclusive=self.exclusive)

    def outside(self, values: Array) -> NDArray[np.bool_]:
        """Return whether values, shape (K,), are outside; values that are not finite are reported elsewhere."""
        if self.constant:
            return (values <= self.minimum) | (values > self.maximum)
        if self.exclusive:
            return (values <= self.minimum) | (values >= self.maximum)
        return (values < self.minimum) | (values > self.maximum)

    def message(self, parameters: Array) -> str:
        """Return a message on the value outside the range, for parameters (P,)."""
        value = format_quantity(float(parameters[self.index]), self.units)
        return f"the {self.name} is {value}: expected {self.expected}{_at(self.inputs, parameters)}"


@dataclass(frozen=True)
class Tensor:
    """Inertia tensor of a body in three dimensions."""

    body: str
    index: Index  # (6,): indices of Jxx, Jyy, Jzz, Jxy, Jxz, Jyz among the parameters of the model
    inputs: Inputs = ()  # as for `Limit`

    def moments(self, parameters: Array) -> Array:
        """Return ascending principal moments of inertia, kg m^2, shape (K, 3)."""
        entries = parameters[:, self.index[[[0, 3, 4], [3, 1, 5], [4, 5, 2]]]]
        return np.asarray(np.linalg.eigvalsh(entries), dtype=np.float64)

    def message(self, moments: Array, parameters: Array) -> str:
        """Return a message on impossible principal moments, for parameters (P,)."""
        listed = ", ".join(f"{x:.4g}" for x in moments)
        why = "none may be negative" if moments[0] < 0 else "the largest may not be more than the sum of the others"
        return (
            f"the inertia of body {self.body!r} is not possible for any body: its principal moments are {listed} kg "
            "m^2; "
            f"{why}{_at(self.inputs, parameters)}"
        )


def limits_of(mechanism: Mechanism, expressions: list[sympy.Expr]) -> tuple[tuple[Limit, ...], tuple[Tensor, ...]]:
    """Collect the random numbers with a range, and the random inertia tensors, of a mechanism.

    `Mechanism` has already checked constants and values at the means; numbers that depend on time or motion are not
    checked.  Missing expressions are appended to `expressions`, the parameters of the model.
    """
    limits: list[Limit] = []
    tensors: list[Tensor] = []
    places: dict[sympy.Expr, int] = {}

    def placed(value: sympy.Expr) -> int:
        return _placed(value, expressions, places)

    def inputs_of(*values: sympy.Expr) -> Inputs:
        found: set[sympy.Expr] = set().union(*(value.free_symbols for value in values))
        return tuple((str(v), placed(v)) for v in sorted(found, key=str))

    def limit(name: str, value: sympy.Expr, units: str, ends: Ends = NO_LESS) -> Limit:
        return Limit(name, placed(value), units, *ends, inputs=inputs_of(value))

    for body in mechanism.bodies.values():
        mass = as_symbolic(body.terms.values["mass"])
        if _random(mass):
            limits.append(limit(f"mass of body {body.name!r}", mass, "kg"))
        moments = [as_symbolic(x) for x in body.terms.values["inertia"] or ()]
        if len(moments) == 1 and _random(moments[0]):
            limits.append(limit(f"moment of inertia of body {body.name!r}", moments[0], "kg m^2"))
        if len(moments) == 6 and any(_random(x) for x in moments):
            index = np.array([placed(x) for x in moments], dtype=np.int64)
            tensors.append(Tensor(body.name, index, inputs_of(*moments)))
    for name, entry, parameter in _numbers(mechanism):
        if parameter.ranged:
            ends = (parameter.minimum, parameter.maximum, parameter.exclusive)
            limits.append(replace(limit(name, entry, parameter.units, ends), constant=parameter.at_minimum))
    return tuple(limits), tuple(tensors)


def signs_of(mechanism: Mechanism, expressions: list[sympy.Expr]) -> tuple[Limit, ...]:
    """Collect the random numbers that should have the same sign for all inputs as at the means (`Parameter.one_sign`).

    Missing expressions are appended to `expressions`, as in `limits_of`.
    """
    found: list[Limit] = []
    places: dict[sympy.Expr, int] = {}
    for name, entry, parameter in _numbers(mechanism):
        if not parameter.one_sign or parameter.ranged:
            continue
        at_means = nominal(entry)
        inputs = tuple((str(v), _placed(v, expressions, places)) for v in sorted(entry.free_symbols, key=str))
        ends = (0.0, math.inf) if at_means > 0 else (-math.inf, 0.0)
        if at_means:
            found.append(Limit(name, _placed(entry, expressions, places), parameter.units, *ends, inputs=inputs))
    return tuple(found)


def squares_of(mechanism: Mechanism, expressions: list[sympy.Expr]) -> tuple[Limit, ...]:
    """Return factors of masses, inertias and ranged numbers with even powers, which hide a change of sign.

    A moment of inertia ``m length**2 / 12`` is also positive for negative lengths.  A sum with other terms, for example
    with an offset between axes, is omitted, because the offset may have either sign.  Missing expressions are appended
    to `expressions`, as in `limits_of`.
    """
    entries: list[tuple[str, sympy.Expr]] = []
    for body in mechanism.bodies.values():
        moments = [as_symbolic(x) for x in body.terms.values["inertia"] or ()]
        entries += [(f"inertia of body {body.name!r}", x) for x in moments if _random(x)]
        mass = as_symbolic(body.terms.values["mass"])
        entries += [(f"mass of body {body.name!r}", mass)] if _random(mass) else []
    entries += [(name, entry) for name, entry, parameter in _numbers(mechanism) if parameter.ranged]
    found: dict[tuple[str, sympy.Expr], Limit] = {}
    places: dict[sympy.Expr, int] = {}
    for name, entry in entries:
        for base, power in (x.as_base_exp() for x in sympy.Mul.make_args(sympy.factor_terms(entry))):
            if not (power.is_even and base.free_symbols and (at_means := nominal(base))):
                continue
            ends = (0.0, math.inf) if at_means > 0 else (-math.inf, 0.0)
            inputs = tuple((str(v), _placed(v, expressions, places)) for v in sorted(base.free_symbols, key=str))
            place = _placed(base, expressions, places)
            found[name, base] = Limit(f"{base} in the {name}", place, "", *ends, inputs=inputs)
    return tuple(found.values())


def impossible(limits: Sequence[Limit], tensors: Sequence[Tensor], parameters: Array) -> list[str]:
    """Return a message for each realisation, empty if its finite parameters (K, parameter) are possible."""
    messages = [""] * len(parameters)
    for limit in limits:
        values = parameters[:, limit.index]
        for k in np.flatnonzero(limit.outside(values)):
            messages[k] = messages[k] or limit.message(parameters[k])
    for tensor in tensors:
        moments = tensor.moments(parameters)
        for k in np.flatnonzero(~is_tensor_of_body(moments)):
            messages[k] = messages[k] or tensor.message(moments[k], parameters[k])
    return messages


def _numbers(mechanism: Mechanism) -> Iterator[tuple[str, sympy.Expr, Parameter]]:
    """Yield random numbers of components with a range or a sign, and their names."""
    for component in mechanism.components.values():
        for key, parameter in component.parameters().items():
            if not (parameter.ranged or parameter.one_sign):
                continue
            value = component.values.get(key)
            entries = [] if value is None else [as_symbolic(x) for x in flatten(value)]
            for k, entry in enumerate(entries):
                if _random(entry):
                    place = f"[{k}]" if len(entries) > 1 else ""
                    yield f"{key}{place} of {type(component).__name__} {component.name!r}", entry, parameter


def _placed(value: sympy.Expr, expressions: list[sympy.Expr], places: dict[sympy.Expr, int]) -> int:
    """Return the index of an expression in a list; append the expression if it is missing."""
    if value not in places:
        places[value] = len(expressions)
        expressions.append(value)
    return places[value]


def _at(inputs: Inputs, parameters: Array) -> str:
    """Return a list of the inputs of a realisation as text, for parameters (P,)."""
    listed = ", ".join(f"{name} = {format_number(float(parameters[k]))}" for name, k in inputs[:NAMED])
    return f"; {listed}{', ...' if len(inputs) > NAMED else ''}"


def _random(value: sympy.Expr) -> bool:
    """Return whether a number depends on random variables only."""
    return bool(value.free_symbols) and all(isinstance(s, RandomVariable) for s in value.free_symbols)
