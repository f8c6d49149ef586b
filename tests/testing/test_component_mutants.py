"""Mutants of sound components, each with one realistic mistake: `check_component` finds every one.

The oracles are invariants (a closed motion of a passive component gains no energy, a virtual power is the same in two
frames, an unused number has no effect), not numbers of an earlier run.
"""

from __future__ import annotations

import pytest
import sympy

import uqmbd
from uqmbd.testing import check_component

P = uqmbd.Parameter
WORK, STATE = uqmbd.VirtualWork, uqmbd.Auxiliary


def component(terms, *, spaces=(uqmbd.Planar,), bodies=("body_i", "body_j"), **parameters):
    """Make a class of components from its terms, as a function of `p`."""
    own = {"__doc__": "A component.", "spaces": spaces, "bodies": bodies, "terms": lambda self, p: terms(p)}
    return type("Made", (uqmbd.Component,), {**own, **parameters})


def offset(p):
    return p.body_j.position - p.body_i.position


def length(p):
    return p.let("length", sympy.sqrt(offset(p).dot(offset(p)) + sympy.Rational(1, 100)))


def relative(p):
    return p.body_j.velocity - p.body_i.velocity


def damper(sign=-1, spaces=(uqmbd.Planar,)):
    """Return a viscous damper along the line between two bodies."""

    def terms(p):
        speed = p.rate_of(length(p))
        yield uqmbd.Potential(p.stiffness * length(p) ** 2 / 2)
        yield WORK(sign * p.rate * speed, speed)

    numbers = {"rate": P("N s/m", "damper rate", minimum=0), "stiffness": P("N/m", "stiffness", minimum=0)}
    return component(terms, spaces=spaces, **numbers)


def torsion(sign=-1):
    """Return a torsional damper between two bodies in space."""

    def terms(p):
        turning = p.body_j.angular_velocity - p.body_i.angular_velocity
        yield WORK(sign * p.rate * turning, turning)

    return component(terms, spaces=(uqmbd.Spatial,), rate=P("N m s", "damper rate", minimum=0))


def body_axes():
    """Return the same damper, with angular velocities in the axes of two bodies."""

    def terms(p):
        turning = p.body_j.rotation.T * p.body_j.angular_velocity - p.body_i.rotation.T * p.body_i.angular_velocity
        yield WORK(-p.rate * turning, turning)

    return component(terms, spaces=(uqmbd.Spatial,), rate=P("N m s", "damper rate", minimum=0))


def contact(force, spaces=(uqmbd.Translational,)):
    """Return a sphere around the other body, with a law of the depth and its rate."""

    def terms(p):
        depth = p.let("depth", p.radius - length(p))
        rate = p.rate_of(depth)
        push = p.let("push", sympy.Piecewise((0, depth <= 0), (force(p, depth, rate), True)))
        yield WORK(push, -rate)

    radius, stiffness = P("m", "radius", minimum=0, example=3.0), P("N/m", "stiffness", minimum=0)
    return component(terms, spaces=spaces, radius=radius, stiffness=stiffness, loss=P("s/m", "loss", minimum=0))


def friction(slip, sign=-1):
    """Return a friction of two bodies with a smooth law of the slip speed."""

    def terms(p):
        speed = slip(p)
        size = sympy.sqrt(speed.dot(speed) + sympy.Rational(1, 100))
        yield WORK(sign * p.force / size * speed, relative(p))

    return component(terms, spaces=(uqmbd.Translational,), force=P("N", "largest friction", minimum=0))


def tyre(slip):
    """Return a wheel of radius 1 on the ground along x: a force that is proportional to its slip."""

    def terms(p):
        forward, turning = p.body.velocity[0], p.body.angular_velocity[0]
        sliding = forward + p.radius * turning
        yield WORK(-p.stiffness * slip(forward, sliding), sliding)

    numbers = {"stiffness": P("N", "slip stiffness", minimum=0), "radius": P("m", "radius", minimum=0)}
    return component(terms, bodies=("body",), **numbers)


def chamber(rate=-1, leak=-1, force=1, **options):
    """Return two bodies with a chamber between them, whose pressure is a state, with leakage."""
    units, used, of = options.get("units", "Pa"), options.get("used", True), options.get("initial", lambda p: 0)

    def terms(p):
        speed = p.rate_of(length(p))
        pressure = p.state("pressure", units)
        flow = rate * p.area * speed + leak * p.leak * pressure
        yield STATE(pressure, p.bulk / p.volume * flow, of(p))
        if options.get("idle"):
            idle = p.state("idle")
            yield STATE(idle, speed - idle * p.leak / p.volume * p.bulk, 0)
        yield WORK(force * p.area * (pressure if used else p.bulk * speed / speed), speed)

    numbers = {
        "area": P("m^2", "area", minimum=0, example=0.5),
        "volume": P("m^3", "volume", minimum=0, exclusive=True, example=2.0),
        "bulk": P("Pa", "bulk modulus", minimum=0, exclusive=True, example=3.0),
        "leak": P("m^3/Pa/s", "leakage", minimum=0, example=0.1),
    }
    return component(terms, **numbers)


def maxwell(sign=-1):
    """Return a spring and a damper in series: the force of the spring is a state."""

    def terms(p):
        force, speed = p.state("force", "N"), p.rate_of(length(p))
        yield STATE(force, p.stiffness * speed + sign * p.stiffness / p.rate * force, 0)
        yield WORK(-force, speed)

    rate = P("N s/m", "damper rate", minimum=0, exclusive=True)
    return component(terms, rate=rate, stiffness=P("N/m", "stiffness", minimum=0))


def bristles(sign=-1):
    """Return a friction whose bristles are a state, with a damper that acts on their rate."""

    def terms(p):
        speed = p.rate_of(length(p))
        bend = p.state("bend", "m")
        rate = speed - sympy.sqrt(speed**2) * bend / p.reach
        yield STATE(bend, rate, 0)
        yield WORK(-p.stiffness * bend + sign * p.damping * rate, speed)

    numbers = {"stiffness": P("N/m", "of the bristles", minimum=0), "damping": P("N s/m", "of the bristles", minimum=0)}
    return component(terms, **numbers, reach=P("m", "largest bend", minimum=0, exclusive=True))


def bounce(restitution, **options):
    """Return a floor on which a body bounces."""

    def terms(p):
        gap = p.let("gap", p.body_j.position[0] - p.body_i.position[0])
        yield uqmbd.Event(gap, uqmbd.extend.Impact(p.rate_of(gap), restitution(p)), "impact")

    return component(terms, spaces=(uqmbd.Line,), bounce=P("1", "restitution", minimum=0, **options))


def load(axes, turned, at=lambda p: p.body.point(p.point)):
    """Return a force on a body, in axes of the world or of the body."""

    def terms(p):
        force = p.body.direction(p.force) if turned else p.force
        velocity = p.body.point_velocity(p.point)
        yield WORK(force, velocity)
        yield uqmbd.Potential(p.stiffness * at(p).dot(at(p)) / 2)

    point, stiffness = P("m", "point, frame of the body", kind="point"), P("N/m", "stiffness", minimum=0)
    force = P("N", "force", kind="vector", axes=axes)
    return component(terms, bodies=("body",), point=point, stiffness=stiffness, force=force)


def drag(turned=False):
    """Return a drag on a body; `turned`: its force is in body axes, its velocity in those of the world."""

    def terms(p):
        velocity = p.body.velocity
        yield WORK(-p.rate * (p.body.rotation.T * velocity if turned else velocity), velocity)

    return component(terms, bodies=("body",), rate=P("N s/m", "drag", minimum=0))


def idle(spaces, how, **options):
    """Return a spring with a number that changes nothing, though it is in the terms."""

    def terms(p):
        yield uqmbd.Potential(p.stiffness * how(p.idle) * length(p) ** 2 / 2)

    return component(terms, spaces=spaces, stiffness=P("N/m", "stiffness"), idle=P("1", "idle", **options))


def hunt_crossley(sign):
    return lambda p, depth, rate: p.stiffness * depth * sympy.Max(0, 1 + sign * p.loss * rate)


def one(x):
    """Return 1, as the sign of a positive number."""
    return (x + 1) / sympy.sqrt((x + 1) ** 2)


LINE, PLANE, POINTS = (uqmbd.Line,), (uqmbd.Planar,), (uqmbd.Translational,)
MUTANTS = {
    "damper, wrong sign": (damper(1), "its virtual work generates energy"),
    "damper, wrong sign, on a line": (damper(1, LINE), "its virtual work generates energy"),
    "damper, wrong sign, of points": (damper(1, POINTS), "its virtual work generates energy"),
    "torsional damper, wrong sign": (torsion(1), "its virtual work generates energy"),
    "angular velocities in two frames": (body_axes(), "do not cancel|its forces change by|generates energy"),
    "contact that pushes harder while it opens": (
        contact(hunt_crossley(-1)),
        "a contact force is not larger during separation",
    ),
    "viscous contact, wrong sign": (contact(lambda p, d, r: p.stiffness * d * (1 - p.loss * r)), "generates energy"),
    "contact, rate of the gap for that of the depth, on a line": (contact(hunt_crossley(-1), LINE), "generates energy"),
    "friction along the slip": (friction(relative, 1), "its virtual work generates energy"),
    "slip of one body only": (friction(lambda p: p.body_j.velocity), "generates energy|forces change|not cancel"),
    "slip over the signed speed": (tyre(lambda v, s: s * v / (v**2 + 0.01)), "its virtual work generates energy"),
    "slip, wrong sign": (tyre(lambda v, s: -s / sympy.sqrt(v**2 + 0.01)), "its virtual work generates energy"),
    "pressure rises as the chamber grows": (chamber(rate=1), "'pressure' amplify the motion"),
    "force of the pressure, wrong sign": (chamber(force=-1), "'pressure' amplify the motion"),
    "leakage, wrong sign": (chamber(leak=1), "'pressure' grow at the rate .* while the bodies are at rest"),
    "units of the state": (chamber(units="Pa s"), "the rate of the state 'pressure', times seconds"),
    "initial value in other units": (chamber(initial=lambda p: p.bulk * p.area), "initial value of the state"),
    "state that nothing uses": (chamber(idle=True), "or other state depends on the auxiliary state 'idle'"),
    "series damper, wrong sign": (maxwell(1), "'force' grow at the rate"),
    "damper on the rate of a state, wrong sign": (bristles(1), "its virtual work generates energy"),
    "restitution, one too large": (bounce(lambda p: 1 + p.bounce, maximum=1), "coefficient of restitution"),
    "restitution without a maximum": (bounce(lambda p: p.bounce), "coefficient of restitution .* maximum="),
    "force in body axes, not turned": (load("body", False), "force in body axes"),
    "force in world axes, turned": (load("world", True), "force in world axes"),
    "point not turned with its body": (load("world", False, lambda p: p.body.position + p.point), "rotate together"),
    "drag in two frames": (drag(True), "its virtual work generates energy"),
    "number without effect, of points": (idle(POINTS, one), "parameter 'idle' has no effect"),
    "number without effect, on a line": (idle(LINE, one), "parameter 'idle' has no effect"),
    "number without effect, with example=": (idle(PLANE, one, example=2.0), "parameter 'idle' has no effect"),
    "number with example=1, of points": (idle(POINTS, one, example=1, minimum=0), "'idle' has no effect"),
}

SOUND = {
    "damper": damper(),
    "damper on a line": damper(spaces=LINE),
    "damper of points": damper(spaces=POINTS),
    "torsional damper": torsion(),
    "contact": contact(hunt_crossley(1)),
    "contact on a line": contact(hunt_crossley(1), LINE),
    "friction": friction(relative),
    "tyre": tyre(lambda v, s: s / sympy.sqrt(v**2 + 0.01)),
    "chamber": chamber(),
    "precharged chamber": chamber(initial=lambda p: p.bulk),
    "spring and damper in series": maxwell(),
    "bristles": bristles(),
    "floor": bounce(lambda p: p.bounce, maximum=1),
    "force in body axes": load("body", True),
    "force in world axes": load("world", False),
    "drag": drag(),
    "number with an effect": idle(POINTS, lambda x: 1 + x**2, example=1, maximum=1),
}


def checked(made):
    check_component(made, propagators=(), internal=made.bodies != ("body",))


QUICK = ("damper, wrong sign, on a line", "leakage, wrong sign", "restitution, one too large", "damper on a line")


def cases(table):
    return [pytest.param(k, id=k, marks=() if k in QUICK else pytest.mark.thorough) for k in table]


@pytest.mark.parametrize("name", cases(MUTANTS))
def test_mutants_are_found(name):
    made, words = MUTANTS[name]
    with pytest.raises(AssertionError, match=words):
        checked(made)


@pytest.mark.parametrize("name", cases(SOUND))
def test_sound_components_pass(name):
    checked(SOUND[name])


def test_active_components_say_so():
    check_component(damper(1, LINE), dissipative=False, propagators=())
