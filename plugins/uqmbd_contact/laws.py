"""Laws of the normal force of a compliant contact."""

from __future__ import annotations

from typing import Any

import sympy

__all__ = ["LAWS", "friction_force", "normal_force"]

LAWS = ("linear", "hertz", "hunt-crossley", "kelvin-voigt")
"""Names of the laws."""


def normal_force(law: str, depth: Any, rate: Any, stiffness: Any, exponent: Any, damping: Any) -> sympy.Expr:
    """Force that pushes two bodies apart; it never pulls.

    ``linear``: ``k d``; ``hertz``: ``k d^1.5``; ``hunt-crossley``: ``k d^n (1 + D d')`` [1]_; ``kelvin-voigt``:
    ``k d + c d'``, which ends when the *force* vanishes, before the bodies have left each other: there is no adhesion.
    (The other convention, an end at zero depth, pulls at last; for a damping ratio of 0.1 its restitution is 0.729,
    that of this one 0.744.)

    Parameters
    ----------
    law : str
        One of `LAWS`.
    depth, rate : expression
        Penetration, m, positive in contact, and its rate, m/s.
    stiffness : expression
        N/m^n.
    exponent, damping : expression
        n and D (s/m) of ``hunt-crossley``; c (N s/m) of ``kelvin-voigt``; the other laws have none.

    References
    ----------
    .. [1] K. H. Hunt and F. R. E. Crossley, Journal of Applied Mechanics 42 (1975) 440-445.

    Examples
    --------
    >>> d, v = sympy.symbols("d v", real=True)
    >>> force = normal_force("linear", d, v, 100, 1, 0)
    >>> force.subs(d, 2), force.subs(d, -1)
    (200, 0)
    """
    depth, rate = sympy.sympify(depth), sympy.sympify(rate)
    if law == "linear":
        force, touching = stiffness * depth, depth > 0
    elif law == "hertz":
        force, touching = stiffness * depth * sympy.sqrt(depth), depth > 0
    elif law == "hunt-crossley":
        force, touching = (
            stiffness * depth**exponent * (1 + damping * rate),
            sympy.And(depth > 0, 1 + damping * rate > 0),
        )
    else:
        force = stiffness * depth + damping * rate
        touching = sympy.And(depth > 0, force > 0)
    # the condition is around everything, so that derivatives outside are zero, not those of a root of nothing
    return sympy.Piecewise((force, touching), (0, True))


def friction_force(normal: Any, coefficient: Any, sliding: sympy.Matrix, slow: Any) -> sympy.Matrix:
    """Coulomb friction, regularised: ``-mu N v / sqrt(v^2 + v0^2)``.

    Below the speed ``v0`` it is viscous: what sticks creeps, at ``v0 F / sqrt((mu N)^2 - F^2)`` under a force F.
    """
    return -coefficient * normal / sympy.sqrt(sliding.dot(sliding) + slow**2) * sliding
