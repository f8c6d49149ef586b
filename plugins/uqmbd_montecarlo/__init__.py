"""Monte Carlo: the reference that every other method is measured against."""

from __future__ import annotations

import uqmbd
from uqmbd_montecarlo.lowfidelity import LowFidelity
from uqmbd_montecarlo.propagator import MonteCarlo

__all__ = ["LowFidelity", "MonteCarlo"]


@uqmbd.hookimpl
def uqmbd_propagators() -> list[type[uqmbd.extend.Propagator]]:
    """Return the propagator of this package."""
    return [MonteCarlo]
