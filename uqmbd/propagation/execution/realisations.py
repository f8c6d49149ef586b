"""What a problem yields: the responses of some realisations."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from uqmbd.dynamics import MarginValues, ScalarMap, ScalarValues
from uqmbd.propagation.execution.chunks import Chunk
from uqmbd.status import Status
from uqmbd.typing import Array, Index, Mask

__all__ = ["Realisations"]


@dataclass(frozen=True)
class Realisations:
    """Responses of a mechanism to given inputs.

    Attributes
    ----------
    values : array, shape (K, input)
        The inputs.
    response : array, shape (K, output, time)
        NaN where a realisation failed.
    status : array of int, shape (K,)
        0: fine; `uqmbd.results.STATUS_MEANINGS` names the others.
    messages : tuple of str
        Reason of each failure, else empty.
    counters : dict
        Solver counters, summed.
    wall_time : float
        s.
    scalars : ScalarValues, optional
        Outputs without a time: `values` (K, scalar) with a `status` and `messages` of their own, where the mechanism
        has some.
    margins : MarginValues, optional
        Margins of requirements: `running` (K, requirement, T), `values` (K, requirement) of the whole motion, below
        zero where the requirement is violated, and `failed` (K,), where the mechanism has some.

    Examples
    --------
    >>> import chaospy
    >>> import numpy as np
    >>> import uqmbd
    >>> from uqmbd_collocation import Collocation
    >>> speed = uqmbd.RandomVariable("speed", chaospy.Uniform(6, 7), units="rad/s")
    >>> mechanism = uqmbd.Mechanism("wheel", uqmbd.Planar())
    >>> wheel = mechanism.body("wheel", mass=1, inertia=1, angular_velocity=speed)
    >>> mechanism.output("angle", wheel.angle, units="rad")
    >>> study = uqmbd.Study("turning", mechanism, np.linspace(0, 2, 5), [Collocation(order=1)])
    >>> problem = study.problem(study.propagators[0])
    >>> found = problem.realise(np.array([[6.0], [7.0]]))
    >>> found.response[:, 0, -1].round(4).tolist(), found.good.tolist(), found.failures  # after 2 s, rad
    ([12.0, 14.0], [True, True], 0)
    >>> found[:1].values.tolist()
    [[6.0]]
    """

    values: Array
    response: Array
    status: NDArray[np.int64]
    messages: tuple[str, ...]
    counters: dict[str, float]
    wall_time: float
    scalars: ScalarValues | None = None
    margins: MarginValues | None = None

    @classmethod
    def joined(
        cls, values: Array, parts: Sequence[Realisations], shape: tuple[int, ...], wall_time: float
    ) -> Realisations:
        """Join those of several chunks: of all inputs (K, input), with responses of a shape (output, time).

        Parameters
        ----------
        values : array, shape (K, input)
            Inputs of all.
        parts : sequence of Realisations
            In their order.
        shape : tuple of int
            (output, T) of each response.
        wall_time : float
            s.

        Returns
        -------
        Realisations
            K of them.
        """
        counters: Counter[str] = Counter()
        for part in parts:
            counters.update(part.counters)
        scalars = [p.scalars for p in parts if p.scalars is not None]
        margins = [p.margins for p in parts if p.margins is not None]
        return cls(
            values,
            np.concatenate([np.zeros((0, *shape)), *(p.response for p in parts)]),
            np.concatenate([np.zeros(0, dtype=np.int64), *(p.status for p in parts)]),
            tuple(m for p in parts for m in p.messages),
            dict(counters),
            wall_time,
            ScalarValues.joined(scalars) if scalars else None,
            MarginValues.joined(margins) if margins else None,
        )

    def __getitem__(self, rows: slice | Index) -> Realisations:
        """Return some of them, in order; what solvers counted, and the time, are those of all alone."""
        messages = tuple(np.array(self.messages, dtype=object)[rows])
        return Realisations(self.values[rows], self.response[rows], self.status[rows], messages, {}, 0.0)

    @classmethod
    def of(cls, values: Array, chunk: Chunk, wall_time: float) -> Realisations:
        """Return those of a chunk.

        Parameters
        ----------
        values : array, shape (K, input)
            Inputs.
        chunk : Chunk
            What a worker computed.
        wall_time : float
            s.
        """
        about = (chunk.response, chunk.status, chunk.messages, dict(chunk.counters), wall_time)
        return cls(values, *about, chunk.scalars, chunk.margins)

    def choosing(self, seen: ScalarMap, chosen: Sequence[str]) -> Realisations:
        """Return them with some of the outputs without a time; those in which one does not happen are censored.

        Parameters
        ----------
        seen : ScalarMap
            Which outputs without a time the model has.
        chosen : sequence of str
            Names of some of them.
        """
        columns = [k for k, name in enumerate(seen.names) if name in chosen]
        response, status, messages = self.response[:, columns], self.status.copy(), list(self.messages)
        for k in np.flatnonzero((status == Status.OK) & np.isnan(response).any(axis=(1, 2))).tolist():
            late = columns[int(np.argmax(np.isnan(response[k]).any(axis=1)))]
            status[k], messages[k] = Status.CENSORED, seen.late[late]
        return replace(self, response=response, status=status, messages=tuple(messages))

    @property
    def censored(self) -> int:
        """In how many of them an output that is asked for does not happen: they have not failed."""
        return int(np.count_nonzero(self.status == Status.CENSORED))

    @property
    def good(self) -> Mask:
        """Which succeeded, with outputs that are all finite, shape (K,)."""
        return np.asarray((self.status == Status.OK) & np.isfinite(self.response).all(axis=(1, 2)))

    @property
    def failures(self) -> int:
        """How many failed."""
        return int(np.count_nonzero(self.status)) - self.censored

    def most_frequent_reason(self) -> str:
        """Return the reason that most failures share (numbers aside), in its first wording."""
        reasons = [m for m, status in zip(self.messages, self.status, strict=True) if m and status != Status.CENSORED]
        if not reasons:
            return ""
        shapes = ["".join(c for c in m if not c.isdigit()) for m in reasons]
        return reasons[shapes.index(Counter(shapes).most_common(1)[0][0])]
