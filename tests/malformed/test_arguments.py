"""Arguments and labels that there cannot be are refused where they are given, before anything is computed."""

from __future__ import annotations

import enum
import functools
import inspect
from dataclasses import dataclass
from typing import ClassVar, Literal

import chaospy
import pytest

import uqmbd
from uqmbd import plugins
from uqmbd_joints import Revolute

from .public_calls import MADE
from .test_text_is_not_run import CORE, PLUGINS, public_names

PROPAGATORS = sorted(plugins.propagators())


def mechanism():
    return uqmbd.Mechanism("machine", uqmbd.Planar())


def study():
    made = mechanism()
    made.output("x", made.body("rod", mass=1, inertia=1).position[0])
    return uqmbd.Study("study", made, [0, 1])


CALLS = {
    "Mechanism": lambda **given: uqmbd.Mechanism("machine", **given),
    "Planar": lambda **given: uqmbd.Planar(**given),
    "Mechanism.body": lambda **given: mechanism().body("rod", **given),
    "Mechanism.output": lambda **given: mechanism().output("x", 1, **given),
    "RandomVariable": lambda **given: uqmbd.RandomVariable("length", **given),
    "random_vector": lambda **given: uqmbd.random_vector(["a", "b"], **given),
    "Study": lambda **given: uqmbd.Study("study", mechanism(), **given),
    "Study.run": lambda **given: study().run(**given),
    "Study.propagate": lambda **given: study().propagate(None, **given),
    "simulate": lambda **given: uqmbd.simulate(mechanism(), **given),
    "static_equilibrium": lambda **given: uqmbd.static_equilibrium(mechanism(), **given),
    "eigenfrequencies": lambda **given: uqmbd.eigenfrequencies(mechanism(), **given),
    "check": lambda **given: uqmbd.check(mechanism(), **given),
    "eigenfrequency": lambda **given: uqmbd.eigenfrequency(1, **given),
    "Frame.point": lambda **given: mechanism().body("rod", mass=1, inertia=1).point(**given),
    "Revolute": lambda **given: Revolute("pin", mechanism().ground, None, **given),
    **{name: functools.partial(lambda kind, **given: plugins.propagator(kind)(**given), name) for name in PROPAGATORS},
}
MISSPELT = {
    "Mechanism": ("spcae", "space"), "Planar": ("gravitiy", "gravity"), "Mechanism.body": ("angel", "angle"), "Mechanism.output": ("unit", "units"),
    "RandomVariable": ("distribtion", "distribution"), "random_vector": ("unit", "units"), "Study": ("time", "times"), "Study.run": ("worker", "workers"),
    "Study.propagate": ("worker", "workers"), "simulate": ("rtoll", "rtol"), "static_equilibrium": ("tmie", "time"), "eigenfrequencies": ("tmie", "time"),
    "check": ("tiem", "time"), "eigenfrequency": ("att", "at"), "Frame.point": ("locla", "local"), "Revolute": ("piont_i", "point_i"),
    **dict.fromkeys(PROPAGATORS, ("lable", "label")),
}  # fmt: skip


@pytest.mark.parametrize("what", CALLS)
def test_a_misspelt_argument_names_what_was_meant(what):
    wrong, meant = MISSPELT[what]
    with pytest.raises(uqmbd.StudyError) as caught:
        CALLS[what](**{wrong: 1})
    assert repr(wrong) in str(caught.value)
    assert f"did you mean {meant!r}?" in str(caught.value)


def test_missing_double_and_too_many_arguments_are_reported():
    with pytest.raises(uqmbd.StudyError, match=r"Mechanism.body: the argument 'name' is missing. Usage: body\(name,"):
        mechanism().body(mass=1)
    with pytest.raises(uqmbd.StudyError, match=r"simulate: the argument 'times' is missing"):
        uqmbd.simulate(mechanism())
    with pytest.raises(uqmbd.StudyError, match=r"'mass' is given twice, by position and by name"):
        mechanism().body("rod", 1, mass=1)
    with pytest.raises(uqmbd.StudyError, match=r"2 arguments are given by position; at most 1 fit. Usage: Planar\("):
        uqmbd.Planar(0, -9.81)
    with pytest.raises(uqmbd.StudyError, match=r"1 arguments are given by position; all must be given by name"):
        plugins.propagator("collocation")(3)


def test_signatures_and_documentation_are_those_of_the_functions():
    assert "angle" in inspect.signature(uqmbd.Mechanism.body).parameters
    assert uqmbd.Mechanism.body.__doc__.startswith("Add a rigid body")
    assert "rtol" in inspect.signature(uqmbd.Study).parameters


@pytest.mark.parametrize("label", ["..", ".", "", "a/b", "samples", "chaos", "time", "a\0b", "n" * 300, 3, b"a"])
@pytest.mark.parametrize("name", PROPAGATORS)
def test_a_label_that_cannot_name_results_is_refused_where_it_is_given(name, label):
    with pytest.raises(uqmbd.StudyError, match="label"):
        plugins.propagator(name)(label=label)


OPTIONS = {
    "monte-carlo": {"samples": 0.5, "seed": True, "sampling": ["random"], "max_failures": "0.1", "sobol_indices": 1, "keep": None},
    "collocation": {"order": "3", "index_set": "totl", "method": None, "tolerance": True, "level": 1.5, "adaptive": False, "verify": float("nan"), "elements": "adaptiv"},
    "galerkin": {"order": 2.0, "linear_solver": 3, "integrator": "dopri", "stop_at": "5 %", "transform": ["nataf"], "threshold": float("nan"), "samples": "many"},
}  # fmt: skip


@pytest.mark.parametrize(
    ("name", "option", "value"), [(n, o, v) for n, given in OPTIONS.items() for o, v in given.items()]
)
def test_an_option_of_another_type_is_refused_by_name(name, option, value):
    kind = plugins.propagator(name)
    with pytest.raises(uqmbd.StudyError, match=f"{kind.__name__}: {option} is .*[Ee]xpected"):
        kind(**{option: value})


def test_options_of_a_method_of_a_plugin_are_held_against_their_types():
    @dataclass(frozen=True, kw_only=True)
    class Mine(uqmbd.extend.Propagator):
        name: ClassVar[str] = "mine"
        level: int = 1
        kind: Literal["fast", "exact"] | None = None
        anything: object = None

        def propagate(self, problem):
            raise NotImplementedError

    assert Mine(level=2, kind="fast", anything=[1]).level == 2
    with pytest.raises(uqmbd.StudyError, match=r"Mine: level is 1.5; expected a whole number\."):
        Mine(level=1.5)
    with pytest.raises(
        uqmbd.StudyError, match=r"Mine: kind is 'fats'; did you mean 'fast'\? Expected one of .* or None\."
    ):
        Mine(kind="fats")


def test_a_name_that_stands_for_a_folder_is_refused():
    for name in (".", "..", "a\0b"):
        with pytest.raises(uqmbd.StudyError, match="name"):
            uqmbd.RandomVariable(name, chaospy.Normal(0, 1))


EARLY = "it is below the module that checks arguments"

UNCHECKED = {
    **dict.fromkeys(
        ("AtMost", "Bounds", "Finding", "require_package", "same_units", "typechecked", "propagator"), EARLY
    ),
    **dict.fromkeys(("Channel", "Local", "LinearSystem", "MechanismTerms", "MotionCommand", "PortableMotion"), MADE),
    **dict.fromkeys(("Ensemble", "MotionPolynomials", "PhaseMotion", "SummaryData", "ImportedMechanism"), MADE),
    **dict.fromkeys(("ElementRefinement", "Margins", "Problem", "Realisations", "Reduced", "Reductions"), MADE),
    **dict.fromkeys(("Allocation", "Exported", "FlexibleBody"), MADE),
    **dict.fromkeys(("Array", "Index", "Mask", "Markers", "Distribution"), "it is an annotation"),
    **dict.fromkeys(("BodyShape", "MJCF", "URDF"), "it is a base class, or a reader without options"),
    **dict.fromkeys(("load_ipython_extension", "unload_ipython_extension", "hookimpl"), "other packages call it"),
    "step": "SymPy calls it, and its own message states the arguments",
}
"""Public names whose calls with unknown arguments end with Python's own message, and why."""


def _callables():
    """Yield the public functions and classes of all modules that users and authors of plugins import."""
    for module in (*CORE, *PLUGINS):
        for name, thing in public_names(module).items():
            made = not isinstance(thing, type) or not issubclass(
                thing, (BaseException, enum.Enum, tuple, uqmbd.Component)
            )
            if callable(thing) and made and not getattr(thing, "_is_protocol", False):
                yield name, thing


def test_an_unknown_argument_of_every_public_name_is_refused_by_name():
    wrong, refused = {}, 0
    for name, thing in _callables():
        try:
            thing(misspelt_argument=1)
        except uqmbd.StudyError as error:
            refused += 1
            if "misspelt_argument" not in str(error) and name not in UNCHECKED:
                wrong[name] = str(error)
        except TypeError as error:
            if name not in UNCHECKED:
                wrong[name] = str(error)
    assert wrong == {}
    assert refused > 200
