"""Progress in the output of a notebook's cell, which changes in place.

The table is rich's, as on a terminal; it is shown as HTML by IPython, since rich's own display in notebooks needs
ipywidgets.
"""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

from uqmbd.progress.board import Board

__all__ = ["Notebook", "in_notebook"]

WIDTH = 90
"""Characters of a row."""


def in_notebook() -> bool:
    """Return whether this is a notebook: an IPython with a kernel, not one on a terminal."""
    shell = getattr(sys.modules.get("IPython"), "get_ipython", lambda: None)()
    return getattr(shell, "kernel", None) is not None


@dataclass
class Notebook:
    """Progress in a notebook: a row for each label, and one for their total."""

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
        """Show what begins."""
        self.board.stage(text, self.clock())
        self._show()

    def start(self, label: str, total: int) -> None:
        """Show a bar; one that has not ended grows, one that has starts again."""
        self.board.settle(self.clock())
        self.board.begun(label, total, self.clock())
        self._show()

    def advance(self, label: str, count: int = 1) -> None:
        """Move the bar."""
        self.board.moved(label, count)
        if self.clock() - self.last >= self.interval:
            self._show()

    def finish(self, label: str) -> None:
        """Fill the bar and say how long it took."""
        self.board.ended(label, "done", self.clock())
        self._show()

    def fail(self, label: str) -> None:
        """Say that it has failed."""
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

        # rich shows what it prints in a notebook by itself, besides
        console = Console(
            file=io.StringIO(), record=True, width=WIDTH, force_terminal=True, force_jupyter=False, legacy_windows=False
        )
        console.print(self.board.table(self.last, WIDTH))
        # the colours of the text and of its ground are the notebook's
        table = console.export_html(inline_styles=True, code_format="<code>{code}</code>")
        style = "margin:0;padding:0;line-height:1.3;white-space:pre;overflow-x:auto;background:none"
        return f'<pre style="{style}" role="status" aria-label="progress">{table.strip()}</pre>'
