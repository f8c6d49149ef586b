"""The recipes of the page on other packages: their numbers against ours, and against closed forms."""

from __future__ import annotations

import chaospy
import numpy as np
import pytest

import uqmbd
from uqmbd.extend import labels, project
from uqmbd.randomness import JointInput
from uqmbd.results import PolynomialChaos
from uqmbd_collocation import Collocation
from uqmbd_montecarlo import MonteCarlo

from ..mechanisms import pendulum

FIRST, TOTAL = (0.313905, 0.442411, 0.0), (0.557589, 0.442411, 0.243684)
"""Of Ishigami's function, a = 7, b = 0.1 (Ishigami and Homma 1990; in closed form)."""


def ishigami(x):
    return np.sin(x[:, 0]) + 7 * np.sin(x[:, 1]) ** 2 + 0.1 * x[:, 2] ** 4 * np.sin(x[:, 0])


@pytest.fixture(scope="module")
def chaos():
    """Ishigami's function, projected: a surrogate of an output without a time."""
    inputs = [uqmbd.RandomVariable(f"x_{k}", chaospy.Uniform(-np.pi, np.pi)) for k in (1, 2, 3)]
    space = uqmbd.extend.GermSpace.of(JointInput.of(inputs))
    rule, terms = uqmbd.extend.gauss_tensor(space, [16, 16, 16]), space.basis(14, "total")
    values = ishigami(space.to_inputs(rule.nodes))[:, None]
    return PolynomialChaos(
        project(values, space.evaluate(rule.nodes, terms), rule.weights),
        terms,
        space,
        labels(["f"], space.inputs, None),
    )


def of_salib(space, evaluate, count):
    """The recipe of the page."""
    analyze = pytest.importorskip("SALib.analyze.sobol").analyze
    design = pytest.importorskip("SALib.sample.sobol")
    problem = {"num_vars": space.dimension, "names": list(space.inputs), "bounds": [[0.0, 1.0]] * space.dimension}
    inputs = space.to_inputs(space.from_uniform(design.sample(problem, count, seed=1)))
    return analyze(problem, evaluate(inputs), seed=1)


def test_ishigami_in_closed_form(chaos):
    assert chaos.sobol_first[:, 0] == pytest.approx(FIRST, abs=2e-4)
    assert chaos.sobol_total[:, 0] == pytest.approx(TOTAL, abs=2e-4)


@pytest.mark.thorough
def test_salib_finds_the_indices_of_ishigami_by_the_surrogate_and_by_the_function(chaos):
    """Within its own intervals (95 %, twice as wide: six indices at once)."""
    for evaluate in (lambda x: chaos.evaluate(x)[:, 0], ishigami):
        found = of_salib(chaos.space, evaluate, 2048)
        for index, exact in (("S1", FIRST), ("ST", TOTAL)):
            assert np.all(np.abs(found[index] - exact) < 2 * found[f"{index}_conf"] + 1e-3)


@pytest.mark.thorough
def test_salib_finds_our_indices_of_a_mechanism():
    """By the surrogate, and by simulation of few realisations with what `Problem.realise` returns."""
    study = uqmbd.Study(
        "pendulum", pendulum(loaded=True), np.linspace(0, 0.6, 4), [Collocation(order=4), MonteCarlo(samples=10)]
    )
    tree = study.run()
    chaos = uqmbd.results.surrogate(tree["collocation"])
    found = of_salib(chaos.space, lambda x: chaos.evaluate(x)[:, 0, -1], 1024)
    for index, ours in (("S1", chaos.sobol_first), ("ST", chaos.sobol_total)):
        assert np.all(np.abs(found[index] - ours[:, 0, -1]) < 2 * found[f"{index}_conf"] + 1e-3)
    problem = study.problem(study.propagators[1])
    simulated = of_salib(chaos.space, lambda x: problem.realise(x).response[:, 0, -1], 64)
    assert np.all(np.abs(simulated["S1"] - chaos.sobol_first[:, 0, -1]) < 2 * simulated["S1_conf"] + 1e-3)


@pytest.mark.thorough
def test_scikit_learn_takes_a_surrogate_as_a_predictor(chaos):
    """Its importances by permutation are twice the variance times the total index (Sobol' 2001, by Jansen's formula)."""
    from sklearn.base import BaseEstimator, RegressorMixin
    from sklearn.inspection import permutation_importance

    class Surrogate(RegressorMixin, BaseEstimator):
        def fit(self, X, y=None):
            self.chaos_ = chaos
            return self

        def predict(self, X):
            return self.chaos_.evaluate(X)[:, 0]

    inputs, _ = chaos.sample(4000, 3)
    model = Surrogate().fit(inputs)
    assert model.score(inputs, ishigami(inputs)) > 0.9999
    found = permutation_importance(
        model, inputs, ishigami(inputs), scoring="neg_mean_squared_error", n_repeats=8, random_state=0
    )
    variance = 13.844588
    assert found.importances_mean == pytest.approx(2 * variance * np.array(TOTAL), rel=0.06)
