"""Test whether two methods agree within their stated errors, and describe their differences."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from uqmbd.results.assessment.limits import COARSE, ENOUGH_SAMPLES, EXACT, LEAST_SAMPLES, ROUGH
from uqmbd.results.assessment.own_errors import NO_SPREAD, NO_VARIATION, OwnError, root_mean_square
from uqmbd.results.assessment.simultaneous import curve_length, pointwise_level, student
from uqmbd.results.chaos import error_words
from uqmbd.results.statistics import divisor
from uqmbd.typing import Array
from uqmbd.wording import format_percent, format_quantity

__all__ = [
    "AGREES",
    "DIFFERS",
    "FEW",
    "NO_SPREAD",
    "REFERENCE",
    "UNDER_RESOLVED",
    "UNVERIFIED",
    "Verdict",
    "compare_with_reference",
]


REFERENCE, AGREES, DIFFERS = "reference", "agrees", "differs"
UNDER_RESOLVED, FEW, UNVERIFIED = "under-resolved", "too few samples", "not verified"


@dataclass(frozen=True)
class Verdict:
    """Verdict on one output of a method."""

    kind: str  # one of the constants of this module, or `NO_SPREAD`
    # statement on the output, worst finding first: the kind in words, with numbers; for a method that agrees, its
    # stated error comes first
    text: str
    # smallest detectable difference of standard deviations, relative to the reference (root mean squares over time)
    within: float


@dataclass(frozen=True, eq=False)
class _Deviation:
    """Difference of a statistic beyond its random error, at the worst time of an output."""

    significant: bool
    worst: int


def compare_with_reference(
    found: OwnError,
    base: OwnError,
    times: Array,
    units: list[str],
    *,
    level: float,
    floor: Array,
    names: tuple[str, str] = ("the method", "the reference"),
    own: Sequence[str] | None = None,
    coarse: tuple[ArrayLike, ArrayLike] = (COARSE, COARSE),
) -> list[Verdict]:
    """Compare a method with a reference, output by output.

    `found`, `base`: errors of the method and of the reference, at times at which both are known; `times` (T,): these
    times, s; `units`: units of the outputs; `level`: largest probability that an agreeing method is reported to differ
    in any output at any time; `floor` (O,): differences that are ignored, in the units of the outputs; `names`: labels
    of the method and the reference; `own`: statements of the method on its own error; `coarse`: two limits of the
    stated error over the standard deviation. Above the first limit the method is under-resolved, above the second limit
    the reference cannot verify a method.

    Half of the level is for the means and half for the standard deviations, in equal parts for the outputs. For each
    output, the largest deviation over time is tested, see :mod:`uqmbd.results.assessment.simultaneous`.
    """
    own = [""] * len(units) if own is None else own
    found, base = found.informed(base), base.informed(found)
    share = level / (2 * max(len(units), 1))
    limits = np.stack([np.broadcast_to(np.asarray(limit, dtype=float), len(units)) for limit in coarse], axis=1)
    return [
        _verdict(found, base, o, times, units[o], share, float(floor[o]), names, own[o], limits[o])
        for o in range(len(units))
    ]


def _verdict(
    found: OwnError,
    base: OwnError,
    o: int,
    times: Array,
    units: str,
    level: float,
    floor: float,
    names: tuple[str, str],
    own: str,
    limits: Array,
) -> Verdict:
    if not len(times):
        return Verdict(UNDER_RESOLVED, "not compared: the results have no common time", np.inf)
    scale = float(root_mean_square(base.std[o : o + 1], times)[0]) or float(np.abs(base.std[o]).max())
    bound_mean = _bound(found, base, o, level, "mean")
    bound_std = _bound(found, base, o, level, "std")
    within = _ratio(float(root_mean_square(_widths(found, base, o, bound_std, floor)[None], times)[0]), scale)
    unseen_times, rare = _rare(found, base, o, level)
    tests = {}
    for claimed in (True, False):
        slack = floor + base.integration[o] + found.integration[o] + base.bias[o] + (found.bias[o] if claimed else 0.0)
        tests[claimed] = (
            _mean_deviation(found, base, o, bound_mean, slack, unseen_times),
            _std_deviation(found, base, o, bound_std, slack, unseen_times),
        )
    beyond = any(d.significant for d in tests[True])
    unexplained = any(d.significant for d in tests[False])
    few = rare or _few(found, base, o, times)
    stated = float(found.stated[o])
    of_base = float(base.stated[o])
    # large terms of the highest order indicate missing terms, unless verification shows that the surrogate is exact
    truncated = float(found.top_order[o]) > COARSE and not stated <= EXACT
    coarse = stated > limits[0] or (truncated and (beyond or (unexplained and np.isnan(stated))))
    if not base.varies[o] and not (found.varies[o] and tests[True][1].significant):
        moved = "; ".join(_differences(found, base, o, times, units, tests[True][:1]))
        if rare and not moved:
            return _of_few(rare, names, within)
        return Verdict(DIFFERS, f"differs: {moved}", within) if moved else Verdict(NO_SPREAD, NO_VARIATION, 0.0)
    differences = "; ".join(_differences(found, base, o, times, units, tests[beyond] if unexplained else ()))
    if beyond and not coarse and not (found.drawn and found.samples < LEAST_SAMPLES) and not of_base > limits[1]:
        if few and base.drawn and base.samples < LEAST_SAMPLES:
            return _of_few(few, names, within)
        return Verdict(DIFFERS, f"differs: {differences}", within)
    if coarse:
        subject = "its surrogate" if found.surrogate else "it"
        order = f"order {found.order} is too low" if found.order is not None else f"{subject} is not accurate enough"
        why = f"its stated error is {_describe_error(found, o, times)}" if np.isfinite(stated) else (
            f"{format_percent(float(found.top_order[o]))} of the standard deviation is in terms of its highest order"
        )  # fmt: skip
        tail = f"; {differences}" if differences else ""
        return Verdict(UNDER_RESOLVED, f"under-resolved: {order}, {why}{tail}", within)
    if few:
        return _of_few(few, names, within)
    if of_base > limits[1]:
        text = f"the stated error of {names[1]}, the reference, is {format_percent(of_base)}: too large for a verdict"
        return Verdict(UNVERIFIED, f"not verified: {text}", within)
    unseen = (
        f" (a difference of the standard deviation below {format_percent(within)} cannot be detected)" if within else ""
    )
    large = found.stated_at[o].max(initial=0.0) > (ROUGH if found.drawn else EXACT)
    inside = " within this error" if large else ""
    return Verdict(AGREES, f"{own}{'; ' if own else ''}agrees with {names[1]}{inside}{unseen}", within)


def _of_few(few: tuple[int, str], names: tuple[str, str], within: float) -> Verdict:
    """Return the verdict if the method (0), or the reference (1), has too few samples for a test."""
    which, text = few
    kind, words = (
        (FEW, "too few samples for a verdict"),
        (UNVERIFIED, "not verified, too few samples of the reference"),
    )[which]
    return Verdict(kind, f"{words}: {names[which]} has {text}", within)


def _describe_error(found: OwnError, o: int, times: Array) -> str:
    """Return a text on the stated error of an under-resolved surrogate."""
    return error_words(found.stated_at[o], times if len(times) > 1 else None, EXACT, found.std[o])


def _ratio(value: float, scale: float) -> float:
    return value / scale if scale > 0 else 0.0


def _bound(found: OwnError, base: OwnError, o: int, level: float, name: str) -> Array:
    """Return the critical value (T,) of the largest deviation over time, in standard errors."""
    noisy = [m for m in (found, base) if m.samples]
    count = found.mean.shape[1]
    if not noisy:
        return np.zeros(count)
    squares = np.array([_noise(m, o, name) ** 2 for m in noisy])
    parts = [_parts(m, o, name) for m in noisy if m.response is not None]
    length = curve_length(parts) if len(parts) == len(noisy) else np.inf
    freedoms = np.array([_freedom(m, o, name) for m in noisy])
    total = squares.sum(axis=0)
    split = (squares**2 / freedoms).sum(axis=0)
    # degrees of freedom of Welch and Satterthwaite
    usable = (split > 0) & np.isfinite(split) & np.isfinite(total)
    freedom = np.where(usable, total**2 / np.where(usable, split, 1.0), freedoms.min(axis=0))
    bound: Array = student(pointwise_level(level, length, count), np.asarray(freedom, dtype=float))
    return bound


def _noise(method: OwnError, o: int, name: str) -> Array:
    """Return standard errors (T,) of the mean, or of the logarithm of the standard deviation."""
    if name == "mean":
        return np.asarray(method.noise_mean[o])
    std = method.std[o]
    return np.asarray(np.where(std > 0, method.noise_std[o] / divisor(std), 0.0))


def _freedom(method: OwnError, o: int, name: str) -> Array:
    """Return the degrees of freedom of a standard error (T,): 2 n / (k - 1) for n contributions of kurtosis k.

    Standard errors of few samples with long tails are often far too small. The kurtosis of a standard deviation is
    taken as at least 15, the kurtosis of squares of normal deviations.
    """
    least = 3.0 if name == "mean" else 15.0
    if method.freedom < method.samples - 1:  # estimates of replicates are averages of many samples
        return np.full(method.mean.shape[1], method.freedom)
    if method.response is None:
        return np.full(method.mean.shape[1], method.freedom if name == "mean" else max(method.freedom / 7.0, 1.0))
    off = _offsets(method.response[:, o], name)
    squares = off * off
    square = squares.mean(axis=0)
    kurtosis = np.where(square > 0, (squares * squares).mean(axis=0) / divisor(square) ** 2, least)
    return np.maximum(2.0 * method.samples / (np.maximum(kurtosis, least) - 1.0), 1.0)


def _offsets(response: Array, name: str) -> Array:
    """Return the contribution of each sample to the mean or the variance (S, T), minus its average."""
    spread = np.ptp(response, axis=0)
    off = (response - response.mean(axis=0)) / divisor(spread)
    return np.asarray(off if name == "mean" else off**2 - (off**2).mean(axis=0))


def _parts(method: OwnError, o: int, name: str) -> Array:
    """Return the contribution of each sample to the deviation (S, T), scaled to the standard errors."""
    assert method.response is not None
    off = _offsets(method.response[:, o], name)
    size = np.sqrt(np.square(off).sum(axis=0))
    return np.asarray(off / divisor(size) * _noise(method, o, name))


def _rare(found: OwnError, base: OwnError, o: int, level: float) -> tuple[NDArray[np.bool_], tuple[int, str] | None]:
    """Return the times (T,) at which samples may have missed a rare event, and the method with these samples.

    At these times the samples do not vary, but the other method does. An event of probability p causes a kurtosis of at
    least about 1 / p. The probability that n samples do not contain the event is (1 - p)^n. The second value contains
    the index of the method with these samples, 0 or, for the reference, 1, and a text on the samples. It is None if
    there are no such times.
    """
    times, text = np.zeros(found.std.shape[1], dtype=bool), None
    for which, (method, other) in enumerate(((found, base), (base, found))):
        if not method.drawn:
            continue
        chance = 1.0 / np.maximum(other.kurtosis[o], 1.0 + 1e-9)
        missed = (method.std[o] == 0) & (other.std[o] > 0) & (method.samples * np.log1p(-chance) > np.log(level))
        if missed.any():
            times |= missed
            text = which, f"{method.samples}, which may contain none of the rare events that cause the variation"
    return times, text


def _mean_deviation(
    found: OwnError, base: OwnError, o: int, bound: Array, slack: Array, unseen: NDArray[np.bool_]
) -> _Deviation:
    difference = np.abs(found.mean[o] - base.mean[o])
    noise = np.hypot(found.noise_mean[o], base.noise_mean[o])
    excess = np.where(unseen, 0.0, np.maximum(difference - slack, 0.0))
    return _deviation(excess, bound * noise, difference)


def _std_deviation(
    found: OwnError, base: OwnError, o: int, bound: Array, slack: Array, unseen: NDArray[np.bool_]
) -> _Deviation:
    """Test the logarithm of the ratio of standard deviations, which is closer to normal than their difference."""
    one, other = found.std[o], base.std[o]
    difference = np.abs(one - other)
    nearer = np.where(one > other, np.maximum(one - slack, other), np.minimum(one + slack, other))
    usable = (nearer > 0) & (other > 0)
    ratio = np.abs(np.log(np.where(usable, nearer, 1.0) / np.where(usable, other, 1.0)))
    ratio = np.where(unseen, 0.0, np.where(usable | (nearer == other), ratio, np.inf))
    noise = np.hypot(_noise(found, o, "std"), _noise(base, o, "std"))
    return _deviation(ratio, bound * noise, difference)


def _deviation(excess: Array, allowed: Array, difference: Array) -> _Deviation:
    beyond = excess > allowed
    if not beyond.any():
        return _Deviation(False, int(difference.argmax()))
    return _Deviation(True, int(np.where(beyond, difference, -1.0).argmax()))


def _widths(found: OwnError, base: OwnError, o: int, bound: Array, floor: float) -> Array:
    """Return the largest undetected differences of the standard deviation (T,)."""
    noise = np.hypot(found.noise_std[o], base.noise_std[o])
    return np.asarray(bound * noise + found.bias[o] + base.bias[o] + floor)


def _few(found: OwnError, base: OwnError, o: int, times: Array) -> tuple[int, str] | None:
    """Return 0 if the method has too few samples, 1 if the reference does, with a text; None if both have enough."""
    for which, method in enumerate((found, base)):
        if not method.drawn:
            continue
        if method.samples < ENOUGH_SAMPLES:
            return which, f"{method.samples}"
        scale = float(root_mean_square(method.std[o : o + 1], times)[0])
        error = _ratio(1.96 * float(root_mean_square(method.noise_std[o : o + 1], times)[0]), scale)
        if error > ROUGH:
            return which, f"{method.samples}, which give the standard deviation to within {format_percent(error)}"
    return None


def _differences(
    found: OwnError, base: OwnError, o: int, times: Array, units: str, tests: tuple[_Deviation, ...]
) -> list[str]:
    """Return texts on the differences and their sizes."""
    sentences = []
    for name, test in zip(("mean", "std"), tests, strict=False):
        if not test.significant:
            continue
        k = test.worst
        when = f" at t = {times[k]:.4g} s" if len(times) > 1 else ""
        if name == "mean":
            shift = float(found.mean[o, k] - base.mean[o, k])
            part = _ratio(abs(shift), float(base.std[o].max()) if base.varies[o] else 0.0)
            of_std = f" ({format_percent(part)} of the largest standard deviation)" if part else ""
            sentences.append(f"mean shifted by {format_quantity(float(f'{shift:.3g}'), units)}{of_std}{when}")
            continue
        whole = [float(root_mean_square(m.std[o : o + 1], times)[0]) for m in (found, base)]
        spread = bool(base.varies[o])
        overall = whole[0] / whole[1] - 1.0 if spread and whole[1] > 0 else np.inf
        local = float(found.std[o, k] / base.std[o, k] - 1.0) if spread and base.std[o, k] > 0 else np.inf
        if overall * local > 0 and abs(overall) > 0.3 * abs(local):
            sentences.append(f"standard deviation too {_size(overall)}")
        else:
            sentences.append(f"standard deviation too {_size(local)}{when}")
    return sentences


def _size(relative: float) -> str:
    word = "small" if relative < 0 else "large"
    return (
        f"{word} by {format_percent(abs(relative))}"
        if np.isfinite(relative)
        else "large: the standard deviation of the reference is zero"
    )
