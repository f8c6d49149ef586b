"""Verification realisations of an aligned chaos, which also detect other sequences of markers."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Protocol

import numpy as np

import uqmbd
from uqmbd.typing import Array, Mask
from uqmbd_collocation.runs import DerivedSource

__all__ = ["Watching"]


class MarkerTrajectories(Protocol):
    """Source of sequences of markers."""

    def elsewhere(self, sequence: tuple[str, ...], seen: Array) -> Mask: ...


@dataclass
class Watching(DerivedSource):
    """Problem that records observed quantities of its realisations."""

    problem: uqmbd.extend.Problem
    paths: MarkerTrajectories  # identifies the sequence from the observed outputs
    _seen: list[Array] = field(default_factory=list)

    def realise(self, values: Array) -> uqmbd.extend.Realisations:
        """Compute realisations, and store the observed quantities of successful realisations."""
        found = self.problem.watching().realise(values)
        self._seen.append(found.response[found.good])
        return replace(found, response=found.response[:, : self.problem.labels.shape[0]])

    def elsewhere(self, sequence: tuple[str, ...]) -> Mask:
        """Return which realisations so far certainly have another sequence, shape (K,)."""
        if not self._seen:
            return np.zeros(0, dtype=bool)
        return self.paths.elsewhere(sequence, np.concatenate(self._seen))
