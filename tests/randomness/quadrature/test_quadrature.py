"""Quadrature over germs: moments in closed form, combination against tensor products, accuracy for a basis."""

from __future__ import annotations

from math import comb, prod

import chaospy
import numpy as np
import pytest
import scipy.integrate
import scipy.stats

import uqmbd
from uqmbd.randomness import (
    GermSpace,
    JointInput,
    clenshaw_curtis,
    gauss_tensor,
    gram_error,
    index_set,
    monte_carlo_rule,
    smolyak,
    sparse_rule,
)
from uqmbd.randomness.quadrature.sparse_rules import combination_coefficients


def space_of(*distributions):
    return GermSpace.of(JointInput.of([uqmbd.RandomVariable(f"x{k}", d) for k, d in enumerate(distributions)]))


LAWS = {"hermite": scipy.stats.norm(), "legendre": scipy.stats.uniform(-1, 2), "laguerre": scipy.stats.gamma(2)}
MIXED = (chaospy.Normal(), chaospy.Uniform(), chaospy.Gamma(2))


def exact(space, powers):
    return prod(LAWS[germ.family].moment(int(n)) if n else 1.0 for germ, n in zip(space.germs, powers, strict=True))


def check_exactness(space, rule, first_wrong=True):
    """Exact for every monomial up to the degree that is told, and wrong for one above it."""
    degree = rule.exactness
    wrong = []
    for powers in index_set(space.dimension, degree + 1):
        value = rule.weights @ np.prod(rule.nodes**powers, axis=1)
        size = rule.weights @ np.prod(np.abs(rule.nodes) ** powers, axis=1)
        right = abs(value - exact(space, powers)) < 1e-10 * max(1, abs(size), exact(space, powers))
        if powers.sum() <= degree:
            assert right, powers
        else:
            wrong.append(not right)
    assert any(wrong) == first_wrong


@pytest.mark.parametrize("counts", [1, 2, 4, (3, 2, 5)])
def test_exactness_of_gauss_tensors(counts):
    space = space_of(*MIXED)
    rule = gauss_tensor(space, counts)
    numbers = [counts] * 3 if isinstance(counts, int) else counts
    assert len(rule) == prod(numbers) and rule.exactness == 2 * min(numbers) - 1
    check_exactness(space, rule)


@pytest.mark.thorough
@pytest.mark.parametrize("growth", ["slow", "linear"])
@pytest.mark.parametrize("level", [0, 1, 2, 3])
def test_exactness_of_smolyak_with_gauss(growth, level):
    space = space_of(*MIXED)
    rule = smolyak(space, level, growth)
    # 4 l + 1 in single germs is of use where there are fewer germs than levels
    assert rule.exactness == (9 if (growth, level) == ("linear", 3) else 2 * level + 1)
    assert rule.weights.sum() == pytest.approx(1, abs=1e-12)
    check_exactness(space, rule)


@pytest.mark.thorough
@pytest.mark.parametrize("level", [0, 1, 2, 3])
def test_exactness_of_clenshaw_curtis(level):
    space = space_of(chaospy.Uniform(), chaospy.Uniform(2, 3))
    check_exactness(space, clenshaw_curtis(space, level))
    check_exactness(space, smolyak(space, level, rule="clenshaw-curtis"))


def test_clenshaw_curtis_weights_of_the_literature():
    """Davis and Rabinowitz, Methods of Numerical Integration, 2.5.5: five nodes; their weights sum to 2."""
    rule = clenshaw_curtis(space_of(chaospy.Uniform()), 2)
    assert np.allclose(rule.nodes[:, 0], [-1, -np.sqrt(0.5), 0, np.sqrt(0.5), 1], atol=1e-15)
    assert np.allclose(2 * rule.weights, [1 / 15, 8 / 15, 4 / 5, 8 / 15, 1 / 15], rtol=1e-14)


def test_one_direction_of_smolyak_is_its_finest_rule_and_a_full_set_is_the_tensor():
    space = space_of(chaospy.Uniform())
    assert np.allclose(smolyak(space, 3).nodes, gauss_tensor(space, 4).nodes)
    assert np.allclose(smolyak(space, 3).weights, gauss_tensor(space, 4).weights)
    space = space_of(*MIXED)
    tensor = gauss_tensor(space, 3)
    sparse = sparse_rule(space, index_set(3, 2, "tensor"))
    order = np.lexsort(sparse.nodes.T[::-1])
    expected = np.lexsort(tensor.nodes.T[::-1])
    assert np.allclose(sparse.nodes[order], tensor.nodes[expected])
    assert np.allclose(sparse.weights[order], tensor.weights[expected], atol=1e-15)
    assert sparse.exactness == tensor.exactness


@pytest.mark.parametrize(("dimension", "level"), [(2, 3), (4, 2), (5, 4)])
def test_combination_factors_of_simplices(dimension, level):
    """Wasilkowski and Wozniakowski: ``(-1)**(L - |l|) binomial(d - 1, L - |l|)``."""
    rows = index_set(dimension, level)
    missing = level - rows.sum(axis=1)
    expected = [(-1) ** m * comb(dimension - 1, m) for m in missing.tolist()]
    assert combination_coefficients(rows).tolist() == expected


def test_equal_nodes_are_combined():
    """Published numbers of nodes of Smolyak with nested Clenshaw-Curtis rules (Novak and Ritter 1996): 2 d + 1 ..."""
    space = space_of(*[chaospy.Uniform()] * 5)
    assert [len(smolyak(space, level, rule="clenshaw-curtis")) for level in range(4)] == [1, 11, 61, 241]
    rule = smolyak(space_of(*[chaospy.Normal()] * 3), 3, "linear")
    rounded = rule.nodes.round(9) + 0.0
    assert len(np.unique(rounded, axis=0)) == len(rule)


def test_twenty_inputs():
    rule = smolyak(space_of(*[chaospy.Normal()] * 20), 2, "linear")
    assert rule.exactness == 5 and len(rule) < 1000
    assert rule.weights @ (rule.nodes[:, 3] ** 2 * rule.nodes[:, 17] ** 2) == pytest.approx(1, abs=1e-11)


def test_smooth_functions_of_other_germs_converge_with_nested_rules():
    space = space_of(chaospy.Normal(), chaospy.Triangle(0, 1, 3))
    exact = (
        np.exp(-0.5)
        * scipy.integrate.quad(lambda x: np.exp(-x) * scipy.stats.triang(1 / 3, 0, 3).pdf(x), 0, 3, points=[1])[0]
    )
    errors = []
    for level in (2, 4, 6):
        rule = clenshaw_curtis(space, level)
        assert np.isfinite(rule.nodes).all() and rule.exactness == 0
        x = space.to_inputs(rule.nodes)
        errors.append(abs(rule.weights @ (np.cos(x[:, 0]) * np.exp(-x[:, 1])) - exact))
    assert errors[2] < 1e-4 and errors[2] < errors[1] < errors[0]


def test_error_for_a_basis():
    space = space_of(*MIXED)
    for order in (1, 3):
        index = index_set(3, order)
        assert gram_error(space, gauss_tensor(space, order + 1), index) < 1e-11
        assert gram_error(space, smolyak(space, order), index) < 1e-9
        assert gram_error(space, gauss_tensor(space, order), index) == pytest.approx(1, abs=1e-9)
    samples = monte_carlo_rule(space, 4096, 1, "sobol")
    assert 0.001 < gram_error(space, samples, index_set(3, 2)) < 1


@pytest.mark.parametrize("sequence", ["random", "sobol", "halton"])
def test_sequences(sequence):
    space = space_of(*MIXED)
    rule = monte_carlo_rule(space, 2048, 5, sequence)
    again = monte_carlo_rule(space, 2048, 5, sequence)
    assert np.array_equal(rule.nodes, again.nodes) and rule.exactness == 0 and len(rule) == 2048
    assert not np.array_equal(rule.nodes, monte_carlo_rule(space, 2048, 6, sequence).nodes)
    bound = 4 if sequence == "random" else 1
    assert np.abs(rule.weights @ rule.nodes - [0, 0, 2]).max() < bound * np.sqrt(2 / 2048)
    for k, germ in enumerate(space.germs):
        assert scipy.stats.kstest(rule.nodes[:, k], LAWS[germ.family].cdf).pvalue > 1e-4


def test_rules_of_whole_numbers():
    space = space_of(chaospy.DiscreteUniform(1, 3), chaospy.Uniform(-1, 1))
    assert gauss_tensor(space, [3, 2]).exactness == 3
    rule = smolyak(space, 4)
    x = space.to_inputs(rule.nodes)
    assert rule.weights @ (x[:, 0] ** 4 * x[:, 1] ** 2) == pytest.approx(98 / 3 / 3, rel=1e-12)


WRONG = {
    "counts": (lambda s: gauss_tensor(s, [2, 3]), "counts has 2 entries; expected one number for all germs, or one number for each of the 3 germs"),
    "count": (lambda s: gauss_tensor(s, 0), "number of nodes of 'x0' is 0; expected a whole number of at least 1"),
    "too many": (lambda s: gauss_tensor(s, 1000), "1000000000 nodes for 3 germs exceed the limit of .* Use a sparse grid"),
    "level": (lambda s: smolyak(s, -1), "level is -1"),
    "growth": (lambda s: smolyak(s, 1, "fast"), "smolyak: growth is 'fast'; expected one of slow, linear"),
    "rule": (lambda s: smolyak(s, 1, rule="simpson"), "rule is 'simpson'; expected one of gauss, clenshaw-curtis"),
    "rule of levels": (lambda s: sparse_rule(s, [[0, 0, 0]], rule="simpson"), "sparse_rule: rule is 'simpson'; expected one of gauss"),
    "too many levels": (lambda s: sparse_rule(s, [[k, 0, 0] for k in range(40)], rule="clenshaw-curtis"), "sparse_rule: level .* use a lower level"),
    "holes": (lambda s: sparse_rule(s, [[0, 0, 0], [2, 0, 0]]), r"not downward closed: it contains \(2, 0, 0\), but not \(1, 0, 0\)"),
    "twice": (lambda s: sparse_rule(s, [[0, 0, 0], [0, 0, 0]]), "a row twice"),
    "shape": (lambda s: sparse_rule(s, [[0, 0]]), r"levels have the shape \(1, 2\)"),
    "nested level": (lambda s: clenshaw_curtis(s, [1, 2, -1]), "level of 'x2' is -1"),
    "sequence": (lambda s: monte_carlo_rule(s, 8, 1, "grid"), "sequence is 'grid'; expected one of 'random', 'latin-hypercube', 'sobol', 'halton'"),
    "no samples": (lambda s: monte_carlo_rule(s, 0, 1), "count is 0"),
    "no seed": (lambda s: monte_carlo_rule(s, 8, None), "seed is None"),
}  # fmt: skip


@pytest.mark.parametrize(("make", "words"), WRONG.values(), ids=WRONG)
def test_what_is_no_quadrature(make, words):
    with pytest.raises(uqmbd.StudyError, match=words):
        make(space_of(*MIXED))
