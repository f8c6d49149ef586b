"""Sums of harmonics, against sines and cosines one by one."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from uqmbd.compiled import sum_harmonics


def evaluated(frequencies, lattice, constants, drifts, amplitudes, times):
    """Evaluate samples in turn."""
    found = np.full((*constants.shape, len(times)), np.nan)
    sum_harmonics(frequencies, lattice, constants, drifts, amplitudes, times, found, np.arange(len(frequencies)))
    return found


@pytest.mark.thorough
@given(st.integers(0, 2**32 - 1))
@settings(max_examples=100, deadline=None)
def test_values(seed):
    random = np.random.default_rng(seed)
    samples, outputs, harmonics, bases = random.integers(1, (40, 4, 12, 4))
    harmonics -= random.random() < 0.1
    count = random.integers(1, random.choice([4, 40, 400]))
    lattice = random.integers(-4, 5, (harmonics, bases))
    frequencies, begin = random.uniform(0.1, 3, (samples, bases)), random.uniform(0, 20)
    constants, drifts = random.normal(size=(2, samples, outputs))
    amplitudes = random.normal(size=(samples, outputs, harmonics)) + 1j * random.normal(
        size=(samples, outputs, harmonics)
    )
    # not every output has all harmonics
    amplitudes = amplitudes * (random.random((outputs, harmonics)) < 0.7)
    times = np.linspace(begin, begin + random.uniform(0.1, 50), count)
    if random.random() < 0.3:
        times = np.sort(random.uniform(begin, begin + 50, count))
    own = frequencies, lattice, constants, drifts, amplitudes, times
    found = evaluated(*own)
    phases = (frequencies @ lattice.T)[:, None, :, None] * times
    expected = (amplitudes.real[..., None] * np.cos(phases) - amplitudes.imag[..., None] * np.sin(phases)).sum(axis=2)
    expected += constants[..., None] + drifts[..., None] * times
    np.testing.assert_allclose(found, expected, rtol=0, atol=2e-11 * (1 + np.abs(amplitudes).sum(axis=2).max()))
    # to the bit: a sample without the others, and in a row of its own
    k = random.integers(samples)
    one = slice(k, k + 1)
    alone = evaluated(frequencies[one], lattice, constants[one], drifts[one], amplitudes[one], times)
    np.testing.assert_array_equal(alone, found[one])
    rows, more = random.permutation(samples + 2)[:samples], np.full((samples + 2, outputs, count), 7.0)
    sum_harmonics(*own, more, rows)
    np.testing.assert_array_equal(more[rows], found)
    assert (np.delete(more, rows, axis=0) == 7.0).all()


def test_harmonics_of_one_frequency_over_a_long_time():
    """Phases of a thousand turns are as accurate as they can be."""
    times, frequencies = np.linspace(3, 1000, 20_001), np.linspace(6, 7, 9)[:, None]
    lattice, still = np.array([[1], [2], [5]]), np.zeros((9, 1))
    found = evaluated(frequencies, lattice, still, still, np.ones((9, 1, 3), dtype=complex), times)
    expected = sum(np.cos(k * frequencies * times) for k in lattice[:, 0])
    assert np.abs(found[:, 0] - expected).max() < 1e-11


def test_shapes_that_do_not_fit_are_refused():
    numbers = {
        "frequencies": np.ones((5, 2)),
        "lattice": np.ones((3, 2), dtype=np.int64),
        "constants": np.zeros((5, 1)),
        "drifts": np.zeros((5, 1)),
        "amplitudes": np.ones((5, 1, 3), dtype=complex),
        "times": np.arange(4.0),
        "found": np.zeros((5, 1, 4)),
        "rows": np.arange(5),
    }
    sum_harmonics(**numbers)
    for name, wrong, message in (
        ("found", np.zeros((5, 2, 4)), "do not fit into the array"),
        ("found", np.zeros((5, 1, 8))[..., ::2], "do not fit into the array"),
        ("rows", np.arange(1, 6), "were given rows"),
        ("rows", np.arange(4), "were given rows"),
        ("lattice", np.ones((3, 1), dtype=np.int64), "lattice has the shape"),
        ("amplitudes", np.ones((5, 1, 2), dtype=complex), "amplitudes have the shape"),
        ("drifts", np.ones((5, 2)), "drifts have the shape"),
    ):
        with pytest.raises(ValueError, match=message):
            sum_harmonics(**{**numbers, name: wrong})
