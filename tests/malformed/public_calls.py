"""Which public names are called with hostile values: by examples of docstrings, and by those of `right_calls`."""

from __future__ import annotations

import ast
import doctest
import enum
import inspect
import types
from collections.abc import Iterator
from typing import Any

import uqmbd

from .right_calls import EXAMPLES
from .test_text_is_not_run import CORE, PLUGINS, kind, owners, public_names

__all__ = ["LEFT_OUT", "METHODS", "MODULES", "NOT_TRIED", "called", "examples_of", "targets", "unreached"]

METHODS = (types.FunctionType, classmethod, staticmethod)

MODULES = [x for x in (*CORE, *PLUGINS) if x not in ("uqmbd.testing", "uqmbd.typing")]
"""The kits of `uqmbd.testing` take classes and run studies with them."""

MADE = "uqmbd makes it from what was checked; users and plugins read it"
STEPS = "integrators call it at every step, with arrays that uqmbd made"
HOOK = "a plugin writes it and uqmbd calls it"
SYMPY = "SymPy calls it, or it always refuses"
SPACE = "uqmbd calls it with coordinates of bodies"
FILES = "tests of damaged files try it"

LEFT_OUT = {
    **dict.fromkeys(("Ensemble", "ProjectedEquations", "PhaseMotion"), STEPS),
    **dict.fromkeys(("Planar", "Spatial", "Space", "_Turnless"), SPACE),
    **dict.fromkeys(("NamedFrame", "Local", "JointAngle", "FlexibleBody"), MADE),
    **dict.fromkeys(
        ("ElementRefinement", "Margins", "MechanismTerms", "Problem", "ProblemData", "Realisations", "Reduced"), MADE
    ),
    **dict.fromkeys(("Reductions", "Allocation", "Calibration", "MotionPolynomials"), MADE),
    **dict.fromkeys(
        ("Propagator", "MonteCarlo", "Collocation", "Galerkin", "Reliability", "Calibrated", "CommonPaths"), HOOK
    ),
    "Accessor": "xarray makes it, of its own data",
    **dict.fromkeys(("Symbolic", "step"), SYMPY),
    "SampleStore": FILES,
    "BodyShape": "its subclasses are called",
}
"""Classes whose constructor, or whose methods that no example calls, are not tried, and why."""

IPYTHON = "IPython calls it with its own shell"

NOT_TRIED = {
    **dict.fromkeys(("Ensemble.rates", "Ensemble.outputs", "PhaseMotion.at", "PhaseMotion.rates"), STEPS),
    "Verification.of": MADE,
    **dict.fromkeys(("load_ipython_extension", "unload_ipython_extension"), IPYTHON),
}
"""Functions and methods that are not tried although examples call them, and why."""


def examples_of(thing: Any) -> Iterator[tuple[Any, str]]:
    """Yield a public object and its public methods and properties that have examples, with these."""
    own = [x for owner in owners(thing) for x in vars(owner).items()] if isinstance(thing, type) else ()
    for owner in (thing, *(x for k, x in own if not k.startswith("_") and isinstance(x, (*METHODS, property)))):
        text = inspect.cleandoc(getattr(owner, "__doc__", "") or "")
        if ">>>" in text:
            yield owner, text


def targets() -> dict[str, tuple[str, str]]:
    """Return public functions, classes and methods by their full name, each with its class and what a call names.

    Exceptions, protocols, enumerations and components are none: components have a sweep of their own.  Methods without
    arguments are none either.
    """
    found = {}
    for module in MODULES:
        for name, thing in public_names(module).items():
            if kind(thing) == "function" and name not in NOT_TRIED:
                found[f"{thing.__module__}.{thing.__qualname__}"] = ("", name)
            if kind(thing) != "class" or getattr(thing, "_is_protocol", False):
                continue
            if issubclass(thing, (enum.Enum, uqmbd.Component)):
                continue
            found[f"{thing.__module__}.{thing.__qualname__}"] = (thing.__name__, name)
            for base in thing.__mro__:
                if base.__module__.startswith("uqmbd"):
                    own = [k for k, x in vars(base).items() if not k.startswith("_") and _takes(x)]
                    own = [k for k in own if f"{base.__name__}.{k}" not in NOT_TRIED]
                    found |= {f"{base.__module__}.{base.__qualname__}.{k}": (base.__name__, k) for k in own}
    return found


def _takes(member: Any) -> bool:
    """Tell whether a member of a class is a method with arguments."""
    if not isinstance(member, METHODS):
        return False
    names = [*inspect.signature(getattr(member, "__func__", member)).parameters]
    return bool(names[0 if isinstance(member, staticmethod) else 1 :])


def called() -> set[str]:
    """Return the names that examples call, without what is before the last dot."""
    texts = [text for module in MODULES for x in public_names(module).values() for _, text in examples_of(x)]
    found = set()
    for text in (*texts, *EXAMPLES.values()):
        for example in doctest.DocTestParser().get_examples(text):
            for node in ast.walk(ast.parse(example.source)):
                if isinstance(node, ast.Call):
                    found.add(getattr(node.func, "attr", getattr(node.func, "id", "")))
    return found


def unreached() -> dict[str, str]:
    """Return the targets that no example calls, with their class."""
    names = called()
    return {full: owner for full, (owner, name) in targets().items() if name not in names}
