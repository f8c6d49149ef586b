"""The command line: `uqmbd run | check | animate | plugins | report | compare | new`."""

from __future__ import annotations

from uqmbd.cli.app import app, main

__all__ = ["app", "main"]
