"""Provide aligned polynomial chaos, which expands marker times, and outputs between markers in normalised time."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from uqmbd.arguments import shown, typechecked
from uqmbd.errors import StudyError
from uqmbd.results.chaos.interface import Surrogate
from uqmbd.results.chaos.sampling import spread_germs
from uqmbd.results.chaos.segments import AlignedElement, Segmented
from uqmbd.results.chaos.surrogate_moments import FEWER, MOMENTS, TOPS, frozen_germs, moment_germs
from uqmbd.results.schema import Labels
from uqmbd.typing import Array, Index

if TYPE_CHECKING:
    from uqmbd.randomness import GermSpace

__all__ = ["AlignedChaos"]


ROUNDING = 1e-12
"""Tolerance, relative to the last time, by which the last marker of a sample may be earlier."""


@typechecked
@dataclass(frozen=True, eq=False, repr=False)
class AlignedChaos(Surrogate):
    """Outputs as polynomials that follow the markers of a motion: its events, or equal phases of a clock.

    At a fixed time, outputs may jump as functions of the inputs, or phases may drift apart. The times of markers, and
    the outputs between them in normalised time, remain smooth. Times and outputs are expanded separately, and combined
    for each sample. Statistics come from samples of this surrogate. The outputs of a sample are NaN after its last
    marker. With phases, the last marker is a phase that nearly all samples of the inputs reach by the last time.

    Parameters
    ----------
    elements : sequence of AlignedElement
        Elements whose boxes fill the germ space; a single one if all realisations have the same sequence of markers.
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
    An output rises until an event at 1 s, or slightly later for high speeds, and then remains at 2:

    >>> import chaospy
    >>> import numpy as np
    >>> import uqmbd
    >>> from uqmbd.results import AlignedChaos
    >>> from uqmbd.extend import AlignedElement
    >>> from uqmbd.extend import labels
    >>> speed = uqmbd.RandomVariable("speed", chaospy.Uniform(1, 3), units="m/s")
    >>> mechanism = uqmbd.Mechanism("stone", uqmbd.Line())
    >>> stone = mechanism.body("stone", mass=1, velocity=speed)
    >>> space = uqmbd.extend.GermSpace.of(mechanism.inputs)
    >>> rising, still = 2 * AlignedElement.points(3), np.full(3, 2.0)
    >>> values = np.zeros((2, 2, 1, 3))
    >>> values[0, :, 0] = rising, still
    >>> edges = np.array([[0.0, 1.0, 2.0], [0.0, 0.1, 0.0]])  # the event is at 1 + 0.1 psi
    >>> whole = uqmbd.extend.GermBox.whole(space)
    >>> element = AlignedElement.through(whole, ("stop", ""), edges, values, "events")
    >>> chaos = AlignedChaos((element,), np.array([[0], [1]]), labels([("x", "m")], [("speed", "m/s")], [0.5, 1.5]))
    >>> chaos.evaluate([[2.0]]).ravel().round(6).tolist()  # at the mean speed
    [1.0, 2.0]
    >>> chaos.edges([[2.0]]).round(6).tolist()
    [[0.0, 1.0, 2.0]]
    """

    elements: tuple[AlignedElement, ...]
    multi_index: Index
    labels: Labels
    verification_germs: Array | None = None
    verification_response: Array | None = None
    verification_weights: Array | None = None
    space: GermSpace = field(init=False)

    _kind = Segmented

    def __repr__(self) -> str:
        names = "; ".join(", ".join(x for x in e.events if x) or f"equal {e.landmarks}" for e in self.elements)
        return f"<{type(self).__name__} of {', '.join(self.germ_names)} ({names})>"

    def edges(self, inputs: ArrayLike) -> Array:
        """Return times of markers at inputs (K, d), with begin and end, (K, S + 1), s; NaN after the last marker.

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
        >>> values = np.zeros((2, 2, 1, 3))
        >>> values[0, :, 0] = 2 * AlignedElement.points(3), np.full(3, 2.0)
        >>> edges = np.array([[0.0, 1.0, 2.0], [0.0, 0.1, 0.0]])  # the event is at 1 + 0.1 psi
        >>> whole = uqmbd.extend.GermBox.whole(space)
        >>> element = AlignedElement.through(whole, ("stop", ""), edges, values, "events")
        >>> chaos = AlignedChaos((element,), np.array([[0], [1]]), labels(["x"], ["a"], [0.5, 1.5]))
        >>> chaos.edges([[0.0], [1.0]]).round(4).tolist()  # psi is the root of 3 at the end
        [[0.0, 1.0, 2.0], [0.0, 1.1732, 2.0]]
        """
        return self.edges_at_germs(self.space.to_germs(np.asarray(inputs, dtype=float)))

    def edges_at_germs(self, germs: Array) -> Array:
        """Return times of the markers at germ points (K, d); see :meth:`edges`.

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
        >>> values = np.zeros((2, 2, 1, 3))
        >>> values[0, :, 0] = 2 * AlignedElement.points(3), np.full(3, 2.0)
        >>> edges = np.array([[0.0, 1.0, 2.0], [0.0, 0.1, 0.0]])  # the event is at 1 + 0.1 psi
        >>> whole = uqmbd.extend.GermBox.whole(space)
        >>> element = AlignedElement.through(whole, ("stop", ""), edges, values, "events")
        >>> chaos = AlignedChaos((element,), np.array([[0], [1]]), labels(["x"], ["a"], [0.5, 1.5]))
        >>> chaos.edges_at_germs(np.array([[0.0]])).round(4).tolist()
        [[0.0, 1.0, 2.0]]
        """
        most = max(e.edges.shape[1] for e in self.elements)
        found = np.full((len(germs), most), np.nan)
        for rows, edges in self._edges(germs):
            found[rows, : edges.shape[1]] = edges
        return found

    def aligned(self, inputs: ArrayLike, where: ArrayLike) -> Array:
        """Evaluate all segments at inputs (K, d) and normalised times (N,): (K, S, O, N); NaN after the last segment.

        Parameters
        ----------
        inputs : array_like, shape (K, d)
            Values of the inputs, in their units.
        where : array_like, shape (N,)
            Normalised times, from 0 (begin of a segment) to 1 (its end).

        Returns
        -------
        array, shape (K, S, O, N)
            Outputs, in their units.

        Raises
        ------
        uqmbd.StudyError
            If `where` has more than one axis.

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
        >>> values = np.zeros((2, 2, 1, 3))
        >>> values[0, :, 0] = 2 * AlignedElement.points(3), np.full(3, 2.0)
        >>> edges = np.array([[0.0, 1.0, 2.0], [0.0, 0.1, 0.0]])  # the event is at 1 + 0.1 psi
        >>> whole = uqmbd.extend.GermBox.whole(space)
        >>> element = AlignedElement.through(whole, ("stop", ""), edges, values, "events")
        >>> chaos = AlignedChaos((element,), np.array([[0], [1]]), labels(["x"], ["a"], [0.5, 1.5]))
        >>> chaos.aligned([[0.0]], [0.5]).ravel().round(4).tolist()  # in the middle of each segment
        [1.0, 2.0]
        """
        germs = self.space.to_germs(np.asarray(inputs, dtype=float))
        most = max(e.segments.shape[1] for e in self.elements)
        at = np.asarray(where, dtype=float)
        if at.ndim != 1:
            raise StudyError(
                f"{type(self).__name__}.aligned: the argument `where` is {shown(at)}; expected normalised "
                "times (N,) from 0 to 1."
            )
        found = np.full((len(germs), most, len(self.labels.outputs), len(at)), np.nan)
        for _, s in self._sampled(germs):
            powers = s.element.segments.shape[-1]
            polynomials = np.polynomial.chebyshev.chebvander(2 * at - 1, powers - 1)
            values = np.einsum("kp,pson,tn->ksot", s.basis, s.element.segments, polynomials, optimize=True)
            found[s.rows, : values.shape[1]] = values
        return found

    @cached_property
    def rough_moments(self) -> tuple[Array, Array]:
        """Return mean and standard deviation (O, T) from few samples, as scales of errors.

        Both are NaN at times without results for some samples of the statistics.
        """
        found = self.evaluate_germs(spread_germs(self.space, TOPS, 0))
        late = float(self.late().max())
        known = self._times <= self._times[-1] - (late if late > ROUNDING * float(np.ptp(self._times)) else 0.0)
        return np.where(known, found.mean(axis=0), np.nan), np.where(known, found.std(axis=0), np.nan)

    def late(self) -> Array:
        """Return the intervals (S,), in s, from the last markers of samples to the last time; 0 if there is no gap.

        The method examines the samples from which it computes statistics, and the verification points. Mean, quantiles,
        Sobol' indices and the stated error are NaN at times that one of these samples does not reach.

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
        >>> values = np.zeros((2, 2, 1, 3))
        >>> values[0, :, 0] = 2 * AlignedElement.points(3), np.full(3, 2.0)
        >>> edges = np.array([[0.0, 1.0, 2.0], [0.0, 0.1, 0.0]])  # the event is at 1 + 0.1 psi
        >>> whole = uqmbd.extend.GermBox.whole(space)
        >>> element = AlignedElement.through(whole, ("stop", ""), edges, values, "events")
        >>> chaos = AlignedChaos((element,), np.array([[0], [1]]), labels(["x"], ["a"], [0.5, 1.5]))
        >>> float(chaos.late().max())  # the last marker is at 2 s, after the last time
        0.0
        """
        a, b = frozen_germs(self.space)
        mixed = [np.where(np.arange(a.shape[1]) == k, b, a) for k in range(a.shape[1])]
        verified = a[:0] if self.verification_germs is None else self.verification_germs
        germs = np.concatenate(
            [*moment_germs(self.space, MOMENTS), spread_germs(self.space, FEWER, 0), a, b, *mixed, verified]
        )
        last = [edges[:, -1] for _, edges in self._edges(germs)]
        return np.maximum(float(self._times[-1]) - np.concatenate(last), 0.0)

    def reached(self) -> AlignedChaos:
        """Return the surrogate at the times that all samples reach (see :meth:`late`); itself if these are all times.

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
        >>> values = np.full((1, 1, 1, 3), 2.0)
        >>> whole = uqmbd.extend.GermBox.whole(space)
        >>> element = AlignedElement.through(whole, ("",), np.array([[0.0, 1.0]]), values, "time")
        >>> chaos = AlignedChaos((element,), np.array([[0]]), labels(["x"], ["a"], [0.0, 0.5, 1.5]))
        >>> chaos.reached().labels.times.tolist()  # the last marker is at 1 s
        [0.0, 0.5]
        """
        late = float(self.late().max())
        if late <= ROUNDING * float(np.ptp(self._times)):
            return self
        # all samples begin at the first time
        count = max(int(np.count_nonzero(self._times <= self._times[-1] - late)), 1)
        return self.selected(times=range(count))

    @cached_property
    def _unseen(self) -> Array:
        """Root mean square errors (O, T) in thin layers of the germ space, at events and at faces of elements."""
        layers = sum(
            element.box.probability * element._layer_mean_squares(element.box.local, self.multi_index, self._times)
            for element in self.elements
        )
        return np.asarray(np.sqrt(self._missed_at_faces() ** 2 + layers))

    @property
    def _times(self) -> Array:
        return np.asarray(self.labels.times)

    def _edges(self, germs: Array) -> list[tuple[Index, Array]]:
        """Return indices of samples, and the times (K, S + 1) of their markers in s, for each element."""
        return [(one.rows, one.element.table.edges_at(one.basis)) for _, one in self._sampled(germs)]

    def _why_unknown(self) -> dict[str, str]:
        why = "some samples of the surrogate do not reach this time within the integrated events or phases"
        return {output.name: why for output in self.labels.outputs}
