"""`uqmbd run`: which methods run and how large they are, the run, and its report on the console."""

from __future__ import annotations

from uqmbd.cli.run.run import run_study

__all__ = ["run_study"]
