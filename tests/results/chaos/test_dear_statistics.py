"""Statistics of a chaos that are too dear are those of samples of the surrogate, and say so; they end no run."""

from __future__ import annotations

import chaospy
import numpy as np
import pytest
import xarray as xr
from hypothesis import given, settings
from hypothesis import strategies as st

import uqmbd
from uqmbd.extend import labels
from uqmbd.randomness.index_sets import index_set
from uqmbd.randomness.joint import JointInput
from uqmbd.randomness.space.germ_space import GermSpace
from uqmbd.results import PolynomialChaos, load, save
from uqmbd.results.chaos import chaos_from_dataset
from uqmbd.results.chaos import sampling as chaos_sampling
from uqmbd.results.chaos.terms import moments as chaos_moments
from uqmbd_collocation import Collocation
from uqmbd_galerkin import Galerkin

KINDS = (chaospy.Normal(), chaospy.Uniform(-1, 1), chaospy.Gamma(3), chaospy.Beta(2, 5))


@pytest.fixture
def dear():
    """Let nothing exact be possible."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(chaos_moments, "MAX_NODES", 0)
        patch.setattr(chaos_moments, "MAX_PRODUCTS", 0)
        yield patch


def made(kinds, order, times, seed, decay=3.0):
    inputs = [uqmbd.RandomVariable(f"x{k}", KINDS[kind]) for k, kind in enumerate(kinds)]
    space = GermSpace.of(JointInput.of(inputs))
    index = index_set(len(kinds), order)
    values = np.random.default_rng(seed).normal(size=(len(index), 1, times))
    values *= decay ** -index.sum(axis=1)[:, None, None]
    axes = labels([("y", "m")], [(v.name, "1") for v in inputs], np.arange(times, dtype=float))
    return PolynomialChaos(values, index, space, axes)


@pytest.mark.thorough
@given(st.lists(st.sampled_from(range(4)), min_size=1, max_size=3), st.integers(1, 2), st.integers(0, 2**32 - 1))
@settings(max_examples=8, deadline=None)
def test_samples_tell_what_the_exact_routes_tell(kinds, order, seed):
    """Within five standard errors of as many random samples, whose errors of tails are known from higher moments."""
    exact = made(kinds, order, 3, seed)
    assert not exact.shape_samples
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(chaos_moments, "MAX_NODES", 0)
        patch.setattr(chaos_moments, "MAX_PRODUCTS", 0)
        other = made(kinds, order, 3, seed)
        assert other.shape_samples == 8192
        unit = (exact.evaluate_germs(chaos_sampling.random_germs(exact.space, 100_000, seed)) - exact.mean) / exact.std
        # how the sample moments move with the samples, to first order, mean and deviation being theirs
        third, fourth = exact.skewness, exact.kurtosis
        square = unit**2 - 1
        of_third = unit**3 - third - 3 * unit - 1.5 * third * square
        of_fourth = unit**4 - fourth - 4 * third * unit - 2 * fourth * square
        error = np.sqrt(8192)
        assert np.all(np.abs(other.skewness - third) < 5 * of_third.std(axis=0) / error + 1e-9)
        assert np.all(np.abs(other.kurtosis - fourth) < 5 * of_fourth.std(axis=0) / error + 1e-9)
        assert np.all(other.kurtosis >= 1.0)


def test_what_does_not_vary_keeps_its_moments(dear):
    chaos = made([0, 1], 2, 3, 1)
    values = chaos.coefficients.copy()
    values[1:, :, 1] = 0.0
    flat = PolynomialChaos(values, chaos.multi_index, chaos.space, chaos.labels)
    assert (flat.skewness[0, 1], flat.kurtosis[0, 1]) == (0.0, 3.0)


@pytest.mark.thorough
def test_attributes_say_what_is_of_samples(dear, tmp_path):
    statistics = made([0, 1], 2, 3, 1).statistics()
    for name in ("skewness", "kurtosis"):
        assert statistics[name].attrs["samples"] == 8192
        assert "estimated from 8192 samples of the surrogate" in statistics[name].attrs["comment"]
    assert "samples" not in statistics["mean"].attrs and "samples" not in statistics["quantile"].attrs
    tree = xr.DataTree.from_dict({"statistics": statistics})
    assert load(save(tree, tmp_path / "r.nc"))["statistics/skewness"].attrs["samples"] == 8192


def test_exact_ones_say_nothing():
    statistics = made([0, 1], 2, 3, 1).statistics()
    assert all("samples" not in statistics[name].attrs for name in statistics.data_vars)


def test_quantiles_of_very_many_terms_take_fewer_samples_and_say_so(monkeypatch):
    chaos = made([0, 1], 2, 3, 1)
    monkeypatch.setattr(chaos_sampling, "BASIS_NUMBERS", 1024 * len(chaos.multi_index))
    statistics = chaos.statistics()
    assert statistics["quantile"].attrs["samples"] == 1024
    assert "estimated from 1024 samples of the surrogate" in statistics["quantile"].attrs["comment"]
    scale = float(chaos.std.max())
    assert np.abs(statistics["quantile"].values - chaos.quantiles()).max() < 0.3 * scale


@given(st.integers(1, 10**7), st.integers(1, 10**7), st.sampled_from([1, 100, 8192, 16384]))
def test_affordable_samples(terms, columns, wanted):
    found = chaos_sampling.affordable(wanted, terms, columns)
    assert min(wanted, chaos_sampling.LEAST) <= found <= wanted
    if found > chaos_sampling.LEAST and found < wanted:
        assert found * terms <= chaos_sampling.BASIS_NUMBERS and found * terms * columns <= chaos_sampling.WORK


@pytest.mark.parametrize(
    "method",
    [
        Collocation(order=2),
        Collocation(adaptive="dimension", tolerance=0.1),
        Collocation(order=1, elements=2),
        Galerkin(order=2),
    ],
    ids=["plain", "adaptive", "elements", "galerkin"],
)
def test_finished_run_is_not_thrown_away(dear, method):
    mechanism = uqmbd.Mechanism("fall", uqmbd.Translational(gravity=(0, -9.81)))
    speed = uqmbd.RandomVariable("speed", chaospy.Normal(3, 0.2), units="m/s")
    stone = mechanism.body("stone", mass=1, velocity=(0, speed))
    mechanism.output("square", stone.position[1] ** 2, units="m^2")
    node = uqmbd.Study("fall", mechanism, np.linspace(0, 1, 3)).propagate(method)
    assert node["statistics"]["kurtosis"].attrs["samples"] == 8192
    # y = 3 t - g t^2 / 2 + t d with d normal of deviation 0.2: skewness of its square, in closed form
    mean, dev = 3 - 9.81 / 2, 0.2
    a, b = 2 * mean * dev, dev**2
    expected = (6 * a**2 * b + 8 * b**3) / (a**2 + 2 * b**2) ** 1.5
    assert float(node["statistics"]["skewness"][0, -1]) == pytest.approx(expected, abs=0.05)
    assert chaos_from_dataset(node["chaos"]).shape_samples == 8192


@pytest.mark.slow
def test_many_inputs_of_order_three():
    """2925 terms of 24 gamma inputs have more products than are tabulated; a sum has the moments of its parts."""
    count = 24
    inputs = [uqmbd.RandomVariable(f"x{k:02d}", chaospy.Gamma(2 + k)) for k in range(count)]
    space = GermSpace.of(JointInput.of(inputs))
    index = index_set(count, 3)
    values = np.zeros((len(index), 1, 2))
    values[1:] = 1e-9
    shapes = np.arange(2, 2 + count, dtype=float)
    for k in range(count):
        row = np.flatnonzero((index == np.eye(count, dtype=int)[k]).all(axis=1))[0]
        values[row] = np.sqrt(shapes[k])
    chaos = PolynomialChaos(values, index, space, labels(["y"], [(v.name, "1") for v in inputs], [0.0, 1.0]))
    statistics = chaos.statistics()
    assert chaos.shape_samples == 8192
    # the sum of gamma variables of one scale is a gamma variable: skewness 2 / sqrt(a), kurtosis 3 + 6 / a
    total = shapes.sum()
    assert np.abs(statistics["kurtosis"].values - (3 + 6 / total)).max() < 0.1
    assert np.abs(statistics["skewness"].values - 2 / np.sqrt(total)).max() < 0.05
