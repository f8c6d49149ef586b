"""Progress of long work, as the command line and notebooks show it."""

from __future__ import annotations

from typing import Protocol

__all__ = ["Progress", "Silent"]


class Progress(Protocol):
    """What a study tells of its progress."""

    def start(self, label: str, total: int) -> None:
        """Begin the work called `label`, of `total` realisations."""

    def advance(self, label: str, count: int = 1) -> None:
        """Report `count` more of them."""

    def finish(self, label: str) -> None:
        """End it."""


class Silent:
    """Tells nobody."""

    def start(self, label: str, total: int) -> None:
        """Say nothing."""

    def advance(self, label: str, count: int = 1) -> None:
        """Say nothing."""

    def finish(self, label: str) -> None:
        """Say nothing."""
