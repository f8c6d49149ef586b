"""Bounds of the errors of mean and standard deviation against exact moments, over many seeds."""

from __future__ import annotations

import chaospy
import numpy as np
import pytest

import uqmbd
from uqmbd.extend import Verification, VerificationPoints, labels, statistics_dataset
from uqmbd.propagation.chaos.moment_errors import Stratum, moment_bounds
from uqmbd.randomness import GermBox, GermSpace, JointInput
from uqmbd.results import PolynomialChaos, propagator_node, stated_accuracy

NORMAL, UNIFORM = chaospy.Normal(0, 1), chaospy.Uniform(-1, 1)
SEEDS = 200
CASES = {  # function of the germs, order, distributions, error of the mean, exact mean and mean square
    "exponential": (lambda x: np.exp(0.4 * x[:, 0]), 1, [NORMAL], 0.0, np.exp(0.08), np.exp(0.32)),
    "shifted": (lambda x: np.exp(0.4 * x[:, 0]), 2, [NORMAL], 0.05, np.exp(0.08), np.exp(0.32)),
    "jump": (lambda x: np.sign(x[:, 0] - 0.3), 4, [UNIFORM], 0.02, -0.3, 1.0),
    "kink": (lambda x: np.abs(x[:, 0]), 2, [UNIFORM], 0.0, 0.5, 1 / 3),
    "long tail": (lambda x: np.exp(0.8 * x[:, 0]), 2, [NORMAL], 0.0, np.exp(0.32), np.exp(1.28)),
    "interaction": (lambda x: x[:, 0] + x[:, 0] * x[:, 1], 1, [NORMAL, NORMAL], 0.0, 0.0, 2.0),
    "missing term": (lambda x: x[:, 0] + 0.5 * (x[:, 1] ** 2 - 1), 1, [NORMAL, NORMAL], 0.1, 0.0, 1.5),
}


def projected(name):
    """The space, a chaos of few terms whose mean is wrong by a known number, its function and the exact moments."""
    function, order, distributions, off, mean, square = CASES[name]
    space = GermSpace.of(JointInput.of([uqmbd.RandomVariable(f"x{k}", one) for k, one in enumerate(distributions)]))
    rule, terms = uqmbd.extend.gauss_tensor(space, [60 // len(distributions)] * len(distributions)), space.basis(order)
    coefficients = (space.evaluate(rule.nodes, terms) * rule.weights[:, None]).T @ function(rule.nodes)
    coefficients[0] += off
    chaos = PolynomialChaos(coefficients[:, None, None], terms, space, labels(["y"], list(space.inputs), [0.0]))
    return chaos, function, mean, np.sqrt(square - mean**2)


def bounds(chaos, function, points, looks=1):
    seen = Verification(chaos.space, points, function(points.germs)[:, None, None], asked=len(points))
    found = Verification.moment_errors(chaos.mean, chaos.std, [chaos], [seen], [1.0], chaos.labels, looks=looks)
    return [found[f"error_bound_{name}"].item() for name in ("mean", "std")]


@pytest.mark.parametrize("count", [30, 128])
@pytest.mark.parametrize("case", CASES)
def test_bounds_exceed_the_true_errors_at_95_per_cent_of_seeds(case, count):
    """At least 93 % by both moments; and the bounds are no more than twice the error and four standard errors."""
    chaos, function, mean, std = projected(case)
    true = np.array([abs(chaos.mean.item() - mean), abs(chaos.std.item() - std)])
    points = [VerificationPoints.drawn(chaos.space, count, seed, 7) for seed in range(SEEDS)]
    found = np.array([bounds(chaos, function, one) for one in points])
    assert (found >= true).mean(axis=0).min() >= 0.93
    if case not in ("long tail", "jump"):
        many = VerificationPoints.drawn(chaos.space, 4096, 0, 8)
        wrong = function(many.germs) - chaos.evaluate_germs(many.germs)[:, 0, 0]
        products = wrong * (wrong + 2 * (chaos.evaluate_germs(many.germs)[:, 0, 0] - chaos.mean.item()))
        scatter = [(many.weights * x).std() for x in (wrong, products / (2 * chaos.std.item()))]
        assert (np.median(found, axis=0) <= 2 * true + 4 * np.array(scatter) / np.sqrt(count)).all()


def test_several_looks_have_wider_bounds():
    chaos, function, *_ = projected("exponential")
    points = VerificationPoints.drawn(chaos.space, 64, 0, 7)
    once, twice, four = (np.array(bounds(chaos, function, points, looks)) for looks in (1, 2, 4))
    assert np.array_equal(once, twice)  # each of two looks may be too small in 2.5 %, as one end of an interval
    assert (four > once).all()


def test_elements_weigh_their_realisations_by_probability():
    """A constant in each half of a kink |x|, with Student's t; the moments are those of |x|."""
    (space,) = {GermSpace.of(JointInput.of([uqmbd.RandomVariable("x", UNIFORM)]))}
    boxes = GermBox.whole(space).split(0)
    axes = labels(["y"], ["x"], [0.0])
    parts = [PolynomialChaos([[[0.4]]], [[0]], box.local, axes) for box in boxes]  # the mean is 0.5
    covered = []
    for seed in range(SEEDS):
        seen = []
        for number, box in enumerate(boxes):
            points = VerificationPoints.drawn(box.local, 20, seed, number)
            response = np.abs(box.local.to_inputs(points.germs))[:, :, None]
            seen.append(Verification(box.local, points, response, asked=20))
        found = Verification.moment_errors(np.array([[0.4]]), np.zeros((1, 1)), parts, seen, [0.5, 0.5], axes)
        covered.append([found["error_bound_mean"].item() >= 0.1, found["error_bound_std"].item() >= 12**-0.5])
    assert np.mean(covered, axis=0).min() >= 0.93


def test_probabilities_weigh_strata():
    """Errors 0 and 1 in parts of the probabilities 0.9 and 0.1, without scatter: the mean is wrong by 0.1."""
    zero, one = np.zeros((20, 1, 1)), np.ones((20, 1, 1))
    strata = [Stratum(0.9, zero, zero, np.ones(20)), Stratum(0.1, zero, one, np.ones(20))]
    mean, std = moment_bounds(np.zeros((1, 1)), np.zeros((1, 1)), strata)
    assert mean.item() == pytest.approx(0.1)
    assert std.item() == pytest.approx(0.1**0.5)  # at most, as the variance 0.09 is 0.1 minus a square of up to 0.1^2


@pytest.mark.parametrize("unit", [1e-200, 1e150])
def test_bounds_have_the_units_of_the_outputs(unit):
    chaos, function, *_ = projected("exponential")
    points = VerificationPoints.drawn(chaos.space, 64, 0, 7)
    scaled = PolynomialChaos(unit * chaos.coefficients, chaos.multi_index, chaos.space, chaos.labels)
    found = bounds(scaled, lambda x: unit * function(x), points)
    np.testing.assert_allclose(found, unit * np.array(bounds(chaos, function, points)), rtol=1e-9)


def test_few_realisations_state_no_bounds():
    chaos, function, *_ = projected("exponential")
    with pytest.raises(KeyError):
        bounds(chaos, function, VerificationPoints.drawn(chaos.space, 29, 0, 7))
    with pytest.raises(uqmbd.StudyError, match="found 1 chaoses, 0 verifications and 1 probabilities"):
        Verification.moment_errors(chaos.mean, chaos.std, [chaos], [], [1.0], chaos.labels)


def test_the_stated_accuracy_is_the_smaller_of_bound_and_root_mean_square():
    """The root mean square is 0.2 of the standard deviation; half-widths are 0.05 of it, or not below."""
    axes = labels(["x"], [], [0.0, 1.0])
    error = uqmbd.extend.StatedError([[0.2, 0.4]], "absolute", "root mean square error")
    for bound, expected in (([[0.02, 0.1]], 0.05), ([[0.02, 9.0]], 0.2)):
        plain = statistics_dataset(axes, mean=[[0.0, 0.0]], std=[[1.0, 2.0]], stated_error=error)
        more = {f"error_bound_{kind}": (("output", "time"), bound) for kind in ("mean", "std")}
        node = propagator_node("a", plain.assign(more), propagator="p", realisations=100, wall_time=0.0)
        assert stated_accuracy(node).value == pytest.approx(expected)
