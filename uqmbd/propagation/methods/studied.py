"""Interface of a study to the code that runs its methods."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from concurrent.futures import Executor
from pathlib import Path
from typing import Any, Protocol, Self

from uqmbd.dynamics import Model
from uqmbd.mechanism import Mechanism
from uqmbd.progress import Progress
from uqmbd.propagation.methods.propagator import Propagator
from uqmbd.propagation.problem import Problem
from uqmbd.typing import Array

__all__ = ["Studied"]


class Studied(Protocol):
    """Interface of a study for the code that runs methods: data, and problems of propagators."""

    name: str
    mechanism: Mechanism
    times: Array
    rtol: float
    integrator: str
    start: str
    max_step: float
    breaks: tuple[float, ...]
    report_times: tuple[float, ...]
    propagators: tuple[Propagator, ...]
    convergence: Mapping[str, Any] | None

    @property
    def model(self) -> Model:
        """Return the compiled model."""

    def problem(
        self,
        propagator: Propagator,
        executor: Executor | None = None,
        progress: Progress | bool | None = None,
        folder: Path | None = None,
    ) -> Problem:
        """Make the problem for a propagator."""

    def with_propagators(self, propagators: Iterable[Propagator]) -> Self:
        """Make a copy with other propagators."""
