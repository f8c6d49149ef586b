"""Motions of many realisations with their energies."""

from __future__ import annotations

import numpy as np
import pytest

from uqmbd.dynamics import Ensemble, build, integrate


@pytest.fixture
def dropped():
    """Integrate a mechanism at values of its inputs: messages, total energy (K, T), states, counters."""

    def run(mechanism, values, times, rtol=1e-6):
        ensemble = Ensemble(build(mechanism), np.array(values))
        found = integrate(ensemble, np.asarray(times, dtype=float), rtol)
        energy = ensemble.energies(found.times, found.states).sum(axis=1)
        return found, energy

    return run
