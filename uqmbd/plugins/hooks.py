"""Hooks that a plugin package can implement, and common properties of the classes of each hook."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from typing import NamedTuple

import pluggy

__all__ = ["COMMANDS_GROUP", "GROUP", "KINDS", "HookKind", "hookimpl", "integrator_problem", "plugin_manager"]

GROUP = "uqmbd"
"""Entry-point group of modules that implement hooks."""

COMMANDS_GROUP = "uqmbd.commands"
"""Entry-point group of modules with commands; `uqmbd --help` imports them, so they must not import large libraries."""

hookimpl = pluggy.HookimplMarker("uqmbd")
"""Decorator that marks a function of a plugin as the implementation of the hook with its name."""

_hookspec = pluggy.HookspecMarker("uqmbd")


class _Hooks:
    """Specification of the hooks; each hook returns a sequence of classes, which may be empty."""

    @_hookspec
    def uqmbd_components(self) -> Sequence[type]:  # type: ignore[empty-body]  # a specification
        """Return joints, drivers, springs and others: subclasses of `uqmbd.Component`, registered by class name."""

    @_hookspec
    def uqmbd_propagators(self) -> Sequence[type]:  # type: ignore[empty-body]  # a specification
        """Return subclasses of `uqmbd.extend.Propagator`, registered by their class attribute ``name``."""

    @_hookspec
    def uqmbd_integrators(self) -> Sequence[type]:  # type: ignore[empty-body]  # a specification
        """Return time integrators: classes that follow the protocol `uqmbd.extend.Integrator`, each with a ``name``.

        The class has a method ``integrate(ensemble, times, rtol)``, which returns `uqmbd.extend.Trajectories`. The
        attribute ``capabilities`` of the class, a `uqmbd.extend.Capabilities`, declares further capabilities; a
        class without this attribute has none. The integrators of the core implement the same hook, but are
        stored separately.
        """

    @_hookspec
    def uqmbd_designs(self) -> Sequence[type]:  # type: ignore[empty-body]  # a specification
        """Return sampling designs: classes like `uqmbd.extend.SamplingDesign`, registered by their ``name``.

        The sampling designs of the core implement the same hook, but are stored separately.
        """

    @_hookspec
    def uqmbd_contact_laws(self) -> Sequence[type]:  # type: ignore[empty-body]  # a specification
        """Return contact laws: classes without constructor arguments, registered by their attribute ``name``.

        Contacts with ``law="name"`` use the return value of the method ``law()``.
        """

    @_hookspec
    def uqmbd_readers(self) -> Sequence[type]:  # type: ignore[empty-body]  # a specification
        """Return readers of model files, registered by their class attribute ``name``, a format such as ``"urdf"``.

        The class has no constructor arguments.  The method ``read(path, **options)`` of the class returns
        `uqmbd.extend.ImportedMechanism`.
        """

    @_hookspec
    def uqmbd_report_sections(self) -> Sequence[type]:  # type: ignore[empty-body]  # a specification
        """Return sections of the HTML report: classes that follow the protocol `uqmbd.report.Section`.

        Their constructors have no arguments.
        """

    @_hookspec
    def uqmbd_checks(self) -> Sequence[type]:  # type: ignore[empty-body]  # a specification
        """Return checks of studies: classes without constructor arguments, registered by class name.

        The method ``find(study)`` returns an iterable of `uqmbd.extend.Finding`. The checks of the core implement the
        same hook, but are stored separately.
        """

    @_hookspec
    def uqmbd_surrogates(self) -> Sequence[type]:  # type: ignore[empty-body]  # a specification
        """Return models of surrogates: classes that follow the protocol `uqmbd.extend.SurrogateModel`, with a ``name``.

        Results store this name and the arrays of the model; the registered class reads them.
        """

    @_hookspec
    def uqmbd_exporters(self) -> Sequence[type]:  # type: ignore[empty-body]  # a specification
        """Return exporters to files of other programs: dataclasses that follow the protocol `uqmbd.extend.Exporter`.

        They are registered by ``name``. `uqmbd export` selects the exporter whose class attribute ``suffix`` is the
        ending of the file name.
        """

    @_hookspec
    def uqmbd_commands(self) -> Sequence[type]:  # type: ignore[empty-body]  # a specification
        """Return commands of the command line: classes that follow the protocol `uqmbd.extend.Command`.

        Their constructors have no arguments.
        The entry-point group ``uqmbd.commands`` names the module that implements this hook.
        """


class HookKind(NamedTuple):
    """Common properties of the classes of one hook."""

    hook: str
    noun: str
    base: str | None
    by_attribute: bool
    method: str = ""
    flags: tuple[str, ...] = ()
    """Class attributes with truth values; the default is False."""
    reserved: tuple[str, ...] = ()
    """Names of the classes of the core."""
    problem: Callable[[type], str] | None = None
    """Function that returns any other reason to reject a class, or an empty text."""
    group: str = GROUP
    """Entry-point group of the modules that can implement the hook."""


INTEGRATOR_METHODS = {
    "projected": "integrate_projected(projected, times, rtol)",
    "segments": "integrate_segments(ensemble, times, rtol)",
}
"""Methods that the capabilities `projected` and `segments` of an integrator require."""


def integrator_problem(cls: type) -> str:
    """Return the reason why a class is not an integrator, or an empty text."""
    if not callable(getattr(cls, "integrate", None)):
        return "which has no method integrate(ensemble, times, rtol)"
    declared = getattr(cls, "capabilities", None)
    declared = cls if declared is None else declared
    if declared is not cls and not hasattr(declared, "bounded_steps"):
        return f"whose class attribute `capabilities` is {declared!r}; expected uqmbd.extend.Capabilities(...)"
    for flag, method in INTEGRATOR_METHODS.items():
        if getattr(declared, flag, False) is True and not callable(getattr(cls, method.partition("(")[0], None)):
            return f"which declares {flag}=True, but has no method {method}"
    return ""


EXPORTS = ("surrogate", "mechanism")
"""Objects that an exporter may support."""


def exporter_problem(cls: type) -> str:
    """Return the reason why a class is not an exporter, or an empty text."""
    suffix, supported = getattr(cls, "suffix", ""), getattr(cls, "exports", ())
    if type(suffix) is not str or not re.fullmatch(r"\.[a-z0-9][a-z0-9._-]*", suffix):
        return f"whose class attribute `suffix` is {suffix!r}; expected the ending of its files, such as '.fmu'"
    if not isinstance(supported, tuple) or not supported or not set(supported) <= set(EXPORTS):
        return f"whose class attribute `exports` is {supported!r}; expected a tuple with some of {EXPORTS}"
    return "" if hasattr(cls, "__dataclass_fields__") else "which is not a dataclass, whose fields would be its options"


def command_problem(cls: type) -> str:
    """Return the reason why a class is not a command, or an empty text."""
    name, text = getattr(cls, "name", ""), getattr(cls, "help", None)
    if not re.fullmatch("[a-z][a-z0-9]*(-[a-z0-9]+)*", name):
        return f"whose name {name!r} is not a word of lower-case letters, digits and hyphens"
    if type(text) is not str or not text.strip():
        return "whose class attribute `help` is not a description for `uqmbd --help`"
    return ""


KINDS = {
    "components": HookKind("uqmbd_components", "component", "uqmbd.Component", False),
    "propagators": HookKind("uqmbd_propagators", "propagator", "uqmbd.extend.Propagator", True),
    "integrators": HookKind(
        "uqmbd_integrators",
        "integrator",
        None,
        True,
        "",
        ("events", "projected"),
        ("auto", "ida", "dop853", "radau"),
        integrator_problem,
    ),
    "designs": HookKind(
        "uqmbd_designs",
        "sampling design",
        None,
        True,
        "points",
        ("independent", "extendable"),
        ("random", "latin-hypercube", "sobol", "halton"),
    ),
    "contact_laws": HookKind("uqmbd_contact_laws", "contact law", None, True, "law"),
    "readers": HookKind("uqmbd_readers", "reader of model files", None, True, "read"),
    "report_sections": HookKind("uqmbd_report_sections", "report section", None, False, "render"),
    "checks": HookKind("uqmbd_checks", "check of studies", None, False, "find"),
    "surrogates": HookKind("uqmbd_surrogates", "model of a surrogate", None, True, "evaluate"),
    "exporters": HookKind("uqmbd_exporters", "exporter", None, True, "export", (), (), exporter_problem),
    "commands": HookKind(
        "uqmbd_commands",
        "command",
        None,
        True,
        "run",
        (),
        ("run", "check", "animate", "export", "view", "plugins", "report", "compare", "new"),
        command_problem,
        COMMANDS_GROUP,
    ),
}


def plugin_manager() -> pluggy.PluginManager:
    """Return a plugin manager with the specifications of the hooks."""
    manager = pluggy.PluginManager("uqmbd")
    manager.add_hookspecs(_Hooks)
    return manager
