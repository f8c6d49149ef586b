"""Contacts with compliance: normal force by a law, and regularised Coulomb friction."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import TYPE_CHECKING, Any, ClassVar, overload

import sympy

import uqmbd
from uqmbd.extend import NamedFrame
from uqmbd.laws import law_at, law_values
from uqmbd.typing import Quantity, Vector
from uqmbd_contact.geometry import InBearing, Meeting, OnPlane, OnRoad, OnSphere
from uqmbd_contact.laws import LAWS, NUMBERS, SYMBOLS, ContactLaw, LawName, depth, depth_rate, law_named, speed

__all__ = ["ClearanceJoint", "PlaneContact", "RoadContact", "SphereContact"]


class _Contact(uqmbd.extend.TypedComponent):
    """Common part of all contacts: law, friction, and the virtual work of both."""

    body_i: uqmbd.extend.NamedFrame
    body_j: uqmbd.extend.NamedFrame
    law: uqmbd.Parameter[LawName | str | ContactLaw] = uqmbd.Parameter(
        "N",
        "law of the normal force",
        kind="option",
        default="hertz",
        choices=(*LAWS, ContactLaw),
        registered="contact_laws",
        example="hunt-crossley",
    )
    # the example stiffness is low because tests place bodies in random poses, in which the bodies may overlap deeply
    stiffness: uqmbd.Parameter[Quantity] = uqmbd.Parameter(
        "N/m^n", "stiffness of the law", default=1e6, example=20.0, minimum=0
    )
    exponent: uqmbd.Parameter[Quantity] = uqmbd.Parameter(
        "1", "exponent of hunt-crossley", default=sympy.Rational(3, 2), minimum=0, exclusive=True
    )
    damping: uqmbd.Parameter[Quantity] = uqmbd.Parameter(
        "s/m, N s/m", "damping of the law: D of hunt-crossley, c of kelvin-voigt", default=0, minimum=0
    )
    friction: uqmbd.Parameter[Quantity] = uqmbd.Parameter(
        "1", "coefficient of friction", default=0, minimum=0, dimensions=2
    )
    slow: uqmbd.Parameter[Quantity] = uqmbd.Parameter(
        "m/s", "speed below which friction is viscous", default=1e-3, minimum=0, exclusive=True, dimensions=2
    )

    meeting: ClassVar[Callable[..., Meeting]]

    def prepare(self) -> dict[str, Any]:
        """Return the symbols in the contact law other than `SYMBOLS`, by name."""
        law = law_named(self.law)
        found = law_values(law.normal, *SYMBOLS, what="force")
        return {**super().prepare(), **found, **law_values(law.friction, *SYMBOLS, what="coefficient")}

    def terms(self, p: uqmbd.extend.Local) -> Iterator[uqmbd.VirtualWork | uqmbd.extend.Separation]:
        """Yield the gap for the check at the start, and the virtual work of the normal force and of friction."""
        law = law_named(p.law)
        meeting = self.meeting(p)
        yield uqmbd.extend.Separation(meeting.gap, meeting.reach)
        opening = p.rate_of(meeting.gap)
        state = {x: getattr(p, x.name) for x in NUMBERS} | {depth: -meeting.gap, depth_rate: -opening, speed: speed}
        force = p.let("normal force", law_at(p, law.normal, state, what="force"))
        yield uqmbd.VirtualWork(force, opening)
        if p.space.dimension == 1:  # no sliding is possible across the normal
            return
        coefficient = law_at(p, law.friction, state, what="coefficient")
        if coefficient != 0:
            sliding = meeting.relative - meeting.normal.dot(meeting.relative) * meeting.normal
            sliding = p.let("sliding", sliding)
            # Below the speed `slow`, friction is viscous: a force F causes creep at slow F / sqrt((mu N)^2 - F^2)
            size = sympy.sqrt(sliding.dot(sliding) + p.slow**2)
            yield uqmbd.VirtualWork(-coefficient.xreplace({speed: size}) * force / size * sliding, meeting.relative)


class PlaneContact(_Contact, OnPlane):
    """Contact of a sphere (or a point, of radius 0) of body j with a plane fixed in body i.

    Examples
    --------
    >>> import uqmbd
    >>> mechanism = uqmbd.Mechanism("ball", uqmbd.Translational(gravity=(0, -9.81)))
    >>> ball = mechanism.body("ball", mass=1, position=(0, 1))
    >>> mechanism.add(PlaneContact("floor", mechanism.ground, ball, (0, 0), (0, 0), (0, 1), law="linear"))
    <PlaneContact 'floor': ground, ball>
    """


class SphereContact(_Contact, OnSphere):
    """Contact of a sphere of body j and a sphere of body i.

    Examples
    --------
    >>> SphereContact.signature()[:65]
    '(name, body_i, body_j, point_i, point_j, radius_i, radius_j, law='
    """


class RoadContact(_Contact, OnRoad):
    """Contact of a point of body j with a road in body i: the first axis of body i points forward, the last axis up.

    The road profile is an expression in ``uqmbd_contact.distance``, the forward coordinate of the point, and in
    `uqmbd.t`. The profile can contain random variables. ``uqmbd_contact.distance`` is the same symbol as
    ``uqmbd_springs.distance``. The gap is measured along the normal of the road below the point. The measured gap is
    accurate if the depth of contact is small compared with the radius of curvature of the road.

    Examples
    --------
    >>> RoadContact.signature()[:42]
    '(name, body_i, body_j, point_j, road, law='
    """


class ClearanceJoint(_Contact, InBearing):
    """A hinge with clearance: a journal (circle of body j) moves inside a bearing (circle of body i).

    The motion consists of free flight, impact and contact. In contact, the normal force of the contact law and the
    friction force act on both bodies. The radius of the bearing is the radius of the journal plus the `clearance`. In
    space, the joint is a ball in a socket.

    Examples
    --------
    >>> ClearanceJoint.signature()[:64]
    '(name, body_i, body_j, point_i, point_j, radius, clearance, law='
    """

    if TYPE_CHECKING:

        @overload
        def __init__(
            self, name: str, body_i: NamedFrame, body_j: NamedFrame, point_i: Vector, point_j: Vector,
            radius: Quantity, clearance: Quantity, law: LawName | str | ContactLaw = "hertz",
            stiffness: Quantity = 1e6, exponent: Quantity = 1.5, damping: Quantity = 0, friction: Quantity = 0,
            slow: Quantity = 1e-3,
        ) -> None: ...  # fmt: skip
        @overload
        def __init__(
            self, name: str, body_i: NamedFrame, body_j: NamedFrame, *, at: Vector, radius: Quantity,
            clearance: Quantity, law: LawName | str | ContactLaw = "hertz", stiffness: Quantity = 1e6,
            exponent: Quantity = 1.5, damping: Quantity = 0, friction: Quantity = 0, slow: Quantity = 1e-3,
        ) -> None: ...  # fmt: skip
        def __init__(self, *arguments: Any, **keywords: Any) -> None: ...
