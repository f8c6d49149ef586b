"""One element of a quasi-periodic chaos, and samples of it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from uqmbd.compiled import wave_values
from uqmbd.typing import Array, Index

if TYPE_CHECKING:
    from uqmbd.randomness import GermBox

__all__ = ["QuasiPeriodicElement", "SampledWaves"]


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

    Examples
    --------
    >>> import chaospy
    >>> import numpy as np
    >>> import uqmbd
    >>> from uqmbd.extend import QuasiPeriodicElement
    >>> speed = uqmbd.RandomVariable("speed", chaospy.Uniform(1, 3), units="m/s")
    >>> mechanism = uqmbd.Mechanism("stone", uqmbd.Line())
    >>> stone = mechanism.body("stone", mass=1, velocity=speed)
    >>> space = uqmbd.extend.GermSpace.of(mechanism.inputs)
    >>> element = QuasiPeriodicElement(
    ...     uqmbd.extend.GermBox.whole(space),
    ...     frequencies=np.array([[2.0], [0.1]]),
    ...     constants=np.zeros((2, 1)),
    ...     drifts=np.zeros((2, 1)),
    ...     waves=np.array([[[1.0 + 0j]], [[0j]]]),
    ... )
    >>> element.frequencies[0].tolist(), element.waves.shape  # cos(2 t) at the mean; terms, outputs, harmonics
    ([2.0], (2, 1, 1))
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

    def evaluate(self, outputs: slice, times: Array, found: Array) -> None:
        """Evaluate some outputs at times (T,) since the origin, into rows of (N, C, T)."""
        constants, drifts, waves = self.constants[:, outputs], self.drifts[:, outputs], self.waves[:, outputs]
        wave_values(self.frequencies, self.lattice, constants, drifts, waves, times, found, self.rows)

    def evaluate_change(self, change: SampledWaves, times: Array, found: Array) -> None:
        """Evaluate the first-order change of all outputs at times (T,) since the origin, into rows of (N, O, T).

        Parameters
        ----------
        change : SampledWaves
            Changes of frequencies, constants, drifts and waves of the same samples.
        times : array, shape (T,)
        found : array, shape (N, O, T)
        """
        of_waves = (self.frequencies, self.lattice, change.constants, change.drifts, change.waves)
        wave_values(*of_waves, times, found, self.rows)
        # d/dw of a wave is i t times the wave
        turned = 1j * (change.frequencies @ self.lattice.T)[:, None, :] * self.waves
        still = np.zeros_like(self.constants)
        phases = np.zeros_like(found)
        wave_values(self.frequencies, self.lattice, still, still, turned, times, phases, self.rows)
        found[self.rows] += times * phases[self.rows]
