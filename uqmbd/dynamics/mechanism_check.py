"""Checks of a mechanism without integration."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from uqmbd.arguments import typechecked
from uqmbd.dynamics.drawn_pose import Move, apart, moved
from uqmbd.dynamics.model_building import kinematic_model, reactions_not_unique
from uqmbd.mechanism import Controller, Mechanism, find_unit_problems

__all__ = ["Check", "check"]


@dataclass(frozen=True)
class Check:
    """Bodies, equations, rank, redundancy, mobility and inputs of a mechanism.

    Attributes
    ----------
    bodies : tuple of str
        Names of the bodies.
    components : tuple of (name, type, number of constraint equations)
        Name, type and number of constraint equations of each component.
    coordinates, equations, rank, mobility : int
        Numbers of coordinates and of constraint equations, rank of the equations, and number of degrees of freedom of
        the positions. The equations include the unit norm of each quaternion. For equations of positions, ``mobility =
        coordinates - rank``.
    redundant : tuple of str
        Equations that follow from the others.
    not_unique : tuple of str
        Reactions that are undetermined because of redundant equations, such as ``A.reaction_force[0]``.
    inputs : tuple of (name, distribution, units)
        Name, distribution and units of each random variable.
    unused_inputs : tuple of str
        Declared but unused random variables.
    unit_lengths : int
        Number of unit-norm equations of half-angle pairs or quaternions of bodies.
    apart : tuple of tuple of str
        Groups of bodies that no component connects with each other or the ground.
    moved : tuple of Move
        Bodies that assembly displaced by more than 1 % of the size of the mechanism from their given pose, or rotated
        by more than 1 degree.
    conditions : tuple of (condition, kind)
        Start conditions, each with its kind: ``position`` or ``velocity``.
    controllers : tuple of (name, timing, measured, commands)
        Name, timing, measurements and commands of each controller, as text.
    units : tuple of str
        Errors in units, one sentence each.

    Examples
    --------
    >>> import uqmbd
    >>> mechanism = uqmbd.Mechanism("free", uqmbd.Planar())
    >>> body = mechanism.body("body", mass=1, inertia=1)
    >>> found = uqmbd.check(mechanism)
    >>> found.mobility, found.redundant, found.bodies
    (3, (), ('body',))
    """

    bodies: tuple[str, ...]
    components: tuple[tuple[str, str, int], ...]
    coordinates: int
    equations: int
    rank: int
    redundant: tuple[str, ...]
    mobility: int
    not_unique: tuple[str, ...]
    inputs: tuple[tuple[str, str, str], ...]
    unused_inputs: tuple[str, ...]
    unit_lengths: int = 0
    apart: tuple[tuple[str, ...], ...] = ()
    moved: tuple[Move, ...] = ()
    velocity_equations: int = 0
    """Number of equations that constrain velocities only (`VelocityConstraint`)."""
    velocity_mobility: int = 0
    """Degrees of freedom of the velocities, ``coordinates - rank`` of all equations; fewer than those of the positions
    if equations constrain velocities only."""
    conditions: tuple[tuple[str, str], ...] = ()
    controllers: tuple[tuple[str, str, str, str], ...] = ()
    units: tuple[str, ...] = ()


@typechecked
def check(mechanism: Mechanism, time: float = 0.0) -> Check:
    """Assemble a mechanism at the means of its inputs, and count its equations and degrees of freedom.

    Parameters
    ----------
    mechanism : Mechanism
        Mechanism to check.
    time : float
        Initial time, s.

    Returns
    -------
    Check
        Counts and findings of the mechanism.

    Raises
    ------
    uqmbd.AssemblyError
        If the mechanism cannot be assembled.

    Examples
    --------
    >>> import uqmbd
    >>> from uqmbd_joints import Revolute
    >>> mechanism = uqmbd.Mechanism("pendulum", uqmbd.Planar(gravity=(0, -9.81)))
    >>> rod = mechanism.body("rod", mass=1, inertia=1 / 12, position=(0.5, 0))
    >>> pivot = mechanism.add(Revolute("pivot", mechanism.ground, rod, (0, 0), (-0.5, 0)))
    >>> uqmbd.check(mechanism).mobility
    1
    """
    model = kinematic_model(mechanism, time)
    layout = model.layout
    redundant = np.setdiff1d(np.arange(layout.constraints), layout.kept)
    inputs = mechanism.inputs
    owners = list(model.owners)
    used = mechanism.used_inputs()
    return Check(
        bodies=model.bodies,
        components=tuple((c.name, type(c).__name__, owners.count(c.name)) for c in mechanism.components.values()),
        coordinates=layout.coordinates,
        equations=layout.constraints,
        rank=layout.rank,
        redundant=tuple(model.equations[k] for k in redundant),
        mobility=layout.coordinates - len(layout.independent_holonomic),
        not_unique=reactions_not_unique(mechanism, time) if len(redundant) else (),
        inputs=tuple((v.name, v.description, v.units) for v in inputs.variables),
        unused_inputs=tuple(n for n in inputs.names if n not in used),
        unit_lengths=len(model.norms),
        apart=apart(mechanism),
        moved=moved(mechanism, model),
        units=find_unit_problems(mechanism),
        velocity_equations=len(layout.nonholonomic),
        velocity_mobility=layout.coordinates - layout.rank,
        conditions=tuple((name, c.kind) for name, c in mechanism.conditions.items()),
        controllers=tuple(_controller(c) for c in mechanism.controllers.values()),
    )


def _controller(controller: Controller) -> tuple[str, str, str, str]:
    """Return name, timing, measured quantities and commands of a controller as text."""
    delay = f", commands act {controller.delay:g} s later" if controller.delay else ""
    commands = [f"{name} ({units})" if units else name for name, units in controller.commands.items()]
    return (
        controller.name,
        f"{controller.rate:g} Hz{delay}",
        ", ".join(map(str, controller.measured)),
        ", ".join(commands),
    )
