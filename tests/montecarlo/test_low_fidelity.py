"""A cheaper study as control variate: unbiased, honest about its error, and refused where it does not fit."""

from __future__ import annotations

import functools
import warnings
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import chaospy
import numpy as np
import pytest
import scipy.optimize
import sympy
import xarray as xr

import uqmbd
from uqmbd.results import validate
from uqmbd_joints import Revolute
from uqmbd_montecarlo import LowFidelity, MonteCarlo
from uqmbd_montecarlo.allocation import equal_budget, optimum
from uqmbd_montecarlo.control import FOLDS, Controlled, controlled_statistics, controls, fold_of, variables
from uqmbd_montecarlo.jointmoments import JointMoments

from .conftest import resting

# these studies cost nothing, and what a control costs beside them depends on the machine
pytestmark = pytest.mark.filterwarnings("ignore:.*on an equal budget:UserWarning")

EDGE = np.sqrt(3.0)  # of uniform inputs of mean 0 and variance 1
REPETITIONS, SAMPLES = 250, 200


def expensive(x: np.ndarray) -> np.ndarray:
    return np.exp(0.5 * x[:, 0]) + 0.2 * x[:, 0] * x[:, 1] + 0.1 * x[:, 1]


CHEAP = {
    "linear": lambda x: 5.0 + 0.7 * x[:, 0],
    "good": lambda x: np.exp(0.45 * x[:, 0]) + 0.15 * x[:, 0] * x[:, 1],
    "useless": lambda x: np.sin(9.0 * x[:, 0]) * x[:, 1],
}


def truth() -> tuple[float, float]:
    """Mean and variance by a Gauss rule that is exact to rounding."""
    y, w = np.polynomial.legendre.leggauss(40)
    x = EDGE * np.stack(np.meshgrid(y, y), axis=-1).reshape(-1, 2)
    weights, values = np.outer(w, w).ravel() / 4, expensive(x)
    mean = float(weights @ values)
    return mean, float(weights @ (values - mean) ** 2)


def estimated(u: np.ndarray, z: np.ndarray, further: np.ndarray | None) -> Controlled:
    """Estimate from responses (S, C), the control at the samples (S, C), and besides (N, C)."""
    gathered, fold = variables(u, z, np.ones(len(u), dtype=bool)), fold_of(np.arange(len(u)), len(u))
    folds = [JointMoments.of(gathered[fold == k]) for k in range(FOLDS)]
    return controlled_statistics(folds, None if further is None else JointMoments.of(controls(further)))


@functools.cache
def repeated(name: str, further: int) -> tuple[np.ndarray, ...]:
    """Means, variances, their stated errors and reductions, and the plain mean and variance, of many seeds."""
    found = []
    for seed in range(REPETITIONS):
        generator = np.random.default_rng(seed)
        x, y = (EDGE * (2 * generator.random((n, 2)) - 1) for n in (SAMPLES, further))
        u, z, alone = (part[:, None] for part in (expensive(x), CHEAP[name](x), CHEAP[name](y)))
        centre, unit, shift = z[:50].mean(), z[:50].std(), u[:50].mean()
        one = estimated((u - shift) / unit, (z - centre) / unit, (alone - centre) / unit)
        scale = np.array([unit, unit**2, unit, unit**2, 1.0, 1.0])
        parts = (one.mean, one.variance, one.error_mean, one.error_variance, one.reduction_mean, one.reduction_variance)
        values = np.concatenate(parts) * scale
        values[0] += shift
        found.append([*values, u.mean(), u.var(ddof=1)])
    return tuple(np.array(found).T)


@pytest.mark.thorough
@pytest.mark.parametrize(("name", "further"), [("good", 4000), ("linear", 4000), ("good", 100)])
def test_estimates_are_unbiased_and_intervals_hold(name: str, further: int) -> None:
    mean, variance, error_mean, error_variance, *_ = repeated(name, further)
    for values, true in ((mean, truth()[0]), (variance, truth()[1])):
        assert abs(values.mean() - true) <= 3 * values.std(ddof=1) / np.sqrt(REPETITIONS)
    deviation = np.sqrt(variance)
    assert np.mean(abs(mean - truth()[0]) <= 1.96 * error_mean) >= 0.92
    assert np.mean(abs(deviation - np.sqrt(truth()[1])) <= 1.96 * error_variance / (2 * deviation)) >= 0.92


@pytest.mark.thorough
@pytest.mark.parametrize(("name", "further"), [("linear", 4000), ("good", 100), ("good", 4000), ("useless", 100)])
def test_stated_reduction_is_that_of_the_scatter(name: str, further: int) -> None:
    mean, variance, _, _, reduction_mean, reduction_variance, plain_mean, plain_variance = repeated(name, further)
    # two variances of 250 repetitions: each known to 9 %
    assert np.median(reduction_mean) == pytest.approx(plain_mean.var() / mean.var(), rel=0.3)
    assert np.median(reduction_variance) == pytest.approx(plain_variance.var() / variance.var(), rel=0.35)


@pytest.mark.parametrize("further", [200, 3000])
def test_reduction_is_that_of_theory(further: int) -> None:
    """Of normal variables with a correlation of 0.95: 1 / (l + (1 - l) / r), in the mean over many outputs."""
    generator, samples, left = np.random.default_rng(0), 1000, 1 - 0.95**2
    z = generator.normal(size=(samples + further, 60))
    u = 0.95 * z[:samples] + np.sqrt(left) * generator.normal(size=(samples, 60))
    found = estimated(u, z[:samples], z[samples:])
    ratio = 1 + further / samples
    assert np.mean(found.reduction_mean) == pytest.approx(1 / (left + (1 - left) / ratio), rel=0.03)
    # squares are correlated by the square
    left = 1 - 0.95**4
    assert np.mean(found.reduction_variance) == pytest.approx(1 / (left + (1 - left) / ratio), rel=0.05)


def test_mean_is_that_of_regressions_of_the_other_folds() -> None:
    z, u = np.random.default_rng(0).normal(size=(2, 100, 1))
    u += 0.8 * z
    further = np.random.default_rng(1).normal(size=(300, 1)) + 0.05
    found = estimated(u, z + 0.05, further)
    expected = []
    for k in range(FOLDS):
        of = fold_of(np.arange(100), 100) == k
        slope = np.polyfit(z[~of, 0], u[~of, 0], 1)[0]
        expected.append(u[of].mean() - 300 / 400 * slope * (z[of].mean() + 0.05 - further.mean()))
    assert found.mean[0] == pytest.approx(np.mean(expected), rel=1e-10)


def test_of_infinitely_many_further_realisations_the_expectations_are_known() -> None:
    z, u = np.random.default_rng(0).normal(size=(2, 200, 3))
    u += z
    gathered, fold = variables(u, z, np.ones(200, dtype=bool)), fold_of(np.arange(200), 200)
    folds = [JointMoments.of(gathered[fold == k]) for k in range(FOLDS)]
    many = JointMoments(10**15, np.zeros((2, 3)), 1e15 * np.ones((2, 2, 3)))
    one, other = controlled_statistics(folds), controlled_statistics(folds, many)
    for name in ("mean", "variance", "error_mean", "error_variance", "reduction_mean", "reduction_variance"):
        np.testing.assert_allclose(getattr(one, name), getattr(other, name), rtol=1e-9, err_msg=name)


@pytest.mark.parametrize(("left", "cost"), [(0.01, 0.01), (0.1, 0.05), (0.002, 0.3), (0.4, 0.01)])
def test_optimum_is_found_by_search_too(left: float, cost: float) -> None:
    found = scipy.optimize.minimize_scalar(
        lambda x: -equal_budget(left, np.exp(x), cost), bounds=(0, 7), method="bounded", options={"xatol": 1e-8}
    )
    assert optimum(left, cost) == pytest.approx(np.exp(found.x), rel=1e-4)


# --- the propagator ---------------------------------------------------------------------------------------------------


def variable(name: str, distribution: chaospy.Distribution, units: str = "") -> uqmbd.RandomVariable:
    return uqmbd.RandomVariable(name, distribution, units=units)


A = variable("a", chaospy.Normal(1.0, 0.2))


def rough() -> uqmbd.Study:
    """A study of the outputs of `curved` and others, in another order, without the input b."""
    a = variable("a", chaospy.Uniform(0.0, 2.0))  # of other distributions: that does not matter
    return resting({"other": a**3, "linear": 1000 * a, "fixed": None, "skewed": 1 + a + a**2 / 2})


def test_study_with_a_cheaper_one(curved: uqmbd.Study, curved_truth: dict) -> None:
    plain = curved.propagate(MonteCarlo(samples=400, seed=2))
    node = curved.propagate(MonteCarlo(samples=400, seed=2, control=LowFidelity(rough(), cost=0.01)))
    validate(node)
    total = node.attrs["control_realisations"]
    assert (node.attrs["realisations"], node.attrs["control_failures"]) == (400, 0)
    assert total > 1000
    assert f"{total} realisations of the control, 400 of them at the samples" in node.attrs["control_summary"]
    assert "of the time of a realisation of the study" in node.attrs["control_measured"]
    assert "LowFidelity('rest', cost=0.01)" in node.attrs["options"]
    xr.testing.assert_identical(node["samples"].to_dataset(), plain["samples"].to_dataset())
    found, without = (n["statistics"].to_dataset().isel(time=1) for n in (node, plain))
    for name, (mean, std) in curved_truth.items():
        one = found.sel(output=name)
        assert abs(one["mean"] - mean) <= 4 * one["std_error_mean"]
        assert abs(one["std"] - std) <= 4 * one["std_error_std"]
        gain = float((without["std_error_mean"] / found["std_error_mean"]).sel(output=name) ** 2)
        assert gain == pytest.approx(float(one["variance_reduction"]), rel=0.02)
    # what b adds is left: that of a b / 2 in one output, and of b in the other
    for name, share in (("skewed", 1.04 / 12 / curved_truth["skewed"][1] ** 2), ("linear", 1 / 3 / (1 / 3 + 0.04))):
        expected = 1 / (share + (1 - share) * 400 / total)
        assert float(found["variance_reduction"].sel(output=name)) == pytest.approx(expected, rel=0.2), name
    assert found["variance_reduction"].sel(output="fixed").item() == 1.0
    assert found["mean"].sel(output="fixed").item() == 2.5
    assert "the study 'rest' as control" in found["mean"].attrs["comment"]


@pytest.mark.parametrize("keep", [20_000, pytest.param(100, marks=pytest.mark.thorough)])
def test_bits_do_not_depend_on_workers(curved: uqmbd.Study, tmp_path: Path, keep: int) -> None:
    method = MonteCarlo(samples=300, seed=7, keep=keep, control=LowFidelity(rough(), samples=900))
    study = curved.with_propagators([method])
    one = study.run(folder=tmp_path / "one")["monte-carlo"]
    with ThreadPoolExecutor(3) as threads:
        other = study.run(workers=threads, folder=tmp_path / "other")["monte-carlo"]
    xr.testing.assert_identical(one["statistics"].to_dataset(), other["statistics"].to_dataset())
    assert one.attrs["control_summary"] == other.attrs["control_summary"]
    assert one.attrs["control_realisations"] == 900
    again = curved.propagate(MonteCarlo(samples=300, seed=8, keep=keep, control=LowFidelity(rough(), samples=900)))
    assert not np.array_equal(one["statistics/mean"], again["statistics/mean"])


def test_chunks_of_other_sizes_give_the_same_estimates(curved: uqmbd.Study) -> None:
    """Responses of the control are as wide as its outputs, and come in other chunks than those of the samples."""
    wide = resting(
        {f"more{k}": (k + 1) * A for k in range(60)} | {"linear": A, "fixed": None, "skewed": A + A**2}, [0.0, 1.0]
    )
    narrow = resting({"linear": A, "fixed": None, "skewed": A + A**2}, [0.0, 1.0])
    found = [
        curved.propagate(MonteCarlo(samples=300, seed=7, control=LowFidelity(one, samples=2000)))["statistics"]
        for one in (wide, narrow)
    ]
    for name in ("mean", "std", "std_error_mean", "variance_reduction_std"):
        np.testing.assert_allclose(found[0][name], found[1][name], rtol=1e-9, err_msg=name)


@pytest.mark.thorough
def test_many_seeds_of_a_study_whose_control_fails_at_some_inputs() -> None:
    """The mean of exp(a) is known; the control is not finite at a tenth of the inputs."""
    fine = resting({"y": sympy.exp(A)})
    cheap = resting({"y": sympy.sqrt(A - 0.75)})
    true, inside = np.exp(1.0 + 0.02), 0
    for seed in range(20):
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", RuntimeWarning)
            node = fine.propagate(MonteCarlo(samples=100, seed=seed, control=LowFidelity(cheap, samples=1000)))
        assert 40 < node.attrs["control_failures"] < 180
        found = node["statistics"].to_dataset().isel(output=0, time=0)
        inside += bool(abs(found["mean"] - true) <= 1.96 * found["std_error_mean"])
    assert inside >= 16


def test_control_that_does_not_help_is_reported_and_leaves_the_samples(curved: uqmbd.Study) -> None:
    b = variable("b", chaospy.Uniform(-1, 1))
    useless = resting({"skewed": sympy.cos(40 * b), "linear": sympy.cos(50 * b), "fixed": None})
    with pytest.warns(UserWarning, match=r"variance reduction 1\.0, no advantage over Monte Carlo"):
        node = curved.propagate(MonteCarlo(samples=200, seed=3, control=useless))
    plain = curved.propagate(MonteCarlo(samples=200, seed=3))
    xr.testing.assert_identical(node["statistics"].to_dataset(), plain["statistics"].to_dataset())
    assert "no advantage over Monte Carlo without control" in node.attrs["control_summary"]
    assert node.attrs["control_realisations"] == 200


def pendulum(rtol: float) -> uqmbd.Study:
    length = variable("length", chaospy.Normal(1.0, 0.05), "m")
    mechanism = uqmbd.Mechanism("pendulum", uqmbd.Planar(gravity=(0.0, -9.81)))
    rod = mechanism.body("rod", mass=1.2, inertia=length**2 / 10, position=(length / 2, 0))
    mechanism.add(Revolute("pivot", mechanism.ground, rod, point_i=(0, 0), point_j=(-length / 2, 0)))
    mechanism.output("angle", rod.angle, units="rad")
    mechanism.output("lowest", uqmbd.minimum(rod.point((length / 2, 0))[1]), units="m")
    return uqmbd.Study("pendulum", mechanism, np.linspace(0, 1.5, 16), rtol=rtol)


@pytest.mark.thorough
def test_levels_by_tolerance_and_outputs_without_a_time() -> None:
    """The same mechanism with a looser tolerance: estimates of 100 samples are those of 2,000."""
    control = LowFidelity(pendulum(1e-4), samples=2000)
    node = pendulum(1e-9).propagate(MonteCarlo(samples=100, seed=1, control=control))
    many = pendulum(1e-9).propagate(MonteCarlo(samples=2000, seed=2))
    validate(node)
    for one, other in (
        (node["statistics"].isel(output=0, time=-1), many["statistics"].isel(output=0, time=-1)),
        (node["scalars/statistics"].isel(output=0), many["scalars/statistics"].isel(output=0)),
    ):
        assert float(one["variance_reduction"]) == pytest.approx(20, rel=0.1)
        for name in ("mean", "std"):
            error = np.hypot(one[f"std_error_{name}"], other[f"std_error_{name}"])
            assert float(abs(one[name] - other[name])) <= 4 * error
            # those of fewer samples are wider
            assert 0.75 <= float(one[f"std_error_{name}"]) / float(other[f"std_error_{name}"]) <= 1.75


def test_a_study_alone_is_taken_and_its_use_is_reported() -> None:
    assert MonteCarlo(samples=100, control=rough()).control.cost == 0.1


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"study": 3}, ["study is 3", "uqmbd.Study"]),
        ({"study": rough(), "cost": 0}, ["cost is 0", "above 0"]),
        ({"study": rough(), "cost": float("nan")}, ["cost is nan", "above 0"]),
        ({"study": rough(), "samples": 2.5}, ["samples is 2.5", "whole number"]),
        ({"study": rough(), "samples": 100}, ["samples is 100", "samples=100", "102"]),
    ],
)
def test_bad_options_are_explained(options: dict, words: list[str]) -> None:
    with pytest.raises(uqmbd.StudyError) as caught:
        MonteCarlo(samples=100, control=LowFidelity(**options))
    for word in words:
        assert word in str(caught.value)


@pytest.mark.parametrize(
    ("control", "words"),
    [
        (resting({"skewed": A, "linear": A, "fixed": None}, [0.0, 2.0]), "different output times"),
        (
            resting({"skewed": A, "fixed": None}),
            "has no output 'linear'; expected all outputs of .* skewed, linear, fixed",
        ),
        (
            resting({"skewed": A, "linear": variable("c", chaospy.Uniform(0, 1)), "fixed": None}),
            "has the input 'c'; expected only inputs of the controlled study, a, b",
        ),
        (
            resting({"skewed": variable("a", chaospy.Uniform(0, 1), "m"), "linear": None, "fixed": None}),
            "has the input 'a' in 'm'; expected the units ''",
        ),
    ],
)
def test_control_that_does_not_fit_is_explained(curved: uqmbd.Study, control: uqmbd.Study, words: str) -> None:
    method = MonteCarlo(samples=50, control=control)
    assert method.obstacle(curved)
    with pytest.raises(uqmbd.StudyError, match=words):
        curved.propagate(method)


def test_outputs_of_another_kind_are_refused() -> None:
    other = pendulum(1e-6)
    mechanism = uqmbd.Mechanism("turned", uqmbd.Translational(gravity=(0, 0)))
    stone = mechanism.body("stone", mass=1, velocity=(1.0 * variable("length", chaospy.Normal(1, 0.1), "m"), 0))
    mechanism.output("lowest", stone.position[0], units="m")
    mechanism.output("angle", uqmbd.maximum(stone.position[0]), units="m")
    control = uqmbd.Study("turned", mechanism, other.times)
    with pytest.raises(
        uqmbd.StudyError, match="output 'angle' of the control study .* the wrong kind; expected an output over time"
    ):
        other.propagate(MonteCarlo(samples=50, control=control))


@pytest.mark.thorough
def test_an_accuracy_takes_fewer_samples_with_a_control() -> None:
    fine, cheap = resting({"y": sympy.exp(A)}), resting({"y": 1 + A + A**2 / 2})
    methods = (MonteCarlo(samples=100, seed=1), MonteCarlo(samples=100, seed=1, control=LowFidelity(cheap, cost=0.01)))
    few, many = (
        fine.with_propagators([method]).run(accuracy=0.03)["monte-carlo"].attrs["realisations"]
        for method in reversed(methods)
    )
    assert 5 * few < many
