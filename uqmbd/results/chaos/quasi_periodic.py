"""Quasi-periodic polynomial chaos: frequencies and amplitudes are expanded, and put together at any time."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike

from uqmbd.errors import StudyError
from uqmbd.results.chaos.boxes import check_filled, checked_weights, rows_of_boxes, terms_of_all, verification_of_all
from uqmbd.results.chaos.decay import top_order
from uqmbd.results.chaos.interface import Samples
from uqmbd.results.chaos.quasi_periodic_element import QuasiPeriodicElement, SampledWaves
from uqmbd.results.chaos.sampled import TOPS, SampledSurrogate
from uqmbd.results.chaos.sampling import basis_derivatives, basis_values, spread_germs
from uqmbd.results.chaos.storage import quasi_periodic_arguments, quasi_periodic_dataset
from uqmbd.results.schema import Labels
from uqmbd.typing import Array, Index

if TYPE_CHECKING:
    from uqmbd.randomness import GermBox, GermSpace

__all__ = ["QuasiPeriodicChaos"]


@dataclass(frozen=True, eq=False, repr=False)
class QuasiPeriodicChaos(SampledSurrogate):
    """Outputs as sums of harmonics of one or two frequencies, whose frequencies and amplitudes are polynomials.

    Where realisations oscillate with frequencies of their own their phases drift apart, and no order follows outputs at
    a fixed time for long; frequencies and amplitudes stay smooth functions of the inputs.  At a sample they are put
    together: ``y(t) = c + d t + sum_h a_h cos(w_h t) + b_h sin(w_h t)`` with ``w_h = k_h1 w1 + k_h2 w2`` and t from
    `origin` on.  Statistics come from samples of this surrogate.

    Parameters
    ----------
    elements : sequence of QuasiPeriodicElement
        Their boxes fill the germ space.
    lattice : array of int, shape (H, M)
        Multiples k of the base frequencies in each harmonic.
    origin : float
        Time from which phases count, s.
    multi_index : array of int, shape (P, d)
        Degrees of the terms.
    labels : Labels
        Outputs, inputs and times.
    verification_germs, verification_response : array, shape (V, d) and (V, O, T), optional
        Realisations that did not enter the coefficients.
    verification_weights : array, shape (V,), optional
        What each counts; they are made to sum to 1.  Default: they are spread like the inputs within each element, and
        each element counts by its probability.

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

    def __post_init__(self) -> None:
        """Check that the elements fill the space."""
        object.__setattr__(self, "elements", tuple(self.elements))
        check_filled([e.box for e in self.elements])
        object.__setattr__(self, "space", self.elements[0].box.space)
        boxes = [e.box for e in self.elements]
        weights = checked_weights(self.verification_weights, self.verification_germs, boxes)
        object.__setattr__(self, "verification_weights", weights)
        if self.labels.times is None:
            raise StudyError("Outputs without times have no frequencies; use PolynomialChaos.")

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
        for one in self._sampled(germs):
            found[one.rows] = one.frequencies
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
        for one in self._sampled(germs):
            found[one.rows] = np.abs(one.waves)
        return found

    @classmethod
    def joined(cls, chaoses: Sequence[QuasiPeriodicChaos], boxes: Sequence[GermBox]) -> QuasiPeriodicChaos:
        """Join chaoses of the same harmonics, each on the conditional distribution in its box, that were not split.

        Parameters
        ----------
        chaoses : sequence
            Of the elements.
        boxes : sequence of GermBox
            Their parts of the germ space, which they fill.

        Returns
        -------
        QuasiPeriodicChaos
            On the whole germ space.

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
        >>> def half(box, size):  # size times cos(2 t) in half of the germ space
        ...     zero, waves = np.zeros((1, 1)), np.array([[[size + 0j]]])
        ...     whole = uqmbd.extend.GermBox.whole(box.local)
        ...     element = QuasiPeriodicElement(whole, np.array([[2.0]]), zero, zero, waves)
        ...     axes = labels(["x"], ["a"], [0.0])
        ...     return QuasiPeriodicChaos((element,), np.array([[1]]), 0.0, np.array([[0]]), axes)
        >>> boxes = uqmbd.extend.GermBox.whole(space).split(0)
        >>> chaos = QuasiPeriodicChaos.joined([half(box, size) for box, size in zip(boxes, (1.0, 3.0))], boxes)
        >>> chaos.evaluate([[-0.5], [0.5]]).ravel().tolist()
        [1.0, 3.0]
        """
        terms, places = terms_of_all(chaoses)
        elements = []
        for chaos, box, rows in zip(chaoses, boxes, places, strict=True):
            (own,) = chaos.elements
            parts = (own.frequencies, own.constants, own.drifts, own.waves)
            frequencies, constants, drifts, waves = (np.zeros((len(terms), *x.shape[1:]), x.dtype) for x in parts)
            frequencies[rows], constants[rows], drifts[rows], waves[rows] = parts
            elements.append(QuasiPeriodicElement(box, frequencies, constants, drifts, waves))
        first = chaoses[0]
        known = verification_of_all(chaoses, [box.probability for box in boxes])
        return cls(tuple(elements), first.lattice, first.origin, terms, first.labels, **known)

    def to_dataset(self) -> xr.Dataset:
        """Build the dataset `quasi_periodic` of a propagator's node; see :meth:`from_dataset`.

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
        >>> dict(chaos.to_dataset().sizes)["harmonic"]
        1
        """
        return quasi_periodic_dataset(self, self.elements, self.lattice, self.origin)

    @classmethod
    def from_dataset(cls, dataset: xr.Dataset | xr.DataTree) -> QuasiPeriodicChaos:
        """Make it from the dataset `quasi_periodic` of a result, without the mechanism.

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
        >>> QuasiPeriodicChaos.from_dataset(chaos.to_dataset()).frequencies([[0.0]]).round(4).tolist()
        [[2.0]]
        """
        return cls(**quasi_periodic_arguments(dataset))

    def _evaluate(self, germs: Array) -> Array:
        found = np.empty((len(germs), *self.labels.shape))
        for one in self._sampled(germs):
            one.evaluate(slice(None), self._times - self.origin, found)
        return found

    def _derivative(self, germs: Array, germ: int) -> Array:
        found = np.zeros((len(germs), *self.labels.shape))
        for one, change in zip(self._sampled(germs), self._sampled(germs, germ), strict=True):
            one.evaluate_change(change, self._times - self.origin, found)
        return found

    def _sampler(self, germs: Array) -> Samples:
        sampled, count = self._sampled(germs), self.labels.shape[1]

        def columns(part: slice) -> Array:
            first, last, _ = part.indices(int(np.prod(self.labels.shape)))
            found = np.empty((len(germs), last - first))
            for output in range(first // count, -(-last // count)):
                begin, end = max(first, output * count), min(last, (output + 1) * count)
                times = self._times[begin - output * count : end - output * count]
                values = np.empty((len(germs), 1, len(times)))
                for one in sampled:
                    one.evaluate(slice(output, output + 1), times - self.origin, values)
                found[:, begin - first : end - first] = values[:, 0]
            return found

        return Samples(columns, lambda part: np.ascontiguousarray(columns(part).T))

    @property
    def _times(self) -> Array:
        return np.asarray(self.labels.times)

    def _sampled(self, germs: Array, germ: int | None = None) -> list[SampledWaves]:
        """Find what elements have of samples, or how that changes with a germ."""
        found = []
        for element, rows in zip(self.elements, rows_of_boxes([e.box for e in self.elements], germs), strict=True):
            if len(rows):
                where = element.box.local, germs[rows], self.multi_index
                basis = basis_values(*where) if germ is None else basis_derivatives(*where, germ)
                waves = np.tensordot(basis, element.waves, 1)
                frequencies, constants, drifts = (
                    basis @ x for x in (element.frequencies, element.constants, element.drifts)
                )
                found.append(SampledWaves(rows, frequencies, constants, drifts, waves, self.lattice))
        return found

    @cached_property
    def _tops(self) -> Array:
        germs = spread_germs(self.space, TOPS, 0)
        whole, (_, edge) = self.evaluate_germs(germs), top_order(self.multi_index)
        found = []
        for left_out in (edge, *(edge & (self.multi_index[:, k] > 0) for k in range(len(self.germ_names)))):
            kept = ~left_out[:, None]
            fewer = [
                replace(
                    e,
                    frequencies=e.frequencies * kept,
                    constants=e.constants * kept,
                    drifts=e.drifts * kept,
                    waves=e.waves * kept[:, :, None],
                )
                for e in self.elements
            ]
            found.append(np.mean((whole - replace(self, elements=tuple(fewer)).evaluate_germs(germs)) ** 2, axis=0))
        return np.array(found)
