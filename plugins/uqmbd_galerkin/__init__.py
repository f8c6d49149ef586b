"""Intrusive Galerkin polynomial chaos by Variational Work."""

from __future__ import annotations

import uqmbd
from uqmbd_galerkin.propagator import Galerkin

__all__ = ["Galerkin"]


@uqmbd.hookimpl
def uqmbd_propagators() -> list[type[uqmbd.extend.Propagator]]:
    """Return the propagator of this package."""
    return [Galerkin]
