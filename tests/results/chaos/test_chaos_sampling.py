"""Evaluation and samples of a chaos, and what follows from them: quantiles, densities, the dataset of statistics."""

from __future__ import annotations

import json
import timeit
from collections.abc import Callable

import chaospy
import numpy as np
import pytest
import scipy.stats

from uqmbd import RandomVariable, extend, results
from uqmbd.errors import StudyError
from uqmbd.randomness.index_sets import index_set
from uqmbd.randomness.joint import JointInput
from uqmbd.randomness.space.germ_space import GermSpace
from uqmbd.results import PolynomialChaos
from uqmbd.results.chaos import sampling as chaos_sampling

TIMES = np.linspace(0.0, 1.0, 4)


@pytest.fixture(scope="module")
def chaos() -> PolynomialChaos:
    """Return a chaos of two outputs and four times, in a normal, a uniform and a beta variable."""
    inputs = {
        "a": chaospy.Normal(10.0, 2.0),
        "b": chaospy.Uniform(-3.0, 1.0),
        "c": chaospy.Beta(2.0, 3.0, lower=1.0, upper=2.0),
    }
    space = GermSpace.of(JointInput.of([RandomVariable(name, d) for name, d in inputs.items()]))
    index = index_set(3, 3)
    scale = 0.4 ** index.sum(axis=1)[:, None, None]
    values = np.random.default_rng(1).normal(size=(len(index), 2, 4)) * scale
    axes = extend.labels([("x", "m"), ("pull", "N")], [("a", "N"), ("b", "m"), "c"], TIMES)
    return PolynomialChaos(values, index, space, axes)


def test_evaluation_at_inputs_is_the_polynomial_in_standard_form(chaos: PolynomialChaos) -> None:
    """Hermite in (a - 10) / 2 and Legendre in (b + 1) / 2, from numpy; terms of c left out by a marginal."""
    rng = np.random.default_rng(2)
    inputs = np.stack([rng.normal(10, 2, 50), rng.uniform(-3, 1, 50), rng.uniform(1.1, 1.9, 50)], axis=1)
    given = chaos.marginal("a", "b")
    hermite = np.polynomial.hermite_e.hermevander((inputs[:, 0] - 10) / 2, 3) / np.sqrt([1, 1, 2, 6])
    legendre = np.polynomial.legendre.legvander((inputs[:, 1] + 1) / 2, 3) * np.sqrt([1, 3, 5, 7])
    psi = hermite[:, given.multi_index[:, 0]] * legendre[:, given.multi_index[:, 1]]
    expected = np.einsum("kp,pot->kot", psi, given.coefficients)
    np.testing.assert_allclose(given.evaluate(inputs), expected, atol=1e-12)
    assert given.evaluate(inputs).shape == (50, 2, 4)
    with pytest.raises(StudyError, match="'b'"):
        chaos.evaluate([[10.0, 5.0, 1.5]])
    with pytest.raises(StudyError, match=r"shape \(2,\); expected \(K, 3\)"):
        chaos.evaluate_germs([0.0, 0.0])


def test_samples_agree_with_coefficients(chaos: PolynomialChaos) -> None:
    """Moments of samples lie within their own standard errors of those from the coefficients; inputs are as declared."""
    count = 40_000
    inputs, response = chaos.sample(count, seed=3)
    found = results.sample_statistics(response)
    assert np.all(np.abs(found["mean"] - chaos.mean) < 4 * found["std_error_mean"])
    assert np.all(np.abs(found["std"] - chaos.std) < 4 * found["std_error_std"])
    np.testing.assert_allclose(found["skewness"], chaos.skewness, atol=0.15)
    np.testing.assert_allclose(found["kurtosis"], chaos.kurtosis, rtol=0.15)
    assert scipy.stats.kstest(inputs[:, 0], scipy.stats.norm(10, 2).cdf).pvalue > 1e-3
    assert scipy.stats.kstest(inputs[:, 2], scipy.stats.beta(2, 3, 1, 1).cdf).pvalue > 1e-3
    np.testing.assert_allclose(chaos.evaluate(inputs), response, atol=1e-9)
    again, _ = chaos.sample(count, seed=3)
    np.testing.assert_array_equal(again, inputs)


def test_total_index_by_pick_and_freeze(chaos: PolynomialChaos) -> None:
    """Sobol' indices from coefficients agree with the estimators of Saltelli and of Jansen on samples."""
    first, second = (chaos_sampling.random_germs(chaos.space, 40_000, seed) for seed in (4, 5))
    base, other = chaos.evaluate_germs(first), chaos.evaluate_germs(second)
    for k in range(3):
        mixed = first.copy()
        mixed[:, k] = second[:, k]
        swapped = chaos.evaluate_germs(mixed)
        total = np.mean((base - swapped) ** 2, axis=0) / 2 / chaos.variance
        alone = np.mean((other - chaos.mean) * (swapped - base), axis=0) / chaos.variance
        np.testing.assert_allclose(chaos.sobol_total[k], total, atol=0.03)
        np.testing.assert_allclose(chaos.sobol_first[k], alone, atol=0.04)


LEVELS = np.array([0.001, 0.025, 0.25, 0.5, 0.75, 0.975, 0.999])


def sum_of_normal_and_uniform(q: np.ndarray, width: float) -> np.ndarray:
    """Return the distribution function of a standard normal plus a uniform in -width to width: their convolution."""

    def integral(x: np.ndarray) -> np.ndarray:
        return x * scipy.stats.norm.cdf(x) + scipy.stats.norm.pdf(x)

    return (integral(q + width) - integral(q - width)) / (2 * width)


@pytest.mark.parametrize(
    ("inputs", "index", "coefficients", "probability"),
    [
        ([chaospy.Normal()], [[0], [1]], [3.0, 2.0], lambda q: scipy.stats.norm.cdf(q, 3.0, 2.0)),
        ([chaospy.Uniform(-1, 1)], [[0], [1]], [1e6, 1e-3 / 3**0.5], lambda q: (q - (1e6 - 1e-3)) / 2e-3),
        ([chaospy.Normal()], [[0], [1], [2]], [1.0, 0.0, 2**0.5], lambda q: scipy.stats.chi2.cdf(q, 1)),
        (
            [chaospy.Normal(), chaospy.Uniform(-1, 1)],
            [[0, 0], [1, 0], [0, 1]],
            [0.0, 1.0, 2 / 3**0.5],
            lambda q: sum_of_normal_and_uniform(q, 2.0),
        ),
        (
            [chaospy.Normal()] * 5,
            np.concatenate([np.zeros((1, 5), dtype=int), 2 * np.eye(5, dtype=int)]),
            [5.0] + [2**0.5] * 5,
            lambda q: scipy.stats.chi2.cdf(q, 5),
        ),
    ],
    ids=["normal", "uniform", "chi-square", "normal and uniform", "chi-square of five"],
)
@pytest.mark.parametrize("count", [1024, 8192])
def test_quantiles_are_within_their_error(inputs, index, coefficients, probability, count) -> None:
    """Of closed forms: within 2 / N for one germ, else within four standard errors of independent samples."""
    space = GermSpace.of(JointInput.of([RandomVariable(f"x{k}", one) for k, one in enumerate(inputs)]))
    axes = extend.labels(["y"], [f"x{k}" for k in range(len(inputs))], None)
    chaos = PolynomialChaos(np.array(coefficients)[:, None], index, space, axes)
    bound = 2 / count if len(inputs) == 1 else 4 * np.sqrt(LEVELS * (1 - LEVELS) / count)
    for seed in range(3):
        found = chaos.quantiles(LEVELS, samples=count, seed=seed)[:, 0]
        assert np.all(np.abs(probability(found) - LEVELS) < bound)


@pytest.mark.thorough
def test_quantiles_and_density_of_a_normal() -> None:
    """A linear function of a normal has its quantiles and density, whatever the blocks."""
    space = GermSpace.of(JointInput.of([RandomVariable("x", chaospy.Normal(0, 1))]))
    axes = extend.labels(["y", "z"], ["x"], [0.0, 1.0])
    chaos = PolynomialChaos([[[1.0, 5.0], [0.0, 3.0]], [[2.0, 0.0], [1.0, -1.0]]], [[0], [1]], space, axes)
    levels = [0.025, 0.5, 0.95]
    found = chaos.quantiles(levels)
    normal = scipy.stats.norm.ppf(levels)
    np.testing.assert_allclose(found[:, 0, 0], 1 + 2 * normal, atol=2e-3)
    np.testing.assert_allclose(found[:, 1, 1], 3 + normal, atol=1e-3)
    assert found[:, 0, 1].tolist() == [5.0] * 3
    many = extend.labels(["y", "z"], ["x"], np.arange(600.0))
    whole = PolynomialChaos(np.tile(chaos.coefficients, 300), [[0], [1]], space, many)
    np.testing.assert_allclose(whole.quantiles(levels)[..., -2:], found, rtol=1e-14)
    where = np.linspace(-7, 9, 33)
    np.testing.assert_allclose(chaos.density(where, "y", 0.0), scipy.stats.norm.pdf(where, 1, 2), atol=2e-3)
    with pytest.raises(StudyError, match="'y' is constant at this time .5."):
        chaos.density(where, "y", 1.0)
    with pytest.raises(StudyError, match="no output 'w'; the outputs are y, z"):
        chaos.density(where, "w", 1.0)
    with pytest.raises(StudyError, match="The time 0.3 s is not an output time; the nearest output time is 0 s"):
        chaos.density(where, "y", 0.3)
    with pytest.raises(StudyError, match="The time is missing"):
        chaos.density(where, "y")
    with pytest.raises(StudyError, match="The probabilities are .*; expected increasing numbers"):
        chaos.quantiles([0.5, 0.1])
    with pytest.raises(StudyError, match="The number of samples is 0; expected a whole number of at least 1"):
        chaos.sample(0, seed=1)


def test_quantiles_interpolate_as_numpy_does(chaos: PolynomialChaos) -> None:
    """On the same samples, numpy's quantiles."""
    basis = chaos_sampling.basis_values(
        chaos.space, chaos_sampling.random_germs(chaos.space, 5001, 1), chaos.multi_index
    )
    flat = chaos.coefficients.reshape(20, -1)
    levels = [0.0, 0.03, 0.5, 1.0]
    samples = basis @ flat
    found = chaos_sampling.quantiles_of_rows(lambda part: samples.T[part].copy(), 5001, flat.shape[1], levels)
    np.testing.assert_allclose(found, np.quantile(samples, levels, axis=0), rtol=1e-12)


def test_samples_along_a_germ_have_the_quantiles_that_they_have_in_any_order() -> None:
    """Monotone, with turning points, rounding about a mean, random, constant: in any order the same bits."""
    rng, germ = np.random.default_rng(3), np.linspace(-1, 1, 4096)
    noise = 5.0 + 1e-15 * rng.integers(-3, 3, 4096)
    rows = np.array([germ**3, germ**2, np.sin(20 * germ), noise, rng.random(4096), np.ones(4096), np.sin(900 * germ)])
    levels = [0.0, 0.025, 0.3, 0.5, 0.999, 1.0]
    along, other = (
        chaos_sampling.quantiles_of_rows(lambda part, x=x: x[part].copy(), 4096, len(rows), levels)
        for x in (rows, rng.permuted(rows, axis=1))
    )
    assert along.tobytes() == other.tobytes()
    np.testing.assert_allclose(along, np.quantile(rows, levels, axis=1), rtol=1e-12, atol=1e-15)


def test_statistics_are_a_propagators(chaos: PolynomialChaos) -> None:
    """The datasets make a node that keeps to the schema."""
    statistics = chaos.statistics()
    assert statistics["sobol_total"].dims == ("input", "output", "time")
    np.testing.assert_array_equal(statistics["sobol_first"].sel(input="b"), chaos.sobol_first[1])
    assert statistics["input_units"].values.tolist() == ["N", "m", ""]
    np.testing.assert_array_equal(statistics["kurtosis"], chaos.kurtosis)
    node = results.propagator_node(
        "pce",
        statistics,
        propagator="collocation",
        realisations=64,
        wall_time=1.0,
        children={"chaos": chaos.to_dataset()},
    )
    results.validate(node)
    assert json.loads(node.attrs["options"]) == {}
    assert node["chaos/coefficients"].dims == ("term", "output", "time")
    assert node["chaos/multi_index"].dims == ("term", "input")


def test_outputs_without_times(chaos: PolynomialChaos) -> None:
    """Event times and the like: the same without a time axis."""
    axes = extend.labels([("x", "m"), ("pull", "N")], ["a", "b", "c"], None)
    germs = chaos_sampling.random_germs(chaos.space, 8, 1)
    plain = PolynomialChaos(
        chaos.coefficients[:, :, 2],
        chaos.multi_index,
        chaos.space,
        axes,
        verification_germs=germs,
        verification_response=chaos.evaluate_germs(germs)[:, :, 2] + 0.01 * chaos.std[:, 2],
    )
    np.testing.assert_allclose(plain.kurtosis, chaos.kurtosis[:, 2])
    np.testing.assert_allclose(plain.sobol_second, chaos.sobol_second[..., 2])
    np.testing.assert_allclose(plain.verification_error(), [0.01, 0.01])
    assert plain.verification_error("pull") == pytest.approx(0.01)
    assert plain.statistics()["quantile"].dims == ("probability", "output")
    assert plain.decay()["energy"].dims == ("order", "output")
    assert plain.density([0.0], "x").shape == (1,)
    assert (
        plain.verdicts(0.005)[0] == "x: stated error of the surrogate 1.0 % of the standard deviation; raise the order"
    )
    back = PolynomialChaos.from_dataset(plain.to_dataset())
    assert back.labels.times is None
    np.testing.assert_array_equal(back.verification_error(), plain.verification_error())
    with pytest.raises(StudyError, match="no times and therefore no horizon"):
        plain.horizon()
    with pytest.raises(StudyError, match="time is 1.0, but these outputs are scalar outputs"):
        plain.verification_error(time=1.0)


def test_a_density_is_that_of_scipy() -> None:
    """The same numbers, with the same bandwidth."""
    sold, samples, points = of_scipy()
    np.testing.assert_allclose(sold(points), chaos_sampling.kernel_density(samples, points), rtol=1e-12)


def of_scipy() -> tuple[Callable[[np.ndarray], np.ndarray], np.ndarray, np.ndarray]:
    samples, points = np.random.default_rng(0).normal(size=16384), np.linspace(-4.0, 4.0, 200)
    low, high = np.quantile(samples, [0.25, 0.75])
    spread = samples.std(ddof=1)
    factor = 0.9 * min(spread, (high - low) / 1.34) * len(samples) ** -0.2 / spread
    return scipy.stats.gaussian_kde(samples, bw_method=factor), samples, points


@pytest.mark.slow
def test_scipy_takes_longer_for_a_density() -> None:
    """Once it is as quick, it takes over."""
    sold, samples, points = of_scipy()

    def seconds(made: Callable[[], object]) -> float:
        return min(timeit.repeat(made, number=1, repeat=5))

    assert seconds(lambda: sold(points)) > 1.5 * seconds(lambda: chaos_sampling.kernel_density(samples, points))
