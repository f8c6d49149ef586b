"""Distributions of one variable whose parameters are expressions in other variables.

chaospy evaluates such distributions, too. This module corrects five defects of chaospy. Variables that depend on a
whole number receive the value before rounding. ``chaospy.Trunc`` with two bounds leaves an atom at the upper bound.
Arithmetic on arithmetic has no inverse. A binomial distribution accepts no array of probabilities. Quantiles without a
formula come from a search with random steps, so that each run gives other bits.

Length: each kind of distribution is a class with the same methods, and the decoder of files refers to all kinds.
"""

from __future__ import annotations

import importlib
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
import scipy.special

from uqmbd.randomness.rosenblatt.bisection import bisected
from uqmbd.randomness.rosenblatt.expressions import Expression, NotUnderstood, decoded, encoded, evaluated, used
from uqmbd.typing import Array

__all__ = ["AffineConditional", "Conditional", "Core", "Cut", "Mapped", "Spanned", "decoded_conditional"]


COLLECTION = "chaospy.distributions.collection."
"""Package of the standard families of chaospy; a stored distribution must not name another module."""


class Conditional(Protocol):
    """Distribution of one variable, conditional on values (n, N) of all members of a joint distribution."""

    @property
    def discrete(self) -> bool:
        """Whether the distribution is discrete."""

    @property
    def given(self) -> frozenset[int]:
        """Indices of the members on which the parameters depend."""

    def ends(self, values: Array) -> tuple[Array, Array]:
        """Return the ends of the support, each of shape (N,)."""

    def upto(self, x: Array, values: Array) -> Array:
        """Return the probability of values up to, and including, `x`, shape (N,)."""

    def below(self, x: Array, values: Array) -> Array:
        """Return the probability of values below `x`, shape (N,)."""

    def quantile(self, u: Array, values: Array) -> Array:
        """Return quantiles, shape (N,)."""

    def encoded(self) -> Any:
        """Return the distribution as numbers, texts and lists."""


@dataclass(frozen=True, eq=False)
class Core:
    """Family of chaospy with parameters, evaluated by its formulas."""

    family: Any  # distribution whose formulas are evaluated
    parameters: tuple[tuple[str, Expression], ...]  # keyed by the names in the formulas

    @property
    def discrete(self) -> bool:
        """Whether the distribution takes whole numbers only."""
        return bool(getattr(self.family, "interpret_as_integer", False))

    @property
    def given(self) -> frozenset[int]:
        """Indices of the members on which the parameters depend."""
        return frozenset().union(*(used(expression) for _, expression in self.parameters))

    def ends(self, values: Array) -> tuple[Array, Array]:
        """Return the ends of the support; for whole numbers, the smallest and the largest number."""
        given, shape = self._given(values), values.shape[1]
        low = np.broadcast_to(np.asarray(self.family._lower(**given), dtype=float), shape)
        high = np.broadcast_to(np.asarray(self.family._upper(**given), dtype=float), shape)
        return (np.ceil(low), np.floor(high)) if self.discrete else (low, high)

    def upto(self, x: Array, values: Array) -> Array:
        """Return the probability of values up to `x`."""
        low, high = self.ends(values)
        with np.errstate(all="ignore"):
            if self.discrete:
                x = np.floor(x)
                found = self._counted(np.clip(x, low, high), values)
            else:
                found = np.asarray(self.family._cdf(np.clip(x, low, high), **self._given(values)), dtype=float)
        return np.where(x < low, 0.0, np.where(x >= high, 1.0, np.clip(found, 0.0, 1.0)))

    def below(self, x: Array, values: Array) -> Array:
        """Return the probability of values below `x`."""
        return self.upto(np.ceil(x) - 1, values) if self.discrete else self.upto(x, values)

    def quantile(self, u: Array, values: Array) -> Array:
        """Return quantiles by the formula of the family, or by bisection if it has none."""
        import chaospy

        low, high = self.ends(values)
        if self.discrete:
            below, top = low - 1.0, high.copy()
            while np.any(top - below > 1):
                middle = np.floor((below + top) / 2)
                reached = self.upto(middle, values) >= u
                top, below = np.where(reached, middle, top), np.where(reached, below, middle)
            return top
        given = self._given(values)
        with np.errstate(all="ignore"):
            try:
                found = np.asarray(self.family._ppf(u, **given), dtype=float)
            except chaospy.UnsupportedFeature:
                found = bisected(lambda x: np.asarray(self.family._cdf(x, **given), dtype=float) - u, low, high)
        return np.asarray(np.clip(np.broadcast_to(found, u.shape), low, high))

    def encoded(self) -> Any:
        """Return the distribution as data, with the name of its family."""
        name = f"{type(self.family).__module__}.{type(self.family).__name__}"
        if not name.startswith(COLLECTION):
            raise NotUnderstood(str(self.family))
        return ["core", name[len(COLLECTION) :], {key: encoded(value) for key, value in self.parameters}]

    def _given(self, values: Array) -> dict[str, Any]:
        return {name: np.asarray(evaluated(x, values), dtype=float) for name, x in self.parameters}

    def _counted(self, x: Array, values: Array) -> Array:
        given = self._given(values)
        if type(self.family).__name__ == "binomial":
            rest = np.round(given["size"]) - x
            return np.asarray(scipy.special.betainc(rest, x + 1, 1 - given["prob"]), dtype=float)
        # chaospy spreads each number over an interval of length one
        return np.asarray(self.family._cdf(x + 0.5, **given), dtype=float)


@dataclass(frozen=True, eq=False)
class AffineConditional:
    """Distribution of ``shift + scale * y``."""

    inner: Conditional  # distribution of y
    shift: Expression
    scale: Expression
    turns: bool = False  # whether the scale may be negative, as in arithmetic but not as a parameter of a family

    @property
    def discrete(self) -> bool:
        """Whether the distribution is discrete."""
        return self.inner.discrete

    @property
    def given(self) -> frozenset[int]:
        """Indices of the members on which the parameters depend."""
        return self.inner.given | used(self.shift) | used(self.scale)

    def ends(self, values: Array) -> tuple[Array, Array]:
        """Return the ends of the support."""
        shift, scale = self._map(values)
        low, high = self.inner.ends(values)
        first, last = shift + scale * low, shift + scale * high
        return np.minimum(first, last), np.maximum(first, last)

    def upto(self, x: Array, values: Array) -> Array:
        """Return the probability of values up to `x`."""
        return self._passed(x, values, self.inner.upto, self.inner.below)

    def below(self, x: Array, values: Array) -> Array:
        """Return the probability of values below `x`."""
        return self._passed(x, values, self.inner.below, self.inner.upto)

    def quantile(self, u: Array, values: Array) -> Array:
        """Return quantiles."""
        shift, scale = self._map(values)
        if self.turns:
            u = np.where(scale < 0, 1 - u, u)
        found: Array = shift + scale * self.inner.quantile(u, values)
        return found

    def encoded(self) -> Any:
        """Return the distribution as data."""
        return ["moved", self.inner.encoded(), encoded(self.shift), encoded(self.scale), self.turns]

    def _map(self, values: Array) -> tuple[Any, Any]:
        return evaluated(self.shift, values), evaluated(self.scale, values)

    def _passed(
        self, x: Array, values: Array, up: Callable[[Array, Array], Array], down: Callable[[Array, Array], Array]
    ) -> Array:
        shift, scale = self._map(values)
        y = (x - shift) / scale
        if self.discrete:
            near = np.rint(y)  # removes the rounding of an affine map of a whole number
            y = np.where(np.abs(y - near) <= 1e-9 * np.maximum(1.0, np.abs(near)), near, y)
        turned = np.broadcast_to(np.asarray(scale) < 0, y.shape)
        if not turned.any():
            return up(y, values)
        return np.where(turned, 1 - down(y, values), up(y, values))


@dataclass(frozen=True, eq=False)
class Spanned:
    """Distribution of bounded support, mapped linearly to other ends."""

    inner: Conditional
    lower: Expression
    upper: Expression

    @property
    def discrete(self) -> bool:
        """Whether the distribution is discrete."""
        return self.inner.discrete

    @property
    def given(self) -> frozenset[int]:
        """Indices of the members on which the parameters depend."""
        return self.inner.given | used(self.lower) | used(self.upper)

    def ends(self, values: Array) -> tuple[Array, Array]:
        """Return the ends of the support."""
        shape = values.shape[1]
        low, high = (np.broadcast_to(evaluated(end, values), shape) for end in (self.lower, self.upper))
        return low, high

    def upto(self, x: Array, values: Array) -> Array:
        """Return the probability of values up to `x`."""
        low, first, stretch = self._map(values)
        return self.inner.upto(first + (x - low) / stretch, values)

    def below(self, x: Array, values: Array) -> Array:
        """Return the probability of values below `x`."""
        return self.upto(x, values)

    def quantile(self, u: Array, values: Array) -> Array:
        """Return quantiles."""
        low, first, stretch = self._map(values)
        found: Array = low + stretch * (self.inner.quantile(u, values) - first)
        return found

    def encoded(self) -> Any:
        """Return the distribution as data."""
        return ["spanned", self.inner.encoded(), encoded(self.lower), encoded(self.upper)]

    def _map(self, values: Array) -> tuple[Array, Array, Array]:
        (low, high), (first, last) = self.ends(values), self.inner.ends(values)
        return low, first, (high - low) / (last - first)


@dataclass(frozen=True, eq=False)
class Cut:
    """Truncated distribution; a missing bound is None."""

    inner: Conditional
    lower: Expression | None
    upper: Expression | None

    @property
    def discrete(self) -> bool:
        """Whether the distribution is discrete."""
        return self.inner.discrete

    @property
    def given(self) -> frozenset[int]:
        """Indices of the members on which the parameters depend."""
        return self.inner.given.union(*(used(end) for end in (self.lower, self.upper) if end is not None))

    def ends(self, values: Array) -> tuple[Array, Array]:
        """Return the ends of the support."""
        low, high = self.inner.ends(values)
        return (
            low if self.lower is None else np.maximum(low, evaluated(self.lower, values)),
            high if self.upper is None else np.minimum(high, evaluated(self.upper, values)),
        )

    def upto(self, x: Array, values: Array) -> Array:
        """Return the probability of values up to `x`."""
        first, mass = self._mass(values)
        return np.clip((self.inner.upto(x, values) - first) / mass, 0.0, 1.0)

    def below(self, x: Array, values: Array) -> Array:
        """Return the probability of values below `x`."""
        first, mass = self._mass(values)
        return np.clip((self.inner.below(x, values) - first) / mass, 0.0, 1.0)

    def quantile(self, u: Array, values: Array) -> Array:
        """Return quantiles."""
        first, mass = self._mass(values)
        found: Array = np.clip(self.inner.quantile(first + u * mass, values), *self.ends(values))
        return found

    def encoded(self) -> Any:
        """Return the distribution as data."""
        ends = [None if end is None else encoded(end) for end in (self.lower, self.upper)]
        return ["cut", self.inner.encoded(), *ends]

    def _mass(self, values: Array) -> tuple[Array, Array]:
        shape = values.shape[1]
        first, last = np.zeros(shape), np.ones(shape)
        if self.lower is not None:
            first = self.inner.below(np.broadcast_to(evaluated(self.lower, values), shape), values)
        if self.upper is not None:
            last = self.inner.upto(np.broadcast_to(evaluated(self.upper, values), shape), values)
        return first, last - first


@dataclass(frozen=True, eq=False)
class Mapped:
    """Monotone function of a continuous variable y.

    The function is ``y ** number``, ``number ** y``, or the logarithm of y to the base `number`.
    """

    inner: Conditional
    kind: str  # "power", "exponential" or "logarithm"
    number: float

    @property
    def discrete(self) -> bool:
        """Whether the distribution is discrete."""
        return self.inner.discrete

    @property
    def given(self) -> frozenset[int]:
        """Indices of the members on which the parameters depend."""
        return self.inner.given

    @property
    def _falls(self) -> bool:
        return self.number < 0 if self.kind == "power" else self.number < 1

    def ends(self, values: Array) -> tuple[Array, Array]:
        """Return the ends of the support."""
        first, last = (self._forth(end) for end in self.inner.ends(values))
        return np.minimum(first, last), np.maximum(first, last)

    def upto(self, x: Array, values: Array) -> Array:
        """Return the probability of values up to `x`."""
        y = self._back(x)
        return 1 - self.inner.below(y, values) if self._falls else self.inner.upto(y, values)

    def below(self, x: Array, values: Array) -> Array:
        """Return the probability of values below `x`."""
        y = self._back(x)
        return 1 - self.inner.upto(y, values) if self._falls else self.inner.below(y, values)

    def quantile(self, u: Array, values: Array) -> Array:
        """Return quantiles."""
        return self._forth(self.inner.quantile(1 - u if self._falls else u, values))

    def encoded(self) -> Any:
        """Return the distribution as data."""
        return ["mapped", self.inner.encoded(), self.kind, self.number]

    def _forth(self, y: Array) -> Array:
        with np.errstate(all="ignore"):
            if self.kind == "power":
                return np.asarray(np.power(y, self.number))
            if self.kind == "exponential":
                return np.asarray(np.power(self.number, y))
            return np.asarray(np.log(y) / np.log(self.number))

    def _back(self, x: Array) -> Array:
        with np.errstate(all="ignore"):
            if self.kind == "power":
                return np.asarray(np.sign(x) * np.abs(x) ** (1 / self.number))
            if self.kind == "exponential":
                return np.asarray(np.log(x) / np.log(self.number))
            return np.asarray(np.power(self.number, x))


def decoded_conditional(data: Any) -> Conditional:
    """Return the distribution from its ``encoded`` form; raise ValueError for other data."""
    kind, *parts = data
    if kind == "core":
        import chaospy

        module, _, name = parts[0].rpartition(".")
        family = getattr(importlib.import_module(COLLECTION + module), name)
        if not (isinstance(family, type) and issubclass(family, chaospy.SimpleDistribution)):
            raise ValueError(f"{parts[0]!r} is not a family of chaospy")
        parameters = tuple((key, decoded(value)) for key, value in parts[1].items())
        # formulas take all parameters as arguments, so those of the constructor are unused
        try:
            made = family(**{key: value if isinstance(value, float) else 1.0 for key, value in parameters})
        except Exception:  # the constructor checks its arguments
            made = object.__new__(family)
        return Core(made, parameters)
    inner = decoded_conditional(parts[0])
    if kind == "moved":
        return AffineConditional(inner, decoded(parts[1]), decoded(parts[2]), bool(parts[3]))
    if kind == "spanned":
        return Spanned(inner, decoded(parts[1]), decoded(parts[2]))
    if kind == "cut":
        return Cut(inner, *(None if end is None else decoded(end) for end in parts[1:3]))
    if kind == "mapped":
        return Mapped(inner, str(parts[1]), float(parts[2]))
    raise ValueError(f"unknown kind of distribution {kind!r}")
