"""Names, descriptions, times and numbers that results cannot hold are refused when they are given, not when a run ends."""

from __future__ import annotations

import chaospy
import numpy as np
import pytest

import uqmbd
from uqmbd_joints import Revolute
from uqmbd_montecarlo import MonteCarlo
from uqmbd_springs import SpringDamper


def falling():
    mechanism = uqmbd.Mechanism("m", uqmbd.Line())
    speed = uqmbd.RandomVariable("v", chaospy.Normal(1, 0.1), units="m/s")
    body = mechanism.body("b", mass=1, velocity=speed)
    mechanism.output("x", body.position[0], units="m")
    return mechanism, body, speed


@pytest.mark.parametrize("mark", ["\udcff", "\x00", "\ud800", "\x07", "\ufffe", "\x9f"])
def test_a_description_that_no_file_can_hold(mark):
    mechanism, body, _ = falling()
    for text in (mark, f"limit{mark}", f"{mark} of the stroke"):
        with pytest.raises(uqmbd.StudyError, match="requirement 'r': the description is .* must not contain"):
            mechanism.require("r", body.position[0] <= 10, text)
    mechanism.require("r", body.position[0] <= 10, "Länge ≤ 10 m,\nsecond line")


@pytest.mark.parametrize("mark", ["\n", "\r", "\t", "\r\n", "\u2028", "\u2029"])
def test_a_name_of_several_lines(mark):
    mechanism, body, _ = falling()
    for name in (f"a{mark}b", f"a{mark}", mark + "b"):
        for make in (
            lambda x: mechanism.body(x, mass=1),
            lambda x: mechanism.output(x, body.position[0]),
            lambda x: mechanism.require(x, body.position[0] <= 1),
            lambda x: mechanism.add(SpringDamper(x, mechanism.ground, body, 0, 0, 1)),
            lambda x: uqmbd.RandomVariable(x, chaospy.Normal()),
            lambda x: uqmbd.Mechanism(x, uqmbd.Line()),
            lambda x: uqmbd.Study(x, mechanism, [0, 1]),
            lambda x: MonteCarlo(label=x),
        ):
            with pytest.raises(uqmbd.StudyError, match="tabs or ends of lines"):
                make(name)


TIMES = [
    ["0", "1"],
    [0, "1"],
    ("0", 1.0),
    np.array(["0", "1"]),
    [b"0", b"1"],
    np.array([0, "1"], dtype=object),
    "01",
    [["0"], ["1"]],
]


@pytest.mark.parametrize("times", TIMES, ids=map(repr, TIMES))
def test_times_that_are_texts(times):
    mechanism, *_ = falling()
    for make in (lambda: uqmbd.Study("s", mechanism, times), lambda: uqmbd.simulate(mechanism, times)):
        with pytest.raises(uqmbd.StudyError, match="times"):
            make()
    for report_times in (["0.5"], "1", [b"1"], [0.5, "1"], 3):
        with pytest.raises(uqmbd.StudyError, match="report_times"):
            uqmbd.Study("s", mechanism, [0, 1], report_times=report_times)


@pytest.mark.parametrize("value", [[1.0], (1,), np.array([1.0]), np.array([[1.0]]), range(1, 2), [[1.0]]])
def test_a_scalar_is_no_sequence(value):
    mechanism = uqmbd.Mechanism("m", uqmbd.Planar())
    body = mechanism.body("b", mass=1, inertia=1)
    for make in (
        lambda: mechanism.body("c", mass=value, inertia=1),
        lambda: mechanism.body("c", mass=1, inertia=value),
        lambda: mechanism.body("c", mass=1, inertia=1, angle=value),
        lambda: mechanism.add(SpringDamper("s", mechanism.ground, body, (0, 0), (0, 0), value)),
        lambda: mechanism.add(SpringDamper("s", mechanism.ground, body, (0, 0), (0, 0), 1, damping=value)),
    ):
        with pytest.raises(uqmbd.StudyError, match="sequence"):
            make()
    assert float(mechanism.body("d", mass=np.array(2.0), inertia=np.float64(1), angle=np.int64(1)).mass) == 2
    mechanism.add(Revolute("pin", mechanism.ground, body, at=(0, 0)))


@pytest.mark.parametrize("relation", [uqmbd.t <= 1, uqmbd.t**2 >= 0.5, 2 * uqmbd.t + 1 <= 3])
def test_a_requirement_on_time_alone(relation):
    mechanism, body, speed = falling()
    with pytest.raises(uqmbd.StudyError, match="depends only on time"):
        mechanism.require("r", relation)
    mechanism.require("with a quantity", body.position[0] <= uqmbd.t + 1)
    mechanism.require("of an input", speed <= 2)
