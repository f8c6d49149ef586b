"""Sampled controllers: calls, measured values, and use of commands."""

from __future__ import annotations

from uqmbd.dynamics.control.loop import ControlLoop, loops_of, require_controllers, unused_commands
from uqmbd.dynamics.control.sampling import Sampling

__all__ = ["ControlLoop", "Sampling", "loops_of", "require_controllers", "unused_commands"]
