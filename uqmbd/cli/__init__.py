"""The command line: `uqmbd run | check | plugins | report | compare`."""

from __future__ import annotations

from uqmbd.cli.app import app, main

__all__ = ["app", "main"]
