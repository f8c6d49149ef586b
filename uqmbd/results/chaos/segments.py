"""Provide elements, samples and storage of outputs in segments between markers."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Annotated, Any, Literal, Self, get_args

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from uqmbd.arguments import Bounds, OrInfinite, OrNaN, shown, typechecked
from uqmbd.compiled import SegmentTable
from uqmbd.errors import StudyError
from uqmbd.results.chaos.readouts import GermElement, OverTime, SampledPiece
from uqmbd.results.chaos.sampling import basis_values, spread_germs
from uqmbd.results.schema import check_shape, fixed_width
from uqmbd.typing import Array, Index, Mask

if TYPE_CHECKING:
    from uqmbd.randomness import GermBox, GermSpace

__all__ = ["AlignedElement", "Markers", "SampledSegments", "Segmented"]


SLACK = 1e-12
"""Tolerance, relative to the times, by which a time may be after the last edge."""

NOISE = 1e-10
"""Coefficient in time, relative to the largest coefficient of its output, below which it counts as rounding."""

SMOOTH = 1e-6
"""Jump at an event, relative to the size of the output, below which it counts as integration error."""

AT_ONCE = 64
"""Number of samples that are differentiated at once."""

DENSITY_SAMPLES, NARROW = 4096, 0.0625
"""Number of samples for the density of event times, and its bandwidth relative to their standard deviation."""

MOST_POINTS = 10_000
"""Maximum number of points of a segment."""

Markers = Literal["events", "phase", "time"]
"""Points of comparison of the motions of an element: their events, equal phases of a clock, or equal times."""


@typechecked
@dataclass(frozen=True, eq=False)
class AlignedElement(GermElement):
    """Part of the germ space in which all realisations have the same sequence of markers.

    Attributes
    ----------
    box : GermBox
        Part of the germ space.
    events : tuple of str, length S
        Event that ends each segment; empty if no event ends the segment.
    edges : array, shape (P, S + 1)
        Coefficients of the times at which segments begin and end, s.
    segments : array, shape (P, S, O, N)
        Coefficients of the outputs in Chebyshev polynomials of the normalised time of each segment.
    landmarks : {"events", "phase", "time"}
        Markers that end segments: events, equal phases of a clock, or equal times.
    event_errors : tuple of float, length S
        Mean absolute error of the time of the event that ends each segment, s; NaN if unknown.

    Examples
    --------
    >>> import chaospy
    >>> import numpy as np
    >>> import uqmbd
    >>> from uqmbd.extend import AlignedElement
    >>> speed = uqmbd.RandomVariable("speed", chaospy.Uniform(1, 3), units="m/s")
    >>> mechanism = uqmbd.Mechanism("stone", uqmbd.Line())
    >>> stone = mechanism.body("stone", mass=1, velocity=speed)
    >>> space = uqmbd.extend.GermSpace.of(mechanism.inputs)
    >>> points = AlignedElement.points(3)
    >>> points.tolist()
    [0.0, 0.49999999999999994, 1.0]
    >>> values = (1 + points)[None, None, None, :]  # of one term, segment and output: 1 + s
    >>> whole = uqmbd.extend.GermBox.whole(space)
    >>> element = AlignedElement.through(whole, ("",), np.array([[0.0, 2.0]]), values, "time")
    >>> element.segments.round(6).ravel().tolist()  # 1.5 + 0.5 T1(2 s - 1)
    [1.5, 0.5]
    """

    events: tuple[str, ...]
    edges: Array
    segments: Array
    landmarks: Markers = "events"
    event_errors: tuple[OrNaN | OrInfinite, ...] = ()

    def _layer_mean_squares(self, space: GermSpace, terms: Index, times: Array) -> Array:
        """Return the mean square error (O, T) in layers of the germ space between predicted and true events.

        `space`: germ space of the element; `terms` (P, d): degrees of the terms; `times` (T,): times, s. In such a
        layer, the output has jumped in either the surrogate or the mechanism, but not in both. A layer is thinner than
        the distance of verification realisations, which therefore miss it. Its probability is the probability of an
        event within the mean error of its time. The result is NaN if an output jumps and the error of the event time
        is unknown.
        """
        found = np.zeros((self.segments.shape[2], len(times)))
        # realisations with a late event may be missing, so the largest known error replaces unknown errors
        largest = max((error for error in self.event_errors if not np.isnan(error)), default=np.nan)
        errors = [largest if np.isnan(error) else error for error in self.event_errors]
        jumping = [s for s, error in enumerate(errors[:-1]) if self.events[s] and error != 0]
        if not jumping:
            return found
        germs = spread_germs(space, DENSITY_SAMPLES, 0)
        basis, growth = basis_values(space, germs, terms), _growth(space, germs, terms)
        edges = self.table.edges_at(basis)
        signs = (-1.0) ** np.arange(self.segments.shape[-1])
        for s in jumping:
            at, error = edges[:, s + 1], errors[s]
            before, after = self.segments[:, s].sum(axis=-1), self.segments[:, s + 1] @ signs
            squares = growth[:, None] * (basis @ (after - before)) ** 2  # (M, O)
            # sort the event times (M,), to sum over the events within a bandwidth of each time
            order = np.argsort(at)
            at, squares = at[order], squares[order]
            summed = np.concatenate([np.zeros((1, squares.shape[1])), np.cumsum(squares, axis=0)])
            width = max(0.0 if np.isnan(error) else error / 2, NARROW * float(at.std()))
            if np.isnan(error):
                size = ((basis @ before) ** 2 + (basis @ after) ** 2).mean(axis=0)
                near = (at[0] - width <= times) & (times <= at[-1] + width)
                found[np.ix_(squares.mean(axis=0) > SMOOTH**2 * size, near)] = np.nan
                continue
            low, high = (np.searchsorted(at, times + side * width) for side in (-1, 1))
            found += error * ((summed[high] - summed[low]) / (2 * width * len(at))).T
        return found

    @typechecked
    def verified(self, space: GermSpace, terms: Index, germs: Array, weights: Array, ends: Array) -> Self:
        """Return the element with errors of its event times, from realisations that were not used to fit it.

        Parameters
        ----------
        space : GermSpace
            Conditional distribution in the box of the element.
        terms : array of int, shape (P, d)
            Degrees of the terms.
        germs, weights : array, shape (V, d) and (V,)
            Verification points, and their weights.
        ends : array, shape (V, S)
            Times at which the segments end, s; NaN if unknown.

        Returns
        -------
        AlignedElement
            Element with `event_errors`.

        Raises
        ------
        uqmbd.StudyError
            If the shapes do not match.

        Examples
        --------
        >>> import chaospy
        >>> import numpy as np
        >>> import uqmbd
        >>> from uqmbd.extend import AlignedElement
        >>> speed = uqmbd.RandomVariable("speed", chaospy.Uniform(1, 3), units="m/s")
        >>> mechanism = uqmbd.Mechanism("stone", uqmbd.Line())
        >>> stone = mechanism.body("stone", mass=1, velocity=speed)
        >>> space = uqmbd.extend.GermSpace.of(mechanism.inputs)
        >>> whole, terms = uqmbd.extend.GermBox.whole(space), np.array([[0]])
        >>> values = np.zeros((1, 2, 1, 3))
        >>> element = AlignedElement.through(whole, ("stop", ""), np.array([[0.0, 1.0, 2.0]]), values, "events")
        >>> ends = np.array([[1.1, 2.0], [0.9, 2.0]])
        >>> found = element.verified(space, terms, np.array([[-0.5], [0.5]]), np.ones(2), ends)
        >>> np.round(found.event_errors, 2).tolist()  # a polynomial of order 1 is half as large there as on average
        [0.1, nan]
        """
        check_shape("terms", terms, (len(self.edges), space.dimension), ("P", "d"))
        check_shape("germs", germs, (len(weights), space.dimension), ("V", "d"))
        check_shape("weights", weights, (len(weights),), ("V",))
        check_shape("ends", ends, (len(weights), len(self.events)), ("V", "S"))
        wrong = np.abs(self.table.edges_at(basis_values(space, germs, terms))[:, 1:] - ends)
        known = np.isfinite(wrong) & np.array([bool(event) for event in self.events])
        counted = np.where(known, weights[:, None], 0.0)
        # divide errors by the size of the polynomials of the next degree at these points, relative to its average
        size = _growth(space, germs, terms) @ counted
        total = (np.where(known, wrong, 0.0) * counted).sum(axis=0)
        errors = np.divide(total, size, out=np.full(size.shape, np.nan), where=size > 0)
        return replace(self, event_errors=tuple(errors.tolist()))

    @staticmethod
    def points(count: Annotated[int, Bounds(2, MOST_POINTS)]) -> Array:
        """Return Chebyshev points of the second kind in the normalised time of a segment, 0 to 1, shape (count,)."""
        found: Array = (1 - np.cos(np.pi * np.arange(count) / (count - 1))) / 2
        return found

    @classmethod
    def through(
        cls, box: GermBox, events: tuple[str, ...], edges: Array, values: Array, landmarks: Markers
    ) -> AlignedElement:
        """Create an element from coefficients (P, S, O, N) of the outputs at the `points` of each segment.

        The element omits powers of the normalised time whose coefficients are below rounding.

        Parameters
        ----------
        box : GermBox
            Part of the germ space.
        events : tuple of str, length S
            Event that ends each segment; empty if none does.
        edges : array, shape (P, S + 1)
            Coefficients of the times at which segments begin and end, s.
        values : array, shape (P, S, O, N)
            Coefficients of the outputs at the points.
        landmarks : {"events", "phase", "time"}
            Markers that end segments.

        Returns
        -------
        AlignedElement
            Element with as many Chebyshev coefficients as points.

        Raises
        ------
        uqmbd.StudyError
            If the values have other axes, or fewer than two points.
        """
        if values.ndim != 4 or not 2 <= values.shape[-1] <= MOST_POINTS:
            raise StudyError(
                f"AlignedElement.through: values is {shown(values)}; expected four axes (term, segment, output, "
                "point) with at least two points."
            )
        count = values.shape[-1]
        vander = np.polynomial.chebyshev.chebvander(2 * cls.points(count) - 1, count - 1)
        found = values @ np.linalg.inv(vander).T
        size = np.abs(found).max(axis=(0, 1, 3), keepdims=True)
        large = np.flatnonzero((np.abs(found) > NOISE * size).any(axis=(0, 1, 2)))
        return cls(box, events, edges, found[..., : int(large[-1]) + 1 if len(large) else 1], landmarks)

    def _without(self, terms: Mask) -> Self:
        """Return the element without masked terms (P,); keep the last marker, after which outputs are unknown."""
        edges = np.append(self.edges[:, :-1] * ~terms[:, None], self.edges[:, -1:], axis=1)
        return replace(super()._without(terms), edges=edges)

    @cached_property
    def table(self) -> SegmentTable:
        """Table of the coefficients for evaluation."""
        return SegmentTable.of(self.edges, self.segments)


@dataclass(frozen=True, eq=False)
class SampledSegments(SampledPiece):
    """Samples in one element."""

    element: AlignedElement

    def evaluate(self, outputs: slice, times: Array, found: Array) -> None:
        """Evaluate some outputs at increasing times (T,), into rows of (N, C, T); NaN after the last edge."""
        self.element.table.evaluate(self.basis, times, outputs, found, self.rows)

    def evaluate_change(self, change: Array, times: Array, found: Array) -> None:
        """Evaluate the change due to a basis change (K, P), into rows of (N, O, T); NaN after the last edge."""
        for start in range(0, len(self.rows), AT_ONCE):
            part = slice(start, start + AT_ONCE)
            SampledSegments(self.element, self.rows[part], self.basis[part])._change(change[part], times, found)

    def _change(self, change: Array, times: Array, found: Array) -> None:
        """Evaluate the change of one block of samples.

        Changes of edges shift the normalised time. An edge belongs to the segment that begins there.
        """
        edges, moving = self._moving_edges(change)
        segments, powers = self.element.segments, self.element.segments.shape[-1]
        at = np.stack([np.searchsorted(row[1:-1], times, side="right") for row in edges])  # (K, T)
        sample = np.arange(len(edges))[:, None]
        begin, end = edges[sample, at], edges[sample, at + 1]
        length = end - begin
        there = length > 0
        share = np.divide(times - begin, length, out=np.zeros_like(length), where=there)
        # values are constant before the start and after the end of a segment
        free = there & (share > 0) & (share < 1)
        shift = -(moving[sample, at] * (1 - share) + moving[sample, at + 1] * share)
        shift = np.divide(shift, length, out=np.zeros_like(length), where=free)
        x = np.clip(2 * share - 1, -1, 1)
        chebyshev = np.polynomial.chebyshev.chebvander(x, powers - 1)  # (K, T, N)
        slopes = _chebyshev_slopes(x, powers) * (2 * shift)[..., None]
        own, changed = (np.tensordot(b, segments, 1) for b in (self.basis, change))  # (K, S, O, N)
        for row, k in zip(self.rows, range(len(edges)), strict=True):
            values = np.einsum("ton,tn->ot", changed[k, at[k]], chebyshev[k])
            values += np.einsum("ton,tn->ot", own[k, at[k]], slopes[k])
            found[row] = np.where(times <= edges[k, -1] + SLACK * np.abs(times).max(), values, np.nan)

    def _moving_edges(self, change: Array) -> tuple[Array, Array]:
        """Return the edges (K, S + 1), made non-decreasing, and their changes."""
        edges, moving = self.basis @ self.element.edges, change @ self.element.edges
        for s in range(1, edges.shape[1]):
            late = edges[:, s] < edges[:, s - 1]
            edges[late, s], moving[late, s] = edges[late, s - 1], moving[late, s - 1]
        return edges, moving


def _growth(space: GermSpace, germs: Array, terms: Index) -> Array:
    """Return the size (K,), with mean 1, of the polynomials of the next degree above `terms` (P, d).

    The error of an expansion in these terms is about proportional to this size.
    """
    degree = int(terms.max(initial=0)) + 1
    free = [k for k, germ in enumerate(space.germs) if germ.values is None or degree < germ.values]
    if not free:
        return np.ones(len(germs))
    following = degree * np.eye(space.dimension, dtype=np.int64)[free]
    both = np.concatenate([spread_germs(space, DENSITY_SAMPLES, 0), germs])
    found = np.sqrt((basis_values(space, both, following) ** 2).sum(axis=1))
    return np.asarray(found[-len(germs) :] / found[: -len(germs)].mean())


def _chebyshev_slopes(x: Array, powers: int) -> Array:
    """Return the derivatives (..., N) of the first N Chebyshev polynomials."""
    found = np.zeros((*x.shape, powers))
    if powers > 1:
        # T_n' = n U_{n-1}
        second = np.zeros_like(found)
        second[..., 0] = 1.0
        for n in range(1, powers):
            second[..., n] = 2 * x * second[..., n - 1] - (second[..., n - 2] if n > 1 else 0.0)
        found[..., 1:] = np.arange(1, powers) * second[..., :-1]
    return found


class Segmented(OverTime):
    """Readout of outputs as polynomials of the normalised time between markers, with polynomial marker times."""

    name = "aligned"
    needed = ("edge_coefficients", "segment_coefficients")
    of_times = "events to follow"

    def at(self, element: AlignedElement, rows: NDArray[np.intp], basis: Array) -> SampledSegments:
        """Prepare samples."""
        return SampledSegments(element, rows, basis)

    def variables(self, elements: Sequence[AlignedElement]) -> dict[str, Any]:
        """Return elements as variables, padded to the largest number of segments and powers."""
        terms, outputs = elements[0].segments.shape[0], elements[0].segments.shape[2]
        most, powers = (max(e.segments.shape[k] for e in elements) for k in (1, 3))
        edges = np.full((len(elements), terms, most + 1), np.nan)
        segments = np.zeros((len(elements), terms, most, outputs, powers))
        errors = np.full((len(elements), most), np.nan)
        events = [["" for _ in range(most)] for _ in elements]
        for k, e in enumerate(elements):
            count = e.segments.shape[1]
            edges[k, :, : count + 1], segments[k, :, :count, :, : e.segments.shape[3]] = e.edges, e.segments
            events[k][:count] = e.events
            errors[k, : len(e.event_errors)] = e.event_errors
        stated = {}
        if any(e.event_errors for e in elements):
            about = {"long_name": "mean absolute error of event times", "units": "s"}
            stated["event_error"] = (("element", "segment"), errors, about)
        return stated | {
            "edge_coefficients": (
                ("element", "term", "edge"),
                edges,
                {"long_name": "coefficients of the times at which segments begin and end", "units": "s"},
            ),
            "segment_coefficients": (
                ("element", "term", "segment", "output", "power"),
                segments,
                {"long_name": "coefficients of the outputs at Chebyshev polynomials of each segment's normalised time"},
            ),
            "event": (("element", "segment"), fixed_width(np.array(events).ravel()).reshape(len(elements), most)),
            "landmarks": (
                "element",
                np.array([e.landmarks for e in elements], dtype=np.str_),
                {"long_name": "what ends segments"},
            ),
            "segments": (
                "element",
                np.array([e.segments.shape[1] for e in elements]),
                {"long_name": "number of segments"},
            ),
        }

    @classmethod
    def read(cls, data: xr.Dataset, boxes: Sequence[GermBox]) -> tuple[Self, tuple[AlignedElement, ...]]:
        """Return the elements of a dataset."""
        segments = data["segment_coefficients"].transpose("element", "term", "segment", "output", "power").values
        kinds = [str(x) for x in data["landmarks"].values] if "landmarks" in data else ["events"] * len(boxes)
        if unknown := set(kinds) - set(get_args(Markers)):
            raise StudyError(
                f"The landmarks of an aligned chaos are {min(unknown)!r}; expected {', '.join(get_args(Markers))}."
            )
        found: list[Any] = [
            (
                box,
                tuple(str(x) for x in data["event"].values[k, :count]),
                data["edge_coefficients"].values[k, :, : count + 1],
                segments[k, :, :count],
                kinds[k],
                tuple(data["event_error"].values[k, :count].tolist()) if "event_error" in data else (),
            )
            for k, (box, count) in enumerate(zip(boxes, data["segments"].values.tolist(), strict=True))
        ]
        return cls(), tuple(AlignedElement(*one) for one in found)
