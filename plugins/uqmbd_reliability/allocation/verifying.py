"""The probability of real realisations, from the count of a surrogate and the realisations at which it is wrong."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.stats import beta

from uqmbd.typing import Array, Mask

__all__ = ["Verified", "verified"]

CONFIDENCE = 0.95


@dataclass(frozen=True)
class Verified:
    """Probability from real realisations, with its 95 % interval."""

    probability: float
    std_error: float
    lower: float
    upper: float
    wrong: int  # realisations that the surrogate classifies wrongly
    failures: int  # realisations that failed


def verified(counted: float, samples: int, predicted: Mask, real: Array) -> Verified:
    """Correct the share `counted` of violations among samples of a surrogate by independent real realisations.

    P = P_surrogate + P(violation, not predicted) - P(predicted, no violation), whose first term is known from many
    samples and whose others are small: far fewer realisations are needed than for a count. The interval adds those of
    Clopper and Pearson, so that it holds for few realisations, too. `predicted` (K,) are violations by the surrogate at
    the real realisations, `real` (K,) their smallest margins; NaN where a realisation failed, which counts as safe in
    the lower bound and as a violation in the upper one.
    """
    count = len(real)
    failed = np.isnan(real)
    violated = real < 0  # of NaN: False
    missed, false = int((violated & ~predicted).sum()), int((predicted & ~violated & ~failed).sum())
    # failures at which the surrogate predicts a violation agree with the upper bound, the others with the lower one
    doubtful, lost = int((failed & ~predicted).sum()), int((failed & predicted).sum())
    share = (missed - false) / max(count - int(failed.sum()), 1)
    own = counted * (1 - counted) / samples
    spread = ((missed + false) / count - share**2) / count + own
    around = 1.96 * np.sqrt(own)
    most, least = _interval(missed + doubtful, count)[1], _interval(missed, count)[0]
    fewest, largest = _interval(false, count)[0], _interval(false + lost, count)[1]
    return Verified(
        float(np.clip(counted + share, 0, 1)),
        float(np.sqrt(max(spread, 0.0))),
        float(np.clip(counted + least - largest - around, 0, 1)),
        float(np.clip(counted + most - fewest + around, 0, 1)),
        missed + false,
        int(failed.sum()),
    )


def _interval(hits: int, count: int) -> tuple[float, float]:
    """Return the interval of Clopper and Pearson; two of them hold together with the confidence."""
    tail = (1 - CONFIDENCE) / 4
    lower = beta.ppf(tail, hits, count - hits + 1) if hits else 0.0
    upper = beta.ppf(1 - tail, hits + 1, count - hits) if hits < count else 1.0
    return float(lower), float(upper)
