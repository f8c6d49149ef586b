"""What the installed plugins offer, by kind and name."""

from __future__ import annotations

import functools
import importlib.metadata
import os
import warnings

from uqmbd.errors import PluginWarning, StudyError
from uqmbd.plugins.hooks import COMMANDS_GROUP, GROUP, KINDS
from uqmbd.plugins.loading import PluginInfo, Registry, load, merged

__all__ = [
    "checks",
    "commands",
    "component",
    "components",
    "contact_law",
    "contact_laws",
    "designs",
    "installed",
    "integrator",
    "integrators",
    "owner",
    "propagator",
    "propagators",
    "reader",
    "report_sections",
    "surrogates",
    "unusable",
]

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


def contact_laws() -> dict[str, type]:
    """Return the laws of contact that plugins offer by registered name."""
    return dict(registered().classes["contact_laws"])


def contact_law(name: str) -> type:
    """Return the law of contact of this name; a `uqmbd.StudyError` lists those that are installed."""
    return _find("contact_laws", name)


def reader(name: str) -> type:
    """Return the reader of model files of this format; a `uqmbd.StudyError` lists those that are installed."""
    return _find("readers", name)


def report_sections() -> dict[str, type]:
    """Return the report sections that plugins offer by class name, in the order of registration."""
    return dict(registered().classes["report_sections"])


def checks() -> dict[str, type]:
    """Return the checks of studies that plugins offer by class name; those of the core are not among them."""
    return dict(registered().classes.get("checks", {}))


def surrogates() -> dict[str, type]:
    """Return the models of surrogates that plugins offer by registered name."""
    return dict(registered().classes.get("surrogates", {}))


def commands() -> dict[str, type]:
    """Return the commands that plugins offer by name, in the order of registration; no other plugin is loaded."""
    return dict(registered_commands().classes["commands"])


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
        A subclass of `uqmbd.extend.Propagator`.

    Raises
    ------
    uqmbd.StudyError
        If there is none: the message lists those that are installed.

    Examples
    --------
    >>> propagator("collocation").__name__
    'Collocation'
    """
    given: object = name
    if not isinstance(given, str):
        from uqmbd.arguments import refusal  # here: it imports NumPy, and `uqmbd --help` imports this module

        raise StudyError(f"propagator: {refusal('name', name, str)}")
    return _find("propagators", name)


def integrator(name: str) -> type:
    """Return the integrator class of this name; a `uqmbd.StudyError` lists those that are installed."""
    return _find("integrators", name)


def owner(kind: str, name: str) -> str:
    """Return the plugin that registered a name, for messages; empty if none did."""
    found = registered_commands() if kind == "commands" else registered()
    return next((info.title for info in found.plugins if name in getattr(info, kind)), "")


def installed() -> tuple[PluginInfo, ...]:
    """Return every plugin, whether it could be used or not."""
    return merged([*registered().plugins, *registered_commands().plugins])


def unusable() -> str:
    """Name the plugins that could not be loaded completely, as a sentence; empty if there is none."""
    broken = [info.title for info in installed() if info.status in ("failed", "incomplete")]
    return f"Could not be loaded completely: {', '.join(broken)} (see `uqmbd plugins`)." if broken else ""


def _find(kind: str, name: str) -> type:
    found = registered().classes[kind]
    if isinstance(name, str) and name in found:
        return found[name]
    noun = KINDS[kind].noun
    offered = ", ".join(sorted(found)) or "none"
    raise StudyError(f"There is no {noun} named {name!r}. Installed: {offered}. {unusable()}".rstrip())


@functools.cache
def registered() -> Registry:
    """Load the plugins, once per process, and warn of what cannot be used."""
    return _registered(GROUP)


@functools.cache
def registered_commands() -> Registry:
    """Load the modules of plugins that offer commands, once per process, and warn of what cannot be used."""
    return _registered(COMMANDS_GROUP)


def _registered(group: str) -> Registry:
    disabled = tuple(part.strip() for part in os.environ.get(DISABLE, "").split(",") if part.strip())
    registry = load(importlib.metadata.entry_points(group=group), disabled, group)
    for info in registry.plugins:
        for error in info.errors:
            warnings.warn(f"{info.title}: {error}", PluginWarning, stacklevel=3)
    return registry
