"""Commands of the command line that plugins offer."""

from __future__ import annotations

from typing import Any, Protocol

__all__ = ["Command", "command_line"]


class Command(Protocol):
    """What a command of the command line has: a class that a plugin offers by the hook ``uqmbd_commands``.

    It is made without arguments, when it is listed or run, and need not derive from this one.  Its module is named in
    the entry-point group ``uqmbd.commands`` and imports nothing heavy: `uqmbd --help` waits for it.  What `run` needs
    it imports when it runs.

    The parameters of `run` are arguments and options, annotated as typer wants them.  It returns nothing and prints
    its result.  A `uqmbd.StudyError` is shown as a message and ends the program with the status 2, any other
    `uqmbd.UqmbdError` with 1, and ``raise SystemExit(status)`` with another one.  ``--debug`` is an option of all
    commands, and shows the traceback.

    A parameter of the type `uqmbd.Workers` without a default, after a ``*``, becomes the options ``--workers``,
    ``--dask`` and ``--mpi``: ``with workers.start(script) as executor:`` yields what `Study.run`,
    `uqmbd.extend.pool` and others take as workers.

    Attributes
    ----------
    name : str
        What is typed after ``uqmbd``: small letters, digits and hyphens.
    help : str
        What it does, shown by ``uqmbd --help`` (as far as it fits into a line) and ``uqmbd NAME --help``.

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
        """Do the work.

        Parameters
        ----------
        *arguments, **options
            As its signature declares them: with them the command line calls it.
        """


def command_line(command: type[Command]) -> Any:
    """Make what `typer` runs of a command.

    Raise Exception whatever the class raises when it is made, or typer where it cannot take an annotation.
    """
    import typer

    from uqmbd.clusters import with_worker_options

    # help without rich, as that of the other commands
    app = typer.Typer(
        rich_markup_mode=None,
        pretty_exceptions_enable=False,
        add_completion=False,
        context_settings={"help_option_names": ["-h", "--help"]},
    )
    app.command(name=command.name, help=command.help)(with_worker_options(command().run))
    return typer.main.get_command(app)
