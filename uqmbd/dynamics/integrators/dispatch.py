"""Integrators by name, their capabilities, and the integration of an ensemble."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import replace
from functools import cache, partial
from typing import cast

import numpy as np

from uqmbd.dynamics.ensemble import Ensemble
from uqmbd.dynamics.equations import Model
from uqmbd.dynamics.integration import Trajectories
from uqmbd.dynamics.integrators.between import with_motion_between
from uqmbd.dynamics.integrators.built_in import BuiltInIntegrators
from uqmbd.dynamics.integrators.protocol import Capability, Integrator, capabilities_of
from uqmbd.dynamics.integrators.sampled import trajectories_in_samples
from uqmbd.dynamics.integrators.stacks import checked
from uqmbd.errors import StudyError
from uqmbd.plugins import core_offers
from uqmbd.plugins import integrator as integrator_of_plugin
from uqmbd.plugins import integrators as integrators_of_plugins
from uqmbd.typing import Array

__all__ = ["built_in_names", "integrate", "integrator_class", "installed_integrators", "require", "require_for"]


@cache
def _integrators_by_name() -> dict[str, type]:
    return core_offers(BuiltInIntegrators(), "integrators")


def built_in_names() -> tuple[str, ...]:
    """Return the names of the integrators of the core.

    >>> built_in_names()
    ('auto', 'ida', 'dop853', 'radau')
    """
    return tuple(_integrators_by_name())


def installed_integrators() -> dict[str, type[Integrator]]:
    """Return all available integrators by name; integrators of the core come first."""
    return {**_integrators_by_name(), **integrators_of_plugins()}


def integrator_class(name: str) -> type[Integrator]:
    """Return the integrator class with this name; if there is none, raise StudyError with the installed names."""
    found = _integrators_by_name().get(name)
    return cast(type[Integrator], found if found is not None else integrator_of_plugin(name))


WORDS: Mapping[Capability, str] = {
    "events": "follow impacts and other events",
    "projected": "integrate projected equations",
    "bounded_steps": "bound its steps, or restart at given times",
    "sampled_control": "sample controllers across impacts",
    "segments": "integrate from event to event, one segment after the other",
}


def require(name: str, needed: Capability, where: str, why: str = "", remedy: str = "") -> None:
    """Raise `uqmbd.StudyError`, which lists capable integrators, if an integrator lacks a capability.

    `needed` is the name of a field of `Capabilities`; `where` is the object that requires it, such as ``study 'drop'``,
    and `why` the purpose.  The `remedy` describes how to choose another integrator; default: by the option
    ``integrator``.

    >>> require("ida", "events", "study 'drop'", "floor: impact")
    Traceback (most recent call last):
        ...
    uqmbd.errors.StudyError: study 'drop': the integrator 'ida' cannot follow impacts and other events (floor: impact).
    Use integrator='auto', or 'dop853', 'radau'.
    """
    if getattr(capabilities_of(integrator_class(name)), needed):
        return
    able = [repr(other) for other, cls in installed_integrators().items() if _has(cls, needed)]
    undeclared = "" if name in built_in_names() else f": its class does not declare {needed}=True in its capabilities"
    about = f" ({why})" if why else ""
    more = f", or {', '.join(able[1:])}" if len(able) > 1 else ""
    raise StudyError(
        f"{where}: the integrator {name!r} cannot {WORDS[needed]}{about}{undeclared}. "
        f"{remedy or 'Use'} integrator={able[0]}{more}."
    )


def _has(cls: type, needed: Capability) -> bool:
    """Return whether an integrator declares a capability; False if its declaration is invalid."""
    try:
        return bool(getattr(capabilities_of(cls), needed))
    except StudyError:
        return False


def require_for(model: Model, name: str, where: str) -> None:
    """Raise if an integrator cannot handle the events or bounds of a mechanism."""
    if np.isfinite(model.max_step) or model.added_breaks:
        require(name, "bounded_steps", where, "max_step" if np.isfinite(model.max_step) else "breaks")
    if model.events:
        require(name, "events", where, ", ".join(_named(model.events)))


def _named(events: Iterable[tuple[str, str, int]]) -> list[str]:
    found = list(dict.fromkeys(f"{component}: {label}" for component, label, _ in events))
    return found if len(found) <= 3 else [*found[:3], f"and {len(found) - 3} more"]


def integrate(
    ensemble: Ensemble, times: Array, rtol: float = 1e-6, method: str = "auto", *, between: bool = False
) -> Trajectories:
    """Assemble and integrate K realisations at strictly increasing output times (T,), s; the first is the start.

    With `between`, the motion between the output times is also returned (`Trajectories.path`).  A failed realisation
    does not affect the others.  Raises `uqmbd.StudyError` if the integrator lacks a required capability, such as the
    treatment of events, or returns an invalid result.  A `uqmbd.RedundantConstraintWarning` reports that the
    independent equations became dependent during the motion, and that others were chosen.
    """
    require_for(ensemble.model, method, f"mechanism {ensemble.model.name!r}")
    if ensemble.paths is not None:
        ensemble.paths.reach(float(times[0]), float(times[-1]))
    cls = integrator_class(method)
    integrator = cls()
    recorded = between and capabilities_of(cls).dense_output
    options = {"recording": True} if recorded else {}

    def solve(ensemble: Ensemble, times: Array, rtol: float) -> Trajectories:
        return _valid(integrator.integrate(ensemble, times, rtol, **options), method, ensemble, times)

    model = ensemble.model
    if between and not recorded:
        solve = partial(with_motion_between, solve)
    if not model.controls or capabilities_of(cls).sampled_control:
        found = checked(solve, ensemble, times, rtol)
    else:
        found = checked(partial(trajectories_in_samples, solve), ensemble, times, rtol)
    return replace(found, rtol=rtol) if between else found


def _valid(found: object, name: str, ensemble: Ensemble, times: Array) -> Trajectories:
    """Return the result of an integrator; raise if its type is wrong."""
    shape = (len(ensemble), len(times), ensemble.model.layout.width)
    if not isinstance(found, Trajectories) or np.shape(found.states) != shape or len(found.messages) != shape[0]:
        what = f"a {type(found).__name__}"
        if isinstance(found, Trajectories):
            what = f"states of shape {np.shape(found.states)} and {len(found.messages)} messages"
        raise StudyError(
            f"the integrator {name!r}: its method integrate returned {what}; expected uqmbd.extend.Trajectories "
            f"with states of shape {shape} and {shape[0]} messages."
        )
    # an integrator of a plugin may have changed the states after it computed `off`, which is then invalid
    return found if name in built_in_names() else replace(found, off=None)
