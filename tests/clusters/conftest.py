"""A Dask cluster: its scheduler and its workers are processes of their own, and any of them may be killed."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

import uqmbd

ROOT = Path(uqmbd.__file__).parents[1]
ENVIRONMENT = dict(
    os.environ, PYTHONPATH=os.pathsep.join([str(ROOT), str(ROOT / "plugins"), os.environ.get("PYTHONPATH", "")])
)
# a run must not wait long for a worker that was killed; and a worker that is lost is no mistake of its piece
ENVIRONMENT["DASK_DISTRIBUTED__SCHEDULER__ALLOWED_FAILURES"] = "3"
QUIET = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}


class Cluster:
    """A scheduler and workers."""

    def __init__(self, folder: Path) -> None:
        self.file = folder / "scheduler.json"
        self.folder = folder
        self.workers: list[subprocess.Popen[bytes]] = []
        where = ("--host", "127.0.0.1", "--port", "0", "--no-dashboard", "--scheduler-file", str(self.file))
        self.scheduler = self._start("scheduler", *where)

    def _start(self, *words: str, **environment: str) -> subprocess.Popen[bytes]:
        code = "import sys; from dask.__main__ import main; sys.argv[0] = 'dask'; main()"
        command = [sys.executable, "-c", code, *words]
        return subprocess.Popen(command, env=ENVIRONMENT | environment, cwd=self.folder, **QUIET)

    def hire(self, *words: str, **environment: str) -> subprocess.Popen[bytes]:
        """Start a worker of one thread, without a nanny that would start it again."""
        about = ("--scheduler-file", str(self.file), "--nthreads", "1", "--no-nanny", "--no-dashboard")
        self.workers.append(self._start("worker", *about, *words, **environment))
        return self.workers[-1]

    @property
    def address(self) -> str:
        deadline = time.monotonic() + 60
        while not (self.file.exists() and self.file.read_text().endswith("}")):
            assert time.monotonic() < deadline and self.scheduler.poll() is None
            time.sleep(0.05)
        return str(json.loads(self.file.read_text())["address"])

    def close(self) -> None:
        for process in (self.scheduler, *self.workers):
            process.kill()
            process.wait()


@pytest.fixture
def cluster(tmp_path: Path) -> Iterator[Cluster]:
    """A cluster without workers."""
    pytest.importorskip("distributed")
    made = Cluster(tmp_path)
    try:
        yield made
    finally:
        made.close()


@pytest.fixture
def command(tmp_path: Path) -> Callable[..., subprocess.CompletedProcess[str]]:
    """Run `uqmbd` in a process of its own, in the folder of the cluster."""
    code = "import sys; from uqmbd.cli import main; main(sys.argv[1:])"

    def run(*words: str) -> subprocess.CompletedProcess[str]:
        whole = [sys.executable, "-c", code, *words]
        about: dict[str, Any] = {"cwd": tmp_path, "env": ENVIRONMENT, "timeout": 300}
        return subprocess.run(whole, **about, capture_output=True, text=True, check=False)

    return run
