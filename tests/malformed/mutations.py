"""Malformed studies: a valid one in which a single argument of one call is wrong, with what must happen to it."""

from __future__ import annotations

import contextlib
import dataclasses
import decimal
import fractions
import functools
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

import chaospy
import numpy as np
import sympy

import uqmbd
from uqmbd import plugins

from .studies import BASES, component

Fate = Literal["refused", "computed", "either"]
"""``refused``: a `StudyError`; ``either``: that, another error of uqmbd, or a result; nothing else ever."""


@dataclass(frozen=True)
class Case:
    """A study in which one keyword of one call is another one.

    Attributes
    ----------
    base, key, argument : str
        Which study, call and keyword.
    label : str
        What is given instead.
    value : callable
        Makes it from what the study has made so far, a dict by key.
    fate : {"refused", "computed", "either"}
    words : tuple of str
        What the message must contain.
    """

    base: str
    key: str
    argument: str
    label: str
    value: Callable[[dict[str, Any]], Any]
    fate: Fate = "refused"
    words: tuple[str, ...] = ()

    @property
    def name(self) -> str:
        return f"{self.base} | {self.key} | {self.argument} | {self.label}"

    def study(self) -> uqmbd.Study:
        """Build the study, and leave the computation to somebody else; whatever is refused on the way is raised."""
        found: list[uqmbd.Study] = []
        with contextlib.suppress(Built):
            self.run(instead=lambda made: found.append(made["Study"]))
        return found[0]

    def run(self, instead: Callable[[dict[str, Any]], None] | None = None) -> None:
        """Build and compute the study; or do something else with what was made, instead of a run."""
        made: dict[str, Any] = {}
        changed = []

        def call(key: str, function: Callable[..., Any], **keywords: Any) -> Any:
            if key == self.key:
                changed.append(key)
                value = self.value({**made, **keywords})
                if value is LEFT_OUT:
                    keywords.pop(self.argument)
                else:
                    keywords[self.argument] = value
            if key == "run" and instead is not None:
                instead(made)
                raise Built
            made[key] = function(**keywords)
            return made[key]

        BASES[self.base](call)
        assert changed, f"{self.base} makes no call {self.key}"


class Built(Exception):
    """A study is there, and shall not be computed here."""


LEFT_OUT = object()
x = sympy.Symbol("x")
f = sympy.Function("f")


class Nothing:
    """An object without any meaning."""

    def __repr__(self) -> str:
        return "<nothing>"


def random(low: float = 0.9, high: float = 1.1) -> uqmbd.RandomVariable:
    return uqmbd.RandomVariable("other", chaospy.Uniform(low, high))


def other_mechanism() -> uqmbd.Mechanism:
    mechanism = uqmbd.Mechanism("elsewhere", uqmbd.Planar())
    mechanism.body("stranger", mass=1, inertia=1)
    return mechanism


def moving(made: dict[str, Any]) -> Any:
    """Return a quantity that moves, of this mechanism if it has a body yet."""
    body = next((v for v in made.values() if isinstance(v, uqmbd.mechanism.Body)), None)
    return (body or other_mechanism().bodies["stranger"]).position[0]


def fixed(value: Any) -> Callable[[dict[str, Any]], Any]:
    return lambda made: value


NO_NUMBERS: dict[str, Any] = {
    "a text": fixed("0.3"),
    "bytes": fixed(b"0.3"),
    "True": fixed(True),
    "NumPy's true": fixed(np.True_),
    "an empty list": fixed([]),
    "nan": fixed(float("nan")),
    "inf": fixed(float("inf")),
    "SymPy's nan": fixed(sympy.nan),
    "SymPy's zoo": fixed(sympy.zoo),
    "complex": fixed(1j),
    "an imaginary expression": fixed(sympy.sqrt(-2)),
    "a dict": fixed({"a": 1}),
    "an object": fixed(Nothing()),
    "a class": fixed(dict),
    "a function": fixed(np.sin),
    "a foreign symbol": fixed(sympy.Symbol("k")),
    "an undefined function": fixed(f(1)),
    "an undefined function of time": fixed(f(uqmbd.t)),
    "an integral": fixed(sympy.Integral(sympy.exp(-(x**2)), (x, 0, random()))),
    "an integral that does not exist": fixed(sympy.Integral(1 / x, (x, 0, 1))),
    "a derivative": fixed(sympy.Derivative(f(x), x)),
    "a limit": fixed(sympy.Limit(f(x), x, 0)),
    "a relation": fixed(x > 0),
    "a set": fixed({1.0}),
    "a mode": fixed(uqmbd.eigenfrequency(1)),
    "too large an integer": fixed(10**400),
    "a matrix": fixed(sympy.eye(2)),
    "a ragged list": fixed([1, [2, 3]]),
    "a path": fixed(Path("a")),
    "an object array": fixed(np.array([None, "a"], dtype=object)),
    "a distribution": fixed(chaospy.Normal(1, 0.1)),
    "a matrix symbol": fixed(sympy.MatrixSymbol("A", 2, 2)),
    "an order": fixed(sympy.O(x)),
    "a special function that is not compiled": fixed(sympy.besselj(random(), x)),
}
"""What is no number, wherever one is expected."""

MOVING: dict[str, Any] = {"time": fixed(uqmbd.t), "a position": moving}
"""What is no number where nothing moves."""

PECULIAR: dict[str, Any] = {
    "a fraction": fixed(fractions.Fraction(1, 3)),
    "a decimal": fixed(decimal.Decimal("0.5")),
    "a float of 32 bits": fixed(np.float32(0.5)),
    "an array of no dimension": fixed(np.array(0.5)),
    "a random variable": fixed(random()),
    "an error function": fixed(sympy.erf(random())),
    "a definite integral": fixed(sympy.Integral(sympy.exp(-(x**2)), (x, 0, 1))),
    "a sum without end": fixed(sympy.Sum(1 / x**3, (x, 1, sympy.oo))),
}
"""Numbers of unusual types."""

EXTREME: dict[str, Any] = {
    "1e-320": fixed(1e-320),
    "1e-150": fixed(1e-150),
    "-1e-150": fixed(-1e-150),
    "1e150": fixed(1e150),
    "1e300": fixed(1e300),
    "-1e300": fixed(-1e300),
    "-1": fixed(-1),
    "0": fixed(0),
    "1e-20": fixed(1e-20),
    "a logarithm of a negative number": fixed(sympy.log(random() - 5)),
    "a pole": fixed(1 / (random() - 1)),
}
"""Numbers that may or may not be usable."""

NOT_TEXTS: dict[str, Any] = {
    "None": fixed(None), "a number": fixed(3), "bytes": fixed(b"a"), "a list": fixed(["a"]), "an object": fixed(Nothing()),
    "a symbol": fixed(sympy.Symbol("a")),
}  # fmt: skip
NO_NAMES: dict[str, Any] = {**NOT_TEXTS, "empty": fixed(""), "blank": fixed(" \t"), "a slash": fixed("a/b"), "time": fixed("time"), "a dot": fixed("."), "two dots": fixed(".."), "a null": fixed("a\0b")}  # fmt: skip
NO_FLAGS: dict[str, Any] = {
    "None": fixed(None), "one": fixed(1), "yes": fixed("yes"), "a list": fixed([]), "an array": fixed(np.array([True, False])),
}  # fmt: skip
NO_COUNTS: dict[str, Any] = {
    "None": fixed(None), "negative": fixed(-1), "a half": fixed(1.5), "a text": fixed("3"), "True": fixed(True), "nan": fixed(float("nan")),
    "a list": fixed([3]), "an array": fixed(np.array([3, 4])), "a random variable": fixed(random()), "an object": fixed(Nothing()),
}  # fmt: skip
NO_CHOICES: dict[str, Any] = {
    "misspelt": fixed("atuo"), "a number": fixed(3), "a list": fixed(["auto"]), "a dict": fixed({}), "True": fixed(True), "an array": fixed(np.array(["auto", "ida"])),
    "an object": fixed(Nothing()),
}  # fmt: skip
NO_SHARES: dict[str, Any] = {
    "None": fixed(None), "negative": fixed(-0.1), "a text": fixed("0.1"), "True": fixed(True), "nan": fixed(float("nan")), "inf": fixed(float("inf")), "a list": fixed([0.1]),
    "an array": fixed(np.array([0.1, 0.2])), "a random variable": fixed(random()), "complex": fixed(0.1j),
}  # fmt: skip
NO_BODIES: dict[str, Any] = {
    "None": fixed(None), "a name": fixed("rod"), "a number": fixed(1), "a class": fixed(uqmbd.mechanism.Body), "a list": fixed([]),
    "a body elsewhere": lambda made: other_mechanism().bodies["stranger"], "the ground elsewhere": lambda made: other_mechanism().ground,
}  # fmt: skip
NO_DISTRIBUTIONS: dict[str, Any] = {
    "None": fixed(None), "a number": fixed(1.0), "a text": fixed("normal"), "a class": fixed(chaospy.Normal), "a list": fixed([chaospy.Normal(0, 1)]),
    "two dimensions": fixed(chaospy.J(chaospy.Normal(0, 1), chaospy.Normal(0, 1), chaospy.Normal(0, 1))),
}  # fmt: skip
NO_TIMES: dict[str, Any] = {
    "a number": fixed(1.0), "one": fixed([0.0]), "none": fixed([]), "a text": fixed("0, 1"), "texts": fixed(["a", "b"]), "descending": fixed([1, 0]), "equal": fixed([0, 0, 1]),
    "nan": fixed([0, float("nan")]), "inf": fixed([0, float("inf")]), "two dimensions": fixed([[0, 1], [2, 3]]), "complex": fixed([0, 1j]), "an object": fixed(Nothing()),
    "symbols": fixed([0, uqmbd.t]), "ragged": fixed([0, [1, 2]]), "truths": fixed([False, True]), "a dict": fixed({0: 1}),
}  # fmt: skip
PECULIAR_TIMES: dict[str, Any] = {
    "1e-150": fixed([0, 1e-150, 2e-150]), "1e-320": fixed([0, 1e-320]), "1e300": fixed([0, 1e300]), "late": fixed([1e17, 1e17 + 64]), "close": fixed([1.0, 1.0 + 3e-16, 2.0]),
    "negative": fixed([-0.01, 0.0]),
}  # fmt: skip


def _entries(values: dict[str, Any], good: Any) -> Iterator[tuple[str, Any]]:
    """Put each value in the place of the first entry of a vector."""
    for label, value in values.items():
        yield f"with {label}", lambda made, value=value: (value(made), *tuple(good)[1:])


def _vectors(size: int) -> dict[str, Any]:
    return {
        "too short": fixed((1.0,) * (size - 1)), "too long": fixed((1.0,) * (size + 1)), "nested": fixed(((1.0,) * size, (1.0,) * size)),
        "a number": fixed(2.0), "a text": fixed("1, 2"), "a dict": fixed({k: 1.0 for k in range(size)}), "a set": fixed(set(range(size))),
        "a generator": lambda made: (1.0 for _ in range(size)), "an object": fixed(Nothing()), "None in it": fixed((None,) * size),
        "truths": fixed((True,) * size), "texts": fixed(("a",) * size),
    }  # fmt: skip


def _values(key: str, argument: str, good: Any) -> Iterator[tuple[str, Any, Fate]]:
    """Yield what to give an argument instead, and what must become of it."""

    def all_of(values: dict[str, Any], fate: Fate = "refused") -> Iterator[tuple[str, Any, Fate]]:
        for label, value in values.items():
            yield label, value, fate

    kind = _kind(key, argument)
    if key in METHODS and good is None:
        yield from ((label, value, fate) for label, value, fate in _values("", argument, 1) if label != "None")
        return
    match kind:
        case "name":
            yield from all_of(NO_NAMES)
            yield "very long", fixed("n" * 5000), "either"
            yield "lines", fixed("a\nb"), "either"
        case "polynomials":
            yield from all_of(_WRONG)
        case "units":
            yield from all_of(NOT_TEXTS)
        case "flag":
            yield from all_of(NO_FLAGS)
        case "body":
            yield from all_of(NO_BODIES)
        case "distribution":
            yield from all_of(NO_DISTRIBUTIONS)
        case "times":
            yield from all_of(NO_TIMES)
            yield from all_of(PECULIAR_TIMES, "either")
        case "count":
            yield from all_of(NO_COUNTS)
        case "share":
            yield from all_of(NO_SHARES)
        case "choice":
            yield from all_of(NO_CHOICES)
        case "law":
            yield from all_of({k: v for k, v in NO_NUMBERS.items() if k not in ("an undefined function of time",)})
            yield from all_of({"time": MOVING["time"]} | EXTREME, "either")
            yield from all_of(PECULIAR, "either")
        case "number" | "driven" | "expression":
            yield from all_of({k: v for k, v in NO_NUMBERS.items() if kind != "expression" or k != "a mode"})
            if kind == "number":
                yield from all_of(MOVING)
            else:
                yield from all_of(MOVING, "either")
            yield from all_of(PECULIAR, "either")
            yield from all_of(EXTREME, "either")
        case "vector" | "driven vector":
            yield from all_of(_vectors(len(good)))
            modes = "a mode" if kind == "driven vector" else ""
            yield from (
                (label, value, "refused") for label, value in _entries(NO_NUMBERS, good) if label != f"with {modes}"
            )
            yield from (
                (label, value, "refused" if kind == "vector" else "either") for label, value in _entries(MOVING, good)
            )
            yield from ((label, value, "either") for label, value in _entries(PECULIAR | EXTREME, good))
            yield "zeros", fixed((0,) * len(good)), "either"
        case "body or none":
            yield from all_of({k: v for k, v in NO_BODIES.items() if k != "None"})
        case "counts":
            yield from all_of({k: v for k, v in NO_COUNTS.items() if k not in ("None", "an array", "a list")})
            yield from all_of({"an array": NO_COUNTS["an array"]}, "either")
        case "special":
            yield from SPECIAL[key, argument]
        case _:
            raise AssertionError(f"no kind of values for {argument} of {key}")


def _special(**values: Any) -> list[tuple[str, Any, Fate]]:
    return [
        (label.replace("_", " "), value if callable(value) else fixed(value), "refused")
        for label, value in values.items()
    ]


_WRONG = {"a number": fixed(1), "a text": fixed("a"), "None": fixed(None), "a class": fixed(uqmbd.Planar), "a list": fixed([]), "an object": fixed(Nothing())}  # fmt: skip

SPECIAL: dict[tuple[str, str], list[tuple[str, Any, Fate]]] = {
    ("Mechanism", "space"): [(k, v, "refused") for k, v in _WRONG.items()],
    ("add", "component"): [
        *((k, v, "refused") for k, v in _WRONG.items()),
        ("a component class", lambda made: component("Revolute"), "refused"),
        ("a body", lambda made: other_mechanism().bodies["stranger"], "refused"),
    ],
    ("random_vector", "names"): [
        (k, fixed(v), "refused")
        for k, v in {
            "a text": "ab", "one": ["a"], "three": ["a", "b", "c"], "twice": ["a", "a"], "numbers": [1, 2], "None": None, "a number": 2, "empty": [], "a dot": ["a", "."],
            "an object": Nothing(), "a slash": ["a/b", "c"],
        }.items()
    ],
    ("random_vector", "units"): [
        (k, fixed(v), "refused") for k, v in {"None": None, "a number": 2, "one": ["m"], "three": ["m"] * 3, "numbers": [1, 2], "an object": Nothing()}.items()
    ],
    ("random_vector", "distribution"): [(k, v, "refused") for k, v in NO_DISTRIBUTIONS.items()],
    ("simulate", "values"): [
        (k, fixed(v), "refused") for k, v in {"unknown": {"lenght": 1}, "a list": [1], "a number": 1.0, "a text": "length", "number as name": {1: 1.0}}.items()
    ],
    ("Study", "propagators"): [
        (k, fixed(v), "refused")
        for k, v in {"a text": "monte-carlo", "None": None, "a number": 1, "a list of texts": ["monte-carlo"], "a dict": {}, "an object": Nothing()}.items()
        if k != "a dict"
    ] + [("twice", lambda made: [plugins.propagator("monte-carlo")()] * 2, "refused"), ("a class in it", lambda made: [plugins.propagator("monte-carlo")], "refused")],
    ("Study", "report_times"): [
        (k, fixed(v), "refused") for k, v in {"outside": [5.0], "a number": 0.01, "a text": "0.01", "nan": [float("nan")], "None": None, "complex": [1j], "nested": [[0.0]], "an object": Nothing()}.items()
    ],
    ("Study", "convergence"): [
        (k, fixed(v), "refused")
        for k, v in {"a list": [], "a text": "yes", "a number": 1, "empty": {}, "True": True, "no levels": {"propagators": [plugins.propagator("monte-carlo")]},
                     "wrong levels": {"propagators": [plugins.propagator("monte-carlo")], "samples": "many"},
                     "unknown reference": {"propagators": [plugins.propagator("monte-carlo")], "samples": [4, 8], "reference": "nobody"},}.items()
    ],
    ("run", "only"): [(k, fixed(v), "refused") for k, v in {"unknown": ["nobody"], "a number": 3, "numbers": [3], "an object": Nothing(), "empty": []}.items()],
    ("run", "workers"): [(k, fixed(v), "refused") for k, v in {"zero": 0, "negative": -1, "a text": "2", "a half": 1.5, "None": None, "True": True, "an object": Nothing()}.items()],
    ("run", "progress"): [(k, fixed(v), "refused") for k, v in {"a text": "yes", "a number": 3, "an object": Nothing()}.items()],
    ("run", "folder"): [(k, fixed(v), "refused") for k, v in {"a number": 3, "an object": Nothing(), "a list": []}.items()],
}  # fmt: skip

KINDS: dict[str, str] = {
    "name": "name", "units": "units", "hold": "flag", "angle": "number", "mass": "number", "inertia": "number", "com": "vector", "position": "vector", "velocity": "vector",
    "angular_velocity": "number", "quaternion": "vector", "gravity": "driven vector", "local": "driven vector", "expression": "expression", "times": "times", "rtol": "share",
    "integrator": "choice", "start": "choice", "samples": "count", "seed": "count", "order": "count", "verify": "count", "label": "name", "distribution": "distribution",
    "number": "count", "at": "choice", "resume": "flag", "body_i": "body", "body_j": "body", "body": "body", "mechanism": "special",
    "carrier": "body or none", "sampling": "choice", "replicates": "count", "max_failures": "share", "keep": "count", "control": "choice", "sobol_indices": "flag",
    "index_set": "choice", "weights": "counts", "method": "choice", "rule": "choice", "nodes": "counts", "level": "count", "adaptive": "choice", "tolerance": "share", "max_error": "share",
    "max_realisations": "count", "elements": "count", "max_elements": "count", "threshold": "share", "alignment": "choice", "clock": "name", "transform": "choice", "linear_solver": "choice",
    "stop_at": "share", "expansion": "polynomials", "x": "law", "x0": "law", "y0": "law", "x1": "law", "y1": "law",
}  # fmt: skip


def _kind(key: str, argument: str) -> str:
    if (key, argument) in SPECIAL:
        return "special"
    if key in ("output", "angle", "reaction") and argument == "angle":
        return "flag"
    if key == "spatial body" and argument in ("inertia", "angular_velocity"):
        return "vector"
    if key == "event_time" and argument == "label":
        return "choice"
    if " in " in key:
        name, _, space = key.partition(" in ")
        parameter = component(name).parameters().get(argument)
        if parameter is not None:
            size = parameter.size(getattr(uqmbd, space)())
            if parameter.kind == "option":
                return "choice" if parameter.choices else "law"
            return "driven vector" if size > 1 else "driven"
    return KINDS[argument]


SPECIAL["Study", "mechanism"] = SPECIAL["simulate", "mechanism"] = [(k, v, "refused") for k, v in _WRONG.items()]
METHOD_NAMES = {"MonteCarlo": "monte-carlo", "Collocation": "collocation", "Galerkin": "galerkin"}
METHODS = set(METHOD_NAMES)
SKIPPED = {"mu", "sigma", "lower", "upper"}  # of chaospy, which refuses what it cannot use
OPTIONAL = {("Study", "convergence"), ("simulate", "values"), ("body", "velocity")}


@functools.cache
def cases() -> list[Case]:
    """All of them, in one order."""
    found = []
    for base in BASES:
        for key, keywords in calls(base).items():
            if " in " in base and key != base and not (key == "add" and base == "Revolute in Planar"):
                continue
            for argument, good in keywords.items():
                if argument in SKIPPED:
                    continue
                told = (
                    (key, argument) not in SPECIAL
                    and key not in ("step", "run")
                    and argument not in ("name", "label", "expression")
                )
                words = (argument,) if told else ()
                found += [
                    Case(
                        base,
                        key,
                        argument,
                        label,
                        value,
                        fate,
                        words if fate == "refused" and label != "a mode" else (),
                    )
                    for label, value, fate in _values(key, argument, good)
                ]
            if key != "step" and keywords:
                one = next(iter(keywords))
                wrong = next(iter([k for k in keywords if len(k) > 3] or keywords)) + "s"
                found.append(Case(base, key, wrong, "misspelt", fixed(1), "refused", (repr(wrong),)))
                if key not in ("run", "Translational", "Spatial", "Planar", "MonteCarlo", "Collocation", "Galerkin"):
                    found.append(Case(base, key, one, "left out", fixed(LEFT_OUT), "refused", ()))
    return found


def named(name: str) -> Case:
    """Return one of them."""
    return next(case for case in cases() if case.name == name)


def calls(base: str) -> dict[str, dict[str, Any]]:
    """Return the keywords of each call of a study, without computing it."""
    found: dict[str, dict[str, Any]] = {}

    class Enough(Exception):
        pass

    def call(key: str, function: Callable[..., Any], **keywords: Any) -> Any:
        found[key] = keywords
        if key in ("add",):
            raise Enough
        return None if key in ("run", "simulate") else function(**keywords)

    try:
        BASES[base](call)
    except Enough:
        pass
    for key in METHODS & found.keys():
        fields = dataclasses.fields(plugins.propagator(METHOD_NAMES[key]))
        found[key] = {field.name: found[key].get(field.name, field.default) for field in fields}
    return {key: value for key, value in found.items() if key not in ("Normal", "Uniform")}
