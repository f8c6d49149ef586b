"""Is a command listed and explained, and does its module cost `uqmbd --help` nothing."""

from __future__ import annotations

import subprocess
import sys
from typing import Any

from uqmbd.isolation import Isolated
from uqmbd.plugins import KINDS, Command, command_line, registered_name

__all__ = ["check_command"]

HEAVY = ("matplotlib", "numpy", "pandas", "rich", "scipy", "sklearn", "sympy", "symengine", "xarray")
"""What a module that offers commands does not import."""


def check_command(command: type[Command], module: str = "") -> None:
    """Check a command of the command line.

    - It has a name and a help, and is made without arguments.
    - Typer takes the parameters of its method ``run``; each of them has a help.
    - The module that its entry point names imports nothing heavy: `uqmbd --help` waits for it.

    Parameters
    ----------
    command : type
        As `uqmbd.extend.Command` says.
    module : str
        Name of the module that the entry point in the group ``uqmbd.commands`` names; not looked at if empty.

    Raises
    ------
    AssertionError
        If something is wrong; the message says what.

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
    assert command.__doc__, f"{command.__name__} has no docstring; say what it is."
    made: Any = None
    with Isolated() as work:
        made = command_line(command)
    assert not work.failed, f"{command.__name__}: no command can be made of it: {work.reason}"
    for parameter in made.params:
        where = f"{command.__name__}: the parameter {parameter.name!r}"
        assert getattr(parameter, "help", None), f"{where} has no help; say what it is, e.g. typer.Option(help=...)."
        assert "--debug" not in parameter.opts, f"{where} is --debug, which uqmbd takes itself, to show tracebacks."
    if module:
        found = _imported(module)
        assert not found, (
            f"{command.__name__}: its module {module} imports {', '.join(found)}; `uqmbd --help` waits for it. Import "
            "that inside of `run`; the package that the module is in is imported, too."
        )


def _imported(module: str) -> list[str]:
    """Import a module in an interpreter of its own and name what is heavy of all that it brings."""
    code = f"import sys, {module}; print(*(name for name in {HEAVY!r} if name in sys.modules))"
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert run.returncode == 0, f"the module {module!r} cannot be imported: {run.stderr.strip()}"
    return run.stdout.split()
