"""Source files of a motion, and a description of its variables for the program that uses them."""

from __future__ import annotations

from dataclasses import dataclass

from uqmbd.dynamics.portable.commands import MotionCommand
from uqmbd.dynamics.portable.dependencies import Dependencies

__all__ = ["PortableMotion"]


@dataclass(frozen=True)
class PortableMotion:
    """Motion of a mechanism as C source: the driver of uqmbd, and kernels and tables of the mechanism.

    Attributes
    ----------
    files : dict of str to str
        Source files and headers by name: ``driver.c`` includes the parts of the driver, and ``motion.h`` declares the
        tables, which ``motion_data.c`` defines.
    inputs : tuple of str
        Names of the inputs, in the order of their values.
    outputs : tuple of str
        Names of the outputs, in their order.
    units : tuple of str
        Units of the outputs.
    commands : tuple of MotionCommand
        Commands of controllers, which the program that integrates the motion sets. They are constant in each step.
    measured : tuple of str
        Measured expressions of controllers, whose values come after the values of the outputs.
    fixed : tuple of str
        Inputs that change the start of the motion only, or nothing: they cannot change during the motion.
    contacts : tuple of str
        Contacts of bodies.
    direct, at_start : tuple of tuple of str
        For each output, then each measured expression: the inputs and commands that change it at the time at which
        they are set, during the motion and at its start.

    Examples
    --------
    >>> from uqmbd.extend import PortableMotion
    >>> PortableMotion({"driver.c": ""}, ("speed",), ("height",), ("m",)).outputs
    ('height',)
    """

    files: dict[str, str]
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    units: tuple[str, ...]
    commands: tuple[MotionCommand, ...] = ()
    measured: tuple[str, ...] = ()
    fixed: tuple[str, ...] = ()
    contacts: tuple[str, ...] = ()
    direct: Dependencies = ()
    at_start: Dependencies = ()
