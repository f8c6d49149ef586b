"""What no mechanism can be, for each realisation: numbers outside of their range, and inertia that no body has."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import sympy
from numpy.typing import NDArray

from uqmbd.mechanism import Mechanism, flatten, is_tensor_of_body, range_text
from uqmbd.randomness import RandomVariable
from uqmbd.typing import Array, Index
from uqmbd.wording import format_quantity

__all__ = ["Limit", "Tensor", "impossible", "limits_of"]


@dataclass(frozen=True)
class Limit:
    """A parameter with a range.

    Attributes
    ----------
    name : str
        What it is and of whom, as ``mass of body 'rod'``.
    index : int
        Among the parameters of the model.
    units : str
        Its units.
    minimum, maximum : float
        The range, in these units.
    exclusive : bool
        Whether the ends do not belong to it.
    """

    name: str
    index: int
    units: str = ""
    minimum: float = 0.0
    maximum: float = math.inf
    exclusive: bool = False

    def outside(self, values: Array) -> NDArray[np.bool_]:
        """Whether values, shape (K,), are outside; what is not finite is told elsewhere."""
        if self.exclusive:
            return (values <= self.minimum) | (values >= self.maximum)
        return (values < self.minimum) | (values > self.maximum)

    def message(self, value: float) -> str:
        """Say that a value is outside."""
        expected = range_text(self.minimum, self.maximum, exclusive=self.exclusive)
        return f"the {self.name} is {format_quantity(value, self.units)}: expected {expected}"


@dataclass(frozen=True)
class Tensor:
    """The inertia tensor of a body in space.

    Attributes
    ----------
    body : str
        Its name.
    index : array of int, shape (6,)
        Of Jxx, Jyy, Jzz, Jxy, Jxz, Jyz among the parameters of the model.
    """

    body: str
    index: Index

    def moments(self, parameters: Array) -> Array:
        """Principal moments of inertia, ascending, kg m^2, shape (K, 3)."""
        entries = parameters[:, self.index[[[0, 3, 4], [3, 1, 5], [4, 5, 2]]]]
        return np.asarray(np.linalg.eigvalsh(entries), dtype=np.float64)

    def message(self, moments: Array) -> str:
        """Say that no body has these principal moments."""
        listed = ", ".join(f"{x:.4g}" for x in moments)
        why = "none may be negative" if moments[0] < 0 else "the largest may not be more than the sum of the others"
        return f"the inertia of body {self.body!r} is that of no body: its principal moments are {listed} kg m^2; {why}"


def limits_of(mechanism: Mechanism, expressions: list[sympy.Expr]) -> tuple[tuple[Limit, ...], tuple[Tensor, ...]]:
    """Collect the random numbers of a mechanism that have a range, and its random inertia tensors.

    Constants, and the values at the means, were looked at when they were given; what depends on time or motion is not
    looked at.

    Parameters
    ----------
    mechanism : Mechanism
        What to look into.
    expressions : list of expressions
        Parameters of the model; what is needed besides is appended.
    """
    limits: list[Limit] = []
    tensors: list[Tensor] = []

    def placed(value: sympy.Expr) -> int:
        expressions.append(value)
        return len(expressions) - 1

    for body in mechanism.bodies.values():
        mass = sympy.sympify(body.terms.values["mass"])
        if _random(mass):
            limits.append(Limit(f"mass of body {body.name!r}", placed(mass), "kg"))
        moments = [sympy.sympify(x) for x in body.terms.values["inertia"] or ()]
        if len(moments) == 1 and _random(moments[0]):
            limits.append(Limit(f"moment of inertia of body {body.name!r}", placed(moments[0]), "kg m^2"))
        if len(moments) == 6 and any(_random(x) for x in moments):
            tensors.append(Tensor(body.name, np.array([placed(x) for x in moments], dtype=np.int64)))
    for component in mechanism.components.values():
        for key, parameter in component.parameters().items():
            entries = [sympy.sympify(x) for x in flatten(component.values.get(key))] if parameter.ranged else []
            for k, entry in enumerate(entries):
                if _random(entry):
                    place = f"[{k}]" if len(entries) > 1 else ""
                    name = f"{key}{place} of {type(component).__name__} {component.name!r}"
                    ends = (parameter.minimum, parameter.maximum, parameter.exclusive)
                    limits.append(Limit(name, placed(entry), parameter.units, *ends))
    return tuple(limits), tuple(tensors)


def impossible(limits: Sequence[Limit], tensors: Sequence[Tensor], parameters: Array) -> list[str]:
    """Say of each realisation what is impossible about its numbers: empty where nothing is.

    Parameters
    ----------
    limits, tensors : sequence of Limit, of Tensor
        From `limits_of`.
    parameters : array, shape (K, parameter)
        Finite.
    """
    messages = [""] * len(parameters)
    for limit in limits:
        values = parameters[:, limit.index]
        for k in np.flatnonzero(limit.outside(values)):
            messages[k] = messages[k] or limit.message(float(values[k]))
    for tensor in tensors:
        moments = tensor.moments(parameters)
        for k in np.flatnonzero(~is_tensor_of_body(moments)):
            messages[k] = messages[k] or tensor.message(moments[k])
    return messages


def _random(value: sympy.Expr) -> bool:
    """Whether a number differs between realisations, and from nothing else."""
    return bool(value.free_symbols) and all(isinstance(s, RandomVariable) for s in value.free_symbols)
