"""Batch of realisations: interface of an ensemble for integration, contacts, statics and observation."""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol

from uqmbd.compiled import SampledControl
from uqmbd.dynamics.assembly import Start
from uqmbd.dynamics.equations import Model
from uqmbd.dynamics.sampled_paths import SampledPaths
from uqmbd.typing import Array, Index

__all__ = ["Batch", "Sampler"]


class Sampler(Protocol):
    """Samples of controllers in one integration: `uqmbd.dynamics.control.Sampling`."""

    times: Array

    def after(self, number: int, states: Array, members: Index) -> tuple[Array, dict[int, str]]:
        """Return the states right after an instant, and reasons of failures."""

    def control(self) -> SampledControl | None:
        """Return the samples for the driver; None: call `after` at each instant."""

    def answering(self, measured: Array, states: Array, members: Index, found: Array) -> Callable[[int], None]:
        """Return a function of an instant that writes commands and states of controllers to `found` (M, entry)."""

    def alone(self, control: SampledControl, row: int, member: int, state: Array) -> tuple[Array, str]:
        """Take a sample that the driver has skipped; return the state (width,), and the reason of a failure."""

    def jumps(self, time: float, states: Array, members: Index) -> tuple[Array, dict[int, str]]:
        """Return the jumps of velocities due to commanded speeds, and reasons of failures."""


class Batch(Protocol):
    """K realisations of one model; `uqmbd.extend.Ensemble` implements and documents the attributes."""

    model: Model
    values: Array
    parameters: Array
    block: Array

    def __len__(self) -> int:
        """Return K."""

    @property
    def start(self) -> Start:
        """Consistent initial states."""

    @property
    def frozen(self) -> Array:
        """Values of the frozen coordinates, shape (K, frozen)."""

    @property
    def gradient_lengths(self) -> Array:
        """Lengths of the gradients of all equations at the start, shape (K, equation)."""

    @property
    def breaks(self) -> Array:
        """Break times, shape (K, break)."""

    @property
    def paths(self) -> SampledPaths | None:
        """Sampled paths of excitations."""

    def without_paths(self) -> Batch:
        """Return the batch with the mean of every sampled path."""

    def select(self, members: Index) -> Batch:
        """Return the batch of the selected realisations."""

    def sampling(self, times: Array) -> Sampler | None:
        """Return the samples of the controllers over output times, s; None if there are no controllers."""

    def pack(self, q: Array, s: Array, v: Array, multipliers: Array) -> Array:
        """Return the unknowns ``y`` of states."""

    def expand(self, y: Array) -> tuple[Array, Array, Array]:
        """Return all coordinates, auxiliary states and velocities of unknowns ``y``."""

    def residual(self, time: float, y: Array, yp: Array) -> Array:
        """Return the stabilised index-2 residual."""

    def jacobian(self, time: float, y: Array, yp: Array, c: float) -> Array:
        """Return the values of ``dr/dy + c dr/dy'``."""
