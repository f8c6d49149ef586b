"""Which clock tells the phase: what may be one in a study, and what suits realisations best."""

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
"""Before the name of a body or joint whose angle is watched."""

ENOUGH = 0.5
"""Share of realisations in which an oscillation tells the phase, at least, for it to be one of the mechanism."""

EVEN = 0.3
"""Least rate of a clock, over its mean one, from which it is no worse than steadier ones."""


@typechecked
def watched_angles(mechanism: Mechanism) -> Mapping[str, Any]:
    """Return the angles of all bodies and joints that have one, by the names of these, as expressions.

    Parameters
    ----------
    mechanism : Mechanism
        Of the study.

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
    """Choose what tells the phase in all realisations, or as many as possible; else say why there is none.

    What turns in some realisations comes first, also where it swings in others: another output that oscillates in all
    of them changes its motion there, too.  Then what tells the phase in most realisations, angles before others, the
    steadier, and the first of equals; one that is very unsteady comes behind.

    Parameters
    ----------
    problem : Problem
        That of the study.
    found : Dense
        Realisations, with what is watched.
    end : float
        Last time of the study, s.
    wanted : str, optional
        Name of an output, a body or a joint; default: whatever serves.

    Returns
    -------
    clock : Clock or None
        None: nothing tells the phase.
    why : str
        Why not, or empty.

    Raises
    ------
    uqmbd.StudyError
        If there is nothing of the wanted name.

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
    >>> found, told = uqmbd.extend.dense(problem.watching(), np.array([[6.0], [7.0]]), end=2.0)
    >>> clock, why = uqmbd.extend.choose_clock(problem, found, 2.0, None)
    >>> clock.name, why
    ('angle', '')
    """
    known = _candidates(problem)
    asked = known if wanted is None else [require_clock(problem, wanted)]
    good = np.isfinite(found.values).all(axis=(1, 2))
    if not good.any():
        return None, "all realisations failed"
    seen = Dense(found.times, found.values[good], found.error)
    fits = [_Fitness.of(clock, seen, end) for clock in asked]
    best = max(fits, key=lambda fit: fit.rank)
    if best.share >= ENOUGH or (best.turns and best.share > 0):
        return best.clock, ""
    others = [] if wanted is None else [_Fitness.of(clock, seen, end) for clock in known if clock.name != wanted]
    whole = [fit.clock for fit in others if fit.share == 1.0]
    said = f"neither does {wanted!r}" if wanted else f"none of {', '.join(repr(c.name) for c in known)} does"
    why = f"a clock turns or swings on, without standing or turning back, for a turn at least; {said}"
    if len(seen.values) > 1 and best.share:
        count = round(best.share * len(seen.values))
        why += f" (at best {best.clock.words}, in {count} of {len(seen.values)} realisations)"
    return None, why + (f", but {whole[0].words} does so in all realisations" if whole else "")


@typechecked
def clock_at_means(problem: Problem, wanted: str | None = None) -> str:
    """Follow the realisation at the means of the inputs, and say which clock it has, in words.

    Parameters
    ----------
    problem : Problem
        That of the study.
    wanted : str, optional
        Name of an output, a body or a joint; default: whatever serves.

    Returns
    -------
    str
        A sentence, without its full stop.

    Raises
    ------
    uqmbd.StudyError
        If there is nothing of the wanted name.

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
    found, told = dense(problem.watching(), problem.inputs.means[None], end, 2 * len(problem.times))
    if not told.good.all():
        return f"no clock can be found, for the realisation at the means fails: {told.most_frequent_reason()}"
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
    """How well a clock tells the phase: in which share of realisations, in which of them by turning, how steadily."""

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
        # an angle that never turns is an oscillation
        if clock.turn and not turns:
            forwards = replace(clock, turn=0.0).fitted(seen)
        return cls(forwards, share, turns, bool(clock.turn), forwards.phases(seen).steadiness(end))

    @property
    def rank(self) -> tuple[bool, float, bool, bool, float]:
        # rounded: of clocks that differ by rounding the first is taken
        common, even = self.turns > 0 and self.share >= ENOUGH, self.steadiness >= EVEN
        return common, round(self.share, 3), even, self.angle, round(self.steadiness, 1)


@typechecked
def require_outputs_over_time(problem: Problem, option: str) -> None:
    """Refuse an option that means nothing for outputs without a time, where a study has no others.

    Parameters
    ----------
    problem : uqmbd.extend.Problem
        That of the study.
    option : str
        As it was given, ``alignment='phase'``.

    Raises
    ------
    uqmbd.StudyError
        If all outputs are without a time.

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
    collocation: alignment='phase' is about outputs over time
    """
    if not problem.model.outputs.names:
        raise StudyError(
            f"{problem.label}: {option} is about outputs over time, and the study has only such without a time; leave "
            "it out."
        )


@typechecked
def require_clock(problem: Problem, wanted: str) -> Clock:
    """Return the clock of a name.

    Parameters
    ----------
    problem : Problem
        That of the study.
    wanted : str
        Name of an output, a body or a joint.

    Raises
    ------
    uqmbd.StudyError
        If there is nothing of that name.

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
    """Return whatever may be a clock: outputs, then the angles that are watched."""
    outputs = problem.labels.outputs
    watched = enumerate(o.name for o in problem.watching().labels.outputs)
    return [
        *(Clock(o.name, k, _turn(o.units, o.turn)) for k, o in enumerate(outputs)),
        # a method may watch more than angles
        *(Clock(x.removeprefix(WATCHED), k, TURN) for k, x in watched if k >= len(outputs) and x.startswith(WATCHED)),
    ]


def _turn(units: str, turn: float) -> float:
    if turn:
        return turn
    return {"rad": TURN, "deg": 360.0}.get(units, 0.0)
