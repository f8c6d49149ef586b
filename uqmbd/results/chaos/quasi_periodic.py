"""Provide quasi-periodic polynomial chaos, which expands frequencies and amplitudes and combines them at any time."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, Any, Self

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike, NDArray

from uqmbd.arguments import shown, typechecked
from uqmbd.compiled import sum_harmonics
from uqmbd.errors import StudyError
from uqmbd.results.chaos.interface import Surrogate
from uqmbd.results.chaos.readouts import GermElement, OverTime, SampledPiece
from uqmbd.results.schema import Labels
from uqmbd.typing import Array, Index

if TYPE_CHECKING:
    from uqmbd.randomness import GermBox, GermSpace

__all__ = ["QuasiPeriodicChaos", "QuasiPeriodicElement"]


@typechecked
@dataclass(frozen=True, eq=False)
class QuasiPeriodicElement(GermElement):
    """Part of the germ space in which motions are sums of the same harmonics.

    Attributes
    ----------
    box : GermBox
        Part of the germ space.
    frequencies : array, shape (P, M)
        Coefficients of the base frequencies, rad/s.
    constants, drifts : array, shape (P, O)
        Coefficients of the constant terms, and of mean rates (1/s), in the units of the outputs.
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

    frequencies: Array
    constants: Array
    drifts: Array
    waves: NDArray[np.complex128]


@dataclass(frozen=True, eq=False)
class SampledHarmonics(SampledPiece):
    """Samples in one element."""

    element: QuasiPeriodicElement
    lattice: Index

    @cached_property
    def parts(self) -> tuple[Array, Array, Array, NDArray[np.complex128]]:
        """Frequencies (K, M), constants and drifts (K, O), and harmonics (K, O, H)."""
        of, basis = self.element, self.basis
        return basis @ of.frequencies, basis @ of.constants, basis @ of.drifts, np.tensordot(basis, of.waves, 1)

    def evaluate(self, outputs: slice, times: Array, found: Array) -> None:
        """Evaluate some outputs at times (T,) since the origin, into rows of (N, C, T)."""
        frequencies, constants, drifts, waves = self.parts
        of_outputs = constants[:, outputs], drifts[:, outputs], waves[:, outputs]
        sum_harmonics(frequencies, self.lattice, *of_outputs, times, found, self.rows)

    def evaluate_change(self, change: Array, times: Array, found: Array) -> None:
        """Evaluate the change due to a basis change (K, P) at times (T,) since the origin, into rows of (N, O, T)."""
        frequencies, constants, _, waves = self.parts
        changes = SampledHarmonics(self.element, self.rows, change, self.lattice).parts
        sum_harmonics(frequencies, self.lattice, changes[1], changes[2], changes[3], times, found, self.rows)
        # the derivative of a harmonic with respect to its frequency is i t times the harmonic
        rotated = 1j * (changes[0] @ self.lattice.T)[:, None, :] * waves
        zero = np.zeros_like(constants)
        phases = np.zeros_like(found)
        sum_harmonics(frequencies, self.lattice, zero, zero, rotated, times, phases, self.rows)
        found[self.rows] += times * phases[self.rows]


COEFFICIENTS = {
    "frequency": ("base", {"long_name": "coefficients of the base frequencies", "units": "rad/s"}),
    "constant": (
        "output",
        {"long_name": "coefficients of the constant parts", "comment": "in the units of the outputs"},
    ),
    "drift": (
        "output",
        {"long_name": "coefficients of mean rates", "comment": "in the units of the outputs, per second"},
    ),
    "cosine": ("output", {"long_name": "coefficients of the cosines", "comment": "in the units of the outputs"}),
    "sine": ("output", {"long_name": "coefficients of the sines", "comment": "in the units of the outputs"}),
}
"""Dimension, in addition to terms and harmonics, and attributes of each stored array of coefficients."""


@dataclass(frozen=True)
class Harmonic(OverTime):
    """Readout of outputs as sums of harmonics, whose frequencies and amplitudes are polynomials of the germs."""

    lattice: Index  # (H, M) multiples of the base frequencies
    origin: float  # time from which t in the harmonics counts, s

    name = "quasi_periodic"
    needed = (*(f"{name}_coefficients" for name in COEFFICIENTS), "harmonics", "origin")
    of_times = "frequencies"

    def since(self, labels: Labels) -> Array:
        """Return times since the origin (T,), s."""
        return np.asarray(labels.times) - self.origin

    def at(self, element: QuasiPeriodicElement, rows: NDArray[np.intp], basis: Array) -> SampledHarmonics:
        """Prepare samples."""
        return SampledHarmonics(element, rows, basis, self.lattice)

    def variables(self, elements: Sequence[QuasiPeriodicElement]) -> dict[str, Any]:
        """Return elements, multiples of the base frequencies and the origin as variables."""
        parts = [(e.frequencies, e.constants, e.drifts, e.waves.real, -e.waves.imag) for e in elements]
        found: dict[str, Any] = {
            f"{name}_coefficients": (_dims(name), np.array([part[k] for part in parts]), about)
            for k, (name, (_, about)) in enumerate(COEFFICIENTS.items())
        }
        return found | {
            "harmonics": (("harmonic", "base"), self.lattice, {"long_name": "multiples of the base frequencies"}),
            "origin": ((), self.origin, {"long_name": "time from which phases count", "units": "s"}),
        }

    @classmethod
    def read(cls, data: xr.Dataset, boxes: Sequence[GermBox]) -> tuple[Self, tuple[QuasiPeriodicElement, ...]]:
        """Return the readout and the elements of a dataset."""
        found = [data[f"{name}_coefficients"].transpose(*_dims(name)).values for name in COEFFICIENTS]
        elements = [
            QuasiPeriodicElement(box, found[0][k], found[1][k], found[2][k], found[3][k] - 1j * found[4][k])
            for k, box in enumerate(boxes)
        ]
        return cls(data["harmonics"].transpose("harmonic", "base").values, float(data["origin"])), tuple(elements)


@typechecked
@dataclass(frozen=True, eq=False, repr=False)
class QuasiPeriodicChaos(Surrogate):
    """Outputs as sums of harmonics of one or two frequencies, whose frequencies and amplitudes are polynomials.

    If realisations oscillate with different frequencies, their phases drift apart, and after some time no order
    resolves outputs at a fixed time. Frequencies and amplitudes remain smooth functions of the inputs. The output of a
    sample is ``y(t) = c + d t + sum_h a_h cos(w_h t) + b_h sin(w_h t)``, with ``w_h = k_h1 w1 + k_h2 w2`` and t
    since `origin`. Statistics come from samples of this surrogate.

    Parameters
    ----------
    elements : sequence of QuasiPeriodicElement
        Elements whose boxes fill the germ space.
    lattice : array of int, shape (H, M)
        Multiples k of the base frequencies in each harmonic.
    origin : float
        Time from which t in the harmonics counts, s.
    multi_index : array of int, shape (P, d)
        Degrees of the terms.
    labels : Labels
        Outputs, inputs and times of the axes.
    verification_germs, verification_response : array, shape (V, d) and (V, O, T), optional
        Verification realisations, which did not affect the coefficients.
    verification_weights : array, shape (V,), optional
        Weights of the verification realisations, scaled to the sum 1. Default: equal weights within an element, and
        each element has its probability.

    Raises
    ------
    uqmbd.StudyError
        If the elements do not fill the germ space.

    Examples
    --------
    ``cos(w t)`` with a frequency of 2 rad/s at the mean of the input:

    >>> import chaospy
    >>> import numpy as np
    >>> import uqmbd
    >>> from uqmbd.results import QuasiPeriodicChaos
    >>> from uqmbd.extend import QuasiPeriodicElement
    >>> from uqmbd.extend import labels
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
    >>> axes = labels([("x", "m")], [("speed", "m/s")], [0.0, np.pi])
    >>> chaos = QuasiPeriodicChaos((element,), np.array([[1]]), 0.0, np.array([[0], [1]]), axes)
    >>> chaos.evaluate([[2.0]]).ravel().round(6).tolist(), chaos.frequencies([[2.0]]).ravel().round(6).tolist()
    ([1.0, 1.0], [2.0])
    """

    elements: tuple[QuasiPeriodicElement, ...]
    lattice: Index
    origin: float
    multi_index: Index
    labels: Labels
    verification_germs: Array | None = None
    verification_response: Array | None = None
    verification_weights: Array | None = None
    space: GermSpace = field(init=False)

    _kind = Harmonic

    def __post_init__(self) -> None:
        """Check the multiples of the frequencies, and the common attributes of surrogates."""
        super().__post_init__()
        for element in self.elements:
            counts = np.shape(element.frequencies)[-1:], np.shape(element.waves)[-1:]
            if np.ndim(self.lattice) != 2 or (self.lattice.shape[1:], self.lattice.shape[:1]) != counts:
                raise StudyError(
                    f"QuasiPeriodicChaos: lattice is {shown(self.lattice)}; expected an array (H, M) with the "
                    "multiples of the M base frequencies in each of the H harmonics."
                )

    def __repr__(self) -> str:
        numbers = f"{len(self.lattice)} harmonics of {self.lattice.shape[1]} frequencies"
        return f"<{type(self).__name__} of {', '.join(self.germ_names)} ({numbers})>"

    def frequencies(self, inputs: ArrayLike) -> Array:
        """Return the base frequencies (K, M) at inputs (K, d), rad/s.

        Examples
        --------
        >>> import chaospy
        >>> import numpy as np
        >>> import uqmbd
        >>> from uqmbd.results import QuasiPeriodicChaos
        >>> from uqmbd.extend import QuasiPeriodicElement
        >>> from uqmbd.extend import labels
        >>> a = uqmbd.RandomVariable("a", chaospy.Uniform(-1, 1))
        >>> mechanism = uqmbd.Mechanism("inputs", uqmbd.Line())
        >>> mechanism.output("a", a)
        >>> space = uqmbd.extend.GermSpace.of(mechanism.inputs)
        >>> frequencies, waves = np.array([[2.0], [0.1]]), np.array([[[1.0 + 0j]], [[0j]]])
        >>> zero = np.zeros((2, 1))
        >>> element = QuasiPeriodicElement(uqmbd.extend.GermBox.whole(space), frequencies, zero, zero, waves)
        >>> axes = labels(["x"], ["a"], [0.0, 1.0])
        >>> chaos = QuasiPeriodicChaos((element,), np.array([[1]]), 0.0, np.array([[0], [1]]), axes)
        >>> chaos.frequencies([[0.0], [1.0]]).round(4).tolist()  # rad/s; psi is the root of 3 at the end
        [[2.0], [2.1732]]
        """
        germs = self.space.to_germs(np.asarray(inputs, dtype=float))
        found = np.empty((len(germs), self.lattice.shape[1]))
        for _, one in self._sampled(germs):
            found[one.rows] = one.basis @ one.element.frequencies
        return found

    def amplitudes(self, inputs: ArrayLike) -> Array:
        """Return the size (K, O, H) of each harmonic at inputs (K, d), in the units of the outputs.

        Examples
        --------
        >>> import chaospy
        >>> import numpy as np
        >>> import uqmbd
        >>> from uqmbd.results import QuasiPeriodicChaos
        >>> from uqmbd.extend import QuasiPeriodicElement
        >>> from uqmbd.extend import labels
        >>> a = uqmbd.RandomVariable("a", chaospy.Uniform(-1, 1))
        >>> mechanism = uqmbd.Mechanism("inputs", uqmbd.Line())
        >>> mechanism.output("a", a)
        >>> space = uqmbd.extend.GermSpace.of(mechanism.inputs)
        >>> frequencies, waves = np.array([[2.0], [0.1]]), np.array([[[1.0 + 0j]], [[0j]]])
        >>> zero = np.zeros((2, 1))
        >>> element = QuasiPeriodicElement(uqmbd.extend.GermBox.whole(space), frequencies, zero, zero, waves)
        >>> axes = labels(["x"], ["a"], [0.0, 1.0])
        >>> chaos = QuasiPeriodicChaos((element,), np.array([[1]]), 0.0, np.array([[0], [1]]), axes)
        >>> chaos.amplitudes([[0.0]]).round(4).tolist()
        [[[1.0]]]
        """
        germs = self.space.to_germs(np.asarray(inputs, dtype=float))
        found = np.empty((len(germs), len(self.labels.outputs), len(self.lattice)))
        for _, one in self._sampled(germs):
            found[one.rows] = np.abs(np.tensordot(one.basis, one.element.waves, 1))
        return found


def _dims(name: str) -> tuple[str, ...]:
    """Return the dimensions of stored coefficients."""
    return ("element", "term", COEFFICIENTS[name][0], *(("harmonic",) if name in ("cosine", "sine") else ()))
