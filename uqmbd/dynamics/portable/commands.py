"""Commands of controllers as inputs of a motion in C, and measured expressions as its outputs."""

from __future__ import annotations

from dataclasses import dataclass

from uqmbd.dynamics.equations import Model
from uqmbd.errors import StudyError
from uqmbd.mechanism import Mechanism

__all__ = ["MOST_MEASURED", "MotionCommand", "commands_of", "measured_expressions"]

MOST_MEASURED = 1 << 12
"""Count of numbers for the measured values of each controller, larger than the count of its measured values."""


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
    """Return the commands of all controllers; raise StudyError if their values or uses have no form in C."""
    found = []
    for loop in model.controls:
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
    """Return measured expressions that are no outputs: name, number of the controller, and number in its list."""
    return [
        (f"{loop.name}.{name}", k, number)
        for k, loop in enumerate(model.controls)
        for number, name in enumerate(loop.measure.names)
        if name not in model.outputs.names
    ]
