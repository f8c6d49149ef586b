"""Probabilities of violation from a surrogate of margins, with intervals that include the error of the surrogate.

A million samples of an inaccurate surrogate give a wrong probability with a small sampling error. Verification
realisations, which did not enter the surrogate, measure its error. The residuals of these realisations give a band
about the limit of a margin; samples within the band may be violations or not.

The error of polynomials grows with the distance of the margin from its median, and limits are usually far from the
median. The growth function is the mean of :math:`He_i(u)^2 / i!` up to one above the degree of the surrogate, at most
`HIGHEST`. Here :math:`u` is the normal score of the margin in its own distribution. The mean square of an error that
consists of all polynomials up to this degree is proportional to this function. The half-width of the band is a product
of three factors: the root mean square of the residuals, each divided by the root of the growth function; a quantile of
Student's t distribution, whose degrees of freedom are the effective number of residuals; and the root of the growth
function. Residuals have the weights of the realisations or equal weights; the wider band is used.

If the surrogate does not follow a margin at all, residuals contain no information. Such a margin jumps, or changes only
between the realisations. A surrogate does not follow a margin if residuals exceed `FOLLOWED` times the standard
deviation of the samples, or if samples do not vary. The interval is then widened by the probability that mechanism and
surrogate are on different sides of the limit. This probability is estimated from the verification realisations; Clopper
and Pearson's method gives its interval, with the effective number of trials of the weights.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from uqmbd.results.chaos import Surrogate, spread_germs
from uqmbd.results.requirements.counting import events, failures_in
from uqmbd.results.requirements.dataset import requirements_dataset
from uqmbd.results.requirements.intervals import clopper_pearson
from uqmbd.typing import Array

if TYPE_CHECKING:
    from uqmbd.mechanism import Requirement

__all__ = ["margin_bands", "margins_of", "sampled_requirements", "signs_allow"]

SAMPLES = 1 << 17
"""Number of samples of the surrogate for probabilities of the whole motion."""

FEWER = 1 << 14
"""Number of samples for probabilities over time."""

MOST_TIMES = 33
"""Maximum number of times at which an interval is computed; other times have bounds from their neighbours."""

ROWS = 4096
"""Number of samples that are evaluated at once."""

BAND_PROBABILITY = 0.995
"""One-sided probability of the quantile of Student's t distribution for the band from residuals."""

FOLLOWED = 0.3
"""Error, relative to the spread of a margin, up to which a surrogate follows the margin."""

CONSTANT = 1e-9
"""Spread of a margin, relative to its size, up to which the margin is constant."""

HIGHEST = 8
"""Highest degree of the growth function."""


def sampled_requirements(
    requirements: Sequence[Requirement],
    late: NDArray[np.bool_],
    at: Callable[[int], Surrogate],
    over_time: Surrogate,
    lost: float = 0.0,
    seed: int = 0,
) -> xr.Dataset:
    """Build the dataset ``requirements`` of a propagator's node from a surrogate of margins.

    `late` (requirement,): whether margins are known only at the end; `at`, `over_time`: surrogates of the running
    margins at the output time of an index, and at all output times; `lost`: share of failed realisations; `seed`: seed
    of the samples. The variable ``uncertain (requirement)`` is the share of samples whose margin the error of the
    surrogate can move across the limit. Attributes of the dataset are ``samples``, ``verification`` (number of
    realisations) and ``failed`` (share). Without verification realisations, every interval is from 0 to 1.
    """
    at_end = at(-1)
    margins = _sampled(at_end, SAMPLES, seed)
    verified = at_end.verification_germs is not None and at_end.verification_response is not None
    whole = _sampled_probability(at_end, margins, lost, verified)
    probability, lower, upper, count = whole.probability, whole.lower, whole.upper, len(margins)
    inaccurate = [r.name for r, f in zip(requirements, whole.followed, strict=False) if not f]
    times = over_time.labels.times
    by_time = _over_time(over_time, late, probability, seed)
    intervals = None if times is None else _intervals_over_time(at, late, by_time, whole, lost, seed)
    verification = 0 if at_end.verification_germs is None else len(at_end.verification_germs)
    about: dict[str, Any] = {"samples": count, "verification": verification, "failed": float(lost)}
    about["how"] = f"{count} samples of the surrogate" + (
        f", whose error is estimated at {verification} verification realisations"
        if verified
        else "; without verification realisations its error is unknown: use verify=16 or more"
    )
    if inaccurate:
        names = ", ".join(inaccurate)
        about["how"] += f"; for {names} the surrogate is inaccurate, and only the signs of its margins are reliable"
    near = (
        ("requirement",),
        whole.uncertain,
        {"long_name": "share of samples whose margin the error can move across the limit"},
    )
    return requirements_dataset(
        requirements,
        violation_probability=probability,
        std_error=np.sqrt(probability * (1 - probability) / count),
        lower=lower,
        upper=upper,
        times=times,
        violated_by=by_time if times is not None else None,
        violated_by_interval=intervals,
        variables={"uncertain": near},
        attrs=about,
    )


@dataclass(frozen=True)
class _SampledProbability:
    """Probabilities (event,) of violation from samples of a surrogate, and their intervals."""

    probability: Array
    lower: Array
    upper: Array
    uncertain: Array  # share of samples whose margin the error can move across the limit
    followed: NDArray[np.bool_]  # whether the surrogate follows the margin


def _sampled_probability(
    chaos: Surrogate, margins: Array, lost: float, verified: bool, late: NDArray[np.bool_] | None = None
) -> _SampledProbability:
    """Return probabilities and intervals from samples (K, requirement) of the margins of a surrogate at one time.

    `late` (requirement,): margins that are not known at this time, so that they are not violated.
    """
    count = len(margins)
    bands = margin_bands(chaos, margins) if verified else np.full_like(margins, np.inf)
    unknown = np.zeros(margins.shape[1], dtype=bool) if late is None else late
    happened, least, most = (
        events(np.where(unknown, np.inf, margins + shift)[:, :, None])[:, :, 0].sum(axis=0)
        for shift in (0.0, bands, -bands)
    )
    probability, size = happened / count, len(happened)
    near = (most - least) / count
    if not verified:
        return _SampledProbability(probability, np.zeros(size), np.ones(size), near, np.ones(size, dtype=bool))
    lower, upper = clopper_pearson(least, count)[0], clopper_pearson(most, count)[1]
    down, up, followed = signs_allow(chaos, margins)
    lower = np.where(followed, lower, np.minimum(lower, np.maximum(probability - down, 0)))
    upper = np.where(followed, upper, np.maximum(upper, np.minimum(probability + up, 1)))
    lower, upper = failures_in(lower, upper, lost)
    lower, upper = np.minimum(lower, probability), np.maximum(upper, probability)
    return _SampledProbability(probability, lower, upper, near, followed)


def _intervals_over_time(
    at: Callable[[int], Surrogate],
    late: NDArray[np.bool_],
    by_time: Array,
    whole: _SampledProbability,
    lost: float,
    seed: int,
) -> tuple[Array, Array]:
    """Return intervals (event, T) of the probabilities `by_time` (event, T) of a violation until each time.

    Intervals are computed at `MOST_TIMES` times at most. A violation is permanent, so the probability grows with time.
    Between two of these times, the lower end is that of the time before, and the upper end that of the time after. The
    same bounds apply where the surrogate does not follow the margin, such as at the start, where margins may not vary.
    """
    last = by_time.shape[1] - 1
    chosen = np.unique(np.linspace(0, last, min(last + 1, MOST_TIMES)).round().astype(int))
    lower, upper = np.empty((len(by_time), len(chosen))), np.empty((len(by_time), len(chosen)))
    followed, germs = np.empty(lower.shape, dtype=bool), None
    for k, index in enumerate(chosen[:-1]):
        chaos = at(int(index))
        germs = spread_germs(chaos.space, FEWER, seed) if germs is None else germs
        verified = chaos.verification_germs is not None and chaos.verification_response is not None
        found = _sampled_probability(chaos, margins_of(chaos, germs), lost, verified, late)
        lower[:, k], upper[:, k], followed[:, k] = found.lower, found.upper, found.followed
    known_late = [k for k, unknown in enumerate(late) if unknown]
    # a margin that is known only at the end is not violated before the end
    lower[known_late], upper[known_late] = 0.0, 0.0
    lower[:, -1], upper[:, -1], followed[:, -1] = whole.lower, whole.upper, whole.followed
    up = followed.copy()
    for k in range(1, len(chosen) - 1):
        bounded = ~followed[:, k] & followed[:, k - 1]
        lower[bounded, k], followed[bounded, k] = lower[bounded, k - 1], True
    for k in range(len(chosen) - 2, -1, -1):
        bounded = ~up[:, k] & up[:, k + 1]
        upper[bounded, k], up[bounded, k] = upper[bounded, k + 1], True
    before = np.searchsorted(chosen, np.arange(last + 1), side="right") - 1
    after = np.searchsorted(chosen, np.arange(last + 1))
    low, high = lower[:, before], upper[:, after]
    high[known_late, :-1] = 0.0
    return np.minimum(low, by_time), np.maximum(high, by_time)


def _sampled(chaos: Surrogate, samples: int, seed: int) -> Array:
    """Return samples (K, requirement) of a surrogate of margins at one time."""
    return margins_of(chaos, spread_germs(chaos.space, samples, seed))


def margins_of(chaos: Surrogate, germs: Array) -> Array:
    """Return margins (K, requirement) at germs (K, d) of a surrogate at one time, in blocks of `ROWS` germs."""
    parts = [chaos.evaluate_germs(germs[k : k + ROWS]) for k in range(0, len(germs), ROWS)]
    return np.concatenate(parts).reshape(len(germs), len(chaos.labels.outputs))


def _over_time(chaos: Surrogate, late: NDArray[np.bool_], probability: Array, seed: int) -> Array:
    """Return the probabilities (event, T) of a violation until each time; `probability` is the last one."""
    germs = spread_germs(chaos.space, FEWER, seed)
    counts: Array | float = 0.0
    for k in range(0, len(germs), ROWS):
        margins = chaos.evaluate_germs(germs[k : k + ROWS]).reshape(-1, len(late), chaos.labels.shape[1])
        margins[:, late, :-1] = np.inf
        counts = counts + events(margins).sum(axis=0)
    # a violation is permanent, but separate polynomials at each time may give decreasing shares
    shares = np.minimum(np.maximum.accumulate(np.asarray(counts) / len(germs), axis=1), probability[:, None])
    shares[:, -1] = probability
    return np.asarray(shares)


def _verification_margins(chaos: Surrogate, size: int) -> tuple[Array, Array, Array]:
    """Return margins (K, requirement) of surrogate and mechanism at verification realisations, and weights (K,)."""
    points, real = np.asarray(chaos.verification_germs), np.asarray(chaos.verification_response)
    shape = len(points), size
    return chaos.evaluate_germs(points).reshape(shape), real.reshape(shape), np.asarray(chaos.verification_weights)


def margin_bands(chaos: Surrogate, margins: Array) -> Array:
    """Return half-widths (K, requirement) of the band in which the error may move margins over the limit."""
    from scipy.special import ndtri

    seen, real, weights = _verification_margins(chaos, margins.shape[1])
    degree = min(int(chaos.multi_index.sum(axis=1).max(initial=0)) + 1, HIGHEST)
    if not len(chaos.multi_index):  # the growth of the error is unknown for models other than polynomials
        degree = HIGHEST
    bands = np.empty_like(margins)
    for k in range(margins.shape[1]):
        order = np.argsort(margins[:, k])
        rank = np.searchsorted(margins[order, k], seen[:, k])
        growth = _growth(ndtri((np.arange(len(order) + 1) + 0.5) / (len(order) + 1)), degree)
        square = (real[:, k] - seen[:, k]) ** 2 / growth[rank]
        # weights represent the inputs as in a mean; equal weights represent the tails better
        bound = max(_error_bound(square, w) for w in (weights, np.full(len(real), 1 / len(real))))
        bands[order, k] = bound * np.sqrt(growth[:-1])
    return bands


def signs_allow(chaos: Surrogate, margins: Array) -> tuple[Array, Array, NDArray[np.bool_]]:
    """Bound probabilities by the signs of margins at verification realisations.

    Return, with the shape (event,), the possible decrease and increase of each probability, and whether the surrogate
    follows the margin. If it does, decrease and increase are 0.
    """
    seen, real, weights = _verification_margins(chaos, margins.shape[1])
    square, spread = (real - seen) ** 2, margins.std(axis=0)
    wrong = np.sqrt(np.maximum(weights @ square, square.mean(axis=0)))
    followed = (wrong <= FOLLOWED * spread) & (spread > CONSTANT * np.abs(margins).max(axis=0))
    trials = 1 / float((weights**2).sum())
    down, up = (
        np.where(followed, 0.0, clopper_pearson(trials * (weights @ (a & ~b)), trials)[1])
        for a, b in ((seen < 0, real < 0), (real < 0, seen < 0))
    )
    if margins.shape[1] == 1:
        return down, up, followed
    return np.append(down, down.sum()), np.append(up, up.sum()), np.append(followed, followed.all())


def _error_bound(square: Array, weights: Array) -> float:
    """Return the root mean square of errors times a quantile of Student's t, from squares and weights of sum 1.

    The degrees of freedom are the effective number of realisations, ``1 / sum(weights^2)``, or fewer. Near a jump, a
    few squares may be nearly all of the sum. The root mean square is then as uncertain as a root mean square of these
    few errors. The degrees of freedom are therefore at most three times the effective number of the weighted squares.
    For normal errors with equal weights, this effective number is about a third of the number of realisations, so the
    limit has no effect.
    """
    from scipy.special import stdtrit

    parts = weights * square
    if not (total := float(parts.sum())) > 0:
        return 0.0
    freedom = min(1 / float((weights**2).sum()), 3 * total**2 / float((parts**2).sum()))
    return float(stdtrit(freedom, BAND_PROBABILITY)) * float(np.sqrt(total))


def _growth(scores: Array, degree: int) -> Array:
    """Return the growth function (K,): the mean square of orthonormal Hermite polynomials up to a degree.

    `scores` (K,): normal scores of a margin. The result is at least 1 / (degree + 1).

    >>> _growth(np.array([0.0, 3.0]), 2).round(3).tolist()
    [0.5, 14.0]
    """
    before, now = np.zeros_like(scores), np.ones_like(scores)
    total = now.copy()
    for k in range(degree):
        before, now = now, (scores * now - np.sqrt(k) * before) / np.sqrt(k + 1)
        total += now**2
    return total / (degree + 1)
