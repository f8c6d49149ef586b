"""Sizes of Monte Carlo for a requested accuracy: numbers of samples and of replicates."""

from __future__ import annotations

from collections.abc import Callable

import uqmbd
from uqmbd_montecarlo.gathering import allowed_pairs, allowed_samples

__all__ = ["replicated", "sized"]

FIRST = 64
"""Initial number of samples if the number is searched; each replicate has at least four samples."""

PARTS = 4
"""Number of steps in which replicates are added until the next size of the design."""


def replicated(design: str, samples: int, replicates: int) -> tuple[int, int]:
    """Return the largest number of samples up to `samples`, and the number of replicates, at least `replicates`.

    For a balanced design, the number of replicates grows by quarters between two sizes of the design. The replicates
    of the smaller number of samples are then the first ones of the larger number. Other designs do not change.

    >>> replicated("sobol", 1500, 16), replicated("sobol", 2047, 16), replicated("latin-hypercube", 1500, 16)
    ((1280, 20), (1792, 28), (1500, 16))
    """
    found = allowed_samples(design, samples, replicates)
    if uqmbd.extend.sampling_design(design).base < 2:
        return found, replicates
    points, step = found // replicates, max(replicates // PARTS, 1)
    count = replicates + max(samples // points - replicates, 0) // step * step
    return count * points, count


def sized(
    changed: Callable[..., uqmbd.extend.Propagator], design: str, replicates: int, *, pairs: bool
) -> uqmbd.extend.Sizing:
    """Return the options and the choice of the numbers of samples and replicates.

    `changed`: function that returns the method with changed options; `design`, `replicates`: options of the method;
    `pairs`: whether the samples form pairs, for which the number of replicates does not change.
    """

    def allowed(samples: int) -> int:
        if pairs:
            return allowed_pairs(design, samples, replicates)
        return replicated(design, samples, replicates)[0]

    def at(samples: int) -> uqmbd.extend.Propagator:
        count = replicates if pairs else replicated(design, samples, replicates)[1]
        return changed(samples=samples, replicates=count)

    found = uqmbd.extend.sampling_design(design, "MonteCarlo: sampling")
    return uqmbd.extend.Sizing(
        option="samples",
        at=at,
        least=allowed(FIRST if found.independent else max(FIRST, 4 * replicates)),
        allowed=allowed,
        extends=found.independent,
    )
