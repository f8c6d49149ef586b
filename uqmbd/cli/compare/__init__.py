"""`uqmbd compare`: differences between stored results in numbers and settings."""

from __future__ import annotations

from uqmbd.cli.compare.compare import show_comparison

__all__ = ["show_comparison"]
