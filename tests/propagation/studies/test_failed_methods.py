"""A method that cannot do a study, or fails, costs nothing but itself."""

from __future__ import annotations

import dataclasses
import json
import os
import signal
import threading
import time
import typing

import numpy as np
import pytest
import xarray as xr
from hypothesis import given, settings
from hypothesis import strategies as st

import uqmbd
from uqmbd.results import load, propagator_nodes, save, validate
from uqmbd_montecarlo import MonteCarlo

from ..conftest import oscillator

TIMES = np.linspace(0, 0.1, 3)
GOOD = MonteCarlo(samples=4, seed=1, label="good")


class Odd(BaseException):
    """No exception of Python's own."""


def raising(error):
    raise error


def cut(change):
    """Return what makes a node that is changed from the right one."""

    def made(method, problem):
        node = Own.right(method, problem)
        return change(node)

    return made


def without(name):
    def change(node):
        data = {"/": node.to_dataset(), "statistics": node["statistics"].to_dataset().drop_vars(name)}
        return xr.DataTree.from_dict(data, name=node.name)

    return change


BAD = {
    "raises": lambda m, p: raising(RuntimeError("no licence")),
    "has no memory": lambda m, p: raising(MemoryError()),
    "leaves": lambda m, p: raising(SystemExit("bye")),
    "is mistaken": lambda m, p: p.no_such_thing,
    "asserts": lambda m, p: raising(AssertionError()),
    "stops an iteration": lambda m, p: raising(StopIteration()),
    "recurses": lambda m, p: BAD["recurses"](m, p),
    "refuses": lambda m, p: raising(uqmbd.StudyError(f"{p.label}: the order is too high")),
    "returns nothing": lambda m, p: None,
    "returns text": lambda m, p: "done",
    "returns a dataset": lambda m, p: Own.right(m, p)["statistics"].to_dataset(),
    "returns an empty tree": lambda m, p: xr.DataTree(name=p.label),
    "returns another name": cut(lambda node: xr.DataTree.from_dict({"/": None, "statistics": node["statistics"].to_dataset()}, name="x")),
    "forgets the mean": cut(without("mean")),
    "forgets the deviation": cut(without("std")),
    "drops an output": cut(lambda node: node.map_over_datasets(lambda d: d.isel(output=[0]) if "output" in d.dims else d)),
    "drops a time": cut(lambda node: node.map_over_datasets(lambda d: d.isel(time=[0]) if "time" in d.dims else d)),
}  # fmt: skip


OBSTACLES = {
    "says what is in the way": lambda: "too many inputs",
    "raises": lambda: raising(KeyError("order")),
    "leaves": lambda: raising(SystemExit(3)),
    "returns a number": lambda: 42,
    "returns False": lambda: False,
}


@dataclasses.dataclass(frozen=True, kw_only=True)
class Own(uqmbd.extend.Propagator):
    """A method that does as it is told."""

    name: typing.ClassVar[str] = "own"
    how: str = "right"

    @staticmethod
    def right(method, problem):
        blank = np.zeros(problem.labels.shape)
        statistics = uqmbd.extend.statistics_dataset(problem.labels, mean=blank, std=blank)
        return problem.node(method, statistics, realisations=0, wall_time=0.0)

    def obstacle(self, study):
        return OBSTACLES[self.how]() if self.how in OBSTACLES else None

    def propagate(self, problem):
        return BAD[self.how](self, problem) if self.how in BAD else self.right(self, problem)


@dataclasses.dataclass(frozen=True, kw_only=True)
class Asked(Own):
    """A method of which an obstacle is asked for only."""

    def propagate(self, problem):
        raise AssertionError("it was run though something is in its way")


@pytest.fixture(scope="module")
def swing():
    study = uqmbd.Study("swings", oscillator(), TIMES, [GOOD])
    study.model  # noqa: B018 - made once
    return study


@pytest.fixture(scope="module")
def alone(swing):
    return swing.run()


def run_with(study, *methods, **options):
    """Return the tree and the warnings of methods that failed."""
    with pytest.warns(uqmbd.MethodFailedWarning) as told:
        tree = study.with_propagators(methods).run(**options)
    assert all(issubclass(w.category, uqmbd.MethodFailedWarning) and w.filename == __file__ for w in told)
    return tree, [str(w.message) for w in told]


# before and after the method that succeeds, by turns
@pytest.mark.parametrize(("how", "first"), [(how, k % 2 == 0) for k, how in enumerate([*BAD, *OBSTACLES])])
def test_the_others_run_and_their_bits_are_the_same(swing, alone, how, first):
    bad = (Asked if how in OBSTACLES else Own)(how=how, label="bad one")
    tree, (said,) = run_with(swing, *((bad, GOOD) if first else (GOOD, bad)))
    assert list(propagator_nodes(tree)) == ["good"]
    for part in ("statistics", "samples"):
        assert tree[f"good/{part}"].to_dataset().identical(alone[f"good/{part}"].to_dataset())
    failed = json.loads(tree.attrs["failed"])
    assert list(failed) == ["bad one"] and failed["bad one"] and "'bad one'" in said and failed["bad one"] in said
    validate(tree)


@pytest.mark.parametrize("how", [how for how in BAD if how.startswith(("returns", "forgets", "drops"))])
def test_wrong_kind_of_result_is_reported_by_the_name_of_the_method(swing, how):
    tree, _ = run_with(swing, GOOD, Own(how=how))
    assert f"{__name__}.Own" in json.loads(tree.attrs["failed"])["own"]


@pytest.mark.thorough
@given(st.lists(st.sampled_from(["right", *BAD, *OBSTACLES]), min_size=1, max_size=5))
@settings(max_examples=12, deadline=None)
def test_any_mixture_of_good_and_bad_methods(swing, kinds):
    """Which succeed, and which are told, does not depend on the others; without any the first error is raised."""
    methods = [Own(how=how, label=f"m{k}") for k, how in enumerate(kinds)]
    good = [m.label for m in methods if m.how == "right"]
    bad = [m.label for m in methods if m.how != "right"]
    study = swing.with_propagators(methods)
    if not good:
        with pytest.raises((Exception, SystemExit)) as caught:
            study.run()
        assert [note.split("'")[1] for note in getattr(caught.value, "__notes__", ())] == bad[1:]
        if isinstance(caught.value, uqmbd.UqmbdError):
            assert list(caught.value.failed) == bad
        return
    if bad:
        tree, said = run_with(study, *methods)
        assert len(said) == len(bad) and list(json.loads(tree.attrs["failed"])) == bad
    else:
        tree = study.run()
        assert "failed" not in tree.attrs
    assert list(propagator_nodes(tree)) == good


def test_obstacles_of_all_are_asked_before_the_first_realisation(swing):
    class Told:
        started = ()

        def start(self, label, total):
            self.started += (label,)

        def advance(self, label, count=1):
            assert asked == ["early", "late"]

        def finish(self, label):
            pass

    asked = []

    @dataclasses.dataclass(frozen=True, kw_only=True)
    class Asks(Own):
        def obstacle(self, study):
            asked.append(self.label)

    told = Told()
    swing.with_propagators([Asks(label="early"), GOOD, Asks(label="late")]).run(progress=told)
    assert told.started == ("good",)


def test_mechanism_that_cannot_be_used_is_no_matter_of_a_method():
    mechanism = uqmbd.Mechanism("m", uqmbd.Planar())
    mechanism.body("b", mass=1, inertia=1)
    with pytest.raises(uqmbd.StudyError, match="has no outputs") as caught:
        uqmbd.Study("s", mechanism, TIMES, [Own(label="a"), Own(label="b")]).run()
    assert not caught.value.failed and not getattr(caught.value, "__notes__", ())


@pytest.mark.parametrize("interruption", [KeyboardInterrupt, Odd])
def test_interruptions_end_the_run(swing, monkeypatch, interruption):
    monkeypatch.setitem(BAD, "is interrupted", lambda m, p: raising(interruption()))
    with pytest.raises(interruption):
        swing.with_propagators([Own(how="is interrupted"), GOOD]).run()


def test_signal_that_ends_the_program_is_not_taken_for_a_failure(swing, monkeypatch):
    """A handler that leaves by SystemExit, as services do for SIGTERM."""
    before = signal.signal(signal.SIGTERM, lambda number, frame: raising(SystemExit(143)))

    def killed(method, problem):
        os.kill(os.getpid(), signal.SIGTERM)
        time.sleep(1)

    monkeypatch.setitem(BAD, "is killed", killed)
    try:
        with pytest.raises(SystemExit, match="143"):
            swing.with_propagators([Own(how="is killed"), GOOD]).run()
    finally:
        after = signal.signal(signal.SIGTERM, before)
    assert after.__name__ == "<lambda>"


def test_runs_outside_the_main_thread(swing):
    found = []
    study = swing.with_propagators([GOOD, Own(how="leaves")])

    def run():
        with pytest.warns(uqmbd.MethodFailedWarning):
            found.append(study.run())

    thread = threading.Thread(target=run)
    thread.start()
    thread.join()
    assert list(propagator_nodes(found[0])) == ["good"]


def die(model, code):
    os._exit(code)


@pytest.mark.thorough
def test_method_whose_worker_dies_costs_nothing_but_itself(swing, alone, monkeypatch):
    monkeypatch.setitem(BAD, "dies", lambda m, p: list(p.run(die, [(3,)])))
    tree, (said,) = run_with(swing, Own(how="dies"), GOOD, workers=2)
    assert "test_failed_methods.die was lost" in said
    assert tree["good/samples"].to_dataset().identical(alone["good/samples"].to_dataset())


def test_memory_of_a_failed_method_is_free_for_the_next(swing, monkeypatch):
    import weakref

    class Large:
        pass

    alive = []

    def hungry(method, problem):
        large = Large()
        alive.append(weakref.ref(large))
        raise MemoryError

    def looking(method, problem):
        assert alive[0]() is None
        return Own.right(method, problem)

    monkeypatch.setitem(BAD, "is hungry", hungry)
    monkeypatch.setitem(BAD, "looks", looking)
    tree, _ = run_with(swing, Own(how="is hungry", label="a"), Own(how="looks", label="b"))
    assert list(propagator_nodes(tree)) == ["b"]


@pytest.mark.thorough
def test_chunks_of_a_run_in_which_a_method_failed_are_kept_for_resume(swing, tmp_path, monkeypatch):
    tree, _ = run_with(swing, GOOD, Own(how="raises"), folder=tmp_path)
    assert list(tmp_path.rglob("*.npz"))
    with pytest.warns(uqmbd.StudyWarning, match="recomputes the realisations"):
        tree = swing.with_propagators([GOOD, Own()]).run(folder=tmp_path, resume=True)
    assert not (tmp_path / "unfinished").exists()
    save(tree, tmp_path / "results.nc")
    assert not list(tmp_path.rglob("*.npz")), "they are kept until the results are saved"


@pytest.mark.thorough
def test_comparison_that_fails_costs_nothing_but_itself(swing, tmp_path, monkeypatch):
    import uqmbd.results.tree.compared

    monkeypatch.setattr(
        uqmbd.results.tree.compared, "compare_both", lambda *a, **k: raising(ZeroDivisionError("no scale"))
    )
    with pytest.warns(UserWarning, match="the comparison of the methods failed: ZeroDivisionError: no scale"):
        tree = swing.with_propagators([GOOD, Own()]).run()
    assert list(propagator_nodes(tree)) == ["good", "own"]
    assert "no scale" in tree["comparison"].attrs["problem"]
    validate(tree)
    assert load(save(tree, tmp_path / "results.nc")).identical(tree)


def test_reference_of_the_convergence_that_failed_is_reported(swing):
    study = uqmbd.Study(
        "s", swing.mechanism, TIMES, [GOOD, Own(how="raises")],
        convergence={"propagators": [MonteCarlo(seed=1)], "samples": [2, 4], "reference": "own"},
    )  # fmt: skip
    with pytest.warns(UserWarning) as told:
        tree = study.run()
    assert "the reference 'own' has no results" in tree["convergence"].attrs["problem"]
    assert {w.category for w in told} == {uqmbd.MethodFailedWarning, UserWarning}


def test_level_that_fails_costs_nothing_but_itself(swing):
    found = swing.converge([GOOD, Own(label="own")], samples=[2, 4], how=["right", "is mistaken"], reference=GOOD)
    row = found["problem"].sel({"method": "own"}).values.tolist()
    assert row[0] == "" and "AttributeError" in row[1]
