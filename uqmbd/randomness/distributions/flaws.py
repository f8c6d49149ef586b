"""Check of distributions: chaospy accepts invalid parameters, and then samples a constant or NaN."""

from __future__ import annotations

from typing import Any

import numpy as np

from uqmbd.randomness.distributions.decomposed import AffineDistribution, is_dependent

__all__ = ["flaw_of"]


LEVELS = np.array([1e-3, 0.05, 0.25, 0.5, 0.75, 0.95, 1 - 1e-3])
"""Probabilities at which quantiles are checked; even the heaviest tails have finite quantiles at these."""

RARE = 1e-9
"""Probability beyond which a discrete distribution is not checked."""

ROUGH = 1e-3
"""Accepted decrease of consecutive quantiles, relative to their span, because quantiles from iterations have errors."""

MISFIT = 0.1
"""Accepted error of the probabilities of quantiles, because of iterations and cuts of infinite supports."""

POINTS = 16
"""Number of points at which the map of a dependent distribution is checked."""


def flaw_of(distribution: Any) -> str:
    """Return why a distribution of any dimension is invalid; empty if it is valid.

    Quantiles of the distribution and of all its parts must be finite and increase; arithmetic may hide an invalid part.

    >>> import chaospy
    >>> flaw_of(chaospy.Normal(1, 0.02)), flaw_of(chaospy.Normal(1, -0.02))
    ('', 'all of its quantiles are 0.8356')
    """
    with np.errstate(all="ignore"):
        try:
            return _flaw(distribution)
        except Exception as error:  # any exception, because chaospy has no common class for bad parameters
            text = " ".join(str(error).split())
            return f"chaospy cannot sample it ({text or type(error).__name__})"


def _flaw(distribution: Any) -> str:
    if len(distribution) > 1:
        if is_dependent(distribution):
            return _flaw_of_map(distribution)
        flaws = [(k, _flaw(part)) for k, part in enumerate(distribution)]
        return next((f"of component {k + 1} {flaw}" for k, flaw in flaws if flaw), "")
    # check this first: chaospy may search endlessly for quantiles with such a parameter
    if name := _not_a_number(distribution):
        return f"its parameter {name} is not a number"
    law = AffineDistribution.of(distribution)
    levels = np.array([RARE, *LEVELS, 1 - RARE]) if law.discrete else LEVELS
    quantiles = law.quantile(levels) if law.mends else np.ravel(distribution.inv(levels)).astype(float)
    if law.discrete and law.cut is None:
        # chaospy spreads each integer over an interval of length one
        quantiles = np.rint((quantiles - law.shift) / law.scale) * law.scale + law.shift
    if not np.isfinite(quantiles).all():
        return f"its quantiles are {', '.join(f'{x:g}' for x in dict.fromkeys(quantiles.tolist()))}"
    span = quantiles.max() - quantiles.min()
    if span <= 4 * np.finfo(float).eps * np.abs(quantiles).max():
        return f"all of its quantiles are {quantiles[0]:.4g}"
    if (np.diff(quantiles) < -ROUGH * span).any():
        return "its quantiles do not increase"
    if not law.discrete:
        passed = law.cdf(quantiles) if law.mends else np.ravel(distribution.fwd(quantiles)).astype(float)
        if not np.abs(passed - levels).max() < MISFIT:
            return (
                f"its quantiles ({', '.join(f'{x:.4g}' for x in quantiles)}) do not correspond to their probabilities"
            )
    return next((flaw for flaw in map(_flaw, _inner(distribution)) if flaw), "")


def _inner(distribution: Any) -> list[Any]:
    """Return the distributions inside a distribution."""
    import chaospy

    parts = [getattr(distribution, "_dist", None), *distribution._parameters.values()]
    return [part for part in parts if isinstance(part, chaospy.Distribution)]


def _not_a_number(distribution: Any) -> str:
    """Return the name of a NaN parameter of a distribution or its parts; empty if there is none."""
    inner = _inner(distribution)
    numbers = {name: x for name, x in distribution._parameters.items() if not any(x is part for part in inner)}
    bad = [name for name, x in numbers.items() if np.isnan(np.asarray(x, dtype=float)).any()]
    return next((name for name in [*bad, *map(_not_a_number, inner)] if name), "")


def _flaw_of_map(distribution: Any) -> str:
    """Return a flaw of dependent variables at given points of the unit cube; empty if there is none."""
    steps = np.sqrt(np.arange(2, 2 + len(distribution)))[:, None]  # a lattice with irrational steps
    points = 0.05 + 0.9 * np.mod(steps * np.arange(1, POINTS + 1), 1.0)
    values = np.asarray(distribution.inv(points), dtype=float)
    for k, row in enumerate(values):
        if not np.isfinite(row).all():
            return f"of component {k + 1} its values are not finite"
        if np.ptp(row) <= 4 * np.finfo(float).eps * np.abs(row).max():
            return f"of component {k + 1} all of its values are {row[0]:.4g}"
    return ""
