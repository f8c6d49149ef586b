"""Scalar outputs, which have no time: modes, values at rest or in steady motion, and results of an integration."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
import sympy

from uqmbd.compiled import Kernel, cached, compile_kernel
from uqmbd.dynamics.batch import Batch
from uqmbd.dynamics.equations import (
    Instance,
    OutputMap,
    Placement,
    Tables,
    output_map,
    plain,
)
from uqmbd.dynamics.integration import Trajectories
from uqmbd.dynamics.observation import observe, observe_along
from uqmbd.dynamics.statics.equilibrium import static_equilibria
from uqmbd.dynamics.statics.linear_response import LinearMap, linear_map
from uqmbd.dynamics.statics.mode_values import ModeMap, mode_map
from uqmbd.dynamics.statics.modes import linearise
from uqmbd.dynamics.statics.screws import Screws
from uqmbd.dynamics.statics.steady_modes import linearise_steady
from uqmbd.dynamics.statics.steady_motion import SteadyMotions, steady_motions
from uqmbd.dynamics.summaries import SummaryMap, summarised, summary_map
from uqmbd.errors import StudyError
from uqmbd.mechanism import (
    AtEquilibrium,
    AtSteady,
    EventTime,
    FirstTime,
    LinearOutput,
    ModeShape,
    MotionSymbol,
    Output,
    ScalarSymbol,
    Summary,
    shown,
)
from uqmbd.names import SeriesPlace, did_you_mean
from uqmbd.randomness import RandomVariable
from uqmbd.status import Status
from uqmbd.typing import Array, Index, Mask

__all__ = ["ScalarMap", "ScalarValues", "scalar_map", "scalars_of"]


LASTING = ("rest", "lift-off", "stick", "slip")
"""Labels of events of a persistent contact."""

LETTERS = ("_m", "_n", "_e", "_s", "_u", "_d", "_x")
"""Prefixes of the arguments of the output kernel, in order: modal, motion, resting, steady, summed, linear, inputs."""

CHANGES = 1e-5
"""Allowed relative change of a value in a steady motion, due to rounding and Newton's method."""


@dataclass(frozen=True)
class ScalarValues:
    """Scalar outputs of K realisations."""

    values: Array  # (K, scalar): NaN if a realisation has no value
    status: Index  # (K,): `Status`; OTHER: missing value, for example without equilibrium or with fewer modes
    messages: tuple[str, ...]  # reasons
    # (K, scalar): events later than the last output time in successful realisations; their values are NaN
    censored: Mask

    @classmethod
    def joined(cls, parts: Sequence[ScalarValues]) -> ScalarValues:
        """Join the outputs of several chunks."""
        return cls(
            np.concatenate([p.values for p in parts]),
            np.concatenate([p.status for p in parts]),
            tuple(m for p in parts for m in p.messages),
            np.concatenate([p.censored for p in parts]),
        )


@dataclass(frozen=True)
class ScalarMap:
    """Compiled scalar outputs."""

    names: tuple[str, ...]  # in the user's spelling
    units: tuple[str, ...]  # in the user's spelling
    places: tuple[SeriesPlace | None, ...]  # place of each output in a series along an axis; None: not in a series
    modal: ModeMap  # required quantities of modes: frequencies (Hz), damping ratios, shapes
    motion: tuple[str, ...]  # names of the required results of an integration
    resting: OutputMap  # expressions at static equilibrium
    steady: OutputMap  # expressions in steady motion
    summed: SummaryMap  # summaries of the motion
    summed_in: tuple[tuple[str, str], ...]  # for each summary: its output, and its text in messages
    responses: LinearMap | None  # values of the linearised mechanism
    kernel: Kernel  # of (modal, motion, resting, steady, summed, linear, inputs)
    # for each output: arguments that may be censored (first times and times of events)
    reaching: tuple[tuple[int, ...], ...]
    late: tuple[str, ...]  # for each output: message on a realisation with a censored argument

    @property
    def turns(self) -> Array:
        """Length of a turn of each output (O,): 0, because scalar outputs are not unwrapped."""
        return np.zeros(len(self.names))

    @property
    def needs_motion(self) -> bool:
        """Whether the motion must be integrated."""
        return bool(self.motion or self.summed.names)

    @property
    def needs_dense_output(self) -> bool:
        """Whether the motion between the output times is needed."""
        return self.summed.needs_dense_output

    def of_events(self, output: int) -> bool:
        """Return whether an output, given by its number, contains times of events."""
        first = len(self.modal.values)
        return any(first <= argument < first + len(self.motion) for argument in self.reaching[output])

    @property
    def needs_equilibrium(self) -> bool:
        """Whether the static equilibrium must be found."""
        return bool(self.resting.names) or "equilibrium" in (self.modal.poses | self.linear_poses)

    @property
    def linear_poses(self) -> frozenset[str]:
        """Poses about which the response to excitations is linearised."""
        return frozenset() if self.responses is None else self.responses.poses

    @property
    def needs_steady_motion(self) -> bool:
        """Whether the steady motion must be found."""
        return bool(self.steady.names) or "steady" in (self.modal.poses | self.linear_poses)


def scalar_map(
    outputs: Sequence[Output],
    instances: list[Instance],
    places: list[Placement],
    order: dict[str, int],
    inputs: Sequence[RandomVariable],
    sizes: tuple[int, int, int],
) -> ScalarMap | None:
    """Compile scalar outputs, with the arguments of `output_map`; None if there are no outputs."""
    if not outputs:
        return None
    free = sorted({s for o in outputs for s in o.expression.free_symbols if isinstance(s, ScalarSymbol)}, key=str)
    motion = [s for s in free if isinstance(s, MotionSymbol)]
    modal: list[ScalarSymbol | ModeShape] = [s for s in free if not isinstance(s, MotionSymbol)]
    modal += sorted({e for o in outputs for e in o.expression.atoms(ModeShape)}, key=str)
    for symbol in motion:
        if isinstance(symbol, EventTime):
            _require_event(symbol, outputs, instances)
    held, going, summed, excited = (
        sorted({e for o in outputs for e in o.expression.atoms(kind)}, key=str)
        for kind in (AtEquilibrium, AtSteady, Summary, LinearOutput)
    )

    def compiled(part: Sequence[Output], *, gradients: Literal["", "motion", "all"] = "") -> OutputMap:
        return output_map(part, instances, places, order, inputs, sizes, gradients=gradients)

    resting, steady = (compiled([Output(str(e), e.args[0], "") for e in part]) for part in (held, going))
    # whole expressions come first, because their symbols are states
    swaps: list[tuple[Any, list[Any]]] = [("_e", held), ("_s", going), ("_u", summed), ("_m", modal), ("_n", motion)]
    swaps[3:3] = [("_d", excited)]
    swaps.append(("_x", list(inputs)))
    local = [o.expression for o in outputs]
    for letter, old in swaps:
        new = {e: sympy.Symbol(f"{letter}{k}", real=True) for k, e in enumerate(old)}
        local = [e.xreplace(new) for e in local]
    local = [plain(e) for e in local]

    def make() -> Kernel:
        import symengine as se

        names = [f"{letter}{k}" for letter in LETTERS for k in range(len(dict(swaps)[letter]))]
        tables = Tables()
        expressions = tables.applied([tables.converted(e) for e in local])
        return compile_kernel([se.Symbol(name) for name in names], expressions, tables=tables.known)

    counts = [len(old) for _, old in swaps]
    every = [e for letter in LETTERS for e in dict(swaps)[letter]]
    kernel = cached(("scalars", counts, sympy.srepr(sympy.Tuple(*local))), make)
    return ScalarMap(
        tuple(o.name for o in outputs),
        tuple(o.units for o in outputs),
        tuple(o.place for o in outputs),
        mode_map(modal, lambda part: compiled(part, gradients="motion")),
        tuple(str(s) for s in motion),
        resting,
        steady,
        summary_map(summed, compiled),
        tuple((next(o.name for o in outputs if o.expression.has(s)), shown(s)) for s in summed),
        linear_map(excited, instances, inputs, lambda part: compiled(part, gradients="all")),
        kernel,
        tuple(
            tuple(k for k, s in enumerate(every) if isinstance(s, EventTime | FirstTime) and o.expression.has(s))
            for o in outputs
        ),
        tuple(_missing_event(o.expression) for o in outputs),
    )


def _missing_event(expression: sympy.Expr) -> str:
    """Return the message for an event that an output needs but that does not occur."""
    events = sorted(map(str, expression.atoms(EventTime)))
    one = len(events) == 1 and not expression.atoms(FirstTime)
    return f"the event {repr(events[0]) if one else 'of this output'} does not occur by the last output time"


def _require_event(symbol: EventTime, outputs: Sequence[Output], instances: Sequence[Instance]) -> None:
    """Raise unless the component has events with this label."""
    kinds = [e for i in instances if i.component is symbol.component for e in i.type.events]
    lasting = LASTING if any(e.directions for e in kinds) else ()
    known = [*dict.fromkeys(e.label for e in kinds), *lasting]
    if symbol.label in known:
        return
    component = symbol.component
    where = next((o.name for o in outputs if symbol in o.expression.free_symbols), "")
    there = f"Its events are: {', '.join(map(repr, known))}." if known else "It has no events."
    raise StudyError(
        f"output {where!r}: {type(component).__name__} {component.name!r} has no event "
        f"{symbol.label!r}{did_you_mean(symbol.label, known) or '.'} {there}"
    )


def scalars_of(
    ensemble: Batch,
    trajectories: Trajectories | None = None,
    scalars: ScalarMap | None = None,
    never: float | None = None,
) -> ScalarValues:
    """Evaluate scalar outputs of K realisations; by default the scalar outputs of the model.

    Poses are the initial pose of each realisation, and the static equilibrium and steady motion found from it.  Time is
    the initial time, except in steady motions.  `trajectories` are required if ``model.scalars.needs_motion``.  The
    time `never` in s replaces censored first times and event times; by default, outputs that depend on
    these times are NaN.  If one
    value of a realisation is missing, all its values are missing.
    """
    model = ensemble.model
    seen: ScalarMap = scalars or model.scalars
    count = len(ensemble)
    still = ensemble.without_paths()
    start = ensemble.start
    messages = list(start.messages)
    status = start.status
    blocks = (seen.modal.values, seen.motion, seen.resting.names, seen.steady.names, seen.summed.names)
    responses = 0 if seen.responses is None else len(seen.responses.requests)
    ends = np.cumsum([*(len(block) for block in blocks), responses])
    columns = np.full((count, int(ends[-1])), np.nan)

    def fail(members: Index, reasons: Sequence[str], kind: Status = Status.OTHER) -> None:
        if not any(reasons):
            return
        for k, reason in zip(members.tolist(), reasons, strict=True):
            if reason and status[k] == Status.OK:
                messages[k], status[k] = reason, kind

    poses = {"start": (still.start.q, still.start.s)}
    if seen.needs_equilibrium:
        found = static_equilibria(still)
        fail(np.arange(count), found.messages)
        poses["equilibrium"] = (found.q, found.s)
    going = None
    if seen.needs_steady_motion:
        going = steady_motions(still)
        fail(np.arange(count), going.messages)
    for pose in sorted(seen.modal.poses):
        good = np.flatnonzero(status == Status.OK)
        if not len(good):
            break
        some = still.select(good)
        if pose == "steady" and going is not None:
            stable = going.select(good)
            modes, reasons = linearise_steady(some, stable)
            fail(good, reasons)
            seen_at = [_examined_states(some, screws) for screws in stable.screws]
        else:
            q, s = (x[good] for x in poses[pose])
            modes, reasons = linearise(some, q, s)
            fail(good, reasons)
            seen_at = [(x[None], np.zeros(1)) for x in np.concatenate([q, s, np.zeros_like(q)], axis=1)]
        for column, value in enumerate(seen.modal.values):
            if value.pose == pose:
                columns[good, column], reasons = seen.modal.evaluate(value, some, modes, seen_at)
                fail(good, reasons)
    for pose in sorted(seen.linear_poses):
        good = np.flatnonzero(status == Status.OK)
        if seen.responses is None or not len(good):
            break
        if pose == "steady" and going is not None:
            numbers, found_values, reasons = seen.responses.evaluate_steady(still.select(good), going.select(good))
        else:
            q, s = (x[good] for x in poses[pose])
            numbers, found_values, reasons = seen.responses.evaluate(still.select(good), pose, q, s)
        columns[np.ix_(good, ends[4] + np.array(numbers, dtype=np.int64))] = found_values
        fail(good, reasons)
    if seen.needs_motion:
        given: Mapping[str, Array] = {} if trajectories is None else trajectories.scalars
        failed = [""] * count if trajectories is None else list(trajectories.messages)
        fail(np.arange(count), failed, Status.INTEGRATION_FAILED)
        for column, name in enumerate(seen.motion, start=len(seen.modal.values)):
            columns[:, column] = given.get(name, np.nan)
            if not any(column in reaching for reaching in seen.reaching):
                missing = np.isnan(columns[:, column])
                fail(np.arange(count), [f"its motion has no {name}" if x else "" for x in missing])
    good = np.flatnonzero(status == Status.OK)
    if seen.resting.names and len(good):
        q, s = (x[good] for x in poses["equilibrium"])
        columns[good, ends[1] : ends[2]] = _at_rest(still.select(good), seen.resting, q, s)
    good = np.flatnonzero(status == Status.OK)
    if seen.steady.names and going is not None and len(good):
        columns[good, ends[2] : ends[3]], reasons = _in_motion(still.select(good), seen.steady, going.select(good))
        fail(good, reasons)
    good = np.flatnonzero(status == Status.OK)
    if seen.summed.names and trajectories is not None and len(good):
        columns[good, ends[3] : ends[4]], lost = summarised(ensemble, seen.summed, trajectories, good)
        for member, reason in zip(good.tolist(), lost, strict=True):
            if reason is not None:
                name, expression = seen.summed_in[reason.number]
                message = f"output {name!r} {reason.fault}: the expression of {expression} {reason.text}"
                fail(np.array([member]), [message], reason.status)
    censored = np.zeros((count, len(seen.names)), dtype=bool)
    for k, reaching in enumerate(seen.reaching):
        censored[good, k] = np.isnan(columns[good][:, np.array(reaching, dtype=np.int64)]).any(axis=1)
    if never is not None:
        late = np.unique([x for reaching in seen.reaching for x in reaching]).astype(np.int64)
        columns[:, late] = np.where(np.isnan(columns[:, late]), never, columns[:, late])
    values = np.full((count, len(seen.names)), np.nan)
    if len(good):
        with np.errstate(all="ignore"):
            arguments = np.concatenate([columns[good], ensemble.values[good]], axis=1)
            values[good] = seen.kernel(np.ascontiguousarray(arguments))
    if never is None:
        values[censored] = np.nan
    wrong = ~np.isfinite(values) & ~censored
    fail(
        good,
        []
        if not wrong.any()
        else [
            f"output {seen.names[int(np.argmax(row))]!r} is not finite ({value[np.argmax(row)]:g})" if row.any() else ""
            for row, value in zip(wrong[good], values[good], strict=True)
        ],
        Status.NOT_FINITE,
    )
    failed = status != Status.OK
    values[failed], censored[failed] = np.nan, False
    return ScalarValues(values, status.astype(np.int64), tuple(messages), censored)


def _at_rest(ensemble: Batch, resting: OutputMap, q: Array, s: Array) -> Array:
    """Evaluate expressions in poses at rest, shape (K, expression)."""
    states = np.concatenate([q, s, np.zeros_like(q)], axis=1)
    return observe_along(ensemble, resting, np.array([ensemble.model.time]), states[:, None, :])[:, :, 0]


def _examined_states(ensemble: Batch, screws: Screws | None) -> tuple[Array, Array]:
    """Return states of a steady motion (S, width) at the examined times, and these times, s after the start."""
    if screws is None:
        return np.zeros((0, ensemble.model.layout.width)), np.zeros(0)
    after = np.array(screws.times)
    found = [screws.at(x) for x in after.tolist()]
    return np.array([np.concatenate([q, s, v]) for q, v, _, s, _ in found]), after


def _in_motion(ensemble: Batch, steady: OutputMap, motions: SteadyMotions) -> tuple[Array, list[str]]:
    """Evaluate expressions in steady motions, shape (K, expression); also return messages on varying expressions."""
    values, reasons = np.full((len(ensemble), len(steady.names)), np.nan), [""] * len(ensemble)
    for k, screws in enumerate(motions.screws):
        if screws is None:
            continue
        states, after = _examined_states(ensemble, screws)
        seen = observe(
            ensemble.select(np.array([k])), steady, states, ensemble.model.time + after, np.zeros(len(after), dtype=int)
        )
        values[k] = seen[0]
        change = np.ptp(seen, axis=0)
        moving = change > CHANGES * np.maximum(np.abs(seen).max(axis=0), 1e-3)
        if moving.any():
            i = int(np.argmax(moving))
            reasons[k] = (
                f"{steady.names[i].replace('AtSteady', 'at_steady')} changes during the steady motion, by "
                f"{change[i]:.3g} or more; use a quantity that remains constant, such as an angle between bodies, a "
                "height, or the norm of a vector"
            )
    return values, reasons
