"""Multi-element polynomial chaos: a chaos of its own in each of some boxes of the germ space."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
import xarray as xr

from uqmbd.errors import StudyError
from uqmbd.results.chaos.boxes import check_filled, rows_of_boxes, verification_of_all
from uqmbd.results.chaos.decay import decay_dataset, energy_of_germs, energy_of_orders
from uqmbd.results.chaos.interface import Samples, Surrogate
from uqmbd.results.chaos.polynomial import PolynomialChaos
from uqmbd.results.chaos.stated_error import reference_spread
from uqmbd.results.chaos.storage import piecewise_arguments, piecewise_dataset
from uqmbd.results.chaos.terms import closed_variance
from uqmbd.results.schema import Labels
from uqmbd.results.statistics import divisor
from uqmbd.threads import one_thread
from uqmbd.typing import Array, Index, Mask
from uqmbd.wording import format_at_most

if TYPE_CHECKING:
    from uqmbd.randomness import GermBox, GermSpace

__all__ = ["PiecewiseChaos"]


@dataclass(frozen=True, eq=False, repr=False)
class PiecewiseChaos(Surrogate):
    """Outputs as a polynomial chaos in each of the boxes (elements) that the germ space is split into.

    It does what a :class:`uqmbd.results.PolynomialChaos` does.  Moments are merged from those of the elements;
    Sobol' indices are exact integrals of the piecewise polynomial over the whole germ space; quantiles and densities
    come from samples.  It never changes.

    Parameters
    ----------
    elements : sequence of PolynomialChaos
        One for each box, on its ``local`` germ space, all with the same labels.  Their verification realisations,
        if any, lie in their boxes.
    boxes : sequence of GermBox
        Disjoint; they fill the germ space.

    Raises
    ------
    StudyError
        If elements and boxes do not belong together, or the boxes do not fill the space.

    References
    ----------
    X. Wan and G. E. Karniadakis, Journal of Computational Physics 209 (2005) 617-642, and SIAM Journal on Scientific
    Computing 28 (2006) 901-928.

    Examples
    --------
    The sign of a uniform germ, by two elements of order 0:

    >>> import chaospy, uqmbd
    >>> from uqmbd.randomness import GermBox, GermSpace, JointInput
    >>> from uqmbd.extend import labels
    >>> space = GermSpace.of(JointInput.of([uqmbd.RandomVariable("a", chaospy.Uniform(-1, 1))]))
    >>> axes, boxes = labels(["x"], ["a"], [0.0]), GermBox.whole(space).split(0)
    >>> parts = [PolynomialChaos([[[s]]], [[0]], b.local, axes) for s, b in zip((-1.0, 1.0), boxes)]
    >>> chaos = PiecewiseChaos(parts, boxes)
    >>> chaos.std.item(), chaos.kurtosis.item(), chaos.sobol_first.item()
    (1.0, 1.0, 1.0)
    >>> chaos.evaluate([[-0.5], [0.5]]).ravel().tolist()
    [-1.0, 1.0]
    """

    elements: tuple[PolynomialChaos, ...]
    boxes: tuple[GermBox, ...]
    labels: Labels = field(init=False)
    space: GermSpace = field(init=False)
    verification_germs: Array | None = field(init=False)
    verification_response: Array | None = field(init=False)
    verification_weights: Array | None = field(init=False)

    _remedy = "allow more elements, or raise the order"

    def __post_init__(self) -> None:
        """Check that elements and boxes belong together."""
        object.__setattr__(self, "elements", tuple(self.elements))
        object.__setattr__(self, "boxes", tuple(self.boxes))
        if not self.elements or len(self.elements) != len(self.boxes):
            raise StudyError(
                f"Each box needs a chaos, and there must be one; {len(self.elements)} chaoses and {len(self.boxes)} "
                "boxes were given."
            )
        first = self.elements[0].labels
        for element, box in zip(self.elements, self.boxes, strict=True):
            same = element.labels.dims == first.dims and element.labels.outputs == first.outputs
            if not same or not np.array_equal(element.labels.times, first.times):  # type: ignore[arg-type]
                raise StudyError("All elements must have the same outputs and times.")
            if element.space.inputs != box.space.inputs:
                raise StudyError(f"A chaos of {element.space.inputs} is none of a box of {box.space.inputs}.")
        check_filled(self.boxes)
        object.__setattr__(self, "labels", first)
        object.__setattr__(self, "space", self.boxes[0].space)
        probabilities = [box.probability for box in self.boxes]
        for name, value in verification_of_all(self.elements, probabilities).items():
            object.__setattr__(self, name, value)

    def __repr__(self) -> str:
        sizes = zip(("elements", "terms", *self.labels.dims), self.coefficients.shape, strict=True)
        axes = ", ".join(f"{name}: {size}" for name, size in sizes)
        return f"<{type(self).__name__} of {', '.join(self.germ_names)} ({axes})>"

    @cached_property
    def probabilities(self) -> Array:
        """Probability of each element, shape (E,)."""
        return np.array([box.probability for box in self.boxes])

    @cached_property
    def multi_index(self) -> Index:  # type: ignore[override]
        """Degrees of all terms that any element has, shape (P, d), the mean first."""
        terms = {tuple(row) for element in self.elements for row in element.multi_index.tolist()}
        ordered = sorted(terms, key=lambda row: (sum(row), [-k for k in row]))
        return np.array(ordered, dtype=np.int64).reshape(len(ordered), -1)

    @cached_property
    def coefficients(self) -> Array:
        """Coefficients of each element, shape (E, P, O, T); 0 where it does not have a term."""
        place = {tuple(row): k for k, row in enumerate(self.multi_index.tolist())}
        found = np.zeros((len(self.elements), len(place), *self.labels.shape))
        for part, element in zip(found, self.elements, strict=True):
            part[[place[tuple(row)] for row in element.multi_index.tolist()]] = element.coefficients
        found.setflags(write=False)
        return found

    @cached_property
    def has_term(self) -> Mask:
        """Whether each element has each term, shape (E, P)."""
        own = [set(map(tuple, element.multi_index.tolist())) for element in self.elements]
        return np.array([[tuple(row) in terms for row in self.multi_index.tolist()] for terms in own], dtype=bool)

    @cached_property
    def mean(self) -> Array:
        """Expectation, shape (O, T), in the units of the outputs."""
        return self._merged(self._means)

    @cached_property
    def std(self) -> Array:
        """Standard deviation, shape (O, T), in the units of the outputs."""
        return np.sqrt(self._merged(self._stds**2 + (self._means - self.mean) ** 2))

    @property
    def shape_samples(self) -> int:
        """Samples of the surrogate from which skewness and kurtosis of an element are; 0: they are exact."""
        return max(element.shape_samples for element in self.elements)

    @cached_property
    def sobol_first_germ(self) -> Array:
        """First-order Sobol' indices of the germs, shape (germ, O, T), in the order of :attr:`germ_names`."""
        return np.stack([self._closed([k]) for k in range(len(self.germ_names))])

    @cached_property
    def sobol_total_germ(self) -> Array:
        """Total Sobol' indices of the germs, shape (germ, O, T)."""
        every = range(len(self.germ_names))
        found = [1.0 - self._closed([j for j in every if j != k]) for k in every]
        return np.where(self._constant, 0.0, np.clip(np.stack(found), 0.0, 1.0))

    @cached_property
    def sobol_second_germ(self) -> Array:
        """Sobol' indices of pairs of germs, shape (germ, germ, O, T): symmetric, 0 on the diagonal."""
        count, first = len(self.germ_names), self.sobol_first_germ
        found = np.zeros((count, count, *self.labels.shape))
        for i, j in zip(*np.triu_indices(count, 1), strict=True):
            both = np.maximum(self._closed([int(i), int(j)]) - first[i] - first[j], 0.0)
            found[i, j] = found[j, i] = both
        return found

    def element_errors(self) -> Array:
        """Return the stated error within each element, over the standard deviation of the whole.

        Returns
        -------
        array, shape (E, O, T)
            The root mean square at the verification realisations of the element; 0 where it has none.  With the
            probabilities as weights their mean square is that of :meth:`verification_error`.

        Examples
        --------
        >>> import chaospy
        >>> import uqmbd
        >>> from uqmbd.results import PiecewiseChaos, PolynomialChaos
        >>> from uqmbd.extend import labels
        >>> a = uqmbd.RandomVariable("a", chaospy.Uniform(-1, 1))
        >>> mechanism = uqmbd.Mechanism("inputs", uqmbd.Line())
        >>> mechanism.output("a", a)
        >>> space, axes = uqmbd.extend.GermSpace.of(mechanism.inputs), labels(["sign"], ["a"], [0.0])
        >>> boxes = uqmbd.extend.GermBox.whole(space).split(0)
        >>> def part(sign, box):
        ...     return PolynomialChaos([[[sign]], [[0.0]]], [[0], [1]], box.local, axes)
        >>> parts = [part(-1.0, boxes[0]), part(1.0, boxes[1])]
        >>> chaos = PiecewiseChaos(parts, boxes)
        >>> chaos.element_errors().shape
        (2, 1, 1)
        """
        shape = (len(self.labels.outputs), -1)
        spread = reference_spread(self.std.reshape(shape)).reshape(self.labels.shape)
        found = np.zeros((len(self.elements), *self.labels.shape))
        for row, element in zip(found, self.elements, strict=True):
            if element.verification_germs is not None:
                row[...] = element.verification_rms() / divisor(spread)
        return found

    def decay(self) -> xr.Dataset:
        """Build a dataset of how the coefficients fall with the order, on average over the elements.

        Returns
        -------
        xarray.Dataset
            As of :meth:`PolynomialChaos.decay`; of each element its probability is the weight.

        Examples
        --------
        >>> import chaospy
        >>> import uqmbd
        >>> from uqmbd.results import PiecewiseChaos, PolynomialChaos
        >>> from uqmbd.extend import labels
        >>> a = uqmbd.RandomVariable("a", chaospy.Uniform(-1, 1))
        >>> mechanism = uqmbd.Mechanism("inputs", uqmbd.Line())
        >>> mechanism.output("a", a)
        >>> space, axes = uqmbd.extend.GermSpace.of(mechanism.inputs), labels(["sign"], ["a"], [0.0])
        >>> boxes = uqmbd.extend.GermBox.whole(space).split(0)
        >>> def part(sign, box):
        ...     return PolynomialChaos([[[sign]], [[0.0]]], [[0], [1]], box.local, axes)
        >>> parts = [part(-1.0, boxes[0]), part(1.0, boxes[1])]
        >>> chaos = PiecewiseChaos(parts, boxes)
        >>> sorted(chaos.decay().data_vars)
        ['energy', 'energy_germ', 'rate']
        """
        return decay_dataset(
            self.labels,
            self.germ_names,
            self._weighted(energy_of_orders),
            self._weighted(energy_of_germs),
            self._constant,
            energy_note="sum of squared coefficients, averaged over the elements",
            rate_note="within the elements; decades of the remaining standard deviation per order",
        )

    def to_dataset(self) -> xr.Dataset:
        """Build the dataset `chaos` of a propagator's node; see :meth:`from_dataset`.

        Examples
        --------
        >>> import chaospy
        >>> import uqmbd
        >>> from uqmbd.results import PiecewiseChaos, PolynomialChaos
        >>> from uqmbd.extend import labels
        >>> a = uqmbd.RandomVariable("a", chaospy.Uniform(-1, 1))
        >>> mechanism = uqmbd.Mechanism("inputs", uqmbd.Line())
        >>> mechanism.output("a", a)
        >>> space, axes = uqmbd.extend.GermSpace.of(mechanism.inputs), labels(["sign"], ["a"], [0.0])
        >>> boxes = uqmbd.extend.GermBox.whole(space).split(0)
        >>> def part(sign, box):
        ...     return PolynomialChaos([[[sign]], [[0.0]]], [[0], [1]], box.local, axes)
        >>> parts = [part(-1.0, boxes[0]), part(1.0, boxes[1])]
        >>> chaos = PiecewiseChaos(parts, boxes)
        >>> dict(chaos.to_dataset().sizes)["element"]
        2
        """
        return piecewise_dataset(self, self.boxes, self.coefficients, self.has_term, self.element_errors)

    @classmethod
    def from_dataset(cls, dataset: xr.Dataset | xr.DataTree) -> PiecewiseChaos:
        """Make a chaos from the dataset `chaos` of a result, without the mechanism.

        Raises
        ------
        StudyError
            If it is no such dataset.

        Examples
        --------
        >>> import chaospy
        >>> import uqmbd
        >>> from uqmbd.results import PiecewiseChaos, PolynomialChaos
        >>> from uqmbd.extend import labels
        >>> a = uqmbd.RandomVariable("a", chaospy.Uniform(-1, 1))
        >>> mechanism = uqmbd.Mechanism("inputs", uqmbd.Line())
        >>> mechanism.output("a", a)
        >>> space, axes = uqmbd.extend.GermSpace.of(mechanism.inputs), labels(["sign"], ["a"], [0.0])
        >>> boxes = uqmbd.extend.GermBox.whole(space).split(0)
        >>> def part(sign, box):
        ...     return PolynomialChaos([[[sign]], [[0.0]]], [[0], [1]], box.local, axes)
        >>> parts = [part(-1.0, boxes[0]), part(1.0, boxes[1])]
        >>> chaos = PiecewiseChaos(parts, boxes)
        >>> again = PiecewiseChaos.from_dataset(chaos.to_dataset())
        >>> again.evaluate([[-0.5], [0.5]]).ravel().tolist()
        [-1.0, 1.0]
        """
        boxes, elements = piecewise_arguments(dataset)
        return cls(tuple(PolynomialChaos(**element) for element in elements), boxes)

    def _evaluate(self, germs: Array) -> Array:
        found = np.empty((len(germs), *self.labels.shape))
        for element, rows in zip(self.elements, rows_of_boxes(self.boxes, germs), strict=True):
            if len(rows):
                found[rows] = element._evaluate(germs[rows])
        return found

    def _derivative(self, germs: Array, germ: int) -> Array:
        found = np.empty((len(germs), *self.labels.shape))
        for element, rows in zip(self.elements, rows_of_boxes(self.boxes, germs), strict=True):
            if len(rows):
                found[rows] = element._derivative(germs[rows], germ)
        return found

    def _sampler(self, germs: Array) -> Samples:
        pairs = zip(self.elements, rows_of_boxes(self.boxes, germs), strict=True)
        parts = [element._sampler(germs[rows]) for element, rows in pairs if len(rows)]
        return Samples(
            lambda part: np.concatenate([of.columns(part) for of in parts]),
            lambda part: np.concatenate([of.rows(part) for of in parts], axis=1),
        )

    def _verdicts_of_decay(self, tolerance: float) -> tuple[str, ...]:
        tops = np.sqrt(self._merged(np.stack([e.top_energy for e in self.elements])))
        shape = (len(self.labels.outputs), -1)
        spread = reference_spread(self.std.reshape(shape))
        share = tops.reshape(shape) / divisor(spread)
        return tuple(
            f"{output.name}: within the {len(self.elements)} elements the top order carries "
            f"{format_at_most(float(np.fmax.reduce(row)))} of the standard deviation"
            + (f"; {self._remedy}" if np.any(row > tolerance) else ", no proof without verification realisations")
            for output, row in zip(self.labels.outputs, share, strict=True)
        )

    @cached_property
    def _means(self) -> Array:
        return np.stack([element.mean for element in self.elements])

    @cached_property
    def _stds(self) -> Array:
        return np.stack([element.std for element in self.elements])

    @cached_property
    def _shape_moments(self) -> tuple[Array, Array]:
        std = np.where(self._constant, 1.0, self.std)
        away, s = (self._means - self.mean) / std, self._stds / std
        skewness = np.stack([e.skewness for e in self.elements])
        kurtosis = np.stack([e.kurtosis for e in self.elements])
        third = self._merged(s**3 * skewness + 3 * s**2 * away + away**3)
        fourth = self._merged(s**4 * kurtosis + 4 * s**3 * skewness * away + 6 * s**2 * away**2 + away**4)
        return np.where(self._constant, 0.0, third), np.where(self._constant, 3.0, fourth)

    def _merged(self, values: Array) -> Array:
        """Average over the elements (E, O, T), by their probabilities."""
        found: Array = np.einsum("e,e...->...", self.probabilities, values) / self.probabilities.sum()
        return found

    def _weighted(self, energies: Callable[[Array, Index], Array]) -> Array:
        return self._merged(np.stack([energies(local, self.multi_index) for local in self.coefficients]))

    def _closed(self, germs: list[int]) -> Array:
        """Share of the variance that the expectation given some germs has."""
        if not germs:
            return np.zeros(self.labels.shape)
        shape = self.coefficients.shape
        with one_thread():
            found = closed_variance(
                self.coefficients.reshape(*shape[:2], -1), self.multi_index, self.boxes, self.mean.ravel(), germs
            )
        share = found.reshape(self.labels.shape) / np.where(self._constant, 1.0, self.variance)
        return np.where(self._constant, 0.0, np.clip(share, 0.0, 1.0))
