"""Choose the size of one method: completed sizes, their errors and costs, and the next size."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from uqmbd.propagation.methods import Propagator, Sizing

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["RemainingBudget", "Sized", "Stage"]

MARGIN = 1.1
"""Ratio of the next sample size to the size at which the extrapolated stated error equals the accuracy."""

HEAVY = 1.8
"""Replacement of `MARGIN` if the largest error, without the allowance for few samples, is that of a standard deviation.

This error is computed from the kurtosis, which most samples of a heavy-tailed distribution underestimate.
"""

LEAP = 16
"""Growth of the size above which an intermediate size, the geometric mean, runs first.

An intermediate size is used if the error may decrease faster than the inverse root of the number of samples.
Examples are errors of a design, and errors that are widened because there are few samples.
"""

DESIGN_GROWTH = 2, 4
"""Minimum and maximum growth of the size of a design per step.

The error of a design may decrease like 1 / size, and few points in each replicate overestimate it.  The size therefore
grows by the square root of the growth that independent samples would need, within these limits.  It grows by less than
the minimum if independent samples would: further replicates reduce the error like independent samples.
"""

TIGHTENINGS = 2
"""Maximum number of repetitions with smaller tolerances, if a method ends automatically with too large an error."""

TIGHTER = 0.7
"""Ratio of the next stated error to the accuracy, if the stated error is proportional to the tolerance."""

GROWTH = 256
"""Maximum growth of the sample size per step, because few samples do not determine the spread reliably."""

WORTH = 1.1
"""Minimum growth that justifies a run of the next size, if the accuracy does not determine the size."""

RESERVE = 0.85
"""Part of the remaining time that a size may take according to its predicted cost."""

GUESSED = 0.5
"""Part of the remaining time that a size of more than `FEW` times the timed realisations may take."""

FEW = 10

TOGETHER = 1.5
"""Exponent of the number of nodes in the computing time of methods that solve for all nodes together."""

STALLED = 0.5, 0.8
"""Ratio of errors over two steps above which no further step runs: without and with a requested accuracy."""

INTEGRATION = 10.0
"""Ratio of error to integration tolerance below which integration errors dominate, so that no further step runs."""

STEPS = 30
"""Maximum size of a method whose error decreases with steps, such as an order."""

MOST = 10_000_000
"""Maximum number of samples without a budget, because a spread that grows with the samples does not converge."""


@dataclass(frozen=True)
class RemainingBudget:
    """Remaining budget of a method: realisations, and seconds."""

    realisations: float = math.inf
    seconds: float = math.inf


@dataclass(frozen=True)
class Stage:
    """Results and costs of a completed size of a method."""

    size: int
    cost: int  # number of realisations of this size
    fresh: int  # number of realisations of this size that no earlier size had computed
    seconds: float
    computing: float  # part of the seconds for realisations
    accuracy: float  # stated accuracy; infinite if none is stated
    quantity: str  # name of the quantity that determines the accuracy
    kind: str = ""  # kind of the quantity: ``mean``, ``std`` or ``probability``
    usual: float = math.nan
    """Accuracy without the allowance for few samples, proportional to 1 / sqrt(samples); NaN: unknown."""
    usual_kind: str = ""  # kind of the quantity that determines `usual`


@dataclass
class Sized:
    """Method whose size is chosen, with its completed sizes."""

    propagator: Propagator  # method of the study
    sizing: Sizing
    study: Any  # determines the cost of a size
    accuracy: float | None  # requested accuracy
    chunk: Callable[[int], int] = lambda count: 1  # maps a number of realisations to the size of a chunk
    joinable: bool = False  # whether smaller chunks can be joined to larger ones
    held: float = math.inf  # maximum number of stored realisations between sizes
    stages: list[Stage] = field(default_factory=list)  # sizes in the order in which they ran
    node: xr.DataTree | None = None  # results of the chosen size
    taken: Stage | None = None
    problem: str = ""  # reason against a larger size; otherwise empty
    _costs: dict[int, int] = field(default_factory=dict)
    _tightenings: int = 0
    _pending: bool = False  # whether tolerances are smaller than those of the last stage

    @property
    def label(self) -> str:
        """Return the label of the method."""
        return self.propagator.node_name

    @property
    def met(self) -> bool:
        """Return whether the method has reached the accuracy."""
        return self.taken is not None and self.accuracy is not None and self.taken.accuracy <= self.accuracy

    def add(self, stage: Stage, node: xr.DataTree) -> None:
        """Add a completed size, and choose it unless an earlier order stated a smaller error."""
        self.stages.append(stage)
        worse = self.taken is not None and stage.accuracy > self.taken.accuracy
        if not (worse and (self.sizing.falls == "steps" or self._tightenings)):
            self.node, self.taken = node, stage
        self._pending = False
        early = self.sizing.falls == "itself" and 2 * stage.cost <= stage.size  # ended before its limit
        if early and self.accuracy is not None and self.accuracy < stage.accuracy < math.inf:
            tighten = self.sizing.tighten
            if tighten is not None and self._tightenings < TIGHTENINGS:
                self.sizing = tighten(TIGHTER * self.accuracy / stage.accuracy)
                self._tightenings, self._pending = self._tightenings + 1, True

    def cost(self, size: int) -> int:
        """Return the number of realisations of a size; raise `uqmbd.StudyError` if there is no such size."""
        if size not in self._costs:
            found = self.sizing.at(size).estimate(self.study)
            self._costs[size] = size if found is None else found.realisations
        return self._costs[size]

    def needs_pilot(self, *, timed: bool) -> bool:
        """Return whether a pilot must predict the cost; a method that ends automatically needs one only if `timed`."""
        return self.sizing.falls != "itself" or timed

    def expected_size(self) -> float:
        """Return the expected final size; methods that share a budget run in ascending order of this size."""
        if self.sizing.falls == "steps":
            return 0.0
        bound = self.sizing.bound if self.sizing.falls == "itself" and self.accuracy is not None else None
        return self.needed() if bound is None else float(bound)

    def first(self, left: RemainingBudget) -> int:
        """Return the first size."""
        least = self.sizing.least
        if self.needs_pilot(timed=math.isfinite(left.seconds)):
            return least
        bound = math.inf if self.sizing.bound is None or self.accuracy is None else self.sizing.bound
        most = min(left.realisations, bound)
        return self.sizing.largest(most if math.isfinite(most) else self.sizing.bound or least)

    def needed(self) -> float:
        """Return the predicted size for the accuracy; infinity means the largest possible size."""
        if self.accuracy is None or not self.stages:
            return math.inf
        last = self.stages[-1]
        if self._is_accurate():
            return last.size
        if self.sizing.falls == "itself":
            return math.inf if self.sizing.bound is None else self.sizing.bound
        if self.sizing.falls == "steps":
            return self._step()
        if not math.isfinite(last.accuracy):
            return 4.0 * last.size
        if math.isfinite(last.usual):
            margin = HEAVY if self._heavy(last) else MARGIN
            needed = math.ceil(margin * last.size * (last.usual / self.accuracy) ** 2)
            if needed > WORTH * last.size:
                return needed
        return math.ceil(MARGIN * last.size * (last.accuracy / self.accuracy) ** 2)

    def _heavy(self, stage: Stage) -> bool:
        """Return whether a standard deviation of independent samples has the largest error; heavy tails may hide it."""
        return self.sizing.falls == "root" and self.sizing.extends and stage.usual_kind == "std"

    def _is_accurate(self) -> bool:
        """Return whether no larger size is needed."""
        last = self.stages[-1]
        if self.accuracy is None:
            return False
        return last.accuracy <= self.accuracy

    def _step(self) -> float:
        """Return the order at which the error reaches the accuracy, extrapolated from the last orders."""
        one, *others = reversed([s for s in self.stages if 0 < s.accuracy < math.inf][-3:] or [self.stages[-1]])
        rates = [math.log(o.accuracy / one.accuracy) / (one.size - o.size) for o in others if o.accuracy > one.accuracy]
        assert self.accuracy is not None
        if not rates or not math.isfinite(one.accuracy):
            return self.stages[-1].size + 1
        return max(self.stages[-1].size + 1, one.size + math.ceil(math.log(one.accuracy / self.accuracy) / min(rates)))

    def following(self, left: RemainingBudget) -> int | None:
        """Return the next size; None if the method is accurate enough or no further size is affordable."""
        last = self.stages[-1]
        if self.problem or self._is_accurate():
            return None
        if self.sizing.falls == "steps":
            return self._following_step(left)
        if self.sizing.falls == "itself":
            return self._following_bound(left)
        needed = min(self.needed(), GROWTH * last.size)
        if self.accuracy is not None and last.kind in ("mean", "std") and last.usual >= last.accuracy:
            step = math.sqrt(needed * last.size)
            if not self.sizing.extends:
                least, most = (factor * last.size for factor in DESIGN_GROWTH)
                needed = min(needed, max(least, min(step, most)))
            elif needed > LEAP * last.size:
                needed = step
        if math.isinf(left.realisations) and math.isinf(left.seconds):
            needed = min(needed, MOST)
        # round a design down, because it may need fewer points; but rounding must not end the run just above the
        # accuracy
        design = not self.sizing.extends and self.sizing.largest(needed) >= WORTH * last.size
        size = self._affordable(self.sizing.largest(needed) if design else self._upwards(needed), left)
        if size <= last.size:
            self.problem = self._budget_reason(left)
            return None
        if size < needed and size < WORTH * last.size:
            self.problem = self._budget_reason(left)
            return None
        return size

    def finished(self, size: int, done: int) -> int | None:
        """Return the largest size whose realisations an interrupted run of a larger size has finished."""
        if not self.sizing.extends or done <= self.sizing.least:
            return None
        # the smaller last chunk may finish before others, so only whole chunks count
        found = self.sizing.largest(done if done == size else done // self.chunk(size) * self.chunk(size))
        larger = found > (self.stages[-1].size if self.stages else 0)
        return found if larger and self.chunk(found) == self.chunk(size) and self.cost(found) <= done else None

    def _upwards(self, number: float) -> int:
        """Return the smallest size that is not less than a number, or the largest size up to 16 times the number."""
        low, high = math.ceil(number) - 1, math.ceil(16 * number)
        while high - low > 1 and self.sizing.largest(high) >= number:
            middle = (low + high) // 2
            low, high = (low, middle) if self.sizing.largest(middle) >= number else (middle, high)
        return self.sizing.largest(high)

    def _affordable(self, size: int, left: RemainingBudget) -> int:
        """Return the largest affordable size up to a given size; the last size if no larger one is affordable."""
        low, high = self.stages[-1].size, size
        if high <= low or self._fits(high, left):
            return high
        while high - low > 1:
            middle = (low + high) // 2
            tried = self.sizing.largest(middle)
            if tried <= low:
                low = middle
            elif self._fits(tried, left):
                low = middle
            else:
                high = tried
        return self.sizing.largest(low)

    def _fits(self, size: int, left: RemainingBudget) -> bool:
        if self.fresh(size) > left.realisations:
            return False
        share = RESERVE if self.sizing.falls == "steps" or self.fresh(size) <= FEW * self._timed() else GUESSED
        return self.seconds(size) <= share * left.seconds

    def fresh(self, size: int) -> int:
        """Return the number of realisations of a size that are not yet computed."""
        return self.cost(size) - self.reusable(size)

    def reusable(self, size: int) -> int:
        """Return the number of realisations of the last size that fill whole chunks of another size."""
        if not self.sizing.extends or not self.stages:
            return 0
        last, chunk = min(self.stages[-1].size, self.held), self.chunk(size)
        whole = self.chunk(self.stages[-1].size)
        if chunk != whole and not (self.joinable and chunk > whole):
            return 0
        return int(min(last, size)) // whole * whole // chunk * chunk

    def _timely(self, seconds: float) -> float:
        """Return the number of realisations that the remaining time allows, from their measured cost."""

        def count(share: float) -> float:
            return max(share * seconds - self._overhead(), 0.0) / self._rate()

        # an extrapolation to few more realisations than were timed is more reliable than an extrapolation to many more
        return max(count(GUESSED), min(count(RESERVE), FEW * self._timed()))

    def _timed(self) -> int:
        """Return the largest number of realisations in one call."""
        return max((stage.fresh for stage in self.stages), default=0)

    def _rate(self) -> float:
        """Return the time of a realisation, s, measured in the call with the most realisations."""
        if not self._timed():
            return 1e-12
        one = max(self.stages, key=lambda stage: stage.fresh)
        return max((one.computing or one.seconds) / one.fresh, 1e-12)

    def _overhead(self) -> float:
        """Return the time, s, that a size takes in addition to the time of its realisations."""
        last = self.stages[-1]
        return last.seconds - last.computing if last.computing else 0.0

    def seconds(self, size: int) -> float:
        """Return the predicted time of a size, s, from the times of smaller sizes."""
        last = self.stages[-1]
        found = self.sizing.at(size).estimate(self.study) if self.sizing.falls == "steps" else None
        if found is not None and found.together:
            return float(last.seconds * (self.cost(size) / max(last.cost, 1)) ** TOGETHER)
        return self._overhead() + self._rate() * self.fresh(size)

    def _following_step(self, left: RemainingBudget) -> int | None:
        last = self.stages[-1]
        rtol = float(getattr(self.study, "rtol", 0.0))
        if last.accuracy < INTEGRATION * rtol:
            self.problem = f"the error is about as large as the integration error (rtol={rtol:g})"
            return None
        if len(self.stages) > 2 and last.accuracy > STALLED[self.accuracy is not None] * self.stages[-3].accuracy:
            self.problem = f"the stated error hardly decreases with a higher {self.sizing.option}"
            return None
        size = last.size + 1
        if len(self.stages) > 2 and self.accuracy is not None:
            # use the extrapolated order minus one: a further step costs less than an order that is too high
            size = max(size, min(int(min(self.needed(), STEPS)) - 1, 2 * last.size))
        while size > last.size + 1 and not self._fits(size, left):
            size -= 1
        if size > STEPS:
            self.problem = f"{self.sizing.option}={last.size} is the highest allowed value"
            return None
        if not self._fits(size, left):
            self.problem = self._budget_reason(left, size)
            return None
        return size

    def _following_bound(self, left: RemainingBudget) -> int | None:
        last = self.stages[-1]
        needed = self.needed()
        room = min(left.realisations, self._timely(left.seconds))
        if self._pending and last.cost < room:
            return self.sizing.largest(min(max(float(last.size), needed), room))
        if last.cost < last.size:
            ended = f"the method ended with {last.cost} realisations"
            more = ", and the remaining budget does not allow a smaller tolerance" if self._pending else ""
            self.problem = ended + more
            return None
        size = self.sizing.largest(min(needed, room)) if math.isfinite(min(needed, room)) else last.size
        if size <= last.size * WORTH:
            self.problem = self._budget_reason(left)
            return None
        return size

    def _budget_reason(self, left: RemainingBudget, size: int | None = None) -> str:
        """Return the reason why the budget ends the method, with the cost of the next size."""
        last = self.stages[-1]
        if math.isinf(left.realisations) and math.isinf(left.seconds):
            return f"{self.sizing.option}={last.size} is the largest allowed value"
        if size is None and self.accuracy is not None and math.isfinite(found := self.needed()):
            size = self._upwards(found)
        if size is None:
            return "the budget is used"
        about = "about " if self.sizing.falls == "root" else ""
        return (
            f"{about}{self.sizing.option}={size} needs {self.cost(size)} realisations, more than the remaining budget"
        )
