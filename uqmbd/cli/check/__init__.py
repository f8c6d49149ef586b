"""`uqmbd check`: describe the computations of a study, in words and as a picture."""

from __future__ import annotations

from uqmbd.cli.check.check import show_check

__all__ = ["show_check"]
