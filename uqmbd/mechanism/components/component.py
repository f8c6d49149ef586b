"""Components: descriptions of joints, drivers, springs and forces.

Length: the class documents parameters and return values of its public methods, which authors of components use.
"""

from __future__ import annotations

import inspect
from collections.abc import Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, Any, ClassVar

import sympy

from uqmbd.errors import StudyError
from uqmbd.mechanism.components.attached_bodies import AttachedBodies
from uqmbd.mechanism.components.auxiliary_state import make_auxiliary_state
from uqmbd.mechanism.components.coordinates import Coordinate, CoordinateSet, coordinate_symbol
from uqmbd.mechanism.components.declaration import declare
from uqmbd.mechanism.components.event_terms import DryFriction, Event, Impact, Separation
from uqmbd.mechanism.components.joint_motion import (
    JointAngle,
    JointDisplacement,
    motion_quantity,
)
from uqmbd.mechanism.components.local import Local
from uqmbd.mechanism.components.mistakes import remedy
from uqmbd.mechanism.components.parameter import Parameter
from uqmbd.mechanism.components.reaction import PlaneReaction, ReactionSymbol
from uqmbd.mechanism.components.terms import (
    Auxiliary,
    Constraint,
    Kinetic,
    Potential,
    Term,
    Upright,
    VelocityConstraint,
    VirtualWork,
)
from uqmbd.mechanism.components.world_pose import KEYWORDS, replaced
from uqmbd.mechanism.expressions import EventTime, flatten
from uqmbd.mechanism.geometry import (
    Frame,
    Matrix,
    NamedFrame,
    Planar,
    Space,
    Spatial,
    Translational,
)
from uqmbd.names import check_name, checked, did_you_mean
from uqmbd.wording import place_of

__all__ = [
    "Auxiliary",
    "Component",
    "Constraint",
    "Event",
    "DryFriction",
    "Impact",
    "Kinetic",
    "Local",
    "Parameter",
    "Potential",
    "ReactionSymbol",
    "Separation",
    "Term",
    "Upright",
    "VelocityConstraint",
    "VirtualWork",
    "flatten",
]


class Component(AttachedBodies):
    """Base of joints, drivers, springs and forces.

    A subclass names its body arguments in `bodies` and its admissible spaces in `spaces`. The ground replaces omitted
    body arguments that are in `grounded`. A component with its own coordinates needs no body. The subclass declares
    each `Parameter` as a class attribute, and its method `terms` yields terms. uqmbd derives equations of motion,
    Jacobians and reactions from these terms.

    ``at=`` gives one point in the world frame instead of `point_i` and `point_j`. ``axis=`` gives one axis in the world
    frame instead of `axis_i` and `axis_j`, or instead of the only axis. The point and the axis refer to the given
    poses, which must not be random. The attribute `drawn_by` lists the keywords that a class accepts; by default both.
    If the points (axes) of a component need not coincide, `drawn_by` must not contain ``at`` (``axis``).

    Parameters
    ----------
    name : str
        Name of the component, unique in its mechanism.
    *arguments, **keywords
        Bodies, then parameters in the order of their declaration, by position or by name.

    Raises
    ------
    uqmbd.StudyError
        If an argument is missing, unknown or given twice.

    Examples
    --------
    A constraint holds a particle on a circle about the world's origin:

    >>> import uqmbd
    >>> class Circle(uqmbd.Component):
    ...     bodies = ("body",)
    ...     radius = uqmbd.Parameter("m", "radius of the circle")
    ...     def terms(self, p):
    ...         r = p.body.position
    ...         yield uqmbd.Constraint(r.dot(r) - p.radius**2)
    >>> Circle.signature()
    '(name, body, radius)'
    """

    bodies: ClassVar[tuple[str, ...]] = ("body_i", "body_j")
    grounded: ClassVar[tuple[str, ...]] = ()
    drawn_by: ClassVar[tuple[str, ...]] = ("at", "axis")
    spaces: ClassVar[tuple[type[Space], ...]] = (Spatial, Planar, Translational)
    symbol: ClassVar[str] = ""
    """Symbol in figures; an unknown name raises an error that lists all symbols. Empty: derived from the parameters."""
    prescribed_angle: ClassVar[str] = ""
    """Parameter for the angle of `body_j` relative to `body_i`, in a driver that counts turns."""
    __signature__: ClassVar[inspect.Signature]
    """Arguments with types, units and descriptions, as in `help`."""
    if TYPE_CHECKING:  # mypy would accept an object with __getattr__ as a number and a vector
        __float__: ClassVar[None]
        __len__: ClassVar[None]
    settled = 0
    """Number of times that the parameters received values; 0: the component is not part of a mechanism."""
    stating = False
    """Whether the terms are being evaluated."""
    offered = False
    """Whether the component belongs to a mechanism without a call of `Mechanism.add`."""

    def __init__(self, name: str | None = None, *arguments: Any, **keywords: Any) -> None:
        kind = type(self).__name__
        if name is None:
            raise StudyError(f"{kind}: the name is missing. Usage: {kind}{self.signature()}.")
        self.name = check_name(name, kind)
        names = [*(x for x in self.bodies if x not in self.grounded), *self.parameters()]
        where = f"{kind} {name!r}"
        usage = f"Usage: {kind}{self.signature()}."
        if len(arguments) > len(names):
            raise StudyError(
                f"{where}: {len(arguments) + 1} positional arguments are given; expected at most "
                f"{len(names) + 1}. {usage}"
            )
        given = dict(zip(names, arguments, strict=False))
        self.world_pose = {key: keywords.pop(key) for key in KEYWORDS if key in keywords and replaced(type(self), key)}
        for key, value in keywords.items():
            if key not in (*names, *self.grounded):
                known = [*names, *self.grounded, *(word for word in KEYWORDS if replaced(type(self), word))]
                near = did_you_mean(key, known) or "."
                raise StudyError(f"{where}: the class has no argument {key!r}{near} {usage}")
            if key in given:
                raise StudyError(f"{where}: {key!r} is given twice. {usage}")
            given[key] = value
        for key in self.bodies:
            if key not in given and key not in self.grounded:
                raise StudyError(f"{where}: {key!r} is missing; give a body or mechanism.ground. {usage}")
        # bodies with a default come before the others: reactions act on the last body, which a call must contain
        roles = sorted(self.bodies, key=lambda key: (key != self.bodies[0], key not in self.grounded))
        self.attached: dict[str, NamedFrame] = {key: given.pop(key, None) for key in roles}
        self.given = given
        self.values: dict[str, Any] = {}
        self.coordinate_set: CoordinateSet | None = None
        """Coordinates of the component; None: it has none."""
        self.settled_space: Space | None = None
        """Space of the mechanism; None: the component is not part of a mechanism."""
        self.read: set[str] = set()
        """Parameters with values read by code other than `prepare`."""
        self.prepared_from: frozenset[str] = frozenset()
        """Parameters with values read by `prepare`."""
        if not self.offered:
            for body in self.attached.values():
                getattr(body, "drafts", {})[name] = kind

    @classmethod
    def parameters(cls) -> dict[str, Parameter]:
        """Return the declared parameters by name, in the order of their declaration.

        Examples
        --------
        >>> import uqmbd
        >>> from uqmbd_joints import Revolute
        >>> sorted(Revolute.parameters())
        ['axis_i', 'axis_j', 'point_i', 'point_j']
        """
        found: dict[str, Parameter] = {}
        for base in reversed(cls.__mro__):
            found.update({k: v for k, v in vars(base).items() if isinstance(v, Parameter)})
        return found

    @classmethod
    def body_of(cls, parameter: str) -> str:
        """Return the body argument whose body frame a point or an axis refers to; see `Parameter`.

        Examples
        --------
        >>> import uqmbd
        >>> from uqmbd_joints import Revolute
        >>> Revolute.body_of("point_j")
        'body_j'
        """
        if stated := cls.parameters()[parameter].body:
            return stated
        ending = parameter.rsplit("_", 1)[-1]
        return next((body for body in cls.bodies if body.rsplit("_", 1)[-1] == ending), cls.bodies[0])

    @classmethod
    def radius_of(cls, point: str) -> str:
        """Return the name of the parameter for the radius about a point, or an empty text; see `Parameter`.

        Examples
        --------
        >>> from uqmbd_joints import RollingWheel
        >>> RollingWheel.radius_of("point_j")
        'radius'
        """
        parameters = cls.parameters()
        if any(parameter.about for parameter in parameters.values()):
            return next((name for name, parameter in parameters.items() if parameter.about == point), "")
        names = [f"radius_{point.rsplit('_', 1)[-1]}", *(["radius"] if cls.body_of(point) == cls.bodies[-1] else [])]
        return next((name for name in names if name in parameters), "")

    @classmethod
    def signature(cls) -> str:
        """Return the argument list as text.

        Examples
        --------
        >>> import uqmbd
        >>> from uqmbd_joints import Revolute
        >>> Revolute.signature()
        '(name, body_i, body_j, point_i, point_j, axis_i, axis_j)'
        """
        words = ["name", *(x for x in cls.bodies if x not in cls.grounded)]
        words += [k if p.required else f"{k}={p.default!r}" for k, p in cls.parameters().items()]
        words += [f"{x}=ground" for x in cls.grounded]
        return f"({', '.join(words)})"

    def __init_subclass__(cls, **keywords: Any) -> None:
        super().__init_subclass__(**keywords)
        declare(cls)

    def prepare(self) -> Mapping[str, Any]:
        """Return further values by name, computed from the given parameters (`self.point_i` and so on).

        `Mechanism.add` calls this method once. The values may be expressions in random variables. The expressions are
        evaluated once for each realisation.
        """
        return {}

    def coordinates(self) -> Mapping[str, Coordinate]:
        """Return the generalised coordinates of the component that have kinetic energy, by name; default: none.

        `Mechanism.add` calls this method after `prepare`. The equations of motion contain one row for each coordinate,
        which follows from the energies, the virtual work and the constraints of all components.
        """
        return {}

    def largest_speeds(self) -> Mapping[str, float]:
        """Return the angular speeds of attached bodies up to which the component is valid; default: none.

        `uqmbd.simulate` warns if a body turns faster.

        Returns
        -------
        mapping of str to float
            Angular speeds by body argument, rad/s.
        """
        return {}

    def drawn_lines(self) -> Sequence[Sequence[Sequence[Any]]]:
        """Return lines along which drawings show the first body argument; default: none, and drawings show a hull.

        Returns
        -------
        sequence of sequence of sequence of numbers or expressions
            Points of each line in the frame of the body, m. They may contain coordinates of the component
            (`Component.coordinate`), so that drawings show deformations. A line of one point is drawn as a dot.
        """
        return ()

    def terms(self, p: Local) -> Iterable[Term]:
        """Yield the terms as expressions in attributes of `p` (never of `self`)."""
        raise NotImplementedError

    def stated(self, p: Local) -> tuple[list[Term], sympy.Matrix]:
        """Return the terms and the reference point of reactions.

        Raises
        ------
        uqmbd.StudyError
            If the method `terms` or `reaction_point` of the component raises any exception. The message states the
            method, the file and the line.
        """
        self.stating = True
        method = "terms()"
        try:
            terms = list(self.terms(p))
            method = "reaction_point()"
            return terms, self.reaction_point(p)
        except StudyError as error:
            raise StudyError(f"{type(self).__name__} {self.name!r}: {error}") from None
        except Exception as error:
            raise StudyError(
                f"{type(self).__name__} {self.name!r}: {method} raised {type(error).__name__}: {error}"
                f"{place_of(error)}. {remedy(error)}"
            ) from error
        finally:
            self.stating = False

    def reaction_point(self, p: Local) -> sympy.Matrix:
        """Return the world position of the reference point of `reaction_moment`.

        The point is `point_i`; without this parameter `point`; without both, the origin of the first body argument.
        """
        if not self.bodies:
            return sympy.zeros(p.space.dimension, 1)
        first = getattr(p, self.bodies[0])
        if isinstance(first, Frame):
            local = p.__dict__["_names"].get("point_i", p.__dict__["_names"].get("point"))
            return first.position if local is None else first.point(local)
        raise TypeError(f"{self.bodies[0]} is not a frame")

    def motion(self) -> Mapping[str, JointAngle | JointDisplacement | None]:
        """Return the motion of the component, by name: `joint.angle`, `joint.displacement`, and their speeds.

        The values are expressions in quantities of bodies (``self.attached["body_i"]``) and parameters.  For most
        joints, `joint_angle` and `joint_displacement` return these values.  None: the quantity does not exist in the
        space.
        """
        return {}

    # -- outputs -----------------------------------------------------------------------------------------------------
    @property
    def reaction_force(self) -> Matrix:
        """Force exerted on body j by body i, world axes, N: a column of symbols for outputs."""
        return sympy.Matrix([ReactionSymbol(self, "reaction_force", k) for k in range(self._space().dimension)])

    @property
    def reaction_moment(self) -> Any:
        """Moment exerted on body j by body i about the component's point on body i, world axes, N m.

        The moment is a column of three symbols in three dimensions and one symbol in planar space; on a line it does
        not exist.
        """
        if self._space().dimension == 1:
            raise AttributeError(
                f"{type(self).__name__} {self.name!r} has no .reaction_moment: there are no moments on a line; "
                "use .reaction_force."
            )
        if self._space().dimension == 2:
            return PlaneReaction(self, "reaction_moment", 0)
        return sympy.Matrix([ReactionSymbol(self, "reaction_moment", k) for k in range(3)])

    def state(self, name: str) -> sympy.Symbol:
        """Return the symbol of an auxiliary differential state, such as a pressure or a temperature.

        The symbol may occur in outputs, requirements, summaries such as `uqmbd.maximum`, and controller measurements.

        Parameters
        ----------
        name : str
            Name of the state in ``p.state(name, units)`` in the terms of the component. The call also sets the units.

        Returns
        -------
        symbol
            Symbol of the state.

        Raises
        ------
        uqmbd.StudyError
            If the component is not in a mechanism, or has no state of this name.

        Examples
        --------
        >>> import uqmbd
        >>> class Leak(uqmbd.Component):
        ...     bodies, spaces = ("body",), (uqmbd.Line,)
        ...     time_constant = uqmbd.Parameter("s", "time constant of the leak")
        ...     area = uqmbd.Parameter("m^2", "area of the piston")
        ...     def terms(self, p):
        ...         pressure = p.state("pressure", "Pa")
        ...         yield uqmbd.Auxiliary(pressure, -pressure / p.time_constant, initial=100)
        ...         yield uqmbd.VirtualWork(p.area * pressure, p.body.velocity[0])
        >>> mechanism = uqmbd.Mechanism("cylinder", uqmbd.Line())
        >>> piston = mechanism.body("piston", mass=1)
        >>> leak = mechanism.add(Leak("leak", piston, time_constant=1, area=0.01))
        >>> mechanism.output("pressure", leak.state("pressure"), units="Pa")
        >>> round(float(uqmbd.simulate(mechanism, [0, 1])["pressure"][-1]), 3)  # 100 exp(-1)
        36.788
        """
        return make_auxiliary_state(self, name, self._space())

    def coordinate(self, name: str, derivative: int = 0) -> sympy.Symbol:
        """Return the symbol of a coordinate of this component, or of its time derivative.

        The symbol may occur in outputs, requirements, start conditions and summaries. The coordinate and its rate may
        also occur in parameters of other components.

        Parameters
        ----------
        name : str
            Name of the coordinate in the method `coordinates` of the component.
        derivative : int
            0 for the coordinate, 1 for its rate, 2 for its acceleration (outputs only).

        Returns
        -------
        symbol
            Symbol of the coordinate, with units.

        Raises
        ------
        uqmbd.StudyError
            If the component is not in a mechanism, or has no coordinate of this name.

        Examples
        --------
        >>> import uqmbd
        >>> class Rotor(uqmbd.Component):
        ...     bodies, spaces = ("body",), (uqmbd.Line,)
        ...     inertia = uqmbd.Parameter("kg m^2", "second moment of mass")
        ...     def coordinates(self):
        ...         return {"angle": uqmbd.extend.Coordinate("rad", rate=3)}
        ...     def terms(self, p):
        ...         yield uqmbd.Kinetic(p.inertia * p.coordinate("angle", 1) ** 2 / 2)
        >>> mechanism = uqmbd.Mechanism("drive", uqmbd.Line())
        >>> rotor = mechanism.add(Rotor("rotor", mechanism.ground, inertia=2))
        >>> mechanism.output("angle", rotor.coordinate("angle"), units="rad")
        >>> round(float(uqmbd.simulate(mechanism, [0, 2])["angle"][-1]), 6)
        6.0
        """
        return coordinate_symbol(self, name, derivative)

    @checked
    def event_time(self, label: str, number: int = 1) -> sympy.Symbol:
        """Return the time of an event, s, for scalar outputs.

        Parameters
        ----------
        label : str
            Label of the `Event`, such as ``impact``. An impact also has ``rest`` (bodies stay in contact),
            ``lift-off``, ``stick`` and ``slip``.
        number : int
            Number of the occurrence of the event, from 1.

        Returns
        -------
        symbol
            Symbol of the time, s. In a realisation with fewer occurrences by the last output time, the value is
            censored, as for `uqmbd.first_time`: the realisation has not failed, but has no value. Statistics of samples
            exclude censored realisations, and contain their share (``censored``). A surrogate of the time is fitted
            only if none of its realisations is censored. `uqmbd.simulate` returns NaN.

        Raises
        ------
        uqmbd.StudyError
            If the component has no event with this label.
        """
        if not isinstance(label, str):
            raise StudyError(
                f"{type(self).__name__} {self.name!r}: event_time: the label is {label!r}; expected the label of an "
                "event, such as 'impact'."
            )
        if isinstance(number, bool) or not isinstance(number, int) or number < 1:
            raise StudyError(
                f"{type(self).__name__} {self.name!r}: event_time({label!r}, {number!r}): "
                f"the number is {number!r}; events are counted from 1."
            )
        return EventTime(self, label, number)

    def __getattr__(self, name: str) -> Any:
        """Return a motion quantity (an expression for outputs, parameters and laws) or a body of the component."""
        if name in type(self).bodies and "attached" in self.__dict__:
            return self.attached[name]
        if hasattr(type(self), name):  # a property that does not exist in this space
            return object.__getattribute__(self, name)
        if name.startswith("_") or "values" not in self.__dict__:
            raise AttributeError(f"{type(self).__name__!r} object has no attribute {name!r}", name=name, obj=self)
        return motion_quantity(self, name)

    def __repr__(self) -> str:
        where = ", ".join(getattr(self.attached[b], "name", repr(self.attached[b])) for b in self.bodies)
        return f"<{type(self).__name__} {self.name!r}: {where}>"
