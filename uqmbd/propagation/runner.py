"""Data of a problem, and its runner, which computes, stores and records realisations."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import Any, Self

import numpy as np

from uqmbd.arguments import Size, shown, typechecked
from uqmbd.dynamics import Capability, Ensemble, Ida, Model, built_in_names, capabilities_of, integrator_class, require
from uqmbd.errors import StudyError
from uqmbd.mechanism import Requirement
from uqmbd.progress import Progress, Silent
from uqmbd.propagation.execution import (
    Arrays,
    Checkpoint,
    Chunk,
    ChunkStore,
    CostClock,
    Kind,
    Ledger,
    Observed,
    Packed,
    Realisations,
    Spending,
    StoredChunks,
    chunk_size_of,
    compute_chunk,
    executor_for,
    fingerprint,
    log_realisations,
    lost_chunk,
    needs_motion,
    run_in_order,
    run_tasks,
    threads_of,
)
from uqmbd.propagation.inputs import Existence, input_info, nothing_random
from uqmbd.randomness import JointInput, RandomVariable
from uqmbd.results.schema import Labels, OutputInfo, labels
from uqmbd.typing import Array

__all__ = ["ProblemData", "Runner"]


@dataclass(frozen=True)
class Runner:
    """Runner with the executor, checkpoint, ledger, clock and cache of a problem."""

    executor: Executor | None = None  # computes chunks and tasks; None: this process
    progress: Progress = field(default_factory=Silent)
    checkpoint: Checkpoint | None = None
    """Store of finished chunks."""
    ledger: Ledger | None = None
    """Budget of a run, and chunks that the run has computed for other sizes of the method."""
    clock: CostClock = field(default_factory=CostClock)
    """Clock in s that includes the computing time of data restored from an interrupted run."""
    spending: Spending = field(default_factory=Spending)
    """Computing time of the method, by part."""
    observed: Observed = field(default_factory=Observed)
    """Realisations for the measurement of the integration error."""
    known: StoredChunks = field(default_factory=dict)
    """Chunks with outputs without a time, and with margins, from the same computations, or references to files."""
    again: dict[str, StoredChunks] = field(default_factory=dict)
    """Chunks as in `known`, of realisations that are integrated again; the keys are the purposes."""
    chunk: int | None = None  # number of realisations in a chunk; None: chosen from their total number

    @property
    def folder(self) -> Path | None:
        """Return the folder of the run's files, if it has one."""
        return self.checkpoint.folder if self.checkpoint else None

    def of(self, label: str) -> Runner:
        """Return a runner that stores chunks under another label and counts realisations separately."""
        checkpoint = self.checkpoint and replace(self.checkpoint, label=label)
        return replace(self, checkpoint=checkpoint, observed=Observed())

    def each(self, function: Callable[[Any], Any], pieces: Sequence[Any]) -> Iterator[Any]:
        """Apply a function to tasks in order, in threads if there are workers, for NumPy operations on large arrays."""
        threads = threads_of(self.executor) if len(pieces) > 1 else None
        return map(function, pieces) if threads is None else threads.map(function, pieces)

    def stream(self, problem: ProblemData, values: Array) -> Iterator[Realisations]:
        """Compute the response to each row of inputs; see :meth:`uqmbd.extend.Problem.stream`."""
        self.progress.start(problem.label, len(values))
        begin = started = self.clock()
        size = self.chunk or problem.chunk_of(len(values))
        parts = [np.ascontiguousarray(values[k : k + size]) for k in range(0, len(values), size)]
        store, model = self.chunk_store(problem), problem.model if self.executor is None else problem.packed
        about = (problem.rtol, problem.integrator, problem.kind)

        def lost(part: Array, reason: str) -> Chunk:
            # a lost chunk is not stored, so a resumed run computes it again
            chunk = lost_chunk(problem.model, len(part), problem.whole_times, reason, problem.kind)
            return store.note(part, chunk, lost=True)

        chunks = run_in_order(
            parts,
            executor_for(self.executor, unlocked=problem.unlocked),
            store.find,
            lambda part: (compute_chunk, (model, part, problem.whole_times, *about)),
            store.keep,
            lost,
        )
        for part, chunk in zip(parts, chunks, strict=True):
            now = self.clock()
            self.spending.realised(now - started, chunk.counters)
            found = Realisations.of(part, chunk, now - begin)
            if problem.chosen is not None:
                found = found.choosing(problem.model.scalars, problem.chosen)
            self.observed.add(found)
            log_realisations(problem.label, problem.kind, found)
            yield found
            begin, started = now, self.clock()
            self.progress.advance(problem.label, len(chunk.status))
            if self.ledger is not None and part is not parts[-1]:
                self.ledger.begin()
        self.progress.finish(problem.label)

    def run(
        self, problem: ProblemData, function: Callable[..., Arrays], tasks: Sequence[tuple[Any, ...]]
    ) -> Iterator[Arrays]:
        """Compute tasks other than realisations; see :meth:`uqmbd.extend.Problem.run`."""
        work = (problem.label, problem.packed, problem.identity, self.executor, self.checkpoint, self.clock)
        began = self.clock()
        for done, found in enumerate(run_tasks(*work, function, tasks), 1):
            self.spending.realised(self.clock() - began)
            yield found
            began = self.clock()
            if self.ledger is not None and done < len(tasks):
                self.ledger.begin()

    def chunk_store(self, problem: ProblemData) -> ChunkStore:
        """Return the store of the computed chunks of a problem."""
        return ChunkStore(
            kind=problem.kind,
            partial=problem.chosen is not None,
            margins=not problem.answers_requirements,
            fingerprint=problem.identity,
            joinable=problem.joinable,
            known=self.known,
            checkpoint=self.checkpoint,
            ledger=self.ledger,
            clock=self.clock,
        )


@dataclass(frozen=True)
class ProblemData:
    """Inputs, outputs and times of a study; `uqmbd.extend.Problem` documents the fields."""

    study: str
    mechanism: str
    label: str
    inputs: JointInput
    times: Array
    rtol: float
    integrator: str
    model: Model = field(repr=False)
    kind: Kind = "outputs"
    over: Array | None = field(default=None, repr=False)
    chosen: tuple[str, ...] | None = None
    answers_requirements: bool = False
    method_label: str = field(default="", repr=False)
    watched: Model | None = field(default=None, repr=False)
    existence: Existence = field(default_factory=lambda: Existence({}, {}, {}), repr=False)

    runner: Runner = field(default_factory=Runner, repr=False, compare=False)

    def __getattr__(self, name: str) -> Any:
        """Return an attribute of the runner with a deprecation warning, until version 0.2."""
        now = {"beside": "again"}.get(name, name)
        if hasattr(type(self), name):  # the property of the problem raised the AttributeError
            return object.__getattribute__(self, name)
        if now not in ("again", "checkpoint", "each", "executor", "known", "ledger", "observed", "spending"):
            raise AttributeError(f"{type(self).__name__!r} object has no attribute {name!r}")
        text = f"problem.{name} was renamed to problem.runner.{now}; version 0.2 removes the old name."
        warnings.warn(text, DeprecationWarning, stacklevel=2)
        return getattr(self.runner, now)

    @property
    def progress(self) -> Progress:
        """Return the receiver of progress reports."""
        return self.runner.progress

    def clock(self) -> float:
        """Return seconds that include the cost of work restored from an interrupted run."""
        return self.runner.clock()

    @property
    def folder(self) -> Path | None:
        """Return the folder of the run's files, if it has one."""
        return self.runner.folder

    @property
    def timeless(self) -> bool:
        """Return whether the outputs are scalar outputs, with one nominal time, or margins of requirements.

        Most methods need not distinguish the cases, because the run converts their results afterwards. A method that
        solves for all realisations together must compute separate realisations if this property is true.
        """
        return self.kind != "outputs"

    @property
    def requirements(self) -> tuple[Requirement, ...]:
        """Return the requirements of the mechanism."""
        return () if self.model.margins is None else tuple(self.model.margins.requirements)

    @property
    def whole_times(self) -> Array:
        """Return the output times of the study for every kind of outputs, shape (T,), s."""
        return self.times if self.over is None else self.over

    @typechecked
    def with_inputs(self, variables: Iterable[RandomVariable]) -> Self:
        """Return the problem with other distributions of some inputs, as after a calibration.

        Parameters
        ----------
        variables : iterable of RandomVariable
            Variables with finite moments, and names and units of the inputs that they replace; other inputs stay.

        Raises
        ------
        uqmbd.StudyError
            If a variable has an unknown name or other units, or replaces only part of a group of dependent inputs.
        """
        given = tuple(variables)
        try:
            inputs = self.inputs.replaced(given)
        except StudyError as error:
            raise StudyError(f"{self.label}: {error}") from None
        return replace(self, inputs=inputs, existence=self.existence.without({v.name for v in given}))

    @cached_property
    def labels(self) -> Labels:
        """Return names and units of outputs, inputs and times, for `uqmbd.results`."""
        if self.kind == "requirements":
            outputs = [OutputInfo(requirement.name, requirement.units) for requirement in self.requirements]
        else:
            seen = self.model.scalars if self.kind == "scalars" else self.model.outputs
            outputs = list(map(OutputInfo, seen.names, seen.units, seen.turns.tolist(), seen.places))
        if self.chosen is not None:
            outputs = [output for output in outputs if output.name in self.chosen]
        return labels(outputs, [input_info(v) for v in self.inputs.variables], self.times)

    @cached_property
    def packed(self) -> Packed:
        """Return the packed model for workers."""
        return Packed.of(self.model)

    @typechecked
    def ensemble(self, values: Array) -> Ensemble:
        """Make the ensemble of realisations for methods that solve them together.

        Parameters
        ----------
        values : array, shape (K, input)
            Inputs, in the order of ``inputs.names``.

        Returns
        -------
        Ensemble
            Ensemble at its initial state.
        """
        return Ensemble(self.model, self.checked(values))

    @typechecked
    def chunk_of(self, count: Size) -> int:
        """Return the chunk size for a number of realisations, the same for all kinds of outputs."""
        return chunk_size_of(self.model, self.inputs.means, self.whole_times, count)

    @property
    def joinable(self) -> bool:
        """Return whether joined chunks equal a larger one to the bit; false for plugins, and for `Ida` stacks."""
        return self.integrator in built_in_names() and self.integrator != Ida.name

    def require_random(self) -> None:
        """Raise a `uqmbd.StudyError` if there are no random inputs.

        Raises
        ------
        uqmbd.StudyError
            If there are no random inputs.
        """
        if reason := nothing_random(self.inputs, self.mechanism):
            raise StudyError(f"{self.label}: {reason}.")

    @typechecked
    def require(self, needed: Capability, integrator: str | None = None, remedy: str = "") -> None:
        """Raise an error if the integrator lacks a capability that a method needs.

        A method that does not integrate its equations by `realise` calls this method, in `propagate` and in
        `Propagator.obstacle`.

        Parameters
        ----------
        needed : str
            Name of a field of `uqmbd.extend.Capabilities`: ``projected`` to integrate a
            `uqmbd.extend.ProjectedEnsemble`, ``segments`` for `histories`.
        integrator : str, optional
            Name of the integrator; default: the integrator of the study.
        remedy : str
            Text before the names of suitable integrators that describes how to choose one.

        Raises
        ------
        uqmbd.StudyError
            If the integrator lacks the capability; the message lists integrators that have it.
        """
        require(integrator or self.integrator, needed, self.label, remedy=remedy)

    @property
    def unlocked(self) -> bool:
        """Whether realisations run without the interpreter lock: never with events, controllers, or only statics."""
        free = capabilities_of(integrator_class(self.integrator)).releases_gil
        return free and not (self.model.events or self.model.controls) and needs_motion(self.model, self.kind)

    @cached_property
    def common_identity(self) -> bytes:
        """Return the digest of the data that affect the numbers of chunks of all kinds."""
        return fingerprint(self.model, self.inputs, (self.rtol, self.integrator), (self.whole_times.tobytes(),))

    @cached_property
    def identity(self) -> bytes:
        """Return the digest of the data, other than inputs, that affect a chunk: equations, outputs, options."""
        if self.over is None:
            return self.common_identity
        kind = (self.kind, self.over.tobytes())
        return fingerprint(self.model, self.inputs, (self.rtol, self.integrator), kind)

    def checked(self, values: Array) -> Array:
        """Return rows of inputs as an array.

        Parameters
        ----------
        values : array, shape (K, input)
            Inputs, in the order of ``inputs.names``; a single row may have shape (input,). Terms of paths may follow.

        Returns
        -------
        array, shape (K, input)
            The same values.

        Raises
        ------
        uqmbd.StudyError
            If the shape is different.
        """
        array = np.atleast_2d(np.asarray(values, dtype=float))
        more, terms = array.shape[-1] - len(self.inputs), 2 * len(self.model.paths)
        if array.ndim != 2 or more < 0 or (more % terms if terms else more):
            raise StudyError(
                f"{self.label}: inputs have shape {np.shape(values)}; expected (realisations, {len(self.inputs)}), "
                f"with the columns {', '.join(self.inputs.names)}."
            )
        return array

    def without_time(self) -> Self:
        """Return the problem of the scalar outputs, which reuses the results computed so far."""
        return self._of("scalars", self.whole_times[:1], self.existence)

    def choosing(self, names: tuple[str, ...]) -> Self:
        """Return the problem of some scalar outputs; a realisation that lacks any of them is censored."""
        return replace(self, chosen=names).using(observed=Observed())

    def of_requirements(self) -> Self:
        """Return the problem of the margins of requirements: the smallest value until each time."""
        return self._of("requirements", self.whole_times, Existence({}, {}, {}))

    def _of(self, kind: Kind, times: Array, existence: Existence) -> Self:
        part = self.part(f"{self.label}-{kind}")
        return replace(part, kind=kind, over=self.whole_times, chosen=None, times=times, existence=existence)

    @typechecked
    def part(self, label: str) -> Self:
        """Return the problem of a part of the work, with a separate label and separate stored chunks.

        Parameters
        ----------
        label : str
            Label of the part, such as ``f"{problem.label}: control"``.
        """
        return replace(self, label=label, runner=self.runner.of(label))

    def using(self, **changes: Any) -> Self:
        """Return the same problem with another executor, progress, checkpoint, ledger, clock or record.

        Parameters
        ----------
        **changes
            Fields of ``problem.runner``: ``executor``, ``progress``, ``checkpoint``, ``ledger``, ``clock``,
            ``spending``, ``observed``, ``known``, ``again``.
        """
        return replace(self, runner=replace(self.runner, **changes))

    @typechecked
    def watching(self, times: Array | None = None) -> Self:
        """Return the problem with the outputs of the study followed by the watched expressions, at any times (T,), s.

        Raises
        ------
        uqmbd.StudyError
            If the times do not increase.
        """
        # margins and outputs without a time are defined only for the times of the study
        model = replace(self.watched or self.model, margins=None)
        if times is not None:
            model = replace(model, scalars=None)
        times = self.times if times is None else np.array(times, dtype=float)
        if times.ndim != 1 or not np.isfinite(times).all() or (np.diff(times) <= 0).any():
            raise StudyError(f"{self.label}: times is {shown(times)}; expected an array of increasing times (T,) in s.")
        other = replace(self, model=model, watched=None, times=times)
        return other.using(observed=Observed())
