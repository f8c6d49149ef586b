"""Event-aligned polynomial chaos: event times, and the motion between them in normalised time, expanded separately."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike, NDArray

from uqmbd.errors import StudyError
from uqmbd.results.chaos import decay as decaying
from uqmbd.results.chaos.moments import constant_columns
from uqmbd.results.chaos.sampling import basis_values, quantiles_of_rows, spread_germs
from uqmbd.results.chaos.stated_error import stated_error
from uqmbd.results.chaos.surrogate import SAMPLES, ChaosInterface
from uqmbd.results.schema import DEFAULT_PROBABILITIES, Labels
from uqmbd.results.statistics import circular_of_blocks
from uqmbd.typing import Array, Index

if TYPE_CHECKING:
    from uqmbd.randomness import GermBox, GermSpace

__all__ = ["AlignedChaos", "AlignedElement"]


MOMENTS = 16_384
"""Samples of the surrogate for mean and standard deviation."""
FROZEN = 4_096
"""Pairs of samples for Sobol' indices."""
BLOCK = 2_048
"""Samples that are evaluated at once."""
REMEDY = "raise the order"


@dataclass(frozen=True, eq=False)
class AlignedElement:
    """Where all realisations have the same sequence of events.

    Attributes
    ----------
    box : GermBox
        Part of the germ space.
    events : tuple of str, length S
        What ends each segment; empty: nothing.
    edges : array, shape (P, S + 1)
        Coefficients of the times at which segments begin and end, s.
    segments : array, shape (P, S, O, N)
        Coefficients of the outputs in Chebyshev polynomials of each segment's normalised time.
    """

    box: GermBox
    events: tuple[str, ...]
    edges: Array
    segments: Array


@dataclass(frozen=True)
class _Sampled:
    """Samples in one element: their places, basis (K, P), and edges (K, S + 1)."""

    element: AlignedElement
    rows: NDArray[np.intp]
    basis: Array
    edges: Array

    def values(self, output: int, times: Array) -> Array:
        """One output at times (T,), shape (K, T)."""
        local = np.einsum("kp,psn->nks", self.basis, self.element.segments[:, :, output])
        count = self.edges.shape[1] - 1
        segment = np.zeros((len(self.rows), len(times)), dtype=np.intp)
        for edge in self.edges[:, 1:-1].T:
            segment += edge[:, None] <= times
        segment = np.minimum(segment, count - 1)
        begin = np.take_along_axis(self.edges, segment, axis=1)
        length = np.take_along_axis(self.edges, segment + 1, axis=1) - begin
        where = np.clip((times - begin) / np.where(length > 0, length, 1.0), 0.0, 1.0)
        return _chebyshev([np.take_along_axis(c, segment, axis=1) for c in local], 2 * where - 1)


@dataclass(frozen=True, eq=False, repr=False)
class AlignedChaos(ChaosInterface):
    """Outputs of a motion with events, as polynomials that follow the events.

    The times of events and the outputs between them, each in its own normalised time, are smooth in the inputs where
    the outputs at a fixed time jump; they are expanded separately, and put together at a sample.  Statistics come from
    samples of this surrogate.

    Parameters
    ----------
    elements : sequence of AlignedElement
        Their boxes fill the germ space; one where the sequence of events is the same everywhere.
    multi_index : array of int, shape (P, d)
        Degrees of the terms.
    labels : Labels
        Outputs, inputs and times.
    verification_germs, verification_response : array, shape (V, d) and (V, O, T), optional
        Realisations that did not enter the coefficients.
    """

    elements: tuple[AlignedElement, ...]
    multi_index: Index
    labels: Labels = field()
    verification_germs: Array | None = None
    verification_response: Array | None = None

    def __post_init__(self) -> None:
        """Check that the elements fill the space."""
        object.__setattr__(self, "elements", tuple(self.elements))
        total = sum(e.box.probability for e in self.elements)
        if abs(total - 1) > 1e-9:
            raise StudyError(f"The boxes must fill the germ space; their probabilities sum to {total:.12g}.")
        if self.labels.times is None:
            raise StudyError("Outputs without times have no events to follow; use PolynomialChaos.")

    def __repr__(self) -> str:
        names = "; ".join(", ".join(x for x in e.events if x) or "no events" for e in self.elements)
        return f"<{type(self).__name__} of {', '.join(self.germ_names)} ({names})>"

    @property
    def space(self) -> GermSpace:
        """The germs, and the map between germs and inputs."""
        return self.elements[0].box.space

    # -- evaluation --------------------------------------------------------------------------------------------------
    def evaluate_germs(self, germs: ArrayLike) -> Array:
        """Evaluate at germ points (K, d): (K, O, T), in the units of the outputs."""
        points = np.asarray(germs, dtype=float)
        found = np.empty((len(points), *self.labels.shape))
        for first in range(0, len(points), BLOCK):
            part = slice(first, first + BLOCK)
            for sampled in self._sampled(points[part]):
                for output in range(len(self.labels.outputs)):
                    found[part][sampled.rows, output] = self._values(sampled, output)
        return found

    def edges(self, inputs: ArrayLike) -> Array:
        """Return event times at inputs (K, d), with begin and end, shape (K, S + 1), s; NaN behind the last one."""
        return self.edges_at_germs(self.space.to_germs(np.asarray(inputs, dtype=float)))

    def edges_at_germs(self, germs: Array) -> Array:
        """Return times of the events at germ points (K, d); see :meth:`edges`."""
        most = max(e.edges.shape[1] for e in self.elements)
        found = np.full((len(germs), most), np.nan)
        for sampled in self._sampled(germs):
            found[sampled.rows, : sampled.edges.shape[1]] = sampled.edges
        return found

    def aligned(self, inputs: ArrayLike, where: ArrayLike) -> Array:
        """Evaluate at inputs (K, d) and normalised times (N,) of all segments: (K, S, O, N); NaN behind the last."""
        germs = self.space.to_germs(np.asarray(inputs, dtype=float))
        most = max(e.segments.shape[1] for e in self.elements)
        at = np.asarray(where, dtype=float)
        found = np.full((len(germs), most, len(self.labels.outputs), len(at)), np.nan)
        for s in self._sampled(germs):
            nodal = np.einsum("kp,pson->kson", s.basis, s.element.segments)
            shape = nodal.shape[:-1]
            for column, x in enumerate(at):
                found[s.rows, : shape[1], :, column] = _chebyshev(list(np.moveaxis(nodal, -1, 0)), np.array(2 * x - 1))
        return found

    def _sampled(self, germs: Array) -> list[_Sampled]:
        from uqmbd.randomness import located

        where = located([e.box for e in self.elements], germs)
        if np.any(where < 0):
            raise StudyError(f"The germ point {germs[int(where.argmin())].tolist()} lies in none of the elements.")
        found = []
        for k, element in enumerate(self.elements):
            rows = np.flatnonzero(where == k)
            if len(rows):
                basis = basis_values(element.box.local, germs[rows], self.multi_index)
                edges = np.maximum.accumulate(basis @ element.edges, axis=1)
                found.append(_Sampled(element, rows, basis, edges))
        return found

    def _values(self, sampled: _Sampled, output: int, times: Array | None = None) -> Array:
        assert self.labels.times is not None
        chosen = self.labels.times if times is None else times
        return sampled.values(output, chosen)

    def _column(self, germs: Array, where: tuple[int, ...]) -> Array:
        output, column = where
        return self._at(germs, output, slice(column, column + 1))[:, 0]

    def _at(self, germs: Array, output: int, times: slice) -> Array:
        """One output at some times, at germ points (K, d): (K, T)."""
        assert self.labels.times is not None
        chosen = self.labels.times[times]
        found = np.empty((len(germs), len(chosen)))
        for first in range(0, len(germs), BLOCK):
            for sampled in self._sampled(germs[first : first + BLOCK]):
                found[first + sampled.rows] = self._values(sampled, output, chosen)
        return found

    # -- statistics --------------------------------------------------------------------------------------------------
    @cached_property
    def _moments(self) -> tuple[Array, Array, Array, Array]:
        """Mean, variance, skewness and kurtosis (O, T)."""
        germs = spread_germs(self.space, MOMENTS, 0)
        shift = self.evaluate_germs(germs[:1])[0]
        sums = np.zeros((4, *self.labels.shape))
        for first in range(0, len(germs), BLOCK):
            x = self.evaluate_germs(germs[first : first + BLOCK]) - shift
            power = x.copy()
            for k in range(4):
                sums[k] += power.sum(axis=0)
                power *= x
        one, two, three, four = sums / len(germs)
        variance = np.maximum(two - one**2, 0.0)
        constant = constant_columns((shift + one).reshape(1, -1), np.sqrt(variance).ravel()).reshape(variance.shape)
        scale = np.where(constant, 1.0, np.sqrt(variance))
        third = (three - 3 * one * two + 2 * one**3) / scale**3
        fourth = (four - 4 * one * three + 6 * one**2 * two - 3 * one**4) / scale**4
        return (
            shift + one,
            np.where(constant, 0.0, variance),
            np.where(constant, 0.0, third),
            np.where(constant, 3.0, fourth),
        )

    @property
    def mean(self) -> Array:
        """Expectation, shape (O, T)."""
        return self._moments[0]

    @property
    def variance(self) -> Array:
        """Variance, shape (O, T)."""
        return self._moments[1]

    @property
    def std(self) -> Array:
        """Standard deviation, shape (O, T)."""
        return np.sqrt(self._moments[1])

    @property
    def skewness(self) -> Array:
        """Third standardised moment, shape (O, T); 0 where an output does not vary."""
        return self._moments[2]

    @property
    def kurtosis(self) -> Array:
        """Fourth standardised moment, shape (O, T); 3 where an output does not vary."""
        return self._moments[3]

    @property
    def shape_samples(self) -> int:
        """Samples of the surrogate from which skewness and kurtosis are."""
        return MOMENTS

    @property
    def sobol_first_germ(self) -> Array:
        """First-order indices, shape (germ, O, T), by Jansen's estimators on the surrogate."""
        return self._sobol[0]

    @property
    def sobol_total_germ(self) -> Array:
        """Total indices, shape (germ, O, T)."""
        return self._sobol[1]

    @cached_property
    def _sobol(self) -> tuple[Array, Array]:
        from scipy.stats import qmc

        d = len(self.germ_names)
        uniform = np.clip(qmc.Sobol(2 * d, seed=0).random(FROZEN), 1e-12, 1 - 1e-12)
        a, b = self.space.from_uniform(uniform[:, :d]), self.space.from_uniform(uniform[:, d:])
        other = self.evaluate_germs(b)
        base = self.evaluate_germs(a)
        variance = 0.5 * (base.var(axis=0) + other.var(axis=0))
        constant = variance <= 1e-24 * (1.0 + self.mean**2)
        scale = np.where(constant, 1.0, variance)
        first, total = np.zeros((2, d, *self.labels.shape))
        for k in range(d):
            mixed = a.copy()
            mixed[:, k] = b[:, k]
            found = self.evaluate_germs(mixed)
            first[k] = 1.0 - np.mean((other - found) ** 2, axis=0) / (2 * scale)
            total[k] = np.mean((base - found) ** 2, axis=0) / (2 * scale)
        zero = np.broadcast_to(constant, first.shape)
        return np.where(zero, 0.0, np.clip(first, 0, 1)), np.where(zero, 0.0, np.clip(total, 0, 1))

    def quantiles(
        self, probabilities: Sequence[float] = DEFAULT_PROBABILITIES, *, samples: int = SAMPLES, seed: int = 0
    ) -> Array:
        """Return quantiles (N, O, T) of samples of the surrogate."""
        germs = spread_germs(self.space, samples, seed)
        outputs, times = self.labels.shape

        def rows(part: slice) -> Array:
            wanted = np.arange(outputs * times)[part]
            parts = []
            for output in np.unique(wanted // times):
                columns = wanted[wanted // times == output] % times
                parts.append(self._at(germs, int(output), slice(int(columns[0]), int(columns[-1]) + 1)).T)
            return np.concatenate(parts)

        found = quantiles_of_rows(rows, len(germs), outputs * times, probabilities)
        return found.reshape(len(found), outputs, times)

    def circular(self, *, samples: int = SAMPLES, seed: int = 0) -> dict[str, Array]:
        """Return `circular_mean` and `circular_std`, (O, T), of the outputs that are angles, from surrogate samples."""
        if not np.any(self.labels.turns):
            return {}
        germs = spread_germs(self.space, samples, seed)

        def values(output: int, part: slice) -> Array:
            return self._at(germs, output, part)

        return circular_of_blocks(self.labels.shape, len(germs), self.labels.turns, values)

    # -- trust -------------------------------------------------------------------------------------------------------
    def verdicts(self, tolerance: float = 0.01) -> tuple[str, ...]:
        """Say for each output, in a sentence, how far the surrogate can be trusted."""
        rows, times = self._stated_error(), self.labels.times
        names = [o.name for o in self.labels.outputs]
        return tuple(
            decaying.verdict_of_error(n, row, times, tolerance, REMEDY) for n, row in zip(names, rows, strict=True)
        )

    def _stated_error(self) -> Array:
        if self.verification_germs is None or self.verification_response is None:
            raise StudyError("This chaos has no verification realisations; give the propagator verify=8.")
        surrogate = self.evaluate_germs(self.verification_germs)
        return stated_error(surrogate, self.verification_response, self.mean[None], self.std)

    # -- storage -----------------------------------------------------------------------------------------------------
    def to_dataset(self) -> xr.Dataset:
        """Build the dataset `aligned` of a propagator's node; see :meth:`from_dataset`."""
        from uqmbd.results.chaos.aligned_storage import aligned_dataset

        return aligned_dataset(self)

    @classmethod
    def from_dataset(cls, dataset: xr.Dataset | xr.DataTree) -> AlignedChaos:
        """Make it from the dataset `aligned` of a result, without the mechanism."""
        from uqmbd.results.chaos.aligned_storage import aligned_arguments

        return cls(**aligned_arguments(dataset))


def _chebyshev(coefficients: list[Array], x: Array) -> Array:
    """Sum of Chebyshev polynomials at x, in -1 to 1, by Clenshaw's recurrence; all shapes are alike."""
    one, two = np.zeros_like(coefficients[0]), np.zeros_like(coefficients[0])
    for c in coefficients[:0:-1]:
        one, two = c + 2 * x * one - two, one
    found: Array = coefficients[0] + x * one - two
    return found
