"""Motions whose contacts are decided in Python, one realisation at a time, in comparison with those of the driver."""

from __future__ import annotations

import numpy as np
import pytest

from uqmbd.compiled import Encounters
from uqmbd.dynamics import integrate
from uqmbd.dynamics.contact import event_driven


class Waiting(Encounters):
    """Contacts about which the driver decides nothing."""

    def __init__(self, *given, **options):
        super().__init__(*given, **options)
        self.decides = 2


def one_by_one(ensemble, times, rtol):
    """Integrate with decisions in Python, which treat any number of contacts, about each realisation alone."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(event_driven, "Encounters", Waiting)
        return integrate(ensemble, times, rtol, "dop853")


def compare(ensemble, times, allowed):
    """Compare decisions of the driver with those about each realisation alone, and parts with the whole."""
    found, alone = integrate(ensemble, times, 1e-9, "dop853"), one_by_one(ensemble, times, 1e-9)
    assert found.messages == alone.messages
    assert found.scalars.keys() == alone.scalars.keys()
    for name, moments in found.scalars.items():
        np.testing.assert_allclose(moments, alone.scalars[name], rtol=0, atol=allowed)
    np.testing.assert_allclose(found.states, alone.states, rtol=0, atol=allowed)
    for part in (np.arange(len(ensemble))[1::2], np.array([0])):
        some = integrate(ensemble.select(part), times, 1e-9, "dop853")
        assert np.array_equal(some.states, found.states[part], equal_nan=True)
