"""The contact law of Flores and others, for ``law="flores"`` of the contacts of `uqmbd_contact`."""

from __future__ import annotations

from typing import Any

import sympy

import uqmbd
from uqmbd_contact import ContactLaw, damping, depth, depth_rate, stiffness

__all__ = ["Flores", "flores_damping"]


class Flores:
    """The law of Flores and others: ``K d^(3/2) (1 + D d')``; `flores_damping` gives D.

    References
    ----------
    P. Flores, M. Machado, M. T. Silva and J. M. Martins, Multibody System Dynamics 25 (2011) 357-375.
    """

    name = "flores"

    def law(self) -> ContactLaw:
        """Return the law; it is written in the numbers of the contact."""
        return ContactLaw(stiffness * depth ** sympy.Rational(3, 2) * (1 + damping * depth_rate))


def flores_damping(restitution: Any, impact_speed: Any) -> Any:
    """Return the damping D (s/m) for a coefficient of restitution and a speed of impact (m/s)."""
    return 8 * (1 - restitution) / (5 * restitution * impact_speed)


@uqmbd.hookimpl
def uqmbd_contact_laws() -> list[type]:
    """Return the law of contact of this package."""
    return [Flores]
