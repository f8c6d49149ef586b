"""Controllers of a model: numbers, measured quantities, and indices of commands in the state."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import sympy

from uqmbd.compiled import Kernel, cached, compile_kernel
from uqmbd.dynamics.control.shipped import Shipped
from uqmbd.dynamics.equations import Instance, OutputMap, ParameterMap, Placement, Tables, output_map, plain
from uqmbd.errors import Finding, Severity, StudyError
from uqmbd.mechanism import ControlLaw, Controller, HeldStates, HeldSymbol, Mechanism, Output, flatten, t
from uqmbd.names import did_you_mean
from uqmbd.randomness import RandomVariable
from uqmbd.typing import Array, Index

__all__ = ["ControlLoop", "loops_of", "require_controllers", "unused_commands"]

LONGEST_NAME = 40
"""Largest number of characters of a measured expression that messages use as its name."""
UNLIMITED = 1e300
"""Value that represents no limit."""


@dataclass(frozen=True)
class ControlLoop:
    """Controller of a model."""

    name: str
    rate: float  # samples per second, Hz
    delay: float  # time from a sample until its commands act, s
    measure: OutputMap  # measured quantities
    commands: tuple[str, ...]  # names of commands
    states: tuple[str, ...]  # names of states
    held: Index  # indices of the commands, then of the states, among the auxiliary states of the model
    limits: ParameterMap  # from inputs to the smallest values of the commands, then the largest
    shipped: Shipped | None = field(repr=False)  # the function; None: the controller has a law
    law: Kernel | None = field(repr=False)  # maps (time, measured, states, inputs) to commands, then new states
    digest: str = field(default="", repr=False)
    """Hash of all data that affect the controller."""

    def bounds(self, values: Array) -> tuple[Array, Array]:
        """Return smallest and largest commands for inputs (K, input), shape (K, command) each."""
        found = self.limits(values)
        return found[:, : len(self.commands)], found[:, len(self.commands) :]


def loops_of(
    mechanism: Mechanism,
    instances: list[Instance],
    places: list[Placement],
    order: dict[str, int],
    inputs: Sequence[RandomVariable],
    sizes: tuple[int, int, int],
) -> tuple[ControlLoop, ...]:
    """Compile the controllers of a mechanism; arguments as for `output_map`."""
    found: list[ControlLoop] = []
    for instance, place in zip(instances, places, strict=True):
        if not isinstance(instance.component, HeldStates):
            continue
        controller = instance.component.controller
        measured = [_output(mechanism, controller, k, x) for k, x in enumerate(controller.measured)]
        low, high = zip(*controller.limits.values(), strict=True)
        shipped = None if controller.function is None else Shipped(controller.function, controller.where)
        bounds = [sympy.Float(np.sign(float(x)) * UNLIMITED) if x.is_infinite else x for x in (*low, *high)]
        found.append(
            ControlLoop(
                controller.name,
                controller.rate,
                controller.delay,
                output_map(measured, instances, places, order, inputs, sizes),
                tuple(controller.commands),
                tuple(controller.states),
                np.asarray(place.letters["s"], dtype=np.int64),
                ParameterMap.of(bounds, inputs),
                shipped,
                None if controller.law is None else _kernel(controller.law, inputs),
                _digest(controller, measured, shipped),
            )
        )
    return tuple(found)


def _kernel(law: ControlLaw, inputs: Sequence[RandomVariable]) -> Kernel:
    """Compile a law of (time, measured, states, inputs) to commands, then new states."""
    arguments = (t, *law.arguments, *inputs)
    symbols = {x: sympy.Symbol(f"_x{k}", real=True) for k, x in enumerate(arguments)}
    local = [plain(x).xreplace(symbols) for x in law.results]

    def make() -> Kernel:
        import symengine as se

        tables = Tables()
        expressions = tables.applied([tables.converted(x) for x in local])
        return compile_kernel([se.Symbol(f"_x{k}") for k in range(len(arguments))], expressions, tables=tables.known)

    kernel: Kernel = cached(("control law", len(arguments), sympy.srepr(sympy.Tuple(*local))), make)
    return kernel


def _digest(controller: Controller, measured: Sequence[Output], shipped: Shipped | None) -> str:
    about = (controller.name, controller.rate, controller.delay, list(controller.commands), list(controller.states))
    # readable texts omit tables and digits of numbers
    text = sympy.srepr((controller.values, tuple(controller.limits.values()), tuple(x.expression for x in measured)))
    law = sympy.srepr(controller.law.results) if shipped is None and controller.law is not None else ""
    return hashlib.sha256(f"{about} {text} {law if shipped is None else shipped.digest()}".encode()).hexdigest()


def require_controllers(mechanism: Mechanism) -> None:
    """Raise if the controller of a used command was not added, or a measured output is unknown."""
    places = [(f"{type(c).__name__} {c.name!r}", _entries(c.values.values())) for c in mechanism.all_components()]
    places += [(f"output {o.name!r}", [o.expression]) for o in mechanism.observed()]
    places += [(c.where, [x for x in c.measured if not isinstance(x, str)]) for c in mechanism.controllers.values()]
    for where, entries in places:
        for symbol in _held(entries):
            if mechanism.controllers.get(symbol.owner.name) is not symbol.owner:
                raise StudyError(
                    f"{where}: the expression contains {symbol}, but the controller {symbol.owner.name!r} was not "
                    f"added to mechanism {mechanism.name!r}; call mechanism.add(controller)."
                )
    for controller in mechanism.controllers.values():
        for k, entry in enumerate(controller.measured):
            _output(mechanism, controller, k, entry)


def unused_commands(mechanism: Mechanism) -> tuple[Finding, ...]:
    """Return findings on unused commands of each controller."""
    used: set[Any] = set()
    for component in mechanism.all_components():
        used |= _held(_entries(component.values.values()))
    used |= _held([o.expression for o in mechanism.observed()])
    used |= _held([x for c in mechanism.controllers.values() for x in c.measured if not isinstance(x, str)])
    found: list[Finding] = []
    for controller in mechanism.controllers.values():
        unused = [name for name in controller.commands if controller.command(name) not in used]
        if unused:
            listed = " and ".join(map(repr, unused))
            verb = "is" if len(unused) == 1 else "are"
            message = f"{controller.where}: the command{'s' * (len(unused) > 1)} {listed} {verb} not used"
            remedy = f"Pass controller.command({unused[0]!r}) to a component, e.g. as a torque or a force"
            found.append(Finding(Severity.WARNING, controller.where, message, remedy))
    return tuple(found)


def _output(mechanism: Mechanism, controller: Controller, k: int, entry: Any) -> Output:
    """Return the output of an entry of `measured`."""
    if not isinstance(entry, str):
        return Output(text if len(text := str(entry)) <= LONGEST_NAME else f"measured[{k}]", entry, "")
    if entry in mechanism.outputs and mechanism.outputs[entry].turn:
        raise StudyError(
            f"{controller.where}: measured[{k}] is the output {entry!r}, an angle that is known only up to whole "
            "turns (angle=True). Results count its turns, but a controller would measure a jump by a turn. Measure "
            "joint.angle or body.angle, which count turns. Or measure the expression of the output itself, which "
            "jumps by turns."
        )
    if entry in mechanism.outputs:
        return Output(entry, mechanism.outputs[entry].expression, mechanism.outputs[entry].units)
    if entry in mechanism.scalars:
        raise StudyError(
            f"{controller.where}: measured[{k}] is the output {entry!r}, which is a scalar output; a controller can "
            "measure only quantities that change over time."
        )
    listed = ", ".join(map(repr, mechanism.outputs)) or "none"
    near = did_you_mean(entry, list(mechanism.outputs)) or "."
    raise StudyError(
        f"{controller.where}: measured[{k}] is {entry!r}, but mechanism {mechanism.name!r} has no such output{near} "
        f"Its outputs are: {listed}. An expression, such as body.position[0], can be measured as well."
    )


def _entries(values: Any) -> list[Any]:
    return [x for value in values for x in flatten(value)]


def _held(entries: list[Any]) -> set[HeldSymbol]:
    return {s for x in entries for s in getattr(x, "free_symbols", ()) if isinstance(s, HeldSymbol)}
