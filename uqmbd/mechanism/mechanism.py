"""The mechanism: bodies, components and outputs, declared once.

Length: it is one class, whose public methods have examples.
"""

from __future__ import annotations

from collections.abc import Callable, Hashable, Sequence, Sized
from typing import Any, TypeVar

from uqmbd.arguments import typechecked
from uqmbd.display import html_of
from uqmbd.errors import StudyError
from uqmbd.mechanism.bodies import Body, Ground
from uqmbd.mechanism.components import Component
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
from uqmbd.mechanism.expressions import is_scalar, random_variables, shown
from uqmbd.mechanism.geometry import Space
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
        What appears in data and reports.
    space : Spatial, Planar, Translational or Line
        What the bodies move in, with the gravity.

    Raises
    ------
    uqmbd.StudyError
        If the space or the name cannot be used.

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
                f"mechanism {name!r}: the space is {shown(space)}; expected uqmbd.Spatial(gravity=(0, 0, -9.81)), "
                "uqmbd.Planar(gravity=(0, -9.81)), uqmbd.Translational(...) or uqmbd.Line(gravity=-9.81), called."
            )
        require_known(self, f"mechanism {name!r}: gravity", space.gravity, "law")
        self.space = space
        self.ground = Ground(space)
        self.outputs: dict[str, Output] = {}
        self.scalars: dict[str, Output] = {}
        """Outputs without a time."""
        self.requirements: dict[str, Requirement] = {}
        """Limits to stay within."""
        self.margins: dict[str, Output] = {}
        self.conditions: dict[str, StartCondition] = {}
        """Start conditions by text."""
        self.effective: dict[Hashable, frozenset[str]] = {}
        """Parameters that have an effect, for classes of components with their options."""
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
    ) -> Body:
        """Add a rigid body, as drawn.

        Every number may be an expression in random variables.

        Parameters
        ----------
        name : str
            Unique among bodies and components.
        mass : number
            kg.
        inertia : number or sequence
            About the centre of mass, body axes, kg m^2: one number in the plane; in space a 3 x 3 matrix or
            ``(Jxx, Jyy, Jzz[, Jxy, Jxz, Jyz])``, all tensor entries; none for point masses.
        com : sequence
            Centre of mass in the body frame, m; default its origin.
        position : sequence
            Of the body frame's origin, world axes, m; default the world's origin.
        angle, quaternion, rotation : number, four numbers, 3 x 3 matrix
            Orientation, body to world: `angle` (rad) in the plane, one of the others in space.
        velocity, angular_velocity : sequence or number, optional
            Initial velocity of the origin (world axes) and initial angular velocity (body axes).  None: solved for,
            with the smallest norm; stated: held.
        hold : bool
            Keep the drawn pose when the mechanism is assembled.

        Returns
        -------
        Body

        Raises
        ------
        uqmbd.StudyError
            If a value is missing, of the wrong dimension, or physically impossible.

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
        body = make_body(self, name, stated, hold)
        self.bodies[name] = body
        return body

    @checked
    def add(self, component: C) -> C:
        """Add a joint, driver, spring, force or controller.

        Parameters
        ----------
        component : Component or Controller
            Its bodies must be of this mechanism (or `ground`).

        Returns
        -------
        Component or Controller
            The same object, so that its reactions can be made outputs.

        Raises
        ------
        uqmbd.StudyError
            If its name is taken, a body is unknown, or a parameter has the wrong dimension.

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
        """Record a scalar expression at every time of a study.

        An angle that is known only up to whole turns, e.g. ``sympy.atan2(...)``, jumps by a turn, and where samples
        stand on both sides of the jump a plain mean means nothing.  Declared with ``angle=True`` it is unwrapped in
        every realisation: whole turns are added. Then it is continuous over the output times. It starts within half a
        turn of the angle of the mechanism at the means of its inputs. Mean, standard deviation, quantiles, Sobol'
        indices and all else in results and reports are then those of the unwrapped angle, which counts turns; beside
        them stand ``circular_mean`` and ``circular_std``, those of the direction, to which turns do not matter.

        Turns are counted from one output time to the next: where an angle moves by half a turn or more between them,
        its turns are lost, and nothing can tell; take more times.  ``body.angle``, ``joint.angle`` and polynomials of
        them are counted by the integration, whatever the times; there ``angle=True`` picks the turn of the start and
        adds the circular statistics.

        Parameters
        ----------
        name : str
            What appears in data, plots and messages.
        expression : SymPy expression
            In positions, velocities, accelerations, reactions, random variables and `uqmbd.t`; or, for an output that
            has one value per realisation and no time, in `uqmbd.eigenfrequency`, `uqmbd.damping_ratio`,
            `uqmbd.at_equilibrium`, `uqmbd.at_steady` and random variables.
        units : str
            As ``m``, ``deg``, or ``1`` for a pure number; if they do not fit it is a `uqmbd.UnitsWarning`.
        angle : bool
            Whether it is an angle, in ``rad`` or ``deg``, that is known only up to whole turns.
        over : str, optional
            Name of an output that is recorded already, over which reports draw this one as well as over time:
            `uqmbd.report.over_output`.

        Raises
        ------
        uqmbd.StudyError
            If it is no scalar, depends on nothing, or speaks of another mechanism; if it is declared an angle, but its
            units are neither ``rad`` nor ``deg``; if its numbers are not in these units, as metres in ``mm``.

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
        found = output_of(self, name, expression, units, angle=angle, over=over)
        (self.scalars if is_scalar(found.expression) else self.outputs)[name] = found

    @checked
    def require(self, name: str, relation: Any, description: str = "") -> None:
        """State a limit that the mechanism has to stay within: how probably it does not is a result of every study.

        Parameters
        ----------
        name : str
        relation : SymPy relation
            ``a <= b``, ``a >= b``, ``a < b`` or ``a > b`` of whatever outputs may contain; limits may be random.  What
            changes with time has to hold at all output times and between them.  Where nothing in it does (frequencies,
            values at rest, what sums a motion up, random variables) it is one statement on each realisation.  No
            difference is made between ``<`` and ``<=``.
        description : str
            In words, for reports.

        Raises
        ------
        uqmbd.StudyError
            If it is no such relation, or mixes what changes with time with what does not.

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
        """Add a start condition, which every realisation meets at its start only.

        Conditions of positions are closed together with the joints: from the drawn pose the mechanism is moved until
        they hold, and what they leave open moves as little as possible.  Angles are followed on the way, so that
        turns may be given, up to some 150; joints and springs that count turns count these, also where a driver of
        rotation holds the body at this angle.  Conditions of velocities, which
        have to be linear in them, are solved together with the velocities that bodies state.

        Parameters
        ----------
        condition : SymPy expression, or equation
            In positions, points and angles, or in velocities, of bodies of this mechanism.  An equation is
            ``sympy.Eq(expression, value)``; Python compares the sides of ``==`` at once.
        value : number or SymPy expression
            What the expression is at the start, in its units; random variables may occur.

        Raises
        ------
        uqmbd.StudyError
            If it is no equation of such quantities, or was stated already.  The assembly reports an equation that
            cannot be met, or that follows from the others.

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
        """Make numbers of bodies and components random, by the pattern of their names (``docs/how-to/randomise.md``).

        Parameters
        ----------
        pattern : str or sequence of str
            ``*``, ``?`` and ``[abc]`` stand for characters of ``BODY.mass``, ``BODY.com``, ``BODY.inertia``,
            ``COMPONENT.parameter``, or an entry of a vector, as ``BODY.com.x``.
        relative, absolute : float
            Standard deviation, over the size of the number or in its units; the mean is the number itself.
        distribution : str, uqmbd.typing.Distribution or function
            ``"normal"``, ``"lognormal"``, ``"uniform"``; by default normal, in a range lognormal or beta.  Instead of
            a standard deviation: a distribution of a factor, or a function from number to distribution.

        Returns
        -------
        list of RandomVariable
            Named like the numbers.  An inertia tensor has one for each principal second moment of mass.

        Raises
        ------
        uqmbd.StudyError
            If nothing matches, nothing of it can vary, or a distribution leaves the range of a number.

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

    def revision(self) -> tuple[int, ...]:
        """Return numbers that change whenever something is added, or parameters get other values.

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
            What is asked for, e.g. a model for some initial time.
        make : callable
            Makes it.

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
        """All random variables that enter anything, ordered by name, with their joint distribution."""
        return self.remembered("inputs", lambda: JointInput.of(self._used()))

    def used_inputs(self) -> frozenset[str]:
        """Return the names of random variables that enter something; dependent ones may be inputs without that.

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
        """Return all that is observed: outputs over time, those without, and the margins of requirements.

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
        """Return the bodies' own terms, then the components, in the order in which they were added.

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

    def moving_inputs(self) -> frozenset[RandomVariable]:
        """Return the random variables that enter the motion: all but those that outputs alone contain.

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
        values += [self.space.gravity, *(c.residual for c in self.conditions.values())]
        values += [number for controller in self.controllers.values() for number in controller.numbers]
        return frozenset(variable for value in values for variable in random_variables(value))

    def _used(self) -> set[RandomVariable]:
        values = [output.expression for output in self.observed()]
        return {variable for value in values for variable in random_variables(value)} | self.moving_inputs()

    def _control(self, controller: Controller) -> None:
        """Add a controller; the names of measured outputs are resolved when the equations are made."""
        if self.controllers.get(controller.name) is controller:
            raise StudyError(f"{controller.where}: it has been added to mechanism {self.name!r} already.")
        require_free(self, controller.name, controller.where)
        require_measured(self, controller)
        self.controllers[controller.name] = controller

    def _repr_html_(self) -> str | None:
        """Tables and a picture, for notebooks."""
        return html_of(self)

    def __copy__(self) -> Mechanism:
        """Return a copy that may have other outputs; bodies and components are shared."""
        other = object.__new__(type(self))
        kept = {k: dict(v) if isinstance(v, dict) else v for k, v in vars(self).items()}
        other.__dict__.update({**kept, "_memory": {}})
        return other

    def __repr__(self) -> str:
        return (
            f"<mechanism {self.name!r}: {len(self.bodies)} bodies, {len(self.components)} components, "
            f"{len(self.outputs) + len(self.scalars)} outputs>"
        )
