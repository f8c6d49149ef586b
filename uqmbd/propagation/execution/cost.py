"""Computing time over all runs that contributed to a result, and the types of the machines that they used.

Data from a checkpoint count with their recorded computing time. The solver counters include machine types, so
checkpoints store both.
"""

from __future__ import annotations

import json
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Any

from uqmbd.errors import StudyError
from uqmbd.propagation.execution.transport import machine_type

__all__ = [
    "OTHER",
    "PARTS",
    "CostClock",
    "Laps",
    "Spending",
    "machine_attribute",
    "machine_counter",
    "solver_counters",
    "spending_attributes",
]


PARTS = ("integration", "fitting", "verification", "error estimation")
"""Parts of the computing time of a method; the remaining time is `OTHER`."""

OTHER = "other"

_ON = "on "
"""Prefix of the names of machine counters."""

PURPOSES = ("verification", "error estimation")
"""Parts of the computing time that include the realisations computed for them."""


@dataclass
class CostClock:
    """Clock that advances by the recorded computing time of stored work.

    The difference of two readings is the wall time that an uninterrupted run would have needed.
    """

    _recovered: float = 0.0
    _known: set[str] = field(default_factory=set)

    def __call__(self) -> float:
        """Return seconds from an arbitrary origin."""
        return time.perf_counter() + self._recovered

    def recover(self, key: str, seconds: float) -> None:
        """Advance by the computing time of stored work, unless this run has already computed or read this work."""
        if key not in self._known:
            self._known.add(key)
            self._recovered += seconds

    def knows(self, key: str) -> bool:
        """Return whether this run has computed or read the stored work with a key."""
        return key in self._known

    def done(self, key: str) -> None:
        """Record that this run has computed the stored work with a key."""
        self._known.add(key)


class Laps:
    """Lap times between calls."""

    def __init__(self) -> None:
        self._last = time.perf_counter()

    def __call__(self) -> float:
        """Return the seconds since the last call."""
        before, self._last = self._last, time.perf_counter()
        return self._last - before


@dataclass
class Spending:
    """Single record of the computing time of a method, by part.

    The time of a part is the time while the part is open, minus the time of parts within it. The time of realisations
    is recorded as integration, unless a part that states their purpose is open.
    """

    seconds: dict[str, float] = field(default_factory=lambda: dict.fromkeys(PARTS, 0.0))
    """Seconds by part, from the clock of the problem."""
    _open: list[list[Any]] = field(default_factory=list)
    """Names of open parts, and the seconds of parts within them."""
    computed: int = 0
    """Number of computed realisations, for all kinds of outputs; without repetitions for the integration error."""

    @contextmanager
    def part(self, name: str, clock: Callable[[], float]) -> Iterator[None]:
        """Record the time within the context as a part; raise StudyError for an unknown part."""
        if name not in PARTS:
            raise StudyError(f"The name of a part of the cost is {name!r}; expected one of {', '.join(PARTS)}.")
        begin = clock()
        self._open.append([name, 0.0])
        try:
            yield
        finally:
            spent = clock() - begin
            self.seconds[name] += spent - self._open.pop()[1]
            if self._open:
                self._open[-1][1] += spent

    def realised(self, seconds: float, counters: Mapping[str, float] | None = None) -> None:
        """Record the computing time of realisations in s; also record their number, if their counters are given."""
        self.count(counters or {})
        if self._open:
            if self._open[-1][0] in PURPOSES:
                return
            self._open[-1][1] += seconds
        self.seconds["integration"] += seconds

    def count(self, counters: Mapping[str, float]) -> None:
        """Count the realisations of a chunk from its counters; results of a run for other outputs have no counters.

        >>> spending = Spending()
        >>> spending.count(machine_counter(64)), spending.count({}), spending.computed
        (None, None, 64)
        """
        if not any(name == "error estimation" for name, _ in self._open):
            self.computed += sum(int(count) for name, count in counters.items() if name.startswith(_ON))

    @contextmanager
    def whole(self, clock: Callable[[], float]) -> Iterator[dict[str, float | int]]:
        """Measure the total time of the context; write the attributes of a node at its end."""
        found: dict[str, float | int] = {}
        before, begin = dict(self.seconds), clock()
        try:
            yield found
        finally:
            spent = clock() - begin
            found |= spending_attributes({name: self.seconds[name] - before[name] for name in PARTS}, spent)


def spending_attributes(parts: dict[str, float], whole: float) -> dict[str, float]:
    """Return ``wall_time`` in s and its parts; their sum is ``wall_time``, and ``other`` is the remainder of `whole`.

    >>> spending_attributes({"integration": 2.0, "fitting": 1.0, "verification": 0.0, "error estimation": 0.5}, 4.0)
    {'wall_time_integration': 2.0, 'wall_time_fitting': 1.0, ..., 'wall_time_other': 0.5, 'wall_time': 4.0}
    """
    kept = {name: max(float(parts[name]), 0.0) for name in PARTS}
    kept[OTHER] = max(whole - sum(kept.values()), 0.0)
    found = {f"wall_time_{name.replace(' ', '_')}": seconds for name, seconds in kept.items()}
    return {**found, "wall_time": sum(found.values())}


def machine_counter(realisations: int) -> dict[str, float]:
    """Return the counter of realisations that this machine computed."""
    return {f"{_ON}{machine_type()}": realisations}


def solver_counters(counters: Mapping[str, Any]) -> dict[str, Any]:
    """Return the solver counters without the machine counters."""
    return {name: value for name, value in counters.items() if not name.startswith(_ON)}


def machine_attribute(counters: Mapping[str, float]) -> dict[str, str]:
    """Return the attribute with the number of realisations by type of machine, as a JSON object.

    The result is empty if machines of the type of this machine computed all realisations.

    >>> machine_attribute({"steps": 12, "on aarch64 neon glibc-2.36": 64})
    {'machines': '{"aarch64 neon glibc-2.36": 64}'}
    >>> machine_attribute(machine_counter(64))
    {}
    """
    found = {name.removeprefix(_ON): int(count) for name, count in counters.items() if name.startswith(_ON) and count}
    return {"machines": json.dumps(found)} if set(found) - {machine_type()} else {}
