"""The command line: `uqmbd run | check | animate | plugins | report | compare | new`."""

from __future__ import annotations

import sys
from collections.abc import Sequence

__all__ = ["main"]


def main(arguments: Sequence[str] | None = None) -> None:
    """Run the command line; see `uqmbd.cli.app.main`."""
    words = sys.argv[1:] if arguments is None else arguments
    early = list(words[:1]) == ["view"] and "--help" not in words and any(word.endswith(".py") for word in words)
    if early:
        # the process of the study imports its packages while this process imports the command line
        from uqmbd.viewer import start_early

        start_early()
    from uqmbd.cli.app import main as run

    try:
        run(arguments)
    finally:
        if early:
            from uqmbd.viewer import end_early

            end_early()
