"""Expansions and rules of chaospy: the same chaos as chaospy computes, told or refused where they do not fit."""

from __future__ import annotations

import json
from dataclasses import replace

import chaospy
import numpy as np
import pytest

import uqmbd
from uqmbd_collocation import Collocation

from ..mechanisms import oscillator, pendulum

TIMES = np.linspace(0, 0.6, 4)


@pytest.fixture(scope="module")
def study():
    return uqmbd.Study("pendulum", pendulum(loaded=True), TIMES, [Collocation(order=2)])


def joint_of(study):
    return chaospy.J(*(variable.distribution for variable in study.mechanism.inputs.variables))


def simulated(study, inputs):
    return study.problem(study.propagators[0]).realise(inputs).response


RULES = {"tensor": {"order": 5, "sparse": False}, "sparse, with negative weights": {"order": 5, "sparse": True}}


@pytest.mark.parametrize("rule", RULES.values(), ids=RULES)
@pytest.mark.parametrize("options", [{"normed": True}, {"normed": False}, {"cross_truncation": 0.7}], ids=str)
def test_it_is_the_projection_that_chaospy_computes(study, options, rule):
    """``chaospy.fit_quadrature`` with the responses at the same nodes; evaluated at random inputs, in their own units."""
    joint = joint_of(study)
    expansion = chaospy.generate_expansion(2, joint, **options)
    nodes, weights = chaospy.generate_quadrature(dist=joint, rule="gaussian", **rule)
    assert (weights.min() < 0) == rule["sparse"]
    node = study.propagate(Collocation(expansion=expansion, nodes=nodes, weights=weights))
    chaos = uqmbd.results.surrogate(node)
    response = simulated(study, nodes.T)[:, 0]
    theirs = chaospy.fit_quadrature(expansion, nodes, weights, response)
    x = joint.sample(20, seed=1)
    expected = np.array([p(*x) for p in theirs])
    assert np.allclose(chaos.evaluate(x.T)[:, 0].T, expected, rtol=0, atol=1e-8)
    assert chaos.verification_error("x", float(TIMES[-1])) < 0.1


def test_the_same_terms_and_nodes_are_the_same_chaos_as_ours(study):
    """chaospy's Gauss nodes of order 3 are our four."""
    joint = joint_of(study)
    nodes, weights = chaospy.generate_quadrature(3, joint, rule="gaussian")
    given = Collocation(expansion=chaospy.generate_expansion(3, joint), nodes=nodes, weights=weights)
    theirs, ours = (uqmbd.results.surrogate(study.propagate(method)) for method in (given, Collocation(order=3)))
    inputs, expected = ours.sample(30, 2)
    assert np.allclose(theirs.evaluate(inputs), expected, rtol=0, atol=1e-9)
    assert np.allclose(theirs.sobol_total, ours.sobol_total, rtol=0, atol=1e-8)


def test_an_expansion_that_leaves_out_products_is_projected_on(study):
    """No interaction: what is left is the chaos without its terms of both inputs."""
    joint = joint_of(study)
    nodes, weights = chaospy.generate_quadrature(4, joint, rule="gaussian")
    full = chaospy.generate_expansion(2, joint)
    alone = chaospy.polynomial([p for p in full if not any(min(e) for e in p.exponents.tolist())])
    assert len(alone) == len(full) - 1
    chaos = uqmbd.results.surrogate(study.propagate(Collocation(expansion=alone, nodes=nodes, weights=weights)))
    whole = uqmbd.results.surrogate(study.propagate(Collocation(expansion=full, nodes=nodes, weights=weights)))
    both = (chaos.multi_index > 0).all(axis=1)
    assert np.abs(chaos.coefficients[both]).max(initial=0) < 1e-12
    assert np.allclose(chaos.coefficients[~both], whole.coefficients[~(whole.multi_index > 0).all(axis=1)], atol=1e-10)


def test_it_is_stored_recorded_and_compared(study, tmp_path):
    joint = joint_of(study)
    nodes, weights = chaospy.generate_quadrature(3, joint, rule="gaussian")
    method = Collocation(expansion=chaospy.generate_expansion(2, joint), nodes=nodes, weights=weights, label="given")
    other = Collocation(expansion=chaospy.generate_expansion(2, joint), nodes=nodes[:, ::-1], weights=weights[::-1])
    assert replace(method, verify=8).expansion == method.expansion != other.expansion
    tree = uqmbd.Study("pendulum", study.mechanism, TIMES, [method]).run()
    recorded = json.loads(tree["given"].attrs["options"])["expansion"]
    assert recorded.startswith("6 polynomials, 16 nodes (") and len(recorded) < 50
    uqmbd.results.save(tree, tmp_path / "results.nc")
    again = uqmbd.results.surrogate(uqmbd.results.load(tmp_path / "results.nc")["given"])
    x = nodes.T
    assert np.array_equal(again.evaluate(x), uqmbd.results.surrogate(tree["given"]).evaluate(x))
    assert method.estimate(study).realisations == 16 + 16


def test_what_does_not_belong_to_the_inputs_is_reported_or_refused(study):
    joint = joint_of(study)
    nodes, weights = chaospy.generate_quadrature(3, joint, rule="gaussian")
    wrong = chaospy.generate_expansion(2, chaospy.J(chaospy.Normal(1.0, 0.02), chaospy.Uniform(0.9, 1.2)))
    why = Collocation(expansion=wrong, nodes=nodes, weights=weights).obstacle(study)
    assert "not orthogonal for the distributions of length, mass (in this order)" in why
    near = chaospy.generate_expansion(2, chaospy.J(chaospy.Normal(1.0, 0.02), chaospy.Uniform(0.801, 1.2)))
    with pytest.warns(UserWarning, match="not orthogonal .* the largest correlation of two of them is 0.0"):
        study.propagate(Collocation(expansion=near, nodes=nodes, weights=weights))
    swapped = Collocation(
        expansion=chaospy.generate_expansion(2, joint), nodes=nodes[::-1] + [[0], [0.5]], weights=weights
    )
    assert "outside the support" in swapped.obstacle(study)
    coarse, by = chaospy.generate_quadrature(1, joint, rule="gaussian")
    assert "does not resolve the 10 terms" in Collocation(
        expansion=chaospy.generate_expansion(3, joint), nodes=coarse, weights=by
    ).obstacle(study)
    one, by = chaospy.generate_quadrature(3, chaospy.Normal(1.0, 0.02), rule="gaussian")
    single = Collocation(expansion=chaospy.generate_expansion(2, chaospy.Normal(1.0, 0.02)), nodes=one, weights=by)
    assert "the nodes have 1 inputs, but the mechanism has 2 (length, mass, in this order)" in single.obstacle(study)


def test_inputs_that_are_no_multiples_of_their_germs_are_refused():
    lognormal = chaospy.LogNormal(4.5, 0.1)
    nodes, weights = chaospy.generate_quadrature(4, lognormal, rule="gaussian")
    expansion = chaospy.generate_expansion(2, lognormal)
    method = Collocation(expansion=expansion, nodes=nodes, weights=weights)
    study = uqmbd.Study("oscillator", oscillator(uqmbd.RandomVariable("k", lognormal)), TIMES, [method])
    assert "the expansion is not a polynomial of the germs" in method.obstacle(study)
    pair = uqmbd.random_vector(["c", "k"], chaospy.MvNormal([0.1, 90], [[1e-4, 0.01], [0.01, 9]]))
    joint = chaospy.J(chaospy.Normal(0.1, 0.01), chaospy.Normal(90, 3))
    nodes, weights = chaospy.generate_quadrature(2, joint, rule="gaussian")
    method = Collocation(expansion=chaospy.generate_expansion(2, joint), nodes=nodes, weights=weights)
    study = uqmbd.Study("oscillator", oscillator(pair[1], damping=pair[0]), TIMES, [method])
    assert "expansion= requires independent inputs, but some inputs are dependent" in method.obstacle(study)


JOINT = chaospy.J(chaospy.Normal(1.0, 0.02), chaospy.Uniform(0.8, 1.2))
EXPANSION = chaospy.generate_expansion(2, JOINT)
NODES, WEIGHTS = chaospy.generate_quadrature(3, JOINT, rule="gaussian")

WRONG = {
    "no polynomials": ({"expansion": 3, "nodes": NODES, "weights": WEIGHTS}, "expansion is '3'; expected polynomials of chaospy"),
    "no rule": ({"expansion": EXPANSION, "nodes": NODES}, "expansion= also requires weights="),
    "no nodes": ({"expansion": EXPANSION, "weights": WEIGHTS}, "expansion= also requires nodes="),
    "nodes turned round": ({"expansion": EXPANSION, "nodes": NODES.T, "weights": WEIGHTS}, r"nodes have the shape \(16, 2\), and weights have the shape \(16,\)"),
    "weights of another sum": ({"expansion": EXPANSION, "nodes": NODES, "weights": 2 * WEIGHTS}, "the sum of the weights is 2; expected"),
    "a weight that is no number": ({"expansion": EXPANSION, "nodes": NODES, "weights": np.where(WEIGHTS > 0.05, np.nan, WEIGHTS)}, "weights contain NaN or infinity"),
    "an infinite node": ({"expansion": EXPANSION, "nodes": np.where(NODES > 1.1, np.inf, NODES), "weights": WEIGHTS}, "nodes contain NaN or infinity"),
    "nodes of one input": ({"expansion": EXPANSION, "nodes": NODES[:1], "weights": WEIGHTS}, "nodes have 1 rows, but the expansion has 2 variables"),
    "a matrix of polynomials": ({"expansion": chaospy.polynomial([[EXPANSION[1]]]), "nodes": NODES, "weights": WEIGHTS}, r"has the shape \(1, 1\)"),
    "an order": ({"expansion": EXPANSION, "nodes": NODES, "weights": WEIGHTS, "order": 2}, "order=2 cannot be combined with expansion="),
    "a rule": ({"expansion": EXPANSION, "nodes": NODES, "weights": WEIGHTS, "rule": "smolyak"}, "rule='smolyak' cannot be combined with expansion="),
    "a regression": ({"expansion": EXPANSION, "nodes": NODES, "weights": WEIGHTS, "method": "regression"}, "method='regression' cannot be combined"),
    "elements": ({"expansion": EXPANSION, "nodes": NODES, "weights": WEIGHTS, "elements": 2}, "elements=2 cannot be combined with expansion="),
    "nodes alone": ({"nodes": NODES}, r"nodes is an array of the shape \(2, 16\); expected a whole number of 1 or more for each input. An array of nodes or weights also requires expansion="),
    "text": ({"nodes": "many"}, "nodes is 'many'; expected a whole number, 1 or more for each input"),
}  # fmt: skip


@pytest.mark.parametrize(("options", "words"), WRONG.values(), ids=WRONG)
def test_what_is_refused(options, words):
    with pytest.raises(uqmbd.StudyError, match=words):
        Collocation(**options)
