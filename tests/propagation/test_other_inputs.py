"""Problems with other distributions of some inputs, and results of different populations beside each other."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from typing import ClassVar

import chaospy
import numpy as np
import pytest

import uqmbd
from uqmbd.report import write_report
from uqmbd.results import validate
from uqmbd_collocation import Collocation
from uqmbd_montecarlo import MonteCarlo
from uqmbd_springs import SpringDamper


@dataclass(frozen=True, kw_only=True)
class Elsewhere(uqmbd.extend.Propagator):
    """Run a method with another stiffness."""

    name: ClassVar[str] = "elsewhere"
    method: uqmbd.extend.Propagator
    variables: tuple[uqmbd.RandomVariable, ...]

    def propagate(self, problem):
        node = self.method.propagate(problem.with_inputs(self.variables))
        node.attrs |= {"propagator": self.name, "population": "that of another spring"}
        return node


def oscillator():
    mechanism = uqmbd.Mechanism("oscillator", uqmbd.Line())
    stiffness = uqmbd.RandomVariable("stiffness", chaospy.Uniform(80, 120), units="N/m")
    speed = uqmbd.RandomVariable("speed", chaospy.Normal(1, 0.1), units="m/s")
    mass = mechanism.body("mass", mass=1, position=1, velocity=speed)
    mechanism.add(SpringDamper("spring", mechanism.ground, mass, 0, 0, stiffness, free_length=1))
    mechanism.output("x", mass.position[0], units="m")
    mechanism.output("frequency", uqmbd.eigenfrequency(1), units="Hz")
    mechanism.require("slow", uqmbd.eigenfrequency(1) <= 1.7)
    return mechanism


def other(**changes):
    about = {"name": "stiffness", "distribution": chaospy.Normal(150, 2), "units": "N/m"} | changes
    return uqmbd.RandomVariable(about["name"], about["distribution"], units=about["units"])


def test_a_method_has_the_moments_of_the_other_distribution(tmp_path):
    """The frequency sqrt(k) / 2 pi by a Gauss-Hermite rule; the other input stays; what differs is not compared."""
    times = np.linspace(0, 1, 5)
    methods = [
        Collocation(order=3),
        Elsewhere(method=Collocation(order=3), variables=(other(),)),
        MonteCarlo(samples=50),
    ]
    tree = uqmbd.Study("oscillator", oscillator(), times, methods).run()
    validate(tree)
    nodes, weights = np.polynomial.hermite_e.hermegauss(20)
    mean = weights @ np.sqrt(150 + 2 * nodes) / weights.sum() / (2 * np.pi)
    found = tree["elsewhere/scalars/statistics"].sel(output="frequency")
    assert float(found["mean"]) == pytest.approx(mean, rel=1e-8)
    # x = 1 + speed / w sin(w t): linear in the speed
    w = np.sqrt(150 + 2 * nodes[:, None])
    swing = np.sin(w * times) / w
    square = weights @ (swing**2 * 1.01) / weights.sum() - (weights @ swing / weights.sum()) ** 2
    np.testing.assert_allclose(tree["elsewhere/statistics"]["variance"].values[0], square, rtol=1e-4, atol=1e-12)
    assert tree["comparison"]["method"].values.tolist() == ["collocation", "monte-carlo"]

    assert float(tree["elsewhere/requirements"]["violation_probability"].values.ravel()[-1]) > 0.99
    page = write_report(tree, tmp_path / "report.html").read_text(encoding="utf-8")
    assert "The distributions of the inputs of elsewhere differ from the study: that of another spring; it is" in page
    assert "contradict" not in page


@pytest.mark.parametrize(
    ("variables", "message"),
    [
        (
            [other(name="stifness")],
            "elsewhere: the replaced input 'stifness' does not exist; the inputs are: 'speed'",
        ),
        ([other(units="N/mm")], "the input 'stiffness' has the units 'N/m', but its replacement has 'N/mm'"),
    ],
)
def test_what_cannot_take_the_place_of_an_input_is_refused(variables, message):
    study = uqmbd.Study("oscillator", oscillator(), [0, 1])
    problem = study.problem(Elsewhere(method=Collocation(), variables=()))
    with pytest.raises(uqmbd.StudyError, match=message):
        problem.with_inputs(variables)


def test_one_of_dependent_inputs_cannot_be_replaced_alone():
    k, c = uqmbd.random_vector(["k", "c"], chaospy.MvNormal([10, 1], [[1, 0.05], [0.05, 0.01]]))
    mechanism = uqmbd.Mechanism("oscillator", uqmbd.Line())
    mass = mechanism.body("mass", mass=1, position=1)
    mechanism.add(SpringDamper("spring", mechanism.ground, mass, 0, 0, k, c, free_length=1))
    mechanism.output("frequency", uqmbd.eigenfrequency(1), units="Hz")
    problem = uqmbd.Study("oscillator", mechanism).problem(Collocation())
    alone = uqmbd.RandomVariable("k", chaospy.Normal(10, 1))
    with pytest.raises(
        uqmbd.StudyError, match="the replaced input 'k' depends on the input 'c', which is not replaced"
    ):
        problem.with_inputs([alone])
    both = problem.with_inputs([alone, uqmbd.RandomVariable("c", chaospy.Normal(1, 0.1))])
    assert both.inputs.means.tolist() == [1, 10] and dataclasses.replace(both, inputs=problem.inputs) == problem


def test_moments_that_an_input_of_a_heavy_tail_denies_exist_with_another_one():
    mechanism = uqmbd.Mechanism("fall", uqmbd.Line())
    speed = uqmbd.RandomVariable("speed", chaospy.StudentT(2), units="m/s")
    mechanism.output("x", mechanism.body("stone", mass=1, velocity=speed).position[0], units="m")
    given = (other(name="speed", distribution=chaospy.Normal(1, 0.5), units="m/s"),)
    method = Elsewhere(method=Collocation(order=1), variables=given)
    tree = uqmbd.Study("fall", mechanism, [0, 2], [method]).run()
    np.testing.assert_allclose(tree["elsewhere/statistics"]["std"].values[0], [0, 1], atol=1e-9)
