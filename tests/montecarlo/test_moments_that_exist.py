"""Moments of outputs that grow with an input of a heavy tail are NaN where they do not exist, with a sentence."""

from __future__ import annotations

import json

import chaospy
import numpy as np
import pytest
import sympy

import uqmbd
from uqmbd.extend import labels, statistics_dataset
from uqmbd.propagation.inputs import existence_of, grows
from uqmbd.report import write_report
from uqmbd.results import load, save
from uqmbd_montecarlo import MonteCarlo
from uqmbd_springs import SpringDamper

TIMES = np.linspace(0, 1, 3)
MOMENTS = {"mean": 1, "std": 2, "variance": 2, "std_error_mean": 2, "skewness": 3, "kurtosis": 4, "std_error_std": 4}


def thrown(distribution, **more):
    """A stone thrown with a random speed: its height is proportional to it; its share of a turn is bounded."""
    speed = uqmbd.RandomVariable("speed", distribution, units="m/s")
    mechanism = uqmbd.Mechanism("stone", uqmbd.Planar())
    stone = mechanism.body("stone", mass=1, inertia=1, velocity=(0, speed), angular_velocity=1)
    mechanism.output("height", stone.position[1], units="m")
    mechanism.output("upright", stone.rotation[0, 0])
    for name, expression in more.items():
        mechanism.output(name, expression(stone, speed))
    return mechanism


def run(mechanism, **options):
    study = uqmbd.Study("throw", mechanism, TIMES, [MonteCarlo(samples=64, seed=1, **options)])
    return study.run()


TAILS = [
    (chaospy.Cauchy(), 1),
    (chaospy.StudentT(1), 1),
    (chaospy.Pareto1(1.2), 1.2),
    (3 - 2 * chaospy.Pareto1(1.2), 1.2),
    (chaospy.StudentT(2.5), 2.5),
    (chaospy.StudentT(3), 3),
    (chaospy.Pareto1(3.5), 3.5),
    (chaospy.Levy(), 0.5),
    (chaospy.Normal(), np.inf),
    (chaospy.LogNormal(0, 1), np.inf),
    (chaospy.StudentT(5), np.inf),
    (chaospy.Pareto1(4.5), np.inf),
    (chaospy.Trunc(chaospy.Cauchy(), -5, 5), np.inf),
    (chaospy.Gamma(0.1), np.inf),
    (chaospy.Beta(0.2, 0.2), np.inf),
    (chaospy.Binomial(4, 0.5), np.inf),
]


@pytest.mark.parametrize(("distribution", "order"), TAILS, ids=str)
def test_moments_exist_up_to_the_order_of_the_tail(distribution, order):
    """Of what is proportional to an input, those that the input has; the bounded output has all, and all have quantiles."""
    axes = labels(["height", "upright"], ["speed"], TIMES)
    ones = np.ones((2, len(TIMES)))
    given = statistics_dataset(axes, **dict.fromkeys(MOMENTS, ones), quantile=np.ones((7, 2, len(TIMES))))
    found, sentences = existence_of(thrown(distribution)).applied(given)
    assert len(sentences) == (order < 4)
    for name, moment in MOMENTS.items():
        missing = np.isnan(found[name]).all("time").values.tolist()
        assert missing == [moment >= order, False] and not np.isnan(found[name].sel(output="upright")).any(), name
        assert ("does not exist for height" in found[name].attrs.get("comment", "")) == (moment >= order)
    assert np.isfinite(found["quantile"]).all()


@pytest.mark.parametrize(("distribution", "missing"), [(chaospy.Cauchy(), "mean"), (chaospy.StudentT(3), "skewness")])
def test_moments_that_do_not_exist_are_no_results(distribution, missing):
    with pytest.warns(
        uqmbd.StudyWarning, match=f"monte-carlo: the {missing}.* of output 'height' do not exist"
    ) as told:
        tree = run(thrown(distribution))
    assert len(told) == 1
    statistics = tree["monte-carlo/statistics"]
    assert np.isnan(statistics[missing].sel(output="height", time=1.0))
    assert np.isfinite(statistics[missing].sel(output="upright")).all()
    assert np.isfinite(statistics["quantile"]).all()
    assert json.loads(tree["monte-carlo"].attrs["warnings"]) == [str(told[0].message).partition(": ")[2].rstrip(".")]


def test_an_input_that_outputs_alone_contain_counts_for_those_alone():
    noise = uqmbd.RandomVariable("noise", chaospy.Cauchy())
    mechanism = thrown(chaospy.Normal(3, 0.1), reading=lambda stone, speed: stone.position[1] + noise)
    mechanism.output("phase", sympy.sin(noise))
    assert existence_of(mechanism).orders == {"reading": 1.0}


def test_the_heaviest_of_several_tails_counts():
    mass = uqmbd.RandomVariable("mass", chaospy.Pareto1(3.5))
    mechanism = thrown(chaospy.StudentT(1))
    mechanism.body("other", mass=mass, inertia=1)
    found = existence_of(mechanism)
    assert found.orders["height"] == pytest.approx(1) and found.causes == {"height": "speed"}


def test_dependent_inputs_have_the_tail_of_their_joint_distribution():
    a, b = uqmbd.random_vector(["a", "b"], chaospy.MvStudentT(2, [1, 1], [[1, 0.5], [0.5, 1]]))
    mechanism = uqmbd.Mechanism("stone", uqmbd.Translational())
    stone = mechanism.body("stone", mass=1, velocity=(a, b))
    mechanism.output("x", stone.position[0])
    assert existence_of(mechanism).orders == {"x": pytest.approx(2)}


def test_what_is_bounded_whatever_the_motion():
    mechanism = uqmbd.Mechanism("wheel", uqmbd.Spatial())
    wheel = mechanism.body("wheel", mass=1, inertia=(1, 1, 1))
    bounded = [
        wheel.quaternion[0],
        wheel.rotation[0, 2] ** 2,
        sympy.atan2(wheel.position[0], wheel.position[1]),
        2 * uqmbd.t * sympy.sin(wheel.position[0]),
    ]
    growing = [
        wheel.position[0],
        wheel.velocity[0] ** 2,
        1 / wheel.quaternion[0],
        sympy.exp(wheel.position[0]),
        sympy.sin(wheel.position[0]) * wheel.position[1],
        wheel.angular_velocity[0],
    ]
    assert [grows(e) for e in bounded] == [False] * len(bounded)
    assert [grows(e) for e in growing] == [True] * len(growing)


def test_outputs_without_a_time_have_no_such_moments_either():
    stiffness = uqmbd.RandomVariable("stiffness", chaospy.Pareto1(1.2, 100))
    mechanism = uqmbd.Mechanism("oscillator", uqmbd.Translational())
    mass = mechanism.body("mass", mass=2, position=(1, 0))
    mechanism.add(SpringDamper("spring", mechanism.ground, mass, (0, 0), (0, 0), stiffness))
    mechanism.output("frequency", uqmbd.eigenfrequency(1), units="Hz")
    with pytest.warns(uqmbd.StudyWarning, match="output 'frequency'"):
        tree = run(mechanism)
    statistics = tree["monte-carlo/scalars/statistics"]
    assert np.isfinite(statistics["mean"]).all() and np.isnan(statistics["std"]).all()


@pytest.mark.thorough
@pytest.mark.filterwarnings("ignore::uqmbd.StudyWarning")
def test_results_without_moments_are_stored_compared_and_reported(tmp_path):
    study = uqmbd.Study(
        "throw", thrown(chaospy.Cauchy()), TIMES,
        [MonteCarlo(samples=64, seed=1), MonteCarlo(samples=64, seed=2, sampling="latin-hypercube", label="lhs")],
    )  # fmt: skip
    tree = load(save(study.run(), tmp_path / "results.nc"))
    text = write_report(tree, tmp_path / "report.html").read_text()
    assert "moments of Cauchy" in text and "do not exist" in text
