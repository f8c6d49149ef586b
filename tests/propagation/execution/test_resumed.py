"""A run that goes on with what is kept of something else says so; one that can go on says nothing."""

from __future__ import annotations

import warnings
from pathlib import Path
from typing import Any

import chaospy
import pytest

import uqmbd
from uqmbd_montecarlo import MonteCarlo


def fall(spread: float = 0.2, **options: Any) -> uqmbd.Study:
    mechanism = uqmbd.Mechanism("fall", uqmbd.Translational())
    speed = uqmbd.RandomVariable("speed", chaospy.Normal(3, spread), units="m/s")
    mechanism.output("x", mechanism.body("mass", mass=1, velocity=(speed, 0)).position[0], units="m")
    return uqmbd.Study("fall", mechanism, [0.0, 1.0], [MonteCarlo(**({"samples": 70, "seed": 1} | options))])


@pytest.mark.parametrize(
    ("other", "said"),
    [
        (
            {"seed": 2},
            r"^resume: monte-carlo has options that differ from the data of .*unfinished \(seed=2, not 1\), and recomputes",
        ),
        ({"spread": 0.1}, "^resume: the data in .* belong to another study .*They are not used"),
        ({"label": "mc"}, "^resume: .* contains no data of mc; this method starts"),
        ({"samples": 90}, None),
        ({}, None),
    ],
    ids=str,
)
def test_what_is_kept_of_something_else_is_reported_once(
    tmp_path: Path, other: dict[str, Any], said: str | None
) -> None:
    fall().run(folder=tmp_path)
    for expected in (said, None):  # the second time it is that which is kept
        with warnings.catch_warnings(record=True) as found:
            warnings.simplefilter("always")
            fall(**other).run(folder=tmp_path, resume=True)
        if expected is None:
            assert not found
        else:
            with pytest.warns(uqmbd.StudyWarning, match=expected):
                (one,) = found
                warnings.warn(one.message, stacklevel=1)


def test_a_record_that_is_damaged_is_passed_over(tmp_path: Path) -> None:
    for content in ("", '{"study": 1, "methods": 3}'):
        fall().run(folder=tmp_path)
        (tmp_path / "unsaved" / "asked.json").write_text(content, encoding="latin-1")
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", uqmbd.StudyWarning)
            fall().run(folder=tmp_path, resume=True)
