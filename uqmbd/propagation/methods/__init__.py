"""Methods: their interface, cost estimates, obstacles, and execution."""

from __future__ import annotations

from uqmbd.propagation.methods.estimate import Estimate, Sizing, readable
from uqmbd.propagation.methods.keys import require_keys_accepted, require_smooth_outputs
from uqmbd.propagation.methods.propagator import Propagator, check_propagators, labelled
from uqmbd.propagation.methods.running import obstacle_of, run_method
from uqmbd.propagation.methods.studied import Studied

__all__ = [
    "Estimate",
    "Propagator",
    "Sizing",
    "Studied",
    "check_propagators",
    "labelled",
    "obstacle_of",
    "require_keys_accepted",
    "require_smooth_outputs",
    "readable",
    "run_method",
]
