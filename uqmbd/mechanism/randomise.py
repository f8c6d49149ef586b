"""Conversion of numbers of an existing mechanism to random variables, selected by name patterns."""

from __future__ import annotations

import fnmatch
import math
import warnings
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Annotated, Any

import numpy as np
import sympy

from uqmbd.arguments import Bounds, fits
from uqmbd.errors import StudyError, StudyWarning
from uqmbd.mechanism.components import Component, known_effects, no_effect, range_text, settle, stated_in_bodies
from uqmbd.mechanism.declared import Described
from uqmbd.mechanism.expressions import LARGEST, as_symbolic, shown
from uqmbd.names import did_you_mean
from uqmbd.randomness import RandomVariable, adopt_distribution, distribution_about, is_distribution, leaves_range

__all__ = ["randomise_numbers"]

KINDS = ("scalar", "point", "vector", "moment")
"""Kinds of numeric parameters; axes and rotations are directions, and options are not numbers."""

ROUNDING = 1e-12
ROW = "a row or a matrix of numbers, whose entries depend on each other"
REMEDY = "Pass random variables when you make the component, for example one factor that multiplies all entries"
LISTED = 40
"""Largest number of names that a message lists."""


@dataclass(frozen=True)
class RandomisedQuantity:
    """Number, vector or inertia of a body or a component, with its range."""

    owner: str
    key: str
    holder: Component
    units: str
    minimum: float = -math.inf
    maximum: float = math.inf
    stated: bool = True
    unused: bool = False
    """Whether the number has no effect because of the options of its component."""

    @property
    def name(self) -> str:
        """Name in the form ``OWNER.quantity``."""
        return f"{self.owner}.{self.key}"

    @property
    def entries(self) -> list[sympy.Expr]:
        """Values of the quantity, one for each number."""
        value = self.holder.values[self.key]
        return [as_symbolic(x) for x in (value if isinstance(value, (tuple, list)) else [value])]

    @property
    def tensor(self) -> bool:
        """Whether the quantity is a spatial inertia tensor."""
        return self.key == "inertia" and len(self.entries) == 6

    def names(self) -> list[str]:
        """Names of the numbers: for a vector, its name with the axes; for an inertia tensor, one name."""
        count = 1 if self.tensor else len(self.entries)
        return [self.name] if count == 1 else [f"{self.name}.{'xyz'[k]}" for k in range(count)]


@dataclass
class VariationLaw:
    """Law for the variation of a number: a standard deviation, the distribution of a factor, or a function."""

    where: str
    relative: float | None
    absolute: float | None
    distribution: Any
    left: list[str] = field(default_factory=list)
    unused: list[str] = field(default_factory=list)
    """Matching numbers without an effect, with the reason."""

    @property
    def scales(self) -> bool:
        """Whether the law scales the number, so that zero remains zero."""
        return self.absolute is None and not self.has_function

    @property
    def has_function(self) -> bool:
        """Whether a function returns the distribution of each number."""
        return callable(self.distribution) and not is_distribution(self.distribution)

    def of(self, name: str, value: float, minimum: float, maximum: float) -> Any:
        """Return the distribution of a number, or raise if it is impossible."""
        if self.has_function or is_distribution(self.distribution):
            found = self._distribution_for(name, value) if self.has_function else value * self.distribution
            if not is_distribution(found):
                raise StudyError(
                    f"{self.where}: distribution({value:g}), of {name}, is {shown(found)}; expected a chaospy "
                    "distribution of the number."
                )
            if leaves_range(found, minimum, maximum):
                raise StudyError(
                    f"{self.where}: {name} is {value:g}, but its distribution {found} exceeds the range "
                    f"{_ends(minimum, maximum)}."
                )
            return found
        std = self.absolute if self.absolute is not None else (self.relative or 0.0) * abs(value)
        try:
            return distribution_about(value, std, self.distribution or "", minimum, maximum)
        except StudyError as error:
            raise StudyError(
                f"{self.where}: {name} is {value:g}, but must be {_ends(minimum, maximum)}: {error}. Use a smaller "
                "standard deviation, or pass a chaospy distribution of its factor as distribution=."
            ) from None

    def _distribution_for(self, name: str, value: float) -> Any:
        """Return the distribution that the user's function returns for a number."""
        try:
            found = self.distribution(value)
        except Exception as error:  # noqa: BLE001 - the user's function may raise any exception
            raise StudyError(
                f"{self.where}: distribution({value:g}), of {name}, raised {type(error).__name__}: "
                f"{error}. Expected a function that returns a chaospy distribution for each number. "
                "Correct it, or select fewer quantities."
            ) from error
        return adopt_distribution(self.where, found)

    def variable(self, name: str, value: float, units: str, minimum: float, maximum: float) -> RandomVariable:
        """Return the random variable of a number."""
        return RandomVariable(name, self.of(name, value, minimum, maximum), units)


def randomise_numbers(
    mechanism: Described, pattern: str | Sequence[str], relative: Any, absolute: Any, distribution: Any, known: set[str]
) -> list[RandomVariable]:
    """Make numbers of bodies and components random; see `Mechanism.randomise`.

    The set `known` contains the names of existing random variables.  Raises `uqmbd.StudyError` if no number matches or
    can vary, or if a distribution is invalid.
    """
    where = f"mechanism {mechanism.name!r}: randomise({pattern!r})"
    law = _law(where, relative, absolute, distribution)
    chosen, rows = _chosen(where, mechanism, pattern)
    law.left += [f"{name} is {ROW}" for name in rows]
    changes: list[tuple[RandomisedQuantity, Any]] = []
    found: list[RandomVariable] = []
    for quantity, indices in chosen:
        if quantity.unused:
            parameter = quantity.holder.parameters()[quantity.key]
            law.unused.append(f"{quantity.name} has {no_effect(quantity.holder, mechanism.space, parameter)}")
            continue
        new, variables = (_tensor if quantity.tensor else _numbers)(quantity, indices, law)
        for variable in variables:
            if variable.name in known:
                raise StudyError(
                    f"{where}: the mechanism already has a different random variable "
                    f"{variable.name!r}; rename that variable."
                )
        if variables:
            changes.append((quantity, new))
            found += variables
    if not found:
        raise StudyError(
            f"{where}: none of the selected quantities can be randomised: "
            f"{'; '.join(law.left + law.unused) or 'all of them are zero'}."
        )
    _warn(where, law, changes)
    _settle(mechanism, changes)
    return found


def _law(where: str, relative: Any, absolute: Any, distribution: Any) -> VariationLaw:
    """Check the arguments and return the variation law."""
    distribution = adopt_distribution(where, distribution)
    own = is_distribution(distribution) or callable(distribution)
    named = distribution is None or isinstance(distribution, str) and distribution in ("normal", "lognormal", "uniform")
    if isinstance(distribution, type) or not (own or named):
        raise StudyError(
            f"{where}: distribution is {shown(distribution)}; expected 'normal', 'lognormal', 'uniform', a chaospy "
            "distribution of the factor of each number, such as chaospy.Uniform(0.9, 1.1), or a function. The function "
            "takes a number and returns its distribution."
        )
    given = {"relative": relative, "absolute": absolute}
    stated = [key for key, value in given.items() if value is not None]
    if len(stated) != (0 if own else 1):
        raise StudyError(
            f"{where}: {' and '.join(stated) or 'no standard deviation'} "
            f"{'are' if len(stated) > 1 else 'is'} given; expected "
            + (
                "neither relative= nor absolute=: distribution= already defines the variation."
                if own
                else "relative= or absolute=."
            )
        )
    for key in stated:
        value = given[key]
        if not fits(value, Annotated[float, Bounds(0, LARGEST, above=True)]):
            raise StudyError(
                f"{where}: {key} is {shown(value)}; expected a standard deviation above 0 and up to {LARGEST:g}."
            )
        given[key] = float(value)
    return VariationLaw(where, given["relative"], given["absolute"], distribution)


def _quantities(mechanism: Described) -> Iterator[RandomisedQuantity]:
    """Yield quantities that may become random: inertia of bodies, and numbers of components."""
    for body in mechanism.bodies.values():
        yield RandomisedQuantity(body.name, "mass", body.terms, "kg", minimum=0)
        yield RandomisedQuantity(body.name, "com", body.terms, "m", stated=False)
        if body.terms.values["inertia"]:
            yield RandomisedQuantity(body.name, "inertia", body.terms, "kg m^2", minimum=0)
    for component in mechanism.components.values():
        effective = known_effects(component, mechanism.space, mechanism.effective)
        for key, p in component.parameters().items():
            if p.kind in KINDS and component.values.get(key) not in (None, ()) and p.fits(mechanism.space):
                stated, unused = key in component.given, not p.required and key not in effective
                yield RandomisedQuantity(component.name, key, component, p.units, p.minimum, p.maximum, stated, unused)


def _rows(mechanism: Described) -> list[str]:
    """Return the names of component parameters that are rows or matrices, which do not become random."""
    return [
        f"{component.name}.{key}"
        for component in mechanism.components.values()
        for key, p in component.parameters().items()
        if p.kind in ("numbers", "option") and _is_row(component.values.get(key)) and p.fits(mechanism.space)
    ]


def _is_row(value: Any) -> bool:
    """Return whether a value is a non-empty row or matrix of numbers and expressions."""
    if isinstance(value, (tuple, list)):
        return bool(value) and all(_is_row(x) or isinstance(x, (int, float, np.number, sympy.Expr)) for x in value)
    return isinstance(value, (np.ndarray, sympy.MatrixBase)) and bool(len(value))


def _chosen(
    where: str, mechanism: Described, pattern: Any
) -> tuple[list[tuple[RandomisedQuantity, list[int]]], list[str]]:
    """Return matching quantities with the indices of the selected numbers, and names of matching rows and matrices."""
    patterns = [pattern] if isinstance(pattern, str) else pattern
    if not isinstance(patterns, Sequence) or not patterns or not all(isinstance(x, str) for x in patterns):
        raise StudyError(f"{where}: expected a pattern such as '*.mass' or 'arm.com', or a list of patterns.")
    quantities, every = list(_quantities(mechanism)), _rows(mechanism)
    rows = list[str]()
    indices: dict[int, set[int]] = {}
    for one in patterns:
        hits = 0
        exact = any(one in (quantity.name, *quantity.names()) for quantity in quantities)
        matches = str.__eq__ if exact else fnmatch.fnmatchcase  # a name may contain wildcard characters
        for k, quantity in enumerate(quantities):
            names = quantity.names()
            whole = matches(quantity.name, one)
            picked = {i for i, name in enumerate(names) if whole or matches(name, one)}
            hits += len(picked)
            if picked:
                indices.setdefault(k, set()).update(picked)
        refused = [
            name
            for name in every
            if name == one or one.startswith(f"{name}.") or (not exact and fnmatch.fnmatchcase(name, one))
        ]
        rows += refused
        if not hits and refused:
            raise StudyError(f"{where}: {refused[0]} is {ROW}. {REMEDY}.")
        if not hits:
            names = [quantity.name for quantity in quantities]
            listed = ", ".join(names[:LISTED]) + (f" and {len(names) - LISTED} more" if len(names) > LISTED else "")
            raise StudyError(
                f"{where}: no quantity matches {one!r}{did_you_mean(one, names) or '.'} Available: "
                f"{listed or 'no numbers at all'}."
            )
    return [(quantities[k], sorted(found)) for k, found in sorted(indices.items())], list(dict.fromkeys(rows))


def _ends(minimum: float, maximum: float) -> str:
    return range_text(minimum, maximum) if math.isfinite(minimum) or math.isfinite(maximum) else "any number"


def _numbers(quantity: RandomisedQuantity, indices: list[int], law: VariationLaw) -> tuple[Any, list[RandomVariable]]:
    """Return the new value of a scalar or a vector, and its random variables."""
    entries, names = quantity.entries, quantity.names()
    variables: list[RandomVariable] = []
    zero = True
    for k in indices:
        value = entries[k]
        if value.free_symbols:
            zero = False
            law.left.append(f"{names[k]} {_reason(value)}")
            continue
        if law.scales and float(value) == 0:
            continue
        zero = False
        variable = law.variable(names[k], float(value), quantity.units, quantity.minimum, quantity.maximum)
        variables.append(variable)
        entries[k] = variable
    if zero and quantity.stated:
        law.left.append(f"{quantity.name} is zero")
    value = quantity.holder.values[quantity.key]
    return (tuple(entries) if isinstance(value, (tuple, list)) else entries[0]), variables


def _tensor(quantity: RandomisedQuantity, indices: list[int], law: VariationLaw) -> tuple[Any, list[RandomVariable]]:
    """Return an inertia tensor with random factors on its second moments of mass along its principal axes.

    With the second moments ``S``, the tensor is ``trace(S) I - S``.  The tensor is physical for all positive factors.
    """
    entries = quantity.entries
    if any(x.free_symbols for x in entries):
        law.left.append(f"{quantity.name} {_reason(next(x for x in entries if x.free_symbols))}")
        return entries, []
    if law.absolute is not None:
        raise StudyError(
            f"{law.where}: {quantity.name} is an inertia tensor, which absolute= could make physically impossible; "
            "use relative=."
        )
    xx, yy, zz, xy, xz, yz = map(float, entries)
    matrix = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    if not matrix.any():
        law.left.append(f"{quantity.name} is zero")
        return entries, []
    if not any((xy, xz, yz)):
        moments, axes, marks = np.array([xx, yy, zz]), np.eye(3), "xyz"
    else:
        (moments, axes), marks = np.linalg.eigh(matrix), "123"
    second = moments.sum() / 2 - moments

    def factor(name: str) -> RandomVariable:
        return law.variable(name, 1.0, "1", 0.0, math.inf)

    if second.min() < -ROUNDING * second.max():  # rounded numbers of a flat body: scale them by one factor
        one = factor(quantity.name)
        return tuple(x * one for x in entries), [one]
    factors = {k: factor(f"{quantity.name}.{marks[k]}") for k in range(3) if second[k] > ROUNDING * second.max()}
    s = sympy.zeros(3, 3)
    for k, one in factors.items():
        s += one * sympy.Matrix(3, 3, [sympy.Float(second[k] * a * b) for a in axes[:, k] for b in axes[:, k]])
    j = sympy.eye(3) * s.trace() - s
    return (j[0, 0], j[1, 1], j[2, 2], j[0, 1], j[0, 2], j[1, 2]), list(factors.values())


def _reason(value: sympy.Expr) -> str:
    """Return the reason why `Mechanism.randomise` does not change an expression, as text."""
    symbols = sorted(value.free_symbols, key=str)
    if all(isinstance(s, RandomVariable) for s in symbols):
        return f"is already random ({', '.join(map(str, symbols))})"
    return f"is not a plain number ({shown(value)})"


def _warn(where: str, law: VariationLaw, changes: Sequence[tuple[RandomisedQuantity, Any]]) -> None:
    """Warn about unchanged numbers, and about other expressions that already contain old values of changed numbers."""
    if law.left:
        warnings.warn(f"{where}: not randomised: {'; '.join(law.left)}.", StudyWarning, stacklevel=5)
    read = [quantity.name for quantity, _ in changes if quantity.key in quantity.holder.read]
    if read:
        warnings.warn(
            f"{where}: {', '.join(read)} was read before this call, so existing expressions contain the old number. "
            "Call randomise first, so that they contain the random variable.",
            StudyWarning,
            stacklevel=5,
        )


def _settle(mechanism: Described, changes: Sequence[tuple[RandomisedQuantity, Any]]) -> None:
    """Set new values, and recompute the data that components derive from them; after an error, restore all values."""
    holders: list[tuple[str, Component]] = [(f"body {x.name!r}", x.terms) for x in mechanism.bodies.values()]
    holders += [(f"{type(x).__name__} {x.name!r}", x) for x in mechanism.components.values()]
    before: list[tuple[Component, Mapping[str, Any], Mapping[str, Any], Mapping[str, Any]]] = [
        (x, dict(x.given), dict(x.values), dict(x.world_pose)) for _, x in holders
    ]
    try:
        for quantity, value in changes:
            stated_in_bodies(quantity.holder, quantity.key)
            quantity.holder.given[quantity.key] = value
        for where, holder in holders:
            settle(where, holder, mechanism.space)
    except Exception:
        for holder, given, values, world_pose in before:
            holder.given, holder.values, holder.world_pose = dict(given), dict(values), dict(world_pose)
        raise
