"""What the installed plugins offer, by kind and name."""

from __future__ import annotations

import functools
import importlib.metadata
import os
import warnings

from uqmbd.errors import PluginWarning, StudyError
from uqmbd.plugins.hooks import KINDS
from uqmbd.plugins.loading import PluginInfo, Registry, load

__all__ = [
    "component",
    "components",
    "designs",
    "installed",
    "integrator",
    "integrators",
    "owner",
    "propagator",
    "propagators",
    "reader",
    "report_sections",
]

GROUP = "uqmbd"
DISABLE = "UQMBD_DISABLE_PLUGINS"


def components() -> dict[str, type]:
    """Return the installed component classes by class name."""
    return dict(registered().classes["components"])


def propagators() -> dict[str, type]:
    """Return the installed propagator classes by registered name."""
    return dict(registered().classes["propagators"])


def integrators() -> dict[str, type]:
    """Return the integrator classes that plugins offer by registered name; those of the core are not among them."""
    return dict(registered().classes["integrators"])


def designs() -> dict[str, type]:
    """Return the sampling designs that plugins offer by registered name; those of the core are not among them."""
    return dict(registered().classes["designs"])


def reader(name: str) -> type:
    """Return the reader of model files of this format; a `uqmbd.StudyError` lists those that are installed."""
    return _find("readers", name)


def report_sections() -> dict[str, type]:
    """Return the report sections that plugins offer by class name, in the order of registration."""
    return dict(registered().classes["report_sections"])


def component(name: str) -> type:
    """Return the component class of this name; a `uqmbd.StudyError` lists those that are installed."""
    return _find("components", name)


def propagator(name: str) -> type:
    """Return the propagator class that is registered by a name, for plugins that use the method of another one.

    Parameters
    ----------
    name : str
        Such as ``"collocation"``.

    Returns
    -------
    type
        A subclass of `uqmbd.Propagator`.

    Raises
    ------
    uqmbd.StudyError
        If there is none: the message lists those that are installed.

    Examples
    --------
    >>> propagator("collocation").__name__
    'Collocation'
    """
    return _find("propagators", name)


def integrator(name: str) -> type:
    """Return the integrator class of this name; a `uqmbd.StudyError` lists those that are installed."""
    return _find("integrators", name)


def owner(kind: str, name: str) -> str:
    """Return the plugin that registered a name, for messages; empty if none did.

    Parameters
    ----------
    kind : {"components", "propagators", "integrators", "designs", "readers", "report_sections"}
    name : str
    """
    return next((info.title for info in installed() if name in getattr(info, kind)), "")


def installed() -> tuple[PluginInfo, ...]:
    """Return every entry point of the group ``uqmbd``, whether it could be used or not."""
    return registered().plugins


def _find(kind: str, name: str) -> type:
    found = registered().classes[kind]
    if name in found:
        return found[name]
    noun = KINDS[kind].noun
    offered = ", ".join(sorted(found)) or "none"
    broken = [info.title for info in installed() if info.status in ("failed", "incomplete")]
    hint = f" Could not be loaded completely: {', '.join(broken)} (see `uqmbd plugins`)." if broken else ""
    raise StudyError(f"There is no {noun} named {name!r}. Installed: {offered}.{hint}")


@functools.cache
def registered() -> Registry:
    """Load the plugins, once per process, and warn of what cannot be used."""
    disabled = tuple(part.strip() for part in os.environ.get(DISABLE, "").split(",") if part.strip())
    registry = load(importlib.metadata.entry_points(group=GROUP), disabled=disabled)
    for info in registry.plugins:
        for error in info.errors:
            warnings.warn(f"{info.title}: {error}", PluginWarning, stacklevel=2)
    return registry
