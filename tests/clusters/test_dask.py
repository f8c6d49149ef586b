"""A Dask cluster, whose scheduler and workers are processes, does the work: the same bits, whoever dies or is slow."""

from __future__ import annotations

import functools
import os
import random
import shutil
import signal
import threading
import time
from collections.abc import Callable, Iterator
from concurrent.futures import Executor, Future, ThreadPoolExecutor
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import chaospy
import numpy as np
import pytest

import uqmbd
from uqmbd.results import load
from uqmbd.testing.propagators.moments import difference
from uqmbd_collocation import Collocation
from uqmbd_joints import Revolute
from uqmbd_montecarlo import MonteCarlo

distributed = pytest.importorskip("distributed")

# Dask's own: sockets and loops that it leaves to the garbage collector when it is stopped
pytestmark = [
    pytest.mark.thorough,
    pytest.mark.filterwarnings("ignore::ResourceWarning", "ignore::pytest.PytestUnraisableExceptionWarning"),
]


def pendulum(*methods: uqmbd.extend.Propagator) -> uqmbd.Study:
    """A rod of uncertain length and mass, integrated by IDA: a piece takes some tenths of a second."""
    length = uqmbd.RandomVariable("length", chaospy.Normal(1.0, 0.02), units="m")
    mass = uqmbd.RandomVariable("mass", chaospy.Normal(1.0, 0.05), units="kg")
    mechanism = uqmbd.Mechanism("pendulum", uqmbd.Planar(gravity=(0.0, -9.81)))
    rod = mechanism.body("rod", mass=mass, inertia=mass * length**2 / 12, position=(length / 2, 0))
    pivot = Revolute("pivot", mechanism.ground, rod, point_i=(0, 0), point_j=(-length / 2, 0))
    mechanism.add(pivot)
    mechanism.output("angle", rod.angle, units="rad")
    mechanism.output("reaction", pivot.reaction_force.norm(), units="N")
    return uqmbd.Study("pendulum", mechanism, np.linspace(0, 3, 31), list(methods), integrator="ida")


@contextmanager
def connected(cluster: Any, workers: int = 0) -> Iterator[Any]:
    """A client, once so many workers have come."""
    with distributed.Client(cluster.address, timeout=30) as client:
        if workers:
            client.wait_for_workers(workers, timeout=60)
        yield client


def watched(client: Any, told: Callable[[int], None]) -> Executor:
    """Executor that tells how many pieces are finished, whenever one is."""
    executor: Executor = client.get_executor(pure=False)
    submit, finished, lock = executor.submit, [0], threading.Lock()

    def done(future: Future[Any]) -> None:
        if future.cancelled() or future.exception() is not None:
            return
        # a worker may also ask for the model, or refuse
        if future.result().kind == "done":
            with lock:
                finished[0] += 1
            told(finished[0])

    def submitted(*arguments: Any, **more: Any) -> Future[Any]:
        future = submit(*arguments, **more)
        future.add_done_callback(done)
        return future

    executor.submit = submitted  # type: ignore[method-assign]
    return executor


def pieces(study: uqmbd.Study, **more: Any) -> tuple[int, Any]:
    """Run a study in a thread; return how many pieces are computed, and the results."""
    with ThreadPoolExecutor(1) as executor:
        submit, count = executor.submit, [0]

        def submitted(*arguments: Any, **named: Any) -> Future[Any]:
            count[0] += 1
            return submit(*arguments, **named)

        executor.submit = submitted  # type: ignore[method-assign]
        tree = study.run(executor, **more)
    return count[0], tree


ROOT = Path(uqmbd.__file__).parents[1]


def monte_carlo() -> uqmbd.Study:
    """Sixteen pieces."""
    return pendulum(MonteCarlo(samples=1024, seed=5))


@functools.cache
def alone() -> tuple[int, Any]:
    """Pieces and results of one process."""
    return pieces(monte_carlo())


def difference_from_one_process(tree: Any) -> str:
    return difference(alone()[1]["monte-carlo"], tree["monte-carlo"])


@pytest.mark.filterwarnings("ignore::uqmbd.errors.SurrogateWarning")  # bits are compared, accurate or not
def test_the_same_bits_as_in_one_process(cluster: Any) -> None:
    methods = [
        MonteCarlo(samples=512, seed=5),
        Collocation(order=3),
        Collocation(adaptive="dimension", tolerance=1e-4, label="adaptive"),
        Collocation(order=2, elements="adaptive", label="elements"),
    ]
    for _ in range(2):
        cluster.hire()
    with connected(cluster, workers=2) as client:
        many = pendulum(*methods).run(client.get_executor())
        pieces_of = client.run(lambda dask_worker: dask_worker.state.executed_count)
    one = pendulum(*methods).run()
    assert {method.node_name: difference(one[method.node_name], many[method.node_name]) for method in methods} == {
        method.node_name: "" for method in methods
    }
    assert len(pieces_of) == 2 and min(pieces_of.values()) > 0  # both have worked


def run_and_kill(cluster: Any, study: uqmbd.Study, moments: list[int], seed: int) -> Any:
    """Run; a moment after as many pieces are finished as `moments` say a worker dies, and another one comes."""
    draw, killers = random.Random(seed), []

    def kill(delay: float) -> None:
        time.sleep(delay)
        draw.choice([worker for worker in cluster.workers if worker.poll() is None]).kill()
        cluster.hire()

    def told(finished: int) -> None:
        if finished in moments:
            killers.append(threading.Thread(target=kill, args=(draw.uniform(0, 0.3),)))
            killers[-1].start()

    for _ in range(3):
        cluster.hire()
    with connected(cluster, workers=3) as client:
        tree = study.run(watched(client, told))
    for killer in killers:
        killer.join()
    assert sum(worker.poll() is not None for worker in cluster.workers) == len(moments)
    return tree


def test_workers_that_are_killed_cost_no_bit(cluster: Any) -> None:
    tree = run_and_kill(cluster, monte_carlo(), [2, 5, 6], seed=1)
    assert difference_from_one_process(tree) == ""


@pytest.mark.slow
def test_twenty_workers_that_are_killed_cost_no_bit(cluster: Any) -> None:
    study = pendulum(MonteCarlo(samples=20_000, seed=5))
    tree = run_and_kill(cluster, study, random.Random(2).sample(range(1, 36), 20), seed=3)
    assert difference(study.run()["monte-carlo"], tree["monte-carlo"]) == ""


def test_what_is_finished_when_the_scheduler_is_killed_is_not_computed_again(cluster: Any, tmp_path: Path) -> None:
    cluster.hire()

    def told(finished: int) -> None:
        if finished == 5:
            cluster.scheduler.kill()

    with connected(cluster, workers=1) as client:
        executor = watched(client, told)
        with pytest.raises(uqmbd.IntegrationError, match="has ended .* continue with --resume"):
            monte_carlo().run(executor, folder=tmp_path / "run")
    rest, resumed = pieces(monte_carlo(), folder=tmp_path / "run", resume=True)
    assert 0 < rest <= alone()[0] - 5
    assert difference_from_one_process(resumed) == ""


@pytest.fixture
def other_version(tmp_path: Path) -> str:
    """Paths of a copy of uqmbd that is of another version, and of the plugins."""
    shutil.copytree(ROOT / "uqmbd", tmp_path / "other" / "uqmbd", ignore=shutil.ignore_patterns("__pycache__"))
    (tmp_path / "other" / "uqmbd" / "version.py").write_text('"""Another."""\n__version__ = "0.0.1"\n')
    return os.pathsep.join([str(tmp_path / "other"), str(ROOT / "plugins")])


def test_a_worker_of_another_version_is_refused_by_name(cluster: Any, other_version: str) -> None:
    cluster.hire(PYTHONPATH=other_version)
    with connected(cluster, workers=1) as client:
        with pytest.raises(uqmbd.UqmbdError, match=r"No worker has the same versions .*uqmbd 0\.0\.1"):
            monte_carlo().run(client.get_executor())
        # what it refuses is done by one that has the version
        cluster.hire()
        client.wait_for_workers(2, timeout=60)
        assert difference_from_one_process(monte_carlo().run(client.get_executor())) == ""


def test_a_worker_that_stands_still_stalls_nobody(cluster: Any) -> None:
    """Stopped in the middle of a piece, for good: others do that piece, too, and what waits behind it."""
    first, _ = cluster.hire(), cluster.hire()

    def told(finished: int) -> None:
        if finished == 4:
            first.send_signal(signal.SIGSTOP)

    with connected(cluster, workers=2) as client:
        # where the run waits for it, the worker dies in the end, and the last line fails
        alarm = threading.Timer(120, first.kill)
        alarm.start()
        tree = monte_carlo().run(watched(client, told))
        alarm.cancel()
    assert difference_from_one_process(tree) == ""
    assert first.poll() is None


SCRIPT = """
import chaospy
import numpy as np
from uqmbd_joints import Revolute
from uqmbd_montecarlo import MonteCarlo
from uqmbd_springs import Torque

import uqmbd
from {module} import brake

length = uqmbd.RandomVariable("length", chaospy.Normal(1.0, 0.02), units="m")
mechanism = uqmbd.Mechanism("pendulum", uqmbd.Planar(gravity=(0.0, -9.81)))
rod = mechanism.body("rod", mass=1, inertia=length**2 / 12, position=(length / 2, 0))
mechanism.add(Revolute("pivot", mechanism.ground, rod, point_i=(0, 0), point_j=(-length / 2, 0)))
mechanism.output("angle", rod.angle, units="rad")


def control(time, measured):
    return brake * measured


controller = uqmbd.Controller(measured=["angle"], commanded=["torque"], rate=20, function=control)
mechanism.add(controller)
mechanism.add(Torque("brake", rod, controller.command("torque")))
study = uqmbd.Study("pendulum", mechanism, np.linspace(0, 1, 11), [MonteCarlo(samples=128, seed=5)])
"""


def test_workers_find_the_functions_of_a_script_and_what_lies_beside_it(
    cluster: Any, command: Any, tmp_path: Path
) -> None:
    """And those of its next version, on the same workers, by the file of the scheduler."""
    cluster.hire()
    assert cluster.address
    folder = tmp_path / "studies"
    folder.mkdir()
    found = {}
    for strength in (-0.1, -5.0):
        module = f"helper_{abs(strength):.0f}"
        (folder / "braked.py").write_text(SCRIPT.format(module=module))
        (folder / f"{module}.py").write_text(f"brake = {strength}\n")
        out = tmp_path / module
        words = ("run", "studies/braked.py", "--out", str(out), "--dask", "scheduler.json")
        done = command(*words)
        assert done.returncode == 0, done.stderr
        found[strength] = load(out / "results.nc")["monte-carlo/samples"]["response"].values[:, 0, -1].mean()
    assert found[-0.1] < found[-5.0] - 0.5


def test_a_cluster_without_workers_is_reported_and_waited_for(cluster: Any) -> None:
    with (
        pytest.warns(uqmbd.StudyWarning, match="the cluster has no workers"),
        uqmbd.Workers(dask=cluster.address).start() as executor,
    ):
        found = executor.submit(abs, -3)
        cluster.hire()
        assert found.result(timeout=60) == 3


def test_a_worker_without_uqmbd_is_reported(cluster: Any, command: Any, tmp_path: Path) -> None:
    """It would else die of its first piece of work, and the run wait for others without end."""
    (tmp_path / "none").mkdir()
    (tmp_path / "none" / "uqmbd.py").write_text("raise ImportError('there is no uqmbd here')\n")
    cluster.hire(PYTHONPATH=str(tmp_path / "none"))
    with connected(cluster, 1):
        pass
    (tmp_path / "study.py").write_text(SCRIPT.format(module="helper"))
    (tmp_path / "helper.py").write_text("brake = -0.1\n")
    done = command("run", "study.py", "--out", "out", "--dask", cluster.address)
    assert done.returncode == 2
    assert (
        "a worker cannot import a module or write a file that it needs" in done.stderr
        and "no uqmbd here" in done.stderr
    )


def test_a_cluster_that_is_started_here_is_reached_from_here_alone():
    """Whoever reaches a scheduler may have it run code, and its pages tell of the work."""
    psutil = pytest.importorskip("psutil")
    with uqmbd.Workers(count=1, dask="local").start() as executor:
        assert executor.submit(abs, -3).result() == 3
        own = psutil.Process()
        listening = [
            connection.laddr.ip
            for process in (own, *own.children(recursive=True))
            for connection in process.net_connections()
            if connection.status == psutil.CONN_LISTEN
        ]
    assert listening and set(listening) == {"127.0.0.1"}
