"""Outcome of a realisation: the only list of failures, for the program and for results."""

from __future__ import annotations

from enum import IntEnum

__all__ = ["Status"]


class Status(IntEnum):
    """Outcome of a realisation.

    Results contain the numbers (``status``), and the names in lower case as their meanings
    (`uqmbd.results.STATUS_MEANINGS`).

    Examples
    --------
    >>> Status(1).meaning, int(Status.NOT_FINITE)
    ('assembly_failed', 3)
    """

    OK = 0
    """The realisation has all values."""
    ASSEMBLY_FAILED = 1
    """No pose or velocity satisfies the constraints."""
    INTEGRATION_FAILED = 2
    """The motion ends before the last time."""
    NOT_FINITE = 3
    """An output is not a finite number."""
    OTHER = 4
    """A value is missing, such as a static equilibrium or natural frequency; or a propagator states another reason."""

    CENSORED = 5
    """The event of an output does not occur by the last time; the realisation has not failed."""
    WORKER_DIED = 6
    """The worker process died in the first and in a second attempt."""
    OUTSIDE_LIMITS = 7
    """A number is outside its range, such as a negative mass, or no body can have the inertia."""

    @property
    def meaning(self) -> str:
        """Meaning of the number in results."""
        return self.name.lower()
