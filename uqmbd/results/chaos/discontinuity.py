"""Detect discontinuities in the germ space from a large stated error and slowly decaying coefficients."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from uqmbd.results.chaos.decay import decay_rate
from uqmbd.results.chaos.interface import Surrogate
from uqmbd.results.chaos.stated_error import reference_spread
from uqmbd.typing import Array
from uqmbd.wording import format_factor, format_percent

__all__ = ["Discontinuity", "find_discontinuities"]


LARGE = 0.05
"""Stated error, over the standard deviation, above which an output may be discontinuous."""

SLOW = 0.35
"""Decay rate, decades per order, below which the decay is slow; tails fall as n^-1.5 at a kink, n^-0.5 at a jump."""

CLEAR = 0.14
"""Decay rate, decades per order, below which a discontinuity is certain; smooth responses of large spread reached
0.146."""

FEWEST = 3
"""Minimum order for a reliable estimate of the decay."""

STEEP = 0.3
"""Fraction of the error that remains after two more orders; below it the response is smooth, but the order too low."""

SPREADS = 0.1
"""Minimum standard deviation, as a fraction of its maximum; other times are ignored."""


@dataclass(frozen=True)
class Discontinuity:
    """Suspected discontinuity of an output as a function of an input.

    Attributes
    ----------
    output, germ : str
        Names of the output and of the germ with most of the energy of the top order.
    since, worst : float or None
        First time (s) at which the discontinuity is detected, and time of the largest error; None without times.
    error : float
        Largest stated error, over the standard deviation.
    rate : float
        Decay of the remaining standard deviation at that time, decades per order.
    order : int
        Order of the chaos.

    Examples
    --------
    >>> from uqmbd.results.chaos import Discontinuity
    >>> step = Discontinuity("height", "speed", since=0.5, worst=1.0, error=0.2, rate=0.05, order=6)
    >>> step.clear
    True
    >>> print(step.words().partition(":")[0])
    height looks discontinuous, or has a kink, in speed from t = 0.5 s on
    """

    output: str
    germ: str
    since: float | None
    worst: float | None
    error: float
    rate: float
    order: int

    @property
    def clear(self) -> bool:
        """Whether the discontinuity is certain, so that the method issues a warning in addition to a verdict."""
        return self.rate < CLEAR and self.order >= FEWEST

    def words(self, *, events: bool = False) -> str:
        """Return a sentence; if the mechanism has `events`, the sentence also proposes alignment.

        Examples
        --------
        >>> Discontinuity("height", "drop", 0.45, 0.5, 0.3, 0.1, 4).words()  # doctest: +ELLIPSIS
        "height looks discontinuous, or has a kink, in drop from t = 0.45 s on: the error is 30 % ... or a higher order"
        """
        when = "" if self.since is None else f" from t = {self.since:.4g} s on"
        at = "" if self.worst is None else f" at {self.worst:.4g} s"
        how = "elements='adaptive', " + ("alignment='events', " if events else "")
        return (
            f"{self.output} looks discontinuous, or has a kink, in {self.germ}{when}: the error is "
            f"{format_percent(self.error)} of the standard deviation{at}, and each order divides the remaining error "
            f"only by {format_factor(10 ** max(self.rate, 0.0))}. Try {how}or a higher order"
        )


def find_discontinuities(
    chaos: Surrogate, error: Array, energy: Array, energy_germ: Array, order: int
) -> tuple[Discontinuity | None, ...]:
    """Return the suspected discontinuity of each output, or None.

    `error` (O, T): stated error; `energy` (N + 1, O, T): sum of squared coefficients by order; `energy_germ` (d, O, T):
    part of each germ in the top order; `order`: order of the chaos.
    """
    # The verification error estimates the energy of the next orders, so a chaos with decayed coefficients and a large
    # error does not count as resolved. If the order becomes too low for a smooth motion, the spectrum still decays fast
    # at the first time of a large error. After a jump or a kink, it does not. A smooth response also looks like a
    # discontinuity if the order is much too low from the start.
    outputs = chaos.labels.outputs
    if order < 2:
        return (None,) * len(outputs)
    shape = (len(outputs), -1)
    energy = energy.reshape(len(energy), *error.shape)
    std = chaos.std.reshape(shape)
    missed = (error * reference_spread(std)) ** 2
    whole = np.concatenate([energy, missed[None]])
    rate = decay_rate(whole)
    # sum over two orders, because odd and even responses have energy in every second order only
    before = whole[-3:].sum(axis=0)
    left = np.sqrt(np.divide(missed, before, out=np.zeros_like(missed), where=before > 0))
    most = np.fmax.reduce(std, axis=-1, keepdims=True, initial=0.0)
    large = std > SPREADS * most
    # ignore rounding of the mean and integration errors
    significant = most > 1e-6 * np.fmax.reduce(np.abs(chaos.mean.reshape(shape)), axis=-1, keepdims=True, initial=0.0)
    above = large & significant & (error > LARGE)
    seen = above & (rate < SLOW) & (left > STEEP)
    by_germ = energy_germ.reshape(len(energy_germ), *error.shape)
    found: list[Discontinuity | None] = []
    for k, output in enumerate(outputs):
        places = np.flatnonzero(seen[k])
        if not places.size or places[0] != np.flatnonzero(above[k])[0]:
            found.append(None)
            continue
        worst = int(places[error[k, places].argmax()])
        times = chaos.labels.times
        found.append(
            Discontinuity(
                output.name,
                chaos.germ_names[int(by_germ[:, k, worst].argmax())],
                None if times is None else float(times[places[0]]),
                None if times is None else float(times[worst]),
                float(error[k, worst]),
                float(rate[k, worst]),
                order,
            )
        )
    return tuple(found)
