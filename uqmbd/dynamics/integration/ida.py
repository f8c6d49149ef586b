"""Integration of the stabilised index-2 form by IDA (SUNDIALS, through scikit-sundae), many realisations in one stack.

Realisations of a stack share the steps, and the error norm of IDA averages over them. A realisation with much larger
local errors than the others is therefore less accurate in a stack than alone. The loss is at most the ratio of its
local errors to their mean over the stack. If the loss is too large, the realisation is removed and integrated alone.

IDA satisfies the tolerance in each step, averaged over all unknowns.  Without damping, velocity errors accumulate over
a hundred steps per turn of a body.  The sum of these errors shifts the phase at a growing rate.  If only one of
many bodies rotates, the average over resting bodies and multipliers, which have no errors, hides its errors.  The
tolerance of a step is therefore a small part of the tolerance of the motion (`step_tolerance`).
"""

from __future__ import annotations

import time as clock
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np

from uqmbd.compiled import RecordedSteps
from uqmbd.dynamics.assembly import ahead, dead_end, rank_along
from uqmbd.dynamics.batch import Batch
from uqmbd.dynamics.equations import Model
from uqmbd.dynamics.integration.costs import implicit_costs
from uqmbd.dynamics.integration.intervals import pace, times_between
from uqmbd.dynamics.integration.prescribed import instant
from uqmbd.dynamics.integration.restarts import speed_jumps
from uqmbd.dynamics.integration.slow_progress import Pace
from uqmbd.dynamics.integration.steps import interpolate_steps, projected_steps
from uqmbd.dynamics.integration.sundials import SundialsSolution, solve
from uqmbd.dynamics.integration.trajectories import Counters, Solved
from uqmbd.dynamics.linear import accelerations
from uqmbd.typing import Array, Index

__all__ = ["RELAXED", "STEPS", "diagnosis", "integrate_by_ida", "can_finish_with_ida", "step_limits", "step_tolerance"]

Callbacks = tuple[Callable[..., None], Callable[..., None]]

RELAXED = 1e8
"""Absolute tolerance of multipliers: the error test ignores them, and the Newton iteration nearly ignores them."""

STEP_SHARE = 0.02
"""Part of the tolerance for one unknown in a step.  In tests with rotors, pendulums, a governor and a slider-crank, the
errors of ten turns are then ten to a hundred tolerances.  This factor doubles the number of steps."""

LEAST_TOLERANCE = 1e-13
"""Smallest tolerance of a step; below it, rounding dominates the errors."""

SPARSE_FROM = 150
"""Least number of unknowns for a sparse factorisation."""

OUTLIER = 2.5
"""Roughness, relative to its root mean square over the stack, above which a realisation is integrated alone."""

STEPS = 200_000
"""Largest number of steps between two output times."""


@dataclass(frozen=True)
class _StackIntegration:
    """Integration of a stack: states, and the reason of an early stop."""

    states: Array
    message: str
    counters: Counters
    singular: bool = False
    path: RecordedSteps | None = None


def integrate_by_ida(
    ensemble: Batch,
    members: Index,
    times: Array,
    rtol: float,
    most: float | None = None,
    *,
    recording: bool = False,
) -> Solved:
    """Integrate the assembled realisations `members` (M,) of a batch by IDA.

    If the cost exceeds `most`, by counts, the remaining realisations have a message.  With `recording`, the motion
    between the output times is also returned.
    """
    budget = None if most is None else _CostBudget(most)
    states = np.full((len(members), len(times), ensemble.model.layout.width), np.nan)
    messages, final = [""] * len(members), [False] * len(members)
    counters, paths = Counters(), dict[int, RecordedSteps]()
    todo = [np.arange(len(members))]
    while todo:
        part = todo.pop(0)
        try:
            run = _integrate_stack(ensemble.select(members[part]), times, rtol, budget, recording=recording)
        except _TooExpensiveError:
            for k in np.concatenate([part, *todo]).tolist():
                messages[k] = "implicit steps cost more than explicit ones"
            counters = counters + Counters(integrations=1)
            break
        counters = counters + run.counters
        if run.message and len(part) > 1:
            # the failed realisation is unknown: halve the stack until it is alone
            half = len(part) // 2
            todo = [part[:half], part[half:], *todo]
            continue
        states[part] = run.states
        if run.path is not None:  # realisations integrated alone later start again
            paths |= {int(k): run.path.placed(np.where(part == k, k, -1)) for k in part}
        if run.message:
            messages[part[0]], final[part[0]] = run.message, run.singular
        if len(part) > 1:
            rough = _roughness(ensemble, run.states)
            hard = part[rough > OUTLIER * np.sqrt(np.mean(rough**2))]
            todo = [*(np.array([k]) for k in hard), *todo]
            counters = counters + Counters(alone=len(hard))
    if budget is not None:
        counters = replace(counters, residuals=budget.residuals, jacobians=budget.jacobians)
    return Solved(states, tuple(messages), counters, tuple(final), path=RecordedSteps.joined(paths.values()))


def can_finish_with_ida(ensemble: Batch, times: Array, rtol: float, most: float) -> tuple[bool, Counters]:
    """Return whether IDA integrates the only realisation of a batch to the last time within a given cost."""
    budget = _CostBudget(most)
    try:
        reached = not _integrate_stack(ensemble, times, rtol, budget).message
    except _TooExpensiveError:
        reached = False
    return reached, Counters(budget.residuals, budget.jacobians, 1)


class _TooExpensiveError(Exception):
    """The cost of an integration exceeds its limit."""


class _CostBudget:
    """Budget for evaluations of residuals and Jacobians, in operations."""

    def __init__(self, most: float) -> None:
        self.left, self.residuals, self.jacobians = most, 0, 0

    def limited(self, ensemble: Batch, callbacks: Callbacks) -> Callbacks:
        """Return callbacks of a stack that consume the budget."""
        count, (residual, jacobian) = len(ensemble), callbacks
        sparse = count * ensemble.model.layout.unknowns >= SPARSE_FROM
        residual_cost, jacobian_cost = implicit_costs(ensemble.model, count, sparse=sparse)

        def counted_residual(t: float, y: Array, yp: Array, res: Array) -> None:
            self.residuals += 1
            self._spend(residual_cost)
            residual(t, y, yp, res)

        def counted_jacobian(t: float, y: Array, yp: Array, res: Array, c: float, jac: Array) -> None:
            self.jacobians += 1
            self._spend(jacobian_cost)
            jacobian(t, y, yp, res, c, jac)

        return counted_residual, counted_jacobian

    def _spend(self, cost: float) -> None:
        self.left -= cost
        if self.left < 0:
            raise _TooExpensiveError


def _watched(ensemble: Batch, callbacks: Callbacks, pace: Pace) -> Callbacks:
    """Return callbacks of a stack that monitor its progress."""
    (residual, jacobian), calls = callbacks, 0

    def watched(t: float, y: Array, yp: Array, res: Array) -> None:
        nonlocal calls
        calls += 1
        if pace.due and np.isfinite(y).all():
            states = np.concatenate(ensemble.expand(np.reshape(y, (len(ensemble), -1))), axis=1)
            member = int(np.argmax(np.abs(states[:, ensemble.model.layout.velocities :]).max(axis=1, initial=0.0)))
            # a step needs about two residuals
            pace.check(t, states[member], calls // 2)
        residual(t, y, yp, res)

    return watched, jacobian


def step_tolerance(rtol: float, unknowns: int) -> float:
    """Return the relative tolerance of a step for a motion with an accuracy of about `rtol`.

    The norm of the errors is an average over `unknowns`: the number for one realisation, or for all coupled ones.  The
    error of a single unknown may exceed the norm by the square root of this number.

    >>> step_tolerance(1e-6, 16), step_tolerance(1e-13, 16)
    (5e-09, 1e-13)
    """
    return min(rtol, max(STEP_SHARE * rtol / float(np.sqrt(unknowns)), LEAST_TOLERANCE))


def _integrate_stack(
    ensemble: Batch, times: Array, rtol: float, budget: _CostBudget | None = None, *, recording: bool = False
) -> _StackIntegration:
    """Integrate a stack through all its break times."""
    start = ensemble.start
    width = ensemble.model.layout.width
    result = np.full((len(ensemble), len(times), width), np.nan)
    result[:, 0] = start.state
    if not ensemble.model.layout.unknowns:  # no body can move
        result[:] = result[:, :1]
        still = (
            interpolate_steps(times[[0, -1]], result[:, [0, -1]], None, np.arange(len(ensemble))) if recording else None
        )
        return _StackIntegration(result, "", Counters(), path=still)
    y = ensemble.pack(start.q, start.s, start.v, start.multipliers)
    yp = ensemble.pack(start.v, start.rates, start.a, np.zeros_like(start.multipliers))
    counters = Counters()
    callbacks = _watched(ensemble, stack_callbacks(ensemble), Pace(ensemble.model, float(times[0]), float(times[-1])))
    if budget is not None:
        callbacks = budget.limited(ensemble, callbacks)
    now, paths = float(times[0]), list[RecordedSteps]()
    for stop, longest, _ in pace(ensemble, times, rtol):
        inside, grid = times_between(times, now, stop)
        if ensemble.breaks.size or now > times[0]:
            y, yp, refused = _consistent(ensemble, now, y, rtol)
            result[:, np.flatnonzero(times[1:] == now) + 1] = np.concatenate(ensemble.expand(y[:, None]), axis=2)
            if refused:
                return _StackIntegration(result, next(iter(refused.values())), counters, True)
        begin = clock.perf_counter()
        solution = _solved(ensemble, callbacks, grid, y, yp, rtol, longest, recording=recording)
        spent = clock.perf_counter() - begin
        counters = counters + Counters(solution.residuals, solution.jacobians, 1, seconds=spent)
        found = solution.y.reshape(len(solution.t), len(ensemble), -1)
        reached = len(found) if solution.success else len(found) - 1
        where = np.searchsorted(grid, times[inside])
        done = where < reached
        result[:, inside[done]] = np.concatenate(ensemble.expand(found[where[done]].transpose(1, 0, 2)), axis=2)
        if not solution.success or reached < len(grid):
            last = float(solution.t[-1]) if len(solution.t) else now
            dead = _dead_end(ensemble, found, last)
            reason = dead or _undefined_term(ensemble, found, last, float(times[-1])) or diagnosis(solution, last, rtol)
            return _StackIntegration(result, reason, counters, bool(dead))
        if solution.steps is not None:
            paths.append(_path(ensemble, *solution.steps))
        now, y = stop, found[-1].copy()
    return _StackIntegration(result, "", counters, path=RecordedSteps.joined(paths))


def _path(ensemble: Batch, times: Array, y: Array, yp: Array) -> RecordedSteps:
    """Return the motion of a stack as polynomials through the steps of an integration.

    Rates are from the method: for stiff equations these rates are as smooth as the states, in contrast to rates from
    the equations.
    """
    shape = (len(times), len(ensemble), -1)
    states, rates = (np.concatenate(ensemble.expand(x.reshape(shape).transpose(1, 0, 2)), axis=2) for x in (y, yp))
    layout = ensemble.model.layout
    rates[:, :, layout.frozen] = 0.0
    path = interpolate_steps(times, states, rates, np.arange(len(ensemble)))
    return path._replace(states=projected_steps(ensemble, path.owner, path.ends, path.states))


def _dead_end(ensemble: Batch, found: Array, time: float) -> str:
    """Return a message on equations that become dependent where one realisation stopped; empty if there are none."""
    if len(ensemble) > 1 or not len(found):
        return ""
    (q, s, v), model = ensemble.expand(found[-1]), ensemble.model
    if not np.isfinite(found[-1]).all():
        return ""
    return dead_end(model, time, rank_along(model, q[0], s[0], v[0], time, ensemble.parameters[0]), final=False)


def _undefined_term(ensemble: Batch, found: Array, time: float, stop: float) -> str:
    """Return the name of the term that becomes undefined at the stop of one realisation."""
    if len(ensemble) > 1 or not len(found) or not np.isfinite(found[-1]).all():
        return ""
    q, s, v = ensemble.expand(found[-1])
    return ahead(ensemble.model, (q[0], s[0], v[0]), (time, stop), ensemble.parameters[0])


def _consistent(ensemble: Batch, time: float, y: Array, rtol: float) -> tuple[Array, Array, dict[int, str]]:
    """Return consistent unknowns and rates an instant after the start of a segment, where forces may jump."""
    q, s, v = ensemble.expand(y)
    change, refused = speed_jumps(ensemble.model, np.concatenate([q, s, v], axis=1), time, ensemble.block, rtol)
    v = v + change
    a, multipliers, rates = accelerations(ensemble.model, q, s, v, time + instant(time), ensemble.block)
    y, yp = ensemble.pack(q, s, v, multipliers), ensemble.pack(v, rates, a, np.zeros_like(multipliers))
    return y, yp, refused


def _roughness(ensemble: Batch, states: Array) -> Array:
    """Return the relative size of the local errors of the realisations of a stack.

    The realisations share steps and order, so their local errors are proportional to high derivatives: fourth
    differences of the coordinates between output times.
    """
    n = ensemble.model.layout.coordinates
    differences = np.diff(states[:, :, :n], n=min(4, states.shape[1] - 1), axis=1)
    rough: Array = np.sqrt(np.mean(differences**2, axis=(1, 2)))
    return rough


def _solved(
    ensemble: Batch,
    callbacks: Callbacks,
    times: Array,
    y: Array,
    yp: Array,
    rtol: float,
    longest: float,
    *,
    recording: bool,
) -> SundialsSolution:
    """Integrate a stack over times without a break."""
    model = ensemble.model
    residual, jacobian = callbacks
    length = max(1e-3, float(np.abs(y[:, model.layout.slices["q"]]).max(initial=0.0)))
    rtol = step_tolerance(rtol, model.layout.unknowns)
    atol = np.full(model.layout.unknowns, rtol * min(1.0, length))
    atol[model.layout.differential :] = RELAXED
    options: dict[str, Any] = {"linsolver": "dense", "jacfn": jacobian}
    if y.size >= SPARSE_FROM:
        options |= {"linsolver": "sparse", "sparsity": _sparsity(model, len(ensemble))}
    limits = {"rtol": rtol, "atol": np.tile(atol, len(ensemble)), **step_limits(times, longest)}
    return solve(residual, options, times, y.ravel(), yp.ravel(), recording=recording, **limits)


def step_limits(times: Array, longest: float) -> dict[str, Any]:
    """Return IDA's step limits; a short longest step raises the allowed number of steps between output times."""
    if not np.isfinite(longest):
        return {"max_num_steps": STEPS}
    return {"max_num_steps": STEPS + int(float(np.diff(times).max()) / longest), "max_step": longest}


def stack_callbacks(ensemble: Batch) -> Callbacks:
    """Return residual and Jacobian in the form for IDA.

    scikit-sundae 1.1 calls only Python functions, not C functions, and always with the same arrays. The compiled
    programs read and write these arrays in place.
    """
    size = len(ensemble) * ensemble.model.layout.unknowns
    residual, derivatives = _Evaluation(ensemble, "residual", 1), _Evaluation(ensemble, "jacobian", 2)

    def residuals(t: float, y: Array, yp: Array, res: Array) -> None:
        residual(y, yp, res, t)

    def sparse(t: float, y: Array, yp: Array, res: Array, c: float, jac: Array) -> None:
        derivatives(y, yp, jac, t, c)

    if size >= SPARSE_FROM:
        return residuals, sparse
    rows, pointers = ensemble.model.pattern
    columns = np.repeat(np.arange(ensemble.model.layout.unknowns), np.diff(pointers))
    first = ensemble.model.layout.unknowns * np.arange(len(ensemble))[:, None]
    places = ((rows + first) * size + columns + first).ravel()
    values = np.empty(len(places))

    def dense(t: float, y: Array, yp: Array, res: Array, c: float, jac: Array) -> None:
        derivatives(y, yp, values, t, c)
        jac.reshape(-1)[places] = values

    return residuals, dense


class _Evaluation:
    """Evaluator of the residual or Jacobian of all realisations of a stack.

    After unknowns and rates there are `numbers` further arguments: the time, and the factor of the derivatives with
    respect to rates.
    """

    def __init__(self, ensemble: Batch, kind: Literal["residual", "jacobian"], numbers: int) -> None:
        layout = ensemble.model.layout
        self.shape, self.rates = (len(ensemble), layout.unknowns), layout.differential
        self.tail = np.zeros((1, numbers + 1))  # the last entry stays zero
        self.others = (self.tail, ensemble.frozen, ensemble.block)
        width = layout.unknowns + layout.differential + numbers + 1 + ensemble.frozen.shape[1]
        self.program = ensemble.model.evaluators[kind].program(width, ensemble.block.shape[1])
        self.places: tuple[Array, ...] = ()
        self.call: Callable[[], object] = tuple

    def __call__(self, y: Array, yp: Array, out: Array, *numbers: float) -> None:
        """Evaluate at unknowns and rates (K n,), into an array (K result,)."""
        if not self.places or y is not self.places[0] or yp is not self.places[1] or out is not self.places[2]:
            rates = yp.reshape(self.shape)[:, : self.rates]
            self.call = self.program.bound(
                y.reshape(self.shape), rates, *self.others, out=out.reshape(self.shape[0], -1)
            )
            self.places = (y, yp, out)
        self.tail[0, : len(numbers)] = numbers
        self.call()


def _sparsity(model: Model, copies: int) -> Any:
    """Return the sparsity pattern of `copies` independent realisations, compressed by columns."""
    from scipy import sparse

    rows, pointers = model.pattern
    one = sparse.csc_matrix((np.ones(len(rows)), rows, pointers), shape=(model.layout.unknowns,) * 2)
    return one if copies == 1 else sparse.block_diag([one] * copies, format="csc")


def diagnosis(solution: SundialsSolution, time: float, rtol: float) -> str:
    """Return the reason why IDA stopped, and a remedy."""
    if solution.too_much_work:
        cause = "too many steps: the motion is very stiff or very fast for the output times"
    else:
        cause = "the steps became too small: a singular pose, a stop or an impact, or a force that "
        cause += "jumps or grows without bound"
    return (
        f"the integration stopped at t = {time:.6g} s ({solution.message}); probably {cause}. "
        f"Try another rtol (now {rtol:g}), or inspect the motion up to that time."
    )
