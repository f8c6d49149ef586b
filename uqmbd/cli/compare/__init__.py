"""`uqmbd compare`: how far stored results are apart, and what else differs between them."""

from __future__ import annotations

from uqmbd.cli.compare.compare import show_comparison

__all__ = ["show_comparison"]
