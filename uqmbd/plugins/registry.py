"""Classes of the installed plugins, by kind and name."""

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
    "exporters",
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
    """Return the integrator classes of plugins by registered name, without the integrators of the core."""
    return dict(registered().classes["integrators"])


def designs() -> dict[str, type]:
    """Return the sampling designs of plugins by registered name, without the designs of the core."""
    return dict(registered().classes["designs"])


def contact_laws() -> dict[str, type]:
    """Return the contact laws of plugins by registered name."""
    return dict(registered().classes["contact_laws"])


def contact_law(name: str) -> type:
    """Return the contact law of the given name, or raise a `uqmbd.StudyError` that lists the installed contact laws."""
    return _find("contact_laws", name)


def reader(name: str) -> type:
    """Return the reader of a model file format, or raise a `uqmbd.StudyError` that lists the installed readers."""
    return _find("readers", name)


def report_sections() -> dict[str, type]:
    """Return the report sections of plugins by class name, in the order of registration."""
    return dict(registered().classes["report_sections"])


def checks() -> dict[str, type]:
    """Return the study checks that plugins register, by class name, without the checks of the core."""
    return dict(registered().classes.get("checks", {}))


def surrogates() -> dict[str, type]:
    """Return the surrogate models of plugins by registered name."""
    return dict(registered().classes.get("surrogates", {}))


def exporters() -> dict[str, type]:
    """Return the exporters of plugins by registered name."""
    return dict(registered().classes.get("exporters", {}))


def commands() -> dict[str, type]:
    """Return the commands of plugins by name, in the order of registration, without loading other plugins."""
    return dict(registered_commands().classes["commands"])


def component(name: str) -> type:
    """Return the component class of the given name, or raise a `uqmbd.StudyError` that lists the components."""
    return _find("components", name)


def propagator(name: str) -> type:
    """Return the propagator class of the given registered name, for plugins that use the method of another plugin.

    Parameters
    ----------
    name : str
        Registered name, such as ``"collocation"``.

    Returns
    -------
    type
        Subclass of `uqmbd.extend.Propagator`.

    Raises
    ------
    uqmbd.StudyError
        If there is no such propagator; the message lists the installed names.

    Examples
    --------
    >>> propagator("collocation").__name__
    'Collocation'
    """
    given: object = name
    if not isinstance(given, str):
        from uqmbd.arguments import refusal  # imports NumPy, which would delay `uqmbd --help` at module level

        raise StudyError(f"propagator: {refusal('name', name, str)}")
    return _find("propagators", name)


def integrator(name: str) -> type:
    """Return the integrator class of the given name, or raise a `uqmbd.StudyError` that lists the integrators."""
    return _find("integrators", name)


def owner(kind: str, name: str) -> str:
    """Return the title of the plugin that registered a name, for messages; empty if there is none."""
    found = registered_commands() if kind == "commands" else registered()
    return next((info.title for info in found.plugins if name in getattr(info, kind)), "")


def installed() -> tuple[PluginInfo, ...]:
    """Return all plugins, usable or not."""
    return merged([*registered().plugins, *registered_commands().plugins])


def unusable() -> str:
    """Return a sentence with the plugins that could not be loaded completely; empty if there are none."""
    broken = [info.title for info in installed() if info.status in ("failed", "incomplete")]
    return f"Could not be loaded completely: {', '.join(broken)} (see `uqmbd plugins`)." if broken else ""


def _find(kind: str, name: str) -> type:
    found = registered().classes[kind]
    if isinstance(name, str) and name in found:
        return found[name]
    noun = KINDS[kind].noun
    offered = ", ".join(sorted(found)) or "none"
    raise StudyError(f"The {noun} {name!r} is not installed. Installed: {offered}. {unusable()}".rstrip())


@functools.cache
def registered() -> Registry:
    """Load the plugins once per process, and warn about unusable plugins and classes."""
    return _registered(GROUP)


@functools.cache
def registered_commands() -> Registry:
    """Load the modules with commands of plugins once per process, and warn about unusable modules and classes."""
    return _registered(COMMANDS_GROUP)


def _registered(group: str) -> Registry:
    disabled = tuple(part.strip() for part in os.environ.get(DISABLE, "").split(",") if part.strip())
    registry = load(importlib.metadata.entry_points(group=group), disabled, group)
    for info in registry.plugins:
        for error in info.errors:
            warnings.warn(f"{info.title}: {error}", PluginWarning, stacklevel=3)
    return registry
