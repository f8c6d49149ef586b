"""Probabilities of violations by exploration, search for design points, adaptive proposals, and sampling.

Exploration uses points in all directions, and multilevel splitting by chains that preserve the distribution.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import stats

from uqmbd.typing import Array
from uqmbd_reliability.estimating import ProbabilityEstimate, estimate, with_any
from uqmbd_reliability.importance import Sampled, adapt, sample
from uqmbd_reliability.ledger import LimitState, LimitStateLedger
from uqmbd_reliability.proposals import Proposal, Region, around_points, from_design_point, proposal, round_region
from uqmbd_reliability.searching import DesignPoint, distinct, search, starts

__all__ = ["LEAST", "PILOT", "Analysis", "analyse", "multilevel"]

LEVEL = 0.1
"""Share of a level's points that start the next level."""

MOST_LEVELS = 14


def cloud(dimension: int, count: int, reach: float, generator: np.random.Generator, *, axes: bool = True) -> Array:
    """Return the origin, points on the axes, and `count` points farther from the origin than standard normal points.

    The `count` points have random directions; their distances exceed the distances of standard normal points by 0 to
    `reach`. The points on the axes are at 0.6 times `reach`; with `axes` false they are omitted.
    """
    z = generator.standard_normal((count, dimension))
    distance = np.linalg.norm(z, axis=1, keepdims=True)
    farther = np.linspace(0.0, reach, count)[:, None]
    star = 0.6 * reach * np.eye(dimension)[: dimension if axes else 0]
    return np.concatenate([np.zeros((1, dimension)), star, -star, z * (distance + farther) / distance])


@dataclass(frozen=True, eq=False)
class Levels:
    """Result of multilevel splitting."""

    probability: float
    cov: float  # coefficient of variation of `probability` by Au and Beck, which assumes independent levels
    points: Array  # (K, d), points of the last level; violations if `reached`
    margins: Array  # (K,)
    reached: bool  # whether there are violations


def multilevel(
    ledger: LimitStateLedger,
    column: int,
    points: Array,
    margins: Array,
    generator: np.random.Generator,
    spared: int = 0,
) -> Levels:
    """Return the result of adaptive conditional sampling through levels of one margin, from known points (K, d).

    Each level has K points. Margins (K,) are NaN for failed realisations; `spared` realisations of the ledger remain
    unused. See Au and Beck, Probab. Eng. Mech. 16 (2001) 263; Papaioannou et al., Probab. Eng. Mech. 41 (2015) 89.
    """
    count = len(points)
    points, margins = points[~np.isnan(margins)], margins[~np.isnan(margins)]
    probability, square, chains, step = 1.0, 0.0, np.arange(len(margins)), 0.6
    for _ in range(MOST_LEVELS):
        if not len(margins):
            break
        order = np.argsort(margins, kind="stable")
        kept = max(int(LEVEL * len(margins)), 2)
        threshold = max(float(margins[order[kept - 1]]), 0.0)
        inside = margins < threshold if threshold == 0.0 else margins <= threshold
        share = float(inside.mean())
        probability *= share
        square += _square(inside, chains)
        if threshold == 0.0 or share == 1.0:
            return Levels(probability, square**0.5, points[inside], margins[inside], threshold == 0.0)
        seeds, seeded = points[inside], margins[inside]
        rounds = -(-count // len(seeds)) - 1
        if rounds * len(seeds) > ledger.left - spared:
            break
        states, values = [seeds], [seeded]
        for _ in range(rounds):
            keep = np.sqrt(1.0 - step**2)
            tried = keep * states[-1] + step * generator.standard_normal(seeds.shape)
            found = ledger(tried)[:, column]
            accepted = found <= threshold  # false for a failed realisation
            states.append(np.where(accepted[:, None], tried, states[-1]))
            values.append(np.where(accepted, found, values[-1]))
            step = float(np.clip(step * np.exp(accepted.mean() - 0.44), 0.05, 0.98))
        points, margins = np.concatenate(states), np.concatenate(values)
        chains = np.tile(np.arange(len(seeds)), rounds + 1)
    return Levels(probability, np.inf, points, margins, False)


def _square(inside: np.ndarray, chains: np.ndarray) -> float:
    """Return the squared coefficient of variation of a level's share, from the sums of its chains."""
    share = inside.mean()
    if not 0 < share < 1:
        return 0.0
    sums = np.bincount(chains, inside - share)
    return float((sums**2).sum() / (len(inside) * share) ** 2)


PILOT = 120
"""Number of standard normal points at the start."""

LEAST = 500
"""Least number of realisations; fewer leave no samples for the estimates."""

REACH = 5.0
STARTS = 5


@dataclass(frozen=True, eq=False)
class Analysis:
    """Result of a reliability analysis."""

    # one for each requirement; with several requirements, the last estimate is for the violation of any of them
    estimates: tuple[ProbabilityEstimate, ...]
    design_points: tuple[DesignPoint, ...]  # of all requirements, nearest first
    sampled: Sampled  # the samples of the estimates
    ledger: LimitStateLedger  # all computed realisations
    notes: tuple[str, ...]  # remarks for the results
    dependent: bool = False  # whether samples are dependent, so that they have no standard error
    used: Proposal | None = None  # last proposal; None if no violation was found


def analyse(
    limit: LimitState,
    dimension: int,
    *,
    method: str = "auto",
    target: float = 0.05,
    most: int = 3000,
    generator: np.random.Generator,
) -> Analysis:
    """Estimate the probabilities that margins are below zero, with at most `most` realisations.

    The `method` "form" omits multilevel splitting; "auto" includes splitting, which also finds violations that a search
    misses. `target` is the coefficient of variation at which sampling stops.
    """
    ledger = LimitStateLedger(limit, dimension, most)
    pilot = generator.standard_normal((PILOT, dimension))
    margins = ledger(pilot)
    requirements = margins.shape[1]
    axes = 2 * dimension < most / 10
    around = cloud(dimension, min(60, most // 20), REACH, generator, axes=axes)
    begin = ledger.count
    ledger(around)
    origin = ledger.margins[begin]
    notes: list[str] = []
    levels: list[Levels | None] = [None] * requirements
    if method == "auto":
        for k in range(requirements):
            levels[k] = multilevel(
                ledger, k, pilot, margins[:, k], generator, spared=most // 2 if requirements == 1 else 2 * most // 3
            )
    points = _design_points(ledger, origin, requirements)
    regions = _regions(points, levels, ledger)
    used: Proposal | None = None
    if regions:
        used = adapt(ledger, proposal(regions, None, dimension), requirements, generator)
        used, sampled = sample(ledger, used, requirements, target, generator)
    else:
        sampled = _sample_plainly(ledger, generator)
    estimates = _estimates(sampled, used, margins, levels, notes)
    return Analysis(tuple(estimates), tuple(points), sampled, ledger, tuple(notes), used=used)


def _design_points(ledger: LimitStateLedger, origin: Array, requirements: int) -> list[DesignPoint]:
    """Return design points from searches that start where rays through known points seem to reach limits soonest."""
    known, margins = ledger.points, ledger.margins
    affordable = ledger.left / 3 / (requirements * (ledger.dimension + 8))
    most = int(np.clip(affordable, 1, STARTS))
    begin, which = [], []
    for k in range(requirements):
        if np.isfinite(origin[k]) and origin[k] != 0:
            chosen = starts(known, margins[:, k], float(origin[k]), most)
            begin.append(chosen)
            which += [k] * len(chosen)
    if not which:
        return []
    return distinct(search(ledger, np.concatenate(begin), np.array(which), origin))


def _regions(points: list[DesignPoint], levels: list[Levels | None], ledger: LimitStateLedger) -> list[Region]:
    """Return regions of design points and of other violations.

    A requirement with any of these regions also has a round region.
    """
    regions: list[Region] = []
    known, margins = ledger.points, ledger.margins
    dimension = ledger.dimension
    for k, level in enumerate(levels):
        own = [from_design_point(point) for point in points if point.requirement == k]
        violations = known[margins[:, k] < 0]
        if level is not None and level.reached:
            off = np.ones(len(level.points), dtype=bool)
            for region in own:
                square = ((level.points - region.blunt.mean) ** 2).sum(axis=1)
                off &= square > dimension + 2 * np.sqrt(2 * dimension)
            if off.mean() > 0.2 or not own:
                share = float(np.log(max(level.probability * off.mean(), 1e-300)))
                own.append(around_points(level.points[off], k, share))
        elif not own and len(violations):
            nearest = violations[np.argsort((violations**2).sum(axis=1))[:5]]
            own.append(around_points(nearest, k, 0.0))
        if own:
            seen = level.points if level is not None and level.reached else np.array([r.blunt.mean for r in own])
            regions += [*own, round_region(seen, k)]
    return regions


def _sample_plainly(ledger: LimitStateLedger, generator: np.random.Generator) -> Sampled:
    """Sample the standard normal distribution, if no violation is known."""
    first = ledger.count
    points = generator.standard_normal((ledger.left, ledger.dimension))
    return Sampled(points, np.ones(len(points)), ledger(points), first + np.arange(len(points)))


def _estimates(
    sampled: Sampled, used: Proposal | None, pilot: Array, levels: list[Levels | None], notes: list[str]
) -> list[ProbabilityEstimate]:
    margins, failures = with_any(sampled.margins), sampled.failures
    # samples of the standard normal part of the mixture have the same distribution as the pilot
    share = 1.0 if used is None else float(used.mixture.weights[0])
    standard = int(len(pilot) + share * len(sampled.points))
    count = (len(pilot), int(np.isnan(pilot[:, 0]).sum()))
    found = []
    for k in range(margins.shape[1]):
        one = estimate(np.where(margins[:, k] < 0, sampled.ratio, 0.0), failures, standard, count)
        level = levels[k] if k < len(levels) else None
        if level is not None and level.reached:
            one = _checked(one, level, k, notes)
        found.append(one)
    if margins.shape[1] > len(levels):
        # the probability of any violation is at least that of each requirement
        last = found[-1]
        upper = min(max(last.upper, max(one.upper for one in found[:-1])), 1.0)
        found[-1] = ProbabilityEstimate(last.probability, last.error, last.lower, upper)
    return found


def _checked(one: ProbabilityEstimate, level: Levels, column: int, notes: list[str]) -> ProbabilityEstimate:
    """Widen an interval that contradicts the splitting, because the proposal may miss violations."""
    spread = float(np.exp(stats.norm.ppf(0.995) * np.sqrt(np.log1p((1.3 * level.cov) ** 2))))
    if level.probability / spread <= one.upper:
        return one
    notes.append(
        f"importance sampling gives {one.probability:.3g} for requirement no. {column + 1}, and splitting gives "
        f"{level.probability:.3g}: importance sampling misses some violations, so the interval includes both values"
    )
    return ProbabilityEstimate(one.probability, one.error, one.lower, min(level.probability * spread, 1.0))
