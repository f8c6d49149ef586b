"""The law of contact of Lankarani and Nikravesh, with a friction that falls with the speed."""

from __future__ import annotations

from typing import Any

import sympy

from uqmbd_contact import ContactLaw, depth, depth_rate, friction, speed, stiffness

__all__ = ["lankarani"]


def lankarani(restitution: Any, impact_speed: Any, stribeck_speed: Any = 0.1) -> ContactLaw:
    """Return the law for a coefficient of restitution; numbers, or expressions in random variables.

    Parameters
    ----------
    restitution : expression
        Coefficient of restitution, 1, near to 1.
    impact_speed : expression
        Speed at which the bodies meet, m/s.
    stribeck_speed : expression
        Speed at which friction has fallen to 1.37 times the coefficient of the contact, from twice of it at rest, m/s.

    References
    ----------
    H. M. Lankarani and P. E. Nikravesh, Journal of Mechanical Design 112 (1990) 369-376.
    """
    loss = 3 * (1 - restitution**2) / 4 * depth_rate / impact_speed
    return ContactLaw(
        stiffness * depth ** sympy.Rational(3, 2) * (1 + loss),
        friction=friction * (1 + sympy.exp(-speed / stribeck_speed)),
    )
