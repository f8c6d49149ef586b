"""Options of Galerkin that cannot be used are told before anything is computed."""

from __future__ import annotations

import pytest

import uqmbd
from uqmbd_galerkin import Galerkin


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"weights": "ab"}, "weights is 'ab'; expected one positive number for each input"),
        ({"weights": (1, -1)}, "weights is .1, -1.; expected one positive number"),
        ({"samples": 50}, "samples is given, but rule='gauss' is a grid"),
        ({"stop_at": "x"}, "stop_at is 'x'"),
        ({"stop_at": True}, "stop_at is True"),
    ],
)
def test_unusable_options(options, message):
    with pytest.raises(uqmbd.StudyError, match=message):
        Galerkin(**options)
