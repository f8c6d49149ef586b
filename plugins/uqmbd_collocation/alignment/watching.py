"""Verification realisations of an aligned chaos, which show besides where the sequence of landmarks is another one."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Protocol

import numpy as np

import uqmbd
from uqmbd.results import Labels
from uqmbd.typing import Array, Mask

__all__ = ["Watching"]


class Paths(Protocol):
    """Whatever knows sequences of landmarks."""

    def elsewhere(self, sequence: tuple[str, ...], seen: Array) -> Mask: ...


@dataclass
class Watching:
    """A problem whose realisations are watched.

    Attributes
    ----------
    problem : uqmbd.Problem
        That of the study.
    paths : Paths
        Tells the sequence of what was watched.
    """

    problem: uqmbd.Problem
    paths: Paths
    _seen: list[Array] = field(default_factory=list)

    @property
    def label(self) -> str:
        """Of the propagator."""
        return self.problem.label

    @property
    def rtol(self) -> float:
        """Relative tolerance of the integration."""
        return self.problem.rtol

    @property
    def labels(self) -> Labels:
        """Those of the study."""
        return self.problem.labels

    def realise(self, values: Array) -> uqmbd.Realisations:
        """Compute realisations, and keep what is watched of those that do not fail."""
        found = self.problem.watching().realise(values)
        self._seen.append(found.response[found.good])
        return replace(found, response=found.response[:, : self.problem.labels.shape[0]])

    def elsewhere(self, sequence: tuple[str, ...]) -> Mask:
        """Say which realisations so far surely do not have a sequence, shape (K,)."""
        if not self._seen:
            return np.zeros(0, dtype=bool)
        return self.paths.elsewhere(sequence, np.concatenate(self._seen))
