"""Terms: contributions of a component to the equations of motion, as expressions."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import sympy

from uqmbd.arguments import typechecked
from uqmbd.mechanism.components.event_terms import DryFriction, Event, Separation

__all__ = [
    "Auxiliary",
    "Constraint",
    "Kinetic",
    "Potential",
    "Term",
    "Upright",
    "VelocityConstraint",
    "VirtualWork",
]


@typechecked(values=False)
@dataclass(frozen=True)
class Kinetic:
    """Kinetic energy, J, in coordinates and velocities.

    Parameters
    ----------
    energy : expression
        Kinetic energy, J.

    Examples
    --------
    A mass at the origin of a body halves the acceleration due to a force:

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


@typechecked(values=False)
@dataclass(frozen=True)
class Potential:
    """Potential energy, J, in coordinates and in auxiliary states whose rates are linear in the velocities.

    Parameters
    ----------
    energy : expression
        Potential energy, J.

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


@typechecked(values=False)
@dataclass(frozen=True)
class VirtualWork:
    """Force and conjugate velocity, with the generalised force ``Q_i = force . d velocity / d v_i``.

    Force and velocity are scalars, or vectors of the same length.

    Parameters
    ----------
    force : expression, or vector of expressions
        Force, N, or moment, N m.
    velocity : expression, or vector of expressions
        Velocity at which the force does work, m/s or rad/s; linear in the velocities of the mechanism.

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

    Use `VelocityConstraint` for equations in velocities.

    Parameters
    ----------
    equations : expression, or vector of expressions
        Left-hand sides ``phi``; use polynomials in the coordinates if the geometry allows it.
    label : str
        Name of the constrained quantity (``point``, ``axis``), for messages. Several equations are numbered.

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

    Examples are rolling wheels, skates and knife edges. The equations of such constraints are not derivatives of
    equations in positions. Initial velocities and velocities after impacts satisfy the equations. The assembly of
    positions does not use the equations. Reactions of these constraints do no work if ``b`` is zero (Lagrange and
    d'Alembert; Neimark and Fufaev, Dynamics of Nonholonomic Systems, 1972).

    Parameters
    ----------
    equations : expression, or vector of expressions
        Left-hand sides, m/s or rad/s, in coordinates, velocities, states and time; linear in the velocities.
    label : str
        Name of the constrained quantity (``rolling``, ``blade``), for messages. Several equations are numbered.

    Raises
    ------
    uqmbd.StudyError
        When the mechanism is built, if an equation contains no velocity or is not linear in the velocities.

    Examples
    --------
    A knife edge under the origin of a body, in top view, prevents velocities perpendicular to the x axis of the body:

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


@typechecked(values=False)
@dataclass(frozen=True)
class Auxiliary:
    """Auxiliary differential state of a component, with the equation ``state' = rate``.

    Parameters
    ----------
    state : symbol
        Symbol of the state, from ``Local.state(name)``.
    rate : expression
        Time derivative of the state, in coordinates, velocities, states and time.
    initial : expression
        Initial value of the state, in coordinates.

    Examples
    --------
    A delayed force is a state; it drives a mass to the speed ``t - 1 + exp(-t)``:

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
    """Expression that is positive in the intended assembly and negative in its mirror image.

    An example is the cosine of the angle between two axes that a constraint makes parallel. If the constraint uses dot
    products, they also vanish if one axis has the opposite direction.

    Parameters
    ----------
    cosine : expression
        Expression in coordinates, such as the cosine of the angle between two axes.
    label : str
        Name of the owner of the axes, such as a joint, for messages.

    Examples
    --------
    A bead on a circle can start on the right or on the left; this term selects the start on the right:

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


Term = (
    Kinetic
    | Potential
    | VirtualWork
    | Constraint
    | VelocityConstraint
    | Auxiliary
    | Upright
    | Event
    | DryFriction
    | Separation
)
