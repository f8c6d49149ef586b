"""Laws of compliant contact: normal force and coefficient of friction as expressions of depth, rate and speed."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal

import sympy
from sympy.logic.boolalg import Boolean

import uqmbd
from uqmbd.laws import depth, depth_rate, law_values, registered_contact_law, speed

__all__ = [
    "LAWS",
    "NUMBERS",
    "REGISTERED",
    "SYMBOLS",
    "ContactLaw",
    "LawName",
    "damping",
    "depth",
    "depth_rate",
    "exponent",
    "friction",
    "law_named",
    "speed",
    "stiffness",
]

LawName = Literal["linear", "hertz", "hunt-crossley", "kelvin-voigt"]
"""Laws with a name."""

stiffness = sympy.Symbol("stiffness", real=True)
"""Stiffness of a contact, in the units of its law: N/m if linear, N/m^(3/2) after Hertz."""

exponent = sympy.Symbol("exponent", real=True)
"""Exponent of the depth in the law of a contact, 1."""

damping = sympy.Symbol("damping", real=True)
"""Damping of a contact, in the units of its law: s/m after Hunt and Crossley, N s/m after Kelvin and Voigt."""

friction = sympy.Symbol("friction", real=True)
"""Coefficient of friction of a contact, 1."""

NUMBERS = stiffness, exponent, damping, friction
SYMBOLS = (depth, depth_rate, speed, *NUMBERS)


@dataclass(frozen=True)
class ContactLaw:
    """A law of compliant contact, for the argument ``law`` of `PlaneContact` and its kin.

    Its symbols are ``uqmbd_contact.depth`` (m, positive in contact), ``depth_rate`` (m/s, positive while the bodies
    approach each other) and ``speed`` (m/s, of the sliding; never less than the contact's ``slow``); in the numbers of
    the contact, ``stiffness``, ``exponent``, ``damping`` and ``friction``; and in `uqmbd.t` and random variables.

    Parameters
    ----------
    force : expression
        Normal force, N; positive pushes the bodies apart.
    acts : condition, optional
        Where it acts while the bodies touch; default where it is positive: it never pulls.
    friction : expression
        Coefficient of friction; default that of the contact.

    Raises
    ------
    uqmbd.StudyError
        If the law contains symbols that nothing gives a value.

    Examples
    --------
    The law of Lankarani and Nikravesh (Journal of Mechanical Design 112 (1990) 369-376). The restitution is 0.8 and the
    impact speed 2 m/s. Its friction falls with the speed:

    >>> from uqmbd_contact import depth, depth_rate, friction, speed, stiffness
    >>> loss = 3 * (1 - 0.8**2) / 4 * depth_rate / 2
    >>> law = ContactLaw(stiffness * depth**1.5 * (1 + loss), friction=friction * (1 + sympy.exp(-speed / 0.1)))
    >>> law.normal.subs({stiffness: 1e5, depth: 0.01, depth_rate: 0}), law.normal.subs(depth, -0.01)
    (100.000000000000, 0)
    """

    force: Any
    acts: Any = None
    friction: Any = friction

    def __post_init__(self) -> None:
        for name in ("force", "friction"):
            law_values(getattr(self, name), *SYMBOLS, what=name, package="uqmbd_contact")
        if sympy.sympify(self.friction, strict=True).is_negative:
            raise uqmbd.StudyError(f"friction is {self.friction}; expected a coefficient of friction, 0 or more.")
        condition = isinstance(self.acts, (bool, Boolean)) and not isinstance(self.acts, sympy.Expr)
        if self.acts is not None and not condition:
            raise uqmbd.StudyError(
                f"acts is {self.acts!r}; expected a condition, such as uqmbd_contact.depth_rate > 0, or True."
            )

    @property
    def normal(self) -> sympy.Expr:
        """The force where the bodies touch and it acts, else zero."""
        force = sympy.sympify(self.force, strict=True)
        # the condition is around everything, so that derivatives outside are zero, not those of a root of nothing
        if self.acts is None:
            # a force that is not a number is no force that pulls: it is handed on, and the realisation fails
            return sympy.Piecewise((0, sympy.Or(depth <= 0, force <= 0)), (force, True))
        return sympy.Piecewise((force, sympy.And(depth > 0, self.acts)), (0, True))


LAWS: dict[LawName, ContactLaw] = {
    "linear": ContactLaw(stiffness * depth, acts=True),
    # a root is quicker than a power
    "hertz": ContactLaw(sympy.Mul(stiffness, depth, sympy.sqrt(depth), evaluate=False), acts=True),
    "hunt-crossley": ContactLaw(
        stiffness * depth**exponent * (1 + damping * depth_rate), acts=1 + damping * depth_rate > 0
    ),
    "kelvin-voigt": ContactLaw(
        stiffness * depth + damping * depth_rate, acts=stiffness * depth + damping * depth_rate > 0
    ),
}
"""Laws by name.

``linear``: ``k d``; ``hertz``: ``k d^1.5``; ``hunt-crossley``: ``k d^n (1 + D d')`` (K. H. Hunt and F. R. E. Crossley,
Journal of Applied Mechanics 42 (1975) 440-445), D in s/m; ``kelvin-voigt``: ``k d + c d'``, c in N s/m, which ends when
the *force* vanishes, before the bodies have left each other: there is no adhesion.  (The other convention, an end at
zero depth, pulls at last; for a damping ratio of 0.1 its restitution is 0.729, that of this one 0.744.)
"""


_NAMED: dict[str, ContactLaw] = {str(name): law for name, law in LAWS.items()}


def law_named(law: str | ContactLaw) -> ContactLaw:
    """Return the law of a name; a law is returned unchanged."""
    if not isinstance(law, str):
        return law
    found = _NAMED[law] if law in _NAMED else registered_contact_law(law)
    if not isinstance(found, ContactLaw):
        raise uqmbd.StudyError(
            f"The contact law {law!r} of a plugin is {found!r:.80}; expected that its method law() returns a "
            "uqmbd_contact.ContactLaw."
        )
    return found


def _registered(name: str) -> type:
    """Return the class by which a law of this package is registered."""
    return type(name, (), {"__doc__": f"The law {name!r}.", "name": name, "law": lambda _: _NAMED[name]})


REGISTERED = [_registered(name) for name in LAWS]
"""Classes of the laws of this package, for the hook ``uqmbd_contact_laws``."""
