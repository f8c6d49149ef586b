"""Controllers of a model: their numbers, what they measure, and where their commands are among the states."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import sympy

from uqmbd.dynamics.control.shipping import Shipped
from uqmbd.dynamics.equations import Instance, OutputMap, ParameterMap, Placement, output_map
from uqmbd.errors import Finding, Severity, StudyError
from uqmbd.mechanism import Controller, HeldStates, HeldSymbol, Mechanism, Output, flatten
from uqmbd.names import did_you_mean
from uqmbd.randomness import RandomVariable
from uqmbd.typing import Array, Index

__all__ = ["Loop", "loops_of", "require_controllers", "unused_commands"]

LONGEST_NAME = 40
"""Characters up to which a measured expression is its own name in messages."""
UNLIMITED = 1e300
"""Stands for no limit."""


@dataclass(frozen=True)
class Loop:
    """A controller of a model."""

    name: str
    rate: float  # samples per second, Hz
    delay: float  # time from a sample until its commands act, s
    measure: OutputMap  # measured quantities
    commands: tuple[str, ...]  # names
    states: tuple[str, ...]  # names
    held: Index  # indices of the commands, then of the states, among the auxiliary states of the model
    limits: ParameterMap  # from inputs to the smallest values of the commands, then the largest
    shipped: Shipped = field(repr=False)
    digest: str = field(default="", repr=False)
    """Hash of all that it does."""

    def bounds(self, values: Array) -> tuple[Array, Array]:
        """Smallest and largest commands at inputs (K, input), shape (K, command) each."""
        found = self.limits(values)
        return found[:, : len(self.commands)], found[:, len(self.commands) :]


def loops_of(
    mechanism: Mechanism,
    instances: list[Instance],
    places: list[Placement],
    order: dict[str, int],
    inputs: Sequence[RandomVariable],
    sizes: tuple[int, int, int],
) -> tuple[Loop, ...]:
    """Compile the controllers of a mechanism; arguments as for `output_map`."""
    found: list[Loop] = []
    for instance, place in zip(instances, places, strict=True):
        if not isinstance(instance.component, HeldStates):
            continue
        controller = instance.component.controller
        measured = [_output(mechanism, controller, k, x) for k, x in enumerate(controller.measured)]
        low, high = zip(*controller.limits.values(), strict=True)
        bounds = [sympy.Float(np.sign(float(x)) * UNLIMITED) if x.is_infinite else x for x in (*low, *high)]
        found.append(
            Loop(
                controller.name,
                controller.rate,
                controller.delay,
                output_map(measured, instances, places, order, inputs, sizes),
                tuple(controller.commands),
                tuple(controller.states),
                np.asarray(place.letters["s"], dtype=np.int64),
                ParameterMap.of(bounds, inputs),
                shipped := Shipped(controller.function, controller.where),
                _digest(controller, measured, shipped),
            )
        )
    return tuple(found)


def _digest(controller: Controller, measured: Sequence[Output], shipped: Shipped) -> str:
    about = (controller.name, controller.rate, controller.delay, list(controller.commands), list(controller.states))
    # the text that people read leaves out tables, and digits of numbers
    said = sympy.srepr((controller.values, tuple(controller.limits.values()), tuple(x.expression for x in measured)))
    return hashlib.sha256(f"{about} {said} {shipped.digest()}".encode()).hexdigest()


def require_controllers(mechanism: Mechanism) -> None:
    """Raise where a command is used whose controller was not added, or a measured output is unknown."""
    places = [(f"{type(c).__name__} {c.name!r}", _entries(c.values.values())) for c in mechanism.all_components()]
    places += [(f"output {o.name!r}", [o.expression]) for o in mechanism.observed()]
    places += [(c.where, [x for x in c.measured if not isinstance(x, str)]) for c in mechanism.controllers.values()]
    for where, entries in places:
        for symbol in _held(entries):
            if mechanism.controllers.get(symbol.owner.name) is not symbol.owner:
                raise StudyError(
                    f"{where}: it contains {symbol}, but the controller {symbol.owner.name!r} was not added to "
                    f"mechanism {mechanism.name!r}; call mechanism.add(controller)."
                )
    for controller in mechanism.controllers.values():
        for k, entry in enumerate(controller.measured):
            _output(mechanism, controller, k, entry)


def unused_commands(mechanism: Mechanism) -> tuple[Finding, ...]:
    """Find the commands that nothing uses, of each controller."""
    used: set[Any] = set()
    for component in mechanism.all_components():
        used |= _held(_entries(component.values.values()))
    used |= _held([o.expression for o in mechanism.observed()])
    used |= _held([x for c in mechanism.controllers.values() for x in c.measured if not isinstance(x, str)])
    found: list[Finding] = []
    for controller in mechanism.controllers.values():
        idle = [name for name in controller.commands if controller.command(name) not in used]
        if idle:
            listed = " and ".join(map(repr, idle))
            verb = "is" if len(idle) == 1 else "are"
            message = f"{controller.where}: its command{'s' * (len(idle) > 1)} {listed} {verb} used nowhere"
            remedy = f"Give controller.command({idle[0]!r}) to a component, such as the torque of a Torque"
            found.append(Finding(Severity.WARNING, controller.where, message, remedy))
    return tuple(found)


def _output(mechanism: Mechanism, controller: Controller, k: int, entry: Any) -> Output:
    """Return what an entry of `measured` is."""
    if not isinstance(entry, str):
        return Output(text if len(text := str(entry)) <= LONGEST_NAME else f"measured[{k}]", entry, "")
    if entry in mechanism.outputs and mechanism.outputs[entry].turn:
        raise StudyError(
            f"{controller.where}: measured[{k}] is the output {entry!r}, an angle that is known only up to whole turns "
            "(angle=True); its turns are counted in results, and a controller would see it jump by a turn. Measure "
            "joint.angle or body.angle, which count turns, or the expression of the output itself, which does not."
        )
    if entry in mechanism.outputs:
        return Output(entry, mechanism.outputs[entry].expression, mechanism.outputs[entry].units)
    if entry in mechanism.scalars:
        raise StudyError(
            f"{controller.where}: measured[{k}] is the output {entry!r}, which has one value without a time; a "
            "controller measures what changes."
        )
    listed = ", ".join(map(repr, mechanism.outputs)) or "none"
    near = did_you_mean(entry, list(mechanism.outputs)) or "."
    raise StudyError(
        f"{controller.where}: measured[{k}] is {entry!r}, and mechanism {mechanism.name!r} has no such output{near} "
        f"Its outputs are: {listed}. An expression, such as body.position[0], can be measured as well."
    )


def _entries(values: Any) -> list[Any]:
    return [x for value in values for x in flatten(value)]


def _held(entries: list[Any]) -> set[HeldSymbol]:
    return {s for x in entries for s in getattr(x, "free_symbols", ()) if isinstance(s, HeldSymbol)}
