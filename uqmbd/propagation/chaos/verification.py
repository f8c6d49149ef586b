"""Verification realisations: how wrong a chaos is at germ points that none of its nodes uses."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from uqmbd.propagation.execution import Realisations
from uqmbd.randomness import GermBox, GermSpace, monte_carlo_rule
from uqmbd.results import Labels, PolynomialChaos
from uqmbd.typing import Array, Index

__all__ = ["Verification"]


FEWEST = 3
"""Verification realisations that every element gets, however improbable."""


@dataclass(frozen=True, eq=False)
class Verification:
    """Realisations at verification points.

    Attributes
    ----------
    space : GermSpace
        Of the inputs.
    germs : array, shape (V, d)
        Points of those that did not fail.
    response : array, shape (V, output, time)
        Their responses.
    asked : int
        How many were computed.
    reason : str
        The most frequent reason of failure, or empty.
    """

    space: GermSpace
    germs: Array
    response: Array
    asked: int
    reason: str = ""

    @classmethod
    def of(cls, space: GermSpace, germs: Array, found: Realisations) -> Verification:
        """Return those of some realisations, at the germ points (K, d), that did not fail."""
        good = np.flatnonzero(found.good)
        return cls(space, germs[good], found.response[good], len(germs), found.most_frequent_reason())

    @staticmethod
    def points(space: GermSpace, count: int, seed: int, stream: int) -> Array:
        """Return germ points that no node uses, spread like the inputs, shape (count, d).

        Parameters
        ----------
        space : GermSpace
        count, seed : int
            As the options of a method.
        stream : int
            A number of the method's own: its points are no points of its designs.
        """
        if not count:
            return np.zeros((0, space.dimension))
        own = int(np.random.SeedSequence([seed, stream]).generate_state(1)[0])
        return monte_carlo_rule(space, count, own, "sobol").nodes

    @classmethod
    def points_of_elements(
        cls, boxes: Sequence[GermBox], first: int, count: int, seed: int, stream: int
    ) -> list[Array]:
        """Return the points of elements, by their probability, as local germs; `first` is the number of the first."""
        found = []
        for number, box in enumerate(boxes, start=first):
            share = max(FEWEST, math.ceil(count * box.probability)) if count else 0
            own = int(np.random.SeedSequence([seed, number]).generate_state(1)[0])
            found.append(cls.points(box.local, share, own, stream))
        return found

    @property
    def failures(self) -> int:
        """How many failed: there the response does not exist."""
        return self.asked - len(self.germs)

    def chaos(self, coefficients: Array, multi_index: Index, labels: Labels) -> PolynomialChaos:
        """Make a verified chaos; where it has fewer times than the labels, of the first ones.

        Parameters
        ----------
        coefficients : array, shape (P, output, T)
            In the units of the outputs.
        multi_index : array of int, shape (P, d)
            Degrees of the terms.
        labels : uqmbd.results.Labels
            Of the problem.
        """
        count = coefficients.shape[2]
        if labels.times is not None and count < len(labels.times):
            labels = replace(labels, times=labels.times[:count])
        known = len(self.germs) > 0
        return PolynomialChaos(
            coefficients,
            multi_index,
            self.space,
            labels,
            verification_germs=self.germs if known else None,
            verification_response=self.response[:, :, :count] if known else None,
        )
