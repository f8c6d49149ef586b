"""Control variates: unbiased, honest about their error, and harmless where they are useless."""

from __future__ import annotations

import dataclasses
import functools
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import chaospy
import numpy as np
import pytest
import scipy.stats
import xarray as xr

import uqmbd
from uqmbd.extend import labels, project
from uqmbd.randomness import GermSpace, JointInput, index_set
from uqmbd.randomness.quadrature.rules import gauss_tensor
from uqmbd.results import PolynomialChaos, propagator_nodes, sample_statistics, validate
from uqmbd_joints import Revolute
from uqmbd_montecarlo import MonteCarlo
from uqmbd_montecarlo.control import FOLDS, controlled_statistics, fold_of, variables
from uqmbd_montecarlo.controlledsums import ControlledSums
from uqmbd_montecarlo.jointmoments import JointMoments
from uqmbd_montecarlo.surrogate import ChaosControl

from .conftest import Quadrature, resting

REPETITIONS, SAMPLES = 200, 200


EDGE = np.sqrt(3.0)  # of uniform inputs of mean 0 and variance 1


def model(x: np.ndarray) -> np.ndarray:
    return np.exp(0.5 * x[:, 0]) + 0.2 * x[:, 0] * x[:, 1] + 0.1 * x[:, 1]


def exponential(s: float, top: float = EDGE) -> float:
    """E exp(s a) of a below `top`."""
    return float((np.exp(s * top) - np.exp(-s * EDGE)) / (s * (top + EDGE)))


# the three parts are not correlated
MEAN = exponential(0.5)
VARIANCE = exponential(1.0) - MEAN**2 + 0.04 + 0.01
COVARIANCE = np.cosh(0.5 * EDGE) / 0.5 - MEAN / 0.5  # with a: the derivative of E exp(s a)


def chaos_of(index: list[list[int]], coefficients: np.ndarray) -> PolynomialChaos:
    axes = labels(["y"], ["a", "b"], [0.0])
    return PolynomialChaos(np.reshape(coefficients, (-1, 1, 1)), index, space(), axes)


def space() -> GermSpace:
    return GermSpace.of(JointInput.of([uqmbd.RandomVariable(name, chaospy.Uniform(-EDGE, EDGE)) for name in "ab"]))


def good() -> PolynomialChaos:
    """All terms of degree two, by projection."""
    rule, index = gauss_tensor(space(), 8), index_set(2, 2)
    return chaos_of(
        index, project(model(space().to_inputs(rule.nodes)), space().evaluate(rule.nodes, index), rule.weights)
    )


def biased() -> PolynomialChaos:
    """Linear in one input, with a wrong slope, and a mean that is far off."""
    return chaos_of([[0, 0], [1, 0]], np.array([-3.0, 0.7]))


def draw(seed: int, samples: int) -> tuple[np.ndarray, np.ndarray]:
    uniform = np.random.default_rng(seed).random((samples, 2))
    return uniform, EDGE * (2 * uniform - 1)


@functools.cache
def repeated(
    surrogate: Callable[[], PolynomialChaos], samples: int = SAMPLES, repetitions: int = REPETITIONS
) -> xr.Dataset:
    """Statistics of repetitions (along `r`), with a control and, named `plain_...`, without."""
    chaos, found = surrogate(), []
    for seed in range(repetitions):
        uniform, x = draw(seed, samples)
        y = model(x)[:, None, None]
        sums = ControlledSums(ChaosControl(chaos, uniform), len(uniform))
        for first in range(0, samples, 64):
            part = y[first : first + 64]
            sums.add(first, part, np.ones(len(part), dtype=bool))
        plain = statistics(sample_statistics(y))
        names = {name: f"plain_{name}" for name in ("mean", "std", "variance")}
        found.append(sums.apply(plain).merge(plain[list(names)].rename(names)))
    return xr.concat(found, "r", data_vars="all").isel(output=0, time=0)


def statistics(found: dict[str, np.ndarray]) -> xr.Dataset:
    names = ("mean", "std", "variance", "skewness", "kurtosis", "std_error_mean", "std_error_std")
    dims = ("output", "time")
    return xr.Dataset({n: (dims, found[n]) for n in names} | {"quantile": (("p", *dims), found["quantile"])})


def scatter_ratio(found: xr.Dataset, name: str) -> float:
    return float(found[f"plain_{name}"].var() / found[name].var())


@pytest.mark.thorough
@pytest.mark.parametrize("surrogate", [biased, pytest.param(good, marks=pytest.mark.thorough)])
def test_estimates_are_unbiased_and_their_errors_honest(surrogate: Callable[[], PolynomialChaos]) -> None:
    found = repeated(surrogate)
    for name, truth in (("mean", MEAN), ("variance", VARIANCE)):
        error = float(found[name].std(ddof=1)) / np.sqrt(REPETITIONS)
        assert abs(float(found[name].mean()) - truth) <= 3 * error, name
    for name, truth in (("mean", MEAN), ("std", np.sqrt(VARIANCE))):
        inside = float((abs(found[name] - truth) <= 1.96 * found[f"std_error_{name}"]).mean())
        assert 0.92 <= inside < 1.0, (name, inside)
    # the stated variance against the scatter, which 200 repetitions know to a tenth or so; stated ones are wider
    for name in ("mean", "std"):
        stated = float((found[f"std_error_{name}"] ** 2).mean())
        assert 0.75 <= stated / float(found[name].var(ddof=1)) <= 2.5


@pytest.mark.parametrize(
    ("surrogate", "least_mean", "least_std"),
    [(biased, 3.0, 1.5), pytest.param(good, 100.0, 20.0, marks=pytest.mark.thorough)],
)
def test_stated_reduction_is_that_of_the_scatter(
    surrogate: Callable[[], PolynomialChaos], least_mean: float, least_std: float
) -> None:
    found = repeated(surrogate)
    for name, stated, least in (
        ("mean", "variance_reduction", least_mean),
        ("std", "variance_reduction_std", least_std),
    ):
        ratio = scatter_ratio(found, name)
        assert ratio > least
        # two variances of 200 repetitions: each known to 10 %; of heavy tails less
        assert float(found[stated].median()) == pytest.approx(ratio, rel=0.35), name


@pytest.mark.thorough
def test_reduction_of_the_mean_is_that_of_the_correlation() -> None:
    """1 / (1 - rho^2) of the model with a, in closed form."""
    rho2 = COVARIANCE**2 / VARIANCE
    found = repeated(biased, samples=2000, repetitions=20)
    assert float(found["variance_reduction"].mean()) == pytest.approx(1 / (1 - rho2), rel=0.05)


@pytest.mark.parametrize("samples", [60, 200])
def test_useless_control_does_no_harm(samples: int) -> None:
    """A surrogate that has nothing to do with the response, though it varies."""
    x, y, z = np.random.default_rng(5).normal(size=(3, samples, 400))
    u = np.exp(0.3 * x) + 0.2 * x * y - 1.0
    gathered, fold = variables(u, z, np.ones(samples, dtype=bool)), fold_of(np.arange(samples), samples)
    found = controlled_statistics([JointMoments.of(gathered[fold == k]) for k in range(FOLDS)])
    assert np.var(found.mean) < (1.1 if samples == 60 else 1.04) * np.var(u.mean(axis=0))
    assert np.var(found.variance) < (1.15 if samples == 60 else 1.04) * np.var(u.var(axis=0, ddof=1))
    # and what is stated says so
    for reduction in (found.reduction_mean, found.reduction_variance):
        assert np.median(reduction) == pytest.approx(1.0, abs=0.1)


def test_factors_of_a_fold_come_from_the_others() -> None:
    """The estimate is that of plain regressions of the other folds; with all samples it would be another one."""
    z, u = np.random.default_rng(0).normal(size=(2, 100, 1))
    fold = fold_of(np.arange(100), 100)
    gathered = variables(u, z, np.ones(100, dtype=bool))
    found = controlled_statistics([JointMoments.of(gathered[fold == k]) for k in range(FOLDS)])

    def estimate(of: np.ndarray, fitted_to: np.ndarray) -> float:
        slope = np.polyfit(z[fitted_to, 0], u[fitted_to, 0], 1)[0]
        return float(u[of].mean() - slope * z[of].mean())

    expected = np.mean([estimate(fold == k, fold != k) for k in range(FOLDS)])
    assert found.mean[0] == pytest.approx(expected, rel=1e-10)
    everything = np.ones(100, dtype=bool)
    assert abs(expected - estimate(everything, everything)) > 1e-5


def test_without_anything_to_gain_the_plain_formulas_are_met() -> None:
    """A control that is 1 and -1 for equal responses: estimates and errors are those of `sample_statistics`."""
    u = np.repeat(np.random.default_rng(0).exponential(size=(250, 3)), 2, axis=0)
    z = np.tile([[1.0], [-1.0]], (250, 3))
    gathered, fold = variables(u, z, np.ones(500, dtype=bool)), fold_of(np.arange(500), 500)
    found = controlled_statistics([JointMoments.of(gathered[fold == k]) for k in range(FOLDS)])
    plain = sample_statistics(u)
    np.testing.assert_allclose(found.mean, plain["mean"], rtol=1e-12)
    np.testing.assert_allclose(found.variance, plain["variance"], rtol=1e-12)
    # the usual formulas, from scipy: stated errors of samples are wider
    fourth = scipy.stats.moment(u, 4, axis=0) * (500 / 499) ** 2
    of_variance = np.sqrt((fourth - 497 / 499 * plain["variance"] ** 2) / 500)
    np.testing.assert_allclose(found.error_mean, scipy.stats.sem(u, axis=0), rtol=1e-12)
    np.testing.assert_allclose(found.error_variance, of_variance, rtol=5e-3)
    np.testing.assert_allclose(found.alone_mean, found.error_mean, rtol=1e-12)
    np.testing.assert_allclose(found.reduction_mean, 1.0, rtol=1e-12)


def test_shift_and_fold_sums_do_not_change_the_estimates() -> None:
    """The estimates are those of any other shift, though squares about it are what is gathered."""
    generator = np.random.default_rng(3)
    x = generator.normal(size=(300, 2))
    u, z = model(x)[:, None], x[:, :1]
    fine, fold = x[:, 1] < 1.5, fold_of(np.arange(300), 300)
    found = [
        controlled_statistics([JointMoments.of(variables(u - s, z, fine)[fold == k]) for k in range(FOLDS)])
        for s in (0.0, 1.0)
    ]
    complete = [
        controlled_statistics(
            [JointMoments.of(variables(u - s, z, np.ones(300, dtype=bool))[fold == k]) for k in range(FOLDS)]
        )
        for s in (0.0, 1.0)
    ]
    assert complete[1].mean[0] + 1.0 == pytest.approx(complete[0].mean[0], rel=1e-12)
    assert complete[1].variance[0] == pytest.approx(complete[0].variance[0], rel=1e-9)
    assert complete[1].error_variance[0] == pytest.approx(complete[0].error_variance[0], rel=1e-9)
    # where samples fail the number of successes is estimated too, with other factors for the mean
    assert found[1].mean[0] + 1.0 == pytest.approx(found[0].mean[0], rel=1e-12)
    assert found[1].variance[0] == pytest.approx(found[0].variance[0], rel=1e-9)


@pytest.mark.thorough
def test_failed_samples_leave_the_statistics_of_the_others() -> None:
    """All with a > 1.5 fail (7 %): mean and deviation are those of the inputs that do not, and errors are honest."""
    mean = exponential(0.5, 1.5)
    variance = exponential(1.0, 1.5) - mean**2 + 0.04 * (1.5**3 + EDGE**3) / (3 * (1.5 + EDGE)) + 0.01
    variance += 2 * 0.02 * (1.5**2 - EDGE**2) / (2 * (1.5 + EDGE))
    chaos, found = good(), []
    for seed in range(REPETITIONS):
        uniform, x = draw(seed, SAMPLES)
        fine = x[:, 0] < 1.5
        y = np.where(fine, model(x), np.nan)[:, None, None]
        sums = ControlledSums(ChaosControl(chaos, uniform), len(uniform))
        sums.add(0, y, fine)
        found.append(sums.apply(statistics(sample_statistics(y[fine]))))
    all_of = xr.concat(found, "r", data_vars="all").isel(output=0, time=0)
    for name, truth in (("mean", mean), ("variance", variance)):
        error = float(all_of[name].std(ddof=1)) / np.sqrt(REPETITIONS)
        assert abs(float(all_of[name].mean()) - truth) <= 3 * error, name
    for name, truth in (("mean", mean), ("std", np.sqrt(variance))):
        inside = float((abs(all_of[name] - truth) <= 1.96 * all_of[f"std_error_{name}"]).mean())
        assert 0.90 <= inside <= 0.99, (name, inside)
    assert float(all_of["variance_reduction"].median()) > 1.5


def test_surrogate_that_leaves_nothing_is_exact() -> None:
    """Of a response that is the surrogate, but for a constant, the estimates are exact to rounding."""
    chaos = chaos_of([[0, 0], [1, 0], [0, 1]], np.array([2.0, 0.5, 0.1]))
    uniform, x = draw(1, 100)
    y = (1e4 + 0.5 * x[:, 0] + 0.1 * x[:, 1])[:, None, None]
    sums = ControlledSums(ChaosControl(chaos, uniform), len(uniform))
    sums.add(0, y, np.ones(100, dtype=bool))
    found = sums.apply(statistics(sample_statistics(y)))
    assert found["mean"].item() == pytest.approx(1e4, rel=1e-13)
    assert found["std"].item() == pytest.approx(np.sqrt(0.26), rel=1e-9)
    assert found["std_error_mean"].item() < 1e-10
    assert 1e12 < found["variance_reduction"].item() < 1e16


# --- the propagator ---------------------------------------------------------------------------------------------------


@pytest.mark.thorough
def test_study_with_a_trained_control(curved: uqmbd.Study, curved_truth: dict) -> None:
    plain = curved.propagate(MonteCarlo(samples=400, seed=2))
    node = curved.propagate(MonteCarlo(samples=400, seed=2, control=Quadrature(order=2)))
    validate(node)
    assert (node.attrs["realisations"], node.attrs["control_realisations"]) == (416, 16)
    assert "16 realisations for the surrogate" in node.attrs["control_summary"]
    xr.testing.assert_identical(node["samples"].to_dataset(), plain["samples"].to_dataset())
    found, without = (n["statistics"].to_dataset().isel(time=1) for n in (node, plain))
    for name, (mean, std) in curved_truth.items():
        one = found.sel(output=name)
        assert abs(one["mean"] - mean) <= 4 * one["std_error_mean"] + 1e-12
        assert abs(one["std"] - std) <= 4 * one["std_error_std"] + 1e-12
    gain = without["std_error_mean"] / found["std_error_mean"].where(found["output"] != "fixed")
    assert gain.sel(output="skewed") ** 2 == pytest.approx(
        float(found["variance_reduction"].sel(output="skewed")), rel=0.01
    )
    assert found["variance_reduction"].sel(output="skewed") > 100
    for name in ("mean", "std", "std_error_mean", "std_error_std"):
        assert found[name].sel(output="fixed").item() == without[name].sel(output="fixed").item()
    assert found["variance_reduction"].sel(output="fixed").item() == 1.0
    assert found["variance_reduction_std"].sel(output="fixed").item() == 1.0
    for name in ("skewness", "kurtosis", "quantile"):
        np.testing.assert_array_equal(found[name], without[name])
        assert "from the samples alone" in found[name].attrs["comment"]


def test_collocation_as_control(curved: uqmbd.Study, curved_truth: dict) -> None:
    from uqmbd_collocation import Collocation

    node = curved.propagate(MonteCarlo(samples=100, seed=2, control=Collocation(order=3)))
    validate(node)
    assert node.attrs["realisations"] == 100 + node.attrs["control_realisations"] > 100
    found = node["statistics"].to_dataset().sel(output="skewed").isel(time=1)
    for name, truth in zip(("mean", "std"), curved_truth["skewed"], strict=True):
        assert abs(found[name] - truth) <= 4 * found[f"std_error_{name}"]
    assert found["variance_reduction"] > 1e4


@pytest.mark.thorough
def test_given_chaos_and_trained_one_give_the_same_bits_and_seeds_too(curved: uqmbd.Study) -> None:
    chaos, _ = Quadrature(order=1).fit(curved.problem(Quadrature(order=1)))
    trained = curved.propagate(MonteCarlo(samples=100, seed=7, control=Quadrature(order=1)))
    with ThreadPoolExecutor(2) as threads:
        again = curved.propagate(MonteCarlo(samples=100, seed=7, control=Quadrature(order=1)), workers=threads)
    given = curved.propagate(MonteCarlo(samples=100, seed=7, control=chaos))
    xr.testing.assert_identical(trained["statistics"].to_dataset(), again["statistics"].to_dataset())
    xr.testing.assert_identical(trained["statistics"].to_dataset(), given["statistics"].to_dataset())
    assert given.attrs["realisations"] == 100
    assert "a given surrogate" in given.attrs["control_summary"]


@pytest.mark.thorough
def test_many_samples_are_controlled_as_they_come(curved: uqmbd.Study, tmp_path: Path) -> None:
    options = {"samples": 300, "seed": 4, "control": Quadrature(order=1)}
    whole = curved.propagate(MonteCarlo(**options))
    streamed = curved.with_propagators([MonteCarlo(**options, keep=100)]).run(folder=tmp_path)["monte-carlo"]
    validate(streamed)
    assert streamed.attrs["all_samples"] == "monte-carlo-samples.zarr"
    for name in ("mean", "std", "std_error_mean", "std_error_std", "variance_reduction"):
        expected = whole["statistics"][name]
        np.testing.assert_allclose(streamed["statistics"][name], expected, rtol=1e-9, atol=1e-14, err_msg=name)


def test_dependent_inputs_are_controlled_at_the_same_uniform_numbers() -> None:
    """Names in another order than that of the conditioning; a linear response is known to its linear chaos exactly."""
    z, a = uqmbd.random_vector(["z", "a"], chaospy.MvNormal([1, 2], [[1.0, 0.6], [0.6, 2.0]]))
    study = resting({"y": 2 * z - a})
    node = study.propagate(MonteCarlo(samples=100, seed=1, control=Quadrature(order=1, nodes=2)))
    found = node["statistics"].to_dataset().isel(output=0, time=0)
    assert found["mean"].item() == pytest.approx(0.0, abs=1e-9)
    assert found["std"].item() == pytest.approx(np.sqrt(4 - 2.4 + 2), rel=1e-9)


@pytest.mark.thorough
def test_pendulum_of_random_length() -> None:
    """A mechanism that moves: the controlled estimates lie within their errors of many plain samples', and are better."""
    length = uqmbd.RandomVariable("length", chaospy.Normal(1.0, 0.05), units="m")
    mechanism = uqmbd.Mechanism("pendulum", uqmbd.Planar(gravity=(0.0, -9.81)))
    rod = mechanism.body("rod", mass=1.2, inertia=length**2 / 10, position=(length / 2, 0))
    mechanism.add(Revolute("pivot", mechanism.ground, rod, point_i=(0, 0), point_j=(-length / 2, 0)))
    mechanism.output("angle", rod.angle, units="rad")
    study = uqmbd.Study(
        "pendulum",
        mechanism,
        np.linspace(0, 1.5, 16),
        [
            MonteCarlo(samples=128, seed=1, control=Quadrature(order=2, nodes=5), label="controlled"),
            MonteCarlo(samples=2048, seed=2),
        ],
    )
    tree = study.run()
    validate(tree)
    one, many = (n["statistics"].to_dataset().isel(output=0) for n in propagator_nodes(tree).values())
    for name in ("mean", "std"):
        error = np.hypot(one[f"std_error_{name}"], many[f"std_error_{name}"])
        assert np.all(abs(one[name] - many[name])[1:] <= 4 * error[1:]), name
        # of a sixteenth of the samples; for plain ones the errors would be more than four times as large
        assert np.all(one[f"std_error_{name}"][1:] < many[f"std_error_{name}"][1:]), name
    assert one["variance_reduction"][0] == 1.0  # the start does not vary
    assert np.all(one["variance_reduction"][2:] > 100)


def test_progress_and_chunks_of_the_control_have_a_name_of_their_own(curved: uqmbd.Study) -> None:
    class Listener:
        def __init__(self) -> None:
            self.labels: list[tuple[str, int]] = []

        def start(self, label: str, total: int) -> None:
            self.labels.append((label, total))

        def advance(self, label: str, count: int = 1) -> None: ...

        def finish(self, label: str) -> None: ...

    listener = Listener()
    curved.propagate(MonteCarlo(samples=50, control=Quadrature(order=1)), progress=listener)
    assert listener.labels == [("monte-carlo: control", 16), ("monte-carlo", 50)]


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"control": 3}, ["control is 3", "Collocation(order=3)"]),
        ({"control": Quadrature(), "samples": 49}, ["samples is 49", "50"]),
        ({"control": Quadrature(), "sampling": "latin-hypercube"}, ["control", "'latin-hypercube'", "'random'"]),
    ],
)
def test_bad_options_are_explained(options: dict, words: list[str]) -> None:
    with pytest.raises(uqmbd.StudyError) as caught:
        MonteCarlo(**options)
    for word in words:
        assert word in str(caught.value)


def test_control_that_does_not_fit_is_explained(curved: uqmbd.Study) -> None:
    with pytest.raises(uqmbd.StudyError, match="'quadrature' computes no polynomial chaos; .*Collocation"):
        curved.propagate(MonteCarlo(samples=50, control=Quadrature(chaos=False)))
    chaos, _ = Quadrature(order=1).fit(curved.problem(Quadrature()))
    other = uqmbd.Study("other", curved.mechanism, [0.0, 2.0])
    with pytest.raises(uqmbd.StudyError, match="the output times of the control differ"):
        other.propagate(MonteCarlo(samples=50, control=chaos))
    axes = dataclasses.replace(chaos.labels, outputs=chaos.labels.outputs[::-1])
    turned = PolynomialChaos(chaos.coefficients, chaos.multi_index, chaos.space, axes)
    with pytest.raises(
        uqmbd.StudyError, match="outputs of the control are fixed, linear, skewed; expected .*skewed, linear, fixed"
    ):
        curved.propagate(MonteCarlo(samples=50, control=turned))
    c = uqmbd.RandomVariable("c", chaospy.Normal(0, 1))
    stranger = resting({"skewed": c, "linear": c, "fixed": None})
    with pytest.raises(uqmbd.StudyError, match="inputs of the control are a, b; expected those of the study, c"):
        stranger.propagate(MonteCarlo(samples=50, control=chaos))
