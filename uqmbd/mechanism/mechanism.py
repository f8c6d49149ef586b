"""Mechanism with its bodies, components and outputs.

Length: the module contains one class, and its public methods have examples.
"""

from __future__ import annotations

from collections.abc import Callable, Hashable, Sequence, Sized
from dataclasses import replace
from typing import Any, TypeVar

from uqmbd.arguments import typechecked
from uqmbd.display import display_function, html_of
from uqmbd.errors import StudyError
from uqmbd.mechanism.bodies import Body, Ground
from uqmbd.mechanism.components import Component, coordinates_of
from uqmbd.mechanism.controller import Controller
from uqmbd.mechanism.declared import (
    Output,
    Requirement,
    StartCondition,
    output_of,
    require_free,
    require_known,
    require_measured,
    requirement_of,
    start_condition,
)
from uqmbd.mechanism.expressions import (
    MotionSymbol,
    OutputSeries,
    Summary,
    is_scalar,
    path_keys,
    random_variables,
    shown,
)
from uqmbd.mechanism.geometry import BodyShape, Space
from uqmbd.mechanism.new_body import make_body
from uqmbd.mechanism.new_component import prepare_component
from uqmbd.mechanism.randomise import randomise_numbers
from uqmbd.names import check_name, checked
from uqmbd.randomness import JointInput, RandomVariable
from uqmbd.typing import Quantity, Vector

__all__ = ["Mechanism"]

C = TypeVar("C", bound=Component | Controller)
T = TypeVar("T")


class Mechanism:
    """Bodies, their joints, drivers and loads, and the outputs of their motion.

    Parameters
    ----------
    name : str
        Name of the mechanism in data and reports.
    space : Spatial, Planar, Translational or Line
        Space of the motion, with its gravity.

    Raises
    ------
    uqmbd.StudyError
        If the space or the name is invalid.

    Examples
    --------
    >>> import uqmbd
    >>> mechanism = uqmbd.Mechanism("falling", uqmbd.Planar(gravity=(0, -9.81)))
    >>> stone = mechanism.body("stone", mass=1, inertia=0.1, position=(0, 10))
    >>> mechanism.output("height", stone.position[1], units="m")
    >>> list(mechanism.outputs)
    ['height']
    """

    @checked
    def __init__(self, name: str, space: Space) -> None:
        self.name = check_name(name, "mechanism")
        self.bodies: dict[str, Body] = {}
        self.components: dict[str, Component] = {}
        self.controllers: dict[str, Controller] = {}
        if not isinstance(space, Space):
            raise StudyError(
                f"mechanism {name!r}: the space is {shown(space)}; expected e.g. uqmbd.Spatial(gravity=(0, 0, "
                "-9.81)), uqmbd.Planar(gravity=(0, -9.81)), uqmbd.Translational(...) or uqmbd.Line(gravity=-9.81)."
            )
        require_known(self, f"mechanism {name!r}: gravity", space.gravity, "law")
        self.space = space
        self.ground = Ground(space)
        self.outputs: dict[str, Output] = {}
        self.scalars: dict[str, Output] = {}
        """Scalar outputs, which have no time."""
        self.requirements: dict[str, Requirement] = {}
        """Requirements by name."""
        self.margins: dict[str, Output] = {}
        self.conditions: dict[str, StartCondition] = {}
        """Start conditions by text."""
        self.effective: dict[Hashable, frozenset[str]] = {}
        """Parameters with an effect, by class and options of components."""
        self._memory: dict[Hashable, tuple[tuple[int, ...], Any]] = {}

    @checked
    def body(
        self,
        name: str,
        mass: Quantity | None = None,
        inertia: Vector | Sequence[Vector] | None = None,
        com: Vector | None = None,
        position: Vector | None = None,
        angle: Quantity | None = None,
        quaternion: Vector | None = None,
        rotation: Vector | Sequence[Vector] | None = None,
        velocity: Vector | None = None,
        angular_velocity: Vector | None = None,
        hold: bool = False,
        shape: BodyShape | Sequence[BodyShape] | None = None,
    ) -> Body:
        """Add a rigid body in its given pose.

        Each number may be an expression in random variables.

        Parameters
        ----------
        name : str
            Name of the body, unique among bodies and components.
        mass : number
            Mass, kg.
        inertia : number or sequence
            Inertia tensor about the centre of mass in body axes, kg m^2. In planar space: one number. In three
            dimensions: a 3 x 3 matrix or ``(Jxx, Jyy, Jzz[, Jxy, Jxz, Jyz])``, entries of the tensor. Point masses have
            no inertia.
        com : sequence
            Centre of mass in the body frame, m. Default: the origin of the body frame.
        position : sequence
            Position of the origin of the body frame in world axes, m. Default: the world origin.
        angle, quaternion, rotation : number, four numbers, 3 x 3 matrix
            Orientation of the body frame in the world: `angle` (rad) in planar space, `quaternion` or `rotation` in
            three dimensions.
        velocity, angular_velocity : sequence or number, optional
            Initial velocity of the origin, m/s (world axes), and initial angular velocity, rad/s (body axes). Assembly
            does not change given values. Default: the values of smallest norm that satisfy the constraints.
        hold : bool
            Whether assembly keeps the given pose of the body.
        shape : BodyShape or sequence of BodyShape, optional
            Shapes of the body (`uqmbd.shapes`), which are drawn and do not affect the motion.

        Returns
        -------
        Body
            The new body.

        Raises
        ------
        uqmbd.StudyError
            If a value is missing, has the wrong dimension, or is physically impossible.

        Examples
        --------
        >>> import sympy
        >>> import uqmbd
        >>> mechanism = uqmbd.Mechanism("arm", uqmbd.Planar())
        >>> arm = mechanism.body("arm", mass=2, inertia=0.5, position=(1, 0), angle=sympy.pi / 2)
        >>> arm.mass, list(mechanism.bodies), uqmbd.check(mechanism).mobility
        (2, ['arm'], 3)
        """
        where = f"body {check_name(name, 'body')!r}"
        require_free(self, name, where)
        stated = {
            "mass": mass, "inertia": inertia, "com": com, "position": position, "angle": angle, "rotation": rotation,
            "quaternion": quaternion, "velocity": velocity, "angular_velocity": angular_velocity,
        }  # fmt: skip
        body = make_body(self, name, stated, hold, shape)
        self.bodies[name] = body
        return body

    @checked
    def add(self, component: C) -> C:
        """Add a joint, driver, spring, force or controller.

        Parameters
        ----------
        component : Component or Controller
            Component or controller to add; its bodies must belong to this mechanism or be `ground`.

        Returns
        -------
        Component or Controller
            The added object; outputs can contain its reactions.

        Raises
        ------
        uqmbd.StudyError
            If the name is already used, a body is unknown, or a parameter has the wrong dimension.

        Examples
        --------
        >>> from uqmbd_springs import SpringDamper
        >>> import uqmbd
        >>> mechanism = uqmbd.Mechanism("stone", uqmbd.Line(gravity=-9.81))
        >>> stone = mechanism.body("stone", mass=1, position=1)
        >>> spring = mechanism.add(SpringDamper("spring", mechanism.ground, stone, 0, 0, stiffness=100))
        >>> spring.name, list(mechanism.components)
        ('spring', ['spring'])
        """
        given: Any = component
        if isinstance(given, Controller):
            self._control(given)
            return component
        part = prepare_component(self, given)
        self.components[part.name] = part
        return component

    @checked
    def output(self, name: str, expression: Any, units: str = "", angle: bool = False, over: str | None = None) -> None:
        """Record a scalar expression, at every time of a study or once in each realisation.

        An angle known only up to whole turns, such as ``sympy.atan2(...)``, jumps by one turn.  If realisations are on
        both sides of the jump, the arithmetic mean has no meaning.  ``angle=True`` adds whole turns to the angle of
        every realisation, so that this unwrapped angle is continuous over the output times.  The first value of the
        unwrapped angle is within half a turn of the angle of the mechanism at the means of its inputs.  The statistics
        in results and reports then refer to the unwrapped angle: mean, standard deviation, variance, skewness,
        kurtosis, quantiles, their errors and Sobol' indices.  Results also contain the circular statistics
        ``circular_mean`` and ``circular_std``, which refer to the direction and are independent of whole turns.

        Unwrapping compares successive output times.  If an angle changes by half a turn or more between two output
        times, turns are lost without a warning; use more output times.  The integration itself counts the turns of
        ``body.angle``, ``joint.angle`` and polynomials of these angles, for any output times.  For these angles,
        ``angle=True`` selects the turn of the initial value and adds the circular statistics.

        Parameters
        ----------
        name : str
            Name of the output in data, plots and messages.
        expression : SymPy expression
            Expression in positions, velocities, accelerations, reactions, random variables and `uqmbd.t`. An expression
            in quantities that do not depend on time is a scalar output, with one value in each realisation. Such
            quantities are `uqmbd.eigenfrequency`, `uqmbd.damping_ratio`, `uqmbd.at_equilibrium`, `uqmbd.at_steady`,
            summaries of the motion such as `uqmbd.maximum`, event times, and random variables.
        units : str
            Units of the output, such as ``m`` or ``deg``; ``1`` for a pure number. Units that do not fit the expression
            give a `uqmbd.UnitsWarning`.
        angle : bool
            Whether the output is an angle in ``rad`` or ``deg`` that is known only up to whole turns.
        over : str, optional
            Name of an earlier output for the horizontal axis of an additional figure in reports, as drawn by
            `uqmbd.report.over_output`.

        Raises
        ------
        uqmbd.StudyError
            If the expression is not a scalar, is constant, or contains quantities of another mechanism. The error also
            occurs if an angle has units other than ``rad`` or ``deg``. It also occurs if the units of the expression
            differ from `units` by a factor, such as metres for ``mm``.

        Examples
        --------
        >>> import sympy, uqmbd
        >>> mechanism = uqmbd.Mechanism("wheel", uqmbd.Planar())
        >>> wheel = mechanism.body("wheel", mass=1, inertia=1, angular_velocity=4)
        >>> x, y = wheel.point((1, 0))
        >>> mechanism.output("direction", sympy.atan2(y, x), units="rad", angle=True)
        >>> [round(float(angle), 3) for angle in uqmbd.simulate(mechanism, [0, 0.5, 1, 1.5])["direction"]]
        [0.0, 2.0, 4.0, 6.0]
        """
        if isinstance(expression, OutputSeries):
            for one, (quantity, place) in expression.named(check_name(name, "output")).items():
                found = output_of(self, one, quantity, units, angle=angle, over=over)
                self.scalars[one] = replace(found, place=place)
            return
        found = output_of(self, name, expression, units, angle=angle, over=over)
        (self.scalars if is_scalar(found.expression) else self.outputs)[name] = found

    @checked
    def require(self, name: str, relation: Any, description: str = "") -> None:
        """Add a requirement; every study computes the probability that it is violated.

        Parameters
        ----------
        name : str
            Name of the requirement in data and reports.
        relation : SymPy relation
            Relation ``a <= b``, ``a >= b``, ``a < b`` or ``a > b`` of expressions as in outputs; limits may be random.
            A relation that depends on time must be true at all output times and between them. A relation of scalar
            outputs and random variables is one condition for each realisation. ``<`` and ``<=`` have the same meaning.
        description : str
            Description of the requirement, for reports.

        Raises
        ------
        uqmbd.StudyError
            If `relation` is not such a relation, or mixes expressions over time with scalar outputs.

        Examples
        --------
        >>> import uqmbd
        >>> from uqmbd_springs import SpringDamper
        >>> mechanism = uqmbd.Mechanism("oscillator", uqmbd.Translational())
        >>> mass = mechanism.body("mass", mass=2, position=(1, 0))
        >>> spring = mechanism.add(SpringDamper("spring", mechanism.ground, mass, (0, 0), (0, 0), stiffness=8))
        >>> mechanism.require("stiff enough", uqmbd.eigenfrequency(1) >= 0.3, description="first mode, 0.3 Hz")
        >>> mechanism.requirements["stiff enough"].relation
        'eigenfrequency(1) >= 0.3'
        """
        self.requirements[name], self.margins[name] = requirement_of(self, name, relation, description)

    @checked
    def start(self, condition: Any, value: Any = None) -> None:
        """Add a start condition, which every realisation satisfies at its start only.

        The assembly satisfies conditions in positions together with the joints.  It moves the mechanism from the given
        pose until all conditions are satisfied, with the smallest motion of the remaining degrees of freedom.  The
        assembly tracks angles, so that a condition may contain up to about 150 turns.  The turn counts of joints and
        springs include these turns, even if a rotation driver determines the angle.  Conditions in velocities must be
        linear in the velocities.  These conditions are solved together with the given velocities of bodies.

        Parameters
        ----------
        condition : SymPy expression, or equation
            Expression or equation in positions, points and angles, or in velocities, of bodies of this mechanism. Write
            an equation as ``sympy.Eq(expression, value)``, because ``==`` in Python immediately returns True or False.
        value : number or SymPy expression
            Initial value of the expression, in its units; it may contain random variables.

        Raises
        ------
        uqmbd.StudyError
            If the condition is invalid or was already added. The assembly later reports conditions that cannot be
            satisfied or that follow from other conditions.

        Examples
        --------
        >>> import uqmbd
        >>> from uqmbd_joints import Revolute
        >>> mechanism = uqmbd.Mechanism("pendulum", uqmbd.Planar(gravity=(0, -9.81)))
        >>> rod = mechanism.body("rod", mass=1, inertia=1 / 12, position=(0.5, 0))
        >>> pivot = mechanism.add(Revolute("pivot", mechanism.ground, rod, (0, 0), (-0.5, 0)))
        >>> mechanism.start(rod.angle, -0.4)
        >>> mechanism.start(rod.angular_velocity, 2.0)
        >>> mechanism.output("tip", rod.point((0.5, 0))[1], units="m")
        >>> round(float(uqmbd.simulate(mechanism, [0, 1])["tip"][0]), 6)
        -0.389418
        """
        found = start_condition(self, condition, value)
        if any(found.residual == other.residual for other in self.conditions.values()):
            raise StudyError(f"mechanism {self.name!r}: start condition {found.text} is stated twice.")
        number = len(self.conditions) + 1
        self.conditions[f"{found.text} ({number})" if found.text in self.conditions else found.text] = found

    @checked
    def randomise(
        self,
        pattern: str | Sequence[str],
        relative: float | None = None,
        absolute: float | None = None,
        distribution: Any = None,
    ) -> list[RandomVariable]:
        """Make numbers of bodies and components random, selected by name (``docs/how-to/randomise.md``).

        Parameters
        ----------
        pattern : str or sequence of str
            Pattern of the names, with the wildcards ``*``, ``?`` and ``[abc]``. Names are ``BODY.mass``, ``BODY.com``,
            ``BODY.inertia`` and ``COMPONENT.parameter``, or entries of vectors, such as ``BODY.com.x``.
        relative, absolute : float
            Standard deviation: `relative` to the absolute value of the number, or `absolute` in the units of the
            number. The number itself is the mean.
        distribution : str, uqmbd.typing.Distribution or function
            ``"normal"``, ``"lognormal"`` or ``"uniform"``. Default: normal; for a number with a range, lognormal or
            beta. Without a standard deviation: the distribution of a factor for the number, or a function that returns
            a distribution for a given number.

        Returns
        -------
        list of RandomVariable
            The new random variables, with the names of the numbers. An inertia tensor has one random variable for each
            principal second moment of mass.

        Raises
        ------
        uqmbd.StudyError
            If no name matches, if no matching number can become random, or if a distribution exceeds the range of a
            number.

        Examples
        --------
        >>> import uqmbd
        >>> mechanism = uqmbd.Mechanism("fall", uqmbd.Line(gravity=-9.81))
        >>> stone = mechanism.body("stone", mass=2)
        >>> mechanism.randomise("*.mass", relative=0.02)
        [stone.mass]
        """
        known = {variable.name for variable in self._used()}
        return randomise_numbers(self, pattern, relative, absolute, distribution, known)

    def view(self, times: Sequence[float] | None = None) -> Any:
        """Show the mechanism on an interactive page; a notebook displays the page if this call ends a cell.

        Parameters
        ----------
        times : sequence of float, optional
            Output times of a motion, s; the page can then play the motion at the chosen inputs.

        Returns
        -------
        MechanismView
            View with the ``address`` of the page on this machine, and the methods ``open()`` and ``close()``.

        Raises
        ------
        uqmbd.StudyError
            If there is no body, or `times` are invalid.

        Examples
        --------
        >>> import uqmbd
        >>> mechanism = uqmbd.Mechanism("stone", uqmbd.Line(gravity=-9.81))
        >>> stone = mechanism.body("stone", mass=2)
        >>> view = mechanism.view()
        >>> view.close()
        """
        return display_function("uqmbd.Mechanism.view")(self, times)

    def revision(self) -> tuple[int, ...]:
        """Return numbers that change with every addition and with every change of parameter values.

        Examples
        --------
        >>> import uqmbd
        >>> mechanism = uqmbd.Mechanism("stone", uqmbd.Line(gravity=-9.81))
        >>> before = mechanism.revision()
        >>> stone = mechanism.body("stone", mass=1)
        >>> before == mechanism.revision()
        False
        """
        parts: tuple[Sized, ...] = (self.bodies, self.components, self.controllers, self.outputs, self.scalars)
        return (*map(len, (*parts, self.requirements, self.conditions)), sum(c.settled for c in self.all_components()))

    @typechecked
    def remembered(self, key: Hashable, make: Callable[[], T]) -> T:
        """Return the stored result of `make` for a key, unless the mechanism has changed since.

        Parameters
        ----------
        key : hashable
            Key of the stored result, such as the initial time of a model.
        make : callable
            Function without arguments that computes the result.

        Examples
        --------
        >>> import uqmbd
        >>> mechanism = uqmbd.Mechanism("stone", uqmbd.Line(gravity=-9.81))
        >>> made = []
        >>> for _ in range(2):
        ...     found = mechanism.remembered("answer", lambda: made.append(1) or 42)
        >>> found, len(made)  # it is made once
        (42, 1)
        """
        revision = self.revision()
        known = self._memory.get(key)
        if known is None or known[0] != revision:
            known = self._memory[key] = (revision, make())
        value: T = known[1]
        return value

    @property
    def inputs(self) -> JointInput:
        """All random variables in use, ordered by name, with their joint distribution."""
        return self.remembered("inputs", lambda: JointInput.of(self._used()))

    def used_inputs(self) -> frozenset[str]:
        """Return the names of random variables in use; `inputs` may also contain unused variables that depend on them.

        Examples
        --------
        >>> import chaospy
        >>> import uqmbd
        >>> speed = uqmbd.RandomVariable("speed", chaospy.Normal(3, 0.2), units="m/s")
        >>> mass = uqmbd.RandomVariable("mass", chaospy.Uniform(1, 2), units="kg")
        >>> mechanism = uqmbd.Mechanism("stone", uqmbd.Line(gravity=-9.81))
        >>> stone = mechanism.body("stone", mass=1, velocity=speed)
        >>> mechanism.output("weight", 9.81 * mass, units="N")
        >>> sorted(mechanism.used_inputs())
        ['mass', 'speed']
        """
        return frozenset(v.name for v in self._used())

    def observed(self) -> tuple[Output, ...]:
        """Return all observed quantities: outputs over time, scalar outputs, and margins of requirements.

        Examples
        --------
        >>> import chaospy
        >>> import uqmbd
        >>> speed = uqmbd.RandomVariable("speed", chaospy.Normal(3, 0.2), units="m/s")
        >>> mass = uqmbd.RandomVariable("mass", chaospy.Uniform(1, 2), units="kg")
        >>> mechanism = uqmbd.Mechanism("stone", uqmbd.Line(gravity=-9.81))
        >>> stone = mechanism.body("stone", mass=1, velocity=speed)
        >>> mechanism.output("weight", 9.81 * mass, units="N")
        >>> mechanism.require("light", 9.81 * mass < 19)
        >>> [output.name for output in mechanism.observed()]
        ['weight', 'light']
        """
        return (*self.outputs.values(), *self.scalars.values(), *self.margins.values())

    def all_components(self) -> list[Component]:
        """Return the terms of bodies, then the components, in the order of their addition.

        Examples
        --------
        >>> import chaospy
        >>> import uqmbd
        >>> speed = uqmbd.RandomVariable("speed", chaospy.Normal(3, 0.2), units="m/s")
        >>> mass = uqmbd.RandomVariable("mass", chaospy.Uniform(1, 2), units="kg")
        >>> mechanism = uqmbd.Mechanism("stone", uqmbd.Line(gravity=-9.81))
        >>> stone = mechanism.body("stone", mass=1, velocity=speed)
        >>> mechanism.output("weight", 9.81 * mass, units="N")
        >>> len(mechanism.all_components())  # gravity and inertia of the only body
        1
        """
        return [*(b.terms for b in self.bodies.values()), *self.components.values()]

    def coordinate_owners(self) -> list[Any]:
        """Return the bodies, then the coordinate sets of components, in the order of the coordinates.

        Examples
        --------
        >>> import uqmbd
        >>> mechanism = uqmbd.Mechanism("stone", uqmbd.Line(gravity=-9.81))
        >>> stone = mechanism.body("stone", mass=1)
        >>> mechanism.coordinate_owners()
        [<body 'stone'>]
        """
        sets = [coordinates_of(component) for component in self.components.values()]
        return [*self.bodies.values(), *(x for x in sets if x is not None)]

    def moving_inputs(self) -> frozenset[RandomVariable]:
        """Return the random variables that affect the motion, without random variables that occur only in outputs.

        Examples
        --------
        >>> import chaospy
        >>> import uqmbd
        >>> speed = uqmbd.RandomVariable("speed", chaospy.Normal(3, 0.2), units="m/s")
        >>> mass = uqmbd.RandomVariable("mass", chaospy.Uniform(1, 2), units="kg")
        >>> mechanism = uqmbd.Mechanism("stone", uqmbd.Line(gravity=-9.81))
        >>> stone = mechanism.body("stone", mass=1, velocity=speed)
        >>> mechanism.output("weight", 9.81 * mass, units="N")
        >>> [variable.name for variable in mechanism.moving_inputs()]
        ['speed']
        """
        values: list[Any] = [value for c in self.all_components() for value in c.values.values()]
        values += [part for b in self.bodies.values() for part in (b.pose.q, b.pose.velocity, b.pose.angular_velocity)]
        sets = (coordinates_of(component) for component in self.components.values())
        values += [x for one in sets if one is not None for c in one.declared.values() for x in (c.initial, c.rate)]
        values += [self.space.gravity, *(c.residual for c in self.conditions.values())]
        values += [number for controller in self.controllers.values() for number in controller.numbers]
        keys = {key for value in values for key in path_keys(value)} if names_of_motion(self) else set()
        return frozenset(keys.union(*map(random_variables, values)))

    def _used(self) -> set[RandomVariable]:
        values: list[Any] = [output.expression for output in self.observed()]
        values += [one.expressions for body in self.bodies.values() for one in body.shapes]
        return {variable for value in values for variable in random_variables(value)} | self.moving_inputs()

    def _control(self, controller: Controller) -> None:
        """Add a controller; the derivation of the equations later resolves the names of measured outputs."""
        if self.controllers.get(controller.name) is controller:
            raise StudyError(f"{controller.where}: the controller has already been added to mechanism {self.name!r}.")
        require_free(self, controller.name, controller.where)
        require_measured(self, controller)
        self.controllers[controller.name] = controller

    def _repr_html_(self) -> str | None:
        """Return tables and a picture as HTML for notebooks."""
        return html_of(self)

    def __copy__(self) -> Mechanism:
        """Return a copy with a separate set of outputs that shares its bodies and components with the original."""
        other = object.__new__(type(self))
        attributes = {k: dict(v) if isinstance(v, dict) else v for k, v in vars(self).items()}
        other.__dict__.update({**attributes, "_memory": {}})
        return other

    def __repr__(self) -> str:
        return (
            f"<mechanism {self.name!r}: {len(self.bodies)} bodies, {len(self.components)} components, "
            f"{len(self.outputs) + len(self.scalars)} outputs>"
        )


def names_of_motion(mechanism: Mechanism) -> tuple[str, ...]:
    """Return the names of outputs and requirements that need an integrated motion."""
    moving = (MotionSymbol, Summary)
    seen = mechanism.observed()
    return tuple(o.name for o in seen if not is_scalar(o.expression) or o.expression.has(*moving))
