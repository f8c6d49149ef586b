"""Choose the receiver of progress reports from the argument `progress`."""

from __future__ import annotations

import sys

from uqmbd.errors import StudyError
from uqmbd.progress.interface import Progress, Silent
from uqmbd.progress.lines import Lines
from uqmbd.progress.notebook import Notebook, in_notebook

__all__ = ["told"]


def told(progress: Progress | bool | None) -> Progress:
    """Return the progress to report to: the given one, lines (True), none (False), or that of a notebook (None).

    >>> type(told(None)).__name__, type(told(True)).__name__, type(told(False)).__name__
    ('Silent', 'Lines', 'Silent')
    """
    if progress is None or isinstance(progress, bool):
        if progress is not False and in_notebook():
            return Notebook()
        return Lines(sys.stderr) if progress else Silent()
    if not all(callable(getattr(progress, name, None)) for name in ("start", "advance", "finish")):
        raise StudyError(
            f"progress is {progress!r}; expected True, False, None, or an object like uqmbd.extend.Progress."
        )
    return progress
