"""Hooks that a plugin package can implement, and the search, loading and isolation of plugin packages.

A plugin package names a module (or an object) in the entry-point group ``uqmbd``. That module implements any of ten
hooks, each of which returns classes::

    import uqmbd

    class Magnet(uqmbd.Component):
        ...

    @uqmbd.hookimpl
    def uqmbd_components():
        return [Magnet]

Modules that offer commands are named in the entry-point group ``uqmbd.commands``: see `uqmbd.extend.Command`.

A plugin that fails causes a `uqmbd.extend.PluginWarning` with its name and the reason; other plugins are not affected.
The environment variable ``UQMBD_DISABLE_PLUGINS`` contains names of entry points or distributions that are not loaded,
separated by commas.
"""

from __future__ import annotations

from uqmbd.plugins.command import Command, command_line
from uqmbd.plugins.exporter import Exporter
from uqmbd.plugins.hooks import EXPORTS, KINDS, HookKind, hookimpl, integrator_problem
from uqmbd.plugins.input_treatment import InputTreatment, declared_treatment
from uqmbd.plugins.loading import PluginInfo, Registry, core_offers, load, merged, registered_name
from uqmbd.plugins.method_names import example_of, method_with_option, such_as
from uqmbd.plugins.registry import (
    checks,
    commands,
    component,
    components,
    contact_law,
    contact_laws,
    designs,
    exporters,
    installed,
    integrator,
    integrators,
    owner,
    propagator,
    propagators,
    reader,
    report_sections,
    surrogates,
    unusable,
)

__all__ = [
    "EXPORTS",
    "KINDS",
    "Command",
    "Exporter",
    "HookKind",
    "InputTreatment",
    "PluginInfo",
    "Registry",
    "checks",
    "command_line",
    "commands",
    "component",
    "components",
    "contact_law",
    "contact_laws",
    "core_offers",
    "declared_treatment",
    "designs",
    "example_of",
    "exporters",
    "hookimpl",
    "installed",
    "integrator",
    "integrator_problem",
    "integrators",
    "load",
    "merged",
    "method_with_option",
    "owner",
    "propagator",
    "propagators",
    "reader",
    "registered_name",
    "report_sections",
    "such_as",
    "surrogates",
    "unusable",
]
