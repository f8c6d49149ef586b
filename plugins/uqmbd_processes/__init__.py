"""Random processes: roads, gusts, motions of the ground, and the stationary response of linearised mechanisms.

The package also computes spectra, orders and cycles of simulated motions.
"""

from __future__ import annotations

import uqmbd
from uqmbd_processes.checks import LostVariance, UnusedProcesses
from uqmbd_processes.common_paths import CommonPaths
from uqmbd_processes.densities import PowerSpectralDensity
from uqmbd_processes.motion_spectra import estimated_psd, estimated_std, order_amplitude
from uqmbd_processes.paths import exponential_covariance
from uqmbd_processes.process import RandomProcess
from uqmbd_processes.rainflow_cycles import rainflow_counts, rainflow_damage
from uqmbd_processes.reporting import VarianceSection
from uqmbd_processes.spectra import davenport_coherence, iso8608, kaimal, kanai_tajimi, von_karman, white_noise
from uqmbd_processes.stationary import (
    crossing_rate,
    expected_maximum,
    fatigue_damage,
    stationary_psd,
    stationary_std,
)

__all__ = [
    "CommonPaths",
    "PowerSpectralDensity",
    "RandomProcess",
    "crossing_rate",
    "davenport_coherence",
    "estimated_psd",
    "estimated_std",
    "expected_maximum",
    "exponential_covariance",
    "fatigue_damage",
    "iso8608",
    "kaimal",
    "kanai_tajimi",
    "order_amplitude",
    "rainflow_counts",
    "rainflow_damage",
    "stationary_psd",
    "stationary_std",
    "von_karman",
    "white_noise",
]


@uqmbd.hookimpl
def uqmbd_checks() -> list[type]:
    """Return the checks of this package."""
    return [UnusedProcesses, LostVariance]


@uqmbd.hookimpl
def uqmbd_report_sections() -> list[type]:
    """Return the report sections of this package."""
    return [VarianceSection]


@uqmbd.hookimpl
def uqmbd_propagators() -> list[type]:
    """Return the propagators of this package."""
    return [CommonPaths]
