"""Provide the base class of surrogates: elements with coefficients, and a readout from coefficients to outputs.

Length: the module has a single class, whose public methods have examples.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import cached_property
from typing import TYPE_CHECKING, Any, ClassVar, Self, TypeVar

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike, NDArray

from uqmbd.arguments import shown, typechecked
from uqmbd.errors import StudyError
from uqmbd.results.chaos.boxes import (
    BOUNDS,
    VERIFICATION,
    box_variables,
    boxes_of,
    check_filled,
    checked_weights,
    degrees,
    read_surrogate,
    rows_of_boxes,
    surrogate_dataset,
    terms_of_all,
    verification_of,
    verification_of_all,
)
from uqmbd.results.chaos.readouts import Piece, Readout, SampleBlocks, SampledPiece
from uqmbd.results.chaos.sampling import basis_values
from uqmbd.results.chaos.surrogate_moments import SampledMoments
from uqmbd.results.chaos.terms import constant_columns
from uqmbd.results.schema import Labels
from uqmbd.typing import Array, Index, Mask

if TYPE_CHECKING:
    from uqmbd.randomness import GermBox, GermSpace

__all__ = ["SurrogateContainer", "frozen"]

_Kind = TypeVar("_Kind", bound=np.generic)

ROUNDING = 1e-6
"""Distance of a germ from its support that is accepted as rounding error of inputs far from zero."""


@typechecked
class SurrogateContainer:
    """Base class of surrogates with evaluation, moments and storage, made of elements and a readout."""

    labels: Labels
    space: GermSpace
    multi_index: Index
    elements: tuple[Any, ...]
    verification_germs: Array | None
    verification_response: Array | None
    verification_weights: Array | None

    _kind: ClassVar[type[Any]]  # class of the readout

    def __post_init__(self) -> None:
        """Check terms, weights, boxes and times, and set derived attributes."""
        object.__setattr__(self, "elements", tuple(self.elements))
        if np.ndim(self.multi_index) != 2:
            raise StudyError(
                f"{type(self).__name__}: multi_index is {shown(self.multi_index)}; expected an array (P, d)."
            )
        check_filled(self._boxes)
        object.__setattr__(self, "space", self._boxes[0].space)
        weights = checked_weights(self.verification_weights, self.verification_germs, self._boxes)
        object.__setattr__(self, "verification_weights", weights)
        if self.labels.times is None:
            raise StudyError(f"Scalar outputs have no {self._kind.of_times}; use PolynomialChaos.")

    @property
    def readout(self) -> Readout:
        """Readout from coefficients to outputs; its ``name`` is also the name of the dataset of the surrogate."""
        found: Readout = self._reader
        return found

    @property
    def _reader(self) -> Any:
        """Readout, created from attributes of the surrogate with the same names."""
        return self._kind(**{name: getattr(self, name) for name in getattr(self._kind, "__dataclass_fields__", ())})

    @property
    def _boxes(self) -> tuple[GermBox, ...]:
        """Boxes of the germ space, one for each element."""
        return tuple(element.box for element in self.elements)

    @property
    def _pieces(self) -> tuple[Piece, ...]:
        """Elements with their germ spaces and terms."""
        return tuple((element.box.local, self.multi_index, element) for element in self.elements)

    def _sampled(self, germs: Array) -> list[tuple[Piece, SampledPiece]]:
        """Prepare samples at germ points (K, d), for each element that contains points."""
        pieces, reader = self._pieces, self._reader
        rows_of = [np.arange(len(germs))] if len(pieces) == 1 else rows_of_boxes(self._boxes, germs)
        return [
            ((space, terms, element), reader.at(element, rows, basis_values(space, germs[rows], terms)))
            for (space, terms, element), rows in zip(pieces, rows_of, strict=True)
            if len(rows)
        ]

    def _evaluate(self, germs: Array) -> Array:
        """Evaluate at germ points (K, d): (K, O, T)."""
        found = np.empty((len(germs), *self.labels.shape))
        for _, one in self._sampled(germs):
            one.evaluate(slice(None), self._reader.since(self.labels), found)
        return found

    def _derivative(self, germs: Array, germ: int) -> Array:
        """Differentiate with respect to one germ, at germ points (K, d): (K, O, T)."""
        found = np.empty((len(germs), *self.labels.shape))
        for (space, terms, _), one in self._sampled(germs):
            change = basis_values(space, germs[one.rows], terms, germ)
            one.evaluate_change(change, self._reader.since(self.labels), found)
        return found

    def _sampler(self, germs: Array) -> SampleBlocks:
        """Prepare samples at germ points (K, d), in any order."""
        found: SampleBlocks = self._reader.samples([one for _, one in self._sampled(germs)], self.labels)
        return found

    @cached_property
    def _moments(self) -> Any:
        """Moments and Sobol' indices from samples; subclasses with exact moments override this property."""
        this: Any = self
        rms = None if self.verification_germs is None else this.verification_rms()
        return SampledMoments(self.space, self.multi_index, self.labels.shape, self.evaluate_germs, self._without, rms)

    def _without(self, terms: Mask, germs: Array) -> Array:
        """Evaluate at germ points (K, d) without the terms in a mask (P,)."""
        this: Any = self
        return np.asarray(replace(this, elements=tuple(e._without(terms) for e in self.elements)).evaluate_germs(germs))

    def _statistic(self, name: str, axis: int, part: Any = slice(None)) -> Array:
        """Return a statistic of `_moments`, or its entries `part`; `axis` is the axis of its outputs."""
        return frozen(np.asarray(getattr(self._moments, name)[part]))

    @cached_property
    def mean(self) -> Array:
        """Expectation, shape (O, T), in the units of the outputs."""
        return self._statistic("mean", 0)

    @cached_property
    def std(self) -> Array:
        """Standard deviation, shape (O, T), in the units of the outputs."""
        return self._statistic("spread", 1, 0)

    @cached_property
    def variance(self) -> Array:
        """Variance, shape (O, T)."""
        return self._statistic("spread", 1, 1)

    @cached_property
    def skewness(self) -> Array:
        """Third standardised moment, shape (O, T); 0 where an output does not vary.

        If the exact moment needs too many operations, it is estimated from surrogate samples (:attr:`shape_samples`).
        """
        return self._statistic("shape", 1, 0)

    @cached_property
    def kurtosis(self) -> Array:
        """Fourth standardised moment (not the excess), shape (O, T); 3 for a normal or a constant output."""
        return self._statistic("shape", 1, 1)

    @property
    def shape_samples(self) -> int:
        """Number of surrogate samples from which skewness and kurtosis are estimated; 0 if they are exact."""
        return int(self._moments.shape_samples)

    @property
    def germ_names(self) -> tuple[str, ...]:
        """Names of the germs; independent inputs give their names to the germs."""
        return tuple(self.space.names)

    @cached_property
    def sobol_first_germ(self) -> Array:
        """First-order Sobol' indices of the germs, shape (germ, O, T), in the order of :attr:`germ_names`."""
        return self._statistic("sobol", 2, 0)

    @cached_property
    def sobol_total_germ(self) -> Array:
        """Total Sobol' indices of the germs, shape (germ, O, T)."""
        return self._statistic("sobol", 2, 1)

    @cached_property
    def sobol_second_germ(self) -> Array:
        """Sobol' indices of pairs of germs, shape (germ, germ, O, T): symmetric, 0 on the diagonal."""
        return self._statistic("sobol_second", 2)

    @cached_property
    def sobol_first(self) -> Array:
        """First-order Sobol' indices, shape (input, O, T): share of the variance due to one input alone."""
        return self._by_input("sobol_first")

    @cached_property
    def sobol_total(self) -> Array:
        """Total Sobol' indices, shape (input, O, T): share of the variance due to an input and its interactions."""
        return self._by_input("sobol_total")

    @cached_property
    def sobol_second(self) -> Array:
        """Sobol' indices of pairs, shape (input, input, O, T): symmetric, 0 on the diagonal."""
        return self._by_input("sobol_second")

    @property
    def top_energy(self) -> Array:
        """Mean square of the terms of the top order (O, T), an upper estimate of the contribution of the next order."""
        return self._statistic("tops", 1, 0)

    @property
    def top_energy_germ(self) -> Array:
        """Part of each germ in :attr:`top_energy`, shape (d, O, T)."""
        return self._statistic("tops", 1, slice(1, None))

    @property
    def variance_germ(self) -> Array:
        """Variance due to each germ and its interactions (d, O, T)."""
        return np.asarray(self.sobol_total_germ * self.variance)

    @classmethod
    def joined(cls, chaoses: Sequence[Self], boxes: Sequence[GermBox]) -> Self:
        """Join several surrogates with one element each into one surrogate.

        Each given surrogate refers to the conditional distribution in its box.

        Parameters
        ----------
        chaoses : sequence
            Surrogates of the elements, with the same outputs, times and harmonics.
        boxes : sequence of GermBox
            Box of each surrogate; the boxes fill the germ space.

        Returns
        -------
        AlignedChaos or QuasiPeriodicChaos
            Surrogate on the whole germ space.

        Examples
        --------
        >>> import chaospy
        >>> import numpy as np
        >>> import uqmbd
        >>> from uqmbd.results import AlignedChaos
        >>> from uqmbd.extend import AlignedElement
        >>> from uqmbd.extend import labels
        >>> a = uqmbd.RandomVariable("a", chaospy.Uniform(-1, 1))
        >>> mechanism = uqmbd.Mechanism("inputs", uqmbd.Line())
        >>> mechanism.output("a", a)
        >>> space = uqmbd.extend.GermSpace.of(mechanism.inputs)
        >>> def half(box, level):  # a constant in half of the germ space
        ...     values, edges = np.full((1, 1, 1, 3), level), np.array([[0.0, 1.0]])
        ...     element = AlignedElement.through(uqmbd.extend.GermBox.whole(box.local), ("",), edges, values, "time")
        ...     return AlignedChaos((element,), np.array([[0]]), labels(["x"], ["a"], [0.5]))
        >>> boxes = uqmbd.extend.GermBox.whole(space).split(0)
        >>> chaos = AlignedChaos.joined([half(box, level) for box, level in zip(boxes, (-1.0, 1.0))], boxes)
        >>> chaos.evaluate([[-0.5], [0.5]]).ravel().tolist()
        [-1.0, 1.0]
        """
        if not len(chaoses) or len(chaoses) != len(boxes) or any(type(x) is not type(chaoses[0]) for x in chaoses):
            raise StudyError(
                f"{cls.__name__}.joined: {len(chaoses)} surrogates and {len(boxes)} boxes are given; expected at "
                "least one surrogate, all of one kind, and one box for each."
            )
        terms, places = terms_of_all(chaoses)
        owners = zip(chaoses, boxes, places, strict=True)
        elements = tuple(chaos.elements[0]._among(box, len(terms), rows) for chaos, box, rows in owners)
        known: dict[str, Any] = verification_of_all(chaoses, [box.probability for box in boxes])
        first: Any = chaoses[0]
        found: Self = replace(first, elements=elements, multi_index=terms, **known)
        return found

    def selected(self, outputs: Sequence[int] | None = None, times: Sequence[int] | None = None) -> Self:
        """Return the surrogate of selected outputs and times, by index, or this surrogate if all are selected.

        Raises
        ------
        StudyError
            If an output or time does not exist, or the selection is empty.

        Examples
        --------
        >>> import chaospy, uqmbd
        >>> from uqmbd.randomness import GermSpace, JointInput
        >>> from uqmbd.results import PolynomialChaos
        >>> from uqmbd.extend import labels
        >>> space = GermSpace.of(JointInput.of([uqmbd.RandomVariable("a", chaospy.Normal(3, 0.2), units="m/s")]))
        >>> axes = labels(["y"], ["a"], [0.0, 1.0])
        >>> chaos = PolynomialChaos([[[1.0, 2.0]], [[0.5, 0.0]]], [[0], [1]], space, axes)
        >>> chaos.selected(times=[1]).mean.tolist()
        [[2.0]]
        """
        whole = dict(zip(self.labels.dims, self.labels.shape, strict=True))
        requested = {dim: list(one) for dim, one in (("output", outputs), ("time", times)) if one is not None}
        for dim, one in requested.items():
            if not one or any(k not in range(whole.get(dim, 0)) for k in one):
                raise StudyError(
                    f"The selected indices along {dim!r} are {one!r}; expected at least one index, each from 0 to "
                    f"{whole.get(dim, 0) - 1}."
                )
        fewer = {dim: one for dim, one in requested.items() if one != [*range(whole[dim])]}
        return self._of(fewer) if fewer else self

    def _of(self, fewer: Mapping[str, Sequence[int]]) -> Self:
        """Return the surrogate of outputs and times by index, for each dimension to select from."""
        return type(self).from_dataset(self._dataset(stated=False).isel(dict(fewer)))

    def reached(self) -> Self:
        """Return the surrogate at the times that all samples reach.

        An aligned surrogate may lose times; any other surrogate is returned unchanged.

        Examples
        --------
        >>> import chaospy, uqmbd
        >>> from uqmbd.randomness import GermSpace, JointInput
        >>> from uqmbd.results import PolynomialChaos
        >>> from uqmbd.extend import labels
        >>> space = GermSpace.of(JointInput.of([uqmbd.RandomVariable("a", chaospy.Normal(3, 0.2), units="m/s")]))
        >>> axes = labels(["y"], ["a"], [0.0])
        >>> chaos = PolynomialChaos([[[1.0]], [[0.5]]], [[0], [1]], space, axes)  # 1 + 0.5 psi
        >>> chaos.reached() is chaos
        True
        """
        return self

    def to_dataset(self) -> xr.Dataset:
        """Build the dataset of a propagator's node in which the surrogate is stored; see :meth:`from_dataset`.

        Examples
        --------
        >>> import chaospy, uqmbd
        >>> from uqmbd.randomness import GermSpace, JointInput
        >>> from uqmbd.results import PolynomialChaos
        >>> from uqmbd.extend import labels
        >>> inputs = [uqmbd.RandomVariable(name, chaospy.Uniform(-1, 1)) for name in "ab"]
        >>> space, axes = GermSpace.of(JointInput.of(inputs)), labels(["y"], ["a", "b"], [0.0])
        >>> chaos = PolynomialChaos([[[1.0]], [[0.3]], [[0.4]], [[0.0]]], [[0, 0], [1, 0], [0, 1], [1, 1]], space, axes)
        >>> chaos.to_dataset()["coefficients"].sizes["term"]
        4
        """
        return self._dataset(stated=True)

    def to_datasets(self) -> dict[str, xr.Dataset]:
        """Build the datasets of a propagator's node, by path below the node; only composed surrogates have several.

        Examples
        --------
        >>> import chaospy, uqmbd
        >>> from uqmbd.randomness import GermSpace, JointInput
        >>> from uqmbd.results import PolynomialChaos
        >>> from uqmbd.extend import labels
        >>> space = GermSpace.of(JointInput.of([uqmbd.RandomVariable("a", chaospy.Normal(3, 0.2), units="m/s")]))
        >>> axes = labels(["y"], ["a"], [0.0])
        >>> chaos = PolynomialChaos([[[1.0]], [[0.5]]], [[0], [1]], space, axes)  # 1 + 0.5 psi
        >>> list(chaos.to_datasets())
        ['chaos']
        """
        return {self.readout.name: self.to_dataset()}

    def _dataset(self, *, stated: bool) -> xr.Dataset:
        """Build the dataset, with the stated error on request."""
        known = {name: getattr(self, name) for name in VERIFICATION} if self.verification_germs is not None else {}
        return surrogate_dataset(self.space, self.labels, self._variables(stated and bool(known)), known)

    def _variables(self, stated: bool) -> dict[str, Any]:
        """Return the variables of the dataset that this class defines; add the stated error on request."""
        boxes = box_variables(self._boxes, {"units": "1"})
        return {**self._reader.variables(self.elements), **degrees(self.multi_index), **boxes}

    @classmethod
    def from_dataset(cls, dataset: xr.Dataset | xr.DataTree) -> Self:
        """Return a surrogate from its dataset of a result, without the mechanism.

        Raises
        ------
        StudyError
            If the dataset does not contain a surrogate of this class.

        Examples
        --------
        >>> import chaospy, uqmbd
        >>> from uqmbd.randomness import GermSpace, JointInput
        >>> from uqmbd.results import PolynomialChaos
        >>> from uqmbd.extend import labels
        >>> inputs = [uqmbd.RandomVariable(name, chaospy.Uniform(-1, 1)) for name in "ab"]
        >>> space, axes = GermSpace.of(JointInput.of(inputs)), labels(["y"], ["a", "b"], [0.0])
        >>> chaos = PolynomialChaos([[[1.0]], [[0.3]], [[0.4]], [[0.0]]], [[0, 0], [1, 0], [0, 1], [1, 1]], space, axes)
        >>> again = PolynomialChaos.from_dataset(chaos.to_dataset())
        >>> bool((again.coefficients == chaos.coefficients).all())
        True
        """
        return cls(**cls._arguments(dataset))

    @classmethod
    def _arguments(cls, dataset: xr.Dataset | xr.DataTree) -> dict[str, Any]:
        """Return the arguments of the constructor from a dataset."""
        needed = (*cls._kind.needed, "multi_index", *BOUNDS)
        data, labels, space = read_surrogate(dataset, cls._kind.name, needed)
        readout, elements = cls._kind.read(data, boxes_of(data, space))
        terms = data["multi_index"].transpose("term", "input").values
        found = {"elements": elements, "multi_index": terms, "labels": labels, **vars(readout)}
        return found | verification_of(data)

    def evaluate_germs(self, germs: ArrayLike) -> Array:
        """Evaluate at germ points (K, d): (K, O, T), in the units of the outputs.

        Raises
        ------
        StudyError
            If the shape differs from (K, d), or a germ is outside its support.

        Examples
        --------
        >>> import chaospy, uqmbd
        >>> from uqmbd.randomness import GermSpace, JointInput
        >>> from uqmbd.results import PolynomialChaos
        >>> from uqmbd.extend import labels
        >>> space = GermSpace.of(JointInput.of([uqmbd.RandomVariable("a", chaospy.Normal(3, 0.2), units="m/s")]))
        >>> axes = labels(["y"], ["a"], [0.0])
        >>> chaos = PolynomialChaos([[[1.0]], [[0.5]]], [[0], [1]], space, axes)  # 1 + 0.5 psi
        >>> chaos.evaluate_germs([[0.0], [2.0]]).ravel().tolist()
        [1.0, 2.0]
        """
        points = np.asarray(germs, dtype=float)
        if points.ndim != 2 or points.shape[1] != len(self.germ_names):
            raise StudyError(f"The points have the shape {points.shape}; expected (K, {len(self.germ_names)}).")
        low, high = np.array([germ.bounds for germ in self.space.germs]).T
        outside = ~((points >= low - ROUNDING) & (points <= high + ROUNDING))
        if outside.any():
            row, k = np.argwhere(outside)[0]
            raise StudyError(
                f"Germ {self.germ_names[k]!r} is {points[row, k]:.10g} in row {row}; expected a number in its "
                f"support, from {low[k]:g} to {high[k]:g}."
            )
        return self._evaluate(points)

    @cached_property
    def _constant(self) -> Mask:
        """Mask of constant outputs and times (O, T)."""
        return constant_columns(self.mean, self.std, self._moments.summands)

    def _by_input(self, name: str) -> Array:
        if not self.space.independent:
            raise StudyError(
                f"'{name}' does not exist for dependent inputs, because shares of the variance belong to the germs. "
                f"Use '{name}_germ', in the order {', '.join(self.germ_names)}."
            )
        found: Array = getattr(self, f"{name}_germ")
        return found


def frozen(array: NDArray[_Kind]) -> NDArray[_Kind]:
    """Make an array read-only and return it."""
    array.setflags(write=False)
    return array
