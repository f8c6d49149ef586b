"""The command line: `uqmbd run | check | animate | plugins | report | compare | new`."""

from __future__ import annotations

import sys
from collections.abc import Sequence

__all__ = ["main"]


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the command line; see `uqmbd.cli.app.main`."""
    words = sys.argv[1:] if arguments is None else arguments
    if "view" in words[:2] and words[-1:] != ["--help"] and any(word.endswith(".py") for word in words):
        # the process of the study imports its packages while this process imports the command line
        from uqmbd.viewer import first_child

        first_child()
    from uqmbd.cli.app import main as run

    run(arguments)
