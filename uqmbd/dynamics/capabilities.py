"""What integrators can do: those of the core by a table, those of plugins by what their classes declare.

The class of an integrator has a method ``integrate(ensemble, times, rtol)``, which returns `uqmbd.Trajectories`, and
declares what more it can by class attributes; what is not declared it cannot:

``events = True``
    It follows impacts and other events of a mechanism.
``projected = True``
    It integrates projected equations, as those of Galerkin, by a method
    ``integrate_projected(projected, times, rtol)``, which returns `uqmbd.ProjectedTrajectories`.
``paced = True``
    Its steps keep to what ``ensemble.pace(times, rtol)`` says: a longest step, and times at which it starts anew.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from uqmbd.errors import StudyError
from uqmbd.plugins import integrator, integrators

if TYPE_CHECKING:
    from uqmbd.dynamics.equations import Model

__all__ = ["INTEGRATORS", "Capability", "Integrator", "capabilities", "require", "require_for"]

Integrator = Literal["auto", "ida", "dop853"]
INTEGRATORS: tuple[Integrator, ...] = ("auto", "ida", "dop853")

Capability = Literal["events", "projected", "segments", "paced"]

OWN: Mapping[str, frozenset[Capability]] = {
    "auto": frozenset({"events", "projected", "segments", "paced"}),
    "dop853": frozenset({"events", "projected", "segments", "paced"}),
    "ida": frozenset({"projected", "paced"}),
}
"""Those of the core.  Segments, motions from event to event one by one, are for these alone."""

WORDS: Mapping[Capability, str] = {
    "events": "follow impacts and other events",
    "projected": "integrate projected equations",
    "paced": "bound its steps, or start anew where it is told to",
    "segments": "integrate from event to event, one segment after the other",
}


def capabilities(name: str) -> frozenset[Capability]:
    """Return what an integrator can do besides plain motions.

    Parameters
    ----------
    name : str
        Of the core or of a plugin; a `uqmbd.StudyError` lists those that are installed.

    Examples
    --------
    >>> sorted(capabilities("ida"))
    ['paced', 'projected']
    """
    if name in OWN:
        return OWN[name]
    return _declared(integrator(name))


def require(name: str, needed: Capability, where: str, why: str = "", remedy: str = "") -> None:
    """Raise where an integrator lacks a capability.

    Parameters
    ----------
    name : str
        Of the integrator.
    needed : {"events", "projected", "segments", "paced"}
        What it must be able to do.
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
    if needed in capabilities(name):
        return
    able = [repr(other) for other in OWN if needed in OWN[other]]
    able += [repr(other) for other, cls in integrators().items() if needed in _declared(cls)]
    undeclared = f": its class does not declare {needed} = True" if name not in OWN and needed != "segments" else ""
    about = f" ({why})" if why else ""
    more = f", or {', '.join(able[1:])}" if len(able) > 1 else ""
    raise StudyError(
        f"{where}: the integrator {name!r} cannot {WORDS[needed]}{about}{undeclared}. "
        f"{remedy or 'Use'} integrator={able[0]}{more}."
    )


def require_for(model: Model, name: str, where: str) -> None:
    """Raise where a mechanism has events that an integrator cannot follow, or bounds that it cannot keep."""
    if np.isfinite(model.max_step) or model.added_breaks:
        require(name, "paced", where, "max_step" if np.isfinite(model.max_step) else "breaks")
    if model.events:
        require(name, "events", where, ", ".join(_named(model.events)))


def _named(events: Iterable[tuple[str, str, int]]) -> list[str]:
    found = list(dict.fromkeys(f"{component}: {label}" for component, label, _ in events))
    return found if len(found) <= 3 else [*found[:3], f"and {len(found) - 3} more"]


def _declared(cls: Any) -> frozenset[Capability]:
    """Return what the class of a plugin declares."""
    names: tuple[Capability, ...] = ("events", "projected", "paced")
    return frozenset(name for name in names if getattr(cls, name, False) is True)
