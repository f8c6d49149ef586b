"""A damaged checkpoint is computed again, whatever is wrong with it; what work cost is stored with it."""

from __future__ import annotations

import math
import random
from collections.abc import Iterator
from concurrent.futures import Executor, Future
from pathlib import Path
from typing import Any

import chaospy
import numpy as np
import pytest

import uqmbd
from uqmbd.errors import IntegrationError
from uqmbd.propagation.execution.checkpoints import Checkpoint
from uqmbd.propagation.execution.chunks import Chunk
from uqmbd.results import save
from uqmbd_joints import Distance
from uqmbd_montecarlo import MonteCarlo

from ...clock import CLOCK


class Counting(Executor):
    """Does everything at once, and counts; it may take its time, or give up."""

    def __init__(self, pause: float = 0.0, gives_up_after: int | None = None) -> None:
        self.chunks = 0
        self.pause = pause
        self.gives_up_after = gives_up_after

    def submit(self, fn: Any, /, *args: Any, **kwargs: Any) -> Future[Any]:
        future: Future[Any] = Future()
        if self.gives_up_after is not None and self.chunks >= self.gives_up_after:
            future.cancel()
            future.set_running_or_notify_cancel()
            return future
        self.chunks += 1
        CLOCK.spend(self.pause)
        future.set_result(fn(*args, **kwargs))
        return future


def swing(samples: int = 200) -> uqmbd.Study:
    """A study of chunks that are done in no time."""
    mechanism = uqmbd.Mechanism("swing", uqmbd.Translational(gravity=(0, -9.81)))
    length = uqmbd.RandomVariable("length", chaospy.Normal(1, 0.02), units="m")
    bob = mechanism.body("bob", mass=1, position=(0, -length), velocity=(0.2, 0))
    mechanism.add(Distance("rod", mechanism.ground, bob, (0, 0), (0, 0), length=length))
    mechanism.output("x", bob.position[0], units="m")
    return uqmbd.Study("swing", mechanism, np.linspace(0, 0.1, 3), [MonteCarlo(samples=samples, seed=3)])


def chunk(generator: np.random.Generator) -> Chunk:
    response = generator.normal(size=(7, 2, 5))
    return Chunk(response, np.zeros(7, dtype=np.int64), ("", "a reason") * 3 + ("",), {"steps": 12.0}, seconds=1.5)


def same(one: Chunk, other: Chunk) -> bool:
    return (
        one.response.tobytes() == other.response.tobytes()
        and one.status.tobytes() == other.status.tobytes()
        and one.messages == other.messages
        and one.counters == other.counters
        and one.seconds == other.seconds
    )


def damages(whole: bytes, count: int) -> Iterator[bytes]:
    """Flipped bits, lost ends, holes, and further bytes."""
    generator = random.Random(5)
    for _ in range(count):
        data = bytearray(whole)
        kind = generator.randrange(5)
        first = generator.randrange(len(data))
        if kind == 0:
            data = data[:first]
        elif kind == 1:
            data[first : first + 40] = bytes(len(data[first : first + 40]))
        elif kind == 2:
            del data[first : first + generator.randint(1, 60)]
        else:
            data[first] ^= 1 << generator.randrange(8)
        yield bytes(data)


@pytest.mark.parametrize("count", [400, pytest.param(20_000, marks=pytest.mark.slow)])
def test_damage_is_noticed_or_does_no_harm(count: int, tmp_path: Path) -> None:
    """A chunk is read as it was, or not at all, and nothing is raised."""
    checkpoint, whole = Checkpoint(tmp_path, "method"), chunk(np.random.default_rng(1))
    checkpoint.save("key", whole)
    (path,) = tmp_path.rglob("*.npz")
    content, lost = path.read_bytes(), 0
    for data in damages(content, count):
        path.write_bytes(data)
        found = checkpoint.load("key")
        lost += found is None
        assert found is None or same(found, whole)
    assert lost > 0.7 * count
    path.write_bytes(content)
    restored = checkpoint.load("key")
    assert restored is not None and same(restored, whole)


@pytest.mark.thorough
def test_what_lies_there_instead_of_a_chunk_is_computed_again(tmp_path: Path) -> None:
    """A folder, nothing at all, a pickle, another archive."""
    whole = swing().run()["monte-carlo/samples"]["response"].values.tobytes()
    with pytest.raises(IntegrationError):
        swing().run(Counting(gives_up_after=3), folder=tmp_path)
    for content in (b"", b"\x80\x04N.", b"PK\x05\x06" + bytes(18), None):
        chunks = list((tmp_path / "unfinished").rglob("*.npz"))
        assert len(chunks) == 3
        for path in chunks:
            path.unlink()
            path.mkdir() if content is None else path.write_bytes(content)
        again = Counting(gives_up_after=3)
        with pytest.raises(IntegrationError):
            swing().run(again, folder=tmp_path, resume=True)
        assert again.chunks == 3
    tree = swing().run(Counting(), folder=tmp_path, resume=True)
    assert tree["monte-carlo/samples"]["response"].values.tobytes() == whole


def test_executor_that_gives_up_says_that_the_work_is_kept(tmp_path: Path) -> None:
    """As that of Dask does when its scheduler dies."""
    with pytest.raises(
        IntegrationError, match=r"has ended \(CancelledError\).*contains the finished results.*--resume"
    ):
        swing().run(Counting(gives_up_after=2), folder=tmp_path)
    rest = Counting()
    node = swing().run(rest, folder=tmp_path, resume=True)["monte-carlo"]
    repeated = node["statistics"]["integration_error"].attrs["realisations"]
    assert rest.chunks == 2 + math.ceil(repeated / 8), "tasks of eight are integrated again for the error"


def test_error_of_a_method_is_not_that_of_its_executor(tmp_path: Path) -> None:
    class Failing(Counting):
        def submit(self, fn: Any, /, *args: Any, **kwargs: Any) -> Future[Any]:
            raise ZeroDivisionError("mine")

    with pytest.raises(ZeroDivisionError, match="mine"):
        swing().run(Failing(), folder=tmp_path)


def test_resumed_run_costs_what_it_cost_to_compute(tmp_path: Path) -> None:
    """The wall time counts what an interrupted run has spent; the executor takes 0.3 s for each of four chunks."""
    with pytest.raises(IntegrationError):
        swing().run(Counting(pause=0.3, gives_up_after=3), folder=tmp_path)
    resumed = swing().run(Counting(pause=0.3), folder=tmp_path, resume=True)
    assert resumed["monte-carlo"].attrs["wall_time"] >= 1.2
    assert float(resumed["comparison"]["wall_time"][0]) >= 1.2
    again = Counting(pause=0.3)
    read = swing().run(again, folder=tmp_path, resume=True)
    assert again.chunks == 0
    assert 1.2 <= read["monte-carlo"].attrs["wall_time"] <= resumed["monte-carlo"].attrs["wall_time"] + 0.2


def test_cost_is_counted_once_where_work_is_read_twice_in_one_run(tmp_path: Path) -> None:
    study = swing()
    problem = study.problem(study.propagators[0], Counting(pause=0.3), folder=tmp_path)
    values = np.linspace(0.9, 1.1, 64)[:, None]
    first = problem.realise(values)
    second = problem.realise(values)
    assert first.wall_time >= 0.3 > second.wall_time
    later = study.problem(study.propagators[0], Counting(), folder=tmp_path)
    assert later.realise(values).wall_time >= 0.3 > later.realise(values).wall_time


def test_work_that_is_no_realisation_keeps_its_cost(tmp_path: Path) -> None:
    study = swing()

    def spent() -> float:
        problem = study.problem(study.propagators[0], Counting(pause=0.3), folder=tmp_path)
        begin = problem.clock()
        list(problem.run(ones, [(1,), (2,)]))
        return problem.clock() - begin

    assert spent() >= 0.6
    assert spent() >= 0.6, "read, and yet the cost of computing"


def ones(model: object, count: int) -> dict[str, Any]:
    return {"ones": np.ones(count)}


@pytest.mark.thorough
def test_finished_work_survives_until_the_results_are_saved(tmp_path: Path) -> None:
    tree = swing().run(folder=tmp_path)
    assert not (tmp_path / "unfinished").exists(), "it has ended"
    unsaved = Counting()
    again = swing().run(unsaved, folder=tmp_path, resume=True)
    assert unsaved.chunks == 0, "nothing was lost before it was saved"
    save(tree, tmp_path / "elsewhere" / "results.nc")
    save(again["monte-carlo"], tmp_path / "part.nc")
    assert (tmp_path / "unsaved").is_dir(), "neither is the result of the run in its folder"
    save(again, tmp_path / "results.nc")
    assert sorted(p.name for p in tmp_path.iterdir()) == [
        ".uqmbd-manifest.json",
        "elsewhere",
        "part.nc",
        "results.nc",
    ]
