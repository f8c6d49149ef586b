"""Valid studies of several kinds, every call of which can be changed: what malformed studies are made from."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import chaospy
import sympy

import uqmbd
from uqmbd import plugins

TIMES = (0.0, 0.01, 0.02)

Caller = Callable[..., Any]
"""``call(key, function, **keywords)``: calls, or changes a keyword first."""


def pendulum(call: Caller) -> None:
    """A rod of random length, by Monte Carlo."""
    normal = call("Normal", chaospy.Normal, mu=1.0, sigma=0.02)
    length = call("RandomVariable", uqmbd.RandomVariable, name="length", distribution=normal, units="m")
    space = call("Planar", uqmbd.Planar, gravity=(0.0, -9.81))
    mechanism = call("Mechanism", uqmbd.Mechanism, name="pendulum", space=space)
    rod = call(
        "planar body", mechanism.body, name="rod", mass=1.0, inertia=length**2 / 12, com=(0.0, 0.0),
        position=(length / 2, 0.0), angle=0.0, angular_velocity=0.5, hold=False,
    )  # fmt: skip
    mechanism.add(component("Revolute")("pivot", mechanism.ground, rod, point_i=(0, 0), point_j=(-length / 2, 0)))
    tip = call("point", rod.point, local=(length / 2, 0.0))
    call("output", mechanism.output, name="tip", expression=tip[1], units="m", angle=False)
    call("angle", mechanism.output, name="direction", expression=sympy.atan2(tip[1], tip[0]), units="rad", angle=True)
    method = call("MonteCarlo", plugins.propagator("monte-carlo"), samples=4, seed=1, label="sampled")
    study(call, mechanism, method)


def slider_crank(call: Caller) -> None:
    """A driven slider-crank with dependent lengths, by collocation."""
    joint = chaospy.MvNormal([0.15, 0.35], [[1e-6, 1e-7], [1e-7, 1e-6]])
    names = ("crank_length", "rod_length")
    given = call("random_vector", uqmbd.random_vector, names=names, distribution=joint, units="m")
    crank_length, rod_length = given
    mechanism = uqmbd.Mechanism("slider-crank", uqmbd.Planar(gravity=(0, -9.81)))
    crank = mechanism.body("crank", mass=1, inertia=0.01, position=(0.075, 0))
    rod = mechanism.body("rod", mass=1, inertia=0.02, position=(0.325, 0))
    slider = mechanism.body("slider", mass=1, inertia=0.01, position=(0.5, 0))
    revolute = component("Revolute")
    mechanism.add(revolute("A", mechanism.ground, crank, (0, 0), (-crank_length / 2, 0)))
    mechanism.add(revolute("B", crank, rod, (crank_length / 2, 0), (-rod_length / 2, 0)))
    pin = mechanism.add(revolute("C", rod, slider, (rod_length / 2, 0), (0, 0)))
    mechanism.add(component("Prismatic")("D", mechanism.ground, slider, (0, 0), (0, 0), (1, 0), (1, 0)))
    turn = call("step", smooth_step, x=uqmbd.t, x0=0.0, y0=0.0, x1=0.01, y1=0.001)
    mechanism.add(component("RotationDriver")("motor", mechanism.ground, crank, angle=turn + uqmbd.t))
    call("reaction", mechanism.output, name="force", expression=pin.reaction_force[0], units="N")
    method = call("Collocation", plugins.propagator("collocation"), order=1, verify=2, seed=0)
    study(call, mechanism, method)


def spatial(call: Caller) -> None:
    """A spatial body on a spring of random stiffness, by Galerkin, with outputs without a time."""
    uniform = call("Uniform", chaospy.Uniform, lower=90.0, upper=110.0)
    stiffness = uqmbd.RandomVariable("stiffness", uniform, "N/m")
    space = call("Spatial", uqmbd.Spatial, gravity=(0, 0, -9.81))
    mechanism = uqmbd.Mechanism("spatial", space)
    body = call(
        "spatial body", mechanism.body, name="body", mass=2.0, inertia=(0.02, 0.03, 0.04), com=(0.0, 0.0, 0.0),
        position=(0.0, 0.0, -1.0), quaternion=(1, 0, 0, 0), velocity=(0.1, 0.0, 0.0), angular_velocity=(0.1, 0, 0),
    )  # fmt: skip
    spring = component("SpringDamper")
    for name, x in (("a", -1), ("b", 0), ("c", 1)):
        mechanism.add(spring(name, mechanism.ground, body, (x, x**2, 0), (0.1 * x, 0.1 * x**2, 0), stiffness))
    call("spatial output", mechanism.output, name="height", expression=body.position[2], units="m")
    call("velocity", body.point_velocity, local=(0.1, 0, 0))
    mode = call("eigenfrequency", uqmbd.eigenfrequency, number=1, at="start")
    mechanism.output("frequency", mode, units="Hz")
    method = call("Galerkin", plugins.propagator("galerkin"), order=1, verify=2, seed=0)
    study(call, mechanism, method)


def impact(call: Caller) -> None:
    """A ball that falls on a floor."""
    space = call("Translational", uqmbd.Translational, gravity=(0, -9.81))
    mechanism = uqmbd.Mechanism("ball", space)
    ball = call("particle", mechanism.body, name="ball", mass=1.0, position=(0.0, 0.001), velocity=(0.0, -1.0))
    floor = component("PlaneImpact")("floor", mechanism.ground, ball, (0, 0), (0, 0), (0, 1), restitution=0.5)
    mechanism.add(floor)
    mechanism.output("height", ball.position[1], units="m")
    time = call("event_time", floor.event_time, label="impact", number=1)
    mechanism.output("first", time, units="s")
    call(
        "simulate", uqmbd.simulate, mechanism=mechanism, times=TIMES, values={}, rtol=1e-6, integrator="auto",
        start="drawn",
    )  # fmt: skip


def smooth_step(**corners: Any) -> Any:
    """Call `uqmbd.step`, which takes its arguments by position, as functions of SymPy do."""
    return uqmbd.step(*corners.values())


def study(call: Caller, mechanism: uqmbd.Mechanism, method: uqmbd.extend.Propagator) -> None:
    made = call(
        "Study", uqmbd.Study, name="study", mechanism=mechanism, times=TIMES, propagators=[method], rtol=1e-6,
        integrator="auto", start="drawn", report_times=(0.01,), convergence=None,
    )  # fmt: skip
    call("run", made.run, workers=1, only=[method.node_name], progress=False, folder=None, resume=False)


def component(name: str) -> type[uqmbd.Component]:
    return plugins.component(name)


def component_study(name: str, space: type[uqmbd.mechanism.Space]) -> Callable[[Caller], None]:
    """A study with one component between two bodies."""
    kind = component(name)
    d = space.dimension

    def build(call: Caller) -> None:
        mechanism = uqmbd.Mechanism("trial", space())
        inertia = {} if not space.turns else {"inertia": 1.0 if d == 2 else (1.0, 1.0, 1.0)}
        bodies = [
            mechanism.body(role, mass=1.0, position=tuple(2.0 * k for _ in range(d)), **inertia)
            for k, role in enumerate(kind.bodies)
        ]
        made = call(
            f"{name} in {space.__name__}",
            kind,
            name="it",
            **dict(zip(kind.bodies, bodies, strict=True)),
            **arguments(kind, space),
        )
        call("add", mechanism.add, component=made)
        mechanism.output("x", bodies[-1].position[0], units="m")
        uqmbd.simulate(mechanism, TIMES)

    return build


def arguments(kind: type[uqmbd.Component], space: type[uqmbd.mechanism.Space]) -> dict[str, Any]:
    """Return usable values of all parameters of a component."""
    found = {}
    for key, parameter in kind.parameters().items():
        size = parameter.size(space())
        if parameter.example is not None:
            found[key] = parameter.example
        elif not parameter.required and parameter.kind in ("option", "scalar", "rotation"):
            continue
        elif parameter.kind == "option":
            found[key] = parameter.choices[0]
        elif parameter.kind == "turning_axis" and not size:
            continue
        elif parameter.kind in ("axis", "turning_axis"):
            axis = (0,) * (size - 1) + (1,)
            found[key] = axis[::-1] if kind.__name__ == "Dot1" and key == "axis_j" else axis
        elif size > 1:
            found[key] = tuple(0.1 * (k + 1) for k in range(size))
        else:
            found[key] = 0.5
    return found


BASES: dict[str, Callable[[Caller], None]] = {
    "pendulum": pendulum, "slider-crank": slider_crank, "spatial": spatial, "impact": impact,
}  # fmt: skip
BASES |= {
    f"{name} in {space.__name__}": component_study(name, space)
    for name, kind in sorted(plugins.components().items())
    for space in kind.spaces
    if kind.__module__.split(".")[0] in ("uqmbd_joints", "uqmbd_drivers", "uqmbd_springs", "uqmbd_contact")
}
