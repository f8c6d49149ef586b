"""Impacts of rigid bodies: Newton's law of restitution with Coulomb friction."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import ClassVar

import uqmbd
from uqmbd.typing import Quantity
from uqmbd_contact.geometry import Meeting, OnPlane, OnRoad, OnSphere, tangents

__all__ = ["PlaneImpact", "RoadImpact", "SphereImpact"]


class _ImpactComponent(uqmbd.extend.TypedComponent):
    """Common part of all impacts."""

    body_i: uqmbd.extend.NamedFrame
    body_j: uqmbd.extend.NamedFrame
    restitution: uqmbd.Parameter[Quantity] = uqmbd.Parameter(
        "1", "coefficient of restitution", default=1, minimum=0, maximum=1
    )
    friction: uqmbd.Parameter[Quantity] = uqmbd.Parameter(
        "1", "coefficient of friction", default=0, minimum=0, dimensions=2
    )

    meeting: ClassVar[Callable[..., Meeting]]

    def terms(self, p: uqmbd.extend.Local) -> Iterator[uqmbd.Event]:
        """Yield the event of an impact between two bodies."""
        meeting = self.meeting(p)
        sliding = [axis.dot(meeting.relative) for axis in tangents(p, meeting)] if p.friction != 0 else ()
        yield uqmbd.Event(meeting.gap, uqmbd.extend.Impact(p.rate_of(meeting.gap), p.restitution, sliding, p.friction))


class PlaneImpact(_ImpactComponent, OnPlane):
    """Impacts of a sphere (or a point, of radius 0) of body j on a plane fixed in body i.

    The impact follows Newton's law of restitution with Coulomb friction. Decaying bounces end in a permanent contact
    with sticking, rolling or sliding. `event_time` accepts the events "impact", "rest", "lift-off", "stick" and "slip".

    Examples
    --------
    >>> import uqmbd
    >>> mechanism = uqmbd.Mechanism("ball", uqmbd.Translational(gravity=(0, -9.81)))
    >>> ball = mechanism.body("ball", mass=1, position=(0, 1))
    >>> floor = mechanism.add(PlaneImpact("floor", mechanism.ground, ball, (0, 0), (0, 0), (0, 1), restitution=0.8))
    >>> mechanism.output("second", floor.event_time("impact", 2), units="s")
    >>> round(float(uqmbd.simulate(mechanism, [0, 2])["second"]), 9)
    1.173961467
    """


class SphereImpact(_ImpactComponent, OnSphere):
    """Impacts of a sphere of body j on a sphere of body i, like `PlaneImpact`.

    Examples
    --------
    >>> SphereImpact.signature()
    '(name, body_i, body_j, point_i, point_j, radius_i, radius_j, restitution=1, friction=0)'
    """


class RoadImpact(_ImpactComponent, OnRoad):
    """Impacts of a point of body j on a road in body i, like `PlaneImpact`.

    The road is defined as for `RoadContact`.

    Examples
    --------
    >>> RoadImpact.signature()
    '(name, body_i, body_j, point_j, road, restitution=1, friction=0)'
    """
