"""Results of the integration of a projected ensemble, and its observers."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from uqmbd.arguments import typechecked
from uqmbd.typing import Array

__all__ = ["ProjectedTrajectories", "Watch"]


Watch = Callable[[Array], bool]
"""Function of coefficients (P, T, width), NaN from the present time on; a true return value ends the integration."""


@typechecked
@dataclass(frozen=True)
class ProjectedTrajectories:
    """Coefficients of states at the output times.

    Attributes
    ----------
    times : array, shape (T,)
        Output times, s.
    coefficients : array, shape (P, T, 2 coordinate + state)
        Coefficients of coordinates, auxiliary states and velocities; NaN after an early end.
    message : str
        Reason of an early end; otherwise empty.
    integrator : str
        Integrator: ``dop853``, ``ida``, or ``none`` if nothing moves.
    counters : dict
        Operations of the integration.

    Examples
    --------
    >>> import numpy as np
    >>> import uqmbd
    >>> states = np.zeros((2, 2, 2))
    >>> found = uqmbd.extend.ProjectedTrajectories(np.array([0.0, 1.0]), states, "", "dop853", dict(steps=3))
    >>> found.coefficients.shape, found.counters["steps"]
    ((2, 2, 2), 3)
    """

    times: Array
    coefficients: Array
    message: str
    integrator: str
    counters: dict[str, Any]
