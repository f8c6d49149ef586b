"""Decomposition of univariate distributions of chaospy into a core, an affine map and a truncation.

chaospy nests distributions: ``chaospy.Normal(mu, sigma)`` shifts and scales a standard distribution, arithmetic adds
layers, and a joint distribution of one variable is another layer. This module corrects three defects. Infinite
supports end at probabilities of about 1e-15, where moments of high degree are not negligible yet. Arithmetic on
arithmetic (``2 * X + 1``) has no inverse. ``chaospy.Trunc`` with a lower *and* an upper bound leaves an atom at the
upper bound: it divides by ``(1 - F(lower)) F(upper)``, not by ``F(upper) - F(lower)``.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from uqmbd.typing import Array

__all__ = ["AffineDistribution", "is_dependent"]


@dataclass(frozen=True, eq=False)
class AffineDistribution:
    """Distribution of ``shift + scale * y``, with ``y`` distributed as a core, possibly truncated."""

    core: Any  # chaospy distribution that is neither affine nor truncated, or the truncated `AffineDistribution`
    shift: float = 0.0
    scale: float = 1.0  # a negative scale reverses the distribution
    cut: tuple[float, float] | None = None  # bounds of the truncation, in the variable of the core
    operations: int = 0  # sums, products and changes of sign that were decomposed

    @classmethod
    def of(cls, distribution: Any) -> AffineDistribution:
        """Decompose a distribution of one variable, as far as its structure is known."""
        law = cls(distribution)
        while law.cut is None:
            inner = law._peel()
            if inner is None:
                break
            law = inner
        return law

    @property
    def kind(self) -> str:
        """Name of the class of the core, such as ``"normal"``, or ``"truncation"``."""
        return "truncation" if self.cut is not None else type(self.core).__name__

    @property
    def discrete(self) -> bool:
        """Whether the core takes integers only."""
        return self.core.discrete if self.cut is not None else bool(getattr(self.core, "interpret_as_integer", False))

    def parameters(self, *names: str) -> tuple[float, ...]:
        """Return parameters of the core by name."""
        return tuple(float(np.ravel(self.core._parameters[name])[0]) for name in names)

    @property
    def mends(self) -> bool:
        """Whether the inverse of chaospy is wrong or fails, as for truncations and arithmetic on arithmetic."""
        return self.cut is not None or self.operations > 1

    @property
    def bounds(self) -> tuple[float, float]:
        """Ends of the support; as in chaospy, an infinite support ends at a finite bound far out."""
        low, high = self._ends_of_core() if self.cut is None else self.core.bounds
        if self.cut is not None:
            low, high = max(low, self.cut[0]), min(high, self.cut[1])
        ends = sorted((self.shift + self.scale * low, self.shift + self.scale * high))
        return ends[0], ends[1]

    def pdf(self, x: Array) -> Array:
        """Return the density at `x`; with a formula of the core, also beyond the bounds of chaospy."""
        y = (x - self.shift) / self.scale
        with np.errstate(all="ignore"):
            if self.cut is not None:
                below, above = self._mass()
                density = np.where((y >= self.cut[0]) & (y <= self.cut[1]), self.core.pdf(y) / (above - below), 0.0)
            elif self._simple:
                raw = self.core._pdf(y, **self.core._parameters)
                density = np.broadcast_to(np.asarray(raw, dtype=float), y.shape)
            else:
                density = np.asarray(self.core.pdf(y), dtype=float)
        return np.where(np.isfinite(density), density, 0.0) / abs(self.scale)

    def cdf(self, x: Array) -> Array:
        """Return the cumulative probability at `x`."""
        values: Array
        y = (x - self.shift) / self.scale
        if self.cut is not None:
            below, above = self._mass()
            values = np.clip((self.core.cdf(np.clip(y, *self.cut)) - below) / (above - below), 0, 1)
        else:
            with np.errstate(all="ignore"):
                values = np.asarray(self.core.fwd(y), dtype=float).reshape(y.shape)
        return values if self.scale > 0 else 1 - values

    def quantile(self, u: Array) -> Array:
        """Return quantiles at the probabilities `u`."""
        y: Array
        p = u if self.scale > 0 else 1 - u
        if self.cut is not None:
            below, above = self._mass()
            y = np.clip(self.core.quantile(below + p * (above - below)), *self.cut)
        else:
            with np.errstate(all="ignore"):
                y = np.asarray(self.core.inv(p), dtype=float).reshape(p.shape)
        return self.shift + self.scale * y

    def far_quantile(self, u: Array) -> Array:
        """Return quantiles; with a formula of the core, without clipping at the bounds of chaospy."""
        if self.cut is None and self._simple:
            import chaospy

            p = u if self.scale > 0 else 1 - u
            try:
                with np.errstate(all="ignore"):
                    y = np.asarray(self.core._ppf(p, **self.core._parameters), dtype=float)
            except chaospy.UnsupportedFeature:
                return self.quantile(u)
            if y.shape == p.shape and np.isfinite(y).all():
                return self.shift + self.scale * y
        return self.quantile(u)

    @property
    def formula(self) -> bool:
        """Whether the density is a formula that is valid beyond the bounds of chaospy."""
        return bool(self.core.formula) if self.cut is not None else self._simple

    def _ends_of_core(self) -> tuple[float, float]:
        low, high = _ends(self.core)
        if not self._simple or self.discrete:
            return low, high
        # chaospy moves some finite ends inwards, to a probability of 1e-12
        import chaospy

        try:
            with np.errstate(all="ignore"):
                first, last = np.ravel(self.core._ppf(np.array([0.0, 1.0]), **self.core._parameters)).astype(float)
        except (chaospy.UnsupportedFeature, ValueError):
            return low, high
        near = (high - low) / 2
        return (first if low - near < first < low else low), (last if high < last < high + near else high)

    @property
    def _simple(self) -> bool:
        import chaospy

        numeric = not any(isinstance(p, chaospy.Distribution) for p in self.core._parameters.values())
        return isinstance(self.core, chaospy.SimpleDistribution) and numeric

    def _mass(self) -> tuple[float, float]:
        assert self.cut is not None
        below, above = self.core.cdf(np.array(self.cut))
        return float(below), float(above)

    def _peel(self) -> AffineDistribution | None:
        """Return the distribution without its outer layer; None if there is no layer of a known type."""
        import chaospy

        core = self.core
        given = getattr(core, "_parameters", {})
        if isinstance(core, chaospy.ItemDistribution):
            parent, index = given["parent"], int(given["index"])
            if isinstance(parent, chaospy.J) and not parent.stochastic_dependent:
                place, owner = parent._owners[index]
                return replace(self, core=owner if len(owner) == 1 else owner[place])
            return None
        if isinstance(core, chaospy.J) and len(core) == 1:
            return replace(self, core=core._owners[0][1])
        if isinstance(core, chaospy.Trunc):
            return self._truncated()
        if isinstance(core, chaospy.ShiftScaleDistribution):
            shift, scale = _number(given["shift"]), _number(given["scale"])
            return self._inside(core._dist, shift, scale)
        if isinstance(core, chaospy.LowerUpperDistribution):
            lower, upper = _number(given["lower"]), _number(given["upper"])
            if lower is None or upper is None:
                return None
            low, high = _ends(core._dist)
            stretch = (upper - lower) / (high - low)
            return self._inside(core._dist, lower - low * stretch, stretch)
        if isinstance(core, (chaospy.Add, chaospy.Multiply, chaospy.Negative)):
            left, right = given["left"], given["right"]
            self = replace(self, operations=self.operations + 1)
            if isinstance(core, chaospy.Negative):
                return self._inside(left, 0.0, -1.0)
            inner, other = (left, right) if isinstance(left, chaospy.Distribution) else (right, left)
            number = _number(other)
            product = isinstance(core, chaospy.Multiply)
            return self._inside(inner, 0.0 if product else number, number if product else 1.0)
        return None

    def _inside(self, inner: Any, shift: float | None, scale: float | None) -> AffineDistribution | None:
        if shift is None or not scale:
            return None
        return replace(self, core=inner, shift=self.shift + self.scale * shift, scale=self.scale * scale)

    def _truncated(self) -> AffineDistribution | None:
        lower, upper = (_number(self.core._parameters[side]) for side in ("lower", "upper"))
        if lower is None or upper is None:
            return None
        inner = self.core._dist
        low, high = _ends(inner)
        cut = (-np.inf if lower <= low else lower, np.inf if upper >= high else upper)
        law = AffineDistribution.of(inner)
        if law.discrete or cut == (-np.inf, np.inf):
            return None if law.discrete else replace(self, core=inner)
        return replace(self, core=law, cut=cut)


def is_dependent(distribution: Any) -> bool:
    """Return whether the components of a distribution are dependent; a truncation hides this property of its core."""
    wrapped = getattr(distribution, "_dist", None) is not None
    return len(distribution) > 1 and bool(distribution.stochastic_dependent or wrapped)


def _number(value: Any) -> float | None:
    import chaospy

    if isinstance(value, chaospy.Distribution):
        return None
    array = np.ravel(np.asarray(value, dtype=float))
    return float(array[0]) if array.size == 1 else None


def _ends(distribution: Any) -> tuple[float, float]:
    return float(np.ravel(distribution.lower)[0]), float(np.ravel(distribution.upper)[0])
