"""Who computes, as commands and scripts ask for it: what is asked for is what computes, or an error says what to write."""

from __future__ import annotations

import sys
from collections.abc import Callable
from concurrent.futures import Executor, ThreadPoolExecutor
from pathlib import Path
from typing import Annotated

import pytest
import typer

import uqmbd
from uqmbd.plugins import command_line
from uqmbd.testing import check_command


class Show:
    """Show who computes."""

    name = "show"
    help = "Show who computes."

    def run(self, word: Annotated[str, typer.Argument(help="Any.")] = "x", *, workers: uqmbd.Workers) -> None:
        with workers.start() as executor:
            print(word, executor)


class Plain:
    """A command that does not compute."""

    name = "plain"
    help = "Compute nothing."

    def run(self, word: Annotated[str, typer.Argument(help="Any.")] = "x") -> None:
        print(word)


def test_a_command_of_a_plugin_has_the_options_of_run(capsys: pytest.CaptureFixture[str]):
    def said(*words: str) -> str:
        command_line(Show).main(list(words), standalone_mode=False)
        return capsys.readouterr().out.strip()

    check_command(Show)
    names = [option for parameter in command_line(Show).params for option in parameter.opts]
    assert names == ["word", "--workers", "--dask", "--mpi"]
    assert [option for parameter in command_line(Plain).params for option in parameter.opts] == ["word"]
    assert said("hello") == "hello 1"
    assert said("--workers", "3") == "x 3"


def test_an_address_that_is_empty_is_no_worker_here():
    with pytest.raises(uqmbd.StudyError, match="--dask is empty"):
        command_line(Show).main(["--dask", ""], standalone_mode=False)


def test_an_executor_that_is_there_is_used_and_left_open():
    with ThreadPoolExecutor(1) as mine:
        with uqmbd.Workers(executor=mine).start() as found:
            assert found is mine
        assert mine.submit(max, 1, 2).result() == 2


@pytest.mark.parametrize(
    ("fields", "expected"),
    [
        ({"count": 2, "mpi": True}, "mpiexec -n 3 "),
        ({"dask": "slurm", "mpi": True}, "--mpi with --dask slurm: give one of them"),
        ({"count": 2, "dask": "tcp://x:1"}, "either --workers or --dask"),
        ({"count": 2, "executor": Executor()}, "give only one of them"),
    ],
)
def test_more_than_one_is_refused(fields: dict, expected: str):
    with pytest.raises(uqmbd.StudyError, match=expected):
        uqmbd.Workers(**fields)


def test_a_number_of_workers_goes_with_a_cluster_that_is_started():
    assert uqmbd.Workers(2, "local").count == uqmbd.Workers(2, "slurm").count == 2


@pytest.mark.parametrize(
    ("module", "workers", "expected"),
    [
        ("distributed", uqmbd.Workers(dask="tcp://x:1"), r'pip install "uqmbd\[distributed\]"'),
        ("mpi4py", uqmbd.Workers(mpi=True), r'pip install "uqmbd\[mpi\]"'),
    ],
)
def test_a_library_that_is_missing_is_named(
    module: str, workers: uqmbd.Workers, expected: str, monkeypatch: pytest.MonkeyPatch
):
    monkeypatch.setitem(sys.modules, module, None)
    with pytest.raises(uqmbd.StudyError, match=expected), workers.start():
        pass


def _at_work(workers: uqmbd.Workers) -> Callable[[], None]:
    def work() -> None:
        with workers.start():
            pass

    return work


class TestDask:
    @pytest.fixture(autouse=True)
    def installed(self):
        pytest.importorskip("distributed")

    def test_a_misspelt_queue_is_answered_at_once(self):
        with pytest.raises(uqmbd.StudyError, match="slrum: expected an address .* scheduler file .* slurm"):
            _at_work(uqmbd.Workers(dask="slrum"))()

    @pytest.mark.parametrize("content", ["", "import numpy", "[1]", "{}", '{"address": 3}'])
    def test_a_file_without_an_address_is_named(self, content: str, tmp_path: Path):
        (tmp_path / "study.py").write_text(content)
        with pytest.raises(uqmbd.StudyError, match=r"study\.py: this file contains no address of a scheduler"):
            _at_work(uqmbd.Workers(dask=str(tmp_path / "study.py")))()

    def test_a_queue_without_its_commands_is_named(self, monkeypatch: pytest.MonkeyPatch):
        pytest.importorskip("dask_jobqueue")
        monkeypatch.setenv("PATH", "")
        with pytest.raises(uqmbd.StudyError, match="the command 'qsub', which submits jobs, is not available"):
            _at_work(uqmbd.Workers(dask="pbs"))()
