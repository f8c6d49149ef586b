"""The hooks that a plugin package may implement, and what the classes of each have in common."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from typing import NamedTuple

import pluggy

__all__ = ["COMMANDS_GROUP", "GROUP", "KINDS", "HookKind", "hookimpl", "integrator_problem", "plugin_manager"]

GROUP = "uqmbd"
"""Entry points of modules that implement hooks."""

COMMANDS_GROUP = "uqmbd.commands"
"""Entry points of modules that offer commands: they import nothing heavy, since `uqmbd --help` waits for them."""

hookimpl = pluggy.HookimplMarker("uqmbd")
"""Mark a function of a plugin as the implementation of the hook of its name."""

_hookspec = pluggy.HookspecMarker("uqmbd")


class _Hooks:
    """What a plugin may offer: each hook returns a sequence of classes, which may be empty."""

    @_hookspec
    def uqmbd_components(self) -> Sequence[type]:  # type: ignore[empty-body]  # a specification
        """Offer joints, drivers, springs: subclasses of `uqmbd.Component`, known by the name of the class."""

    @_hookspec
    def uqmbd_propagators(self) -> Sequence[type]:  # type: ignore[empty-body]  # a specification
        """Offer subclasses of `uqmbd.extend.Propagator`, known by their class attribute ``name``."""

    @_hookspec
    def uqmbd_integrators(self) -> Sequence[type]:  # type: ignore[empty-body]  # a specification
        """Offer time integrators, classes as `uqmbd.extend.Integrator` says, known by their class attribute ``name``.

        The class has a method ``integrate(ensemble, times, rtol)``, which returns `uqmbd.extend.Trajectories`.  What
        more it can it declares by class attributes, which are False where they are left out: ``events``, ``projected``,
        ``segments``, ``paced``, ``watched``, ``delegates``.  The core registers its own by this hook.
        """

    @_hookspec
    def uqmbd_designs(self) -> Sequence[type]:  # type: ignore[empty-body]  # a specification
        """Offer sampling designs: classes like `uqmbd.extend.SamplingDesign`, known by their attribute ``name``.

        The core registers its own by this hook.
        """

    @_hookspec
    def uqmbd_contact_laws(self) -> Sequence[type]:  # type: ignore[empty-body]  # a specification
        """Offer laws of contact with a name: classes made without arguments, known by their attribute ``name``.

        The method ``law()`` returns the law that contacts use for ``law="name"``.
        """

    @_hookspec
    def uqmbd_readers(self) -> Sequence[type]:  # type: ignore[empty-body]  # a specification
        """Offer readers of model files, known by their class attribute ``name``, the format, such as ``"urdf"``.

        The class is made without arguments; its method ``read(path, **options)`` returns
        `uqmbd.extend.ImportedMechanism`.
        """

    @_hookspec
    def uqmbd_report_sections(self) -> Sequence[type]:  # type: ignore[empty-body]  # a specification
        """Offer sections of the HTML report, as `uqmbd.report.Section` says, made without arguments."""

    @_hookspec
    def uqmbd_checks(self) -> Sequence[type]:  # type: ignore[empty-body]  # a specification
        """Offer checks of studies, classes made without arguments, known by the name of the class.

        The method ``find(study)`` returns an iterable of `uqmbd.extend.Finding`.  The core registers its own by this
        hook.
        """

    @_hookspec
    def uqmbd_surrogates(self) -> Sequence[type]:  # type: ignore[empty-body]  # a specification
        """Offer models of surrogates, classes as `uqmbd.extend.SurrogateModel` says, known by their attribute ``name``.

        Results store this name and the arrays of the model; they are read again by the registered class.
        """

    @_hookspec
    def uqmbd_commands(self) -> Sequence[type]:  # type: ignore[empty-body]  # a specification
        """Offer commands of the command line, classes as `uqmbd.extend.Command` says, made without arguments.

        The module that implements it is named in the entry-point group ``uqmbd.commands``.
        """


class HookKind(NamedTuple):
    """What the classes of one hook have in common."""

    hook: str
    noun: str
    base: str | None
    by_attribute: bool
    method: str = ""
    flags: tuple[str, ...] = ()
    """Class attributes that are True or False, and False where they are left out."""
    reserved: tuple[str, ...] = ()
    """Names of what the core itself offers."""
    problem: Callable[[type], str] | None = None
    """What else keeps a class from being one of them, or nothing."""
    group: str = GROUP
    """Entry points whose modules may implement the hook."""


INTEGRATOR_METHODS = {
    "projected": "integrate_projected(projected, times, rtol)",
    "segments": "integrate_segments(ensemble, times, rtol)",
}
"""What an integrator has that declares a capability."""


def integrator_problem(cls: type) -> str:
    """Return what keeps a class from being an integrator, or nothing."""
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


def command_problem(cls: type) -> str:
    """Return what keeps a class from being a command, or nothing."""
    name, text = getattr(cls, "name", ""), getattr(cls, "help", None)
    if not re.fullmatch("[a-z][a-z0-9]*(-[a-z0-9]+)*", name):
        return f"whose name {name!r} is no word of small letters, digits and hyphens"
    if type(text) is not str or not text.strip():
        return "whose class attribute `help` is not a text that says what it does, which `uqmbd --help` shows"
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
        ("auto", "ida", "dop853"),
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
    "commands": HookKind(
        "uqmbd_commands",
        "command",
        None,
        True,
        "run",
        (),
        ("run", "check", "animate", "plugins", "report", "compare", "new"),
        command_problem,
        COMMANDS_GROUP,
    ),
}


def plugin_manager() -> pluggy.PluginManager:
    """Make a manager that knows the hooks."""
    manager = pluggy.PluginManager("uqmbd")
    manager.add_hookspecs(_Hooks)
    return manager
