"""Terminal output of a command: progress, warnings, errors, and the exit status."""

from __future__ import annotations

from uqmbd.cli.terminal.derivation import shown_derivation
from uqmbd.cli.terminal.failures import FAILED, UNMET, explained
from uqmbd.cli.terminal.progress import Staged, plain_progress, shown_progress

__all__ = ["FAILED", "UNMET", "Staged", "explained", "plain_progress", "shown_derivation", "shown_progress"]
