"""The whole test suite of this package: what it offers does what uqmbd expects of it."""

from __future__ import annotations

from uqmbd.testing import check_component, check_propagator
from uqmbd_example import Magnet, MeanValue, Taylor


def test_magnet():
    check_component(Magnet)


def test_taylor():
    check_propagator(Taylor(), moments=["stone"])  # which is linear
    check_propagator(Taylor(), moments=["pendulum"], tolerance=0.1, failures=False, resume=False)  # which is nearly so


def test_mean_value():
    check_propagator(MeanValue(), moments=False, nothing_random=False)  # no spread, and none needed
