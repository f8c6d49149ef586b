"""The whole test suite of this package: its propagators do what uqmbd expects of them."""

from __future__ import annotations

from uqmbd.testing import check_propagator
from uqmbd_gaussian_process import GaussianProcess, UnscentedTransform


def test_gaussian_process():
    check_propagator(GaussianProcess(), nothing_random=False)


def test_unscented_transform():
    # its moments are those of a parabola through three points of each input
    check_propagator(UnscentedTransform(), nothing_random=False, tolerance=0.1)
