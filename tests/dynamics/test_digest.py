"""What the digest of a model holds: every number that the motion depends on, in each place where it may stand."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import chaospy
import pytest
import sympy

import uqmbd
from uqmbd_montecarlo import MonteCarlo
from uqmbd_springs import PointForce


def cart(value: Any, place: str) -> uqmbd.Mechanism:
    """Make a point mass on which a value enters in one place."""
    mechanism = uqmbd.Mechanism("cart", uqmbd.Translational(gravity=(0, -9.81)))
    given = {"position": {"position": (value, 0)}, "velocity": {"velocity": (value, 0)}, "mass": {"mass": value}}
    body = mechanism.body("cart", **({"mass": 2} | given.get(place, {})))
    if place == "parameter":
        mechanism.add(PointForce("motor", body, (0, 0), (value, 0)))
    if place == "start":
        mechanism.start(body.position[0], value)
    mechanism.output("x", value if place == "output" else body.position[0], units="m")
    return mechanism


def digest(value: Any, place: str) -> str:
    """Digest of the model of a cart."""
    return uqmbd.Study("s", cart(value, place), [0, 0.5, 1]).model.digest


def of_a_table(gain: float) -> sympy.Expr:
    """Return a random number out of a table."""
    share = uqmbd.RandomVariable("share", chaospy.Uniform(0.2, 0.8), "1")
    return uqmbd.spline([0, 0.5, 1], [gain, 2 * gain, 5 * gain])(share)


def of_digits(value: float) -> sympy.Expr:
    """Return a random number whose factor needs all of its digits."""
    return sympy.Float(1.1 + 4e-16 * value) * uqmbd.RandomVariable("share", chaospy.Uniform(0.2, 0.8), "1")


@pytest.mark.parametrize("make", [of_a_table, of_digits])
@pytest.mark.parametrize("place", ["parameter", "position", "velocity", "mass", "start", "output"])
def test_models_with_other_numbers_have_other_digests(place: str, make: Callable[[float], sympy.Expr]) -> None:
    assert digest(make(1.0), place) != digest(make(10.0), place)
    assert digest(make(1.0), place) == digest(make(1.0), place)


def test_a_resumed_study_with_another_table_is_computed_anew(tmp_path: Any) -> None:
    def study(gain: float) -> uqmbd.Study:
        return uqmbd.Study("s", cart(of_a_table(gain), "parameter"), [0, 0.5, 1], [MonteCarlo(samples=10, seed=1)])

    def mean(result: Any) -> float:
        return float(result["monte-carlo/statistics"]["mean"].values.ravel()[-1])

    once = mean(study(1.0).run(folder=tmp_path, resume=True))
    with pytest.warns(uqmbd.StudyWarning, match="belong to another study"):
        resumed = mean(study(100.0).run(folder=tmp_path, resume=True))
    # the cart is at rest at the start, and the motion linear in its force
    assert resumed == pytest.approx(100 * once, rel=1e-5)
