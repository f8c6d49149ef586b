"""Cost of work over all runs that it took, and the types of machines that it ran on.

What is read from a checkpoint costs what it cost to compute.  Machines are counted with what solvers count, and so are
stored with it.
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
"""What methods spend time for; the rest is `OTHER`."""

OTHER = "other"

_ON = "on "
"""What begins the names of counters of machines."""

PURPOSES = ("verification", "error estimation")
"""Parts that realisations belong to which are computed for them."""


@dataclass
class CostClock:
    """Clock that advances by the recorded computing time of stored work.

    Differences of its readings are the wall times of an uninterrupted run.
    """

    _recovered: float = 0.0
    _known: set[str] = field(default_factory=set)

    def __call__(self) -> float:
        """Seconds, from an arbitrary origin."""
        return time.perf_counter() + self._recovered

    def recover(self, key: str, seconds: float) -> None:
        """Go on by the cost of work that was read, unless it was done or read before in this run."""
        if key not in self._known:
            self._known.add(key)
            self._recovered += seconds

    def knows(self, key: str) -> bool:
        """Return whether work was done or read in this run."""
        return key in self._known

    def done(self, key: str) -> None:
        """Note that work was done in this run."""
        self._known.add(key)


class Laps:
    """Times from one piece of work to the next."""

    def __init__(self) -> None:
        self._last = time.perf_counter()

    def __call__(self) -> float:
        """Seconds since the last call."""
        before, self._last = self._last, time.perf_counter()
        return self._last - before


@dataclass
class Spending:
    """Computing time of a method by part: a single record for all its work.

    A part receives the time while it is open, less that of parts within it. Realisations are recorded where they are
    computed: as integration, unless a part that states their purpose is open.
    """

    seconds: dict[str, float] = field(default_factory=lambda: dict.fromkeys(PARTS, 0.0))
    """By part, of the clock of the problem."""
    _open: list[list[Any]] = field(default_factory=list)
    """Names of open parts, and the seconds of parts within them."""

    @contextmanager
    def part(self, name: str, clock: Callable[[], float]) -> Iterator[None]:
        """Record the time within the context as a part; raise StudyError for an unknown part."""
        if name not in PARTS:
            raise StudyError(f"There is no part {name!r} of what a method spends; expected one of {', '.join(PARTS)}.")
        begin = clock()
        self._open.append([name, 0.0])
        try:
            yield
        finally:
            spent = clock() - begin
            self.seconds[name] += spent - self._open.pop()[1]
            if self._open:
                self._open[-1][1] += spent

    def realised(self, seconds: float) -> None:
        """Record the seconds of realisations."""
        if self._open:
            if self._open[-1][0] in PURPOSES:
                return
            self._open[-1][1] += seconds
        self.seconds["integration"] += seconds

    @contextmanager
    def whole(self, clock: Callable[[], float]) -> Iterator[dict[str, float | int]]:
        """Measure everything that is spent within; fill the attributes of a node, which are complete at the end."""
        found: dict[str, float | int] = {}
        before, begin = dict(self.seconds), clock()
        try:
            yield found
        finally:
            spent = clock() - begin
            found |= spending_attributes({name: self.seconds[name] - before[name] for name in PARTS}, spent)


def spending_attributes(parts: dict[str, float], whole: float) -> dict[str, float]:
    """Return ``wall_time``, s, and the parts that add up to it; the rest of `whole` is the part ``other``.

    >>> spending_attributes({"integration": 2.0, "fitting": 1.0, "verification": 0.0, "error estimation": 0.5}, 4.0)
    {'wall_time_integration': 2.0, 'wall_time_fitting': 1.0, ..., 'wall_time_other': 0.5, 'wall_time': 4.0}
    """
    kept = {name: max(float(parts[name]), 0.0) for name in PARTS}
    kept[OTHER] = max(whole - sum(kept.values()), 0.0)
    found = {f"wall_time_{name.replace(' ', '_')}": seconds for name, seconds in kept.items()}
    return {**found, "wall_time": sum(found.values())}


def machine_counter(realisations: int) -> dict[str, float]:
    """Return the counter of realisations that this machine has computed."""
    return {f"{_ON}{machine_type()}": realisations}


def solver_counters(counters: Mapping[str, Any]) -> dict[str, Any]:
    """Return the other counters."""
    return {name: value for name, value in counters.items() if not name.startswith(_ON)}


def machine_attribute(counters: Mapping[str, float]) -> dict[str, str]:
    """Return the attribute with the number of realisations by type of machine, as a JSON object.

    It is empty where all of them were computed on machines of the type of this one.

    >>> machine_attribute({"steps": 12, "on aarch64 neon glibc-2.36": 64})
    {'machines': '{"aarch64 neon glibc-2.36": 64}'}
    >>> machine_attribute(machine_counter(64))
    {}
    """
    found = {name.removeprefix(_ON): int(count) for name, count in counters.items() if name.startswith(_ON) and count}
    return {"machines": json.dumps(found)} if set(found) - {machine_type()} else {}
