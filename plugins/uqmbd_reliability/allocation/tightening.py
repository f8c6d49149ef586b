"""Inputs whose tolerances may be changed: their names, widths, and the cost of each width."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

import uqmbd
from uqmbd.typing import Array, Index

__all__ = ["Cost", "Tightened", "tightened"]

Cost = Mapping[str, float | Callable[[float], float]]
"""Cost of a tolerance, by the name of the input: c for c / tolerance, or a function of the tolerance."""

NATURAL = 3.0
"""Tolerance of an input without a stated tolerance, in standard deviations."""

STEP = 1e-5
"""Relative step of the derivative of a cost function."""


@dataclass(frozen=True, eq=False)
class Tightened:
    """Inputs that can be tightened by factors: ``mean + factor * (input - mean)``."""

    names: tuple[str, ...]
    units: tuple[str, ...]
    columns: Index  # (n,) indices among all inputs
    means: Array  # (n,)
    widths: Array  # (n,) half-widths of the present tolerances
    sources: tuple[str, ...]  # description of the origin of each tolerance
    costs: tuple[Callable[[float], float], ...]  # functions of a half width

    def values(self, values: Array, factors: Array) -> Array:
        """Return inputs (K, input) in which the changeable inputs are contracted to their means."""
        found = values.copy()
        found[:, self.columns] = self.means + factors * (values[:, self.columns] - self.means)
        return found

    def cost(self, factors: Array) -> float:
        """Return the cost of the tolerances."""
        return float(sum(c(float(w)) for c, w in zip(self.costs, factors * self.widths, strict=True)))

    def slope(self, factors: Array) -> Array:
        """Return the derivatives of the cost with respect to the logarithms of the factors, shape (n,)."""
        found = []
        for one, width in zip(self.costs, factors * self.widths, strict=True):
            above, below = one(float(width * math.exp(STEP))), one(float(width * math.exp(-STEP)))
            found.append((above - below) / (2 * STEP))
        return np.array(found)


def tightened(where: str, problem: uqmbd.extend.Problem, cost: Cost | None, loosest: float) -> Tightened:
    """Return the inputs that a cost names.

    Default: the inputs with a stated tolerance, with a cost inverse to the tolerance. Raise StudyError if there are no
    such inputs, if an input cannot be tightened, or if a cost is invalid.
    """
    variables = problem.inputs.variables
    names = [v.name for v in variables]
    stated = {v.name: uqmbd.extend.stated_tolerance(v.distribution) for v in variables}
    if cost is None:
        chosen = [name for name in names if stated[name] is not None]
        if not chosen:
            raise uqmbd.StudyError(
                f"{where}: no input has a tolerance. Define inputs with uqmbd.tolerance or uqmbd.iso286, or list the "
                f"inputs in cost=, e.g. {{{names[0]!r}: 1.0}}. The inputs are {', '.join(names)}."
            )
    else:
        chosen = _named(where, cost, names)
    found = []
    for name in chosen:
        variable = variables[names.index(name)]
        tolerance = stated[name]
        if len(variable.joint.names) > 1:
            raise uqmbd.StudyError(
                f"{where}: {name} depends on {', '.join(x for x in variable.joint.names if x != name)}; only "
                "independent inputs can have a tolerance."
            )
        if getattr(variable.distribution, "interpret_as_integer", False):
            raise uqmbd.StudyError(f"{where}: {name} has only integer values, so its tolerance cannot be tightened.")
        if tolerance is not None:
            about = (tolerance.mean, (tolerance.upper - tolerance.lower) / 2, str(tolerance))
        else:
            deviation = math.sqrt(_variance(problem, names.index(name)))
            about = (variable.mean, NATURAL * deviation, f"{NATURAL:g} standard deviations of {variable.description}")
        found.append((variable, *about, _cost_of(where, name, cost, about[1], loosest)))
    return Tightened(
        tuple(v.name for v, *_ in found),
        tuple(v.units for v, *_ in found),
        np.array([names.index(v.name) for v, *_ in found]),
        np.array([mean for _, mean, *_ in found]),
        np.array([width for _, _, width, *_ in found]),
        tuple(source for *_, source, _ in found),
        tuple(one for *_, one in found),
    )


def _named(where: str, cost: Any, names: list[str]) -> list[str]:
    if not isinstance(cost, Mapping) or not cost:
        raise uqmbd.StudyError(
            f"{where}: cost is {cost!r}; expected a mapping from input names to costs, e.g. {{{names[0]!r}: 1.0}}. A "
            "cost is a number c for c / tolerance, or a function of the tolerance."
        )
    for name in cost:
        if name not in names:
            raise uqmbd.StudyError(f"{where}: cost contains {name!r}; expected names of inputs, {', '.join(names)}.")
    return [name for name in names if name in cost]


def _cost_of(where: str, name: str, cost: Cost | None, width: float, loosest: float) -> Callable[[float], float]:
    """Return the cost of a half-width as a function."""
    given = width if cost is None else cost[name]
    if not callable(given):
        number = isinstance(given, (int, float, np.number)) and not isinstance(given, bool)
        if not number or not 0 < float(given) < math.inf:
            raise uqmbd.StudyError(
                f"{where}: the cost of {name} is {given!r}; expected a number c above 0, for the cost c / tolerance, "
                "or a function of the tolerance."
            )
        coefficient = float(given)
        return lambda tolerance: coefficient / tolerance
    loose, now, tighter = (_number(where, name, given, x * width) for x in (loosest, 1.0, 0.7))
    for wide, narrow, lower, higher in ((1.0, 0.7, now, tighter), (loosest, 1.0, loose, now)):
        if wide > narrow and not higher > lower:
            raise uqmbd.StudyError(
                f"{where}: the cost of {name} is {lower:g} at a tolerance of {wide * width:g} and {higher:g} at "
                f"{narrow * width:g}; expected a cost that increases as the tolerance is tightened."
            )
    return given


def _number(where: str, name: str, function: Callable[[float], float], tolerance: float) -> float:
    found = function(tolerance)
    if not isinstance(found, (int, float, np.number)) or not math.isfinite(found):
        raise uqmbd.StudyError(
            f"{where}: the cost of {name} at the tolerance {tolerance:g} is {found!r}; expected a finite number."
        )
    return float(found)


def _variance(problem: uqmbd.extend.Problem, column: int) -> float:
    levels = (np.arange(4096) + 0.5) / 4096
    uniform = np.full((len(levels), len(problem.inputs)), 0.5)
    uniform[:, column] = levels
    return float(problem.inputs.from_uniform(uniform)[:, column].var())
