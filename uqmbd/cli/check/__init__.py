"""`uqmbd check`: describe what a study would compute, in words and as a picture."""

from __future__ import annotations

from uqmbd.cli.check.check import show_check

__all__ = ["show_check"]
