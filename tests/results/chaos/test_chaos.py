"""Statistics of a polynomial chaos against closed forms, published tables and independent routes."""

from __future__ import annotations

import math
from collections.abc import Callable
from itertools import product

import chaospy
import numpy as np
import pytest

from uqmbd import RandomVariable, extend
from uqmbd.errors import StudyError
from uqmbd.randomness.germs.germ import Germ
from uqmbd.randomness.index_sets import index_set
from uqmbd.randomness.joint import JointInput
from uqmbd.randomness.space.germ_space import GermSpace
from uqmbd.randomness.variable import random_vector
from uqmbd.results import PolynomialChaos
from uqmbd.results.chaos.terms import skewness_kurtosis


def space_of(**distributions: object) -> GermSpace:
    """Return the germs of independent inputs."""
    return GermSpace.of(JointInput.of([RandomVariable(name, d) for name, d in distributions.items()]))


def chaos_of(space: GermSpace, multi_index: object, coefficients: object, **more: object) -> PolynomialChaos:
    """Return a chaos of coefficients (P, O, T), or (P,) for one output at one time."""
    values = np.asarray(coefficients, dtype=float)
    values = values.reshape(len(values), *(values.shape[1:] or (1, 1)))
    axes = extend.labels([f"y{k}" for k in range(values.shape[1])], space.inputs, np.arange(values.shape[2]) * 0.5)
    return PolynomialChaos(values, multi_index, space, axes, **more)


def projected(
    space: GermSpace, multi_index: np.ndarray, count: int, model: Callable[..., np.ndarray]
) -> PolynomialChaos:
    """Return the chaos of a function of inputs, by projection with a tensor Gauss rule of `count` nodes per input."""
    rules = [germ.gauss(count) for germ in space.germs]
    nodes = np.array(list(product(*(rule[0] for rule in rules))))
    weights = np.array([math.prod(w) for w in product(*(rule[1] for rule in rules))])
    psi = space.evaluate(nodes, multi_index)
    return chaos_of(space, multi_index, extend.project(model(*space.to_inputs(nodes).T), psi, weights))


def test_hermite_by_hand() -> None:
    """m + b x + d (x^2 - 1) of a standard normal x: variance b^2 + 2 d^2, third and fourth central moment by hand."""
    m, b, d = 5.0, 2.0, 0.7
    chaos = chaos_of(space_of(x=chaospy.Normal(0, 1)), [[0], [1], [2]], [m, b, d * np.sqrt(2)])
    variance = b**2 + 2 * d**2
    assert chaos.mean.item() == m
    assert chaos.variance.item() == pytest.approx(variance)
    assert chaos.std.item() == pytest.approx(variance**0.5)
    assert chaos.skewness.item() == pytest.approx((6 * b**2 * d + 8 * d**3) / variance**1.5)
    assert chaos.kurtosis.item() == pytest.approx((3 * b**4 + 60 * b**2 * d**2 + 60 * d**4) / variance**2)


def test_legendre_by_hand() -> None:
    """A uniform variable has the kurtosis 9/5; its square has the skewness and kurtosis of u^2 - 1/3."""
    space = space_of(u=chaospy.Uniform(2, 6))
    straight = chaos_of(space, [[0], [1]], [4.0, 2 / np.sqrt(3)])
    assert straight.variance.item() == pytest.approx(16 / 12)
    assert straight.skewness.item() == pytest.approx(0.0, abs=1e-14)
    assert straight.kurtosis.item() == pytest.approx(9 / 5)
    assert straight.evaluate([[6.0]]).item() == pytest.approx(6.0)
    square = chaos_of(space, [[0], [1], [2]], [1 / 3, 0.0, 2 / (3 * np.sqrt(5))])  # u^2 on [-1, 1]
    moments = {k: sum(math.comb(k, i) * (-1 / 3) ** (k - i) / (2 * i + 1) for i in range(k + 1)) for k in (2, 3, 4)}
    assert square.variance.item() == pytest.approx(moments[2])
    assert square.skewness.item() == pytest.approx(moments[3] / moments[2] ** 1.5)
    assert square.kurtosis.item() == pytest.approx(moments[4] / moments[2] ** 2)


@pytest.mark.parametrize("order", [1, 2, 5, 10])
def test_truncated_exponential_of_a_normal(order: int) -> None:
    """The moments of exp(x), truncated, are those of the polynomial by moments of the normal: (2 k - 1)!!."""
    coefficients = [math.exp(0.5) / math.sqrt(math.factorial(n)) for n in range(order + 1)]
    chaos = chaos_of(space_of(x=chaospy.Normal(0, 1)), np.arange(order + 1)[:, None], coefficients)
    plain = [c / math.sqrt(math.factorial(n)) for n, c in enumerate(coefficients)]
    central = np.polynomial.Polynomial(np.polynomial.hermite_e.herme2poly([0.0, *plain[1:]]))

    def moment(k: int) -> float:
        powers = (central**k).coef
        return sum(c * math.prod(range(n - 1, 0, -2)) for n, c in enumerate(powers) if n % 2 == 0)

    assert chaos.mean.item() == pytest.approx(math.exp(0.5))
    assert chaos.variance.item() == pytest.approx(moment(2), rel=1e-12)
    assert chaos.skewness.item() == pytest.approx(moment(3) / moment(2) ** 1.5, rel=1e-10)
    assert chaos.kurtosis.item() == pytest.approx(moment(4) / moment(2) ** 2, rel=1e-10)


def test_both_routes_to_the_shape_agree() -> None:
    """Grid and products of polynomials give the same skewness and kurtosis, for mixed families and any index set."""
    germs = (
        Germ.classical("a", "hermite"),
        Germ.classical("b", "legendre"),
        Germ.classical("c", "jacobi", 2.0, 3.0),
        Germ.classical("d", "laguerre", 1.5),
    )
    rng = np.random.default_rng(1)
    for index in (
        index_set(4, 3),
        index_set(4, 2, "tensor"),
        index_set(4, 5, "hyperbolic"),
        index_set(4, 4, weights=[1, 2, 4, 1]),
        index_set(4, 4)[[0, 3, 9, 20, 40]],
    ):
        coefficients = rng.normal(size=(len(index), 7)) * 0.5 ** index.sum(axis=1)[:, None]
        grid = skewness_kurtosis(coefficients, index, germs, "grid")
        products = skewness_kurtosis(coefficients, index, germs, "products")
        np.testing.assert_allclose(grid, products, rtol=1e-9, atol=1e-9)
        np.testing.assert_allclose(skewness_kurtosis(coefficients, index, germs), grid, rtol=1e-9, atol=1e-9)


def test_a_die() -> None:
    """Six values: the kurtosis 3 - 6/5 (n^2 + 1) / (n^2 - 1), and by both routes at the highest order there is."""
    space = space_of(eyes=chaospy.DiscreteUniform(1, 6))
    chaos = projected(space, index_set(1, 1), 6, lambda eyes: eyes)
    assert (chaos.mean.item(), chaos.variance.item()) == pytest.approx((3.5, 35 / 12))
    assert chaos.kurtosis.item() == pytest.approx(3 - 6 / 5 * 37 / 35)
    power = projected(space, index_set(1, 5), 6, lambda eyes: eyes**5)
    exact = np.arange(1.0, 7.0) ** 5
    for route in ("grid", "products"):
        skewness, kurtosis = skewness_kurtosis(power.coefficients[:, 0], power.multi_index, space.germs, route)
        assert skewness.item() == pytest.approx(np.mean((exact - exact.mean()) ** 3) / exact.std() ** 3)
        assert kurtosis.item() == pytest.approx(np.mean((exact - exact.mean()) ** 4) / exact.std() ** 4)


def test_blocks_do_not_matter() -> None:
    """More outputs and times than fit a block have the statistics that few have."""
    space, index = space_of(a=chaospy.Normal(0, 1), b=chaospy.Uniform(-1, 1)), index_set(2, 4)
    values = np.random.default_rng(2).normal(size=(len(index), 3, 40))
    values[1:, 1, 5:9] = 0.0
    whole = chaos_of(space, index, values)
    expected = [whole.std, whole.skewness, whole.kurtosis, whole.sobol_first, whole.sobol_second]
    parts = chaos_of(space, index, np.tile(values, 600))
    found = [parts.std, parts.skewness, parts.kurtosis, parts.sobol_first, parts.sobol_second]
    for one, other in zip(found, expected, strict=True):
        np.testing.assert_allclose(one[..., -40:], other, rtol=1e-12, atol=1e-13)


def test_more_inputs_than_keys_of_a_word() -> None:
    """Thirty inputs: products are found although their degrees do not fit one integer; a sum of squares is chi^2."""
    count = 30
    space = GermSpace(tuple(f"x{k}" for k in range(count)), (Germ.classical("x", "hermite"),) * count, ())
    index = np.concatenate([np.zeros((1, count), dtype=int), 2 * np.eye(count, dtype=int)])
    chaos = chaos_of(space, index, [count, *[np.sqrt(2.0)] * count])
    assert chaos.variance.item() == pytest.approx(2 * count)
    assert chaos.skewness.item() == pytest.approx(np.sqrt(8 / count))
    assert chaos.kurtosis.item() == pytest.approx(3 + 12 / count)
    np.testing.assert_allclose(chaos.sobol_first.ravel(), 1 / count)


def test_ishigami() -> None:
    """The function of Ishigami and Homma (1990): its published indices, and its moments in closed form."""
    space = space_of(**{f"x{k}": chaospy.Uniform(-np.pi, np.pi) for k in (1, 2, 3)})
    chaos = projected(
        space, index_set(3, 14), 16, lambda x, y, z: np.sin(x) + 7 * np.sin(y) ** 2 + 0.1 * z**4 * np.sin(x)
    )
    pi = np.pi
    assert chaos.mean.item() == pytest.approx(3.5)
    assert chaos.variance.item() == pytest.approx(49 / 8 + 0.1 * pi**4 / 5 + 0.01 * pi**8 / 18 + 0.5, rel=1e-6)
    np.testing.assert_allclose(chaos.sobol_first.ravel(), [0.3139, 0.4424, 0.0], atol=5e-5)
    np.testing.assert_allclose(chaos.sobol_total.ravel(), [0.5576, 0.4424, 0.2437], atol=5e-5)
    np.testing.assert_allclose(chaos.sobol_second[:, :, 0, 0][0], [0.0, 0.0, 0.2437], atol=5e-5)
    np.testing.assert_array_equal(chaos.sobol_second, chaos.sobol_second.swapaxes(0, 1))
    assert chaos.sobol_interaction("x3", "x1").item() == pytest.approx(chaos.sobol_second[0, 2].item())
    assert chaos.sobol_interaction("x1", "x2", "x3").item() == pytest.approx(0.0, abs=1e-10)
    assert chaos.sobol_first.shape == chaos.sobol_total.shape == (3, 1, 1)


def test_sobol_g_function() -> None:
    """Sobol's function with a = 1, 2, 5, 10, 20, 50, 100, 500: its published indices.

    The coefficients of a product of |4 x - 2| are found exactly, by Gauss rules on both sides of the kink.
    """
    a = np.array([1.0, 2.0, 5.0, 10.0, 20.0, 50.0, 100.0, 500.0])
    space = space_of(**{f"x{k}": chaospy.Uniform(0, 1) for k in range(8)})
    index = 2 * index_set(8, 8, weights=[1, 1, 2, 2, 2, 4, 4, 8])  # an even function
    x, w = np.polynomial.legendre.leggauss(10)
    nodes, weights = np.concatenate([(x - 1) / 2, (x + 1) / 2]), np.concatenate([w, w]) / 4
    factors = [
        extend.project((2 * np.abs(nodes) + ak) / (1 + ak), germ.polynomials(nodes, 16), weights)
        for ak, germ in zip(a, space.germs, strict=True)
    ]
    coefficients = np.prod([f[column] for f, column in zip(factors, index.T, strict=True)], axis=0)
    chaos = chaos_of(space, index, coefficients)
    assert chaos.mean.item() == pytest.approx(1.0)
    np.testing.assert_allclose(
        chaos.sobol_first.ravel(), [0.6037, 0.2683, 0.0671, 0.0200, 0.0055, 0.0009, 0.0002, 0.0], atol=4e-4
    )
    np.testing.assert_allclose(
        chaos.sobol_total.ravel(), [0.6342, 0.2945, 0.0756, 0.0227, 0.0062, 0.0011, 0.0003, 0.0], atol=4e-4
    )


def test_indices_sum_to_one() -> None:
    """First-order indices and all interactions share the whole variance; an output without one has none to share."""
    space, index = space_of(a=chaospy.Normal(0, 1), b=chaospy.Uniform(0, 1), c=chaospy.Uniform(0, 1)), index_set(3, 3)
    values = np.random.default_rng(3).normal(size=(20, 2, 3))
    values[0], values[1:, 1] = 1e3, 1e-14  # rounding of the mean: output 1 does not vary
    chaos = chaos_of(space, index, values)
    total = chaos.sobol_first.sum(axis=0) + chaos.sobol_second.sum(axis=(0, 1)) / 2
    np.testing.assert_allclose(total + chaos.sobol_interaction("a", "b", "c"), [[1.0] * 3, [0.0] * 3], atol=1e-14)
    assert not chaos.sobol_total[:, 1].any()
    assert not chaos.skewness[1].any() and (chaos.kurtosis[1] == 3.0).all()


@pytest.mark.parametrize("scale", [1e-200, 1e150])
def test_scales_do_not_matter(scale: float) -> None:
    """Units as small or large as one likes: the same shape and the same shares."""
    space, index = space_of(a=chaospy.Normal(0, 1), b=chaospy.Uniform(0, 1)), index_set(2, 3)
    values = np.random.default_rng(4).normal(size=10)
    plain, scaled = chaos_of(space, index, values), chaos_of(space, index, values * scale)
    np.testing.assert_allclose(scaled.std, plain.std * scale)
    np.testing.assert_allclose(scaled.kurtosis, plain.kurtosis)
    np.testing.assert_allclose(scaled.sobol_total, plain.sobol_total)


def test_dependent_inputs() -> None:
    """a + b with correlation r: germ a carries (1 + r) / 2 of the variance, and no share is given to an input."""
    r = 0.6
    a, b = random_vector(["a", "b"], chaospy.MvNormal([1.0, 2.0], [[1.0, r], [r, 1.0]]))
    space = GermSpace.of(JointInput.of([a, b]))
    chaos = projected(space, index_set(2, 2), 3, lambda a, b: a + b)
    assert not space.independent
    assert chaos.variance.item() == pytest.approx(2 + 2 * r)
    np.testing.assert_allclose(chaos.sobol_first_germ.ravel(), [(1 + r) / 2, (1 - r) / 2])
    np.testing.assert_allclose(chaos.sobol_total_germ, chaos.sobol_first_germ)
    for name in ("sobol_first", "sobol_total", "sobol_second"):
        with pytest.raises(StudyError, match=f"'{name}' does not exist for dependent inputs.*{name}_germ"):
            getattr(chaos, name)
    statistics = chaos.statistics()
    assert "sobol_first" not in statistics and "input" not in statistics.dims
    assert statistics["sobol_first_germ"].dims == ("germ", "output", "time")
    assert statistics["germ"].values.tolist() == list(space.names)
    assert statistics["sobol_total_germ"].sel(germ=space.names[0]).item() == pytest.approx((1 + r) / 2)
    # the expectation given a alone: a + 2 + r (a - 1)
    given = chaos.marginal(space.names[0])
    np.testing.assert_allclose(given.evaluate([[0.0, 9.0], [3.0, 9.0]]).ravel(), [2 - r, 5 + 2 * r])


def test_marginal() -> None:
    """The expectation given some inputs does not depend on the others, and its variance is their share."""
    space = space_of(x=chaospy.Uniform(-1, 1), y=chaospy.Uniform(-1, 1))
    chaos = projected(space, index_set(2, 4), 5, lambda x, y: 1 + x + 3 * x**2 * y**2)
    given = chaos.marginal("x")
    assert isinstance(given, PolynomialChaos)
    x = np.linspace(-1, 1, 5)
    np.testing.assert_allclose(given.evaluate(np.stack([x, x * 0 + 0.3], axis=1)).ravel(), 1 + x + x**2)
    assert (given.variance / chaos.variance).item() == pytest.approx(chaos.sobol_first[0].item())
    with pytest.raises(StudyError, match="The germs are z; expected different germs out of x, y"):
        chaos.marginal("z")
    with pytest.raises(StudyError, match="The germs are x, x; expected different germs"):
        chaos.sobol_interaction("x", "x")
    with pytest.raises(StudyError, match="No germ is given"):
        chaos.marginal()


def test_order_zero() -> None:
    """A mean alone is a chaos: nothing varies, nothing warns."""
    chaos = chaos_of(space_of(x=chaospy.Normal(0, 1)), [[0]], [[[3.0, 4.0]]])
    statistics = chaos.statistics()
    assert statistics["std"].values.tolist() == [[0.0, 0.0]]
    assert statistics["quantile"].sel(time=0.5).values.ravel().tolist() == [4.0] * 7
    assert statistics["sobol_first"].values.tolist() == [[[0.0, 0.0]]]
    assert chaos.evaluate([[1.0], [2.0]]).ravel().tolist() == [3.0, 4.0, 3.0, 4.0]
    assert np.isnan(chaos.decay()["rate"]).all()
    assert "order 0" in chaos.verdicts()[0]


def test_a_chaos_does_not_change() -> None:
    """Neither its data, nor what it was made from, nor a statistic of it can be changed under it."""
    values = np.array([[[1.0]], [[2.0]]])
    chaos = chaos_of(space_of(x=chaospy.Normal(0, 1)), [[0], [1]], values)
    values[:] = 9.0
    assert chaos.mean.item() == 1.0
    for array in (chaos.coefficients, chaos.multi_index, chaos.mean, chaos.std, chaos.variance, chaos.sobol_first):
        with pytest.raises(ValueError, match="read-only"):
            array[...] = 0.0
    with pytest.raises(AttributeError):
        chaos.labels = None  # type: ignore[misc]


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (
            {"coefficients": np.ones((2, 1, 2))},
            r"'coefficients' has the shape .*; expected \(term, output, time\) = \(3, 1, 2\)",
        ),
        ({"coefficients": np.full((3, 1, 2), np.nan)}, r"'coefficients' .* not finite at \[0, 0, 0\]"),
        ({"multi_index": [[0], [1], [1]]}, "contains a term twice"),
        ({"multi_index": [[1], [0], [2]]}, "its first row must contain zeros, for the mean"),
        ({"multi_index": [[0], [1], [-1]]}, "degrees of 0 or more"),
        ({"multi_index": [[0], [1], [0.5]]}, "whole numbers"),
        ({"multi_index": [[0, 0], [1, 0], [2, 0]]}, "'multi_index' has the shape .*; expected "),
        ({"labels": extend.labels(["y"], ["other"], [0.0, 1.0])}, "expected the same inputs"),
        ({"verification_germs": [[1.0]]}, "expected both or neither"),
        ({"verification_germs": [[1.0]], "verification_response": [[[1.0]]]}, "'verification_response' has the shape"),
        ({"verification_germs": [[1.0]], "verification_response": [[[1.0, np.inf]]]}, "not finite"),
        ({"verification_germs": [], "verification_response": []}, "The verification arrays contain no realisation"),
    ],
)
def test_bad_data(change: dict[str, object], message: str) -> None:
    """Each breach gets one error with what was given and what was expected."""
    space = space_of(x=chaospy.Normal(0, 1))
    good = {
        "coefficients": np.ones((3, 1, 2)),
        "multi_index": [[0], [1], [2]],
        "space": space,
        "labels": extend.labels(["y"], ["x"], [0.0, 1.0]),
    }
    PolynomialChaos(**good)
    with pytest.raises(StudyError, match=message):
        PolynomialChaos(**{**good, **change})
