"""Angle between two bodies about a common axis, counted over any number of turns."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import sympy

from uqmbd.arguments import typechecked
from uqmbd.mechanism.components.component import Auxiliary, Local
from uqmbd.mechanism.geometry import Frame, continued, relative_quaternion

__all__ = ["counted_angle", "half_angle"]


@typechecked
def half_angle(p: Local, body_i: Frame, body_j: Frame, drawn: Sequence[Any], axis_j: Sequence[Any]) -> tuple[Any, Any]:
    """Return cosine and sine of half the rotation angle of body j relative to body i.

    Parameters
    ----------
    p : Local
        Argument of `Component.terms`.
    body_i, body_j : Frame
        Frames of the bodies.
    drawn : sequence
        Relative quaternion at which the angle is zero: usually that of the given pose, from
        `Component.drawn_quaternion`. In planar space, ``(1, 0)`` means equal orientation of both frames.
    axis_j : sequence
        Unit vector of the axis in the frame of body j; unused in planar space.

    Returns
    -------
    tuple of two expressions
        Cosine and sine, quadratic in the coordinates and known up to their common sign. The sum of their squares is one
        if the bodies only rotate about this axis.

    Examples
    --------
    A body moves without rotation relative to its given pose:

    >>> import uqmbd
    >>> class Held(uqmbd.Component):
    ...     spaces = (uqmbd.Planar,)
    ...     def terms(self, p):
    ...         drawn = self.drawn_quaternion("body_i", "body_j")
    ...         cosine, sine = uqmbd.extend.half_angle(p, p.body_i, p.body_j, drawn, ())
    ...         yield uqmbd.Constraint(sine, "held")
    ...         yield uqmbd.Upright(cosine)
    >>> mechanism = uqmbd.Mechanism("pin", uqmbd.Planar())
    >>> arm = mechanism.body("arm", mass=1, inertia=1, angle=0.4)
    >>> held = mechanism.add(Held("held", mechanism.ground, arm))
    >>> uqmbd.check(mechanism).mobility  # it moves and does not turn
    2
    """
    r = relative_quaternion(body_i.attitude(drawn), body_j.quaternion)
    return r[0], r[1] if p.space.dimension == 2 else sympy.Matrix(r[1:]).dot(sympy.Matrix(list(axis_j)))


@typechecked(values=False)
def counted_angle(
    p: Local, state: str, body_i: Frame, body_j: Frame, drawn: Sequence[Any], axis_j: Sequence[Any] = ()
) -> tuple[sympy.Expr, Auxiliary]:
    """Return the angle of body j relative to body i, counted over any number of turns, for constraints.

    The coordinates determine the angle up to whole turns.  An auxiliary state, which integrates the rate, only selects
    the turn.  The angle therefore does not drift, and constraints in the angle depend on the coordinates only.

    Parameters
    ----------
    p : Local
        Argument of `Component.terms`.
    state : str
        Name of the state.
    body_i, body_j, drawn, axis_j
        Bodies, quaternion at which the angle is zero, and axis, as for `half_angle`.

    Returns
    -------
    angle : expression
        Angle, rad; zero at the relative quaternion `drawn`.
    term : Auxiliary
        Term of the auxiliary state; the method `terms` must also yield it.

    Examples
    --------
    >>> import uqmbd
    >>> class Coupling(uqmbd.Component):
    ...     \"\"\"Two shafts in planar space, of which one turns twice as fast.\"\"\"
    ...     bodies, spaces = ("body_i", "body_j"), (uqmbd.Planar,)
    ...     def prepare(self):
    ...         return {"drawn": self.drawn_quaternion()}
    ...     def terms(self, p):
    ...         ground = uqmbd.extend.Frame(p.space)
    ...         fast, turns = uqmbd.extend.counted_angle(p, "fast", ground, p.body_i, (1, 0))
    ...         yield turns
    ...         slow, turns = uqmbd.extend.counted_angle(p, "slow", ground, p.body_j, (1, 0))
    ...         yield turns
    ...         yield uqmbd.Constraint(fast - 2 * slow)
    """
    cosine, sine = half_angle(p, body_i, body_j, drawn, axis_j)
    spin = body_j.angular_velocity - body_i.angular_velocity
    rate = spin[0] if p.space.dimension == 2 else spin.dot(body_j.direction(axis_j))
    counted = p.state(state)
    angle = continued(counted, cosine, sine, half=True)
    return angle, Auxiliary(counted, rate, 2 * sympy.atan(sine / cosine))
