"""Initial states of realisations, reasons of failed assemblies, and gradients of the equations."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from uqmbd.dynamics.equations import Model, state_arguments
from uqmbd.status import Status
from uqmbd.typing import Array, Index

__all__ = ["Start", "gradient_lengths"]


ROWS = 4096
"""Number of realisations in one evaluation of gradients."""


@dataclass(frozen=True)
class Start:
    """Consistent initial states of K realisations."""

    q: Array  # (K, coordinate)
    s: Array  # auxiliary states (K, state)
    v: Array  # (K, coordinate)
    a: Array  # (K, coordinate)
    rates: Array  # rates of the auxiliary states (K, state)
    multipliers: Array  # multipliers of the independent equations (K, kept)
    messages: tuple[str, ...]  # empty if the realisation was assembled, else the reason
    outside: NDArray[np.bool_]  # (K,): whether a number outside its range is the reason

    def select(self, members: Index) -> Start:
        """Return the initial states of the selected realisations."""
        return Start(
            self.q[members],
            self.s[members],
            self.v[members],
            self.a[members],
            self.rates[members],
            self.multipliers[members],
            tuple(self.messages[k] for k in members),
            self.outside[members],
        )

    @property
    def state(self) -> Array:
        """Coordinates, auxiliary states and velocities, shape (K, 2 coordinate + state)."""
        return np.concatenate([self.q, self.s, self.v], axis=1)

    @property
    def ok(self) -> NDArray[np.bool_]:
        """Mask of assembled realisations, shape (K,)."""
        return np.array([not m for m in self.messages], dtype=bool)

    @property
    def status(self) -> Index:
        """Status of each realisation at the start, as :class:`Status`, shape (K,)."""
        lost = np.where(self.outside, Status.OUTSIDE_LIMITS, Status.ASSEMBLY_FAILED)
        return np.where(self.ok, Status.OK, lost).astype(np.int64)


def gradient_lengths(model: Model, start: Start, parameters: Array) -> Array:
    """Return the lengths of the gradients of all equations at the start, (K, equation); 1 without a gradient."""
    evaluator = model.evaluators["velocity"]
    squares = np.zeros((len(parameters), model.layout.constraints))
    columns, (rows, _) = evaluator.index["d"]
    present, begins = np.unique(rows, return_index=True)  # `rows` are sorted
    for first in range(0, len(parameters), ROWS):
        part = slice(first, first + ROWS)
        q, s = start.q[part], start.s[part]
        values = evaluator(state_arguments(model.time, q, s, np.zeros_like(q)), parameters[part])[:, columns]
        squares[part, present] = np.add.reduceat(values**2, begins, axis=1)
    lengths = np.sqrt(squares)
    return np.where(lengths > 1e-9, lengths, 1.0)
