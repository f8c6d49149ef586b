"""Results of an integration, and its operation counts."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

import numpy as np

from uqmbd.arguments import Positive, Size, typechecked
from uqmbd.compiled import RecordedSteps
from uqmbd.typing import Array

__all__ = ["Counters", "Segment", "SegmentedMotion", "Solved", "Trajectories", "stops"]


@typechecked
@dataclass(frozen=True)
class Counters:
    """Counts of the operations of an integration.

    Attributes
    ----------
    residuals, jacobians : int
        Evaluations by IDA, each for a whole stack, including evaluations for comparisons of costs.
    integrations : int
        Starts of IDA, plus realisations started by the compiled integrators.
    alone : int
        Realisations that IDA integrated again without their stack, because their motions are much rougher than those of
        the stack.
    accelerations : int
        Evaluations of the equations of motion by the compiled integrators ``dop853`` and ``radau``, each for up to
        eight realisations. A matrix of an implicit step counts as four.
    steps : int
        Accepted steps of the compiled integrators, of all realisations together.
    stiff : int
        Realisations that the explicit integrator left to an implicit one because of stiffness or lower costs.
    passages : int
        Passages over singular poses.
    repivots : int
        Number of times that other independent equations were chosen.
    events : int
        Impacts and other events.
    two_motions : int
        Realisations in which, at an event, several motions satisfy the laws of contact and friction.
    by_dop853, by_ida, by_radau : int
        Realisations with a motion from the explicit integrator, from IDA, and from the compiled implicit integrator.
    seconds : float
        Wall time, s.

    Examples
    --------
    >>> import uqmbd
    >>> first = uqmbd.extend.Counters(steps=40, accelerations=300, by_dop853=8)
    >>> second = uqmbd.extend.Counters(steps=60, by_dop853=4, seconds=0.1)
    >>> (first + second).steps, (first + second).by_dop853
    (100, 12)
    """

    residuals: Size = 0
    jacobians: Size = 0
    integrations: Size = 0
    alone: Size = 0
    accelerations: Size = 0
    steps: Size = 0
    stiff: Size = 0
    passages: Size = 0
    repivots: Size = 0
    events: Size = 0
    two_motions: Size = 0
    by_dop853: Size = 0
    by_ida: Size = 0
    by_radau: Size = 0
    seconds: float = 0.0

    def __add__(self, other: Counters) -> Counters:
        return Counters(*(mine + its for mine, its in zip(vars(self).values(), vars(other).values(), strict=True)))


@typechecked
@dataclass(frozen=True)
class Trajectories:
    """States of K realisations at the output times.

    Attributes
    ----------
    times : array, shape (T,)
        Output times, s.
    states : array, shape (K, T, 2 coordinate + state)
        Coordinates, auxiliary states and velocities. NaN from the time at which a realisation failed; all NaN if it
        could not be assembled.
    messages : tuple of str
        Reason of failure of each realisation; otherwise empty.
    counters : Counters
        Operations of the integration.
    scalars : mapping of str to array, shape (K,)
        Scalar results of the motion by name, such as event times; NaN for realisations without a value.
    notes : tuple of str
        Events of the integration that a user should know: choices of other independent equations, and contacts with
        several possible motions.
    off : array, shape (K, residual + 1), optional
        Largest residuals of the constraints after the first time, first in position, then in velocity, and largest
        speeds, if the integrator has computed them; otherwise NaN.
    path : Path, optional
        Motion between the output times, if requested.
    rtol : float
        Relative tolerance of the integration, if the path was requested.

    Examples
    --------
    Return value of an integrator for two realisations; one stands still, and the other realisation fails:

    >>> import numpy as np
    >>> import uqmbd
    >>> states = np.zeros((2, 3, 2))
    >>> states[1, 1:] = np.nan
    >>> found = uqmbd.extend.Trajectories(np.array([0.0, 0.5, 1.0]), states, ("", "the step was too small"))
    >>> [not message for message in found.messages], found.counters.steps
    ([True, False], 0)
    """

    times: Array
    states: Array
    messages: tuple[str, ...]
    counters: Counters = field(default_factory=Counters)
    scalars: Mapping[str, Array] = field(default_factory=dict)
    notes: tuple[str, ...] = ()
    off: Array | None = None
    path: RecordedSteps | None = field(default=None, repr=False)
    rtol: Positive = 1e-6


@dataclass(frozen=True)
class Solved:
    """Realisations integrated by one integrator."""

    states: Array  # (M, T, 2 coordinate + state), as in `Trajectories`
    messages: tuple[str, ...]  # reason of failure of each realisation, or empty
    counters: Counters  # operations of the integration
    # for each: whether the mechanism itself cannot continue, so that all other integrators would fail; empty: unknown
    final: tuple[bool, ...] = ()
    notes: tuple[str, ...] = ()  # events that a user should know, as in `Trajectories`
    # for each: estimated cost by this integrator, in operations, if another one costs less, else zero; empty: none
    explicit_cost: tuple[float, ...] = ()
    off: Array | None = None  # (M, residual + 1), as in `Trajectories`
    path: RecordedSteps | None = None  # as in `Trajectories`


@typechecked
@dataclass(frozen=True)
class Segment:
    """Motion from one event to the next.

    Attributes
    ----------
    begin, end : float
        Initial and final time, s.
    label : str
        Event that ends the segment, such as ``floor: impact``, or ``break`` for a force that switches. Empty if the
        output times end it.
    states : callable
        Function from times (T,) within the segment to states (T, 2 coordinate + state). At the ends, the function
        returns the states right after and right before the events.

    Examples
    --------
    >>> import numpy as np
    >>> import uqmbd
    >>> def fall(times):  # height and speed of a fall from 1 m, with a gravity of 2 m/s^2
    ...     return np.stack([1 - times**2, -2 * times], axis=1)
    >>> segment = uqmbd.extend.Segment(0.0, 1.0, "floor: impact", fall)
    >>> segment.states(np.array([segment.end])).tolist()
    [[0.0, -2.0]]
    """

    begin: float
    end: float
    label: str
    states: Callable[[Array], Array]


@typechecked
@dataclass(frozen=True)
class SegmentedMotion:
    """Motion of one realisation from event to event.

    Attributes
    ----------
    segments : tuple of Segment
        Consecutive segments.
    message : str
        Reason of an early end; otherwise empty.

    Examples
    --------
    >>> import numpy as np
    >>> import uqmbd
    >>> def fall(times):
    ...     return np.stack([1 - times**2, -2 * times], axis=1)
    >>> def rise(times):
    ...     return np.stack([2 * (times - 1) - (times - 1) ** 2, 2 - 2 * (times - 1)], axis=1)
    >>> first, second = uqmbd.extend.Segment(0.0, 1.0, "floor: impact", fall), uqmbd.extend.Segment(1.0, 2.0, "", rise)
    >>> motion = uqmbd.extend.SegmentedMotion((first, second))
    >>> [segment.label for segment in motion.segments], motion.message
    (['floor: impact', ''], '')
    """

    segments: tuple[Segment, ...]
    message: str = ""


def stops(breaks: Array, times: Array) -> Array:
    """Return break times strictly inside the output times; times that differ only by rounding are merged."""
    near = 1e-12 * max(1.0, float(np.abs(times).max()))
    found = np.sort(breaks[np.isfinite(breaks)].ravel())
    if not len(found):
        return found
    right = np.clip(np.searchsorted(times, found), 1, len(times) - 1)
    nearest = np.where(found - times[right - 1] < times[right] - found, times[right - 1], times[right])
    found = np.unique(np.where(np.abs(found - nearest) <= near, nearest, found))
    found = found[(found > times[0]) & (found < times[-1])]
    kept: Array = found[np.diff(found, prepend=-np.inf) > near]
    return kept
