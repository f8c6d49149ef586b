"""Workers are threads where an integrator computes without the interpreter's lock, else processes; results are the same."""

import multiprocessing
import os
import threading
import time
from dataclasses import replace

import chaospy
import numpy as np
import pytest

import uqmbd
from uqmbd import plugins
from uqmbd.dynamics import integrator_class
from uqmbd.propagation.execution import WorkerPool, executor_for, pool
from uqmbd.results import load, save
from uqmbd.testing.propagators.executors import RecordingExecutor
from uqmbd_contact import PlaneImpact
from uqmbd_montecarlo import MonteCarlo
from uqmbd_springs import SpringDamper

TIMES = np.linspace(0, 0.5, 6)
Explicit = integrator_class("dop853")


class Unlocked(Explicit):
    """The explicit method, which notes where it computes, and may be told to wait or to fail."""

    name = "unlocked"
    where: list[tuple[int, str]] = []
    first = staticmethod(lambda: None)

    def integrate(self, ensemble, times, rtol):
        self.where.append((os.getpid(), threading.current_thread().name))
        self.first()
        return super().integrate(ensemble, times, rtol)


class Locked(Unlocked):
    """The same, which does not declare it."""

    name = "locked"
    capabilities = replace(Explicit.capabilities, releases_gil=False)


@pytest.fixture(autouse=True)
def installed(monkeypatch):
    found = plugins.registry.registered()
    registry = plugins.Registry(
        found.plugins, {**found.classes, "integrators": {cls.name: cls for cls in (Unlocked, Locked)}}
    )
    monkeypatch.setattr(plugins.registry, "registered", lambda: registry)
    monkeypatch.setattr(Unlocked, "where", [])


class Both(WorkerPool):
    """Computes here, and notes who should have."""

    def __init__(self):
        super().__init__(2)
        self.asked = []

    @property
    def threads(self):
        self.asked.append("threads")
        return RecordingExecutor()

    @property
    def processes(self):
        self.asked.append("processes")
        return RecordingExecutor()


def spring(*, floor=False, still=False):
    mechanism = uqmbd.Mechanism("spring", uqmbd.Translational(gravity=(0, -9.81)))
    height = uqmbd.RandomVariable("height", chaospy.Uniform(0.9, 1.1), units="m")
    ball = mechanism.body("ball", mass=1, position=(0, height))
    if still:
        mechanism.add(SpringDamper("rope", mechanism.ground, ball, (0, 2), (0, 0), stiffness=50, free_length=1))
    if floor:
        mechanism.add(PlaneImpact("floor", mechanism.ground, ball, (0, 0), (0, 0), (0, 1), restitution=0.7))
    mechanism.output("y", uqmbd.at_equilibrium(ball.position[1]) if still else ball.position[1], units="m")
    return mechanism


def study(integrator="unlocked", samples=200, **about):
    return uqmbd.Study("springs", spring(**about), TIMES, [MonteCarlo(samples=samples, seed=3)], integrator=integrator)


def response(tree):
    return tree["monte-carlo/samples"]["response"].values.tobytes()


@pytest.mark.thorough
def test_threads_of_this_process(monkeypatch):
    """No process is started, several threads compute, and the bits are those of one worker."""
    meeting = threading.Barrier(2)
    with monkeypatch.context() as patch:
        # two at a time, or nobody goes on; afterwards this process integrates some again, alone
        alone = threading.main_thread()
        patch.setattr(Unlocked, "first", staticmethod(lambda: threading.current_thread() is alone or meeting.wait(10)))
        found = study(samples=256).run(workers=2)
    names = {name for _, name in Unlocked.where} - {threading.main_thread().name}
    assert {pid for pid, _ in Unlocked.where} == {os.getpid()}
    assert len(names) == 2
    assert not multiprocessing.active_children()
    assert not [thread for thread in threading.enumerate() if thread.name in names], "they have gone home"
    assert response(found) == response(study(samples=256).run())


@pytest.mark.parametrize(
    ("integrator", "about", "who"),
    [
        ("unlocked", {}, "threads"),
        ("locked", {}, "processes"),
        ("ida", {}, "processes"),
        ("unlocked", {"floor": True}, "processes"),
        ("unlocked", {"still": True}, "processes"),
    ],
    ids=["declared", "not declared", "implicit", "events", "statics alone"],
)
@pytest.mark.filterwarnings("ignore::uqmbd.errors.UnusedInputWarning")
def test_who_is_asked(integrator, about, who):
    """What is followed in Python, events and statics, is work for processes, whatever the integrator declares."""
    executor = Both()
    study(integrator, samples=8, **about).run(workers=executor)
    assert set(executor.asked) == {who}


def test_statistics_are_computed_in_threads_of_this_process():
    """Pieces of arithmetic meet in two threads, come in order, and need nobody where there is one piece or one worker."""
    meeting, problem = threading.Barrier(2), study().problem(MonteCarlo(samples=8))

    def met(piece):
        meeting.wait(10)
        return piece, os.getpid()

    with pool(2) as executor:
        many = problem.using(executor=executor)
        assert list(many.runner.each(met, range(6))) == [(k, os.getpid()) for k in range(6)]
        assert not executor.started
        assert list(many.runner.each(lambda _: threading.current_thread(), [1])) == [threading.main_thread()]
    for executor in (None, RecordingExecutor()):
        alone = problem.using(executor=executor).runner.each(lambda _: threading.current_thread(), [1, 2])
        assert list(alone) == 2 * [threading.main_thread()]


def test_work_of_methods_is_given_to_processes():
    """A method that hands out functions of its own does not know whether they hold the lock."""
    with pool(2) as executor:
        assert isinstance(executor, WorkerPool)
        assert executor_for(executor, unlocked=False) is executor.processes
        assert executor_for(executor, unlocked=True) is executor.threads
        assert not executor.started
    assert executor_for(None, unlocked=True) is None
    inline = RecordingExecutor()
    assert executor_for(inline, unlocked=True) is executor_for(inline, unlocked=False) is inline


class Impatient:
    """Progress that interrupts a run after some chunks, and then opens a gate."""

    def __init__(self, chunks, gate):
        self.left, self.gate = chunks, gate

    def start(self, label, total):
        pass

    def advance(self, label, count=1):
        self.left -= 1
        if not self.left:
            self.gate.set()
            raise KeyboardInterrupt

    finish = start


@pytest.mark.slow
def test_interrupted_threads_keep_what_is_done(tmp_path, monkeypatch):
    """After Ctrl-C no thread computes any more; the run goes on with what is stored, to the same bits."""
    gate, count = threading.Event(), iter(range(100))
    monkeypatch.setattr(Unlocked, "first", staticmethod(lambda: next(count) < 5 or gate.wait(10)))
    with pytest.raises(KeyboardInterrupt):
        study(samples=640).run(workers=2, folder=tmp_path, progress=Impatient(3, gate))
    stored, begun = len(list((tmp_path / "unfinished").rglob("*.npz"))), len(Unlocked.where)
    assert 3 <= stored < 10
    time.sleep(0.05)
    assert len(Unlocked.where) == begun
    tree = study(samples=640).run(workers=2, folder=tmp_path, resume=True)
    # three are integrated again, to measure the error of the integration
    assert len(Unlocked.where) - begun <= 10 - stored + 3
    save(tree, tmp_path / "results.nc")
    assert response(load(tmp_path / "results.nc")) == response(study(samples=640).run())


def test_what_a_thread_raises_ends_the_run(tmp_path, monkeypatch):
    """As in a process: the error is told, and finished chunks beside it are kept."""
    count = iter(range(100))

    def fails():
        if next(count) == 4:
            raise ArithmeticError("no motion today")

    monkeypatch.setattr(Unlocked, "first", staticmethod(fails))
    with pytest.raises(ArithmeticError, match="no motion today"):
        study(samples=640).run(workers=2, folder=tmp_path)
    assert len(list((tmp_path / "unfinished").rglob("*.npz"))) >= 3
