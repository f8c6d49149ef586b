"""Where realisations start, and which of them cannot."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from uqmbd.status import Status
from uqmbd.typing import Array, Index

__all__ = ["Start"]


@dataclass(frozen=True)
class Start:
    """Consistent initial states of K realisations."""

    q: Array  # (K, coordinate)
    s: Array  # auxiliary states (K, state)
    v: Array  # (K, coordinate)
    a: Array  # (K, coordinate)
    rates: Array  # of the auxiliary states (K, state)
    multipliers: Array  # of the kept equations (K, kept)
    messages: tuple[str, ...]  # empty where the realisation was assembled, else the reason
    outside: NDArray[np.bool_]  # (K,): whether the reason is a number outside of its range

    def select(self, members: Index) -> Start:
        """Make the initial states of some realisations."""
        return Start(
            self.q[members],
            self.s[members],
            self.v[members],
            self.a[members],
            self.rates[members],
            self.multipliers[members],
            tuple(self.messages[k] for k in members),
            self.outside[members],
        )

    @property
    def state(self) -> Array:
        """Coordinates, auxiliary states and velocities, shape (K, 2 coordinate + state)."""
        return np.concatenate([self.q, self.s, self.v], axis=1)

    @property
    def ok(self) -> NDArray[np.bool_]:
        """Which realisations could be assembled, shape (K,)."""
        return np.array([not m for m in self.messages], dtype=bool)

    @property
    def status(self) -> Index:
        """What has become of each realisation so far, as :class:`Status`, shape (K,)."""
        lost = np.where(self.outside, Status.OUTSIDE_LIMITS, Status.ASSEMBLY_FAILED)
        return np.where(self.ok, Status.OK, lost).astype(np.int64)
