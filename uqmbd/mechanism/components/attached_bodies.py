"""Given poses of the bodies that a component attaches to each other, and motions of one relative to another."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import sympy

from uqmbd.errors import StudyError
from uqmbd.mechanism.components.joint_motion import (
    JointAngle,
    JointDisplacement,
    angle_between,
    angle_from_drawn,
)
from uqmbd.mechanism.expressions import as_symbolic
from uqmbd.mechanism.geometry import Frame, NamedFrame, Space, nominal, relative_quaternion

__all__ = ["AttachedBodies"]

APART = 1e-12
"""Distance of two points on a line, relative to their coordinates (m), up to which they coincide."""


class AttachedBodies:
    """Bodies of a component with the values of its parameters; `Component` adds declarations and terms."""

    if TYPE_CHECKING:  # annotations at run time would be arguments of components
        name: str
        attached: dict[str, NamedFrame]
        """Bodies by body argument."""
        values: dict[str, Any]
        """Values of the parameters by name."""
        read: set[str]
        """Parameters with values read by code other than `prepare`."""
        settled_space: Space | None
        """Space of the mechanism; None: the component is not part of a mechanism."""

    def joint_angle(
        self, body_i: str = "body_i", body_j: str = "body_j", *, drawn: bool = False, speed: str = "speed"
    ) -> JointAngle | None:
        """Return the rotation angle of one body relative to another about a common axis, for `motion`.

        The angle is zero if the joint frames coincide. The joint frames are `uqmbd.extend.joint_frames` of `axis_i` and
        `axis_j`, and in planar space the body frames. In planar space, the initial angle is the difference of the given
        angles, which may include whole turns. In three dimensions, the initial angle is within half a turn of zero.

        Parameters
        ----------
        body_i, body_j : str
            Names of the body arguments. The axes are the parameters with the same endings, such as `axis_i`.
        drawn : bool
            Whether the angle is zero in the given pose instead. An angle that is zero in the given pose needs only the
            axis of body j.
        speed : str
            Name of the rate of the angle.

        Returns
        -------
        JointAngle
            Angle; None in spaces without rotation.
        """
        if not self._space().turns:
            return None
        i, j = self.attached[body_i], self.attached[body_j]
        axes = [self.values.get(f"axis_{body.rsplit('_', 1)[-1]}", ()) for body in (body_i, body_j)]
        start = self.drawn_quaternion(body_i, body_j)
        if drawn:
            return angle_from_drawn(i, j, axes[1], start, speed)
        return angle_between(i, j, axes, start, self.drawn_angle(body_i, body_j), speed)

    def joint_displacement(self, speed: str = "speed") -> JointDisplacement:
        """Return the displacement of `point_j` from `point_i` along `axis_i`, for `motion`."""
        i, j = (self.attached[key] for key in ("body_i", "body_j"))
        self.read |= {"point_i", "point_j"}
        point_i, point_j, axis_i = (self.values[key] for key in ("point_i", "point_j", "axis_i"))
        return JointDisplacement(i.direction(axis_i).dot(j.point(point_j) - i.point(point_i)), speed)

    def drawn_quaternion(self, body_i: str = "body_i", body_j: str = "body_j") -> tuple[sympy.Expr, ...]:
        """Return the quaternion of one body relative to another in the given pose, ``conj(e_i) e_j``, for `prepare`.

        Parameters
        ----------
        body_i, body_j : str
            Names of two body arguments.

        Returns
        -------
        tuple of expressions
            Four components; in planar space the cosine and sine of half the angle.
        """
        return relative_quaternion(*(_drawn(self.attached[b]) for b in (body_i, body_j)))

    def drawn_angle(self, body_i: str = "body_i", body_j: str = "body_j") -> sympy.Expr:
        """Return the given angle of one body relative to another in planar space, including whole turns, for `prepare`.

        Parameters
        ----------
        body_i, body_j : str
            Names of two body arguments.

        Returns
        -------
        expression
            Angle, rad.
        """
        angle_i, angle_j = (getattr(getattr(self.attached[b], "pose", None), "angle", 0) for b in (body_i, body_j))
        return as_symbolic(angle_j) - as_symbolic(angle_i)

    def drawn_frame(self, body: str) -> Frame:
        """Return the frame of an attached body in the given pose, with zero velocity, for `prepare`."""
        attached = self.attached[body]
        pose = getattr(attached, "pose", None)
        return Frame(self._space(), attached.q if pose is None else pose.q)

    def drawn_side(self, *, either: bool = False) -> int:
        """Return the side of `point_i` on which `point_j` is, in the given pose on a line, for `prepare`.

        Parameters
        ----------
        either : bool
            Whether to return 1 if the points coincide in the given pose; otherwise coincident points are an error.

        Returns
        -------
        int
            At the means of the random variables: 1 if `point_j` is ahead of `point_i`, -1 if it is behind.

        Raises
        ------
        uqmbd.StudyError
            If the points coincide in the given pose and `either` is false.
        """
        i, j = (self.drawn_frame(key) for key in ("body_i", "body_j"))
        ends = [nominal(x) for x in (i.point(self.values["point_i"])[0], j.point(self.values["point_j"])[0])]
        offset = ends[1] - ends[0]
        if abs(offset) > APART * max(1.0, *map(abs, ends)):
            return 1 if offset > 0 else -1
        if either:
            return 1
        raise StudyError(
            f"point_i and point_j have the same given position, {ends[0]:g} m, so their order on the line is "
            "unknown. Separate them by position= of the bodies or by the points."
        )

    def drawn_displacement(self) -> sympy.Expr:
        """Return the displacement of `point_j` from `point_i` along `axis_i` in the given pose, for `prepare`."""
        i, j = (self.drawn_frame(key) for key in ("body_i", "body_j"))
        point_i, point_j, axis_i = (self.values[key] for key in ("point_i", "point_j", "axis_i"))
        return i.direction(axis_i).dot(j.point(point_j) - i.point(point_i))

    def _space(self) -> Space:
        if self.settled_space is not None:
            return self.settled_space
        for body in self.attached.values():
            space = getattr(body, "space", None)
            if isinstance(space, Space):
                return space
        raise StudyError(f"{type(self).__name__} {self.name!r}: none of its bodies belongs to a mechanism.")


def _drawn(body: Any) -> tuple[sympy.Expr, ...]:
    """Return the given quaternion of a body; for the ground, the identity."""
    pose = getattr(body, "pose", None)
    q = body.q if pose is None else pose.q
    return tuple(q[body.space.dimension :])
