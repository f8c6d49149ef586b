"""Multi-element polynomial chaos: a chaos of its own in each of some boxes of the germ space."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike, NDArray

from uqmbd.errors import StudyError
from uqmbd.results.chaos import decay as decaying
from uqmbd.results.chaos.chaos import PolynomialChaos
from uqmbd.results.chaos.moments import constant_columns
from uqmbd.results.chaos.piecewise_sobol import closed_variance
from uqmbd.results.chaos.sampling import basis_values, quantiles_of_rows, spread_germs
from uqmbd.results.chaos.stated_error import reference_spread, stated_error
from uqmbd.results.chaos.surrogate import SAMPLES, ChaosInterface
from uqmbd.results.schema import DEFAULT_PROBABILITIES, Labels, fixed_width
from uqmbd.results.statistics import circular_of_blocks
from uqmbd.threads import one_thread
from uqmbd.typing import Array, Index

if TYPE_CHECKING:
    from uqmbd.randomness import GermBox, GermSpace

__all__ = ["PiecewiseChaos", "chaos_from_dataset"]


REMEDY = "allow more elements, or raise the order"


@dataclass(frozen=True, eq=False, repr=False)
class PiecewiseChaos(ChaosInterface):
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
    >>> from uqmbd.results import labels
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
        total = float(self.probabilities.sum())
        if abs(total - 1) > 1e-9:
            raise StudyError(f"The boxes must fill the germ space; their probabilities sum to {total:.12g}.")

    def __repr__(self) -> str:
        sizes = zip(("elements", "terms", *self.labels.dims), self.coefficients.shape, strict=True)
        axes = ", ".join(f"{name}: {size}" for name, size in sizes)
        return f"<{type(self).__name__} of {', '.join(self.germ_names)} ({axes})>"

    @property
    def labels(self) -> Labels:  # type: ignore[override]
        """Meaning of the axes."""
        return self.elements[0].labels

    @property
    def space(self) -> GermSpace:
        """The germs, and the map between germs and inputs."""
        return self.boxes[0].space

    @cached_property
    def probabilities(self) -> Array:
        """Probability of each element, shape (E,)."""
        return np.array([box.probability for box in self.boxes])

    @cached_property
    def multi_index(self) -> Index:
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
    def has_term(self) -> NDArray[np.bool_]:
        """Whether each element has each term, shape (E, P)."""
        own = [set(map(tuple, element.multi_index.tolist())) for element in self.elements]
        return np.array([[tuple(row) in terms for row in self.multi_index.tolist()] for terms in own], dtype=bool)

    @property
    def verification_germs(self) -> Array | None:
        """Germ points (V, d) that did not enter the coefficients, element by element; None if there are none."""
        found = [e.verification_germs for e in self.elements if e.verification_germs is not None]
        return np.concatenate(found) if found else None

    @property
    def verification_response(self) -> Array | None:
        """What the mechanism did there, shape (V, O, T)."""
        found = [e.verification_response for e in self.elements if e.verification_response is not None]
        return np.concatenate(found) if found else None

    @property
    def verification_weights(self) -> Array:
        """Weights of these points, shape (V,): each element counts by its probability."""
        counts = [0 if e.verification_germs is None else len(e.verification_germs) for e in self.elements]
        each = [np.full(n, p / n) for n, p in zip(counts, self.probabilities, strict=True) if n]
        weights = np.concatenate([np.zeros(0), *each])
        return weights / weights.sum() if len(weights) else weights

    @cached_property
    def mean(self) -> Array:
        """Expectation, shape (O, T), in the units of the outputs."""
        return self._merged(self._means)

    @cached_property
    def std(self) -> Array:
        """Standard deviation, shape (O, T), in the units of the outputs."""
        return np.sqrt(self._merged(self._stds**2 + (self._means - self.mean) ** 2))

    @cached_property
    def variance(self) -> Array:
        """Variance, shape (O, T)."""
        return np.asarray(self.std**2)

    @property
    def skewness(self) -> Array:
        """Third standardised moment, shape (O, T); 0 where an output does not vary."""
        return self._shape_moments[0]

    @property
    def kurtosis(self) -> Array:
        """Fourth standardised moment, shape (O, T), not the excess: 3 for a normal, and where it does not vary."""
        return self._shape_moments[1]

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

    def evaluate_germs(self, germs: ArrayLike) -> Array:
        """Evaluate at germ points (K, d): (K, O, T), in the units of the outputs."""
        points = np.asarray(germs, dtype=float)
        if points.ndim != 2 or points.shape[1] != len(self.germ_names):
            raise StudyError(f"Points must have the shape (K, {len(self.germ_names)}); {points.shape} was given.")
        found = np.empty((len(points), *self.labels.shape))
        for element, rows in zip(self.elements, self._rows(points), strict=True):
            if len(rows):
                found[rows] = element.evaluate_germs(points[rows])
        return found

    def quantiles(
        self, probabilities: Sequence[float] = DEFAULT_PROBABILITIES, *, samples: int = SAMPLES, seed: int = 0
    ) -> Array:
        """Return quantiles (N, O, T) of samples of the surrogate; see :meth:`PolynomialChaos.quantiles`."""
        parts, count = self._sampled(samples, seed)
        columns = int(np.prod(self.labels.shape))
        flat = [e.coefficients.reshape(len(e.coefficients), -1) for e, _ in parts]

        def rows(part: slice) -> Array:
            found = [np.ascontiguousarray(c[:, part].T) @ psi.T for c, (_, psi) in zip(flat, parts, strict=True)]
            return np.concatenate(found, axis=1)

        found = quantiles_of_rows(rows, count, columns, probabilities)
        return found.reshape(len(found), *self.labels.shape)

    def circular(self, *, samples: int = SAMPLES, seed: int = 0) -> dict[str, Array]:
        """Return `circular_mean` and `circular_std`, (O, T), of the outputs that are angles, from surrogate samples."""
        if not np.any(self.labels.turns):
            return {}
        parts, count = self._sampled(samples, seed)
        flat = [e.coefficients.reshape(*e.coefficients.shape[:2], -1) for e, _ in parts]

        def values(output: int, part: slice) -> Array:
            return np.concatenate([psi @ c[:, output, part] for c, (_, psi) in zip(flat, parts, strict=True)])

        return circular_of_blocks(self.labels.shape, count, self.labels.turns, values)

    def element_errors(self) -> Array:
        """Return the stated error within each element, over the standard deviation of the whole.

        Returns
        -------
        array, shape (E, O, T)
            The root mean square at the verification realisations of the element; 0 where it has none.  With the
            probabilities as weights their mean square is that of :meth:`verification_error`.
        """
        shape = (len(self.labels.outputs), -1)
        spread = reference_spread(self.std.reshape(shape)).reshape(self.labels.shape)
        found = np.zeros((len(self.elements), *self.labels.shape))
        for row, element in zip(found, self.elements, strict=True):
            if element.verification_germs is not None and element.verification_response is not None:
                wrong = element.evaluate_germs(element.verification_germs) - element.verification_response
                row[...] = np.sqrt(np.mean(wrong**2, axis=0)) / np.where(spread > 0, spread, 1.0)
        return found

    def decay(self) -> xr.Dataset:
        """Build a dataset of how the coefficients fall with the order, on average over the elements.

        Returns
        -------
        xarray.Dataset
            As of :meth:`PolynomialChaos.decay`; of each element its probability is the weight.
        """
        dims = self.labels.dims
        energy = self._weighted(decaying.energy_of_orders)
        by_germ = self._weighted(decaying.energy_of_germs)
        rate = np.where(self._constant, np.nan, decaying.decay_rate(energy))
        comment = {"comment": "within the elements; decades of the remaining standard deviation per order"}
        note = {"long_name": "sum of squared coefficients, averaged over the elements"}
        return xr.Dataset(
            {
                "energy": (("order", *dims), energy, note),
                "energy_germ": (("germ", "degree", *dims), by_germ, note),
                "rate": (dims, rate, {"long_name": "decay per order"} | comment),
            },
            coords={
                **self.labels.output_coords(),
                "order": np.arange(len(energy)),
                "germ": ("germ", fixed_width(self.germ_names)),
                "degree": np.arange(by_germ.shape[1]),
            },
        )

    def verdicts(self, tolerance: float = 0.01) -> tuple[str, ...]:
        """Say for each output, in a sentence, how far the chaos can be trusted; see :meth:`PolynomialChaos.verdicts`.

        Parameters
        ----------
        tolerance : float
            Of the error, or of the top order, relative to the standard deviation.

        Returns
        -------
        tuple of str, length O
        """
        times, names = self.labels.times, [o.name for o in self.labels.outputs]
        if self.verification_germs is not None:
            rows = self._stated_error()
            return tuple(
                decaying.verdict_of_error(n, row, times, tolerance, REMEDY) for n, row in zip(names, rows, strict=True)
            )
        tops = np.sqrt(self._merged(np.stack([e.top_energy for e in self.elements])))
        shape = (len(names), -1)
        spread = reference_spread(self.std.reshape(shape))
        share = tops.reshape(shape) / np.where(spread > 0, spread, 1.0)
        return tuple(
            f"{n}: within the {len(self.elements)} elements the top order carries at most "
            f"{decaying.percent(float(row.max()))} of the standard deviation"
            + (f"; {REMEDY}" if row.max() > tolerance else ", no proof without verification realisations")
            for n, row in zip(names, share, strict=True)
        )

    def to_dataset(self) -> xr.Dataset:
        """Build the dataset `chaos` of a propagator's node; see :meth:`from_dataset`."""
        from uqmbd.results.chaos.piecewise_storage import piecewise_dataset

        return piecewise_dataset(self)

    @classmethod
    def from_dataset(cls, dataset: xr.Dataset | xr.DataTree) -> PiecewiseChaos:
        """Make a chaos from the dataset `chaos` of a result, without the mechanism.

        Raises
        ------
        StudyError
            If it is no such dataset.
        """
        from uqmbd.results.chaos.piecewise_storage import piecewise_arguments

        return cls(**piecewise_arguments(dataset))

    @cached_property
    def _means(self) -> Array:
        return np.stack([element.mean for element in self.elements])

    @cached_property
    def _stds(self) -> Array:
        return np.stack([element.std for element in self.elements])

    @cached_property
    def _constant(self) -> NDArray[np.bool_]:
        return constant_columns(self.mean.reshape(1, -1), self.std.ravel()).reshape(self.labels.shape)

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

    def _rows(self, points: Array) -> list[NDArray[np.intp]]:
        """Numbers of the points in each element."""
        from uqmbd.randomness import located

        where = located(self.boxes, points)
        if np.any(where < 0):
            raise StudyError(f"The germ point {points[int(where.argmin())].tolist()} lies in none of the elements.")
        return [np.flatnonzero(where == k) for k in range(len(self.elements))]

    def _sampled(self, samples: int, seed: int) -> tuple[list[tuple[PolynomialChaos, Array]], int]:
        """Elements that hold samples, each with its basis there, and how many samples there are."""
        points = spread_germs(self.space, samples, seed)
        pairs = zip(self.elements, self._rows(points), strict=True)
        return [(e, basis_values(e.space, points[rows], e.multi_index)) for e, rows in pairs if len(rows)], len(points)

    def _column(self, germs: Array, where: tuple[int, ...]) -> Array:
        found = np.empty(len(germs))
        for element, rows in zip(self.elements, self._rows(germs), strict=True):
            psi = basis_values(element.space, germs[rows], element.multi_index)
            found[rows] = psi @ np.moveaxis(element.coefficients, 0, -1)[where]
        return found

    def _stated_error(self) -> Array:
        if self.verification_germs is None or self.verification_response is None:
            raise StudyError(
                "This chaos has no verification realisations, so it cannot state its error; give the propagator "
                "verify=8, or see 'verdicts' for what the coefficients tell."
            )
        shape = (len(self.labels.outputs), -1)
        surrogate = self.evaluate_germs(self.verification_germs)
        return stated_error(
            surrogate.reshape(len(surrogate), *shape),
            self.verification_response.reshape(len(surrogate), *shape),
            self.mean.reshape(1, *shape),
            self.std.reshape(shape),
            self.verification_weights,
        )


def chaos_from_dataset(dataset: xr.Dataset | xr.DataTree) -> PolynomialChaos | PiecewiseChaos:
    """Make the chaos of a result, of one element or of several, from its dataset `chaos`.

    Raises
    ------
    StudyError
        If it is no such dataset.
    """
    kind = PiecewiseChaos if "element" in dataset.dims else PolynomialChaos
    return kind.from_dataset(dataset)
