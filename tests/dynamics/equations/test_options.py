"""Components whose options differ have equations of their own."""

from __future__ import annotations

import numpy as np
import pytest

import uqmbd


class Look:
    """Objects that all look alike."""

    def __init__(self, value):
        self.value = value

    def __repr__(self):
        return "Look()"


class Pull(uqmbd.Component):
    """A constant force along x, of the size of an option."""

    bodies = ("body",)
    size = uqmbd.Parameter("N", "force", kind="option", example=(1.0, 0))

    def terms(self, p):
        value = p.size
        while not isinstance(value, (int, float)):
            value = value["N"] if isinstance(value, dict) else value.value if isinstance(value, Look) else value[0]
        yield uqmbd.VirtualWork(value, p.body.velocity[0])


class Row(uqmbd.Component):
    """A force along x that is a polynomial of the time."""

    bodies = ("body",)
    coefficients = uqmbd.Parameter("N", "coefficients, the constant first", kind="numbers", example=(1.0, 2.0))

    def terms(self, p):
        yield uqmbd.VirtualWork(sum(c * p.time**k for k, c in enumerate(p.coefficients)), p.body.velocity[0])


@pytest.mark.parametrize(
    ("first", "second"),
    [
        ((2.0, 0), (5.0, 0)),
        ([2.0], [5.0]),
        (Look(2.0), Look(5.0)),
        ({"N": 2.0}, {"N": 5.0}),
        (np.r_[2.0, np.zeros(2000), 1.0, np.zeros(2000)].tolist(), [5.0]),
        ((Look((2.0, 1)),), (Look((5.0, 1)),)),
    ],
)
def test_options_that_look_alike_are_distinguished(first, second):
    mechanism = uqmbd.Mechanism("pulled", uqmbd.Translational())
    for name, size in (("a", first), ("b", second)):
        body = mechanism.body(name, mass=1.0)
        mechanism.add(Pull(f"pull_{name}", body, size))
        mechanism.output(name, body.position[0])
    found = uqmbd.simulate(mechanism, [0, 2.0])
    assert (float(found["a"][-1]), float(found["b"][-1])) == pytest.approx((4.0, 10.0), rel=1e-8)


def test_a_row_of_numbers_may_be_random_and_of_any_length():
    chaospy = pytest.importorskip("chaospy")
    force = uqmbd.RandomVariable("force", chaospy.Uniform(1, 3), units="N")
    mechanism = uqmbd.Mechanism("pushed", uqmbd.Translational())
    for name, row in (("a", (force,)), ("b", (0, force, 6)), ("c", np.array([1.0, 2.0]))):
        body = mechanism.body(name, mass=1.0)
        mechanism.add(Row(f"push_{name}", body, row))
        mechanism.output(name, body.position[0])
    found = uqmbd.simulate(mechanism, [0, 2.0])
    expected = {"a": 2 * 2, "b": 2 * 8 / 6 + 6 * 16 / 12, "c": 2 + 2 * 8 / 6}
    assert {key: float(found[key][-1]) for key in expected} == pytest.approx(expected, rel=1e-7)
