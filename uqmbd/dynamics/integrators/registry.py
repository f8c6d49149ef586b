"""Integrators by name: those that the core offers by the hook of plugins, and those of plugins."""

from __future__ import annotations

from functools import cache
from typing import cast

from uqmbd.dynamics.integrators.built_in import BuiltIn
from uqmbd.dynamics.integrators.protocol import Integrator
from uqmbd.plugins import integrator as integrator_of_plugin
from uqmbd.plugins import integrators as integrators_of_plugins
from uqmbd.plugins import offered_by_core

__all__ = ["built_in_names", "integrator_class", "integrators"]


@cache
def _offered() -> dict[str, type]:
    return offered_by_core(BuiltIn(), "integrators")


def built_in_names() -> tuple[str, ...]:
    """Return the names of those of the core.

    Examples
    --------
    >>> built_in_names()
    ('auto', 'ida', 'dop853')
    """
    return tuple(_offered())


def integrators() -> dict[str, type[Integrator]]:
    """Return all that there are, those of the core first."""
    return {**_offered(), **integrators_of_plugins()}


def integrator_class(name: str) -> type[Integrator]:
    """Return the class of this name; a `uqmbd.StudyError` lists those that are installed."""
    found = _offered().get(name)
    return cast(type[Integrator], found if found is not None else integrator_of_plugin(name))
