"""Processes pass the kit for excitations, and the kit finds each deliberate mistake."""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass

import numpy as np
import pytest

import uqmbd
from uqmbd.testing import check_excitation
from uqmbd_processes import RandomProcess, davenport_coherence, exponential_covariance, iso8608, kaimal

FREQUENCIES = np.array([1.7, 2.9, 4.3])
"""Frequencies of the harmonics, rad/s."""

STEP = 0.1


@dataclass(frozen=True)
class Swell:
    """Three sines with random phases; points of one field have phases in common."""

    name: str = "swell"
    height: float = 0.4
    units: str = "m"
    place: float = 0.0

    @property
    def key(self):
        return uqmbd.extend.path_key("swell")

    @property
    def variance(self):
        return self.height**2

    def numbers(self, begin, end):
        return np.arange(math.floor(begin / STEP) - 1, math.ceil(end / STEP) + 3)

    def generator(self, key):
        return np.random.default_rng(np.frombuffer(np.float64(key).tobytes(), dtype=np.uint32).tolist())

    def path(self, source, key, numbers):
        phases = self.generator(key).uniform(0, 2 * np.pi, 3) + FREQUENCIES * source.place
        filtered = self.height * np.sqrt(2 / 3) * 6 / (4 + 2 * np.cos(FREQUENCIES * STEP))
        return sum(a * np.sin(w * STEP * numbers + p) for a, w, p in zip(filtered, FREQUENCIES, phases, strict=True))

    def sample_paths(self, sources, keys, begin, end):
        numbers = self.numbers(begin, end)
        found = [[self.path(source, key, numbers) for source in sources] for key in keys]
        return (numbers[0] + 1) * STEP, STEP, np.array(found)


def test_a_sum_of_sines_passes():
    check_excitation(Swell())
    check_excitation(Swell("a"), Swell("c", place=0.4), Swell("b", place=1.0), interval=(-3.0, 20.0))


def test_its_paths_are_the_sines():
    """What the kit computes from the coefficients: at knots and between them."""
    first, step, c = Swell().sample_paths([Swell()], np.array([0.3]), 0.0, 9.0)
    values = (c[0, 0, :-2] + 4 * c[0, 0, 1:-1] + c[0, 0, 2:]) / 6
    phases = Swell().generator(0.3).uniform(0, 2 * np.pi, 3)
    times = first + step * np.arange(len(values))
    expected = 0.4 * np.sqrt(2 / 3) * np.sin(np.outer(times, FREQUENCIES) + phases).sum(axis=1)
    np.testing.assert_allclose(values, expected, atol=1e-12)


@pytest.mark.parametrize(
    ("make", "interval"),
    [
        (lambda: [RandomProcess("road", psd=iso8608("C", band=(0.1, 1.0)), over="distance")], (0, 80)),
        (
            lambda: [RandomProcess("gust", covariance=exponential_covariance(3.0, 0.5), units="N", cutoff=20.0)],
            (-5, 20),
        ),
        (lambda: [_wind().at(0, 20), _wind().at(0, 30), _wind().at(5, 30)], (0, 400)),
    ],
    ids=["road", "gust", "wind"],
)
@pytest.mark.thorough
def test_processes_pass(make, interval):
    check_excitation(*make(), interval=interval)


def _wind():
    coherence = davenport_coherence(10, 12)
    return RandomProcess("wind", psd=kaimal(1.5, 340.2, 12.0), units="m/s", coherence=coherence, cutoff=2.0)


def test_the_fixture_is_the_check(uqmbd_excitation):
    uqmbd_excitation(Swell())


@dataclass(frozen=True)
class Unseeded(Swell):
    def generator(self, key):
        return np.random.default_rng()


@dataclass(frozen=True)
class SharedGenerator(Swell):
    """Phases that are drawn in the order of the keys."""

    def sample_paths(self, sources, keys, begin, end):
        numbers, generator = self.numbers(begin, end), np.random.default_rng(1)
        shifted = [dataclasses.replace(self, place=x) for x in generator.uniform(0, 9, len(keys))]
        found = [[self.path(s, key, numbers)] for s, key in zip(shifted, keys, strict=True)]
        return (numbers[0] + 1) * STEP, STEP, np.array(found)


@dataclass(frozen=True)
class RoundedKeys(Swell):
    def generator(self, key):
        return np.random.default_rng(int(key * 1e6))


@dataclass(frozen=True)
class FromBegin(Swell):
    """Phases at the begin of the interval instead of at zero."""

    def path(self, source, key, numbers):
        return super().path(source, key, numbers - numbers[0])


@dataclass(frozen=True)
class AlmostSame(Swell):
    """Rounding depends on the interval."""

    def path(self, source, key, numbers):
        return super().path(source, key, numbers) + 1e-16 * numbers[0]


@dataclass(frozen=True)
class SeveralSteps(Swell):
    def sample_paths(self, sources, keys, begin, end):
        factor = 1 if end - begin > 2 else 2
        first, step, c = super().sample_paths(sources, keys, begin / factor, end / factor)
        return factor * first, factor * step, c


@dataclass(frozen=True)
class OneColumn(Swell):
    def sample_paths(self, sources, keys, begin, end):
        first, step, c = super().sample_paths(sources, keys, begin, end)
        return first, step, np.repeat(c[:, :1], len(sources), axis=1)


@dataclass(frozen=True)
class Noise(Swell):
    """A table of numbers that a pickled copy draws anew."""

    def __post_init__(self):
        object.__setattr__(self, "table", np.random.default_rng().random())

    def __reduce__(self):
        return (type(self), (self.name,))

    def path(self, source, key, numbers):
        return super().path(source, key, numbers) + self.table


class Plain:
    """A class without a repr."""

    name, units = "swell", "m"
    key = Swell().key


@dataclass(frozen=True)
class Closure(Swell):
    """A source with a function that cannot be pickled."""

    def __post_init__(self):
        object.__setattr__(self, "shape", lambda x: x)


class Forgetful(Swell):
    """A source that loses its height."""

    def __reduce__(self):
        return (type(self), (self.name,))


class OtherKey(Swell):
    """A source with a key of its own."""

    key = uqmbd.extend.path_key("other")


class Scaled(Swell):
    """A source whose variance is that of another height."""

    variance = 0.5


class NoKey(Swell):
    key = None


def returning(change):
    """Return a source that changes what the method returns."""

    class Changed(Swell):
        def sample_paths(self, sources, keys, begin, end):
            return change(*Swell.sample_paths(self, sources, keys, begin, end))

    Changed.__qualname__ = Changed.__name__ = f"Changed{len(CHANGED)}"
    globals()[Changed.__name__] = Changed
    CHANGED.append(Changed)
    return Changed()


CHANGED = []


@pytest.mark.parametrize(
    ("sources", "told"),
    [
        ([NoKey()], "key is None; expected uqmbd.extend.path_key"),
        ([Swell(name="")], "name is ''; expected a text"),
        ([Swell(units="foo")], "units is 'foo'; expected known units"),
        ([Plain()], "its repr contains an address"),
        ([Closure()], "it cannot be pickled for workers"),
        ([Forgetful(height=2.0)], "its repr changes when it is pickled"),
        ([Swell(name="a/b")], "a mechanism with the excitation failed"),
        ([Unseeded()], "two calls with the same keys return different paths"),
        ([Noise()], "the paths of a pickled source differ"),
        ([FromBegin()], "expected equal bits"),
        ([AlmostSame()], "expected equal bits"),
        ([SeveralSteps()], "expected one step for all intervals"),
        ([SharedGenerator()], "a path changes if it is sampled with other keys"),
        ([RoundedKeys()], "have the same path; expected a different path for each key"),
        ([Swell(), OtherKey("b")], "has another key"),
        ([Swell(), Swell(place=3.0)], "two sources have the same name"),
        ([OneColumn(), OneColumn("b", place=1.0)], "the sources 'b' and 'swell' have the same paths"),
        ([Scaled()], "expected source.variance = 0.5"),
        ([returning(lambda first, step, c: (first, step, c + 0.1))], "the mean over 200 paths is 0.1"),
        ([returning(lambda first, step, c: (first + 0.03, step, c))], "which is not a multiple of the step"),
        ([returning(lambda first, step, c: (first, 0.0, c))], "returned the step 0.0"),
        ([returning(lambda first, step, c: (first + 5 * step, step, c[..., 5:]))], "expected knots at both ends"),
        ([returning(lambda first, step, c: (first, step, c[..., :-2]))], "expected knots at both ends"),
        ([returning(lambda first, step, c: (first, step, c[:, 0]))], "returned coefficients of the shape"),
        ([returning(lambda first, step, c: (first, step, c.astype(np.float32)))], "and type float32"),
        ([returning(lambda first, step, c: (first, step, c * np.inf))], "that are not finite"),
        ([returning(lambda first, step, c: (first, c))], "expected .first, step, coefficients."),
    ],
    ids=lambda x: x if isinstance(x, str) else type(x[0]).__name__,
)
def test_mistakes_are_found(sources, told):
    with pytest.raises(AssertionError, match=told):
        check_excitation(*sources)


def test_an_interval_without_a_length_is_refused():
    with pytest.raises(AssertionError, match="expected .begin, end. with end above begin"):
        check_excitation(Swell(), interval=(1.0, 1.0))
