"""Docstrings of what is public tell what there is to know: parameters, what comes back, errors, units, an example.

They are read as numpydoc has them.  Its own validation is not used: it is of the extra ``docs``, which tests do not
have, and it knows neither fields that are told below their line nor methods that are told where they are inherited from.
"""

from __future__ import annotations

import ast
import dataclasses
import doctest
import functools
import inspect
import re
import sys
import textwrap
from pathlib import Path

import pytest

import uqmbd

ROOT = Path(__file__).parents[1]
sys.path.insert(0, str(ROOT / "docs" / "_ext"))
try:
    from uqmbd_site.names import CORE, PLUGINS, kind, owners, public_names, returned
finally:
    sys.path.remove(str(ROOT / "docs" / "_ext"))

SECTIONS = "Parameters Attributes Returns Yields Raises Warns Notes References Examples".split()

NO_CLASSES = {"uqmbd.typing.Distribution"}
"""Names of types of others: `typing.Any` is told where it is assigned."""

EXAMPLES_OF_METHODS = (
    "Study",
    "Mechanism",
    "Frame",
    "Surrogate",
    *(x for x in dir(uqmbd.results) if x.endswith("Chaos")),
)
"""Classes that users call: their methods have examples of their own, those of others are shown by their class."""

UNITS = {
    "s": r"(time|times|wall_time|seconds|begin|origin|longest|largest_step|max_step)",
    "rad": r"(angle|phase|phases)",
    "kg": r"mass",
    "m/s^2": r"gravity",
}
"""Parameters and fields of these names have these units, which their description says, or whose they are."""


INTERNALS = (
    "plugins/uqmbd_calibration",
    "plugins/uqmbd_collocation",
    "plugins/uqmbd_contact",
    "plugins/uqmbd_drivers",
    "plugins/uqmbd_fmi",
    "plugins/uqmbd_geometry",
    "plugins/uqmbd_galerkin",
    "plugins/uqmbd_joints",
    "plugins/uqmbd_models",
    "plugins/uqmbd_montecarlo",
    "plugins/uqmbd_processes",
    "plugins/uqmbd_flexible",
    "plugins/uqmbd_pytest",
    "plugins/uqmbd_reliability",
    "plugins/uqmbd_springs",
    "uqmbd",
)
"""Folders in which names that are not public have short docstrings, without sections."""


RETURNED = frozenset(returned())


def _public():
    """Every public class and function by its full name, and the classes that only functions return."""
    found = {}
    for module in (*CORE, *PLUGINS):
        for name, thing in public_names(module).items():
            if kind(thing) != "data" and f"{module}.{name}" not in NO_CLASSES:
                found.setdefault(id(thing), (f"{module}.{name}", thing))
    for cls in RETURNED:
        found[id(cls)] = (f"{cls.__module__}.{cls.__qualname__}", cls)
    return dict(sorted(found.values()))


PUBLIC = _public()
CLASSES = {name: x for name, x in PUBLIC.items() if inspect.isclass(x)}


def _plain(member):
    """The function of a method, a property or a cached property; else nothing."""
    if isinstance(member, (classmethod, staticmethod)):
        member = member.__func__
    if isinstance(member, property):
        return member.fget
    if isinstance(member, functools.cached_property):
        return member.func
    return inspect.unwrap(member) if inspect.isfunction(member) else None


def _methods():
    """Public methods of public classes by their full name, without properties and what a base has told."""
    found = {}
    for name, cls in {**CLASSES, "uqmbd.results.Surrogate": uqmbd.results.PolynomialChaos.__mro__[1]}.items():
        for owner, key, member in ((x, *item) for x in owners(cls) for item in vars(x).items()):
            inherited = any(key in vars(base) for base in owner.__mro__[1:] if base.__module__.startswith("uqmbd"))
            ours = not key.startswith("_") and not isinstance(member, (property, functools.cached_property))
            if ours and not inherited and _plain(member) is not None and not _of_sympy(cls, key):
                found[f"{name}.{key}"] = member
    return found


def _of_sympy(cls, key):
    return any(hasattr(base, key) for base in cls.__mro__[1:] if base.__module__.startswith("sympy"))


METHODS = _methods()
FUNCTIONS = {name: x for name, x in PUBLIC.items() if not inspect.isclass(x)}


def sections(text):
    """The sections of a docstring: names to what stands below."""
    heads = "|".join(SECTIONS)
    parts = re.split(rf"^({heads})\n-+\n", inspect.cleandoc(text or ""), flags=re.M)
    return {"": parts[0], **dict(zip(parts[1::2], parts[2::2], strict=True))}


def told(body):
    """Names and descriptions that a section of parameters or fields tells; ``a, b : float`` tells two."""
    found, names = {}, []
    for line in body.splitlines():
        if line.strip() and not line.startswith(" "):
            names = [name.strip().lstrip("*") for name in line.split(" : ")[0].split(",")]
            found |= dict.fromkeys(names, line.partition(" : ")[2])
        else:
            found |= {name: f"{found[name]} {line.strip()}" for name in names}
    return found


def arguments(function):
    """Names of what a function takes, without ``self``."""
    names = [p.name for p in inspect.signature(function).parameters.values() if not p.name.startswith("_")]
    return [name for name in names if name not in ("self", "cls")]


def fields_told_below(cls):
    """Fields of a class that a text stands below, as sphinx reads it."""
    body = ast.parse(textwrap.dedent(inspect.getsource(cls))).body[0].body
    pairs = zip(body, body[1:], strict=False)
    return {
        a.target.id
        for a, b in pairs
        if isinstance(a, ast.AnnAssign) and isinstance(b, ast.Expr) and isinstance(b.value, ast.Constant)
    }


def constructor(cls):
    """What is given where an object is made, of classes that are made by name."""
    if issubclass(cls, (BaseException, uqmbd.Component)) or getattr(cls, "_is_protocol", False) or cls in RETURNED:
        return []
    if dataclasses.is_dataclass(cls):
        return [f.name for f in dataclasses.fields(cls) if f.init and not f.name.startswith("_")]
    taken = arguments(vars(cls)["__init__"]) if "__init__" in vars(cls) else []
    return [name for name in taken if name not in ("args", "kwargs")]


def test_examples_are_read():
    """The rules below find what is wrong with this function, so that they can fail."""

    def bad(length, other):
        """Do it.

        Parameters
        ----------
        length : float
            m.
        third : float
        """
        raise uqmbd.StudyError("no")

    assert unlike(bad, bad.__doc__) == (["other"], ["third"]) and raises(bad) == {"StudyError"}


@pytest.mark.parametrize("name", PUBLIC)
def test_every_public_class_and_function_has_an_example(name):
    assert doctest.DocTestParser().get_examples(inspect.getdoc(PUBLIC[name]) or ""), "no doctest"


def test_methods_that_users_call_have_examples():
    wanted = [name for name in METHODS if name.split(".")[-2] in EXAMPLES_OF_METHODS]
    assert len(wanted) > 10
    assert [name for name in wanted if ">>>" not in (inspect.getdoc(METHODS[name]) or "")] == []


def unlike(function, text):
    """What a function takes and its docstring does not tell, and what it tells and the function does not take."""
    known, taken = told(sections(text).get("Parameters", "")), arguments(function)
    return [name for name in taken if name not in known], [name for name in known if name not in taken]


def test_functions_tell_their_parameters_and_no_others():
    wrong = {name: found for name, x in FUNCTIONS.items() if any(found := unlike(x, inspect.getdoc(x)))}
    assert wrong == {}


def test_methods_tell_their_parameters_and_no_others():
    """One with a single parameter may tell it in its sentence."""
    wrong = {}
    for name, member in METHODS.items():
        function = _plain(member)
        text = inspect.getdoc(function)
        if (len(arguments(function)) > 1 or "Parameters" in sections(text)) and any(found := unlike(function, text)):
            wrong[name] = found
    assert wrong == {}


def test_classes_tell_what_they_are_made_of():
    wrong = {}
    for name, cls in CLASSES.items():
        found = sections(inspect.getdoc(cls))
        known = told(found.get("Parameters", "")) | told(found.get("Attributes", ""))
        missing = set(constructor(cls)) - set(known)
        missing -= fields_told_below(cls) if missing else set()
        wrong |= {name: missing} if missing else {}
    assert wrong == {}


def gives(function):
    """Whether a function returns something, by its annotation."""
    stated = inspect.signature(function).return_annotation
    return stated not in (None, "None", inspect.Signature.empty)


def test_functions_and_methods_tell_what_they_return():
    """In a section, or in the first sentence: ``Return the ...``; that of a method without sections says what it is."""
    wrong = []
    for name, member in {**FUNCTIONS, **METHODS}.items():
        function = inspect.unwrap(member) if name in FUNCTIONS else _plain(member)
        found = sections(inspect.getdoc(function))
        first = re.match(r"\s*(Return|Yield|Whether|How many|Say|Tell)", found[""])
        whole = name in FUNCTIONS or "Parameters" in found
        if whole and gives(function) and not {"Returns", "Yields"} & set(found) and not first:
            wrong.append(name)
    assert wrong == []


def raises(function):
    """Errors of uqmbd that a function raises itself."""
    tree = ast.parse(textwrap.dedent(inspect.getsource(function)))
    calls = [node.exc for node in ast.walk(tree) if isinstance(node, ast.Raise) and isinstance(node.exc, ast.Call)]
    names = {ast.unparse(call.func).rpartition(".")[2] for call in calls}
    return {name for name in names if isinstance(getattr(uqmbd, name, None), type)}


def test_errors_are_reported():
    wrong = {}
    for name, member in {**FUNCTIONS, **METHODS}.items():
        function = inspect.unwrap(member) if name in FUNCTIONS else _plain(member)
        silent = {x for x in raises(function) if x not in sections(inspect.getdoc(function)).get("Raises", "")}
        wrong |= {name: silent} if silent else {}
    for name, cls in CLASSES.items():
        made = [vars(cls)[key] for key in ("__init__", "__post_init__") if inspect.isfunction(vars(cls).get(key))]
        made = [function for function in made if inspect.unwrap(function).__code__.co_filename != "<string>"]
        text = sections(inspect.getdoc(cls)).get("Raises", "")
        silent = {x for function in made for x in raises(inspect.unwrap(function)) if x not in text}
        wrong |= {name: silent} if silent else {}
    assert wrong == {}


def test_times_angles_and_masses_have_units():
    wrong = {}
    for name, member in {**PUBLIC, **METHODS}.items():
        found = sections(inspect.getdoc(member))
        for key, text in (told(found.get("Parameters", "")) | told(found.get("Attributes", ""))).items():
            for unit, names in UNITS.items():
                said = rf"(?<![\w/^]){re.escape(unit)}(?![\w/^])|units of|in seconds|^int|of int|as (for|of) "
                if re.fullmatch(names, key) and not re.search(said, text, re.I):
                    wrong[f"{name}: {key}"] = text
    assert wrong == {}


def _documented_names():
    """Return (module, qualified name) of public names, of classes that they return, and of the bases of all these."""
    found = set()
    for thing in PUBLIC.values():
        members = thing.__mro__ if inspect.isclass(thing) else (inspect.unwrap(thing),)
        found |= {(x.__module__, x.__qualname__) for x in members}
    return found


def with_sections(tree, public):
    """Return the qualified names in a module that are not public and whose docstrings have sections."""

    def visit(node, prefix, inside):
        for child in getattr(node, "body", []):
            if isinstance(child, (ast.FunctionDef, ast.AsyncFunctionDef, ast.ClassDef)):
                name = prefix + child.name
                exempt = name in public or (inside and not child.name.startswith("_"))
                if not exempt and set(sections(ast.get_docstring(child))) != {""}:
                    yield name
                yield from visit(child, f"{name}.", exempt and isinstance(child, ast.ClassDef))

    return list(visit(tree, "", False))


def test_sections_of_internals_are_found():
    text = '"""Do it.\n\n    Parameters\n    ----------\n    x : float\n    """'
    tree = ast.parse(f"class A:\n    {text}\n    def f():\n        {text}\n    def _g():\n        {text}\n")
    assert with_sections(tree, set()) == ["A", "A.f", "A._g"] and with_sections(tree, {"A"}) == ["A._g"]


@pytest.mark.parametrize("folder", INTERNALS)
def test_docstrings_of_internals_have_no_sections(folder):
    base, public, wrong = ROOT / "plugins" if folder.startswith("plugins/") else ROOT, _documented_names(), {}
    paths = [path for path in sorted((ROOT / folder).rglob("*.py")) if "templates" not in path.parts]
    assert paths
    for path in paths:
        module = ".".join(path.relative_to(base).with_suffix("").parts).removesuffix(".__init__")
        known = {name for home, name in public if home == module}
        found = with_sections(ast.parse(path.read_text("utf-8")), known)
        wrong |= {module: found} if found else {}
    assert wrong == {}
