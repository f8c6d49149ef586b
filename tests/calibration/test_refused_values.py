"""Values that no argument of calibration expects are refused with what is expected."""

import numpy as np
import pytest

import uqmbd
from uqmbd_calibration import Bias, Series

HUGE = np.broadcast_to(np.float64(1.0), (10**9,))

CASES = {
    "a length of 401 digits": (lambda: Bias(1, length=10**400), "length is .*; expected a finite number above zero"),
    "a truth value": (lambda: Bias(True), "sd is True; expected a finite number above zero"),
    "no times": (lambda: Bias(1).modes(None), "times have the shape .*; expected a one-dimensional array"),
    "a text as times": (lambda: Bias(1).modes("5"), "times are '5'; expected numbers"),
    "a time that is no number": (
        lambda: Bias(1).modes([0.0, float("nan")]),
        "times contains values that are not finite",
    ),
    "a huge record": (lambda: Series("x", HUGE, [1.0], "m", noise=1), "expected at most"),
}


@pytest.mark.parametrize("name", CASES)
def test_values_that_cannot_be_used_are_refused(name):
    call, words = CASES[name]
    with pytest.raises(uqmbd.StudyError, match=words):
        call()


@pytest.mark.parametrize("units", ["m\ns", "m\ts", "m\u2028s"], ids=repr)
def test_units_have_one_line(units):
    mechanism = uqmbd.Mechanism("m", uqmbd.Line())
    with pytest.raises(uqmbd.StudyError, match="units cannot contain tabs or ends of lines"):
        mechanism.output("x", mechanism.body("b", mass=1).position[0], units=units)


def test_an_array_is_no_sequence_of_propagators():
    with pytest.raises(uqmbd.StudyError, match="propagators is"):
        uqmbd.Study("s", uqmbd.Mechanism("m", uqmbd.Line()), [0, 1], np.zeros(3))
