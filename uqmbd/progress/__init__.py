"""Progress of long computations: lines, bars on a terminal, and bars in notebooks."""

from __future__ import annotations

from uqmbd.progress.board import AtMost, Board
from uqmbd.progress.interface import (
    Progress,
    Silent,
    UntilTheEnd,
    choose_receiver,
    expected,
    failed,
    in_notebook,
    stage,
)
from uqmbd.progress.lines import Lines
from uqmbd.progress.notebook import Notebook

__all__ = [
    "AtMost",
    "Board",
    "Lines",
    "Notebook",
    "Progress",
    "Silent",
    "UntilTheEnd",
    "expected",
    "failed",
    "in_notebook",
    "stage",
    "choose_receiver",
]
