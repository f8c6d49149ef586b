"""One element of a quasi-periodic chaos, and samples of it.

Waves at all times are products of few: sines and cosines of each harmonic at each time take five times as long.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from uqmbd.typing import Array, Index

if TYPE_CHECKING:
    from uqmbd.randomness import GermBox

__all__ = ["QuasiPeriodicElement", "SampledWaves"]


BLOCK = 1 << 17
"""Numbers (16 bytes each) of waves that are held at once."""

EVEN = 1e-9
"""Largest difference of the distances of times, over the last time, at which they are even."""


@dataclass(frozen=True, eq=False)
class QuasiPeriodicElement:
    """Part of the germ space in which motions are sums of the same harmonics.

    Attributes
    ----------
    box : GermBox
        The part.
    frequencies : array, shape (P, M)
        Coefficients of the base frequencies, rad/s.
    constants, drifts : array, shape (P, O)
        Coefficients of what is constant, and of mean rates (1/s), in the units of the outputs.
    waves : array of complex, shape (P, O, H)
        Coefficients of the harmonics: a - i b for a cos + b sin.
    """

    box: GermBox
    frequencies: Array
    constants: Array
    drifts: Array
    waves: NDArray[np.complex128]


@dataclass(frozen=True)
class SampledWaves:
    """Samples in one element: their numbers (K,), what an element has of each (K, ...), and the harmonics (H, M)."""

    rows: NDArray[np.intp]
    frequencies: Array
    constants: Array
    drifts: Array
    waves: NDArray[np.complex128]
    lattice: Index

    def values(self, outputs: slice, times: Array) -> Array:
        """Evaluate some outputs at times (T,) since the origin: (K, C, T)."""
        constants, drifts, waves = self.constants[:, outputs], self.drifts[:, outputs], self.waves[:, outputs]
        found = constants[:, :, None] + drifts[:, :, None] * times
        coarse, fine = _two_scales(times)
        # not every output has all harmonics
        sets = [np.flatnonzero(waves[:, output].any(axis=0)) for output in range(waves.shape[1])]
        size = max(1, BLOCK // (max(1, len(self.lattice)) * (len(coarse) + len(fine))))
        for first in range(0, len(found), size):
            part = slice(first, first + size)
            begun, going = (_turns(self.frequencies[part], self.lattice, some) for some in (coarse, fine))
            for output, used in enumerate(sets):
                # the real part of the product, by real numbers
                some = waves[part, output].take(used, axis=1)
                left = (begun.take(used, axis=2) * some[:, None]).view(float)
                right = going.take(used, axis=2).conj().view(float)
                values = left @ right.transpose(0, 2, 1)
                found[part, output] += values.reshape(len(values), -1)[:, : len(times)]
        return found


def _two_scales(times: Array) -> tuple[Array, Array]:
    """Return times (A,) and (B,) whose sums, one behind the other, are even times (T,) and a few more."""
    count = len(times)
    size = int(np.ceil(np.sqrt(count)))
    step = (times[-1] - times[0]) / max(count - 1, 1)
    if np.abs(times - times[0] - step * np.arange(count)).max() > EVEN * step:
        return np.zeros(1), times
    return times[0] + step * size * np.arange(-(-count // size)), step * np.arange(size)


def _turns(frequencies: Array, lattice: Index, times: Array) -> NDArray[np.complex128]:
    """Return exp(i k w t) of base frequencies (K, M), multiples (H, M) and times (T,): (K, T, H)."""
    found = np.ones((len(frequencies), len(times), len(lattice)), dtype=complex)
    for rate, multiples in zip(frequencies.T, lattice.T, strict=True):
        once = np.exp(1j * rate[:, None] * times)
        most = int(np.abs(multiples).max(initial=0))
        powers = np.ones((*once.shape, 2 * most + 1), dtype=complex)
        for k in range(1, most + 1):
            powers[..., most + k] = powers[..., most + k - 1] * once
        powers[..., :most] = powers[..., :most:-1].conj()
        found *= powers.take(most + multiples, axis=2)
    return found
