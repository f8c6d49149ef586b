"""Event-aligned polynomial chaos: event times, and the motion between them in normalised time, expanded separately."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike

from uqmbd.errors import StudyError
from uqmbd.results.chaos.aligned_element import AlignedElement, SampledElement, chebyshev
from uqmbd.results.chaos.boxes import check_filled, rows_of_boxes
from uqmbd.results.chaos.interface import Samples, Surrogate
from uqmbd.results.chaos.moments import constant_columns
from uqmbd.results.chaos.sampling import basis_values, spread_germs
from uqmbd.results.chaos.storage import aligned_arguments, aligned_dataset
from uqmbd.results.schema import Labels
from uqmbd.typing import Array, Index

if TYPE_CHECKING:
    from uqmbd.randomness import GermSpace

__all__ = ["AlignedChaos"]


MOMENTS = 16_384
"""Samples of the surrogate for mean and standard deviation."""
FROZEN = 4_096
"""Pairs of samples for Sobol' indices."""
BLOCK = 2_048
"""Samples that are evaluated at once."""


@dataclass(frozen=True, eq=False, repr=False)
class AlignedChaos(Surrogate):
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
    labels: Labels
    verification_germs: Array | None = None
    verification_response: Array | None = None
    space: GermSpace = field(init=False)

    def __post_init__(self) -> None:
        """Check that the elements fill the space."""
        object.__setattr__(self, "elements", tuple(self.elements))
        check_filled([e.box for e in self.elements])
        object.__setattr__(self, "space", self.elements[0].box.space)
        if self.labels.times is None:
            raise StudyError("Outputs without times have no events to follow; use PolynomialChaos.")

    def __repr__(self) -> str:
        names = "; ".join(", ".join(x for x in e.events if x) or "no events" for e in self.elements)
        return f"<{type(self).__name__} of {', '.join(self.germ_names)} ({names})>"

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
                found[s.rows, : shape[1], :, column] = chebyshev(list(np.moveaxis(nodal, -1, 0)), np.array(2 * x - 1))
        return found

    @property
    def mean(self) -> Array:
        """Expectation, shape (O, T), in the units of the outputs."""
        return self._moments[0]

    @property
    def variance(self) -> Array:
        """Variance, shape (O, T)."""
        return self._moments[1]

    @property
    def std(self) -> Array:
        """Standard deviation, shape (O, T), in the units of the outputs."""
        return np.sqrt(self._moments[1])

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

    def to_dataset(self) -> xr.Dataset:
        """Build the dataset `aligned` of a propagator's node; see :meth:`from_dataset`."""
        return aligned_dataset(self, self.elements)

    @classmethod
    def from_dataset(cls, dataset: xr.Dataset | xr.DataTree) -> AlignedChaos:
        """Make it from the dataset `aligned` of a result, without the mechanism."""
        return cls(**aligned_arguments(dataset))

    def _evaluate(self, germs: Array) -> Array:
        found = np.empty((len(germs), *self.labels.shape))
        for first in range(0, len(germs), BLOCK):
            part = slice(first, first + BLOCK)
            found[part] = self._sampler(germs[part]).columns(slice(None)).reshape(-1, *self.labels.shape)
        return found

    def _sampler(self, germs: Array) -> Samples:
        blocks = [(k, s) for k in range(0, len(germs), BLOCK) for s in self._sampled(germs[k : k + BLOCK])]
        outputs, times = np.divmod(np.arange(np.prod(self.labels.shape)), self.labels.shape[1])

        def rows(part: slice) -> Array:
            found = np.empty((len(outputs[part]), len(germs)))
            for output in np.unique(outputs[part]).tolist():
                columns = np.flatnonzero(outputs[part] == output)
                wanted = np.asarray(self.labels.times)[times[part][columns]]
                for first, sampled in blocks:
                    found[np.ix_(columns, first + sampled.rows)] = sampled.values(output, wanted).T
            return found

        return Samples(lambda part: np.ascontiguousarray(rows(part).T), rows)

    def _sampled(self, germs: Array) -> list[SampledElement]:
        found = []
        for element, rows in zip(self.elements, rows_of_boxes([e.box for e in self.elements], germs), strict=True):
            if len(rows):
                basis = basis_values(element.box.local, germs[rows], self.multi_index)
                edges = np.maximum.accumulate(basis @ element.edges, axis=1)
                found.append(SampledElement(element, rows, basis, edges))
        return found

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
        constant = constant_columns(shift + one, np.sqrt(variance))
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
    def _shape_moments(self) -> tuple[Array, Array]:
        return self._moments[2:]

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
