"""Sparse grids reproduce every polynomial that they resolve, and converge with their level to closed forms."""

from __future__ import annotations

import dataclasses
import itertools

import chaospy
import numpy as np
import pytest
import scipy.integrate
import scipy.special

import uqmbd
from uqmbd.randomness import GermSpace, JointInput
from uqmbd.results import Status
from uqmbd_collocation import Collocation
from uqmbd_collocation.plans import Plans
from uqmbd_collocation.runs import CollocationRuns

FAMILIES = {
    "hermite": chaospy.Normal(1, 2),
    "legendre": chaospy.Uniform(-2, 3),
    "jacobi": chaospy.Beta(2, 5),
    "laguerre": chaospy.Gamma(1.5),
    "two values": chaospy.Binomial(1, 0.3),
    "six values": chaospy.DiscreteUniform(1, 6),
    "triangle": chaospy.Triangle(0, 0.3, 1),
    "truncated": chaospy.Trunc(chaospy.Normal(0, 1), -1, 3),
    "lognormal": chaospy.LogNormal(0, 0.3),
}


def space_of(*distributions):
    return GermSpace.of(JointInput.of([uqmbd.RandomVariable(f"x{k}", one) for k, one in enumerate(distributions)]))


class Source:
    """Realisations of a function of inputs (K, d), without a mechanism."""

    label, rtol = "test", 1e-6

    def __init__(self, function):
        self.function = function

    def realise(self, values):
        """Evaluate the function at each row; what is not finite has failed."""
        response = self.function(values)
        status = np.where(np.isfinite(response), Status.OK, Status.NOT_FINITE)
        messages = tuple("" if ok else "it is too far" for ok in np.isfinite(response))
        return uqmbd.extend.Realisations(values, response[:, None, None], status, messages, {}, 0.0)


def plans(method):
    """Return the plans of a method, of its options."""
    return Plans("test", **{f.name: getattr(method, f.name) for f in dataclasses.fields(Plans) if f.name != "label"})


def planned(space, **options):
    method = Collocation(rule="smolyak", max_realisations=10**6, verify=0, **options)
    plan = plans(method).plan(space, method.order)
    plan.check(space)
    return plan


def fitted(space, function, **options):
    """The fit of a function of inputs (K, d)."""
    return planned(space, **options).fit(CollocationRuns(Source(function), space))


def moments(fit):
    """Mean and standard deviation of a fit."""
    coefficients = fit.coefficients[:, 0, 0]
    return coefficients[0], np.sqrt(np.sum(coefficients[1:] ** 2))


def resolved(space, level):
    """Terms that a level resolves, by their definition: a degree k of one input needs the level ceil(k / 2)."""
    highest = [2 * level if germ.values is None else min(germ.values - 1, 2 * level) for germ in space.germs]
    every = itertools.product(*(range(k + 1) for k in highest))
    return np.array([term for term in every if sum((k + 1) // 2 for k in term) <= level])


def largest_error(space, level, draw, order=None):
    """Fit a random polynomial of the resolved terms; return the largest error of a coefficient, over the largest."""
    terms = resolved(space, level)
    coefficients = draw.normal(size=len(terms)) * (draw.uniform(size=len(terms)) < draw.choice([0.05, 0.5, 1.0]))
    coefficients[draw.integers(len(terms))] = 1.0

    def polynomial(values):
        return space.evaluate(space.to_germs(values), terms) @ coefficients

    fit = fitted(space, polynomial, level=level, order=order)
    expected = dict(zip(map(tuple, terms.tolist()), coefficients, strict=True))
    found = dict(zip(map(tuple, fit.multi_index.tolist()), fit.coefficients[:, 0, 0], strict=True))
    assert set(found) == {term for term in expected if order is None or sum(term) <= order}
    assert not fit.multi_index[0].any()
    return max(abs(value - expected[term]) for term, value in found.items()) / np.abs(coefficients).max()


def random_space(draw, dimension):
    return space_of(*(FAMILIES[name] for name in draw.choice(list(FAMILIES), dimension)))


@pytest.mark.parametrize("family", FAMILIES)
def test_polynomials_of_each_family_are_reproduced(family):
    draw = np.random.default_rng(1)
    for dimension, level in ((1, 0), (1, 3), (2, 2), (3, 1)):
        assert largest_error(space_of(*[FAMILIES[family]] * dimension), level, draw) < 1e-12


@pytest.mark.slow
def test_random_polynomials_of_random_inputs_are_reproduced():
    """No term is mixed with another one: 300 polynomials of 1 to 6 inputs of any families, levels 0 to 5."""
    draw = np.random.default_rng(2)
    for _ in range(300):
        dimension, level = int(draw.integers(1, 7)), int(draw.integers(0, 6))
        if dimension + level > 8:
            continue
        space = random_space(draw, dimension)
        order = None if draw.uniform() < 0.5 else int(draw.integers(0, level + 1))
        assert largest_error(space, level, draw, order) < 1e-12, (space.germs, level, order)


def test_an_order_takes_few_levels_that_resolve_it():
    """Order 3 of three inputs needs (2, 0, 0), (1, 1, 0), (1, 1, 1), not (2, 1, 0); (3, 0, 0) replaces (2, 0, 0)."""
    space = space_of(*[chaospy.Normal(0, 1)] * 3)
    plan = planned(space, order=3)
    np.testing.assert_array_equal(plan.multi_index, uqmbd.extend.index_set(3, 3))
    assert len(plan.nodes) == 1 + 3 * (2 + 6) + 3 * 2**2 + 2**3
    terms = uqmbd.extend.index_set(3, 3)
    coefficients = np.random.default_rng(3).normal(size=len(terms))
    fit = fitted(space, lambda x: space.evaluate(x, terms) @ coefficients, order=3)
    np.testing.assert_allclose(fit.coefficients[:, 0, 0], coefficients, atol=1e-12)
    # the weights of inputs save realisations
    assert len(planned(space, order=3, weights=(1, 3, 3)).nodes) == 1 + 6 + 2 * 4


def test_weights_of_nodes_are_those_of_the_mean():
    space = random_space(np.random.default_rng(4), 3)
    fit = fitted(space, lambda x: np.cos(x).prod(axis=1), level=3)
    assert fit.weights.sum() == pytest.approx(1, abs=1e-12)
    nodes = space.to_inputs(planned(space, level=3).nodes)
    assert fit.weights @ np.cos(nodes).prod(axis=1) == pytest.approx(moments(fit)[0], abs=1e-12)


@pytest.mark.filterwarnings("ignore::uqmbd.errors.SurrogateWarning")  # of a low level
def test_an_order_beyond_the_level_is_refused(resting):
    study = resting(lambda a, b, c: a * b * c, *[chaospy.Uniform(-1, 1)] * 3)
    message = (
        r"level=2 of rule='smolyak' does not resolve 1 of the 20 terms of order=3. Use order=None \(all terms that "
        r"the level resolves\), level=3, or omit level"
    )
    with pytest.raises(uqmbd.StudyError, match=message):
        study.propagate(Collocation(rule="smolyak", order=3, level=2))
    assert study.propagate(Collocation(rule="smolyak", level=2)).attrs["terms"] == len(
        resolved(space_of(*[chaospy.Uniform(-1, 1)] * 3), 2)
    )


def test_a_grid_that_is_too_large_is_refused_before_it_is_built():
    space = space_of(*[chaospy.Uniform(-1, 1)] * 10)
    for options in ({"level": 40}, {"order": 7}):
        with pytest.raises(uqmbd.StudyError, match="needs at least [0-9]+ nodes"):
            plans(Collocation(rule="smolyak", **options)).plan(space, options.get("order"))
    with pytest.raises(uqmbd.StudyError, match="level is 100000000; expected .* at most 1000"):
        Collocation(rule="smolyak", level=10**8)


def test_failed_nodes_are_left_out_of_a_regression():
    space = space_of(*[chaospy.Uniform(-1, 1)] * 2)
    with pytest.warns(UserWarning, match="it is too far"):
        fit = fitted(space, lambda x: np.where(x[:, 0] > 0.95, np.nan, 1 + x[:, 0] * x[:, 1]), level=4)
    assert fit.failed == 1
    assert moments(fit) == (pytest.approx(1, abs=1e-10), pytest.approx(1 / 3, abs=1e-10))


def product_moments(one, two):
    """Mean and standard deviation of a product of functions of independent inputs, by their first two moments."""
    mean, square = np.prod(one), np.prod(two)
    return mean, np.sqrt(square - mean**2)


def exponential_moment(name, a):
    """E[exp(a x)] of the distributions above, in closed form."""
    if name == "hermite":
        return np.exp(a + (2 * a) ** 2 / 2)
    if name == "legendre":
        return (np.exp(3 * a) - np.exp(-2 * a)) / (5 * a)
    if name == "jacobi":
        return scipy.special.hyp1f1(2, 7, a)
    if name == "laguerre":
        return (1 - a) ** -1.5
    if name == "two values":
        return 0.7 + 0.3 * np.exp(a)
    return np.mean(np.exp(a * np.arange(1, 7)))


def test_mean_and_deviation_of_products_in_closed_form():
    """exp(a . x) of inputs of any distributions: level 4 finds both to a millionth."""
    draw = np.random.default_rng(5)
    names = ["hermite", "legendre", "jacobi", "laguerre", "two values", "six values"]
    for _ in range(10):
        chosen = draw.choice(names, int(draw.integers(1, 5)))
        rates = draw.uniform(0.02, 0.08, len(chosen))
        space = space_of(*(FAMILIES[name] for name in chosen))
        # what varies, rates times deviations, is the same for all inputs
        mean, std = moments(fitted(space, lambda x, a=rates: np.exp(x @ a), level=4))
        expected = product_moments(
            [exponential_moment(n, a) for n, a in zip(chosen, rates, strict=True)],
            [exponential_moment(n, 2 * a) for n, a in zip(chosen, rates, strict=True)],
        )
        assert abs(mean - expected[0]) < 1e-6 * expected[1]
        assert abs(std - expected[1]) < 1e-6 * expected[1]


def quadrature(function):
    return scipy.integrate.quad(function, 0, 1, epsabs=1e-13)[0]


def corner(a, m):
    """Integral of (1 + a . x)^-m over the unit cube, by its 2^d corners."""
    signs = np.array(list(itertools.product((0, 1), repeat=len(a))))
    falling = np.prod(m - 1 - np.arange(len(a)))
    return np.sum((-1.0) ** signs.sum(axis=1) * (1 + signs @ a) ** (len(a) - m)) / (np.prod(a) * falling)


def wave(a, u):
    """Integral of cos(2 pi u + a . x) over the unit cube."""
    return np.real(np.exp(2j * np.pi * u) * np.prod((np.exp(1j * a) - 1) / (1j * a)))


def genz(name, a, u):
    """A smooth function of Genz on the unit cube, with its mean and standard deviation."""
    if name == "oscillatory":
        return lambda x: np.cos(2 * np.pi * u[0] + x @ a), wave(a, u[0]), (1 + wave(2 * a, 2 * u[0])) / 2
    if name == "corner peak":
        m = len(a) + 1
        return lambda x: (1 + x @ a) ** -m, corner(a, m), corner(a, 2 * m)
    if name == "product peak":
        one = [quadrature(lambda x, a=a, u=u: 1 / (a**-2 + (x - u) ** 2)) for a, u in zip(a, u, strict=True)]
        two = [quadrature(lambda x, a=a, u=u: 1 / (a**-2 + (x - u) ** 2) ** 2) for a, u in zip(a, u, strict=True)]
        return lambda x: np.prod(1 / (a**-2 + (x - u) ** 2), axis=1), np.prod(one), np.prod(two)
    bell = [
        np.prod(np.sqrt(np.pi) / (2 * b) * (scipy.special.erf(b * (1 - u)) + scipy.special.erf(b * u)))
        for b in (a, np.sqrt(2) * a)
    ]
    return lambda x: np.exp(-np.sum((a * (x - u)) ** 2, axis=1)), *bell


def errors_by_level(space, function, mean, std, levels):
    """Errors of mean, standard deviation and surrogate (root mean square) of each level, over the deviation."""
    points = uqmbd.extend.monte_carlo_rule(space, 1024, 7, "sobol").nodes
    truth, found = function(space.to_inputs(points)), []
    for level in levels:
        fit = fitted(space, function, level=level)
        surrogate = space.evaluate(points, fit.multi_index) @ fit.coefficients[:, 0, 0]
        mine = moments(fit)
        found.append((abs(mine[0] - mean), abs(mine[1] - std), np.sqrt(np.mean((surrogate - truth) ** 2))))
    return np.array(found) / std


@pytest.mark.parametrize("count", [2, pytest.param(40, marks=pytest.mark.slow)])
@pytest.mark.parametrize("name", ["oscillatory", "corner peak", "product peak", "Gaussian"])
def test_the_error_falls_with_the_level_on_functions_of_genz(name, count):
    draw = np.random.default_rng(6)
    for _ in range(count):
        dimension = int(draw.integers(2, 6))
        a = draw.uniform(0.5, 1.5, dimension)
        a *= 2.5 / a.sum()
        function, mean, square = genz(name, a, draw.uniform(0, 1, dimension))
        space = space_of(*[chaospy.Uniform(0, 1)] * dimension)
        errors = errors_by_level(space, function, mean, np.sqrt(square - mean**2), range(1, 5))
        assert (errors[1:, 2] < 0.6 * errors[:-1, 2]).all(), errors
        # a deviation is off by what the surrogate is off at most
        assert (errors[:, :2].max(axis=1) < 2 * errors[:, 2]).all(), errors
        assert errors[-1, :2].max() < 0.01, errors


def ishigami(x):
    return np.sin(x[:, 0]) + 7 * np.sin(x[:, 1]) ** 2 + 0.1 * x[:, 2] ** 4 * np.sin(x[:, 0])


def test_the_error_falls_with_the_level_on_ishigami():
    """Mean a / 2 and variance a^2 / 8 + b pi^4 / 5 + b^2 pi^8 / 18 + 1 / 2."""
    std = np.sqrt(49 / 8 + 0.1 * np.pi**4 / 5 + 0.01 * np.pi**8 / 18 + 0.5)
    space = space_of(*[chaospy.Uniform(-np.pi, np.pi)] * 3)
    errors = errors_by_level(space, ishigami, 3.5, std, range(1, 7))
    assert (np.diff(errors, axis=0) < 0).all(), errors
    assert errors[4, :2].max() < 1e-4
    assert errors[5, :2].max() < 1e-6
