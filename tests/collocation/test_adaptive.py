"""Refinements meet their tolerance against the truth, spend realisations where they matter, and none twice."""

from __future__ import annotations

import chaospy
import numpy as np
import pytest
import sympy

import uqmbd
from uqmbd.results import surrogate
from uqmbd_collocation import Collocation
from uqmbd_collocation.refinement import Limits, RefinementStep, UnmetWarning, warn_unmet

UNIFORM = chaospy.Uniform(-1, 1)


def moments(function):
    """Mean and standard deviation of a function of two inputs by a fine Gauss-Legendre tensor."""
    x, w = np.polynomial.legendre.leggauss(40)
    values, weights = function(x[:, None], x), np.outer(w, w) / 4
    mean = np.sum(weights * values)
    return mean, np.sqrt(np.sum(weights * (values - mean) ** 2))


def runge(a, b, sqrt=sympy.sqrt):
    """Smooth, but of slow decay in ``a``."""
    return 1 / (1 + 2 * a**2) + sqrt(3 + b) * (1 + a / 4)


def distinct(node):
    """Whether no point was computed twice."""
    germs = node["nodes"]["germs"].values.round(9)
    return len(np.unique(germs, axis=0)) == len(germs) == node.attrs["realisations"]


@pytest.mark.thorough
@pytest.mark.parametrize("tolerance", [1e-2, 1e-6])
@pytest.mark.parametrize(
    "options",
    [
        {"adaptive": "order", "order": 1},
        {"adaptive": "order", "order": 1, "rule": "smolyak"},
        {"adaptive": "order", "order": 1, "rule": "clenshaw-curtis"},
        {"adaptive": "order", "order": 1, "method": "regression"},
        {"adaptive": "dimension"},
    ],
    ids=lambda o: "-".join(map(str, o.values())),
)
@pytest.mark.filterwarnings("ignore::uqmbd.errors.SurrogateWarning")  # of 11 %, at the larger tolerance
def test_tolerance_is_met_against_the_truth(resting, options, tolerance):
    study = resting(runge, UNIFORM, UNIFORM)
    mean, std = moments(lambda a, b: runge(a, b, np.sqrt))
    node = study.propagate(Collocation(**options, tolerance=tolerance))
    assert node.attrs["tolerance_met"] == "True"
    assert abs(node["statistics"]["mean"][0, 0] - mean) < tolerance * std
    assert abs(node["statistics"]["std"][0, 0] - std) < tolerance * std
    assert distinct(node)
    steps = node["refinement"]
    # two verification realisations at extremes follow the refinement, and two in gaps if the error is above 10 %
    later = 2 + 2 * (tolerance == 1e-2 and options["adaptive"] == "order" and "method" in options)
    assert steps["realisations"].values[-1] + later == node.attrs["realisations"]
    assert node.attrs["verification"] == 14 + later
    assert steps["terms"].values[-1] == node.attrs["terms"]
    last = {name: float(steps[name][-1]) for name in ("change_mean", "change_std", "missed_std")}
    assert max(last.values()) < tolerance


@pytest.mark.parametrize("adaptive", ["order", "dimension"])
@pytest.mark.filterwarnings("ignore::uqmbd.errors.SurrogateWarning")  # of 18 %, at the larger error
def test_a_refinement_with_a_maximum_error_ends_at_the_first_step_with_a_smaller_error(resting, adaptive):
    """The error of the surrogate by 4,096 points of the closed form; a smaller error needs more realisations."""
    study, costs = resting(runge, UNIFORM, UNIFORM), []
    points = 2 * chaospy.create_sobol_samples(4096, 2) - 1
    true = runge(*points, sqrt=np.sqrt)
    for error in (0.2, 0.02, 0.002):
        node = study.propagate(Collocation(adaptive=adaptive, order=1, max_error=error))
        found = surrogate(node).evaluate(points.T)[:, 0, 0]
        assert np.sqrt(np.mean((found - true) ** 2)) < 2 * error * true.std()
        steps = node["refinement"]["missed_std"].values
        errors = np.sqrt(2 * steps / (1 - 2 * steps))
        assert errors[-1] <= error and (errors[:-1] > error).all()
        costs.append(node.attrs["realisations"])
        assert node.attrs["tolerance_met"] == "True" and distinct(node)
    assert costs == sorted(set(costs))


def test_a_maximum_error_that_is_not_reached_is_reported(resting):
    study = resting(runge, UNIFORM, UNIFORM)
    with pytest.warns(UnmetWarning, match="max_error 1e-09 was not met with .* realisations: the error at the"):
        study.propagate(Collocation(adaptive="dimension", max_error=1e-9, max_realisations=60))


@pytest.mark.parametrize("adaptive", ["order", "dimension"])
def test_an_output_that_is_zero_does_not_prevent_the_end_of_a_refinement(adaptive):
    speed = uqmbd.RandomVariable("speed", chaospy.Uniform(1, 2), units="m/s")
    mechanism = uqmbd.Mechanism("body", uqmbd.Translational())
    body = mechanism.body("body", mass=1, velocity=(speed, 0))
    for name, value in zip("xy", body.position, strict=True):
        mechanism.output(name, value, units="m")
    node = uqmbd.Study("s", mechanism, [0, 1], []).propagate(Collocation(adaptive=adaptive, max_error=0.01))
    assert node.attrs["tolerance_met"] == "True" and node.attrs["realisations"] < 40


def test_a_tolerance_beside_a_maximum_error_has_no_effect_and_is_reported():
    with pytest.warns(uqmbd.StudyWarning, match="tolerance=0.5 has no effect with max_error=0.01"):
        Collocation(adaptive="order", max_error=0.01, tolerance=0.5)


@pytest.mark.parametrize(
    "options", [{}, {"adaptive": "order", "verify": 0}, {"adaptive": "order", "alignment": "phase"}], ids=str
)
def test_a_maximum_error_without_a_refinement_or_verification_is_refused(options):
    with pytest.raises(uqmbd.StudyError, match="max_error=0.01 ends a refinement by the error of realisations"):
        Collocation(max_error=0.01, **options)


@pytest.mark.thorough
def test_orders_of_nested_designs_use_every_realisation_again(resting, chaos_of):
    """All that was computed enters the last fit; Gauss rules of different orders share nothing but the middle."""
    study = resting(runge, UNIFORM, UNIFORM)
    for options in ({"method": "regression"}, {"method": "omp"}):
        node = study.propagate(Collocation(adaptive="order", order=1, **options))
        assert set(node["nodes"]["purpose"].values) == {"fit", "verification"}, options
        assert node.attrs["realisations"] == node.attrs["nodes"] + 16
    node = study.propagate(Collocation(adaptive="order", order=1))
    rules = [np.polynomial.legendre.leggauss(order + 1)[0] for order in range(1, node.attrs["highest_degree"] + 1)]
    points = {(round(a, 9), round(b, 9)) for x in rules for a in x for b in x}
    assert node.attrs["realisations"] == len(points) + 16


def test_dimensions_that_matter_get_the_nodes(resting):
    """exp(3 a) + 0.1 b + 0.001 c d: degrees in a, hardly any in the others."""
    study = resting(lambda a, b, c, d: sympy.exp(3 * a) + b / 10 + c * d / 1000, *[UNIFORM] * 4)
    node = study.propagate(Collocation(adaptive="dimension", tolerance=1e-6))
    degrees = node["chaos"]["multi_index"].values.max(axis=0)
    assert degrees[0] >= 8
    assert degrees[1] <= 4 and degrees[2] <= 4 and degrees[3] <= 4
    # a tensor of the same degrees takes 11^4 nodes, a total degree of 10 has 1001 terms
    assert node.attrs["realisations"] < 80
    std = np.sqrt(np.sinh(6) / 6 - (np.sinh(3) / 3) ** 2 + 0.01 / 3 + 1e-6 / 9)
    assert float(node["statistics"]["std"][0, 0]) == pytest.approx(std, rel=1e-6)


@pytest.mark.thorough
def test_verification_contradicts_steps_that_agree_by_chance(resting):
    """Orders 2 and 3 of cos(3 a) agree, for it is even; an interaction has no main effect that would show it."""
    even = resting(lambda a: sympy.cos(6 * a), UNIFORM)
    std = np.sqrt(0.5 + np.sin(12) / 24 - (np.sin(6) / 6) ** 2)
    for options in ({"adaptive": "order", "order": 0}, {"adaptive": "dimension"}):
        node = even.propagate(Collocation(**options))
        assert float(node["statistics"]["std"][0, 0]) == pytest.approx(std, rel=1e-3), options
    pure = resting(lambda a, b, c: a * b * c, *[UNIFORM] * 3)
    node = pure.propagate(Collocation(adaptive="dimension"))
    assert float(node["statistics"]["std"][0, 0]) == pytest.approx(3**-1.5, rel=1e-10)


@pytest.mark.thorough
@pytest.mark.parametrize(
    ("options", "reason"),
    [
        ({"adaptive": "order"}, "order 32 is the highest"),
        ({"adaptive": "dimension"}, "the level 12 is the highest possible one"),
        ({"adaptive": "order", "max_realisations": 60}, "max_realisations is 60"),
        ({"adaptive": "dimension", "max_realisations": 60}, "max_realisations is 60"),
    ],
    ids=str,
)
def test_a_tolerance_that_cannot_be_met_is_reported(resting, warned, options, reason):
    study = resting(lambda a: sympy.Abs(a - sympy.Rational(1, 10)), UNIFORM)
    node, messages = warned(lambda: study.propagate(Collocation(tolerance=1e-7, **options)))
    (message,) = messages
    # two verification realisations at extremes follow the refinement
    assert f"the tolerance 1e-07 was not met with {node.attrs['realisations'] - 2} realisations" in message
    assert reason in message
    assert "try a smaller rtol" in message
    assert node.attrs["tolerance_met"] == "False"
    assert node.attrs["realisations"] <= options.get("max_realisations", 5000)
    # E|a - 0.1| = (1.1^2 + 0.9^2) / 4
    assert float(node["statistics"]["mean"][0, 0]) == pytest.approx(0.505, rel=0.02)


def test_weights_that_skip_orders_do_not_end_a_refinement(resting):
    """With weights of 2 the orders 1, 3, 5 have no terms of their own."""
    study = resting(lambda a, b: sympy.exp(a + b), UNIFORM, UNIFORM)
    node = study.propagate(Collocation(adaptive="order", order=1, weights=(2, 2), tolerance=1e-4))
    variance = (np.sinh(2) / 2) ** 2 - np.sinh(1) ** 4
    assert float(node["statistics"]["std"][0, 0]) == pytest.approx(np.sqrt(variance), rel=1e-4)


@pytest.mark.filterwarnings("ignore::uqmbd.errors.SurrogateWarning")  # of the rough output
def test_an_output_below_the_accuracy_of_the_integration_does_not_drive_a_refinement(resting):
    """A second output varies by 1e-10 of its mean, in many degrees: rtol is 1e-6."""
    rough = {"rough": lambda a: 1 + sympy.Abs(a) / 10**10}
    study = resting(lambda a: a**2, UNIFORM, **rough)
    node = study.propagate(Collocation(adaptive="order", order=1, tolerance=1e-3))
    assert node.attrs["tolerance_met"] == "True"
    assert node.attrs["highest_degree"] <= 4


def test_progress_is_one_piece_of_work(resting):
    told = []

    class Listener:
        def start(self, label, total):
            told.append(("start", label, total))

        def advance(self, label, count=1):
            told.append(("advance", count))

        def finish(self, label):
            told.append(("finish", label))

    study = resting(runge, UNIFORM, UNIFORM)
    node = study.propagate(Collocation(adaptive="dimension"), progress=Listener())
    assert told[0] == ("start", "collocation", 5000)
    assert told[-1] == ("finish", "collocation")
    assert {entry[0] for entry in told[1:-1]} == {"advance"}
    assert sum(entry[1] for entry in told[1:-1]) == node.attrs["realisations"]


@pytest.mark.parametrize(
    ("helpful", "change", "words"),
    [
        (
            "realisations",
            0.5,
            "Monte Carlo needs no more realisations than this method for this tolerance; use Monte Carlo",
        ),
        ("samples", 0.5, "Monte Carlo needs no more realisations than this method for this tolerance; use Monte Carlo"),
        ("neither", 0.5, ""),  # failures, or no further terms
        ("realisations", 1e-5, ""),  # below a hundred relative tolerances: the noise of the integration
        ("samples", 1e-5, ""),
    ],
)
def test_samples_are_advised_only_where_they_would_help(helpful, change, words):
    """Some changes that do not fall have causes that samples do not remove."""
    limits = Limits(tolerance=1e-6, most=100, rtol=1e-6)
    steps = [RefinementStep(n, n, change, change) for n in (10, 20, 40, 80)]
    with pytest.warns(UnmetWarning) as seen:
        warn_unmet("mine", limits, steps, "a reason", helpful)
    said = str(seen[0].message)
    assert "a reason. Changes of this size may be integration errors" in said
    assert ("Monte Carlo" in said) == bool(words) and words in said
    assert ("changes fell with the power" in said) == bool(words)


@pytest.mark.parametrize("helpful", ["realisations", "samples", "neither"])
def test_a_number_of_realisations_is_stated_only_where_they_are_the_limit(helpful):
    """A refinement that ends at its highest order cannot use more of them."""
    steps = [RefinementStep(n, n, 10 / n, 10 / n) for n in (10, 20, 40, 80)]
    with pytest.warns(UnmetWarning) as seen:
        warn_unmet("mine", Limits(tolerance=1e-2, most=100, rtol=1e-9), steps, "a reason", helpful)
    assert ("about 1000 would meet" in str(seen[0].message)) == (helpful == "realisations")
    assert "Monte Carlo" not in str(seen[0].message)
