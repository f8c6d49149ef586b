"""Terms: contributions of a component to the equations of motion, as expressions."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import sympy

from uqmbd.arguments import typechecked

__all__ = [
    "Auxiliary",
    "Constraint",
    "Event",
    "Impact",
    "Kinetic",
    "Potential",
    "Separation",
    "Term",
    "Upright",
    "VelocityConstraint",
    "VirtualWork",
]


@dataclass(frozen=True)
class Kinetic:
    """Kinetic energy, J, in coordinates and velocities.

    Parameters
    ----------
    energy : expression
        J.

    Examples
    --------
    A mass that is added at the origin of a body halves what a force brings about:

    >>> import uqmbd
    >>> class Load(uqmbd.Component):
    ...     bodies, spaces = ("body",), (uqmbd.Line,)
    ...     mass = uqmbd.Parameter("kg", "mass at the origin of the body")
    ...     def terms(self, p):
    ...         yield uqmbd.Kinetic(p.mass * p.body.velocity.dot(p.body.velocity) / 2)
    >>> mechanism = uqmbd.Mechanism("cart", uqmbd.Line(gravity=-9.81))
    >>> cart = mechanism.body("cart", mass=1)
    >>> load = mechanism.add(Load("load", cart, mass=1))
    >>> mechanism.output("height", cart.position[0], units="m")
    >>> round(float(uqmbd.simulate(mechanism, [0, 1])["height"][-1]), 4)  # of -4.905 m without it
    -2.4525
    """

    energy: Any


@dataclass(frozen=True)
class Potential:
    """Potential energy, J, in coordinates (and auxiliary states whose rate is linear in the velocities).

    Parameters
    ----------
    energy : expression
        J.

    Examples
    --------
    >>> import uqmbd
    >>> class Spring(uqmbd.Component):
    ...     bodies, spaces = ("body",), (uqmbd.Line,)
    ...     stiffness = uqmbd.Parameter("N/m", "spring rate")
    ...     def terms(self, p):
    ...         yield uqmbd.Potential(p.stiffness * p.body.position.dot(p.body.position) / 2)
    >>> mechanism = uqmbd.Mechanism("oscillator", uqmbd.Line())
    >>> mass = mechanism.body("mass", mass=1, position=0.1)
    >>> spring = mechanism.add(Spring("spring", mass, stiffness=4))
    >>> mechanism.output("x", mass.position[0], units="m")
    >>> round(float(uqmbd.simulate(mechanism, [0, 1.5707963])["x"][-1]), 4)  # half a period
    -0.1
    """

    energy: Any


@dataclass(frozen=True)
class VirtualWork:
    """A force and the velocity it acts along: generalised force ``Q_i = force . d velocity / d v_i``.

    Both are scalars, or both are vectors of one length.

    Parameters
    ----------
    force : expression, or vector of them
        N, or N m.
    velocity : expression, or vector of them
        What it does work on, m/s or rad/s, linear in the velocities.

    Examples
    --------
    >>> import uqmbd
    >>> class Damper(uqmbd.Component):
    ...     bodies, spaces = ("body",), (uqmbd.Line,)
    ...     rate = uqmbd.Parameter("N s/m", "damper rate")
    ...     def terms(self, p):
    ...         yield uqmbd.VirtualWork(-p.rate * p.body.velocity, p.body.velocity)
    >>> mechanism = uqmbd.Mechanism("slide", uqmbd.Line())
    >>> mass = mechanism.body("mass", mass=1, velocity=1)
    >>> damper = mechanism.add(Damper("damper", mass, rate=2))
    >>> mechanism.output("speed", mass.velocity[0], units="m/s")
    >>> round(float(uqmbd.simulate(mechanism, [0, 1])["speed"][-1]), 4)  # exp(-2)
    0.1353
    """

    force: Any
    velocity: Any


@typechecked
@dataclass(frozen=True)
class Constraint:
    """Holonomic equations ``phi(q, t) = 0``.

    What binds velocities alone is a `VelocityConstraint`.

    Parameters
    ----------
    equations : expression, or vector of them
        Polynomials in the coordinates wherever the geometry allows.
    label : str
        What they hold together ("point", "axis"), for messages; numbered where there are several.

    Examples
    --------
    >>> import uqmbd
    >>> class Circle(uqmbd.Component):
    ...     bodies, spaces = ("body",), (uqmbd.Translational,)
    ...     radius = uqmbd.Parameter("m", "radius of the circle")
    ...     def terms(self, p):
    ...         yield uqmbd.Constraint(p.body.position.dot(p.body.position) - p.radius**2)
    >>> mechanism = uqmbd.Mechanism("bead", uqmbd.Translational())
    >>> bead = mechanism.body("bead", mass=1, position=(1, 0))
    >>> circle = mechanism.add(Circle("circle", bead, radius=1))
    >>> uqmbd.check(mechanism).mobility
    1
    """

    equations: Any
    label: str = ""


@typechecked
@dataclass(frozen=True)
class VelocityConstraint:
    """Equations ``a(q, t) . v + b(q, t) = 0`` between velocities: nonholonomic constraints.

    Of wheels that roll, skates and knife edges, whose equations are no derivatives of equations of positions.  They
    hold at the level of velocities: initial velocities satisfy them, impacts keep them, and positions are not
    assembled by them.  Their reactions do no work where ``b`` is zero (Lagrange and d'Alembert; Neimark and Fufaev,
    Dynamics of Nonholonomic Systems, 1972).

    Parameters
    ----------
    equations : expression, or vector of them
        In coordinates, velocities, states and time, linear in the velocities; m/s, or rad/s.
    label : str
        What they hold together ("rolling", "blade"), for messages; numbered where there are several.

    Raises
    ------
    uqmbd.StudyError
        When the mechanism is built: an equation contains no velocity, or is not linear in the velocities.

    Examples
    --------
    A knife edge under the origin of a body, seen from above: no velocity across its x axis.

    >>> import uqmbd
    >>> class Edge(uqmbd.Component):
    ...     bodies = ("body",)
    ...     spaces = (uqmbd.Planar,)
    ...     def terms(self, p):
    ...         yield uqmbd.extend.VelocityConstraint(p.body.direction((0, 1)).dot(p.body.velocity), "edge")
    >>> mechanism = uqmbd.Mechanism("sleigh", uqmbd.Planar())
    >>> sleigh = mechanism.body("sleigh", mass=1, inertia=0.1)
    >>> edge = mechanism.add(Edge("edge", sleigh))
    >>> found = uqmbd.check(mechanism)
    >>> found.mobility, found.velocity_mobility
    (3, 2)
    """

    equations: Any
    label: str = ""


@dataclass(frozen=True)
class Auxiliary:
    """A differential state of the component's own, ``state' = rate``.

    Parameters
    ----------
    state : symbol
        From ``Local.state(name)``.
    rate : expression
        In coordinates, velocities, states and time.
    initial : expression
        Its value at the start, in coordinates.

    Examples
    --------
    A force that comes with a delay has a state of its own; it drives a mass to the speed ``t - 1 + exp(-t)``:

    >>> import uqmbd
    >>> class Delayed(uqmbd.Component):
    ...     bodies, spaces = ("body",), (uqmbd.Line,)
    ...     delay = uqmbd.Parameter("s", "time constant")
    ...     def terms(self, p):
    ...         force = p.state("force")
    ...         yield uqmbd.Auxiliary(force, (1 - force) / p.delay, initial=0)
    ...         yield uqmbd.VirtualWork(force, p.body.velocity[0])
    >>> mechanism = uqmbd.Mechanism("cart", uqmbd.Line())
    >>> cart = mechanism.body("cart", mass=1)
    >>> motor = mechanism.add(Delayed("motor", cart, delay=1))
    >>> mechanism.output("speed", cart.velocity[0], units="m/s")
    >>> round(float(uqmbd.simulate(mechanism, [0, 1])["speed"][-1]), 4)  # exp(-1)
    0.3679
    """

    state: sympy.Symbol
    rate: Any
    initial: Any


@typechecked
@dataclass(frozen=True)
class Upright:
    """An expression that is positive in the intended assembly and negative in its mirror image.

    The cosine between two axes that are to be parallel, for example: the dot products that make them so vanish as well
    when one of them points the other way.

    Parameters
    ----------
    cosine : expression
        In coordinates.
    label : str
        What it is of, for messages.

    Examples
    --------
    A bead on a circle may start at the right or at the left; it is to be the right:

    >>> import uqmbd
    >>> class Ring(uqmbd.Component):
    ...     bodies, spaces = ("body",), (uqmbd.Translational,)
    ...     radius = uqmbd.Parameter("m", "radius of the ring")
    ...     def terms(self, p):
    ...         yield uqmbd.Constraint(p.body.position.dot(p.body.position) - p.radius**2)
    ...         yield uqmbd.Upright(p.body.position[0], "side")
    >>> mechanism = uqmbd.Mechanism("bead", uqmbd.Translational())
    >>> bead = mechanism.body("bead", mass=1, position=(-1, 0))
    >>> ring = mechanism.add(Ring("ring", bead, radius=1))
    >>> mechanism.output("x", bead.position[0], units="m")
    >>> try:
    ...     uqmbd.simulate(mechanism, [0, 1])
    ... except uqmbd.AssemblyError as error:
    ...     print(str(error)[:97])
    mechanism 'bead' cannot be assembled: ring: side was assembled in its mirror image, half a turn o
    """

    cosine: Any
    label: str = "axis"


@typechecked
@dataclass(frozen=True)
class Impact:
    """How velocities jump where bodies hit each other: Newton's law of restitution, with Coulomb friction.

    Parameters
    ----------
    speed : expression
        Rate at which the gap opens, m/s (``p.rate_of(gap)``), linear in the velocities; after the impact it is
        ``-restitution`` times what it was.
    restitution : expression
        From 0 (they stay together) to 1.
    sliding : expression, or vector of them
        Relative velocity along the surface, m/s, linear in the velocities; may be left out without friction.
    friction : expression
        Coefficient of friction, of the impulses and of the forces where bodies stay in contact.

    Examples
    --------
    A ball that falls 1 m on a floor leaves it with half of its speed, and rises to a quarter of the height:

    >>> import uqmbd
    >>> class Floor(uqmbd.Component):
    ...     bodies, spaces = ("body",), (uqmbd.Line,)
    ...     def terms(self, p):
    ...         gap = p.let("gap", p.body.position[0])
    ...         yield uqmbd.Event(gap, uqmbd.extend.Impact(p.rate_of(gap), restitution=0.5))
    >>> mechanism = uqmbd.Mechanism("ball", uqmbd.Line(gravity=-2))
    >>> ball = mechanism.body("ball", mass=1, position=1)
    >>> floor = mechanism.add(Floor("floor", ball))
    >>> mechanism.output("height", ball.position[0], units="m")
    >>> round(float(uqmbd.simulate(mechanism, [0, 1, 1.5])["height"][-1]), 4)
    0.25
    """

    speed: Any
    restitution: Any = 0
    sliding: Any = ()
    friction: Any = 0


@typechecked
@dataclass(frozen=True)
class Event:
    """Event at which an expression falls through zero.

    The time is found, and is available to outputs as `Component.event_time`.

    Parameters
    ----------
    guard : expression
        In coordinates, velocities, states and time; of an impact the gap, m.
    jump : Impact, optional
        None: nothing happens, the time is only noted.
    label : str
        What it is called.

    Examples
    --------
    A floor that throws a ball back, and when it does so:

    >>> import uqmbd
    >>> class Floor(uqmbd.Component):
    ...     bodies, spaces = ("body",), (uqmbd.Line,)
    ...     def terms(self, p):
    ...         gap = p.let("gap", p.body.position[0])
    ...         yield uqmbd.Event(gap, uqmbd.extend.Impact(p.rate_of(gap), restitution=1))
    >>> mechanism = uqmbd.Mechanism("ball", uqmbd.Line(gravity=-9.81))
    >>> ball = mechanism.body("ball", mass=1, position=1)
    >>> floor = mechanism.add(Floor("floor", ball))
    >>> mechanism.output("first", floor.event_time("impact"), units="s")
    >>> round(float(uqmbd.simulate(mechanism, [0, 0.5])["first"]), 4)  # sqrt(2 / 9.81)
    0.4515
    """

    guard: Any
    jump: Impact | None = None
    label: str = "impact"


@dataclass(frozen=True)
class Separation:
    """A gap between bodies that is open, or hardly closed, where a motion starts.

    It changes nothing about the motion; where bodies overlap by much at the start, a `uqmbd.StudyWarning` says so.

    Parameters
    ----------
    gap : expression
        m, in coordinates and time; negative where the bodies overlap.
    reach : expression
        Depth, m, beyond which the bodies overlap by much, such as a radius; 0: a tenth of the mechanism's size, which
        is the most in any case.

    Examples
    --------
    A warning reports a wall that overlaps a ball at the start; the wall has no effect:

    >>> import warnings
    >>> import uqmbd
    >>> class Wall(uqmbd.Component):
    ...     bodies, spaces = ("body",), (uqmbd.Line,)
    ...     def terms(self, p):
    ...         yield uqmbd.extend.Separation(p.body.position[0], reach=0.01)
    >>> mechanism = uqmbd.Mechanism("ball", uqmbd.Line())
    >>> ball = mechanism.body("ball", mass=1, position=-0.5)
    >>> wall = mechanism.add(Wall("wall", ball))
    >>> mechanism.output("x", ball.position[0], units="m")
    >>> with warnings.catch_warnings(record=True) as seen:
    ...     warnings.simplefilter("always")
    ...     motion = uqmbd.simulate(mechanism, [0, 1])
    >>> [str(warning.message)[:29] for warning in seen]
    ["Wall 'wall' starts 0.5 m deep"]
    """

    gap: Any
    reach: Any = 0


Term = Kinetic | Potential | VirtualWork | Constraint | VelocityConstraint | Auxiliary | Upright | Event | Separation
