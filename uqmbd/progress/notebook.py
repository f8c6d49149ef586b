"""Progress in the output of a notebook cell, which is updated in place.

The table is created by rich, as on a terminal.  IPython shows it as HTML, because rich's own display in notebooks
requires ipywidgets.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

from uqmbd.progress.board import Board

__all__ = ["Notebook"]

WIDTH = 90
"""Number of characters of a row."""


@dataclass
class Notebook:
    """Progress in a notebook, with a row for each label and a row for the total of the methods."""

    interval: float = 0.2  # least time between two updates, s
    clock: Callable[[], float] = time.monotonic  # time, s
    board: Board = field(default_factory=Board)
    handle: Any = None
    last: float = 0.0

    def expect(self, totals: Mapping[str, int | None]) -> None:
        """Show all methods."""
        self.board.expect(totals)
        self._show()

    def stage(self, text: str) -> None:
        """Show a task without a number of steps."""
        self.board.stage(text, self.clock())
        self._show()

    def start(self, label: str, total: int) -> None:
        """Show a bar; the bar of a running task grows, and the bar of an ended task restarts."""
        self.board.settle(self.clock())
        self.board.begun(label, total, self.clock())
        self._show()

    def advance(self, label: str, count: int = 1) -> None:
        """Move the bar."""
        self.board.moved(label, count)
        if self.clock() - self.last >= self.interval:
            self._show()

    def cost(self, label: str, seconds: float) -> None:
        """Record the wall time for the row, s."""
        self.board.costs(label, seconds)

    def finish(self, label: str) -> None:
        """Fill the bar and show the elapsed time."""
        self.board.ended(label, "done", self.clock())
        self._show()

    def fail(self, label: str) -> None:
        """Mark the bar as failed."""
        self.board.ended(label, "failed", self.clock())
        self._show()

    def _show(self) -> None:
        from IPython.display import HTML, display

        self.last = self.clock()
        made = HTML(self._html())
        if self.handle is None:
            self.handle = display(made, display_id=True)
        else:
            self.handle.update(made)

    def _html(self) -> str:
        import io

        from rich.console import Console

        # without this setting, rich would also display the printed table in a notebook
        console = Console(
            file=io.StringIO(), record=True, width=WIDTH, force_terminal=True, force_jupyter=False, legacy_windows=False
        )
        console.print(self.board.table(self.last, WIDTH))
        # keep the text and background colours of the notebook
        table = console.export_html(inline_styles=True, code_format="<code>{code}</code>")
        style = "margin:0;padding:0;line-height:1.3;white-space:pre;overflow-x:auto;background:none"
        return f'<pre style="{style}" role="status" aria-label="progress">{table.strip()}</pre>'
