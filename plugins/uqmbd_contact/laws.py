"""Laws of compliant contact: normal force and coefficient of friction as expressions of depth, rate and speed."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal

import sympy
from sympy.logic.boolalg import Boolean

import uqmbd
from uqmbd.extend import typechecked
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
"""Names of predefined laws."""

stiffness = sympy.Symbol("stiffness", real=True)
"""Stiffness of a contact, in the units of its law: N/m if linear, N/m^(3/2) after Hertz."""

exponent = sympy.Symbol("exponent", real=True)
"""Exponent of the depth in the law of a contact, 1."""

damping = sympy.Symbol("damping", real=True)
"""Damping of a contact, in the units of its law: s/m for ``hunt-crossley``, N s/m for ``kelvin-voigt``."""

friction = sympy.Symbol("friction", real=True)
"""Coefficient of friction of a contact, 1."""

NUMBERS = stiffness, exponent, damping, friction
SYMBOLS = (depth, depth_rate, speed, *NUMBERS)


@typechecked(values=False)
@dataclass(frozen=True)
class ContactLaw:
    """Law of compliant contact, for the argument ``law`` of `PlaneContact` and similar components.

    The symbols of the law are ``uqmbd_contact.depth`` (m), ``depth_rate`` (m/s) and ``speed`` (sliding speed, m/s).
    The depth is positive in contact, and its rate is positive while the bodies approach each other. The speed is at
    least the parameter ``slow`` of the contact. Further symbols are the parameters of the contact, ``stiffness``,
    ``exponent``, ``damping`` and ``friction``. The law can also contain `uqmbd.t` and random variables.

    Parameters
    ----------
    force : expression
        Normal force, N; a positive force pushes the bodies apart.
    acts : condition, optional
        Condition under which the force acts while the bodies touch. Default: the force is positive, so that it never
        pulls.
    friction : expression
        Coefficient of friction. Default: the coefficient of the contact.

    Raises
    ------
    uqmbd.StudyError
        If the law contains symbols without a value.

    Examples
    --------
    The law of Lankarani and Nikravesh (Journal of Mechanical Design 112 (1990) 369-376), with restitution 0.8 and
    impact speed 2 m/s. The friction decreases with the speed:

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
            raise uqmbd.StudyError(f"friction is {self.friction}; expected a coefficient of friction of 0 or more.")
        condition = isinstance(self.acts, (bool, Boolean)) and not isinstance(self.acts, sympy.Expr)
        if self.acts is not None and not condition:
            raise uqmbd.StudyError(
                f"acts is {self.acts!r}; expected a condition, such as uqmbd_contact.depth_rate > 0, or True."
            )

    @property
    def normal(self) -> sympy.Expr:
        """Normal force, N; zero if the bodies do not touch or the condition `acts` is false."""
        force = sympy.sympify(self.force, strict=True)
        # the condition encloses the whole expression, so that its derivatives without contact are zero and finite
        if self.acts is None:
            # this order of the branches returns a force that is NaN, so that the realisation fails
            return sympy.Piecewise((0, sympy.Or(depth <= 0, force <= 0)), (force, True))
        return sympy.Piecewise((force, sympy.And(depth > 0, self.acts)), (0, True))


LAWS: dict[LawName, ContactLaw] = {
    "linear": ContactLaw(stiffness * depth, acts=True),
    # a root is faster to evaluate than a power
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
Journal of Applied Mechanics 42 (1975) 440-445), D in s/m; ``kelvin-voigt``: ``k d + c d'``, c in N s/m. The contact of
``kelvin-voigt`` ends when the *force* vanishes, before the bodies have separated, so there is no adhesion. (By another
convention, the contact ends at zero depth, and the force pulls before this end. For a damping ratio of 0.1, the
coefficient of restitution is 0.744 here and 0.729 by the other convention.)
"""


_NAMED: dict[str, ContactLaw] = {str(name): law for name, law in LAWS.items()}


def law_named(law: str | ContactLaw) -> ContactLaw:
    """Return the contact law that has a name; return a law object unchanged."""
    if not isinstance(law, str):
        return law
    found = _NAMED[law] if law in _NAMED else registered_contact_law(law)
    if not isinstance(found, ContactLaw):
        raise uqmbd.StudyError(
            f"The method law() of the plugin's contact law {law!r} returned {found!r:.80}; expected a "
            "uqmbd_contact.ContactLaw."
        )
    return found


def _registered(name: str) -> type:
    """Return the plugin class that registers a law of this package by its name."""
    return type(name, (), {"__doc__": f"The law {name!r}.", "name": name, "law": lambda _: _NAMED[name]})


REGISTERED = [_registered(name) for name in LAWS]
"""Classes of the laws of this package, for the hook ``uqmbd_contact_laws``."""
