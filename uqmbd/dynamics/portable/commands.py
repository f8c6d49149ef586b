"""Controllers of a motion in C: laws, and commands of functions as inputs, with measured expressions as outputs."""

from __future__ import annotations

from dataclasses import dataclass

from uqmbd.dynamics.equations import Model
from uqmbd.dynamics.portable.c_source import SourceWriter
from uqmbd.errors import StudyError
from uqmbd.mechanism import Mechanism

__all__ = ["MOST_MEASURED", "MotionCommand", "commands_of", "measured_expressions", "written_laws"]

MOST_MEASURED = 1 << 12
"""Number of indices that are reserved for the measured values of each controller; no controller has as many."""


@dataclass(frozen=True)
class MotionCommand:
    """Command of a controller, as an input of the motion.

    Attributes
    ----------
    name : str
        Name of the controller, a full stop, and the name of the command.
    units : str
        Units of the command.
    place : int
        Index of the command in the state.
    start : float
        Initial value.

    Examples
    --------
    >>> from uqmbd.extend import MotionCommand
    >>> MotionCommand("loop.torque", "N m", 7, 0.0).place
    7
    """

    name: str
    units: str
    place: int
    start: float


def commands_of(mechanism: Mechanism, model: Model) -> tuple[MotionCommand, ...]:
    """Return the commands of controllers with functions; raise StudyError if their values or uses have no form in C."""
    found = []
    for loop in model.controls:
        if loop.law is not None:
            continue
        controller = mechanism.controllers[loop.name]
        states = {controller.state(name) for name in controller.states}
        for output in mechanism.observed():
            if states & getattr(output.expression, "free_symbols", set()):
                raise StudyError(
                    f"the output {output.name!r} contains a state of the controller {loop.name!r}, which is a function "
                    "in Python"
                )
        for k, name in enumerate(loop.commands):
            start = controller.initial[name]
            if not start.is_number:
                raise StudyError(f"the initial value of the command {name!r} depends on random variables; use a number")
            place = model.layout.coordinates + int(loop.held[k])
            found.append(MotionCommand(f"{loop.name}.{name}", controller.commands[name], place, float(start)))
    return tuple(found)


def measured_expressions(model: Model) -> list[tuple[str, int, int]]:
    """Return measured expressions of functions that are no outputs: name, controller, number in its list."""
    return [
        (f"{loop.name}.{name}", k, number)
        for k, loop in enumerate(model.controls)
        for number, name in enumerate(loop.measure.names)
        if loop.law is None and name not in model.outputs.names
    ]


def written_laws(w: SourceWriter, model: Model) -> tuple[list[str], int]:
    """Return the C structures of the controllers with laws, and the number of their waiting commands."""
    found, pending = [], 0
    for number, loop in enumerate(model.controls):
        if loop.law is None:
            continue
        commands, waiting = len(loop.commands), int(loop.delay * loop.rate) + 2
        sizes = f"{number}, {len(loop.measure.names)}, {commands}, {len(loop.states)}, {waiting}, {pending}"
        limits = f"{w.numbers(loop.limits.constants)}, {w.integers(loop.limits.random)}, {len(loop.limits.random)}"
        held = w.integers(model.layout.coordinates + loop.held)
        accelerates = int(loop.measure.accelerates)
        found.append(
            f"{{{w.texts([loop.name])}, {sizes}, {loop.rate!r}, {loop.delay!r}, {w.kernel(loop.law)}, {held}, "
            f"{limits}, {w.kernel(loop.limits.kernel)}, {accelerates}}}"
        )
        pending += commands * waiting
    return found, pending
