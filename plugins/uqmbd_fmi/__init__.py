"""Functional mock-up units of FMI 2.0 and 3.0: export of surrogates and mechanisms, import as controllers."""

from __future__ import annotations

import uqmbd
from uqmbd_fmi.distributions import read_distributions
from uqmbd_fmi.exporter import FmuExporter
from uqmbd_fmi.exporting import Exported, export_fmu
from uqmbd_fmi.importing import fmu_controller

__all__ = ["Exported", "export_fmu", "fmu_controller", "read_distributions"]


@uqmbd.hookimpl
def uqmbd_exporters() -> list[type]:
    """Return the exporters of this package."""
    return [FmuExporter]
