"""Non-intrusive polynomial chaos: realisations at chosen points, and a surrogate fitted to them."""

from __future__ import annotations

import uqmbd
from uqmbd_collocation.propagator import Collocation

__all__ = ["Collocation"]


@uqmbd.hookimpl
def uqmbd_propagators() -> list[type[uqmbd.extend.Propagator]]:
    """Return the propagator of this package."""
    return [Collocation]
