"""Test an excitation with sampled paths: the key and the source alone determine a path."""

from __future__ import annotations

import math
import pickle
import re
from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np

from uqmbd.arguments import typechecked
from uqmbd.errors import UqmbdError
from uqmbd.mechanism import Component, Line, Local, Mechanism, Parameter, VirtualWork, excitation, t
from uqmbd.propagation import simulate
from uqmbd.randomness import RandomVariable
from uqmbd.typing import Array
from uqmbd.units import read_units

__all__ = ["check_excitation"]

KEYS = np.array([0.137, 0.62, 0.9041, 0.25, 0.7500000001, 0.75])
"""Keys of the paths; the last two are almost equal."""

LEAST_ERRORS = 5.0
"""Difference of a mean from its expected value, in standard errors, at which a check fails."""

SLACK = 0.02
"""Difference of the variance that is accepted in any case, such as the variance above the highest frequency."""


class Excited(Component):
    """A force on a body, of any units."""

    spaces = (Line,)
    bodies = ("body",)
    force = Parameter("", "excitation")

    def terms(self, p: Local) -> Iterator[VirtualWork]:
        """Yield the force."""
        yield VirtualWork(p.force, p.body.velocity[0])


class SplinePaths(NamedTuple):
    """Paths (K, source, n), as the method of a source returns them, with the number of the first knot."""

    number: int
    step: float
    coefficients: Array

    @property
    def values(self) -> Array:
        """Values at the knots, (K, source, n - 2)."""
        c = self.coefficients
        return np.asarray((c[..., :-2] + 4 * c[..., 1:-1] + c[..., 2:]) / 6)

    def at(self, argument: Array) -> Array:
        """Return values of the cubic splines, (K, source, N)."""
        place = np.asarray(argument) / self.step - self.number
        knot = np.minimum(np.floor(place).astype(np.int64), self.coefficients.shape[2] - 4)
        x = place - knot
        weights = (1 - x) ** 3, 3 * x**3 - 6 * x**2 + 4, -3 * x**3 + 3 * x**2 + 3 * x + 1, x**3
        return np.asarray(sum(w * self.coefficients[..., knot + k] for k, w in enumerate(weights)) / 6)


@typechecked(values=False)
def check_excitation(source: Any, *others: Any, interval: tuple[float, float] = (0.0, 10.0), paths: int = 200) -> None:
    """Check a source of excitations with sampled paths, such as a random process.

    - The source has a name, known units, a key, and a `repr` that states its parameters instead of an address.
    - A pickled source, and a second call, give the same bits.
    - Paths are finite, reach the whole interval, and have knots at multiples of the step.
    - The bits of a path depend neither on the interval nor on other keys; paths of different keys differ.
    - Sources with the same key are sampled together, and have different paths.
    - The mean over paths is zero, and the variance is ``source.variance``, if the source states it.
    - A mechanism reads the values of the path.

    Parameters
    ----------
    source : object
        Source for `uqmbd.extend.excitation`, with the attribute ``key``.
    *others : object
        Further sources with the same key, such as the process at other points.
    interval : tuple of float
        Interval of the argument, in its units. Paths are sampled up to half of its length beyond both ends. Choose an
        interval of ten or more correlation lengths.
    paths : int
        Number of paths whose mean and variance are checked.

    Raises
    ------
    AssertionError
        If a check fails; the message states the check.

    Examples
    --------
    >>> from uqmbd.testing import check_excitation
    >>> from uqmbd_processes import RandomProcess, iso8608
    >>> check_excitation(RandomProcess("road", psd=iso8608("C", band=(0.1, 1.0)), over="distance"), interval=(0, 80))
    """
    title = f"{type(source).__name__} {getattr(source, 'name', '')!r}"
    for one in (source, *others):
        _check_identity(one)
    _check_differences(title, source, others)
    begin, end = interval
    length = end - begin
    assert length > 0, f"check_excitation: interval is {interval!r}; expected (begin, end) with end above begin."
    every = sorted([source, *others], key=lambda one: str(one.name))
    whole = _sampled(title, every, KEYS, begin, end)
    _check_repeated(title, every, whole, interval)
    for low, high in (
        (begin + 0.3 * length, begin + 0.41 * length),
        (begin - 0.5 * length, begin + 0.2 * length),
        (begin + 0.7 * length, end + 0.5 * length),
        (begin + 0.5 * length, begin + 0.5 * length),
    ):
        _check_overlap(title, whole, _sampled(title, every, KEYS, low, high), f"from {low:g} to {high:g}", interval)
    for some in ([1], [2, 0], list(range(len(KEYS)))[::-1]):
        part = _sampled(title, every, KEYS[some], begin, end)
        same = np.array_equal(part.coefficients, whole.coefficients[some])
        assert same and part.step == whole.step, (
            f"{title}: a path changes if it is sampled with other keys (keys {KEYS[some].tolist()}); a path must "
            "depend on its own key only."
        )
    for j, row in enumerate(whole.coefficients):
        for k in range(j):
            assert not np.array_equal(row, whole.coefficients[k]), (
                f"{title}: the keys {KEYS[k]!r} and {KEYS[j]!r} have the same path; expected a different path for each "
                "key."
            )
    for j, one in enumerate(every):
        for k in range(j):
            assert not np.array_equal(whole.coefficients[:, k], whole.coefficients[:, j]), (
                f"{title}: the sources {every[k].name!r} and {one.name!r} have the same paths; expected the path of "
                "each source in its column."
            )
    for one in every:
        _check_moments(title, one, every, interval, paths)
    _check_kernel(title, source, interval)


def _check_identity(source: Any) -> None:
    """Check the attributes of a source, its `repr` and its pickled form."""
    kind = type(source).__name__
    name = getattr(source, "name", None)
    assert isinstance(name, str) and name.strip(), f"{kind}: name is {name!r}; expected a text."
    title = f"{kind} {name!r}"
    units = getattr(source, "units", None)
    known = isinstance(units, str) and read_units(units or "1") is not None
    assert known, f"{title}: units is {units!r}; expected known units such as 'm'."
    key = getattr(source, "key", None)
    assert isinstance(key, RandomVariable) and key.is_key, (
        f"{title}: key is {key!r}; expected uqmbd.extend.path_key(name). A source without a key has no sampled paths."
    )
    text = repr(source)
    assert not re.search(r" at 0x[0-9a-fA-F]+", text), (
        f"{title}: its repr contains an address ({text:.80}); expected a text that states all its parameters, because "
        "sources with the same repr are equal."
    )
    try:
        again = pickle.loads(pickle.dumps(source))
    except Exception as error:
        raise AssertionError(f"{title}: it cannot be pickled for workers: {type(error).__name__}: {error}") from error
    assert repr(again) == text, f"{title}: its repr changes when it is pickled: {text:.80}, then {again!r:.80}."
    assert again.key == key, f"{title}: its key changes when it is pickled; expected uqmbd.extend.path_key(name)."


def _check_differences(title: str, source: Any, others: tuple[Any, ...]) -> None:
    """Check that sources sampled together have one key, and different names and texts."""
    for other in others:
        assert other.key == source.key, (
            f"{title}: the source {other.name!r} has another key ({other.key} instead of {source.key}); sources that "
            "are sampled together have one key."
        )
    for what, values in (("name", [x.name for x in (source, *others)]), ("repr", [repr(x) for x in (source, *others)])):
        assert len(set(values)) == len(values), f"{title}: two sources have the same {what}: {values}."


def _sampled(title: str, sources: list[Any], keys: Array, begin: float, end: float) -> SplinePaths:
    """Return paths, after a check of the return value of the method."""
    where = f"{title}: sample_paths from {begin:g} to {end:g}"
    try:
        first, step, found = sources[0].sample_paths(sources, keys.copy(), begin, end)
    except (TypeError, ValueError) as error:
        raise AssertionError(
            f"{where} failed ({type(error).__name__}: {error}); expected (first, step, coefficients)."
        ) from error
    assert np.ndim(step) == 0 and 0 < step < math.inf, (
        f"{where} returned the step {step!r}; expected a positive number."
    )
    c = np.asarray(found)
    expected = (len(keys), len(sources))
    assert c.ndim == 3 and c.shape[:2] == expected and c.shape[2] > 3 and c.dtype == np.float64, (
        f"{where} returned coefficients of the shape {c.shape} and type {c.dtype}; expected {expected} and at least "
        "four float64 coefficients, for each key and source."
    )
    assert np.isfinite(c).all(), f"{where} returned coefficients that are not finite."
    number = round(first / step)
    assert abs(first / step - number) < 1e-6, (
        f"{where} returned the first knot {first!r}, which is not a multiple of the step {step!r}."
    )
    last = first + (c.shape[2] - 3) * step
    assert first <= begin and end < last, (
        f"{where} returned knots from {first:g} to {last:g}; expected knots at both ends and beyond the last one."
    )
    return SplinePaths(number, float(step), c)


def _check_repeated(title: str, sources: list[Any], whole: SplinePaths, interval: tuple[float, float]) -> None:
    """Check that a second call and pickled sources return the same bits."""
    again = _sampled(title, sources, KEYS, *interval)
    assert np.array_equal(again.coefficients, whole.coefficients), (
        f"{title}: two calls with the same keys return different paths; derive all random numbers from the key."
    )
    copies = [pickle.loads(pickle.dumps(one)) for one in sources]
    again = _sampled(title, copies, KEYS, *interval)
    assert np.array_equal(again.coefficients, whole.coefficients), (
        f"{title}: the paths of a pickled source differ; workers would compute other realisations."
    )


def _check_overlap(
    title: str, whole: SplinePaths, part: SplinePaths, where: str, interval: tuple[float, float]
) -> None:
    """Check that two intervals have the same step, and the same bits where they overlap."""
    assert part.step == whole.step, (
        f"{title}: the step is {part.step!r} {where}, and {whole.step!r} from {interval[0]:g} to {interval[1]:g}; "
        "expected one step for all intervals."
    )
    low = max(part.number, whole.number)
    high = min(x.number + x.coefficients.shape[2] for x in (part, whole))
    one, two = (x.coefficients[..., low - x.number : high - x.number] for x in (part, whole))
    if high > low and not np.array_equal(one, two):
        raise AssertionError(
            f"{title}: a path {where} differs from the same path from {interval[0]:g} to {interval[1]:g} by up to "
            f"{np.abs(one - two).max():.3g}; expected equal bits. A path must not depend on the interval: compute each "
            "coefficient from the number of its knot."
        )


def _check_moments(title: str, source: Any, sources: list[Any], interval: tuple[float, float], count: int) -> None:
    """Check the mean and the variance over paths."""
    keys = np.random.default_rng(11).random(count)
    values = _sampled(title, sources, keys, *interval).values[:, sources.index(source)]
    means = values.mean(axis=1)
    error = means.std(ddof=1) / math.sqrt(count)
    assert abs(means.mean()) <= LEAST_ERRORS * error + 1e-12 * np.abs(values).max(), (
        f"{title}: the mean over {count} paths is {means.mean():.3g} with the standard error {error:.2g}; expected 0. "
        "Add a mean to the expression of the excitation."
    )
    variance = getattr(source, "variance", None)
    if variance is None or not math.isfinite(variance):
        return
    squares = np.square(values).mean(axis=1)
    error = squares.std(ddof=1) / math.sqrt(count)
    assert abs(squares.mean() - variance) <= LEAST_ERRORS * error + SLACK * variance, (
        f"{title}: the variance of {count} paths is {squares.mean():.4g} with the standard error {error:.2g}; expected "
        f"source.variance = {variance:.4g}."
    )


def _check_kernel(title: str, source: Any, interval: tuple[float, float]) -> None:
    """Check that the compiled equations of a mechanism read the values of a path."""
    begin, end = interval
    mechanism = Mechanism("excited", Line())
    mass = mechanism.body("mass", mass=1)
    key = float(KEYS[0])
    times = np.linspace(0, 1, 12)
    try:
        force = excitation(source, begin + (end - begin) * t)
        mechanism.add(Excited("push", mass, force=force))
        mechanism.output("w", force)
        found = simulate(mechanism, times, {str(source.key): key})["w"].values
    except UqmbdError as error:
        raise AssertionError(f"{title}: a mechanism with the excitation failed: {error}") from error
    expected = _sampled(title, [source], np.array([key]), begin, end).at(begin + (end - begin) * times)[0, 0]
    size = np.abs(expected).max()
    assert np.allclose(found, expected, rtol=1e-6, atol=1e-9 * size), (
        f"{title}: the values in a mechanism differ from those of the splines by up to "
        f"{np.abs(found - expected).max():.3g}."
    )
