"""`uqmbd bodies`: what the mechanism of a study consists of."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

import uqmbd

__all__ = ["Bodies"]


class Bodies:
    """List bodies, or those of a name."""

    name = "bodies"
    help = "List the bodies of a study."

    def run(
        self,
        script: Annotated[Path, typer.Argument(metavar="STUDY.py", help="Study script.")],
        only: Annotated[
            list[str] | None, typer.Option("--only", metavar="NAME", help="Which (may be repeated).")
        ] = None,
    ) -> None:
        """Print the names, a line each."""
        bodies = uqmbd.load_study(script).mechanism.bodies
        for name in only or bodies:
            if name not in bodies:
                raise uqmbd.StudyError(f"--only {name}: there is no such body; there are {', '.join(bodies)}.")
            print(name)
