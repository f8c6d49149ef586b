"""Joint distributions as maps of independent uniform variables: the Rosenblatt transform and its inverse."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np

from uqmbd.randomness.rosenblatt.conditionals import Conditional, decoded_conditional
from uqmbd.randomness.rosenblatt.copulas import Copula, decoded_copula
from uqmbd.randomness.rosenblatt.expressions import Expression, decoded, encoded, evaluated, used
from uqmbd.randomness.rosenblatt.vectors import NormalMixture, Vector
from uqmbd.typing import Array

__all__ = ["AffineJoint", "Chain", "Copulated", "JointLaw", "Single", "ChainStep", "decoded_law"]


class JointLaw(Protocol):
    """Distribution of several variables, as a map of points in columns, shape (n, N).

    The parameters may depend on values (m, N) of a larger distribution, of which this distribution is a part.
    """

    @property
    def order(self) -> tuple[int, ...]:
        """Components in the order of conditioning."""

    @property
    def given(self) -> tuple[frozenset[int], ...]:
        """For each component, the other components on which its distribution depends, directly or indirectly."""

    @property
    def outer(self) -> frozenset[int]:
        """Indices of the variables of the larger distribution on which the parameters depend."""

    @property
    def discrete(self) -> tuple[bool, ...]:
        """Whether each component is discrete."""

    @property
    def invertible(self) -> bool:
        """Whether components determine the uniform variables; a discrete component of a copula does not."""

    def inverse(self, u: Array, values: Array) -> Array:
        """Map independent uniform variables to components."""

    def forward(self, x: Array, values: Array) -> Array:
        """Map components to independent uniform variables; map a discrete value to the middle of its interval."""

    def encoded(self) -> Any:
        """Return the distribution as numbers, texts and lists; raise NotUnderstood if it contains user functions."""


@dataclass(frozen=True, eq=False)
class Single:
    """Distribution of one variable."""

    law: Conditional

    @property
    def order(self) -> tuple[int, ...]:
        """Index of the component."""
        return (0,)

    @property
    def given(self) -> tuple[frozenset[int], ...]:
        """Empty set: there is no other component."""
        return (frozenset(),)

    @property
    def outer(self) -> frozenset[int]:
        """Indices of the variables of the larger distribution on which the parameters depend."""
        return self.law.given

    @property
    def discrete(self) -> tuple[bool, ...]:
        """Whether the component is discrete."""
        return (self.law.discrete,)

    @property
    def invertible(self) -> bool:
        """Whether components determine the uniform variables; a discrete component of a copula does not."""
        return True

    def inverse(self, u: Array, values: Array) -> Array:
        """Return quantiles."""
        return self.law.quantile(u[0], values)[None, :]

    def forward(self, x: Array, values: Array) -> Array:
        """Return probabilities."""
        found = self.law.upto(x[0], values)
        if self.law.discrete:
            found = (found + self.law.below(x[0], values)) / 2
        return found[None, :]

    def encoded(self) -> Any:
        """Return the distribution as data."""
        return ["single", self.law.encoded()]


@dataclass(frozen=True, eq=False)
class ChainStep:
    """Components of a chain that are drawn together."""

    columns: tuple[int, ...]  # indices of the components in the chain
    law: JointLaw  # joint distribution, given the components of earlier steps


@dataclass(frozen=True, eq=False)
class Chain:
    """Sequence of distributions, whose parameters may depend on earlier components."""

    steps: tuple[ChainStep, ...]
    """Indices in parameters refer first to the variables of a larger distribution, then to components of the chain."""
    outside: int = 0  # number of these variables; 0 without a larger distribution

    @property
    def order(self) -> tuple[int, ...]:
        """Components in the order of conditioning."""
        return tuple(step.columns[k] for step in self.steps for k in step.law.order)

    @property
    def given(self) -> tuple[frozenset[int], ...]:
        """For each component, the other components on which its distribution depends."""
        found: dict[int, frozenset[int]] = {}
        for step in self.steps:
            own = frozenset(k - self.outside for k in step.law.outer if k >= self.outside)
            outer = own.union(*(found[k] for k in own))
            for k in step.law.order:
                found[step.columns[k]] = outer | {step.columns[j] for j in step.law.given[k]}
        return tuple(found[k] for k in range(len(found)))

    @property
    def outer(self) -> frozenset[int]:
        """Indices of the variables of the larger distribution on which the parameters depend."""
        return frozenset(k for step in self.steps for k in step.law.outer if k < self.outside)

    @property
    def discrete(self) -> tuple[bool, ...]:
        """Whether each component is discrete."""
        found = {column: step.law.discrete[k] for step in self.steps for k, column in enumerate(step.columns)}
        return tuple(found[k] for k in range(len(found)))

    @property
    def invertible(self) -> bool:
        """Whether components determine the uniform variables; a discrete component of a copula does not."""
        return all(step.law.invertible for step in self.steps)

    def inverse(self, u: Array, values: Array) -> Array:
        """Map independent uniform variables to components."""
        x = np.concatenate([values[: self.outside], np.zeros_like(u)])
        for step in self.steps:
            x[[self.outside + k for k in step.columns]] = step.law.inverse(u[list(step.columns)], x)
        return x[self.outside :]

    def forward(self, x: Array, values: Array) -> Array:
        """Map components to independent uniform variables."""
        u, known = np.zeros_like(x), np.concatenate([values[: self.outside], x])
        for step in self.steps:
            rows = list(step.columns)
            u[rows] = step.law.forward(x[rows], known)
        return u

    def encoded(self) -> Any:
        """Return the distribution as data."""
        steps = [[list(step.columns), step.law.encoded()] for step in self.steps]
        return ["chain", steps, self.outside] if self.outside else ["chain", steps]


@dataclass(frozen=True, eq=False)
class Copulated:
    """Joint distribution from a copula and from the marginal distributions of another joint distribution."""

    copula: Copula
    margins: JointLaw

    @property
    def order(self) -> tuple[int, ...]:
        """Components in the order of conditioning."""
        return self.copula.order

    @property
    def given(self) -> tuple[frozenset[int], ...]:
        """For each component, the other components on which its distribution depends."""
        place = {k: number for number, k in enumerate(self.order)}
        return tuple(
            frozenset(self.order[: place[k]]) | self.margins.given[k] - {k} for k in range(len(self.margins.given))
        )

    @property
    def outer(self) -> frozenset[int]:
        """Indices of the variables of the larger distribution on which the parameters depend."""
        return self.margins.outer

    @property
    def discrete(self) -> tuple[bool, ...]:
        """Whether each component is discrete."""
        return self.margins.discrete

    @property
    def invertible(self) -> bool:
        """Whether components determine the uniform variables; a discrete component of a copula does not."""
        return self.margins.invertible and not any(self.margins.discrete)

    def inverse(self, u: Array, values: Array) -> Array:
        """Map independent uniform variables to components."""
        return self.margins.inverse(self.copula.inverse(u), values)

    def forward(self, x: Array, values: Array) -> Array:
        """Map components to independent uniform variables."""
        return self.copula.forward(self.margins.forward(x, values))

    def encoded(self) -> Any:
        """Return the distribution as data."""
        return ["copulated", self.copula.encoded(), self.margins.encoded()]


@dataclass(frozen=True, eq=False)
class AffineJoint:
    """Shifted and scaled components."""

    inner: JointLaw
    shift: tuple[Expression, ...]
    scale: tuple[Expression, ...]  # of each component, may be negative

    @property
    def order(self) -> tuple[int, ...]:
        """Components in the order of conditioning."""
        return self.inner.order

    @property
    def given(self) -> tuple[frozenset[int], ...]:
        """For each component, the other components on which its distribution depends."""
        return self.inner.given

    @property
    def outer(self) -> frozenset[int]:
        """Indices of the variables of the larger distribution on which the parameters depend."""
        return self.inner.outer.union(*map(used, (*self.shift, *self.scale)))

    @property
    def discrete(self) -> tuple[bool, ...]:
        """Whether each component is discrete."""
        return self.inner.discrete

    @property
    def invertible(self) -> bool:
        """Whether components determine the uniform variables; a discrete component of a copula does not."""
        return self.inner.invertible

    def inverse(self, u: Array, values: Array) -> Array:
        """Map independent uniform variables to components."""
        shift, scale = self._map(values)
        return shift + scale * self.inner.inverse(np.where(scale < 0, 1 - u, u), values)

    def forward(self, x: Array, values: Array) -> Array:
        """Map components to independent uniform variables."""
        shift, scale = self._map(values)
        u = self.inner.forward((x - shift) / scale, values)
        return np.where(scale < 0, 1 - u, u)

    def encoded(self) -> Any:
        """Return the distribution as data."""
        return ["moved", self.inner.encoded(), *([encoded(x) for x in part] for part in (self.shift, self.scale))]

    def _map(self, values: Array) -> tuple[Array, Array]:
        shape = values.shape[1]
        shift, scale = (
            np.stack([np.broadcast_to(np.asarray(evaluated(x, values), dtype=float), shape) for x in part])
            for part in (self.shift, self.scale)
        )
        return shift, scale


def decoded_law(data: Any) -> JointLaw:
    """Return the distribution from its ``encoded`` form; raise ValueError for other data."""
    kind, *parts = data
    if kind == "single":
        return Single(decoded_conditional(parts[0]))
    if kind == "chain":
        steps = tuple(ChainStep(tuple(map(int, columns)), decoded_law(law)) for columns, law in parts[0])
        return Chain(steps, *map(int, parts[1:2]))
    if kind == "copulated":
        return Copulated(decoded_copula(parts[0]), decoded_law(parts[1]))
    if kind == "vector":
        freedom = np.inf if parts[3] is None else float(parts[3])
        centre, order = tuple(map(decoded, parts[0])), tuple(map(int, parts[2]))
        return Vector(centre, np.array(parts[1], dtype=float), order, freedom, bool(parts[4]))
    if kind == "mixture":
        weights, centres, factors = (np.array(part, dtype=float) for part in parts[:3])
        return NormalMixture(weights, centres, factors, tuple(map(int, parts[3])))
    if kind == "moved":
        return AffineJoint(decoded_law(parts[0]), tuple(map(decoded, parts[1])), tuple(map(decoded, parts[2])))
    raise ValueError(f"unknown kind of joint distribution {kind!r}")
