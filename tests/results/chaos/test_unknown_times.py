"""What is unknown at some times changes nothing at others; stated errors have no units."""

from __future__ import annotations

import chaospy
import numpy as np
import pytest

import uqmbd
from uqmbd.extend import AlignedElement, labels
from uqmbd.results import AlignedChaos
from uqmbd.results.chaos.sampling import quantiles_of_rows
from uqmbd.results.chaos.stated_error import (
    compute_stated_error,
    error_words,
    reference_spread,
    stated_words,
    uncertainty_factor,
)


def drawn(seed):
    """Of a surrogate and its verification: values (V, O, T), mean and deviation (O, T), weights, and unknown times."""
    draw = np.random.default_rng(seed)
    count, outputs, times = draw.integers(2, 20), draw.integers(1, 4), draw.integers(3, 12)
    response = draw.normal(size=(count, outputs, times)) * 10 ** draw.uniform(-3, 3, (outputs, 1))
    surrogate = response + draw.normal(size=response.shape) * 10 ** draw.uniform(-6, 0)
    weights = draw.random(count)
    mean, std = response.mean(axis=0), response.std(axis=0)
    if draw.random() < 0.3:  # an output that the surrogate takes for constant
        std[0], surrogate[:, 0] = 0.0, mean[0]
    elif draw.random() < 0.3:  # a common start
        std[:, 0], surrogate[:, :, 0], response[:, :, 0] = 0.0, mean[:, 0], mean[:, 0]
    unknown = draw.random((outputs, times)) < 0.3
    return surrogate, response, mean, std, weights / weights.sum(), unknown


def errors(surrogate, response, mean, std, weights):
    """Stated errors and their factors."""
    return compute_stated_error(surrogate, response, mean, std, weights), uncertainty_factor(
        surrogate - response, weights
    )


def test_what_is_unknown_changes_no_other_time():
    """Of 300 random surrogates with unknown times: the errors are those of a study that leaves these times out."""
    tried = 0
    for seed in range(300):
        surrogate, response, mean, std, weights, unknown = drawn(seed)
        for o in range(len(mean)):
            off = unknown[o]
            if off.all():
                continue
            one = [x[..., o : o + 1, :].copy() for x in (surrogate, response, mean, std)]
            without = errors(*(x[..., ~off] for x in one), weights)
            for k in (0, 2, 3):
                one[k][..., off] = np.nan
            found = errors(*one, weights)
            for with_them, alone in zip(found, without, strict=True):
                np.testing.assert_allclose(with_them[0, ~off], alone[0], rtol=1e-12)
                assert np.isnan(with_them[0, off]).all()
            tried += 1
    assert tried > 400


def test_stated_errors_have_no_units():
    """Of 300 random surrogates, y -> a y + b: errors and factors are the same, with unknown times or without."""
    for seed in range(300):
        surrogate, response, mean, std, weights, unknown = drawn(seed)
        draw = np.random.default_rng(seed + 1000)
        a = 10 ** draw.uniform(-9, 9) * draw.choice([-1, 1])
        b = draw.normal() * 1e3 * np.abs(a) * max(std.max(), 1e-3)
        if seed % 2:
            for x in (surrogate, mean, std):
                x[..., unknown] = np.nan
        known = errors(surrogate, response, mean, std, weights)
        other = errors(a * surrogate + b, a * response + b, a * mean + b, np.abs(a) * std, weights)
        for one, two in zip(known, other, strict=True):
            np.testing.assert_allclose(two, one, rtol=1e-4, atol=1e-7)


def test_the_reference_is_the_largest_known():
    found = reference_spread(np.array([[2.0, np.nan, 0.001], [np.nan, np.nan, np.nan]]))
    np.testing.assert_array_equal(found, [[2.0, np.nan, 0.02], [np.nan, np.nan, np.nan]])


def test_quantiles_are_unknown_where_a_sample_is():
    """NaN are sorted behind all numbers: they must not pass for the largest ones."""
    draw = np.random.default_rng(0)
    values = draw.normal(size=(6, 101))
    values[2, 5] = values[4, :] = np.nan
    found = quantiles_of_rows(lambda part: values[part].copy(), 101, 6, [0.0, 0.25, 0.5, 1.0])
    known = [0, 1, 3, 5]
    np.testing.assert_allclose(found[:, known], np.quantile(values[known], [0, 0.25, 0.5, 1], axis=1))
    assert np.isnan(found[:, [2, 4]]).all()


@pytest.mark.parametrize("scale", [1.0, 1e-9, 1e9])
def test_an_aligned_chaos_that_ends_early(scale):
    """Behind its last landmark it is unknown: all statistics are, at these times only."""
    a = uqmbd.RandomVariable("a", chaospy.Uniform(-1, 1))
    mechanism = uqmbd.Mechanism("inputs", uqmbd.Line())
    mechanism.output("a", a)
    space = uqmbd.extend.GermSpace.of(mechanism.inputs)
    values = np.zeros((2, 1, 1, 3))
    values[:, 0, 0] = scale * np.outer([1.0, 0.5], AlignedElement.points(3))
    edges = np.array([[0.0, 1.0], [0.0, 0.1]])  # the end is at 1 + 0.1 psi: between 0.83 and 1.17
    element = AlignedElement.through(uqmbd.extend.GermBox.whole(space), ("stop",), edges, values, "events")
    germs = np.linspace(-0.9, 0.9, 5)[:, None]
    times = [0.0, 0.4, 0.8, 1.0, 1.4]
    response = np.broadcast_to(scale * (1 + germs) * np.array(times), (5, 5))[:, None]
    known = dict(verification_germs=germs, verification_response=response)
    chaos = AlignedChaos((element,), np.array([[0], [1]]), labels(["x"], ["a"], times), **known)
    found = chaos.statistics()
    for name in ("mean", "std", "quantile", "sobol_total", "verification_error", "skewness"):
        unknown = np.isnan(found[name].values.reshape(-1, 5))
        np.testing.assert_array_equal(unknown, np.broadcast_to([False, False, False, True, True], unknown.shape), name)
    # of unit length, whatever the unit
    other = AlignedChaos.from_dataset(chaos.to_dataset()).statistics()["verification_error"].values[0]
    np.testing.assert_allclose(other[:3], found["verification_error"].values[0, :3])
    assert 0.1 < found["verification_error"].values[0, 2] < 1.0
    (verdict,) = chaos.verdicts()
    assert verdict.endswith("unknown at 2 of 5 times from 1 s on; raise the order") and "–" not in verdict


def test_words_on_errors_that_are_unknown_at_some_times():
    times = np.array([0.0, 1.0, 2.0])
    assert error_words(np.full(3, np.nan), times, 0.01) == "unknown at all times"
    said = stated_words("surrogate", np.array([np.nan, 0.2, 0.001]), times, 0.01)
    assert "20 % at 1 s" in said and said.endswith("unknown at 1 of 3 times from 0 s on; raise the order")
