"""`uqmbd run`: selection and size of methods, the run, and the summary on the console."""

from __future__ import annotations

from uqmbd.cli.run.run import run_study
from uqmbd.cli.run.settings import parse_value, type_name

__all__ = ["parse_value", "run_study", "type_name"]
