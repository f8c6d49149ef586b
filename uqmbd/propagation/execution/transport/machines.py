"""On which types of machines realisations were computed: counted with what solvers count, and so stored with it."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any

from uqmbd.propagation.execution.transport.identity import machine_type

__all__ = ["machine_attribute", "machine_counter", "solver_counters"]

_ON = "on "


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
