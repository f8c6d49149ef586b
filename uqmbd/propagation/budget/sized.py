"""One method whose size is chosen: sizes that were run, what they stated and took, and which one comes next."""

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
"""Samples over those at which the stated error, extrapolated, is the accuracy."""

HEAVY = 1.8
"""As `MARGIN`, where the usual error of the standard deviation is the largest: it follows from the kurtosis, which
samples of a heavy tail underestimate more often than not."""

LEAP = 16
"""Growth beyond which an intermediate size, the geometric mean, runs first, where the error may fall faster than the
root of the number of samples: that of a design, or one that is widened because there are few samples."""

GROWTH = 256
"""By how much samples grow at most from one size to the next: a spread that few of them tell is not trusted further."""

WORTH = 1.1
"""By how much the next size has to be larger to be worth a run, where the accuracy is not what decides."""

RESERVE = 0.85
"""Part of the time that is left which a size may take by what is known of its cost."""

GUESSED = 0.5
"""The same where it takes more than `FEW` times as many realisations as were timed."""

FEW = 10

TOGETHER = 1.5
"""Power of the number of nodes by which the time grows of methods that solve for all of them together."""

STALLED = 0.5, 0.8
"""Two steps that leave more than this part of the error are the last ones: without an accuracy, and with one."""

INTEGRATION = 10.0
"""An error of so many tolerances of the integration is that of the integration: no step makes it smaller."""

STEPS = 30
"""Size at which a method of steps ends in any case."""

MOST = 10_000_000
"""Samples at which a search without a budget ends: a spread that grows with the samples is never known."""


@dataclass(frozen=True)
class RemainingBudget:
    """What a method may still take: realisations, and seconds."""

    realisations: float = math.inf
    seconds: float = math.inf


@dataclass(frozen=True)
class Stage:
    """A size of a method that was run."""

    size: int
    cost: int  # realisations of this size alone
    fresh: int  # realisations of it that no earlier size had computed
    seconds: float
    computing: float  # of these seconds, those of the realisations
    accuracy: float  # stated accuracy; infinite where none is stated
    quantity: str  # that determines the accuracy
    kind: str = ""  # of the quantity: ``mean``, ``std`` or ``probability``
    usual: float = math.nan
    """Accuracy before it is widened for few samples, so that it falls with the root of their number; NaN: unknown."""
    usual_kind: str = ""  # the statistic that has the usual accuracy


@dataclass
class Sized:
    """A method at several sizes."""

    propagator: Propagator  # as the study has it
    sizing: Sizing
    study: Any  # determines the cost of a size
    accuracy: float | None  # as requested
    chunk: Callable[[int], int] = lambda count: 1  # maps a number of realisations to the size of a chunk
    joins: bool = False  # whether smaller chunks make up larger ones
    held: float = math.inf  # most realisations that are stored between sizes
    stages: list[Stage] = field(default_factory=list)  # in the order in which they were run
    node: xr.DataTree | None = None  # of the chosen size
    taken: Stage | None = None
    problem: str = ""  # reason against a larger size, or empty
    _costs: dict[int, int] = field(default_factory=dict)

    @property
    def label(self) -> str:
        """Of the method."""
        return self.propagator.node_name

    @property
    def met(self) -> bool:
        """Whether the accuracy is reached."""
        return self.taken is not None and self.accuracy is not None and self.taken.accuracy <= self.accuracy

    def add(self, stage: Stage, node: xr.DataTree) -> None:
        """Take a size that was run, unless an order before it stated less."""
        self.stages.append(stage)
        worse = self.taken is not None and stage.accuracy > self.taken.accuracy
        if not (worse and self.sizing.falls == "steps"):
            self.node, self.taken = node, stage

    def cost(self, size: int) -> int:
        """Return the realisations of a size; a `uqmbd.StudyError` says that there is none."""
        if size not in self._costs:
            found = self.sizing.at(size).estimate(self.study)
            self._costs[size] = size if found is None else found.realisations
        return self._costs[size]

    def needs_pilot(self, *, timed: bool) -> bool:
        """Whether a small size predicts the cost of a large one; for methods that end automatically, only the time."""
        return self.sizing.falls != "itself" or timed

    def expected_size(self) -> float:
        """Return the size that the method is expected to need: methods that share a budget run in this order."""
        if self.sizing.falls == "steps":
            return 0.0
        bound = self.sizing.bound if self.sizing.falls == "itself" and self.accuracy is not None else None
        return self.wanted() if bound is None else float(bound)

    def first(self, left: RemainingBudget) -> int:
        """Return the first size."""
        least = self.sizing.least
        if self.needs_pilot(timed=math.isfinite(left.seconds)):
            return least
        bound = math.inf if self.sizing.bound is None or self.accuracy is None else self.sizing.bound
        most = min(left.realisations, bound)
        return self.sizing.largest(most if math.isfinite(most) else self.sizing.bound or least)

    def wanted(self) -> float:
        """Return the size at which the accuracy will be reached, by what is known; infinite: as large as may be."""
        if self.accuracy is None or not self.stages:
            return math.inf
        last = self.stages[-1]
        if self._enough():
            return last.size
        if self.sizing.falls == "itself":
            return math.inf if self.sizing.bound is None else self.sizing.bound
        if self.sizing.falls == "steps":
            return self._step()
        if not math.isfinite(last.accuracy):
            return 4.0 * last.size
        if math.isfinite(last.usual):
            margin = HEAVY if self._heavy(last) else MARGIN
            wanted = math.ceil(margin * last.size * (last.usual / self.accuracy) ** 2)
            if wanted > WORTH * last.size:
                return wanted
        return math.ceil(MARGIN * last.size * (last.accuracy / self.accuracy) ** 2)

    def _heavy(self, stage: Stage) -> bool:
        """Return whether independent samples, whose standard errors come from their moments, have a heavy tail."""
        return self.sizing.falls == "root" and self.sizing.extends and stage.usual_kind == "std"

    def _enough(self) -> bool:
        """Return whether no larger size is wanted."""
        last = self.stages[-1]
        if self.accuracy is None:
            return False
        return last.accuracy <= self.accuracy

    def _step(self) -> float:
        """Return the order at which the error, which falls by a factor with each order, is the accuracy."""
        one, *others = reversed([s for s in self.stages if 0 < s.accuracy < math.inf][-3:] or [self.stages[-1]])
        rates = [math.log(o.accuracy / one.accuracy) / (one.size - o.size) for o in others if o.accuracy > one.accuracy]
        assert self.accuracy is not None
        if not rates or not math.isfinite(one.accuracy):
            return self.stages[-1].size + 1
        return max(self.stages[-1].size + 1, one.size + math.ceil(math.log(one.accuracy / self.accuracy) / min(rates)))

    def following(self, left: RemainingBudget) -> int | None:
        """Return the next size to run, or nothing: it is accurate enough, or there is none that may be run."""
        last = self.stages[-1]
        if self.problem or self._enough():
            return None
        if self.sizing.falls == "steps":
            return self._following_step(left)
        if self.sizing.falls == "itself":
            return self._following_bound(left)
        wanted = min(self.wanted(), GROWTH * last.size)
        if self.accuracy is not None and last.kind in ("mean", "std") and last.usual >= last.accuracy:
            wanted = math.sqrt(wanted * last.size) if wanted > LEAP * last.size else wanted
        if math.isinf(left.realisations) and math.isinf(left.seconds):
            wanted = min(wanted, MOST)
        size = self._affordable(self._upwards(wanted), left)
        if size <= last.size:
            self.problem = self._why(left)
            return None
        if size < wanted and size < WORTH * last.size:
            self.problem = self._why(left)
            return None
        return size

    def finished(self, size: int, done: int) -> int | None:
        """Return the size whose realisations are all there when another one ends early, having finished so many."""
        if not self.sizing.extends or done <= self.sizing.least:
            return None
        # the last chunk is smaller, and may be finished before others: of these, whole ones count
        found = self.sizing.largest(done if done == size else done // self.chunk(size) * self.chunk(size))
        larger = found > (self.stages[-1].size if self.stages else 0)
        return found if larger and self.chunk(found) == self.chunk(size) and self.cost(found) <= done else None

    def _upwards(self, number: float) -> int:
        """Return the smallest size from a number on."""
        size, factor = self.sizing.largest(number), 2
        while size < number and factor <= 16:
            size, factor = self.sizing.largest(factor * number), factor + 1
        return size

    def _affordable(self, size: int, left: RemainingBudget) -> int:
        """Return the largest size up to one that may be run; not more than the last one if there is none."""
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
        """Return the realisations of a size that are not there yet."""
        return self.cost(size) - self.reusable(size)

    def reusable(self, size: int) -> int:
        """Return how many realisations of the last size are whole chunks of another one, too."""
        if not self.sizing.extends or not self.stages:
            return 0
        last, chunk = min(self.stages[-1].size, self.held), self.chunk(size)
        whole = self.chunk(self.stages[-1].size)
        if chunk != whole and not (self.joins and chunk > whole):
            return 0
        return int(min(last, size)) // whole * whole // chunk * chunk

    def _timely(self, seconds: float) -> float:
        """Return how many realisations there is time for, by what is known of their cost."""

        def count(share: float) -> float:
            return max(share * seconds - self._besides(), 0.0) / self._rate()

        # some more than were timed may be trusted further than many more
        return max(count(GUESSED), min(count(RESERVE), FEW * self._timed()))

    def _timed(self) -> int:
        """Return the largest number of realisations that were computed at once."""
        return max((stage.fresh for stage in self.stages), default=0)

    def _rate(self) -> float:
        """Return seconds of a realisation: those of the largest number that was computed at once."""
        if not self._timed():
            return 1e-12
        one = max(self.stages, key=lambda stage: stage.fresh)
        return max((one.computing or one.seconds) / one.fresh, 1e-12)

    def _besides(self) -> float:
        """Return the seconds that a size takes besides its realisations."""
        last = self.stages[-1]
        return last.seconds - last.computing if last.computing else 0.0

    def seconds(self, size: int) -> float:
        """Return what a size will take, by what smaller ones took."""
        last = self.stages[-1]
        found = self.sizing.at(size).estimate(self.study) if self.sizing.falls == "steps" else None
        if found is not None and found.together:
            return float(last.seconds * (self.cost(size) / max(last.cost, 1)) ** TOGETHER)
        return self._besides() + self._rate() * self.fresh(size)

    def _following_step(self, left: RemainingBudget) -> int | None:
        last = self.stages[-1]
        rtol = float(getattr(self.study, "rtol", 0.0))
        if last.accuracy < INTEGRATION * rtol:
            self.problem = f"its error is about that of the integration, rtol {rtol:g}"
            return None
        if len(self.stages) > 2 and last.accuracy > STALLED[self.accuracy is not None] * self.stages[-3].accuracy:
            self.problem = f"its stated error hardly falls with a higher {self.sizing.option}"
            return None
        size = last.size + 1
        if len(self.stages) > 2 and self.accuracy is not None:
            # one less than the extrapolated one: an order more costs less than one too many
            size = max(size, min(int(min(self.wanted(), STEPS)) - 1, 2 * last.size))
        while size > last.size + 1 and not self._fits(size, left):
            size -= 1
        if size > STEPS:
            self.problem = f"{self.sizing.option}={last.size} is the highest that is tried"
            return None
        if not self._fits(size, left):
            self.problem = self._why(left, size)
            return None
        return size

    def _following_bound(self, left: RemainingBudget) -> int | None:
        last = self.stages[-1]
        if last.cost < last.size:
            self.problem = f"it ends by itself, with {last.cost} realisations"
            return None
        wanted = self.wanted()
        room = min(left.realisations, self._timely(left.seconds))
        size = self.sizing.largest(min(wanted, room)) if math.isfinite(min(wanted, room)) else last.size
        if size <= last.size * WORTH:
            self.problem = self._why(left)
            return None
        return size

    def _why(self, left: RemainingBudget, size: int | None = None) -> str:
        """Return a message that a budget ends it, and what it would take."""
        last = self.stages[-1]
        if math.isinf(left.realisations) and math.isinf(left.seconds):
            return f"{self.sizing.option}={last.size} is the largest that is tried"
        if size is None and self.accuracy is not None and math.isfinite(found := self.wanted()):
            size = self._upwards(found)
        if size is None:
            return "the budget is used"
        about = "about " if self.sizing.falls == "root" else ""
        return (
            f"{about}{self.sizing.option}={size} would take {self.cost(size)} realisations, more than the budget leaves"
        )
