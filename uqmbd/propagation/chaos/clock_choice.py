"""Choose the clock of a study from candidates, by their suitability for the realisations."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import sympy

from uqmbd.arguments import typechecked
from uqmbd.errors import StudyError
from uqmbd.mechanism import Mechanism
from uqmbd.propagation.chaos.clocks import TURN, Clock
from uqmbd.propagation.chaos.dense_output import Dense, dense
from uqmbd.propagation.problem import Problem

__all__ = ["choose_clock", "clock_at_means", "require_clock", "require_outputs_over_time", "watched_angles"]


WATCHED = "angle_of_"
"""Prefix of the name of a body or joint with a watched angle."""

ENOUGH = 0.5
"""Minimum share of realisations with a phase for a clock without full turns, and for the preference of full turns."""

EVEN = 0.3
"""Ratio of the smallest to the mean rate of a clock above which steadier clocks are not preferred."""


@typechecked
def watched_angles(mechanism: Mechanism) -> Mapping[str, Any]:
    """Return the angles of all bodies and joints with an angle, as expressions by name.

    Parameters
    ----------
    mechanism : Mechanism
        Mechanism of the study.

    Examples
    --------
    >>> import uqmbd
    >>> mechanism = uqmbd.Mechanism("wheel", uqmbd.Planar())
    >>> wheel = mechanism.body("wheel", mass=1, inertia=1)
    >>> uqmbd.extend.watched_angles(mechanism)
    {'angle_of_wheel': wheel.angle}
    """
    found: dict[str, Any] = {}
    parts: tuple[Any, ...] = (*mechanism.bodies.values(), *mechanism.components.values())
    for part in parts:
        angle = getattr(part, "angle", None)
        if isinstance(angle, sympy.Expr) and angle.free_symbols:
            found[WATCHED + part.name] = angle
    return found


@typechecked
def choose_clock(problem: Problem, found: Dense, end: float, wanted: str | None) -> tuple[Clock | None, str]:
    """Choose the clock that is suitable in most realisations; otherwise return the reason why there is no clock.

    An angle that turns in some realisations is preferred, although it may swing in others. An output that oscillates in
    all realisations also changes its motion at this transition. The further criteria, in this order, are: the
    largest number of realisations with a phase; a rate that is not very unsteady; an angle before another output; the
    steadiest rate; and the first of equal clocks.

    Parameters
    ----------
    problem : Problem
        Problem of the study.
    found : Dense
        Realisations with the watched outputs.
    end : float
        Last time of the study, s.
    wanted : str, optional
        Name of an output, a body or a joint; default: automatic choice.

    Returns
    -------
    clock : Clock or None
        Clock; None if no candidate has a phase.
    why : str
        Reason why there is no clock; otherwise empty.

    Raises
    ------
    uqmbd.StudyError
        If there is no output, body or joint of this name.

    Examples
    --------
    >>> import chaospy
    >>> import numpy as np
    >>> import uqmbd
    >>> from uqmbd_collocation import Collocation
    >>> speed = uqmbd.RandomVariable("speed", chaospy.Uniform(6, 7), units="rad/s")
    >>> mechanism = uqmbd.Mechanism("wheel", uqmbd.Planar())
    >>> wheel = mechanism.body("wheel", mass=1, inertia=1, angular_velocity=speed)
    >>> mechanism.output("angle", wheel.angle, units="rad")
    >>> study = uqmbd.Study("turning", mechanism, np.linspace(0, 2, 5), [Collocation(order=1)])
    >>> problem = study.problem(study.propagators[0])
    >>> found, realisations = uqmbd.extend.dense(problem.watching(), np.array([[6.0], [7.0]]), end=2.0)
    >>> clock, why = uqmbd.extend.choose_clock(problem, found, 2.0, None)
    >>> clock.name, why
    ('angle', '')
    """
    known = _candidates(problem)
    requested = known if wanted is None else [require_clock(problem, wanted)]
    good = np.isfinite(found.values).all(axis=(1, 2))
    if not good.any():
        return None, "all realisations failed"
    seen = Dense(found.times, found.values[good], found.error)
    fits = [_Fitness.of(clock, seen, end) for clock in requested]
    best = max(fits, key=lambda fit: fit.rank)
    if best.share >= ENOUGH or (best.turns and best.share > 0):
        return best.clock, ""
    others = [] if wanted is None else [_Fitness.of(clock, seen, end) for clock in known if clock.name != wanted]
    whole = [fit.clock for fit in others if fit.share == 1.0]
    text = f"{wanted!r} does not" if wanted else f"these quantities do not: {', '.join(repr(c.name) for c in known)}"
    why = f"the phase of a clock must advance by at least one turn or period, without stopping or reversing; {text}"
    if len(seen.values) > 1 and best.share:
        count = round(best.share * len(seen.values))
        why += f" (at best {best.clock.words}, in {count} of {len(seen.values)} realisations)"
    return None, why + (f", but {whole[0].words} meets this condition in all realisations" if whole else "")


@typechecked
def clock_at_means(problem: Problem, wanted: str | None = None) -> str:
    """Integrate the realisation at the means of the inputs, and describe its clock.

    Parameters
    ----------
    problem : Problem
        Problem of the study.
    wanted : str, optional
        Name of an output, a body or a joint; default: automatic choice.

    Returns
    -------
    str
        Sentence without the final full stop.

    Raises
    ------
    uqmbd.StudyError
        If there is no output, body or joint of this name.

    Examples
    --------
    A wheel that turns by 6.5 rad/s at the mean of its speed:

    >>> import chaospy
    >>> import numpy as np
    >>> import uqmbd
    >>> from uqmbd_collocation import Collocation
    >>> speed = uqmbd.RandomVariable("speed", chaospy.Uniform(6, 7), units="rad/s")
    >>> mechanism = uqmbd.Mechanism("wheel", uqmbd.Planar())
    >>> wheel = mechanism.body("wheel", mass=1, inertia=1, angular_velocity=speed)
    >>> mechanism.output("angle", wheel.angle, units="rad")
    >>> study = uqmbd.Study("turning", mechanism, np.linspace(0, 2, 5), [Collocation(order=1)])
    >>> problem = study.problem(study.propagators[0])
    >>> print(uqmbd.extend.clock_at_means(problem))
    the clock is the angle 'angle' at the means of the inputs, 2.07 turns until the last output time
    """
    end = float(problem.times[-1])
    found, realised = dense(problem.watching(), problem.inputs.means[None], end, 2 * len(problem.times))
    if not realised.good.all():
        return (
            f"no clock can be selected, because the realisation at the means failed: {realised.most_frequent_reason()}"
        )
    clock, why = choose_clock(problem, found, end, wanted)
    if clock is None:
        return f"no clock at the means of the inputs: {why}"
    phase = clock.phases(found).values[0]
    return (
        f"the clock is {clock.words} at the means of the inputs, {(phase[-1] - phase[0]) / TURN:.3g} turns until the "
        "last output time"
    )


@dataclass(frozen=True)
class _Fitness:
    """Suitability of a clock: shares of realisations with a phase and with full turns, and steadiness."""

    clock: Clock
    share: float
    turns: float
    angle: bool
    steadiness: float

    @classmethod
    def of(cls, clock: Clock, seen: Dense, end: float) -> _Fitness:
        forwards = clock.fitted(seen)
        runs = np.stack([kind.phases(seen).running(end) for kind in forwards.kinds])
        share, turns = float(runs.any(axis=0).mean()), float(runs[:2].any(axis=0).mean()) if clock.turn else 0.0
        # an angle without full turns is an oscillation
        if clock.turn and not turns:
            forwards = replace(clock, turn=0.0).fitted(seen)
        return cls(forwards, share, turns, bool(clock.turn), forwards.phases(seen).steadiness(end))

    @property
    def rank(self) -> tuple[bool, float, bool, bool, float]:
        # values are rounded: the first of clocks that differ only by rounding is preferred
        common, even = self.turns > 0 and self.share >= ENOUGH, self.steadiness >= EVEN
        return common, round(self.share, 3), even, self.angle, round(self.steadiness, 1)


@typechecked
def require_outputs_over_time(problem: Problem, option: str) -> None:
    """Reject an option that has no effect on scalar outputs if a study has no other outputs.

    Parameters
    ----------
    problem : uqmbd.extend.Problem
        Problem of the study.
    option : str
        Option as given, such as ``alignment='phase'``.

    Raises
    ------
    uqmbd.StudyError
        If all outputs are scalar outputs.

    Examples
    --------
    >>> import chaospy
    >>> import numpy as np
    >>> import uqmbd
    >>> from uqmbd_collocation import Collocation
    >>> speed = uqmbd.RandomVariable("speed", chaospy.Uniform(6, 7), units="rad/s")
    >>> mechanism = uqmbd.Mechanism("wheel", uqmbd.Planar())
    >>> wheel = mechanism.body("wheel", mass=1, inertia=1, angular_velocity=speed)
    >>> mechanism.output("most", uqmbd.maximum(wheel.angle), units="rad")
    >>> study = uqmbd.Study("turning", mechanism, np.linspace(0, 2, 5), [Collocation(order=1)])
    >>> problem = study.problem(study.propagators[0])
    >>> try:
    ...     uqmbd.extend.require_outputs_over_time(problem, "alignment='phase'")
    ... except uqmbd.StudyError as error:
    ...     print(str(error)[:57])
    collocation: alignment='phase' applies to outputs over ti
    """
    if not problem.model.outputs.names:
        raise StudyError(
            f"{problem.label}: {option} applies to outputs over time, but the study has only scalar outputs; omit it."
        )


@typechecked
def require_clock(problem: Problem, wanted: str) -> Clock:
    """Return the clock of a name.

    Parameters
    ----------
    problem : Problem
        Problem of the study.
    wanted : str
        Name of an output, a body or a joint.

    Raises
    ------
    uqmbd.StudyError
        If there is no output, body or joint of this name.

    Examples
    --------
    >>> import chaospy
    >>> import numpy as np
    >>> import uqmbd
    >>> from uqmbd_collocation import Collocation
    >>> speed = uqmbd.RandomVariable("speed", chaospy.Uniform(6, 7), units="rad/s")
    >>> mechanism = uqmbd.Mechanism("wheel", uqmbd.Planar())
    >>> wheel = mechanism.body("wheel", mass=1, inertia=1, angular_velocity=speed)
    >>> mechanism.output("angle", wheel.angle, units="rad")
    >>> study = uqmbd.Study("turning", mechanism, np.linspace(0, 2, 5), [Collocation(order=1)])
    >>> problem = study.problem(study.propagators[0])
    >>> uqmbd.extend.require_clock(problem, "angle").words
    "the angle 'angle'"
    >>> try:
    ...     uqmbd.extend.require_clock(problem, "height")
    ... except uqmbd.StudyError as error:
    ...     print(str(error)[:33])
    collocation: clock is 'height'; e
    """
    known = {clock.name: clock for clock in reversed(_candidates(problem))}
    if wanted not in known:
        raise StudyError(
            f"{problem.label}: clock is {wanted!r}; expected the name of an output, or of a body or joint that has an "
            f"angle: {', '.join(map(repr, reversed(known)))}."
        )
    return known[wanted]


def _candidates(problem: Problem) -> list[Clock]:
    """Return all candidates for the clock: outputs, then the watched angles."""
    outputs = problem.labels.outputs
    watched = enumerate(o.name for o in problem.watching().labels.outputs)
    return [
        *(Clock(o.name, k, _turn(o.units, o.turn)) for k, o in enumerate(outputs)),
        # a method may also watch other expressions than angles
        *(Clock(x.removeprefix(WATCHED), k, TURN) for k, x in watched if k >= len(outputs) and x.startswith(WATCHED)),
    ]


def _turn(units: str, turn: float) -> float:
    if turn:
        return turn
    return {"rad": TURN, "deg": 360.0}.get(units, 0.0)
