"""What the work on a study needs of it, and what keeps a method from it before anything is computed."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from concurrent.futures import Executor
from pathlib import Path
from typing import Any, Protocol, Self

from uqmbd.dynamics import Model
from uqmbd.errors import StudyError
from uqmbd.mechanism import Mechanism
from uqmbd.progress import Progress
from uqmbd.propagation.methods.estimate import readable
from uqmbd.propagation.methods.propagator import Propagator
from uqmbd.propagation.problem import Problem
from uqmbd.typing import Array

__all__ = ["Studied", "obstacle_of"]


class Studied(Protocol):
    """A study as those see it whom it asks to run methods: what it is, and the problems that it makes of itself."""

    name: str
    mechanism: Mechanism
    times: Array
    rtol: float
    integrator: str
    start: str
    max_step: float
    breaks: tuple[float, ...]
    propagators: tuple[Propagator, ...]
    convergence: Mapping[str, Any] | None

    @property
    def model(self) -> Model:
        """The compiled model."""

    def problem(
        self,
        propagator: Propagator,
        executor: Executor | None = None,
        progress: Progress | bool | None = None,
        folder: Path | None = None,
    ) -> Problem:
        """Make the problem that a propagator is given."""

    def with_propagators(self, propagators: Iterable[Propagator]) -> Self:
        """Make a copy with other propagators."""


def obstacle_of(propagator: Propagator, study: Studied) -> str | None:
    """Return in one sentence why a method cannot do a study, or None; estimate its memory before asking it."""
    if not len(study.mechanism.inputs):
        return propagator.obstacle(study)
    try:
        found = propagator.estimate(study)
    except StudyError as error:
        return str(error).removeprefix(f"{propagator.node_name}: ")
    if found is not None and not found.at_most and (there := _memory()) < found.memory:
        about = f" for {found.detail}" if found.detail else ""
        return (
            f"it would take about {readable(found.memory)} of memory{about}, and this machine has {readable(there)}; "
            "take fewer samples or nodes, a lower order, fewer outputs or fewer output times"
        )
    return propagator.obstacle(study)


def _memory() -> int:
    """Physical memory of this machine, bytes."""
    import psutil

    return int(psutil.virtual_memory().total)
