"""What a batched integration works with: equations of motion, and a watcher of the rank."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple, Protocol

from uqmbd.typing import Array, Index

__all__ = ["Continuation", "Equations", "Node", "Out", "Watcher"]

Out = tuple[Array, Array, Array]
"""Rates of coordinates, of velocities, and of the whole state, shape (row, ...): views of one array."""


class Node(NamedTuple):
    """An accepted state of one realisation, shape (width,), and its rate."""

    time: float
    z: Array
    rate: Array


@dataclass(frozen=True)
class Continuation:
    """How one realisation is to go on.

    Attributes
    ----------
    reason : str
        Not at all, because ...
    back : bool
        From the node before.
    equations : Equations, optional
        With these.
    state : array, shape (width,), optional
        From this state at `time`, the motion until then being ``curve(time)``.
    """

    reason: str = ""
    back: bool = False
    equations: Any = None
    time: float = 0.0
    state: Array | None = None
    curve: Callable[[Any], Array] | None = None


class Watcher(Protocol):
    """Is asked where steps become difficult: `uqmbd.dynamics.integration.singular_poses.SingularPoseWatcher`."""

    limit: float

    @property
    def alert(self) -> bool:
        """Whether it wants to be asked after each step."""

    def near(self, time: float, z: Array, size: float, parameters: Array) -> bool:
        """Whether a realisation among others is to be integrated alone."""

    def look(self, now: float, nodes: Sequence[Node], size: float, end: float, equations: Any) -> Continuation | None:
        """How a realisation that is alone is to go on; None: as before."""

    def reason(self, now: float, z: Array, parameters: Array) -> str:
        """Why steps became too small, or nothing."""


class Equations(Protocol):
    """Equations of motion of all rows, with a buffer for their states.

    Attributes
    ----------
    n, velocities : int
        Number of coordinates, and first velocity, of a row's state.
    moving : int
        Entries of a state that change.
    coupled : bool
        Whether all rows are one problem.
    evaluations : int
        So far.
    state : array, shape (row, width)
        Where states are put before they are evaluated.
    block : array, shape (row, parameter)
        Parameters.
    """

    n: int
    velocities: int
    moving: int
    coupled: bool
    evaluations: int
    state: Array
    block: Array

    def rate(self, time: float, out: Out) -> None:
        """Write the rates of ``self.state``."""

    def excess(self) -> tuple[Array, Array]:
        """By what coordinates and velocities of ``self.state``, whose rate is known, exceed the constraints."""

    def keep(self, rows: Index) -> None:
        """Go on with some rows only."""

    def impulse(self, time: float, rtol: float) -> tuple[Array, dict[int, str]]:
        """Find how velocities of ``self.state`` jump where prescribed speeds do, and who cannot go on."""
