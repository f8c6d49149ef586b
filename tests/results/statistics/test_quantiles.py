"""Quantiles of samples that are not held at once: the bits of those that are, or bounds that hold."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from uqmbd.errors import StudyError
from uqmbd.extend import CountedQuantiles, quantiles_of_chunks
from uqmbd.results import sample_statistics
from uqmbd.results.statistics import brackets, quantiles

LEVELS = (0.0, 0.025, 0.05, 0.25, 0.5, 0.75, 0.95, 0.975, 1.0)

KINDS = ("normal", "ties", "constant", "cauchy", "sorted", "far", "tiny", "two values", "around zero", "scales")


@dataclass(frozen=True)
class Part:
    response: np.ndarray
    good: np.ndarray


@dataclass
class Passes:
    """Chunks that can be gone through again, and how often they were."""

    parts: Sequence[Part]
    count: int = 0

    def __iter__(self) -> Iterator[Part]:
        self.count += 1
        return iter(self.parts)


def drawn(kind: str, count: int, columns: int, generator: np.random.Generator) -> np.ndarray:
    normal = generator.normal(size=(count, columns))
    return {
        "normal": lambda: normal,
        "ties": lambda: np.round(2 * normal),
        "constant": lambda: np.full((count, columns), 3.7),
        "cauchy": lambda: generator.standard_cauchy((count, columns)) ** 3,
        "sorted": lambda: np.sort(normal, axis=0),
        "far": lambda: 1e8 + 1e-7 * np.round(3 * normal),
        "tiny": lambda: 1e-310 * normal,
        "two values": lambda: np.where(normal < 1, -1e300, 1e300),
        "around zero": lambda: normal * np.exp(100 * generator.normal(size=(count, columns))),
        "scales": lambda: normal * 10.0 ** generator.integers(-150, 150, columns),
    }[kind]()


def cut(x: np.ndarray, good: np.ndarray, edges: Sequence[int]) -> list[Part]:
    return [Part(*one) for one in zip(np.split(x, edges), np.split(good, edges), strict=True)]


def check(x: np.ndarray, good: np.ndarray, parts: list[Part], levels: Sequence[float]) -> None:
    """Hold both ways against NumPy's, on the samples that succeeded."""
    whole = x[good]
    ascending = np.sort(whole, axis=0)
    with np.errstate(over="ignore", invalid="ignore"):
        exact = np.quantile(whole, levels, axis=0)
        found = quantiles_of_chunks(parts, levels)
    # NumPy leaves a last bit of the larger neighbour; where the neighbours are as far apart as numbers can be it fails
    scale = np.maximum(np.abs(whole).max(axis=0), 1e-300)
    usable = np.isfinite(exact)
    np.testing.assert_allclose((found["quantile"] / scale)[usable], (exact / scale)[usable], rtol=0, atol=1e-14)
    np.testing.assert_array_equal(found["smallest"], ascending[0])
    np.testing.assert_array_equal(found["largest"], ascending[-1])
    counted = CountedQuantiles(levels)
    for part in parts:
        counted.add(part.response[part.good])
    with np.errstate(over="ignore", invalid="ignore"):
        bounds = counted.statistics()
    off = np.abs(bounds["quantile"] - found["quantile"])
    assert np.all(off <= bounds["quantile_error"]), (off, bounds["quantile_error"])
    assert np.all(np.diff(bounds["quantile"], axis=0) >= 0)
    np.testing.assert_array_equal(bounds["smallest"], ascending[0])


@pytest.mark.thorough
@settings(max_examples=250, deadline=None)
@given(data=st.data())
def test_quantiles_are_those_of_numpy(data: st.DataObject) -> None:
    """Small budgets, so that brackets are narrowed again and again; failures, and chunks of any sizes."""
    kind, seed = data.draw(st.sampled_from(KINDS)), data.draw(st.integers(0, 2**32))
    count, columns = data.draw(st.integers(3, 300)), data.draw(st.integers(1, 5))
    generator = np.random.default_rng(seed)
    x = drawn(kind, count, columns, generator)
    good = generator.random(count) < data.draw(st.sampled_from([1.0, 0.8]))
    good[:2] = True
    x[~good] = np.nan
    edges = sorted(data.draw(st.lists(st.integers(0, count), max_size=4)))
    levels = sorted(data.draw(st.sets(st.sampled_from(LEVELS), min_size=1)))
    first = data.draw(st.sampled_from([1, 7, 50]))
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(quantiles, "FIRST_SAMPLES", first)
        patch.setattr(quantiles, "GATHERED", data.draw(st.sampled_from([0, 5, 50, 50])))
        patch.setattr(quantiles, "COUNTERS", data.draw(st.sampled_from([1, 300, 5000])))
        patch.setattr(brackets, "BLOCK_NUMBERS", data.draw(st.sampled_from([40, 10_000])))
        check(x, good, cut(x, good, edges), levels)


@pytest.mark.parametrize("kind", KINDS)
def test_they_are_the_bits_of_samples_that_are_held(kind: str) -> None:
    generator = np.random.default_rng(5)
    x = drawn(kind, 1000, 3, generator)
    good = np.ones(1000, dtype=bool)
    with np.errstate(all="ignore"):  # moments of some of them overflow
        held = sample_statistics(x)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(quantiles, "FIRST_SAMPLES", 100)
        found = quantiles_of_chunks(cut(x, good, [10, 400, 400, 990]))
        backwards = quantiles_of_chunks(cut(x, good, [10, 400, 400, 990])[::-1])
    for name, value in found.items():
        np.testing.assert_array_equal(value, held[name], err_msg=name)
        np.testing.assert_array_equal(value, backwards[name], err_msg=name)


def test_counted_ones_are_the_same_in_any_order_and_close() -> None:
    """Bounds far below what so many samples leave open: 0.2 of the standard error of the median."""
    x = np.random.default_rng(2).normal(size=(40_000, 2, 3))
    parts = np.split(x, range(1000, 40_000, 1000))
    found = []
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(quantiles, "FIRST_SAMPLES", 4000)
        for order in ([0, 1, 2, 3, *range(4, 40)], [0, 1, 2, 3, *reversed(range(4, 40))]):
            counted = CountedQuantiles()
            for k in order:
                counted.add(parts[k])
            found.append(counted.statistics())
    for name, value in found[0].items():
        np.testing.assert_array_equal(value, found[1][name], err_msg=name)
    assert found[0]["quantile_error"].shape == (7, 2, 3)
    assert np.all(found[0]["quantile_error"][3] < 0.2 * 1.2533 / np.sqrt(len(x)))


def test_two_passes_are_enough_for_samples_like_the_first_ones() -> None:
    x = np.random.default_rng(2).normal(size=(30_000, 4))
    good = np.ones(len(x), dtype=bool)
    passes = Passes(cut(x, good, range(500, 30_000, 500)))
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(quantiles, "FIRST_SAMPLES", 3000)
        quantiles_of_chunks(passes)
    assert passes.count == 3  # and the first samples


def test_what_cannot_be_is_reported() -> None:
    x, good = np.zeros((4, 1)), np.ones(4, dtype=bool)
    with pytest.raises(StudyError, match="at least two successful samples; the number is 1"):
        quantiles_of_chunks([Part(x, np.arange(4) == 2)])
    with pytest.raises(StudyError, match="at least two successful samples; the number is 0"):
        quantiles_of_chunks([Part(x, ~good)])
    for bad in (np.nan, np.inf):
        x[1] = bad
        with pytest.raises(StudyError, match="contains NaN or infinity"):
            quantiles_of_chunks([Part(x, good)])
        counted = CountedQuantiles()
        counted.add(x)
        with pytest.raises(StudyError, match="contains NaN or infinity"):
            counted.statistics()
    one = CountedQuantiles()
    for count in (0, 1):
        with pytest.raises(StudyError, match=f"at least two successful samples; the number is {count}"):
            one.statistics()
        one.add(np.ones((1, 1)))
    with pytest.raises(StudyError, match="The probabilities are .*; expected increasing numbers"):
        quantiles_of_chunks([Part(x, good)], [0.5, 0.5])


def test_samples_that_change_between_passes_are_reported() -> None:
    generator = np.random.default_rng(0)

    class Changing:
        def __iter__(self) -> Iterator[Part]:
            yield Part(generator.normal(size=(1000, 1)), np.ones(1000, dtype=bool))

    with pytest.raises(StudyError, match="changed between two passes"):
        quantiles_of_chunks(Changing())
