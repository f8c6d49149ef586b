"""Options of Galerkin that cannot be used are told before anything is computed."""

from __future__ import annotations

import pytest

import uqmbd
from uqmbd_galerkin import Galerkin


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"weights": "ab"}, "weights is 'ab'; expected a number above 0 for each input"),
        ({"weights": (1, -1)}, "weights is .1, -1.; expected a number above 0"),
        ({"samples": 50}, "samples cannot be combined with rule='gauss', a grid"),
        ({"stop_at": "x"}, "stop_at is 'x'"),
        ({"stop_at": True}, "stop_at is True"),
    ],
)
def test_unusable_options(options, message):
    with pytest.raises(uqmbd.StudyError, match=message):
        Galerkin(**options)


def test_the_level_of_a_sparse_grid_is_not_a_number_of_samples():
    assert Galerkin(rule="smolyak", level=2).level == 2
    with pytest.warns(DeprecationWarning, match="use level= instead"):
        old = Galerkin(rule="smolyak", samples=2)
    assert (old.level, old.samples) == (2, None)
    for options in ({"level": 2}, {"rule": "sobol", "samples": 8, "level": 2}, {"rule": "smolyak", "level": -1}):
        with pytest.raises(uqmbd.StudyError, match="Galerkin: level(=2 requires| is -1)"):
            Galerkin(**options)
