"""Arguments of public functions are what their annotations declare, and every public name is tried with other ones."""

from __future__ import annotations

import functools
import inspect
import math
import os
import sys
from collections.abc import Callable, Mapping, Sequence
from typing import Annotated, Any, Literal

import chaospy
import numpy as np
import pytest
import sympy
import xarray as xr
from numpy.typing import ArrayLike

import uqmbd
from uqmbd import extend, report, results
from uqmbd.arguments import NotNegativeOrInfinite, OrInfinite, OrNaN, ShareOrNaN, fits, members, typechecked
from uqmbd.typing import Array, Index
from uqmbd_calibration import Bias, Series
from uqmbd_collocation import Collocation
from uqmbd_models import MJCF, URDF

from .hostile import HOSTILE
from .public_calls import LEFT_OUT, targets, unreached


def test_every_public_name_is_called_by_an_example_or_left_out_with_a_reason():
    missing = unreached()
    assert [full for full, owner in missing.items() if owner not in LEFT_OUT] == []
    assert set(LEFT_OUT) <= set(missing.values())  # none is left out that is called
    assert all(LEFT_OUT.values())


OWN_BOUNDS = {
    "elements": "`ElementLimits` names the options of methods",
    "most": "`ElementLimits` names the options of methods",
    "exactness": "a rule for polynomials of other degrees has none",
    "workers": "`pool` takes executors, too",
    "count": "`Workers` names the options of commands",
    "keyframe": "the file says how many there are",
    "power": "units may have any power, negative ones too",
    "reason": "the results say which there are",
    **dict.fromkeys(("dimension", "order", "level", "counts"), "the function names the germ in its message"),
    "germ": "the space says how many there are",
}
"""Whole numbers that are bounded by the function, not by the annotation, and why."""


def _declared(full):
    """Return the arguments of a public call with what the gate judges them by; none where there is no gate."""
    module, _, place = full.rpartition(".")
    while module not in sys.modules:
        module, _, owner = module.rpartition(".")
        place = f"{owner}.{place}"
    found = sys.modules[module]
    for part in place.split("."):
        found = inspect.getattr_static(found, part)
    found = vars(found).get("__init__") if isinstance(found, type) else getattr(found, "__func__", found)
    return found.__kinds__() if hasattr(found, "__kinds__") else []


def test_all_annotations_can_be_read_and_whole_numbers_have_bounds():
    """Counts below zero, or of 400 digits, are refused where they are given."""
    judged = {full: _declared(full) for full in targets()}
    assert sum(map(bool, judged.values())) > 200
    unbounded = {
        f"{full}: {name}" for full, given in judged.items() for name, kind, *_ in given if int in members(kind)
    }
    assert {x for x in unbounded if x.rpartition(": ")[2] not in OWN_BOUNDS} == set()


NUMBERS = {"minus one", "zero", "1e307", "half"}
TEXTS = {"empty text", "text", "lines", "digits", "no units", "null", "surrogate"}
ROWS = {"empty list", "list", "range", "empty array"}

KINDS: dict[str, tuple[Any, set[str]]] = {
    "int": (int, {"minus one", "zero", "10**400"}),
    "bounded int": (Annotated[int, uqmbd.extend.Bounds(0, 10)], {"zero"}),
    "float": (float, NUMBERS),
    "float or NaN": (OrNaN, NUMBERS | {"nan"}),
    "float or infinite": (OrInfinite, NUMBERS | {"inf", "-inf"}),
    "share or NaN": (ShareOrNaN, {"zero", "half", "nan"}),
    "error": (NotNegativeOrInfinite, {"zero", "half", "1e307", "inf"}),
    "expression": (sympy.Expr, NUMBERS | {"foreign symbol", "unknown symbol"}),
    "share": (Annotated[float, uqmbd.extend.Bounds(0, 1)], {"zero", "half"}),
    "text": (str, TEXTS),
    "truth": (bool, {"True"}),
    "word": (Literal["text", "other"], {"text"}),
    "path": (str | os.PathLike[str], TEXTS - {"null"}),
    "none": (str | None, TEXTS | {"None"}),
    "mapping": (Mapping[str, xr.DataTree], {"empty dict"}),
    "row": (Sequence[float], ROWS),
    "texts": (Sequence[str], {"empty list", "empty array", "texts"}),
    "class": (xr.DataTree, set()),
    "function": (Callable[[], Any], {"class", "function", "raising"}),
    "numbers": (
        ArrayLike,
        NUMBERS | ROWS | {"nan", "inf", "-inf", "deep", "nan in list", "flat array", "four axes", "huge"},
    ),
    "array": (Array, {"empty array", "flat array", "four axes", "huge"}),
    "whole numbers": (Index, {"empty array", "flat array"}),
}
"""What each annotation allows of the hostile values, by hand."""


@pytest.mark.parametrize("name", KINDS)
def test_values_fit_the_annotations_that_they_should(name):
    annotation, allowed = KINDS[name]
    # a matrix of SymPy is an array of numbers where arrays are expected
    assert {key for key, value in HOSTILE.items() if fits(value, annotation)} - {"matrix"} == allowed


def test_rows_become_arrays_and_other_arguments_stay_as_they_are():
    @typechecked
    def shape(values: Array, other: Sequence[int] = ()) -> Any:
        return values.shape, other

    assert shape([[1.0, 2.0]], other := [1]) == ((1, 2), other)
    with pytest.raises(uqmbd.StudyError, match="values is .*; expected a NumPy array of numbers"):
        shape([[1.0], [1.0, 2.0]])


def _space():
    return uqmbd.extend.GermSpace.of(_mechanism().inputs)


def _mechanism():
    mechanism = uqmbd.Mechanism("m", uqmbd.Line())
    speed = uqmbd.RandomVariable("speed", chaospy.Uniform(1, 3))
    mechanism.body("b", mass=1, velocity=speed)
    return mechanism


def _arm():
    mechanism = uqmbd.Mechanism("m", uqmbd.Line())
    mechanism.body("b", mass=1)
    return mechanism


def _problem():
    mechanism = _mechanism()
    mechanism.output("x", mechanism.bodies["b"].position[0])
    study = uqmbd.Study("s", mechanism, [0, 1], [Collocation(order=1)])
    return study.problem(study.propagators[0])


def _study():
    mechanism = _mechanism()
    mechanism.output("x", mechanism.bodies["b"].position[0])
    return uqmbd.Study("s", mechanism, [0, 1], [Collocation(order=1)])


def _all(boxes):
    axes = extend.labels(["x"], ["speed"], [0.0])
    return [results.PolynomialChaos([[[2.0]], [[0.5]]], [[0], [1]], box.local, axes) for box in boxes]


def _chaos():
    axes = extend.labels(["x"], ["speed"], [0.0])
    return results.PolynomialChaos([[[2.0]], [[0.5]]], [[0], [1]], _space(), axes)


AXES = extend.labels(["x"], [], [0.0])

FINITE: dict[str, Callable[[Any], Any]] = {
    "turn": lambda x: extend.OutputInfo("x", "rad", x),
    "start": lambda x: extend.Clock("a", 0, 0.0, x),
    "nominal": lambda x: extend.Toleranced(x, 0.0, 1.0, 1.33, False, ""),
    "upper": lambda x: extend.Toleranced(0.0, -1.0, x, 1.33, False, ""),
    "cpk": lambda x: extend.Toleranced(0.0, -1.0, 1.0, x, False, ""),
    "lower": lambda x: results.Answer("m", "r", "", "", 0.5, x, 1.0, ""),
    "wall_time": lambda x: results.propagator_node(
        "m", extend.statistics_dataset(AXES, mean=[[0.0]], std=[[0.0]]), propagator="p", realisations=1, wall_time=x
    ),
    "seconds": lambda x: extend.Counters(seconds=x),
    "begin": lambda x: extend.Segment(x, 1.0, "", len),
    "time": lambda x: uqmbd.check(_arm(), x),
    "end": lambda x: extend.Phases(np.arange(3.0), np.arange(6.0).reshape(2, 3)).running(x),
    "mass": lambda x: extend.MassProperties(x, (0, 0), 1),
    "value": lambda x: uqmbd.Parameter("m", minimum=0).allows(x),
}
"""Calls with one number, by its name: neither NaN nor an infinite number makes sense."""

CASES: dict[str, tuple[Callable[[], Any], str]] = {
    "a number for nodes": (lambda: results.align(5), "nodes is 5; expected a mapping from texts to"),
    "a mapping for a tree": (lambda: results.validate({}), "tree is .*; expected an xarray.DataTree"),
    "a number for names": (lambda: extend.labels(5, [], [0.0]), "outputs is 5; expected a sequence"),
    "a negative seed": (lambda: _chaos().sample(3, -1), "seed is -1; expected a whole number, 0 or more"),
    "too many samples": (lambda: _chaos().sample(10**400, 1), "count is .*; at most 1e"),
    "a text for inputs": (
        lambda: _chaos().evaluate("2"),
        r"inputs.* is .*; expected real numbers in an array \(points, 1\), or by name: speed=0.5",
    ),
    "rows of two lengths": (
        lambda: _chaos().evaluate([[1.0], [1.0, 2.0]]),
        r"inputs.* is .*; expected real numbers in an array \(points, 1\), or by name: speed=0.5",
    ),
    "ten to the 400th": (
        lambda: _chaos().evaluate(10**400),
        r"inputs.* is .*; expected real numbers in an array \(points, 1\), or by name: speed=0.5",
    ),
    "a masked array": (lambda: results.circular_mean(HOSTILE["masked"]), "masked values, the first at index"),
    "a path with a null": (lambda: results.load("a\0b"), "path is"),
    "a broken status": (
        lambda: extend.sample_dataset([[[1.0]]], np.zeros((1, 0)), AXES, status=[0.5]),
        "The status 0.5 is unknown",
    ),
    "probabilities of two axes": (
        lambda: extend.statistics_dataset(AXES, mean=[[0.0]], std=[[0.0]], probability=[[0.5]]),
        "'probability' is .*; expected a sequence of numbers between 0 and 1",
    ),
    "a level of two": (lambda: results.clopper_pearson(1, 2, level=2), "level is 2; expected a number between 0 and 1"),
    "a number for a figure": (lambda: report.bands(5, "x"), "results is 5; expected"),
    "germs of no axis": (lambda: uqmbd.extend.GermBox.whole(_space()).contains(0.5), r"expected \(K, 1\)"),
    "the germ before the first": (lambda: uqmbd.extend.GermBox.whole(_space()).divisible(-1), "germ is -1; expected"),
    "elements without probabilities": (
        lambda: uqmbd.extend.Verification.failed_share([], [1.0], 4, 0),
        "expected one for each element",
    ),
    "units of two lines": (lambda: uqmbd.RandomVariable("a", chaospy.Normal(), units="m\ns"), "ends of lines"),
    "a bias that is too large": (lambda: Bias(1, length=10**400), "length is .*; expected a finite number above zero"),
    "a bias without times": (lambda: Bias(1).modes(None), "times"),
    "a huge record": (lambda: Series("x", HOSTILE["huge"], [1.0], "m", noise=1), "expected at most"),
    "a problem that is none": (lambda: extend.dense(5, [[1.0]], 1.0), "dense: problem is 5; expected a"),
    "elements of no function": (
        lambda: extend.refine_elements(_space(), 5, extend.ElementLimits(2), label="mine"),
        "refine_elements: compute is 5; expected a function",
    ),
    "a frame of no space": (lambda: extend.Frame("plane"), "Frame: space is 'plane'; expected"),
    "a frame of one coordinate": (
        lambda: extend.Frame(uqmbd.Planar(), [0.0]),
        "Frame: q is .*; expected 4 coordinates",
    ),
    "a problem of no method": (
        lambda: uqmbd.Study("s", _mechanism(), [0, 1]).problem(5),
        "Study.problem: propagator is 5; expected",
    ),
    "a key that changes": (lambda: _mechanism().remembered([1], list), r"Mechanism.remembered: key is \[1\]; expected"),
    "findings of no study": (lambda: uqmbd.findings(5), "findings: study is 5; expected"),
    "a table of texts": (lambda: uqmbd.tabulated("text", [1.0]), "tabulated: normal is 'text'; expected real"),
    "a script of a number": (lambda: uqmbd.load_study(5), "load_study: path is 5; expected a text or a path"),
    "ends of an array": (lambda: uqmbd.spline([0, 1], [0, 1], ends=np.zeros(2)), "spline: ends is .*; expected one of"),
    "outputs of a number": (
        lambda: uqmbd.to_frame(xr.DataTree(), 5),
        "to_frame: outputs is 5; expected .*a sequence of texts",
    ),
    "a scheduler of an array": (lambda: uqmbd.Workers(dask=np.zeros(2)), "Workers: dask is .*; expected a text"),
    "a check of an array": (
        lambda: uqmbd.simulate(_mechanism(), [0, 1], check=np.zeros(2)),
        "check is .*; expected True or False",
    ),
    "a pose of an array": (lambda: uqmbd.eigenfrequencies(_mechanism(), at=np.zeros(2)), "at=.*; expected 'equil"),
    "a time in digits": (lambda: uqmbd.eigenfrequencies(_mechanism(), time="5"), "time is '5'; expected a number"),
    "a command of an array": (
        lambda: uqmbd.Controller(commanded=["u"], measured=["x"], function=max).command(np.zeros(2)),
        "the controller has no command array",
    ),
    "a factor without an end": (lambda: _arm().randomise("*.mass", relative=1e307), "relative is 1e.307; expected"),
    "a distribution of an array": (lambda: _arm().randomise("*.mass", distribution=np.zeros(2)), "distribution is"),
    "a law of no symbol": (lambda: uqmbd.laws.law_values(1.0, [1]), "law_values: symbols is .*; expected a"),
    "levels without an end": (
        lambda: uqmbd.Study("s", _mechanism(), [0, 1]).converge(HOSTILE["huge"], order=[1]),
        "converge: an array of the shape .* is not a propagator",
    ),
    "an accuracy of NaN": (
        lambda: results.StatedAccuracy(float("nan"), "mean"),
        "value is nan; expected a finite number, 0",
    ),
    **{
        f"{name} of {value}": (functools.partial(call, value), f"{name} is {value}; expected a finite number")
        for value in (math.nan, math.inf, -math.inf)
        for name, call in FINITE.items()
    },
    "a default of NaN": (lambda: uqmbd.Parameter("m", default=math.nan), "default is nan; expected finite numbers"),
    "a default with NaN": (
        lambda: uqmbd.Parameter("m", kind="point", default=(0, math.nan)),
        "expected finite numbers",
    ),
    "a default of a text": (lambda: uqmbd.Parameter("m", default="5"), "default is '5'; expected finite numbers"),
    "an infinite example": (lambda: uqmbd.Parameter("m", example=math.inf), "example is inf; expected finite numbers"),
    "bounds of NaN": (lambda: extend.Bounds(math.nan), "Bounds: least is nan"),
    "bounds in descending order": (lambda: extend.Bounds(2, 1), "expected numbers with least <= most"),
    "bounds of a text": (lambda: extend.Bounds("0"), "expected numbers with least <= most"),
    "limits that enclose nothing": (lambda: extend.Toleranced(1.0, 1.0, 1.0, 1.33, False, ""), "lower limit below"),
    "a probability of two": (
        lambda: results.Answer("m", "r", "", "", 2.0, 0.0, 1.0, ""),
        "Answer: probability is 2.0; expected a number between 0 and 1 or NaN",
    ),
    "a tolerance below zero": (lambda: extend.varying(_chaos(), -1.0), "rtol is -1.0; expected a number, 0 or more"),
    "no surrogates": (lambda: results.AlignedChaos.joined([], []), "AlignedChaos.joined: 0 surrogates and 0 boxes"),
    "numbers for surrogates": (
        lambda: results.AlignedChaos.joined([1.0], []),
        "chaoses is .1.0.; expected a sequence of",
    ),
    "a surrogate without parts": (lambda: results.ComposedChaos({}, ("x",)), "parts is empty; expected at least one"),
    "parts without their times": (
        lambda: results.ComposedChaos({"a": _chaos()}, ("x",), {}),
        "the argument 'used' has no entry for the part 'a'; expected truth values of the shape",
    ),
    "ten to the 400th germs": (lambda: extend.index_set(10**400, 1), "dimension is .*; expected a whole number up to"),
    "elements that are a number": (
        lambda: extend.refine_elements(_space(), len, extend.ElementLimits(2), label="mine"),
        "refine_elements: compute returned 1; expected a sequence",
    ),
    "a share that is a text": (
        lambda: extend.refine_elements(_space(), _all, extend.ElementLimits(2), label="mine", lost=str),
        "refine_elements: lost returned '0'; expected a number",
    ),
    "room that is a text": (
        lambda: extend.refine_elements(_space(), _all, extend.ElementLimits(2), label="mine", affordable=str),
        "refine_elements: affordable returned ''; expected a whole number",
    ),
    "times without probabilities": (
        lambda: extend.requirements_dataset(["r"], violation_probability=[0], lower=[0], upper=[1], times=[0]),
        "times is given without violated_by; expected both",
    ),
    "a plan that is a number": (lambda: _study().run(planned=5), "planned is 5; expected a function"),
    "a check of a number": (
        lambda: extend.typechecked(5),
        "the argument 'called' is 5; expected a function or a class written in",
    ),
    "a check of a function of C": (lambda: extend.typechecked(len), "expected a function or a class written in Python"),
    "a reader of a number": (lambda: URDF().read(5), "URDF.read: path is 5; expected a text or a path"),
    "a reader with a number": (lambda: MJCF().read("a", fuse=2), "MJCF.read: fuse is 2; expected True or False"),
    "a negative count": (lambda: extend.Estimate(-1, 0), "Estimate: realisations is -1; expected a whole number, 0"),
    "four dimensions": (lambda: uqmbd.Parameter("m", default=0, dimensions=4), "dimensions is 4; expected a whole"),
    "a model of a number": (lambda: uqmbd.from_urdf(5), "from_urdf: path is 5; expected a text or a path"),
    "an inertia that is no word": (
        lambda: uqmbd.from_urdf("robot.urdf", inertia="ignore"),
        "from_urdf: inertia is 'ignore'; expected one of 'refuse'",
    ),
    "errors of another shape": (
        lambda: extend.find_exceedances(AXES, np.zeros(3), 0.1, np.array([True])),
        "find_exceedances: errors is .*; expected an error of each output",
    ),
    "rules of no levels": (lambda: extend.combination_coefficients(5), "levels is 5; expected whole numbers in rows"),
    "a level without an end": (lambda: extend.clenshaw_curtis(_space(), 10**400), "level is .*; expected whole"),
    "a germ that there is not": (lambda: _space().evaluate_derivative([[0.5]], [[1]], 7), "germ is 7; expected the"),
    "times that do not increase": (
        lambda: _problem().watching(np.array([0.0, 1.0, 0.5])),
        "times is .*; expected an array of increasing times",
    ),
    "a sequence without an end": (
        lambda: report.histograms(xr.DataTree(), "x", HOSTILE["huge"]),
        "times is an array of the shape .*; expected a sequence of numbers",
    ),
    "axes of no figure": (lambda: report.axes_grid(1, 1e300), "height is 1e.300; expected a number"),
    "a chunk of a number": (lambda: extend.quantiles_of_chunks([5]), "a chunk is 5; expected consecutive samples"),
    "nodes without terms": (
        lambda: extend.regress_on_nodes(np.zeros((3, 1)), np.ones((3, 1)), [0.5]),
        "regress_on_nodes: multi_index is .*; expected whole degrees",
    ),
    "no replicates": (lambda: extend.replicate_errors([]), "no replicates are given"),
    "a sample without axes": (lambda: extend.Moments.of(5.0), "Moments.of: samples is 5.0; expected samples"),
    "angles of a number": (lambda: extend.watched_angles(5), "watched_angles: mechanism is 5; expected"),
    "propagators of an array": (lambda: uqmbd.Study("s", _mechanism(), [0, 1], HOSTILE["huge"]), "expected a list"),
}
"""One for each cause of a raw error, or of an impossible value that was accepted."""


@pytest.mark.parametrize("name", CASES)
def test_impossible_arguments_are_refused_with_what_is_expected(name):
    call, words = CASES[name]
    with pytest.raises(uqmbd.StudyError, match=words):
        call()


DEFAULTS = {
    *("minus one", "zero", "1e307", "half", "None", "empty list", "list", "nested", "deep", "None in list", "range"),
    *("foreign symbol", "unknown symbol", "empty array", "flat array", "four axes", "matrix"),
}
"""Defaults that may stand for numbers, by hand; whether their count is right depends on the space."""


@pytest.mark.parametrize("key", ["default", "example"])
def test_a_default_of_a_number_is_finite(key):
    accepted = set()
    for name, value in HOSTILE.items():
        uqmbd.Parameter("m", kind="option", **{key: value})
        try:
            uqmbd.Parameter("m", kind="numbers", **{key: value})
        except uqmbd.StudyError as error:
            assert f"{key} is " in str(error) and "expected finite numbers" in str(error)
        else:
            accepted.add(name)
    assert accepted == DEFAULTS
