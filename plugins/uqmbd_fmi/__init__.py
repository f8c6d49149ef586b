"""Export of surrogates with their uncertainty, and of mechanisms, as functional mock-up units of FMI 2.0 and 3.0."""

from __future__ import annotations

import uqmbd
from uqmbd_fmi.distributions import read_distributions
from uqmbd_fmi.exporter import FmuExporter
from uqmbd_fmi.exporting import Exported, export_fmu

__all__ = ["Exported", "export_fmu", "read_distributions"]


@uqmbd.hookimpl
def uqmbd_exporters() -> list[type]:
    """Return the exporters of this package."""
    return [FmuExporter]
