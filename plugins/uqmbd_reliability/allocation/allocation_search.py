"""Search for tolerances that reach a probability at the least cost, by surrogates and verification.

The verified probability combines the count of a surrogate with the realisations that the surrogate classifies wrongly.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy import stats

import uqmbd
from uqmbd.extend import typechecked
from uqmbd.typing import Array, Mask
from uqmbd_reliability.allocation.optimising import MarginSamples, Tightest, cheapest
from uqmbd_reliability.allocation.result import Allocation
from uqmbd_reliability.allocation.surrogates import MarginSurrogate, fitted
from uqmbd_reliability.allocation.tightening import Cost, Tightened, tightened

if TYPE_CHECKING:
    from concurrent.futures import Executor

    import xarray as xr

__all__ = ["allocate", "verified"]

CONFIDENCE = 0.95


@dataclass(frozen=True)
class Verified:
    """Probability from realisations of the mechanism, with its 95 % interval."""

    probability: float
    std_error: float
    lower: float
    upper: float
    wrong: int  # number of realisations that the surrogate classifies wrongly
    failures: int  # number of failed realisations


def verified(counted: float, samples: int, predicted: Mask, real: Array) -> Verified:
    """Correct the share `counted` of violations among samples of a surrogate by independent realisations.

    P = P_surrogate + P(violation, not predicted) - P(predicted, no violation). The first term is known from many
    samples and the others are small, so far fewer realisations are needed than for a count. The interval combines
    intervals of Clopper and Pearson, so that it is valid for few realisations, too. `predicted` (K,): violations by the
    surrogate at the realisations; `real` (K,): their smallest margins, NaN for failed realisations. A failed
    realisation counts as safe in the lower bound and as a violation in the upper one.
    """
    count = len(real)
    failed = np.isnan(real)
    violated = real < 0  # false for NaN
    missed, false = int((violated & ~predicted).sum()), int((predicted & ~violated & ~failed).sum())
    # a failure with a predicted violation is a wrong prediction only in the lower bound, other failures only in the
    # upper
    doubtful, lost = int((failed & ~predicted).sum()), int((failed & predicted).sum())
    share = (missed - false) / max(count - int(failed.sum()), 1)
    own = counted * (1 - counted) / samples
    spread = ((missed + false) / count - share**2) / count + own
    around = 1.96 * np.sqrt(own)
    most, least = _interval(missed + doubtful, count)[1], _interval(missed, count)[0]
    fewest, largest = _interval(false, count)[0], _interval(false + lost, count)[1]
    return Verified(
        float(np.clip(counted + share, 0, 1)),
        float(np.sqrt(max(spread, 0.0))),
        float(np.clip(counted + least - largest - around, 0, 1)),
        float(np.clip(counted + most - fewest + around, 0, 1)),
        missed + false,
        int(failed.sum()),
    )


def _interval(hits: int, count: int) -> tuple[float, float]:
    """Return the interval of Clopper and Pearson for a share.

    Two such intervals both contain their shares with at least the probability `CONFIDENCE`.
    """
    tail = (1 - CONFIDENCE) / 4
    lower = stats.beta.ppf(tail, hits, count - hits + 1) if hits else 0.0
    upper = stats.beta.ppf(1 - tail, hits + 1, count - hits) if hits < count else 1.0
    return float(lower), float(upper)


SMALLEST = 1e-5
"""Probability below which the samples of a surrogate are too few."""

COUNTED = 4000
"""Required number of violations among the samples of a surrogate, if the limit of samples allows it."""

FEWEST, LARGEST = 2**16, 2**20
"""Least and largest number of samples of a surrogate."""

FIRST = 6
"""Number of realisations for the first surrogate, for each term of a polynomial of order two."""

ROUNDS = 5
"""Largest number of surrogates; each is fitted also to the realisations of earlier verifications."""

CLOSE = 0.03
"""Relative distance of the verified probability from the target at which the search stops."""


class _Named(uqmbd.extend.Propagator):
    """Name of the realisations of an allocation in messages and progress."""

    name = "allocation"

    def propagate(self, problem: uqmbd.extend.Problem) -> xr.DataTree:
        """Raise an error, because an allocation has no node."""
        raise uqmbd.StudyError("An allocation is computed by uqmbd_reliability.allocate.")


@typechecked(values=False)
def allocate(
    study: uqmbd.Study,
    requirement: str | None,
    probability: float,
    cost: Cost | None = None,
    *,
    verify: int = 4000,
    narrowest: float = 0.05,
    loosest: float = 1.0,
    seed: int = 0,
    workers: int | Executor = 1,
    progress: uqmbd.extend.Progress | bool | None = None,
) -> Allocation:
    """Return the tolerances with the least cost for which a requirement is violated with a given probability.

    The tolerance of each changeable input is multiplied by a factor of at most `loosest`; by default tolerances are
    only tightened. A polynomial surrogate of the margins proposes the factors with the least cost. Independent
    realisations of the mechanism with these tolerances verify the proposal. The next surrogate is also fitted to these
    realisations, until their probability equals the target.

    Parameters
    ----------
    study : uqmbd.Study
        Study of a mechanism with requirements. The propagators of the study are not used.
    requirement : str or None
        Name of the requirement. None: no requirement may be violated.
    probability : float
        Allowed probability of violation, from 1e-5 to 0.5.
    cost : mapping, optional
        Cost of each changeable tolerance, by the name of the input: a number ``c`` for ``c / t``, with the half-width t
        of the tolerance in the units of the input, or a decreasing function of t. The tolerance of an input without a
        stated tolerance is three standard deviations. Default: every input from `uqmbd.tolerance` or `uqmbd.iso286` is
        changeable, with the inverse of its factor as cost.
    verify : int
        Number of realisations that verify each of at most five surrogates.
    narrowest, loosest : float
        Smallest and largest factor. The largest is from 1 (tolerances are not loosened) to 10. A factor preserves the
        shape of the distribution: its standard deviation and its bounds change with the tolerance.
    seed : int
        Seed of the random numbers.
    workers : int or concurrent.futures.Executor
        Number of workers, or the executor that computes the realisations. Results do not depend on it.
    progress : Progress or bool, optional
        Display of the progress, as for `Study.run`.

    Returns
    -------
    Allocation
        Tolerances, cost, and the probability of the realisations with its interval. `print` shows the allocation as a
        table.

    Raises
    ------
    uqmbd.StudyError
        If an argument cannot be used, or no tightening reaches the probability.

    Notes
    -----
    The derivative of the probability is from a smooth estimate over the samples of the surrogate; SciPy's SLSQP finds
    the minimum. The first surrogate is fitted to inputs with the loosest tolerances, so that it needs no extrapolation.

    Examples
    --------
    >>> import uqmbd
    >>> from uqmbd_reliability import allocate
    >>> mechanism = uqmbd.Mechanism("stack", uqmbd.Planar())
    >>> mechanism.body("part", mass=1, inertia=1) and None
    >>> box, a, b = (
    ...     uqmbd.RandomVariable(name, uqmbd.tolerance(size, t, t, cpk=1), units="mm")
    ...     for name, size, t in (("box", 40.1, 0.1), ("a", 25, 0.1), ("b", 15, 0.1))
    ... )
    >>> mechanism.require("gap", box - a - b >= 0, description="the parts go into the box")
    >>> found = allocate(uqmbd.Study("stack", mechanism), "gap", 0.01, cost={"box": 1, "a": 1, "b": 1})
    >>> [abs(float(t) - 0.0745) < 0.002 for t in found.after]  # the same for all: 0.3 / (2.326 sqrt(3))
    [True, True, True]
    """
    where = "allocate"
    _check(where, study, probability, verify, narrowest, loosest, seed)
    with uqmbd.extend.pool(workers) as executor:
        problem = study.problem(_Named(label="allocation"), executor, progress)
        rows, names = _chosen(where, problem, requirement)
        inputs = tightened(where, problem, cost, loosest)
        return _allocated(where, problem, rows, names, probability, inputs, verify, narrowest, loosest, seed)


def _allocated(
    where: str,
    problem: uqmbd.extend.Problem,
    rows: list[int],
    names: tuple[str, ...],
    probability: float,
    present: Tightened,
    verify: int,
    narrowest: float,
    loosest: float,
    seed: int,
) -> Allocation:
    space = problem.germ_space()
    # draw all inputs with the loosest tolerances; factors refer to these instead of the present ones
    inputs = replace(present, widths=loosest * present.widths)
    least = narrowest / loosest
    realisations = _RealRealisations(problem, rows, present, loosest)
    dimension = len(problem.inputs)
    terms = (dimension + 1) * (dimension + 2) // 2
    first = problem.inputs.from_uniform(_uniform(FIRST * terms, dimension, seed))
    realisations(first)
    count = int(min(LARGEST, max(FEWEST, COUNTED / probability)))
    count = 2 ** int(np.ceil(np.log2(count)))
    germs = space.from_uniform(_uniform(count, dimension, seed + 1))
    generator = np.random.default_rng([seed, 2])
    target = probability
    before: float | None = None
    best: tuple[Tightest, Verified, MarginSurrogate] | None = None
    for turn in range(ROUNDS):
        surrogate = realisations.surrogate(where, space)
        found = cheapest(surrogate, inputs, germs, target, least)
        if before is None:
            before = MarginSamples(germs, inputs, surrogate).probability(np.full(len(inputs.names), 1 / loosest))
        fresh = inputs.values(problem.inputs.from_uniform(generator.random((verify, dimension))), found.factors)
        predicted: Mask = surrogate.margins(space.to_germs(fresh)).min(axis=1) < 0
        checked = verified(found.probability, count, predicted, realisations(fresh))
        best = (found, checked, surrogate)
        off = checked.probability - probability
        loose, tight = bool((found.factors >= 1).all()), bool((found.factors <= least).all())
        if tight and checked.lower > probability:
            raise uqmbd.StudyError(
                f"{where}: tightening cannot reduce the probability to {probability:g}. With all tolerances at "
                f"{narrowest:g} times their present width, the probability is still {checked.probability:.3g}. Change "
                "the nominal values, tighten other inputs as well, or increase the allowed probability."
            )
        if abs(off) <= max(CLOSE * probability, checked.std_error / 2) or (loose and off < 0):
            break
        if turn and checked.probability > 0 and not tight:  # compensate errors that remain with more realisations
            target = float(np.clip(target * probability / checked.probability, target / 3, min(3 * target, 0.5)))
    assert best is not None and before is not None
    return _result(names, probability, present, loosest, before, realisations, *best)


class _RealRealisations:
    """Realisations of the mechanism, with storage of all results."""

    def __init__(self, problem: uqmbd.extend.Problem, rows: list[int], inputs: Tightened, loosest: float) -> None:
        self.problem, self.rows, self.inputs = problem, rows, inputs
        self.factors = np.full(len(inputs.names), loosest)
        self.values: list[Array] = []
        self.margins: list[Array] = []

    def __call__(self, values: Array) -> Array:
        """Return smallest margins (K,) at inputs (K, d) with the loosest tolerances; NaN for failed realisations."""
        found = self.problem.margins(self.inputs.values(values, self.factors))
        margins = np.where(found.failed[:, None], np.nan, found.values[:, self.rows])
        self.values.append(values)
        self.margins.append(margins)
        return np.asarray(margins.min(axis=1))

    @property
    def count(self) -> int:
        """Number of realisations."""
        return sum(map(len, self.values))

    @property
    def failures(self) -> int:
        """Number of failed realisations."""
        return sum(int(np.isnan(m[:, 0]).sum()) for m in self.margins)

    def surrogate(self, where: str, space: uqmbd.extend.GermSpace) -> MarginSurrogate:
        """Return a surrogate fitted to the successful realisations."""
        values, margins = np.concatenate(self.values), np.concatenate(self.margins)
        known = ~np.isnan(margins[:, 0])
        if 2 * known.sum() < len(known):
            raise uqmbd.StudyError(
                f"{where}: {len(known) - int(known.sum())} of {len(known)} realisations failed; examine one of them "
                "with uqmbd.simulate."
            )
        return fitted(space, values[known], margins[known])


def _result(
    names: tuple[str, ...],
    allowed: float,
    inputs: Tightened,
    loosest: float,
    before: float,
    realisations: _RealRealisations,
    found: Tightest,
    checked: Verified,
    surrogate: MarginSurrogate,
) -> Allocation:
    notes = []
    if checked.lower > allowed:
        notes.append(
            f"The probability exceeds {allowed:g}, because the surrogate of the margins is not accurate enough for a "
            "smaller probability."
        )
    factors = loosest * found.factors
    if (found.factors >= 1).all():
        notes.append(
            f"All tolerances can be widened to {loosest:g} times their present width."
            if loosest > 1
            else "No tolerance has to be tightened."
        )
    elif checked.upper > 2 * allowed:
        notes.append("The confidence interval is wide; increase verify= to narrow it.")
    ones = np.ones(len(inputs.names))
    return Allocation(
        names,
        allowed,
        inputs.names,
        inputs.units,
        inputs.sources,
        inputs.widths,
        factors * inputs.widths,
        found.slope,
        inputs.cost(ones),
        inputs.cost(factors),
        found.alike,
        before,
        checked.probability,
        checked.std_error,
        checked.lower,
        checked.upper,
        realisations.count,
        realisations.failures,
        float(surrogate.error.max()),
        tuple(notes),
    )


def _uniform(count: int, dimension: int, seed: int) -> Array:
    """Return points of a Sobol' sequence, shape (count, dimension)."""
    return np.asarray(uqmbd.extend.sampling_design("sobol").points(dimension, count, seed))


def _chosen(where: str, problem: uqmbd.extend.Problem, requirement: str | None) -> tuple[list[int], tuple[str, ...]]:
    known = [r.name for r in problem.requirements]
    if not known:
        raise uqmbd.StudyError(
            f"{where}: mechanism {problem.mechanism!r} has no requirements; add one with "
            "mechanism.require(name, relation)."
        )
    if requirement is None:
        return list(range(len(known))), tuple(known)
    if not isinstance(requirement, str) or requirement not in known:
        raise uqmbd.StudyError(
            f"{where}: the requirement is {requirement!r}; expected one of {', '.join(known)}, or None for the "
            "violation of any of them."
        )
    return [known.index(requirement)], (requirement,)


def _check(where: str, study: Any, probability: Any, verify: Any, narrowest: Any, loosest: Any, seed: Any) -> None:
    if not isinstance(study, uqmbd.Study):
        raise uqmbd.StudyError(f"{where}: the study is {study!r}; expected a uqmbd.Study.")
    numbers = (
        ("probability", probability, SMALLEST, 0.5),
        ("narrowest", narrowest, 1e-3, 1.0),
        ("loosest", loosest, 1.0, 10.0),
    )
    for name, value, low, high in numbers:
        number = isinstance(value, (int, float, np.number)) and not isinstance(value, bool)
        if not number or not low <= value <= high:
            raise uqmbd.StudyError(f"{where}: {name} is {value!r}; expected a number from {low:g} to {high:g}.")
    for name, value, least in (("verify", verify, 100), ("seed", seed, 0)):
        whole = isinstance(value, (int, np.integer)) and not isinstance(value, bool)
        if not whole or int(value) < least:
            raise uqmbd.StudyError(f"{where}: {name} is {value!r}; expected a whole number of at least {least}.")
        if name == "verify" and int(value) > 10**9:
            raise uqmbd.StudyError(f"{where}: verify is more than 1e9; expected a whole number up to 1e9.")
