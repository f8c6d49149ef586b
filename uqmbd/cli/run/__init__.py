"""`uqmbd run`: selection and size of methods, the run, and the summary on the console."""

from __future__ import annotations

from uqmbd.cli.run.run import run_study

__all__ = ["run_study"]
