"""Records that are chosen at random: each realisation is that of its record alone."""

from __future__ import annotations

import chaospy
import numpy as np
import pytest
import scipy.stats
from scipy.integrate import solve_ivp
from scipy.interpolate import CubicSpline

import uqmbd
from uqmbd.laws import random_record
from uqmbd_montecarlo import MonteCarlo
from uqmbd_springs import PointForce, SpringDamper

TIMES = np.linspace(0, 2, 21)


def mechanism(force, stiffness=40):
    made = uqmbd.Mechanism("mass", uqmbd.Line())
    mass = made.body("mass", mass=1)
    made.add(SpringDamper("spring", made.ground, mass, (0,), (0,), stiffness=stiffness, damping=1))
    made.add(PointForce("shaker", mass, (0,), (force,)))
    made.output("x", mass.position[0], units="m")
    return made


def number(count, law=None):
    return uqmbd.RandomVariable("record", law or chaospy.DiscreteUniform(0, count - 1), units="1")


@pytest.mark.parametrize("count", [2, pytest.param(7, marks=pytest.mark.thorough)])
def test_each_realisation_is_that_of_its_record(count):
    """Compared with runs of each record by SciPy, also where another input is random."""
    records = np.random.default_rng(count).normal(size=(count, len(TIMES))).cumsum(1)
    stiffness = uqmbd.RandomVariable("stiffness", chaospy.Uniform(30, 50), units="N/m")
    made = mechanism(random_record(number(count), TIMES, records), stiffness)
    samples = uqmbd.Study("s", made, TIMES, rtol=1e-8).propagate(MonteCarlo(samples=12, seed=2))["samples"].to_dataset()
    drawn = samples["inputs"].sel(input="record").values
    assert set(drawn) <= set(range(count)) and len(set(drawn)) > 1
    for which, k, x in zip(
        drawn, samples["inputs"].sel(input="stiffness").values, samples["response"].values[:, 0], strict=True
    ):
        force = CubicSpline(TIMES, records[int(which)])
        alone = solve_ivp(
            lambda t, y, force=force, k=k: [y[1], force(t) - k * y[0] - y[1]], (0, 2), [0, 0], t_eval=TIMES, rtol=1e-10, atol=1e-12
        ).y[0]  # fmt: skip
        np.testing.assert_allclose(x, alone, atol=1e-6)


@pytest.mark.thorough
def test_it_is_the_same_as_separate_studies():
    records = np.random.default_rng(3).normal(size=(3, len(TIMES))).cumsum(1)
    which = number(3, scipy.stats.randint(0, 3))
    study = uqmbd.Study("s", mechanism(random_record(which, TIMES, records)), TIMES)
    samples = study.propagate(MonteCarlo(samples=20, seed=2))["samples"].to_dataset()
    alone = [uqmbd.simulate(mechanism(uqmbd.spline(TIMES, one)), TIMES)["x"].values for one in records]
    for k, x in zip(samples["inputs"].values[:, 0], samples["response"].values[:, 0], strict=True):
        np.testing.assert_allclose(x, alone[int(k)], rtol=0, atol=1e-6)


@pytest.mark.parametrize(
    ("law", "words"),
    [
        (chaospy.Uniform(0, 2), "whose values are not whole numbers; expected the number of a record, such as"),
        (chaospy.DiscreteUniform(1, 3), "whose values are from 1 to 3; expected whole numbers from 0 to 2"),
        (chaospy.DiscreteUniform(0, 3), "whose values are from 0 to 3; expected whole numbers from 0 to 2"),
        (chaospy.DiscreteUniform(0, 1), "whose values are from 0 to 1; expected whole numbers from 0 to 2"),
    ],
)
def test_numbers_of_other_records_are_refused(law, words):
    with pytest.raises(uqmbd.StudyError, match=words):
        random_record(number(3, law), TIMES, np.zeros((3, len(TIMES))))


def test_records_of_another_length_are_refused():
    with pytest.raises(uqmbd.StudyError, match="spline"):
        random_record(number(2), TIMES, [np.zeros(len(TIMES)), np.zeros(3)])
    with pytest.raises(uqmbd.StudyError, match="records is empty"):
        random_record(number(2), TIMES, [])
