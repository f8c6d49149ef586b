"""What has become of a realisation: the one list of kinds of failure, in the program and in results."""

from __future__ import annotations

from enum import IntEnum

__all__ = ["Status"]


class Status(IntEnum):
    """What has become of a realisation.

    Its numbers stand in results (``status``), its names in lower case are their meanings
    (`uqmbd.results.STATUS_MEANINGS`).

    Examples
    --------
    >>> Status(1).meaning, int(Status.NOT_FINITE)
    ('assembly_failed', 3)
    """

    OK = 0
    """It has all values."""
    ASSEMBLY_FAILED = 1
    """No pose or velocity satisfies its constraints."""
    INTEGRATION_FAILED = 2
    """Its motion ends before the last time."""
    NOT_FINITE = 3
    """An output is no finite number."""
    OTHER = 4
    """It has no such value, as a static equilibrium or a further natural frequency, or a propagator's own reason."""

    CENSORED = 5
    """What is asked for does not happen in it until the last time: it has not failed."""
    WORKER_DIED = 6
    """The process that computed it has ended, and so has that of a second attempt."""
    OUTSIDE_LIMITS = 7
    """A number of it lies outside of its range, as a negative mass, or its inertia is that of no body."""

    @property
    def meaning(self) -> str:
        """Its word in results."""
        return self.name.lower()
