"""Signs of a discontinuity in the germ space: a large stated error, and coefficients that hardly fall."""

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
"""Stated error from which an output is suspected."""

SLOW = 0.35
"""Decades per order below which the decay is slow: a kink leaves n^-1.5 of the standard deviation, a jump n^-0.5."""

CLEAR = 0.14
"""The same from which it is certain: smooth responses of large spread were seen to fall by 0.146."""

FEWEST = 3
"""Order from which a decay is estimated from so many coefficients that it is certain."""

STEEP = 0.3
"""Share of the error that two more orders leave; below it the response is smooth, and only the order is too low."""

SPREADS = 0.1
"""Times at which the standard deviation is below this part of its maximum are left out."""


@dataclass(frozen=True)
class Discontinuity:
    """A suspicion: an output that is no smooth function of an input.

    Attributes
    ----------
    output, germ : str
        Names; `germ` has most of the energy of the top order.
    since, worst : float or None
        First time (s) at which it shows, and that of the largest error; None: outputs without times.
    error : float
        Largest stated error, over the standard deviation.
    rate : float
        Decades that the remaining standard deviation falls with each order there.
    order : int
        Of the chaos.

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
        """Whether the decay is so slow that the method warns, in addition to a verdict."""
        return self.rate < CLEAR and self.order >= FEWEST

    def words(self, *, events: bool = False) -> str:
        """Return a sentence; with `events` (the mechanism has some) it proposes alignment too.

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
            f"{format_percent(self.error)} of the standard deviation{at}, and each order divides what is missing only "
            f"by {format_factor(10 ** max(self.rate, 0.0))}. Try {how}or a higher order"
        )


def find_discontinuities(
    chaos: Surrogate, error: Array, energy: Array, energy_germ: Array, order: int
) -> tuple[Discontinuity | None, ...]:
    """Suspect outputs from errors (O, T) and squared coefficients by order (N + 1, O, T), and by germ (d, O, T)."""
    # What the verification realisations miss counts as what the next orders would add: a chaos that is far from the
    # response but whose own coefficients have fallen does not pass as resolved.  Where a smooth motion outgrows the
    # order, its spectrum still ends steeply at the first time of a large error; next to a jump or a kink it does not.
    # A smooth response of which the order is much too low at once looks like a discontinuity.
    outputs = chaos.labels.outputs
    if order < 2:
        return (None,) * len(outputs)
    shape = (len(outputs), -1)
    energy = energy.reshape(len(energy), *error.shape)
    std = chaos.std.reshape(shape)
    missed = (error * reference_spread(std)) ** 2
    whole = np.concatenate([energy, missed[None]])
    rate = decay_rate(whole)
    # over two orders, since odd and even responses lack every other one
    before = whole[-3:].sum(axis=0)
    left = np.sqrt(np.divide(missed, before, out=np.zeros_like(missed), where=before > 0))
    most = np.fmax.reduce(std, axis=-1, keepdims=True, initial=0.0)
    large = std > SPREADS * most
    # rounding of a mean, or noise of an integration, is no spread
    loud = most > 1e-6 * np.fmax.reduce(np.abs(chaos.mean.reshape(shape)), axis=-1, keepdims=True, initial=0.0)
    above = large & loud & (error > LARGE)
    seen = above & (rate < SLOW) & (left > STEEP)
    blame = energy_germ.reshape(len(energy_germ), *error.shape)
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
                chaos.germ_names[int(blame[:, k, worst].argmax())],
                None if times is None else float(times[places[0]]),
                None if times is None else float(times[worst]),
                float(error[k, worst]),
                float(rate[k, worst]),
                order,
            )
        )
    return tuple(found)
