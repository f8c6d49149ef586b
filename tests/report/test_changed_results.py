"""Results that another program changed are reported on, or are one message that names the file."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import chaospy
import h5py
import numpy as np
import pytest
import xarray as xr

import uqmbd
from tests.results.conftest import oscillator_node
from uqmbd import results
from uqmbd.errors import StudyError
from uqmbd.report import write_report
from uqmbd_collocation import Collocation


@pytest.fixture(scope="module")
def saved(tmp_path_factory: pytest.TempPathFactory) -> Path:
    nodes = [oscillator_node("one", samples=30), oscillator_node("two", samples=20, seed=2)]
    tree = results.study_tree(nodes, study="s", mechanism="m")
    return results.save(tree, tmp_path_factory.mktemp("saved") / "results.nc")


def _kind(tree: xr.DataTree) -> None:
    data = tree["comparison"].to_dataset()
    kinds = data["verdict_kind"]
    tree["comparison"].dataset = data.assign(verdict_kind=(kinds.dims, np.full(kinds.shape, "nonsense")))


def _no_statistics(tree: xr.DataTree) -> None:
    tree["two"].children = {name: child for name, child in tree["two"].children.items() if name != "statistics"}


def _no_reference(tree: xr.DataTree) -> None:
    del tree["comparison"].attrs["reference"]


def _wall_time(tree: xr.DataTree) -> None:
    tree["one"].attrs["wall_time"] = "a while"


@pytest.mark.thorough
@pytest.mark.parametrize(
    ("change", "words"),
    [
        (_kind, "verdict_kind is 'nonsense'; expected one of"),
        (_no_statistics, "no child 'statistics'"),
        (_no_reference, "attribute 'reference'"),
        (_wall_time, "attribute 'wall_time'"),
    ],
)
def test_what_does_not_keep_to_the_schema_is_named(
    saved: Path, tmp_path: Path, change: Callable[[xr.DataTree], None], words: str
) -> None:
    tree = results.load(saved)
    change(tree)
    path = results.save(tree, tmp_path / "results.nc")
    with pytest.raises(StudyError, match=words):
        write_report(results.load(path), tmp_path / "report.html")


@pytest.mark.thorough
def test_a_label_that_was_changed_is_named(tmp_path: Path) -> None:
    """The section on influences looks a method up by its label."""
    mechanism = uqmbd.Mechanism("stone", uqmbd.Line())
    speed = uqmbd.RandomVariable("speed", chaospy.Normal(1, 0.1), units="m/s")
    mechanism.output("way", mechanism.body("stone", mass=1, velocity=speed).position[0], units="m")
    tree = uqmbd.Study("stone", mechanism, [0, 1], [Collocation(order=1)]).run()
    tree["collocation"].attrs["label"] = "other"
    path = results.save(tree, tmp_path / "results.nc")
    with pytest.raises(StudyError, match="results.nc' cannot be used: /collocation: found attribute 'label' = 'other'"):
        write_report(results.load(path), tmp_path / "report.html")


@pytest.mark.thorough
def test_units_that_resemble_dates_are_shown(saved: Path, tmp_path: Path) -> None:
    path = tmp_path / "results.nc"
    path.write_bytes(saved.read_bytes())
    with h5py.File(path, "r+") as file:
        for name in ("one/statistics/mean", "one/statistics/std", "one/statistics/time", "two/statistics/mean"):
            file[name].attrs["units"] = "days since 2000-01-01"
    assert write_report(results.load(path), tmp_path / "report.html").is_file()
