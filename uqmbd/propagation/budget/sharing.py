"""Share a budget among methods: run pilots, then run the sizes that the budget allows, and record the outcome."""

from __future__ import annotations

import contextlib
import json
import math
import time
import warnings
from collections.abc import Callable, Sequence
from concurrent.futures import Executor
from dataclasses import asdict, dataclass, field, fields, is_dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from uqmbd.errors import StudyError, StudyWarning
from uqmbd.files import replacing
from uqmbd.isolation import ERRORS_AND_EXITS, Isolated, release
from uqmbd.progress import Progress
from uqmbd.propagation.budget.amounts import Amount, accuracy_of, budget_of
from uqmbd.propagation.budget.reach import BudgetTooSmallError, out_of_reach
from uqmbd.propagation.budget.sized import RemainingBudget, Sized, Stage
from uqmbd.propagation.budget.timing import first_problem
from uqmbd.propagation.execution import FOLDER, LIMIT, BudgetSpent, Ledger, explained
from uqmbd.propagation.methods import Propagator, Studied, obstacle_of, run_method
from uqmbd.wording import format_duration, format_percent

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["BudgetTerms", "BudgetedRun"]

BEHIND = 0, 2, 8, 32
"""Assumed numbers of missing chunks before the last finished chunk, tried one after another."""

RECORD = "budget.json"
"""Name of the file with the chosen sizes of a run, next to its finished chunks; a resumed run uses the same sizes."""


@dataclass(frozen=True)
class BudgetTerms:
    """Budget and accuracy of a run."""

    budget: Amount | None = None
    accuracy: float | None = None  # see `uqmbd.results.stated_accuracy`
    receiver: Callable[[str], object] | None = None  # receives sentences on the chosen sizes
    clock: Callable[[], float] = time.monotonic  # s

    @classmethod
    def of(cls, where: str, budget: object, accuracy: object, receiver: Callable[[str], object] | None) -> BudgetTerms:
        """Read budget and accuracy; at least one of the two must be given."""
        return cls(budget_of(budget, f"{where}: budget"), accuracy_of(accuracy, f"{where}: accuracy"), receiver)

    @property
    def bounds(self) -> str:
        """Describe the budget; empty if there is none."""
        return (
            ""
            if self.budget is None
            else (f"realisations of the curves of error against cost are not part of the budget of {self.budget.words}")
        )

    @property
    def requested_as_stored(self) -> dict[str, Any]:
        """Return requested budget and accuracy in their stored form."""
        known = self.budget or Amount()
        about = {"realisations": known.realisations, "seconds": known.seconds, "accuracy": self.accuracy}
        return {name: value for name, value in about.items() if value is not None and math.isfinite(value)}

    def report_sentence(self, sentence: str) -> None:
        """Report a sentence."""
        if self.receiver is not None:
            self.receiver(sentence)


@dataclass
class BudgetedRun:
    """Methods of a study that share a budget."""

    study: Studied
    terms: BudgetTerms
    executor: Executor | None
    progress: Progress
    folder: Path | None = None
    resume: bool = False  # whether to use the sizes that an interrupted run has chosen
    nodes: dict[str, xr.DataTree] = field(default_factory=dict)
    errors: dict[str, BaseException] = field(default_factory=dict)
    about: dict[str, dict[str, Any]] = field(default_factory=dict)
    _ledgers: dict[str, Ledger] = field(default_factory=dict)
    _warnings: dict[str, list[warnings.WarningMessage]] = field(default_factory=dict)
    _record: dict[str, list[dict[str, Any]]] = field(default_factory=dict)
    _begin: float = 0.0
    _earlier: float = 0.0

    def run(self, propagators: Sequence[Propagator]) -> None:
        """Run methods, and store their nodes, or errors, by their labels.

        Methods of fixed size run first, because their cost cannot be chosen. Then each other method runs a pilot, and
        uses its part of the remaining budget. The cheapest method runs first, so that the other methods share the
        budget that it does not use.
        """
        self._read()
        self._begin = self.terms.clock()
        self._warm(propagators)
        sized: list[Sized] = []
        for propagator in propagators:
            found = self._possible_sizes(propagator)
            if isinstance(found, Sized):
                sized.append(found)
        # a resumed run may reuse stored realisations, so that a small budget may suffice
        if not self.resume:
            self.errors |= out_of_reach(sized, self._left(1).realisations)
            sized = [one for one in sized if one.label not in self.errors]
        for one in sized:
            # the part of the budget that a pilot does not use remains for all methods
            if one.needs_pilot(timed=math.isfinite((self.terms.budget or Amount()).seconds)):
                self._run_sizes(one, self._left_for_pilot(one, len(sized)), pilot=True)
        waiting = [one for one in sized if one.label not in self.errors]
        waiting.sort(key=lambda one: one.expected_size())
        for number, one in enumerate(waiting):
            self._run_sizes(one, self._left(len(waiting) - number))
            if one.label not in self.errors:
                self._end(one)

    def _warm(self, propagators: Sequence[Propagator]) -> None:
        """Compute the realisation at the means, so that the cost of other realisations excludes compilation."""
        with Isolated(*ERRORS_AND_EXITS), warnings.catch_warnings():
            warnings.simplefilter("ignore")
            problem = first_problem(self.study, propagators[0])
            problem.realise(problem.inputs.means[None, :])

    def _left(self, shared_by: int) -> RemainingBudget:
        """Return the part of the budget that the next method may use."""
        budget = self.terms.budget or Amount()
        spent = sum(ledger.spent for ledger in self._ledgers.values())
        seconds = budget.seconds - self._elapsed()
        most = max(budget.realisations - spent, 0) / shared_by
        return RemainingBudget(math.floor(most) if math.isfinite(most) else most, max(seconds, 0.0) / shared_by)

    def _left_for_pilot(self, one: Sized, shared_by: int) -> RemainingBudget:
        """Return the part of the budget of a method, but at least the cost of its smallest size."""
        left, least = self._left(shared_by), 0
        with Isolated(*ERRORS_AND_EXITS):  # the run of this size reports the error
            least = one.cost(one.sizing.least)
        return replace(left, realisations=max(left.realisations, min(least, self._left(1).realisations)))

    def _elapsed(self) -> float:
        return self.terms.clock() - self._begin + self._earlier

    def smallest(self, propagator: Propagator) -> Propagator:
        """Return the smallest size of a method, or the method itself if it has a fixed size."""
        found = propagator
        with Isolated(*ERRORS_AND_EXITS):  # `_possible_sizes` reports the error
            if (sizing := propagator.sizing(self.study, self.terms.accuracy)) is not None:
                found = sizing.at(sizing.least)
        return found

    def _possible_sizes(self, propagator: Propagator) -> Sized | None:
        """Return the possible sizes of a method; run a method of fixed size unchanged, and return None."""
        label, sizing = propagator.node_name, None
        with Isolated(*ERRORS_AND_EXITS) as isolated:
            sizing = propagator.sizing(self.study, self.terms.accuracy)
        if isolated.error is not None:
            self.errors[label] = isolated.error
            return None
        ledger = self._ledgers[label] = Ledger(clock=self.terms.clock)
        if sizing is not None:
            one = Sized(propagator, sizing, self.study, self.terms.accuracy)
            with Isolated(*ERRORS_AND_EXITS):  # the first run reports a model that cannot be built
                problem = first_problem(self.study, propagator)
                rows = LIMIT / (8 * max(math.prod(problem.labels.shape), 1))
                one.chunk, one.joinable, one.held = (
                    problem.chunk_of,
                    problem.joinable,
                    math.inf if self.folder else rows,
                )
            for stored in self._record.get(label, []):
                self._earlier += stored.get("seconds", 0.0)
            return one
        self.terms.report_sentence(f"{label}: the method has no adjustable size, so it runs with the given options")
        left = self._left(1)
        ledger.most, ledger.until = left.realisations, math.inf
        with Isolated(*ERRORS_AND_EXITS) as work:
            estimate = propagator.estimate(self.study)
            if estimate is not None and not estimate.at_most and estimate.realisations > left.realisations:
                raise BudgetTooSmallError(
                    f"{label}: the method has no adjustable size and needs {estimate.realisations} realisations, "
                    f"more than the remaining budget ({left.realisations:.0f}). Use a larger budget, or omit the "
                    "method (--only LABEL of the other methods; in Python only=)."
                )
            begin = self.terms.clock()
            try:
                node = self._computed(propagator, ledger)
            except BudgetSpent as spent:
                raise BudgetTooSmallError(
                    f"{label}: the method has no adjustable size, and the budget is too small: "
                    f"{spent}. Use a larger budget."
                ) from None
            found = self._stated(node, "moments")
            words = f"the method has no adjustable size; with the given options, the stated error is {found.words}"
            self.about[label] = {"sized": False, "stated": found.value, "summary": words}
            self.about[label]["seconds"] = self.terms.clock() - begin
            node.attrs["budget_summary"] = words
            self.nodes[label] = node
        if work.error is not None:
            release(work.error)
            self.errors[label] = work.error
        return None

    def _stated(self, node: xr.DataTree, of: Any, *, usual: bool = False) -> Any:
        from uqmbd.results import stated_accuracy

        return stated_accuracy(node, rtol=getattr(self.study, "rtol", 0.0), of=of, usual=usual)

    def _run_sizes(self, one: Sized, left: RemainingBudget, *, pilot: bool = False) -> None:
        """Run a method at increasing sizes until its accuracy is sufficient or its part of the budget is spent.

        A method fails if its first size fails. If a later size fails, the method keeps its earlier results.
        """
        ledger, now, size, done = self._ledgers[one.label], self.terms.clock(), 0, 0
        ledger.most, ledger.until = ledger.spent + left.realisations, now + left.seconds
        while True:
            with Isolated(*ERRORS_AND_EXITS) as work:
                try:
                    if (chosen := self._next(one, self._remaining(ledger))) is None:
                        return
                    size, done = chosen, ledger.done
                    if one.stages and not pilot:
                        self._announce(one, size)
                    self._stage(one, size, ledger)
                except BudgetSpent as spent:
                    one.problem = f"the budget was exhausted at {one.sizing.option}={size}"
                    self._salvage(one, size, ledger.done - done, ledger)
                    if one.node is None:
                        raise BudgetTooSmallError(
                            f"{one.label}: the budget is too small for the smallest size of the method, "
                            f"{one.sizing.option}={size}: {spent}. Use a larger budget."
                        ) from None
                    return
            if work.error is not None:
                release(work.error)
                if one.node is None:
                    self.errors[one.label] = work.error
                else:
                    one.problem = f"{one.sizing.option}={size} failed: {work.reason}"
                return
            if pilot:
                return

    def _salvage(self, one: Sized, size: int, done: int, ledger: Ledger) -> None:
        """Use the largest size whose realisations are complete when the budget ends the run of a larger size."""
        ledger.most, ledger.until = ledger.spent, math.inf
        del self._record[one.label][len(one.stages) :]
        for behind in BEHIND:
            # several workers may finish chunks out of order
            if (found := one.finished(size, done - behind * one.chunk(size))) is None:
                return
            with contextlib.suppress(BudgetSpent):
                self._stage(one, found, ledger, finished=True)
                return
            del self._record[one.label][len(one.stages) :]

    def _remaining(self, ledger: Ledger) -> RemainingBudget:
        return RemainingBudget(ledger.most - ledger.spent, max(ledger.until - self.terms.clock(), 0.0))

    def _next(self, one: Sized, left: RemainingBudget) -> int | None:
        """Return the next size; a resumed run uses the size that the interrupted run has chosen."""
        known = self._record.get(one.label, [])
        if len(one.stages) < len(known):
            return int(known[len(one.stages)]["size"])
        return one.following(left) if one.stages else one.first(left)

    def _announce(self, one: Sized, size: int) -> None:
        last, needed = one.stages[-1], one.needed()
        stated = format_percent(last.accuracy, "no error")
        text = f"{one.label}: the stated error with {one.sizing.option}={last.size} is {stated} ({last.quantity})"
        if one.accuracy is not None and math.isfinite(needed) and one.sizing.falls != "itself":
            count = one.sizing.largest(needed)
            text += f"; {format_percent(one.accuracy, 'no error')} needs about {one.sizing.option}={count}"
        text += (
            f"; the next size is {size}: {one.cost(size)} realisations, about "
            f"{format_duration(one.seconds(size), rough=True)}"
        )
        if one.sizing.falls == "root" and math.isfinite(last.accuracy):
            text += f", for about {format_percent(last.accuracy * math.sqrt(last.size / size), 'no error')}"
        self.terms.report_sentence(text)

    def _stage(self, one: Sized, size: int, ledger: Ledger, *, finished: bool = False) -> None:
        """Run a method at a size; `finished` states whether all realisations of this size exist already."""
        method = one.sizing.at(size)
        if method.node_name != one.label:
            method = replace(method, label=one.label)
        record, k = self._record.setdefault(one.label, []), len(one.stages)
        again = record[k] if k < len(record) else None
        if again is None:
            if (reason := obstacle_of(method, self.study)) is not None:
                raise StudyError(f"{one.label}: the method cannot run this study: {reason}")
            if one.stages and not finished and one.fresh(size) > ledger.most - ledger.spent:
                raise BudgetSpent(f"{one.fresh(size)} realisations")
            record.append({"size": size})
            self._write()
        begin, spent, reused, before = self.terms.clock(), ledger.spent, ledger.reused, ledger.computing
        node = self._computed(method, ledger)
        counted = int(node.attrs.get("realisations", 0))
        # a method that solves for all realisations together does not count them separately
        ledger.spent += max(counted - (ledger.spent - spent) - (ledger.reused - reused), 0)
        fresh, seconds, computing = ledger.spent - spent, self.terms.clock() - begin, ledger.computing - before
        if again is not None and "seconds" in again:
            # count realisations of the interrupted run with their recorded cost
            seconds, fresh, computing = again["seconds"], again["fresh"], again["computing"]
            ledger.spent = spent + fresh
        elif again is not None:
            # realisations that were finished before the interruption belong to the same budget
            planned = one.fresh(size) if one.stages else counted
            fresh = max(fresh, planned)
            ledger.spent = spent + fresh
        found = self._stated(node, one.sizing.of)
        usual = self._stated(node, one.sizing.of, usual=True)
        of = (found.value, found.quantity, found.kind, usual.value, usual.kind)
        one.add(Stage(size, counted, fresh, seconds, computing, *of), node)
        record[k].update(seconds=seconds, fresh=fresh, computing=computing)
        self._write()

    def _computed(self, method: Propagator, ledger: Ledger) -> xr.DataTree:
        """Run a method, and store its warnings, which `pass_on_warnings` issues for the chosen size only."""
        with warnings.catch_warnings(record=True) as caught, explained(self.executor):
            warnings.simplefilter("always")
            problem = self.study.problem(method, self.executor, self.progress, self.folder)
            node = run_method(method, problem.using(ledger=ledger))
        self._warnings[method.node_name] = caught
        return node

    def _end(self, one: Sized) -> None:
        """Record and report the chosen size."""
        assert one.node is not None and one.taken is not None
        taken, target = one.taken, one.accuracy
        about: dict[str, Any] = {
            "sized": True,
            "option": one.sizing.option,
            "size": taken.size,
            "stated": taken.accuracy,
            "quantity": taken.quantity,
            "spent": self._ledgers[one.label].spent,
            "seconds": sum(stage.seconds for stage in one.stages),
            "stages": [asdict(stage) for stage in one.stages],
        }
        chosen = ", ".join([f"{one.sizing.option}={taken.size}", *_further_options(one, taken.size)])
        text = f"the stated error with {chosen} is {format_percent(taken.accuracy, 'no error')} ({taken.quantity})"
        if target is not None:
            about["met"] = one.met
            text += f"; {100 * target:g} % was requested"
            text += "" if one.met else f", but not reached: {one.problem or 'the budget is used'}"
            for part in (one.node, *filter(None, [one.node.children.get("scalars")])):
                part.attrs["requested_accuracy"] = target
        about["summary"] = text
        one.node.attrs["budget_summary"] = text
        self.about[one.label], self.nodes[one.label] = about, one.node
        self.terms.report_sentence(f"{one.label}: {text}")

    def pass_on_warnings(self, stacklevel: int) -> None:
        """Issue the warnings of methods at the chosen sizes; without `receiver`, warn of a missed accuracy."""
        for label, about in self.about.items():
            if about.get("met") is False and self.terms.receiver is None:
                warnings.warn(f"{label}: {about['summary']}", StudyWarning, stacklevel=stacklevel + 1)
        for label in self.nodes:
            for one in self._warnings.get(label, []):
                warnings.warn(one.message, one.category, stacklevel=stacklevel + 1)

    def attribute(self) -> dict[str, str]:
        """Return the root attribute ``budget`` in JSON: requested budget and accuracy, and the outcome by method."""
        about: dict[str, Any] = {"asked": self.terms.requested_as_stored, "methods": self.about}
        if small := [label for label, error in self.errors.items() if isinstance(error, BudgetTooSmallError)]:
            about["too_small_for"] = small
        return {"budget": json.dumps(_plain(about), ensure_ascii=False)}

    def _read(self) -> None:
        """Read the sizes that an interrupted run chose for the same budget and accuracy."""
        if self.folder is None or not self.resume:
            return
        with contextlib.suppress(OSError, ValueError, LookupError, TypeError, AttributeError):
            found = json.loads((self.folder / FOLDER / RECORD).read_text())
            if found["asked"] == self.terms.requested_as_stored:
                self._record = {str(k): [_size(one) for one in v] for k, v in found["methods"].items()}

    def _write(self) -> None:
        if self.folder is None:
            return
        place = self.folder / FOLDER
        place.mkdir(parents=True, exist_ok=True)
        with replacing(place / RECORD) as part:
            part.write_text(json.dumps({"asked": self.terms.requested_as_stored, "methods": self._record}))


def _size(record: Any) -> dict[str, Any]:
    """Return a finished or started size from a record; raise an error if the record is damaged."""
    found: dict[str, Any] = {"size": int(record["size"])}
    if "seconds" in record:
        found |= {name: float(record[name]) for name in ("seconds", "computing")} | {"fresh": int(record["fresh"])}
    return found


def _plain(value: Any) -> Any:
    """Return a value that JSON can represent: infinity becomes null."""
    if isinstance(value, dict):
        return {key: _plain(one) for key, one in value.items()}
    if isinstance(value, list):
        return [_plain(one) for one in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value


def _further_options(one: Sized, size: int) -> list[str]:
    """Return the options, other than the size, that differ between the method of a study and that of a size."""
    before, now = one.propagator, one.sizing.at(size)
    if type(now) is not type(before) or not is_dataclass(now):
        return []
    names = [x.name for x in fields(now) if x.name != one.sizing.option]
    found = {name: getattr(now, name) for name in names if getattr(now, name) != getattr(before, name)}
    return [f"{name}={value}" for name, value in found.items() if isinstance(value, int)]
