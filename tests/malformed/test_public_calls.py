"""Arguments of public functions are what their annotations declare, and every public name is tried with other ones."""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping, Sequence
from typing import Annotated, Any, Literal

import chaospy
import numpy as np
import pytest
import xarray as xr
from numpy.typing import ArrayLike

import uqmbd
from uqmbd import extend, report, results
from uqmbd.arguments import fits, typechecked
from uqmbd.typing import Array, Index
from uqmbd_calibration import Bias, Series

from .hostile import HOSTILE
from .public_calls import LEFT_OUT, unreached


def test_every_public_name_is_called_by_an_example_or_left_out_with_a_reason():
    missing = unreached()
    assert [full for full, owner in missing.items() if owner not in LEFT_OUT] == []
    assert set(LEFT_OUT) <= set(missing.values())  # none is left out that is called
    assert all(LEFT_OUT.values())


NUMBERS = {"minus one", "zero", "1e307", "half"}
TEXTS = {"empty text", "text", "lines", "digits", "no units", "null", "surrogate"}
ROWS = {"empty list", "list", "range", "empty array"}

KINDS: dict[str, tuple[Any, set[str]]] = {
    "int": (int, {"minus one", "zero", "10**400"}),
    "bounded int": (Annotated[int, uqmbd.extend.Bounds(0, 10)], {"zero"}),
    "float": (float, NUMBERS | {"inf", "-inf"}),
    "share": (Annotated[float, uqmbd.extend.Bounds(0, 1)], {"zero", "half"}),
    "text": (str, TEXTS),
    "truth": (bool, {"True"}),
    "word": (Literal["text", "other"], {"text"}),
    "path": (str | os.PathLike[str], TEXTS - {"null"}),
    "none": (str | None, TEXTS | {"None"}),
    "mapping": (Mapping[str, xr.DataTree], {"empty dict"}),
    "row": (Sequence[float], ROWS | {"huge"}),
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


def _chaos():
    axes = extend.labels(["x"], ["speed"], [0.0])
    return results.PolynomialChaos([[[2.0]], [[0.5]]], [[0], [1]], _space(), axes)


AXES = extend.labels(["x"], [], [0.0])

CASES: dict[str, tuple[Callable[[], Any], str]] = {
    "a number for nodes": (lambda: results.align(5), "nodes is 5; expected a mapping from texts to"),
    "a mapping for a tree": (lambda: results.validate({}), "tree is .*; expected an xarray.DataTree"),
    "a number for names": (lambda: extend.labels(5, [], [0.0]), "outputs is 5; expected a sequence"),
    "a negative seed": (lambda: _chaos().sample(3, -1), "seed is -1; expected a whole number, 0 or more"),
    "too many samples": (lambda: _chaos().sample(10**400, 1), "count is .*; at most 1e"),
    "a text for inputs": (lambda: _chaos().evaluate("2"), "inputs.*non-numeric"),
    "rows of two lengths": (lambda: _chaos().evaluate([[1.0], [1.0, 2.0]]), "inputs.*non-numeric"),
    "ten to the 400th": (lambda: _chaos().evaluate(10**400), "inputs.*non-numeric"),
    "a masked array": (lambda: results.circular_mean(HOSTILE["masked"]), "masked values, the first at index"),
    "a path with a null": (lambda: results.load("a\0b"), "path is"),
    "a broken status": (
        lambda: extend.sample_dataset([[[1.0]]], np.zeros((1, 0)), AXES, status=[0.5]),
        "Status 0.5 has no meaning",
    ),
    "probabilities of two axes": (
        lambda: extend.statistics_dataset(AXES, mean=[[0.0]], std=[[0.0]], probability=[[0.5]]),
        "'probability' is .*; expected a row of numbers between 0 and 1",
    ),
    "a level of two": (lambda: results.clopper_pearson(1, 2, level=2), "level is 2; expected a number between 0 and 1"),
    "a number for a figure": (lambda: report.bands(5, "x"), "results is 5; expected"),
    "germs of no axis": (lambda: uqmbd.extend.GermBox.whole(_space()).contains(0.5), r"expected \(K, 1\)"),
    "the germ before the first": (lambda: uqmbd.extend.GermBox.whole(_space()).divisible(-1), "germ is -1; expected"),
    "elements without probabilities": (
        lambda: uqmbd.extend.Verification.failed_share([], [1.0], 4, 0),
        "expected as many",
    ),
    "units of two lines": (lambda: uqmbd.RandomVariable("a", chaospy.Normal(), units="m\ns"), "ends of lines"),
    "a bias that is too large": (lambda: Bias(1, length=10**400), "length is .*; expected a finite number above zero"),
    "a bias without times": (lambda: Bias(1).modes(None), "times"),
    "a huge record": (lambda: Series("x", HOSTILE["huge"], [1.0], "m", noise=1), "expected at most"),
    "propagators of an array": (lambda: uqmbd.Study("s", _mechanism(), [0, 1], HOSTILE["huge"]), "expected a list"),
}
"""One for each cause of a raw error, or of an impossible value that was accepted."""


@pytest.mark.parametrize("name", CASES)
def test_impossible_arguments_are_refused_with_what_is_expected(name):
    call, words = CASES[name]
    with pytest.raises(uqmbd.StudyError, match=words):
        call()
