"""Times as arrays of packages: those of one dimension are taken as lists are, those of none are refused in words."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
import xarray as xr

import uqmbd

GIVEN: list[Callable[[Any], Any]] = [np.asarray, xr.DataArray, lambda x: xr.Variable(("time",) * np.ndim(x), x)]


def mechanism() -> uqmbd.Mechanism:
    made = uqmbd.Mechanism("stone", uqmbd.Line())
    made.output("x", made.body("stone", mass=1, velocity=1).position[0], units="m")
    return made


@pytest.mark.parametrize("of", GIVEN)
def test_a_single_number_is_no_row_of_times(of: Callable[[Any], Any]) -> None:
    for one in (1.0, 1, np.nan):
        with pytest.raises(uqmbd.StudyError, match="study 's': times have shape"):
            uqmbd.Study("s", mechanism(), of(one))
        with pytest.raises(uqmbd.StudyError, match="study 's': breaks are"):
            uqmbd.Study("s", mechanism(), [0, 2], breaks=of(one))
        with pytest.raises(uqmbd.StudyError, match="study 's': report_times are"):
            uqmbd.Study("s", mechanism(), [0, 2], report_times=of(one))
        with pytest.raises(uqmbd.StudyError, match="times have shape"):
            uqmbd.simulate(mechanism(), of(one))


@pytest.mark.parametrize("of", GIVEN)
def test_rows_are_taken(of: Callable[[Any], Any]) -> None:
    study = uqmbd.Study("s", mechanism(), of([0.0, 1.0, 2.0]), breaks=of([1.5, 0.5]), report_times=of([1.0]))
    assert study.times.tolist() == [0, 1, 2] and study.breaks == (0.5, 1.5) and study.report_times == (1.0,)
