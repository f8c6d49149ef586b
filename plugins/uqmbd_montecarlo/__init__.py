"""Monte Carlo method, the reference for all other methods."""

from __future__ import annotations

import uqmbd
from uqmbd_montecarlo.lowfidelity import LowFidelity
from uqmbd_montecarlo.propagator import MonteCarlo

__all__ = ["LowFidelity", "MonteCarlo"]


@uqmbd.hookimpl
def uqmbd_propagators() -> list[type[uqmbd.extend.Propagator]]:
    """Return the propagator of this package."""
    return [MonteCarlo]
