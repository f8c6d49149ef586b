"""Sizes of Monte Carlo for a requested accuracy: numbers of samples and of replicates."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import uqmbd
from uqmbd_montecarlo.gathering import allowed_pairs, allowed_samples

if TYPE_CHECKING:
    from uqmbd_montecarlo.propagator import MonteCarlo

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


def sized(method: MonteCarlo) -> uqmbd.extend.Sizing:
    """Return the option and the choice of the number of samples."""
    design, replicates = method.sampling, method.replicates

    def allowed(samples: int) -> int:
        if method.sobol_indices:
            return allowed_pairs(design, samples, replicates)
        return replicated(design, samples, replicates)[0]

    def at(samples: int) -> MonteCarlo:
        count = replicates if method.sobol_indices else replicated(design, samples, replicates)[1]
        return replace(method, samples=samples, replicates=count)

    found = uqmbd.extend.sampling_design(design, "MonteCarlo: sampling")
    also = ("replicates",) if found.base > 1 and not method.sobol_indices else ()
    return uqmbd.extend.Sizing(
        option="samples",
        at=at,
        least=allowed(FIRST if found.independent else max(FIRST, 4 * replicates)),
        allowed=allowed,
        extends=found.independent,
        also=also,
    )
