"""Commands of the command line from plugins."""

from __future__ import annotations

from typing import Any, Protocol

__all__ = ["Command", "command_line"]


class Command(Protocol):
    """Protocol of a command of the command line; a plugin offers the class by the hook ``uqmbd_commands``.

    The command line creates an instance without arguments to list or run the command.  The class need not be derived
    from this protocol.  The entry-point group ``uqmbd.commands`` names its module.  The module must not import large
    libraries, because `uqmbd --help` imports it; the method `run` imports them.

    The parameters of `run` are arguments and options with annotations for typer. The method `run` returns None and
    prints its result. The command line shows a `uqmbd.UqmbdError` as a message. The command line ends the program with
    the status 2 for a `uqmbd.StudyError`, and with 1 for other errors of this type. ``raise SystemExit(status)`` sets
    another status. All commands have the option ``--debug``, which shows the traceback.

    The options ``--workers``, ``--dask`` and ``--mpi`` replace a parameter of the type `uqmbd.Workers` without a
    default, after a ``*``.  The statement ``with workers.start(script) as executor:`` yields an object that
    `Study.run`, `uqmbd.extend.pool` and other functions accept as workers.

    Attributes
    ----------
    name : str
        Name of the command after ``uqmbd``: small letters, digits and hyphens.
    help : str
        Description, shown by ``uqmbd --help`` (shortened to a line) and ``uqmbd NAME --help``.

    Examples
    --------
    >>> from typing import Annotated
    >>> import typer, uqmbd
    >>> class Count:
    ...     name = "count"
    ...     help = "Count bodies."
    ...     def run(self, script: Annotated[str, typer.Argument(help="Study script.")]) -> None:
    ...         print(script)
    >>> command: type[uqmbd.extend.Command] = Count
    """

    name: str
    help: str

    def run(self, *arguments: Any, **options: Any) -> None:
        """Run the command.

        Parameters
        ----------
        *arguments, **options
            Arguments and options of the command line, as declared by the signature of the subclass.
        """


def command_line(command: type[Command]) -> Any:
    """Convert a command to a command object of `typer`.

    Raise an exception of the class, or of typer if it does not accept an annotation.
    """
    import typer

    from uqmbd.clusters import with_worker_options

    # format the help without rich, like the help of the other commands
    app = typer.Typer(
        rich_markup_mode=None,
        pretty_exceptions_enable=False,
        add_completion=False,
        context_settings={"help_option_names": ["-h", "--help"]},
    )
    app.command(name=command.name, help=command.help)(with_worker_options(command().run))
    return typer.main.get_command(app)
