"""Test that a command is listed and explained, and that its module does not slow down `uqmbd --help`."""

from __future__ import annotations

import subprocess
import sys
from typing import Any

from uqmbd.arguments import typechecked
from uqmbd.isolation import Isolated
from uqmbd.plugins import KINDS, Command, command_line, registered_name

__all__ = ["check_command"]

HEAVY = ("matplotlib", "numpy", "pandas", "rich", "scipy", "sklearn", "sympy", "symengine", "xarray")
"""Packages that a module of commands must not import."""


@typechecked(values=False)
def check_command(command: type[Command], module: str = "") -> None:
    """Check a command of the command line.

    - The command has a name and a help text, and is made without arguments.
    - Typer accepts the parameters of its method ``run``; each parameter has a help text.
    - The module of the entry point imports no heavy package, because `uqmbd --help` waits for this import.

    Parameters
    ----------
    command : type
        Class with the interface of `uqmbd.extend.Command`.
    module : str
        Name of the module of the entry point in the group ``uqmbd.commands``; not checked if empty.

    Raises
    ------
    AssertionError
        If a check fails; the message states which.

    Examples
    --------
    >>> from typing import Annotated
    >>> import typer
    >>> from uqmbd.testing import check_command
    >>> class Count:
    ...     \"\"\"Count to a number.\"\"\"
    ...     name = "count"
    ...     help = "Count."
    ...     def run(self, end: Annotated[int, typer.Argument(help="Where to end.")] = 3) -> None:
    ...         print(*range(1, end + 1))
    >>> check_command(Count)
    """
    _, problem = registered_name(command, KINDS["commands"])
    assert not problem, f"{command.__name__} is a class {problem}."
    assert command.__doc__, f"{command.__name__} has no docstring; describe the command in one sentence."
    made: Any = None
    with Isolated() as work:
        made = command_line(command)
    assert not work.failed, f"{command.__name__} cannot be converted to a command of the command line: {work.reason}"
    for parameter in made.params:
        where = f"{command.__name__}: the parameter {parameter.name!r}"
        assert getattr(parameter, "help", None), (
            f"{where} has no help text; describe it, e.g. with typer.Option(help=...)."
        )
        assert "--debug" not in parameter.opts, (
            f"{where} uses the option --debug, which uqmbd reserves for showing tracebacks. Choose another name."
        )
    if module:
        found = _imported(module)
        assert not found, (
            f"{command.__name__}: the import of its module {module} also imports {', '.join(found)}, which delays "
            "`uqmbd --help`. Import such packages inside `run`. Also check the `__init__` of the package that "
            "contains the module."
        )


def _imported(module: str) -> list[str]:
    """Import a module in a separate interpreter, and return the heavy modules that it imports."""
    code = f"import sys, {module}; print(*(name for name in {HEAVY!r} if name in sys.modules))"
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert run.returncode == 0, f"the module {module!r} cannot be imported: {run.stderr.strip()}"
    return run.stdout.split()
