"""Provide multi-element polynomial chaos: a separate chaos in each box of the germ space."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
import xarray as xr

from uqmbd.arguments import typechecked
from uqmbd.errors import StudyError
from uqmbd.results.chaos.boxes import (
    BOUNDS,
    box_variables,
    boxes_of,
    check_filled,
    degrees,
    read_surrogate,
    rows_of_boxes,
    terms_of_all,
    verification_of,
    verification_of_all,
)
from uqmbd.results.chaos.container import frozen
from uqmbd.results.chaos.decay import decay_dataset, energy_of_germs, energy_of_orders
from uqmbd.results.chaos.interface import Surrogate
from uqmbd.results.chaos.polynomial import PolynomialChaos
from uqmbd.results.chaos.readouts import Piece, Plain
from uqmbd.results.chaos.stated_error import exceeds_locally, reference_spread, spread_words
from uqmbd.results.chaos.surrogate_moments import MergedMoments
from uqmbd.results.schema import Labels
from uqmbd.results.statistics import divisor
from uqmbd.typing import Array, Index, Mask
from uqmbd.wording import format_at_most

if TYPE_CHECKING:
    from uqmbd.randomness import GermBox, GermSpace

__all__ = ["PiecewiseChaos"]


@typechecked
@dataclass(frozen=True, eq=False, repr=False)
class PiecewiseChaos(Surrogate):
    """Outputs as a polynomial chaos in each box (element) of a partition of the germ space.

    The class has the interface of :class:`uqmbd.results.PolynomialChaos`. Moments are merged from the moments of the
    elements. Sobol' indices are exact integrals of the piecewise polynomial over the whole germ space. Quantiles and
    densities come from samples. The object is immutable.

    Parameters
    ----------
    elements : sequence of PolynomialChaos
        Chaos of each box, on the ``local`` germ space of the box. All elements have the same labels. Verification
        realisations are within the box of their element.
    boxes : sequence of GermBox
        Disjoint boxes that fill the germ space.

    Raises
    ------
    StudyError
        If elements and boxes do not fit, or the boxes do not fill the space.

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

    _kind = Plain

    @property
    def _remedy(self) -> str:
        return "increase max_elements, or raise the order"

    def __post_init__(self) -> None:
        """Check that elements and boxes match."""
        object.__setattr__(self, "elements", tuple(self.elements))
        object.__setattr__(self, "boxes", tuple(self.boxes))
        if not self.elements or len(self.elements) != len(self.boxes):
            raise StudyError(
                f"PiecewiseChaos: {len(self.elements)} polynomial chaoses and {len(self.boxes)} boxes are given; "
                "expected at least one box, and one polynomial chaos for each."
            )
        first = self.elements[0].labels
        for element, box in zip(self.elements, self.boxes, strict=True):
            same = element.labels.dims == first.dims and element.labels.outputs == first.outputs
            if not same or not np.array_equal(element.labels.times, first.times):  # type: ignore[arg-type]
                raise StudyError(
                    "PiecewiseChaos: the outputs or times of the elements differ; expected the same outputs and "
                    "times in all elements."
                )
            if element.space.inputs != box.space.inputs:
                raise StudyError(
                    f"PiecewiseChaos: a polynomial chaos has the inputs {element.space.inputs}, but its box has the "
                    f"inputs {box.space.inputs}; expected the same inputs."
                )
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
        """Degrees of the terms of all elements, shape (P, d), with the mean first."""
        return self._terms[0]

    @cached_property
    def coefficients(self) -> Array:
        """Coefficients of each element, shape (E, P, O, T); 0 for terms that an element does not have."""
        terms, places = self._terms
        found = np.zeros((len(self.elements), len(terms), *self.labels.shape))
        for part, element, rows in zip(found, self.elements, places, strict=True):
            part[rows] = element.coefficients
        return frozen(found)

    @cached_property
    def has_term(self) -> Mask:
        """Whether each element has each term, shape (E, P)."""
        terms, places = self._terms
        return np.array([np.isin(np.arange(len(terms)), rows) for rows in places])

    def element_errors(self) -> Array:
        """Return the stated error within each element, relative to the total standard deviation.

        Returns
        -------
        array, shape (E, O, T)
            Root mean square error at the verification realisations of the element; 0 if it has none. The mean square of
            these errors, weighted by the element probabilities, is at most the square of :meth:`verification_error`.
            The latter is larger if some elements have no verification realisations, or if the elements differ at their
            common faces.

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
        """Build a dataset of the decay of the coefficients with the order, averaged over the elements.

        Returns
        -------
        xarray.Dataset
            Dataset as from :meth:`PolynomialChaos.decay`. The weight of each element is its probability.

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
            rate_note="decrease within the elements, in decades of the remaining standard deviation per order",
        )

    @property
    def _boxes(self) -> tuple[GermBox, ...]:
        return self.boxes

    @property
    def _pieces(self) -> tuple[Piece, ...]:
        return tuple(piece for element in self.elements for piece in element._pieces)

    @cached_property
    def _terms(self) -> tuple[Index, list[list[int]]]:
        """All terms (P, d), and the indices of the terms of each element."""
        return terms_of_all(self.elements)

    @cached_property
    def _moments(self) -> MergedMoments:
        parts = [element._moments for element in self.elements]
        return MergedMoments(parts, self.boxes, self.multi_index, self.coefficients)

    def _variables(self, stated: bool) -> dict[str, Any]:
        about = {
            "long_name": "coefficients of the orthonormal polynomials of each element",
            "comment": "in the units of the outputs; 0 where an element does not have a term",
        }
        has_term = {"long_name": "whether an element has a term", "comment": "1: yes, 0: no"}
        found = {
            "coefficients": (("element", "term", *self.labels.dims), self.coefficients, about),
            "has_term": (("element", "term"), self.has_term.astype(np.int8), has_term),
        }
        if stated:
            note = (
                "root mean square at realisations in the element that are not nodes, divided by the whole standard "
                "deviation"
            )
            about = {"long_name": "stated error of the surrogate within the element", "comment": note}
            found["verification_error"] = (("element", *self.labels.dims), self.element_errors(), about)
        boxes = box_variables(self.boxes, {"long_name": "probability of the element"})
        return found | boxes | degrees(self.multi_index, "column k belongs to germ k")

    @classmethod
    def _arguments(cls, dataset: xr.Dataset | xr.DataTree) -> dict[str, Any]:
        data, labels, space = read_surrogate(dataset, "chaos", ("coefficients", "multi_index", *BOUNDS), "element")
        boxes, verified = boxes_of(data, space), verification_of(data)
        coefficients = data["coefficients"].transpose("element", "term", *labels.dims).values
        multi_index = data["multi_index"].transpose("term", "input").values
        germs = verified.get("verification_germs", np.zeros((0, space.dimension)))
        elements = []
        for k, (box, own) in enumerate(zip(boxes, rows_of_boxes(boxes, germs), strict=True)):
            # a box of a discrete germ has fewer polynomials
            highest = [germ.values - 1 if germ.values is not None else np.inf for germ in box.local.germs]
            included = (multi_index <= highest).all(axis=1)
            if "has_term" in data:
                included &= data["has_term"].values[k] != 0
            known = {name: values[own] for name, values in verified.items()} if len(own) else {}
            elements.append(
                PolynomialChaos(coefficients[k][included], multi_index[included], box.local, labels, **known)
            )
        return {"elements": tuple(elements), "boxes": boxes}

    def _verdicts_of_decay(self, tolerance: float) -> tuple[str, ...]:
        tops = np.sqrt(self.top_energy)
        shape = (len(self.labels.outputs), -1)
        spread = reference_spread(self.std.reshape(shape))
        share = tops.reshape(shape) / divisor(spread)
        return tuple(
            f"{output.name}: within the {len(self.elements)} elements, the terms of the highest order contribute "
            + format_at_most(float(np.fmax.reduce(row)), spread_words(exceeds_locally(row, std, np.fmax.reduce(row))))
            + (
                f"; {self._remedy}"
                if np.any(row > tolerance)
                else "; only verification realisations can prove that the order is sufficient"
            )
            for output, row, std in zip(self.labels.outputs, share, self.std.reshape(shape), strict=True)
        )

    def _weighted(self, energies: Callable[[Array, Index], Array]) -> Array:
        return self._moments.merged(np.stack([energies(local, self.multi_index) for local in self.coefficients]))
