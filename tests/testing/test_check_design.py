"""Designs of the core pass the kit, and what a design of somebody else's can get wrong is found by it."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import qmc

import uqmbd
from uqmbd import plugins
from uqmbd.randomness.designs.registry import BuiltInDesigns
from uqmbd.testing import check_design

CORE = BuiltInDesigns().uqmbd_designs()


@pytest.mark.parametrize("design", CORE, ids=lambda design: design.name)
def test_designs_of_the_core(design):
    check_design(design)


def test_names_of_the_core_are_those_that_plugins_cannot_take():
    assert plugins.KINDS["designs"].reserved == uqmbd.extend.sampling_designs()[: len(CORE)]


class Shifted:
    """Points of a grid, all of them shifted."""

    name = "shifted"

    def points(self, dimension, numbers, seed):
        steps = np.array(numbers)[:, None] / len(numbers)
        return (steps + np.random.default_rng(seed).random(dimension)) % 1


def variant(points, **attributes):
    return type("Variant", (Shifted,), {"__doc__": "A design.", "points": points, **attributes})


@pytest.mark.parametrize(
    ("design", "told"),
    [
        (variant(lambda *_: np.zeros((3, 1))), "returned points of shape"),
        (variant(lambda s, d, n, seed: 1.1 * Shifted().points(d, n, seed)), "outside the unit cube"),
        (
            variant(lambda s, d, n, seed: np.random.default_rng().random((len(n), d))),
            "two calls with the same seed return different points",
        ),
        (variant(lambda s, d, n, seed: Shifted().points(d, n, 1)), "two different seeds return the same points"),
        (variant(lambda s, d, n, seed: Shifted().points(d, n, seed) ** 2), "is not uniformly distributed"),
        (
            variant(lambda s, d, n, seed: np.repeat(Shifted().points(1, n, seed), d, axis=1)),
            "coordinates 0 and 1 are correlated",
        ),
        (
            variant(lambda s, d, n, seed: np.tile(np.random.default_rng(seed).random(d), (len(n), 1))),
            "coordinate 0 has the same value in all points of a seed",
        ),
        (variant(Shifted.points, name=None), "`name` is not a string"),
        (variant(Shifted.points, name="a/b"), "`name` is not a string without '/'"),
        (variant(Shifted.points, extendable=True), "declares extendable = True"),
        (
            variant(
                lambda s, d, n, seed: qmc.Halton(d, rng=np.random.default_rng(seed)).random(len(n)), extendable=True
            ),
            "declares extendable = True",
        ),
    ],
)
def test_what_is_wrong_is_found(design, told):
    check_design(Shifted)
    with pytest.raises(AssertionError, match=told):
        check_design(design)


def test_base_that_is_no_number_is_refused():
    with pytest.raises(uqmbd.StudyError, match="declares base = 2.5; expected a whole number"):
        check_design(variant(Shifted.points, base=2.5))


@pytest.mark.parametrize(
    ("name", "told"),
    [("sobl", "sobl'; did you mean 'sobol'\\? Expected one of 'random', "), (3, "is 3; expected the name")],
)
def test_unknown_names_are_reported_with_a_suggestion(name, told):
    with pytest.raises(uqmbd.StudyError, match=told):
        uqmbd.extend.sampling_design(name)
