"""What integrators can do, and errors where one cannot do what it takes."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

import numpy as np

from uqmbd.dynamics.equations import Model
from uqmbd.dynamics.integrators.protocol import Capability, capabilities_of
from uqmbd.dynamics.integrators.registry import built_in_names, integrator_class, integrators
from uqmbd.errors import StudyError

__all__ = ["require", "require_for"]


WORDS: Mapping[Capability, str] = {
    "events": "follow impacts and other events",
    "projected": "integrate projected equations",
    "bounded_steps": "bound its steps, or restart at given times",
    "sampled_control": "sample controllers across impacts",
    "segments": "integrate from event to event, one segment after the other",
}


def require(name: str, needed: Capability, where: str, why: str = "", remedy: str = "") -> None:
    """Raise where an integrator lacks a capability.

    Parameters
    ----------
    name : str
        Of the integrator.
    needed : str
        Name of a field of `Capabilities`.
    where : str
        Who needs it, as ``study 'drop'``.
    why : str
        What for.
    remedy : str
        How to choose another one; default: by the option ``integrator``.

    Raises
    ------
    uqmbd.StudyError
        With those integrators that have it.

    Examples
    --------
    >>> require("ida", "events", "study 'drop'", "floor: impact")
    Traceback (most recent call last):
        ...
    uqmbd.errors.StudyError: study 'drop': the integrator 'ida' cannot follow impacts and other events (floor: impact).
    Use integrator='auto', or 'dop853'.
    """
    if getattr(capabilities_of(integrator_class(name)), needed):
        return
    able = [repr(other) for other, cls in integrators().items() if getattr(capabilities_of(cls), needed)]
    undeclared = "" if name in built_in_names() else f": its class does not declare {needed}=True in its capabilities"
    about = f" ({why})" if why else ""
    more = f", or {', '.join(able[1:])}" if len(able) > 1 else ""
    raise StudyError(
        f"{where}: the integrator {name!r} cannot {WORDS[needed]}{about}{undeclared}. "
        f"{remedy or 'Use'} integrator={able[0]}{more}."
    )


def require_for(model: Model, name: str, where: str) -> None:
    """Raise where a mechanism has events that an integrator cannot follow, or bounds that it cannot keep."""
    if np.isfinite(model.max_step) or model.added_breaks:
        require(name, "bounded_steps", where, "max_step" if np.isfinite(model.max_step) else "breaks")
    if model.events:
        require(name, "events", where, ", ".join(_named(model.events)))


def _named(events: Iterable[tuple[str, str, int]]) -> list[str]:
    found = list(dict.fromkeys(f"{component}: {label}" for component, label, _ in events))
    return found if len(found) <= 3 else [*found[:3], f"and {len(found) - 3} more"]
