"""An example of a plugin package: a component, two propagators and a section of the report, on the public interface of uqmbd only."""

from __future__ import annotations

import uqmbd
from uqmbd_example.magnet import Magnet
from uqmbd_example.mean_value import MeanValue
from uqmbd_example.rates import Rates
from uqmbd_example.taylor import Taylor

__all__ = ["Magnet", "MeanValue", "Rates", "Taylor"]


@uqmbd.hookimpl
def uqmbd_components() -> list[type[uqmbd.Component]]:
    """Return the components of this package."""
    return [Magnet]


@uqmbd.hookimpl
def uqmbd_propagators() -> list[type[uqmbd.Propagator]]:
    """Return the propagators of this package."""
    return [MeanValue, Taylor]


@uqmbd.hookimpl
def uqmbd_report_sections() -> list[type[Rates]]:
    """Return the sections of the report of this package."""
    return [Rates]
