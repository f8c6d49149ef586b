"""What a problem yields of requirements: margins of some realisations."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from uqmbd.propagation.execution.realisations import Realisations
from uqmbd.typing import Array, Mask

__all__ = ["Margins"]


@dataclass(frozen=True)
class Margins:
    """How far realisations are from the limits that they have to stay within.

    Attributes
    ----------
    values : array, shape (K, requirement)
        Of the whole motion, in the units of the relations: below zero, the requirement is violated.  NaN where a
        realisation failed.
    running : array, shape (K, requirement, T)
        The smallest margin until each output time, located between the times, too.  Margins that are known at the end
        only, as of an integral, are +inf before the last time.
    failed : array of bool, shape (K,)
        Which realisations have no margins: they are neither safe nor unsafe.
    messages : tuple of str
        Reasons of failures, else empty.
    counters : dict
        Solver counters, summed.
    wall_time : float
        s.

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
    >>> mechanism.require("slow", wheel.angle < 13, "it does not turn by more than 13 rad")
    >>> study = uqmbd.Study("turning", mechanism, np.linspace(0, 2, 5), [Collocation(order=1)])
    >>> problem = study.problem(study.propagators[0])
    >>> margins = problem.margins(np.array([[6.0], [7.0]]))
    >>> margins.values.round(4).tolist(), margins.failed.tolist()  # rad
    ([[1.0], [-1.0]], [False, False])
    """

    values: Array
    running: Array
    failed: Mask
    messages: tuple[str, ...]
    counters: dict[str, float]
    wall_time: float

    @classmethod
    def of(cls, found: Realisations, shape: tuple[int, ...]) -> Margins:
        """Return those of some realisations, the shape of each being (requirement, T).

        Parameters
        ----------
        found : Realisations
            With margins.
        shape : tuple of int
            (requirement, T).
        """
        known = found.margins
        if known is None:
            return cls(np.zeros((0, shape[0])), np.zeros((0, *shape)), np.zeros(0, dtype=bool), (), {}, 0.0)
        return cls(known.values, known.running, known.failed, known.messages, found.counters, found.wall_time)
