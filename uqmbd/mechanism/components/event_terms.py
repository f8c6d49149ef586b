"""Terms of a component for events: impacts, marks, dry friction, and gaps that are open at the start."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from uqmbd.arguments import typechecked

__all__ = ["DryFriction", "Event", "Impact", "Separation"]


@typechecked
@dataclass(frozen=True)
class Impact:
    """Jump of velocities at an impact: Newton's law of restitution with Coulomb friction.

    Parameters
    ----------
    speed : expression
        Opening rate of the gap, m/s (``p.rate_of(gap)``), linear in the velocities. The impact multiplies this rate by
        ``-restitution``.
    restitution : expression
        Coefficient of restitution, from 0 (bodies stay together) to 1.
    sliding : expression, or vector of expressions
        Relative velocity along the surface, m/s, linear in the velocities. Optional without friction.
    friction : expression
        Coefficient of friction, for impulses and for forces during contact.

    Examples
    --------
    A ball falls 1 m to a floor, rebounds with half of its speed, and rises to a quarter of the height:

    >>> import uqmbd
    >>> class Floor(uqmbd.Component):
    ...     bodies, spaces = ("body",), (uqmbd.Line,)
    ...     def terms(self, p):
    ...         gap = p.let("gap", p.body.position[0])
    ...         yield uqmbd.Event(gap, uqmbd.extend.Impact(p.rate_of(gap), restitution=0.5))
    >>> mechanism = uqmbd.Mechanism("ball", uqmbd.Line(gravity=-2))
    >>> ball = mechanism.body("ball", mass=1, position=1)
    >>> floor = mechanism.add(Floor("floor", ball))
    >>> mechanism.output("height", ball.position[0], units="m")
    >>> round(float(uqmbd.simulate(mechanism, [0, 1, 1.5])["height"][-1]), 4)
    0.25
    """

    speed: Any
    restitution: Any = 0
    sliding: Any = ()
    friction: Any = 0


@typechecked
@dataclass(frozen=True)
class Event:
    """Event at a zero crossing of an expression from positive to negative values.

    The integrator locates the time of the event. `Component.event_time` returns the symbol of this time for outputs. An
    event that does not occur is no failure: the motion continues without a jump, and the time is censored.

    Parameters
    ----------
    guard : expression
        Expression whose zero crossing is the event, in coordinates, velocities, states and time. For an impact: the
        gap, m.
    jump : Impact, optional
        Jump of the velocities at the event. Default: none, so that only the time of the event is recorded.
    label : str
        Name of the event.

    Examples
    --------
    A ball bounces on a floor, and an output records the time of the impact:

    >>> import uqmbd
    >>> class Floor(uqmbd.Component):
    ...     bodies, spaces = ("body",), (uqmbd.Line,)
    ...     def terms(self, p):
    ...         gap = p.let("gap", p.body.position[0])
    ...         yield uqmbd.Event(gap, uqmbd.extend.Impact(p.rate_of(gap), restitution=1))
    >>> mechanism = uqmbd.Mechanism("ball", uqmbd.Line(gravity=-9.81))
    >>> ball = mechanism.body("ball", mass=1, position=1)
    >>> floor = mechanism.add(Floor("floor", ball))
    >>> mechanism.output("first", floor.event_time("impact"), units="s")
    >>> round(float(uqmbd.simulate(mechanism, [0, 0.5])["first"]), 4)  # sqrt(2 / 9.81)
    0.4515
    """

    guard: Any
    jump: Impact | None = None
    label: str = "impact"


@typechecked
@dataclass(frozen=True)
class DryFriction:
    """Coulomb friction with a given largest force, as in a joint or a brake; it sticks up to this force.

    The events ``stick`` and ``slip`` are recorded. A limit that falls to zero releases the friction (``lift-off``)
    until it is positive again (``rest``).

    Parameters
    ----------
    limit : expression
        Largest force, N, or moment, N m, in parameters, time and states. A negative limit counts as zero.
    sliding : expression, or vector of expressions
        Relative speed against which the friction acts, m/s or rad/s, linear in the velocities.

    Examples
    --------
    A block on a floor is pulled by a growing force, and slips at 3 N:

    >>> import uqmbd
    >>> class Floor(uqmbd.Component):
    ...     bodies, spaces = ("body",), (uqmbd.Line,)
    ...     def terms(self, p):
    ...         yield uqmbd.VirtualWork(2 * p.time, p.body.velocity[0])
    ...         yield uqmbd.extend.DryFriction(3, p.body.velocity[0])
    >>> mechanism = uqmbd.Mechanism("pull", uqmbd.Line())
    >>> block = mechanism.body("block", mass=1, velocity=0)
    >>> floor = mechanism.add(Floor("floor", block))
    >>> mechanism.output("slips", floor.event_time("slip"), units="s")
    >>> mechanism.output("x", block.position[0], units="m")
    >>> found = uqmbd.simulate(mechanism, [0, 1, 2.5])
    >>> round(float(found["slips"]), 6), found["x"].values.round(6).tolist()  # (t - 1.5)^3 / 3
    (1.5, [0.0, 0.0, 0.333333])
    """

    limit: Any
    sliding: Any


@typechecked(values=False)
@dataclass(frozen=True)
class Separation:
    """Gap between bodies that is open, or almost open, at the start of a motion.

    The gap does not affect the motion; a `uqmbd.StudyWarning` reports a large overlap at the start.

    Parameters
    ----------
    gap : expression
        Gap, m, in coordinates and time; negative if the bodies overlap.
    reach : expression
        Depth in m above which an overlap counts as large, such as a radius. The upper limit is a tenth of the size of
        the mechanism; 0 means this limit.

    Examples
    --------
    A warning reports a wall that overlaps a ball at the start; the wall has no effect:

    >>> import warnings
    >>> import uqmbd
    >>> class Wall(uqmbd.Component):
    ...     bodies, spaces = ("body",), (uqmbd.Line,)
    ...     def terms(self, p):
    ...         yield uqmbd.extend.Separation(p.body.position[0], reach=0.01)
    >>> mechanism = uqmbd.Mechanism("ball", uqmbd.Line())
    >>> ball = mechanism.body("ball", mass=1, position=-0.5)
    >>> wall = mechanism.add(Wall("wall", ball))
    >>> mechanism.output("x", ball.position[0], units="m")
    >>> with warnings.catch_warnings(record=True) as seen:
    ...     warnings.simplefilter("always")
    ...     motion = uqmbd.simulate(mechanism, [0, 1])
    >>> [str(warning.message)[:29] for warning in seen]
    ["Wall 'wall' starts 0.5 m deep"]
    """

    gap: Any
    reach: Any = 0
