"""Samples that are more than are kept: reduced by who computes them, stored once, gone on with in place."""

from __future__ import annotations

import json
import os
import random
import signal
import subprocess
import sys
import time
from concurrent.futures import BrokenExecutor, Executor, Future, ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path
from typing import Any

import chaospy
import numpy as np
import pytest
import xarray as xr

import uqmbd
from uqmbd.propagation.reduction.reduced import ReductionOrder
from uqmbd.results import SampleStore, save
from uqmbd.results.storage.journal import Journal
from uqmbd_joints import Distance
from uqmbd_montecarlo import MonteCarlo

SAMPLES, KEEP = 600, 100


def swing(*, samples: int = SAMPLES, keep: int = KEEP, sampling: str = "random", more: bool = False) -> uqmbd.Study:
    """A study of ten chunks; with `more`, with outputs without a time, of which one may not happen, and requirements."""
    mechanism = uqmbd.Mechanism("swing", uqmbd.Translational(gravity=(0, -9.81)))
    length = uqmbd.RandomVariable("length", chaospy.Normal(1, 0.02), units="m")
    speed = uqmbd.RandomVariable("speed", chaospy.Normal(0.2, 0.05), units="m/s")
    bob = mechanism.body("bob", mass=1, position=(0, -length), velocity=(speed, 0))
    mechanism.add(Distance("rod", mechanism.ground, bob, (0, 0), (0, 0), length=length))
    mechanism.output("x", bob.position[0], units="m")
    if more:
        mechanism.output("most", uqmbd.maximum(bob.position[0]), units="m")
        mechanism.output("when", uqmbd.first_time(bob.position[0] >= 0.02), units="s")
        mechanism.require("near", bob.position[0] <= 0.025)
        mechanism.require("slow", uqmbd.maximum(bob.velocity[0]) <= 0.28)
    method = MonteCarlo(samples=samples, seed=3, keep=keep, sampling=sampling, replicates=4)
    return uqmbd.Study("swing", mechanism, np.linspace(0, 0.1, 3), [method])


class Here(Executor):
    """Does everything at once, and counts; it may give up, or not share the folder."""

    def __init__(self, gives_up_after: int | None = None, *, apart: bool = False) -> None:
        self.chunks, self.computed, self.sent = 0, 0, 0
        self.gives_up_after, self.apart = gives_up_after, apart

    def submit(self, fn: Any, /, *args: Any, **kwargs: Any) -> Future[Any]:
        future: Future[Any] = Future()
        if self.gives_up_after is not None and self.chunks >= self.gives_up_after:
            future.set_exception(KeyboardInterrupt())
            return future
        self.chunks += 1
        if self.apart:
            args = tuple(_elsewhere(x) if isinstance(x, ReductionOrder) else x for x in args)
        found = fn(*args, **kwargs)
        handed = found.result
        self.computed += getattr(handed, "computed", False)
        self.sent += any(content is not None for _, content in getattr(handed, "files", {}).values())
        future.set_result(found)
        return future


def _elsewhere(order: ReductionOrder) -> ReductionOrder:
    nowhere = Path("/nowhere")
    return replace(
        order,
        shelves={
            kind: replace(shelf, token=(nowhere, "token"), path=nowhere / "0") for kind, shelf in order.shelves.items()
        },
    )


def content(tree: xr.DataTree, folder: Path) -> dict[str, bytes]:
    """All numbers of the method's node, and all samples."""
    found = {
        f"{node.path}/{name}": np.asarray(data.values).tobytes()
        for node in tree["monte-carlo"].subtree
        for name, data in node.to_dataset(inherit=False).variables.items()
    }
    for store in sorted(folder.glob("*.zarr")):
        data = xr.load_dataset(store, engine="zarr")
        found |= {f"{store.name}/{name}": data[name].values.tobytes() for name in data.variables}
    attrs = tree["monte-carlo"].attrs
    counters = json.loads(attrs["solver_counters"])
    counts = attrs["realisations"], attrs["failures"], {name: counters[name] for name in counters if name != "seconds"}
    return found | {"counts": repr(counts).encode()}


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> dict[bool, dict[str, bytes]]:
    """What undisturbed runs give."""
    found = {}
    for more in (False, True):
        folder = tmp_path_factory.mktemp("whole")
        found[more] = content(swing(more=more).run(folder=folder), folder)
    return found


def test_stored_samples_and_statistics_are_those_of_all(tmp_path: Path) -> None:
    tree = swing(more=True).run(folder=tmp_path)
    kept = swing(more=True, keep=SAMPLES).run()
    for name in ("mean", "std", "skewness"):
        for part in ("monte-carlo", "monte-carlo/scalars"):
            found, expected = tree[f"{part}/statistics"][name], kept[f"{part}/statistics"][name]
            np.testing.assert_allclose(found, expected, rtol=1e-9, atol=1e-15, err_msg=f"{part} {name}")
    xr.testing.assert_identical(
        tree["monte-carlo/requirements"].to_dataset(), kept["monte-carlo/requirements"].to_dataset()
    )
    store = SampleStore.open(tmp_path / tree["monte-carlo"].attrs["all_samples"])
    found = np.concatenate([part.response for part in store.chunks()])
    np.testing.assert_array_equal(found, kept["monte-carlo/samples"]["response"])
    scalars = SampleStore.open(tmp_path / tree["monte-carlo/scalars"].attrs["all_samples"])
    found = np.concatenate([part.response[:, :, 0] for part in scalars.chunks()])
    np.testing.assert_array_equal(found, kept["monte-carlo/scalars/samples"]["response"])
    assert np.isnan(found).any(), "an output does not happen in some realisations"


@pytest.mark.parametrize("more", [False, True])
def test_realisations_are_computed_once_and_nothing_of_them_is_held(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, more: bool
) -> None:
    problems, made = [], uqmbd.Study.problem

    def problem(*args: Any) -> uqmbd.extend.Problem:
        problems.append(made(*args))
        return problems[-1]

    monkeypatch.setattr(uqmbd.Study, "problem", problem)
    executor = Here()
    swing(more=more).run(executor, folder=tmp_path)
    assert executor.computed == 10 and executor.sent == 0
    (one,) = problems
    assert not one.runner.known


@pytest.mark.parametrize("who", ["threads", "not shared", pytest.param("processes", marks=pytest.mark.thorough)])
def test_bits_do_not_depend_on_who_computes(tmp_path: Path, whole: dict[bool, dict[str, bytes]], who: str) -> None:
    if who == "threads":
        with ThreadPoolExecutor(3) as executor:
            tree = swing(more=True).run(executor, folder=tmp_path)
    elif who == "processes":
        tree = swing(more=True).run(2, folder=tmp_path)
    else:
        apart = Here(apart=True)
        tree = swing(more=True).run(apart, folder=tmp_path)
        assert apart.sent == apart.computed == 10
    assert content(tree, tmp_path) == whole[True]


@pytest.mark.thorough
@pytest.mark.parametrize("more", [False, True])
def test_interrupted_runs_go_on_in_place_with_the_same_bits(
    tmp_path: Path, whole: dict[bool, dict[str, bytes]], more: bool
) -> None:
    """Interrupted at random chunks until all are there: none that is whole is computed twice."""
    generator, total = random.Random(4), 0
    for most in [*(generator.randint(1, 30) for _ in range(8)), None]:
        executor = Here(gives_up_after=most)
        try:
            tree = swing(more=more).run(executor, folder=tmp_path, resume=True)
        except KeyboardInterrupt:
            assert most is not None
        total += executor.computed
    assert total == 10
    assert content(tree, tmp_path) == whole[more]
    save(tree, tmp_path / "results.nc")
    left = {".uqmbd-manifest.json", "results.nc", "monte-carlo-samples.zarr"} | (
        {"monte-carlo-scalars-samples.zarr"} if more else set()
    )
    assert {p.name for p in tmp_path.iterdir()} == left


@pytest.mark.parametrize("ended", [False, True], ids=["interrupted", "not saved"])
def test_damage_costs_only_itself(tmp_path: Path, whole: dict[bool, dict[str, bytes]], ended: bool) -> None:
    """Of ten chunks, one file is lost, one is torn, one has a flipped bit, and the record of one is damaged."""
    try:
        swing(more=True).run(Here(gives_up_after=None if ended else 9), folder=tmp_path)
    except KeyboardInterrupt:
        assert not ended
    journal, *_ = sorted(tmp_path.glob("un*/*/*.journal"), key=lambda path: -path.stat().st_size)
    (store,) = {*tmp_path.rglob(f"{journal.stem}.zarr"), *tmp_path.glob("monte-carlo-samples.zarr")}
    (store / "response" / "1.0.0").unlink()
    path = store / "response" / "2.0.0"
    path.write_bytes(path.read_bytes()[:-10])
    path = store / "response" / "3.0.0"
    flipped = bytearray(path.read_bytes())
    flipped[-20] ^= 8
    path.write_bytes(flipped)
    records = bytearray(journal.read_bytes())
    places = [place for place, _ in Journal(journal).places()]
    records[(places[6] + places[7]) // 2] ^= 1
    journal.write_bytes(records + records[:200])
    executor = Here()
    tree = swing(more=True).run(executor, folder=tmp_path, resume=True)
    assert executor.computed == (4 if ended else 5)
    assert content(tree, tmp_path) == whole[True]


def test_another_study_is_not_gone_on_with(tmp_path: Path) -> None:
    with pytest.raises(KeyboardInterrupt):
        swing(sampling="latin-hypercube").run(Here(gives_up_after=4), folder=tmp_path)
    executor = Here()
    with pytest.warns(
        uqmbd.StudyWarning,
        match='has options that differ from the data of .* .sampling="random", not "latin-hypercube".',
    ):
        swing().run(executor, folder=tmp_path, resume=True)
    assert executor.computed == 10


@pytest.mark.thorough
@pytest.mark.parametrize("samples", [300, 1000])
def test_other_numbers_of_samples_go_on_with_those_that_are_there(tmp_path: Path, samples: int) -> None:
    """Of 600 samples all chunks of 64 but the last, which is not full; fewer samples leave the others out."""
    folder = tmp_path / "undisturbed"
    expected = content(swing(more=True, samples=samples).run(folder=folder), folder)
    swing(more=True).run(folder=tmp_path / "out")
    executor = Here()
    tree = swing(more=True, samples=samples).run(executor, folder=tmp_path / "out", resume=True)
    assert executor.computed == -(-samples // 64) - min(SAMPLES // 64, samples // 64)
    assert content(tree, tmp_path / "out") == expected


def test_more_that_are_kept_do_not_change_what_is_computed(tmp_path: Path) -> None:
    """The samples are gone on with, though another number of them is kept; what violates was counted."""
    with pytest.raises(KeyboardInterrupt):
        swing(more=True).run(Here(gives_up_after=4), folder=tmp_path)
    executor = Here()
    with pytest.warns(uqmbd.StudyWarning, match="recomputes the realisations that depend on them"):
        tree = swing(more=True, keep=KEEP + 50).run(executor, folder=tmp_path, resume=True)
    assert executor.computed == 6
    assert tree["monte-carlo/samples"].sizes["sample"] == KEEP + 50


def test_without_a_folder_statistics_are_the_same(tmp_path: Path, whole: dict[bool, dict[str, bytes]]) -> None:
    executor = Here()
    found = content(swing(more=True).run(executor), tmp_path)
    assert executor.computed == 10
    expected = {name: value for name, value in whole[True].items() if ".zarr" not in name}
    counted = {name for name in found if found[name] != expected.get(name)}
    assert {name.rpartition("/")[2] for name in counted} <= {"quantile", "quantile_error", "quantile_interval"}, (
        "these are counted"
    )


FULL = """
import resource, sys
from pathlib import Path
sys.path.insert(0, sys.argv[1])
from test_reductions import content, swing, SAMPLES, save
folder = Path(sys.argv[2])
before = resource.getrlimit(resource.RLIMIT_FSIZE)
for limit in map(int, sys.argv[3:]):
    resource.setrlimit(resource.RLIMIT_FSIZE, (limit, before[1]))
    try:
        swing().run(folder=folder, resume=True)
        said = "nothing"
    except Exception as error:
        said = f"{type(error).__name__}: {error}"
    resource.setrlimit(resource.RLIMIT_FSIZE, before)
    print(limit, said)
"""


@pytest.mark.thorough
@pytest.mark.skipif(sys.platform == "win32", reason="the resource module is of Unix")
def test_full_disk_is_reported_and_costs_nothing_that_is_there(
    tmp_path: Path, whole: dict[bool, dict[str, bytes]]
) -> None:
    """The disk takes no metadata, then no chunk, then not the whole journal."""
    limits = ["150", "900", "4000"]
    command = [sys.executable, "-c", FULL, str(Path(__file__).parent), str(tmp_path), *limits]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    told = done.stdout.splitlines()
    assert [line.split()[0] for line in told] == limits
    for line in told:
        assert "StudyError" in line and "cannot be written: File too large" in line and str(tmp_path) in line, line
        assert "--resume" in line, line
    executor = Here()
    assert content(swing().run(executor, folder=tmp_path, resume=True), tmp_path) == whole[False]
    assert executor.computed < 10, "what was there"


KILLED = """
import sys
from pathlib import Path
sys.path.insert(0, sys.argv[1])
from test_reductions import swing, save
if __name__ == "__main__":
    folder = Path(sys.argv[2])
    save(swing(more=True, samples=1200).run(int(sys.argv[3]), folder=folder, resume=True), folder / "results.nc")
"""


@pytest.mark.slow
@pytest.mark.skipif(sys.platform == "win32", reason="kills process groups")
@pytest.mark.parametrize("workers", [1, 2])
def test_runs_that_are_killed_at_random_moments_have_the_bits_of_an_undisturbed_one(
    tmp_path: Path, workers: int
) -> None:
    undisturbed, out = tmp_path / "undisturbed", tmp_path / "killed"
    expected = content(swing(more=True, samples=1200).run(folder=undisturbed), undisturbed)
    generator, kills = random.Random(workers), 0
    (tmp_path / "script.py").write_text(KILLED)
    command = [sys.executable, str(tmp_path / "script.py"), str(Path(__file__).parent), str(out), str(workers)]
    while not (out / "results.nc").exists():
        process = subprocess.Popen(command, start_new_session=True, stderr=subprocess.DEVNULL)
        before, most = chunks(out), generator.randint(1, 6) if kills < 6 else 10_000
        while process.poll() is None and chunks(out) < before + most:
            time.sleep(0.001)
        time.sleep(generator.random() * 0.05)
        if process.poll() is None and kills < 6:
            os.killpg(process.pid, signal.SIGKILL)
            kills += 1
        process.wait()
        assert chunks(out) >= before or (out / "results.nc").exists(), "a stored chunk was lost"
    assert kills > 1
    found = xr.open_datatree(out / "results.nc", engine="h5netcdf").load()
    again = content(found, out)
    assert {name for name in expected if expected[name] != again.get(name)} <= {"counts"}


def chunks(folder: Path) -> int:
    """How many chunks of responses are stored."""
    return sum(name[0] != "." for where, _, names in os.walk(folder) if where.endswith("response") for name in names)


class Deadly(Here):
    """Its workers die of one chunk."""

    def submit(self, fn: Any, /, *args: Any, **kwargs: Any) -> Future[Any]:
        if any(isinstance(x, ReductionOrder) and x.first == 128 for x in args):
            future: Future[Any] = Future()
            future.set_exception(BrokenExecutor("killed"))
            return future
        return super().submit(fn, *args, **kwargs)


def test_chunk_that_kills_its_workers_is_failed_and_tried_again_by_a_run_that_goes_on(
    tmp_path: Path, whole: dict[bool, dict[str, bytes]]
) -> None:
    with pytest.warns(UserWarning, match="64 of 600 realisations failed.*ended unexpectedly"):
        tree = swing().run(Deadly(), folder=tmp_path)
    data = xr.load_dataset(tmp_path / "monte-carlo-samples.zarr", engine="zarr")
    failed = np.arange(SAMPLES) // 64 == 2
    np.testing.assert_array_equal(data["status"] == uqmbd.results.Status.WORKER_DIED, failed)
    np.testing.assert_array_equal(np.isnan(data["response"]).all(("output", "time")), failed)
    assert tree["monte-carlo"].attrs["failures"] == 64
    assert all("unexpectedly" in str(text) for text in data["message"].values[failed])
    executor = Here()
    again = swing().run(executor, folder=tmp_path, resume=True)
    assert executor.computed == 1
    assert content(again, tmp_path) == whole[False]
