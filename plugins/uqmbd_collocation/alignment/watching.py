"""Verification realisations of an aligned chaos, which show besides where the sequence of landmarks is another one."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Protocol

import numpy as np

import uqmbd
from uqmbd.typing import Array, Mask
from uqmbd_collocation.runs import DerivedSource

__all__ = ["Watching"]


class MarkerTrajectories(Protocol):
    """Whatever knows sequences of landmarks."""

    def elsewhere(self, sequence: tuple[str, ...], seen: Array) -> Mask: ...


@dataclass
class Watching(DerivedSource):
    """Problem that records watched outputs of its realisations."""

    problem: uqmbd.extend.Problem
    paths: MarkerTrajectories  # identify the sequence from the watched outputs
    _seen: list[Array] = field(default_factory=list)

    def realise(self, values: Array) -> uqmbd.extend.Realisations:
        """Compute realisations, and keep what is watched of those that do not fail."""
        found = self.problem.watching().realise(values)
        self._seen.append(found.response[found.good])
        return replace(found, response=found.response[:, : self.problem.labels.shape[0]])

    def elsewhere(self, sequence: tuple[str, ...]) -> Mask:
        """Say which realisations so far surely do not have a sequence, shape (K,)."""
        if not self._seen:
            return np.zeros(0, dtype=bool)
        return self.paths.elsewhere(sequence, np.concatenate(self._seen))
