"""Verified Rosenblatt transform of a joint distribution."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from uqmbd.randomness.distributions import is_dependent
from uqmbd.randomness.rosenblatt.expressions import NotUnderstood, owners_of
from uqmbd.randomness.rosenblatt.laws import JointLaw, decoded_law
from uqmbd.randomness.rosenblatt.members import conditional
from uqmbd.randomness.rosenblatt.reading import joint_law
from uqmbd.typing import Array

__all__ = ["Transform", "in_blocks"]


BLOCK = 1024
"""Number of rows of dependent inputs that are mapped at once."""

POINTS = 16
"""Number of points at which a map is verified, in addition to points with one component far out."""

RARE = 1e-9
"""Probability beyond which values are not checked."""

LEVELS = np.array([0.05, 0.25, 0.5, 0.75, 0.95])
"""Conditional probabilities at which quantiles must increase."""

ROUGH = 1e-6
"""Accepted error of probabilities of the inverse."""


@dataclass(frozen=True, eq=False)
class _Native:
    """Map that chaospy evaluates, for normal vectors, Gaussian copulas and unknown distributions."""

    distribution: Any

    @property
    def order(self) -> tuple[int, ...]:
        return tuple(int(k) for k in self.distribution._rotation)

    @property
    def given(self) -> tuple[frozenset[int], ...]:
        dependencies = self.distribution._dependencies
        count = range(len(dependencies))
        return tuple(frozenset(j for j in count if j != k and dependencies[j] < dependencies[k]) for k in count)

    @property
    def outer(self) -> frozenset[int]:
        return frozenset()

    @property
    def discrete(self) -> tuple[bool, ...]:
        return (False,) * len(self.distribution)

    @property
    def invertible(self) -> bool:
        return True

    def inverse(self, u: Array, values: Array) -> Array:
        return np.asarray(self.distribution.inv(u), dtype=float)

    def forward(self, x: Array, values: Array) -> Array:
        return np.asarray(np.clip(self.distribution.fwd(x), 0.0, 1.0), dtype=float)

    def encoded(self) -> Any:
        raise NotUnderstood(str(self.distribution))


@dataclass(frozen=True, eq=False)
class Transform:
    """Map of independent uniform variables to dependent variables, and its inverse; points are rows."""

    law: JointLaw
    gaussian: bool = False  # whether chaospy evaluates it, as a normal vector or a Gaussian copula

    @classmethod
    def of(cls, distribution: Any) -> Transform:
        """Return the transform of a joint distribution of chaospy.

        Raise StudyError, whose message is part of a sentence, if a part is not a valid distribution. Raise
        NotUnderstood if the structure is unknown, and chaospy's values are wrong or change from call to call.
        """
        native = _Native(distribution)
        if _gaussian(distribution) and _repeatable(native):
            return cls(native, True)
        try:
            law = joint_law(distribution)
        except NotUnderstood:
            if mistaken := _mistaken(distribution):
                raise NotUnderstood(mistaken) from None
            law = native
        if not _repeatable(law):
            raise NotUnderstood(str(distribution))
        return cls(law)

    @property
    def dimension(self) -> int:
        """Number of components."""
        return len(self.law.order)

    @property
    def invertible(self) -> bool:
        """Whether components determine the uniform variables; a discrete component of a copula does not."""
        return self.law.invertible

    def alone(self, k: int) -> bool:
        """Return whether a component depends on no other component, and no other component on it."""
        return not self.law.given[k] and not any(k in given for given in self.law.given)

    def inverse(self, uniform: Array) -> Array:
        """Map uniform variables, shape (K, n), to components; the bits of a row do not depend on the number of rows."""
        with np.errstate(all="ignore"):
            return self._mapped(self.law.inverse, uniform, 0.5)

    def forward(self, inputs: Array) -> Array:
        """Map components, shape (K, n), to uniform variables; NaN for components that :meth:`inverse` cannot return."""
        middle = self.inverse(np.full((1, self.dimension), 0.5))[0]
        with np.errstate(all="ignore"):
            found = self._mapped(self.law.forward, inputs, middle)
            back = self.inverse(np.where(np.isfinite(found), np.clip(found, 0.0, 1.0), 0.5))
            near = np.abs(back - inputs) <= 1e-6 * (self._spread + np.abs(inputs))
        return np.where(near, found, np.nan)

    def _mapped(self, function: Callable[[Array, Array], Array], rows: Array, filler: ArrayLike) -> Array:
        if isinstance(self.law, _Native):
            return in_blocks(lambda x: function(x, x[:0]), rows, filler)
        found = np.empty_like(rows)
        for first in range(0, len(rows), BLOCK):  # element by element: bits do not depend on the block
            columns = np.ascontiguousarray(rows[first : first + BLOCK].T)
            found[first : first + BLOCK] = function(columns, columns[:0]).T
        return found

    @cached_property
    def text(self) -> str:
        """Text from which :meth:`read` restores the transform; empty if the transform contains functions of a user."""
        points = _verified_at(self.dimension)
        try:
            found = json.dumps(self.law.encoded())
            same = np.array_equal(Transform.read(found).inverse(points), self.inverse(points), equal_nan=True)
        except Exception:  # constructors of families raise any exception
            return ""
        return found if same else ""

    @classmethod
    def read(cls, text: str) -> Transform:
        """Return the transform from its text; raise ValueError if the text does not describe a transform."""
        return cls(decoded_law(json.loads(text)))

    def flaw(self) -> str:
        """Return why the transform does not belong to a distribution; empty if it does.

        Values must be finite and vary. Values of a component must increase with its uniform variable for all
        values of the others. The transform must map the values back to the uniform variables.
        """
        for k in self.law.order:
            if found := self._flaw_of(k):
                return f"of component {k + 1} {found}"
        return ""

    def _flaw_of(self, k: int) -> str:
        base = _verified_at(self.dimension)
        rows = np.repeat(base, len(LEVELS), axis=0)
        rows[:, k] = np.tile(LEVELS, len(base))
        values = self.inverse(rows)
        own = values[:, k].reshape(len(base), len(LEVELS))
        given = sorted(self.law.given[k])

        def where(bad: Any) -> str:
            at = values[:: len(LEVELS)][np.flatnonzero(bad)[0]]
            if not given:
                return ""
            return " where " + " and ".join(f"component {j + 1} is {at[j]:.4g}" for j in given)

        if (bad := ~np.isfinite(own).all(axis=1)).any():
            return f"the values are not finite{where(bad)}"
        steps = np.diff(own, axis=1)
        slack = 1e-12 * np.abs(own).max(axis=1, keepdims=True)
        if (bad := (steps < -slack).any(axis=1)).any():
            return f"the quantiles do not increase{where(bad)}"
        inner = np.arange(len(base)) < POINTS
        span = own.max(axis=1) - own.min(axis=1)
        bad = (span <= 4 * np.finfo(float).eps * np.abs(own[:, 0])) & inner
        if not self.law.discrete[k] and bad.any():
            return f"all values are {own[bad][0, 0]:.4g}{where(bad)}"
        if self.law.discrete[k]:
            return "" if np.ptp(own) > 0 else f"all values are {own[0, 0]:.4g}"
        if not self.invertible:
            return ""
        with np.errstate(all="ignore"):
            back = self.law.forward(values.T, np.empty((0, len(values))))[k].reshape(own.shape)
        # far out, rounding errors of values are comparable with their spread
        if (bad := ~(np.abs(back - LEVELS).max(axis=1) < ROUGH) & inner).any():
            row = np.flatnonzero(bad)[0]
            found = back[row].round(6).tolist()
            return f"the quantiles of the probabilities {LEVELS.tolist()} have the probabilities {found}{where(bad)}"
        return ""

    @cached_property
    def _spread(self) -> Array:
        """Interquartile range (n,) of each component with the others at their medians."""
        quarters = np.full((2 * self.dimension, self.dimension), 0.5)
        quarters[0::2] += 0.25 * np.eye(self.dimension)
        quarters[1::2] -= 0.25 * np.eye(self.dimension)
        found = self.inverse(quarters)
        return np.diagonal(found[0::2] - found[1::2]).copy()


def in_blocks(function: Callable[[Array], Array], rows: Array, filler: ArrayLike) -> Array:
    """Map rows (K, n) in blocks of one size, because rounding of matrix products depends on shape and position.

    `function` maps arrays ``(n, BLOCK)``, a point in each column; the point `filler`, (n,) or (), fills the last block.
    """
    values = np.empty_like(rows)
    for first in range(0, len(rows), BLOCK):
        part = rows[first : first + BLOCK]
        padded = np.empty((BLOCK, rows.shape[1]))
        padded[:] = filler
        padded[: len(part)] = part
        mapped = np.asarray(function(padded.T), dtype=float)
        values[first : first + BLOCK] = mapped.reshape(rows.shape[1], -1).T[: len(part)]
    return values


def _verified_at(dimension: int) -> Array:
    """Return points of the unit cube: a lattice with irrational steps, and points far out."""
    steps = np.sqrt(np.arange(2, 2 + dimension))
    lattice = 0.05 + 0.9 * np.mod(steps * np.arange(1, POINTS + 1)[:, None], 1.0)
    far = np.full((2 * dimension, dimension), 0.5)
    for k in range(dimension):
        far[2 * k : 2 * k + 2, k] = RARE, 1 - RARE
    return np.concatenate([lattice, far])


def _gaussian(distribution: Any) -> bool:
    """Return whether this is a normal vector or Gaussian copula, with marginals that chaospy evaluates correctly."""
    import chaospy

    from uqmbd.randomness.distributions import AffineDistribution

    if isinstance(distribution, (chaospy.MvNormal, chaospy.MvLogNormal)):
        mean = distribution._parameters["mean" if isinstance(distribution, chaospy.MvNormal) else "mu"]
        return not isinstance(mean, chaospy.Distribution)
    if not isinstance(distribution, chaospy.Nataf):
        return False
    margins = distribution._parameters["dist"]
    if is_dependent(margins):
        return False
    return not any(AffineDistribution.of(margins[k]).mends or _whole(margins, k) for k in range(len(margins)))


def _mistaken(distribution: Any) -> str:
    """Return the text of a part that chaospy evaluates wrongly or not at all; empty if there is none."""
    import chaospy

    seen: dict[int, Any] = {}
    parts = [distribution]
    while parts:
        one = parts.pop()
        if not isinstance(one, chaospy.Distribution) or id(one) in seen:
            continue
        seen[id(one)] = one
        if isinstance(one, chaospy.J):
            try:
                parts += [owner for _, owner in owners_of(one).values()]
            except NotUnderstood as part:
                return str(part)
        # of chaospy's copulas, only the normal one with independent marginals is correct
        elif isinstance(one, chaospy.CopulaDistribution):
            margins = one._parameters["dist"]
            if not isinstance(one, chaospy.Nataf) or is_dependent(margins):
                return str(one)
        elif isinstance(one, (chaospy.MvStudentT, chaospy.GaussianKDE)) and len(one) > 1:
            return str(one)
        elif (isinstance(one, chaospy.Trunc) and len(one) > 1) or getattr(one, "interpret_as_integer", False):
            return str(one)
        parts += [*one._parameters.values(), getattr(one, "_dist", None)]
    return ""


def _whole(distribution: Any, k: int) -> bool:
    try:
        return conditional(distribution, {}, k).discrete
    except NotUnderstood:
        return False


def _repeatable(law: JointLaw) -> bool:
    """Return whether each call gives the same bits; searches of chaospy use random steps."""
    u = _verified_at(len(law.order))[:POINTS].T
    state = np.random.get_state()
    try:
        found = []
        for seed in (1, 2):
            np.random.seed(seed)
            with np.errstate(all="ignore"):
                found.append(law.inverse(u, u[:0]))
    finally:
        np.random.set_state(state)
    return bool(np.array_equal(found[0], found[1], equal_nan=True))
