"""The whole test suite of this package: its integrator does what uqmbd expects of it."""

from __future__ import annotations

from uqmbd.testing import check_integrator
from uqmbd_runge_kutta import RungeKutta


def test_runge_kutta():
    check_integrator(RungeKutta)
