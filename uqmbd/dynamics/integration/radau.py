"""Implicit integration of stiff realisations: a Radau IIA method on the index-1 form, with projection after each step.

The driver makes the steps, as for the explicit method; decisions are those of `uqmbd.dynamics.integration.dop853`.

References
----------
.. [1] E. Hairer, G. Wanner, Solving Ordinary Differential Equations II, 2nd ed., Springer 1996, IV.5, IV.8.
.. [2] C. Lubich, Integration of stiff mechanical systems by Runge-Kutta methods, ZAMP 44 (1993) 1022-1053.
"""

from __future__ import annotations

import time as clock
from dataclasses import replace

import numpy as np

from uqmbd.compiled import LANES
from uqmbd.dynamics.batch import Batch
from uqmbd.dynamics.equations import Model
from uqmbd.dynamics.integration.costs import implicit_attempt_cost
from uqmbd.dynamics.integration.dop853 import Integration
from uqmbd.dynamics.integration.trajectories import Counters, Solved
from uqmbd.dynamics.linear import RADAU_STAGES, implicit_dynamics
from uqmbd.typing import Array, Index

__all__ = ["COSTLY", "RADAU_STAGES", "allowed_attempts", "integrate_by_radau", "is_implicit"]

FEWEST = 20
"""Number of attempted steps that are allowed at any cost."""

SLOWER = 2.0
"""Factor on the cost of explicit steps. The first steps underestimate it: for rods on bushings by a factor of 1.6."""

COSTLY = "implicit steps cost more than explicit ones"
"""Message of realisations that need more attempted steps than allowed."""


def is_implicit(model: Model) -> bool:
    """Return whether the systems of implicit steps of a model are compiled."""
    return implicit_dynamics(model) is not None


def allowed_attempts(model: Model, explicit_cost: Array) -> Index:
    """Return the numbers of implicit steps (M,) that cost as much as explicit integrations of a given cost (M,)."""
    dynamics = implicit_dynamics(model)
    assert dynamics is not None
    most = np.minimum(SLOWER * explicit_cost / (LANES * implicit_attempt_cost(dynamics)), 1e15)
    return np.maximum(FEWEST, most).astype(np.int64)


def integrate_by_radau(
    ensemble: Batch,
    members: Index,
    times: Array,
    rtol: float,
    *,
    allowed: Index | None = None,
    recording: bool = False,
) -> Solved:
    """Integrate the assembled realisations `members` (M,) of a batch, whose model `is_implicit`.

    Realisations that need more attempted steps than `allowed` (M,) have a message.  With `recording`, the steps are
    also returned.
    """
    begin = clock.perf_counter()
    run = Integration(
        ensemble.select(members), times, rtol, patient=True, recording=recording, stages=RADAU_STAGES, allowed=allowed
    )
    with np.errstate(all="ignore"):
        run.run()
    for m in np.flatnonzero(run.main.allowed < 0).tolist():
        if run.messages[m]:
            run.messages[m] = COSTLY
    return replace(run.solved(), counters=run.counters + Counters(seconds=clock.perf_counter() - begin))
