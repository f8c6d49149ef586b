"""Intervals of quantiles by ranks, or by replicates of a design, contain the true quantile in 95 % of runs."""

from __future__ import annotations

from dataclasses import dataclass

import chaospy
import numpy as np
import pytest
from scipy import stats

import uqmbd
from uqmbd.extend import CountedQuantiles, labels, quantiles_of_chunks, sampling_design, statistics_dataset
from uqmbd.results import load, sample_statistics, save
from uqmbd_montecarlo import MonteCarlo
from uqmbd_springs import SpringDamper

DISTRIBUTIONS = {
    "normal": stats.norm(),
    "uniform": stats.uniform(),
    "exponential": stats.expon(),
    "long tail": stats.lognorm(1.5),
    "no variance": stats.t(1.5),
    "two groups": stats.beta(0.1, 0.1),
    "dice": stats.randint(1, 7),
    "rare": stats.bernoulli(0.02),
}


def random_case(seed):
    """Return the share of intervals of one quantile that contain it, the exact share, and the number of runs."""
    rng = np.random.default_rng(seed)
    name = str(rng.choice(list(DISTRIBUTIONS)))
    count, runs = int(np.exp(rng.uniform(np.log(5), np.log(1000)))), 200
    level = float(rng.choice([0.025, 0.05, 0.25, 0.5, 0.75, 0.95, 0.975, rng.uniform(0.001, 0.999)]))
    samples = DISTRIBUTIONS[name].rvs((count, runs), random_state=rng).astype(float)
    low, high = sample_statistics(samples, [level])["quantile_interval"][:, 0]
    true = DISTRIBUTIONS[name].ppf(level)
    # a ranked number in place of each sample has the same ranks
    lower, upper = sample_statistics(np.arange(1.0, count + 1), [level])["quantile_interval"][:, 0]
    exact = stats.binom.cdf(upper - 1, count, level) - stats.binom.cdf(lower - 1, count, level)
    return float(np.mean((low <= true) & (true <= high))), float(exact), runs, name in ("dice", "rare")


def test_intervals_of_random_cases_contain_the_quantile():
    """300 cases of 200 runs: in the share that the binomial distribution states, or more often where there are jumps."""
    found = [random_case(seed) for seed in range(300)]
    for share, exact, runs, jumps in found:
        assert exact >= 0.95 - 1e-12
        error = 4.5 * np.sqrt(exact * (1 - exact) / runs) + 1 / runs
        assert share >= exact - error and (jumps or share <= exact + error), (share, exact, jumps)
    # of continuous distributions together the share is the exact one
    shares, exact = np.array([one[:2] for one in found if not one[3]]).T
    assert np.mean(shares) == pytest.approx(np.mean(exact), abs=3e-3) and np.mean(exact) < 0.98


@pytest.mark.parametrize("count", [2, 10, 100, 1000])
@pytest.mark.parametrize("level", [0.0, 0.025, 0.3, 0.5, 0.95, 1.0])
def test_no_narrower_ranks_have_this_confidence(count, level):
    """Each end leaves at most 2.5 %, and the next rank leaves more; without such a rank the end is infinite."""
    samples = np.random.default_rng(count).permutation(np.arange(1.0, count + 1))
    low, high = sample_statistics(samples, [level])["quantile_interval"][:, 0]
    number = stats.binom(count, level)
    first, last = (0 if low == -np.inf else int(low)), (count + 1 if high == np.inf else int(high))
    assert number.cdf(first - 1) <= 0.025 and number.sf(last - 1) <= 0.025
    assert number.cdf(first) > 0.025 or first == count
    assert number.sf(last - 2) > 0.025 or last == 1


def test_intervals_move_and_scale_with_the_output():
    """Also of failed samples left out, of blocks of columns, and of several times."""
    rng = np.random.default_rng(3)
    samples, status = rng.normal(size=(200, 2, 3)), (rng.random(200) < 0.1).astype(int)
    found = sample_statistics(samples, status=status)["quantile_interval"]
    assert found.shape == (2, 7, 2, 3) and (found[0] < found[1]).all()
    np.testing.assert_array_equal(sample_statistics(samples[status == 0])["quantile_interval"], found)
    np.testing.assert_array_equal(sample_statistics(8 * samples, status=status)["quantile_interval"], 8 * found)
    turned = sample_statistics(-samples, status=status)["quantile_interval"]
    np.testing.assert_array_equal(turned, -found[::-1, ::-1])
    quantile = sample_statistics(samples, status=status)["quantile"]
    assert ((found[0] <= quantile) & (quantile <= found[1])).all()


OUTPUTS = {
    "normal": (1, lambda u: stats.norm.ppf(u[..., 0]), stats.norm.ppf),
    "waves": (1, lambda u: np.sin(8 * np.pi * u[..., 0]), lambda p: np.sin(np.pi * (p - 0.5))),
    "jump": (1, lambda u: (u[..., 0] > 0.9).astype(float), lambda p: (p > 0.9).astype(float)),
    "long tail": (4, lambda u: np.exp(stats.norm.ppf(u).sum(axis=-1)), stats.lognorm(2).ppf),
    "largest": (5, lambda u: u.max(axis=-1), lambda p: p**0.2),
    "distance": (3, lambda u: (stats.norm.ppf(u) ** 2).sum(axis=-1), stats.chi2(3).ppf),
}
"""Outputs of uniform inputs: their number, the output, and its quantiles."""


@pytest.mark.thorough
@pytest.mark.parametrize(("design", "count"), [("latin-hypercube", 19), ("sobol", 8), ("sobol", 32)])
def test_intervals_of_designs_contain_the_quantile(design, count):
    """Sixteen replicates, 100 runs of each output: in 95 % of all runs, and in no case in less than chance explains."""
    points, shares = sampling_design(design), []
    for number, (dimension, output, quantile) in enumerate(OUTPUTS.values()):
        streams = np.random.SeedSequence(number).spawn(1600)
        uniform = np.stack([points.points(dimension, count, one) for one in streams])
        samples = output(uniform).reshape(100, 16 * count).T
        found = sample_statistics(samples, independent=False, replicates=[count] * 16)
        low, high = found["quantile_interval"]
        true = quantile(found["probability"])[:, None]
        shares.append(((low <= true) & (true <= high)).mean(axis=1))
        if output is OUTPUTS["normal"][1]:
            ranks = sample_statistics(samples)["quantile_interval"]
            assert np.median((high - low)[3] / (ranks[1] - ranks[0])[3]) < 0.5
    assert np.mean(shares) >= 0.95 and np.min(shares) >= 0.87, np.round(shares, 2)


def test_intervals_of_replicates_and_failures():
    """Replicates of other sizes, failed samples, other units, and equal shares of all replicates at a quarter."""
    rng = np.random.default_rng(5)
    sizes = [19, 18, 18, 0, 19, 18, 18]
    samples, status = rng.normal(size=(sum(sizes), 2, 3)), (rng.random(sum(sizes)) < 0.1).astype(int)
    ends = np.cumsum([0, *sizes])
    fewer = [int((status[a:b] == 0).sum()) for a, b in zip(ends[:-1], ends[1:], strict=True)]
    found = sample_statistics(samples, status=status, independent=False, replicates=sizes)["quantile_interval"]
    left = sample_statistics(samples[status == 0], independent=False, replicates=fewer)["quantile_interval"]
    np.testing.assert_array_equal(found, left)
    turned = sample_statistics(-4 * samples, status=status, independent=False, replicates=sizes)["quantile_interval"]
    np.testing.assert_array_equal(turned, -4 * found[::-1, ::-1])
    strata = (np.arange(8) + rng.uniform(size=(16, 8))).ravel() / 8
    low, high = sample_statistics(strata, [0.25], independent=False, replicates=[8] * 16)["quantile_interval"][:, 0]
    assert low < 0.25 < high and high - low < 0.2


def test_intervals_of_a_design_need_replicates():
    assert "quantile_interval" not in sample_statistics(np.arange(9.0), independent=False)
    one = sample_statistics(np.arange(9.0), independent=False, replicates=[9, 0])["quantile_interval"]
    assert np.isnan(one).all()
    for sizes in ([4, 4], [], [10, -1]):
        with pytest.raises(uqmbd.StudyError, match="'replicates' is .* with the sum 9"):
            sample_statistics(np.arange(9.0), independent=False, replicates=sizes)
    with pytest.raises(uqmbd.StudyError, match="independent=False"):
        sample_statistics(np.arange(9.0), replicates=[9])


@pytest.mark.parametrize("count", [30, 400, 30_000])
def test_intervals_of_several_passes_and_of_counts(count):
    """Passes give the interval of stored samples, counts enclose it closely; also with few samples and with jumps."""
    rng = np.random.default_rng(count)
    samples = np.stack([rng.normal(size=count), np.exp(2 * rng.normal(size=count)), rng.integers(1, 7, count)], axis=1)
    parts = [Chunk(part, np.ones(len(part), dtype=bool)) for part in np.array_split(samples, 7)]
    right = sample_statistics(samples)
    np.testing.assert_array_equal(quantiles_of_chunks(parts)["quantile_interval"], right["quantile_interval"])
    counted = CountedQuantiles()
    for part in parts:
        counted.add(part.response)
    low, high = counted.statistics()["quantile_interval"]
    lower, upper = right["quantile_interval"]
    assert (low <= lower).all() and (upper <= high).all()
    assert (np.isinf(low) == np.isinf(lower)).all() and (np.isinf(high) == np.isinf(upper)).all()
    if count > 10_000:
        assert (np.maximum(lower - low, high - upper) <= 0.02 * right["std"]).all()
    assert "quantile_interval" not in quantiles_of_chunks(parts, independent=False)


@dataclass
class Chunk:
    """Consecutive successful samples."""

    response: np.ndarray
    good: np.ndarray


def test_results_store_intervals_of_samples(tmp_path):
    """In the units of the outputs, and with infinite ends where 40 samples are too few; those of a design, too."""
    stiffness = uqmbd.RandomVariable("k", chaospy.Uniform(90, 110), units="N/m")
    mechanism = uqmbd.Mechanism("oscillator", uqmbd.Line())
    mass = mechanism.body("mass", mass=1, position=0.1)
    mechanism.add(SpringDamper("spring", mechanism.ground, mass, 0, 0, stiffness=stiffness, free_length=0))
    mechanism.output("x", mass.position[0], units="m")
    mechanism.output("last", uqmbd.final(mass.position[0]), units="m")
    study = uqmbd.Study(
        "oscillator",
        mechanism,
        np.linspace(0, 0.3, 4),
        [MonteCarlo(samples=40, seed=1), MonteCarlo(samples=64, sampling="sobol", label="sobol")],
    )
    tree = study.run()
    save(tree, tmp_path / "oscillator.nc")
    node = load(tmp_path / "oscillator.nc")["monte-carlo"]
    for path in ("statistics", "scalars/statistics"):
        interval = node[path]["quantile_interval"]
        assert interval.attrs["units"] == "m" and interval["bound"].values.tolist() == ["lower", "upper"]
        low, high = interval.transpose("bound", ...).values
        assert (low <= high).all() and np.isinf(low[0]).all() and np.isinf(high[-1]).all()
        assert np.isfinite(interval.sel(probability=0.5)).all()
        design = tree["sobol"][path]["quantile_interval"].transpose("bound", ...)
        low, high = design.sel(probability=[0.25, 0.5, 0.75]).values
        assert design.attrs["units"] == "m" and (low <= high).all() and np.isfinite(high - low).all()


def test_an_interval_has_ends_in_order():
    axes = labels([("x", "m")], [], [0.0])
    interval = np.array([[[[0.5]]], [[[0.4]]]])
    data = statistics_dataset(
        axes, mean=[[0.0]], std=[[1.0]], quantile=[[[0.5]]], probability=[0.5], quantile_interval=interval
    )
    node = uqmbd.results.propagator_node("mine", data, propagator="p", realisations=2, wall_time=0.0)
    with pytest.raises(uqmbd.StudyError, match="quantile_interval: found a lower end that is not below"):
        uqmbd.results.validate(uqmbd.results.study_tree([node], study="s", mechanism="m"))
