"""Statistics against scipy.stats, closed-form moments, and the spread of repeated estimates."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest
import scipy.stats

from uqmbd.errors import StudyError
from uqmbd.extend import DEFAULT_PROBABILITIES, labels, sample_dataset, statistics_of_samples
from uqmbd.results import sample_statistics
from uqmbd.results.statistics import usual_errors
from uqmbd.results.statistics.samples import replicate_statistics, running_statistics


def test_statistics_agree_with_scipy_and_numpy() -> None:
    """All moments and quantiles are those of independent libraries."""
    x = np.random.default_rng(3).gamma(2.0, size=(137, 3, 5))
    found = sample_statistics(x)
    np.testing.assert_allclose(found["mean"], x.mean(axis=0), rtol=1e-14)
    np.testing.assert_allclose(found["std"], x.std(axis=0, ddof=1), rtol=1e-13)
    np.testing.assert_allclose(found["variance"], x.var(axis=0, ddof=1), rtol=1e-13)
    np.testing.assert_allclose(found["skewness"], scipy.stats.skew(x, axis=0), rtol=1e-12)
    np.testing.assert_allclose(found["kurtosis"], scipy.stats.kurtosis(x, axis=0, fisher=False), rtol=1e-12)
    t, g = scipy.stats.t(136).ppf(0.975), abs(scipy.stats.skew(x, axis=0))
    reach = t + g * (1 + 2 * t**2) / (6 * np.sqrt(137))  # Johnson's term, for the worse end
    np.testing.assert_allclose(
        found["std_error_mean"], reach / scipy.stats.norm.ppf(0.975) * scipy.stats.sem(x, axis=0), rtol=1e-12
    )
    np.testing.assert_allclose(found["quantile"], np.quantile(x, DEFAULT_PROBABILITIES, axis=0), rtol=1e-13)
    assert found["quantile"].shape == (7, 3, 5)


@pytest.mark.parametrize("shape", [(9,), (9, 4), (9, 2, 3)])
def test_any_number_of_axes(shape: tuple[int, ...]) -> None:
    """Outputs without a time, or a single output, are served as well, extreme probabilities included."""
    x = np.random.default_rng(0).normal(size=shape)
    found = sample_statistics(x, [0.0, 1.0])
    np.testing.assert_array_equal(found["quantile"], [x.min(axis=0), x.max(axis=0)])
    assert found["mean"].shape == shape[1:]


@pytest.mark.parametrize(
    "distribution", [scipy.stats.norm(), scipy.stats.expon(), scipy.stats.uniform(), scipy.stats.t(9)]
)
def test_standard_errors_are_the_spread_of_the_estimates(distribution: scipy.stats.rv_continuous) -> None:
    """Repeated deviations scatter by the usual errors, Var(s^2) = (mu4 - (n-3)/(n-1) s^4)/n; stated ones are wider."""
    n, repetitions = 400, 4000
    x = distribution.rvs(size=(n, repetitions), random_state=np.random.default_rng(5))
    found = sample_statistics(x)
    sigma = distribution.std()
    kurtosis = float(distribution.stats("k")) + 3
    exact = sigma * np.sqrt((kurtosis - (n - 3) / (n - 1)) / n) / 2
    assert exact < np.median(found["std_error_std"]) < 1.5 * exact
    assert np.std(found["std"]) == pytest.approx(exact, rel=0.05)
    assert np.std(found["mean"]) == pytest.approx(np.mean(found["std_error_mean"]), rel=0.08)
    usual = usual_errors(found["std"], found["kurtosis"], n)
    assert np.median(usual[1]) == pytest.approx(exact, rel=0.12)
    np.testing.assert_allclose(usual[0], scipy.stats.sem(x, axis=0), rtol=1e-12)


@pytest.mark.parametrize("distribution", [scipy.stats.norm(), scipy.stats.expon(), scipy.stats.uniform()])
def test_standard_errors_cover_the_truth(distribution: scipy.stats.rv_continuous) -> None:
    """The interval of two standard errors holds the true value at least 95 times in 100, and not always."""
    x = distribution.rvs(size=(1000, 3000), random_state=np.random.default_rng(7))
    found = sample_statistics(x)
    for name in ("mean", "std"):
        covered = np.abs(found[name] - getattr(distribution, name)()) < 1.96 * found[f"std_error_{name}"]
        assert 0.94 < covered.mean() < 0.985


@pytest.mark.parametrize(("offset", "scale"), [(0.0, 1e-100), (1e5, 1e-3), (-1e9, 1.0), (0.0, 1e120)])
def test_no_digits_are_lost(offset: float, scale: float) -> None:
    """A large offset does not cancel, and tiny or huge scales neither under- nor overflow in the fourth power."""
    x = np.random.default_rng(1).normal(size=(300, 2))
    plain, found = sample_statistics(x), sample_statistics(offset + scale * x)
    precision = 1e-12 + 10 * abs(offset) / scale * np.finfo(float).eps
    for name in ("skewness", "kurtosis"):
        np.testing.assert_allclose(found[name], plain[name], rtol=precision, atol=precision)
    for name in ("std", "std_error_mean", "std_error_std"):
        np.testing.assert_allclose(found[name], scale * plain[name], rtol=precision)


@pytest.mark.parametrize("value", [0.0, 0.1, -3.7e200, 5e-324])
def test_a_constant_is_a_constant(value: float) -> None:
    """Without spread the deviation is exactly 0, the skewness 0, the kurtosis 3."""
    found = sample_statistics(np.full((7, 2, 3), value))
    assert np.all(found["mean"] == value)
    for name in ("std", "variance", "skewness", "std_error_mean", "std_error_std"):
        assert np.all(found[name] == 0), name
    assert np.all(found["kurtosis"] == 3)
    assert np.all(found["quantile"] == value)


def test_rounding_has_no_shape() -> None:
    """A spread of one unit in the last place is noise: no skewness of 20 comes from it."""
    x = np.full((500, 1), 0.3)
    x[0] = np.nextafter(0.3, 1)
    found = sample_statistics(x)
    assert (found["skewness"].item(), found["kurtosis"].item()) == (0.0, 3.0)


def test_two_samples() -> None:
    """The smallest set: s = |a - b| / sqrt(2), and Var(s^2) from the formula at n = 2."""
    found = sample_statistics([[1.0], [4.0]])
    assert found["std"].item() == pytest.approx(3 / np.sqrt(2))
    assert np.isfinite(found["std_error_std"].item())


def test_who_computes_changes_no_bit() -> None:
    """Blocks of columns are the same ones for any number of threads, also where samples have failed."""
    rng = np.random.default_rng(5)
    response, status = rng.gamma(2.0, size=(4000, 3, 101)), (rng.random(4000) < 0.1).astype(int)
    alone, blocks = sample_statistics(response, status=status), list[int]()

    def noted(function, pieces):
        blocks.append(len(pieces))
        with ThreadPoolExecutor(3) as threads:
            return list(threads.map(function, pieces))

    together = sample_statistics(response, status=status, each=noted)
    assert blocks[0] > 3
    assert {name: x.tobytes() for name, x in alone.items()} == {name: x.tobytes() for name, x in together.items()}


def test_failed_samples_never_enter() -> None:
    """Statistics of samples with failures are those of the rest alone."""
    x = np.random.default_rng(2).normal(size=(20, 2, 3))
    axes = labels(["a", "b"], ["k"], [0.0, 1.0, 2.0])
    broken = x.copy()
    broken[4, 1, 2] = np.inf
    samples = sample_dataset(broken, np.zeros((20, 1)), axes, status=np.where(np.arange(20) == 7, 1, 0))
    found = statistics_of_samples(samples)
    np.testing.assert_allclose(found["mean"], np.delete(x, [4, 7], axis=0).mean(axis=0), rtol=1e-12, atol=1e-15)
    assert found["output"].values.tolist() == ["a", "b"]


def test_bad_input_is_named() -> None:
    """Too few samples, a hidden NaN, and unusable probabilities are errors that say what to do."""
    with pytest.raises(StudyError, match="at least two successful samples; only 1 of 3 succeeded"):
        sample_statistics(np.ones((3, 1)), status=[0, 1, 2])
    with pytest.raises(StudyError, match="set a status other than 0"):
        sample_statistics([[1.0], [np.nan]])
    for wrong in ([0.5, 0.5], [-0.1], [0.5, 1.1], []):
        with pytest.raises(StudyError, match="expected increasing numbers between 0 and 1"):
            sample_statistics([[1.0], [2.0]], wrong)
    with pytest.raises(StudyError, match="one number for each of the 2 samples"):
        sample_statistics([[1.0], [2.0]], status=[0])


def test_running_statistics_are_those_of_the_first_samples() -> None:
    """For each number of samples the estimates and errors are those of these samples, whatever the offset."""
    for offset, scale in ((0.0, 1.0), (1e5, 1e-3), (0.0, 1e-100)):
        x = offset + scale * np.random.default_rng(0).standard_exponential(200)
        found = running_statistics(x, [2, 17, 200])
        for k, n in enumerate((2, 17, 200)):
            plain = sample_statistics(x[:n, None])
            for name, values in found.items():
                assert values[k] == pytest.approx(plain[name].item(), rel=1e-6), (name, n)
    constant = running_statistics(np.full(5, 0.1), [2, 5])
    assert np.all(constant["mean"] == 0.1) and not constant["std"].any() and not constant["std_error_std"].any()
    with pytest.raises(StudyError, match="expected numbers from 2 to 3"):
        running_statistics([1.0, 2.0, 3.0], [4])


@pytest.mark.thorough
def test_replicate_statistics_are_honest() -> None:
    """With all replicates the estimates are those of all samples, and 95 % of the intervals hold the truth."""
    rng = np.random.default_rng(3)
    covered = {"mean": 0, "std": 0}
    for _ in range(400):
        x = rng.normal(size=(10, 30))
        found = replicate_statistics(list(x))
        assert found["mean"][-1] == pytest.approx(x.mean()) and found["std"][-1] == pytest.approx(x.std())
        assert np.isnan(found["std_error_mean"][0])
        for name, truth in (("mean", 0.0), ("std", 1.0)):
            covered[name] += abs(found[name][-1] - truth) < 1.96 * found[f"std_error_{name}"][-1]
    assert all(0.92 < count / 400 < 0.98 for count in covered.values()), covered
