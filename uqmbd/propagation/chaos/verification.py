"""Verification realisations: how wrong a chaos is at germ points that none of its nodes uses."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from uqmbd.arguments import NotNegative, Seed, Share, Size, shown, typechecked
from uqmbd.errors import StudyError
from uqmbd.propagation.execution import Realisations
from uqmbd.randomness import GermBox, GermSpace, TailMixture
from uqmbd.results import PiecewiseChaos, PolynomialChaos
from uqmbd.results.chaos import weighted_std
from uqmbd.results.schema import Labels
from uqmbd.typing import Array, Index, Mask

__all__ = ["FEWEST", "Verification", "VerificationPoints"]


FEWEST = 3
"""Verification realisations that every element gets, however improbable."""

FURTHER = 0.15
"""Further verification realisations where elements are wrong, over all realisations so far."""


@typechecked
@dataclass(frozen=True, eq=False)
class VerificationPoints:
    """Germ points of verification realisations, and what each of them counts.

    They lie in the tails more often than the inputs do, where errors of polynomials are largest; there each counts for
    less, so that means over them are those of the inputs' own distribution.

    Attributes
    ----------
    germs : array, shape (V, d)
        No node uses them.
    weights : array, shape (V,)
        Density of the germs over that of the points; their mean is about 1.

    Examples
    --------
    >>> import chaospy, numpy as np, uqmbd
    >>> from uqmbd.randomness import GermSpace, JointInput
    >>> space = GermSpace.of(JointInput.of([uqmbd.RandomVariable("a", chaospy.Normal(0, 1))]))
    >>> points = VerificationPoints.drawn(space, 64, seed=0, stream=1)
    >>> bool(abs(np.average(points.germs[:, 0] ** 4, weights=points.weights) - 3) < 0.3)
    True
    """

    germs: Array
    weights: Array

    @classmethod
    def drawn(cls, space: GermSpace, count: Size, seed: Seed, stream: Seed) -> VerificationPoints:
        """Draw points; the same for every order.

        Parameters
        ----------
        space : GermSpace
        count, seed : int
            As the options of a method.
        stream : int
            A number of the method's own: its points are no points of its designs.

        Returns
        -------
        VerificationPoints
            With their weights.
        """
        if not count:
            return cls(np.zeros((0, space.dimension)), np.zeros(0))
        own = int(np.random.SeedSequence([seed, stream]).generate_state(1)[0])
        mixture = TailMixture(space)
        germs = mixture.points(count, own)
        return cls(germs, mixture.weights(germs))

    @classmethod
    def of_elements(
        cls, boxes: Sequence[GermBox], first: Seed, count: Size, seed: Seed, stream: Seed
    ) -> list[VerificationPoints]:
        """Return the points of elements, by their probability, as local germs; `first` is the number of the first.

        Parameters
        ----------
        boxes : sequence of GermBox
            Parts of the germ space.
        first : int
            Number of the first of the elements, in the order of computation.
        count : int
            Points of each.
        seed : int
            Of the method.
        stream : int
            Of the seed, for this use.
        """
        found = []
        for number, box in enumerate(boxes, start=first):
            share = max(FEWEST, math.ceil(count * box.probability)) if count else 0
            own = int(np.random.SeedSequence([seed, number]).generate_state(1)[0])
            found.append(cls.drawn(box.local, share, own, stream))
        return found

    @classmethod
    def of_errors(cls, chaos: PiecewiseChaos, realisations: Size, seed: Seed, stream: Seed) -> list[VerificationPoints]:
        """Return further points of elements, by what these contribute to the stated error, as local germs.

        Most of the error is in elements that a jump or a kink crosses. Few points determine it poorly.

        Parameters
        ----------
        chaos : PiecewiseChaos
            With the verification realisations so far.
        realisations : int
            All that were computed so far; the further points are at most 15 % as many.
        seed : int
            Of the method.
        stream : int
            Of the seed, for this use.

        Returns
        -------
        list of VerificationPoints
            Of each element; some have none.

        Examples
        --------
        Of two constants, which approximate the sign of a germ and one more jump, the second one is wrong:

        >>> import chaospy, numpy as np, uqmbd
        >>> from uqmbd.results import PiecewiseChaos, PolynomialChaos
        >>> a = uqmbd.RandomVariable("a", chaospy.Uniform(-1, 1))
        >>> mechanism = uqmbd.Mechanism("inputs", uqmbd.Line())
        >>> mechanism.output("a", a)
        >>> space, axes = uqmbd.extend.GermSpace.of(mechanism.inputs), uqmbd.extend.labels(["y"], ["a"], [0.0])
        >>> boxes = uqmbd.extend.GermBox.whole(space).split(0)
        >>> seen = {"verification_germs": [[0.25], [0.5]], "verification_response": [[[1.0]], [[2.0]]]}
        >>> parts = [PolynomialChaos([[[-1.0]]], [[0]], boxes[0].local, axes)]
        >>> parts.append(PolynomialChaos([[[1.0]]], [[0]], boxes[1].local, axes, **seen))
        >>> chaos = PiecewiseChaos(tuple(parts), boxes)
        >>> [len(points) for points in VerificationPoints.of_errors(chaos, 40, seed=0, stream=1)]
        [0, 6]
        """
        known = [
            np.zeros(chaos.labels.shape) if e.verification_germs is None else e.verification_rms()
            for e in chaos.elements
        ]
        squares = chaos.probabilities[:, None] * np.stack(known).reshape(len(known), -1) ** 2
        total = squares.sum(axis=0)
        shares = np.divide(squares, total, out=np.zeros_like(squares), where=total > 0).mean(axis=1)
        counts = np.floor(FURTHER * realisations * shares / max(shares.sum(), 1e-300)).astype(int)
        found = []
        for number, (box, count) in enumerate(zip(chaos.boxes, counts.tolist(), strict=True)):
            own = int(np.random.SeedSequence([seed, number, 1]).generate_state(1)[0])
            found.append(cls.drawn(box.local, count, own, stream))
        return found

    def __len__(self) -> int:
        return len(self.weights)

    def __getitem__(self, rows: slice | Index | Mask) -> VerificationPoints:
        """Return some of them."""
        return VerificationPoints(self.germs[rows], self.weights[rows])

    def share(self, which: Mask) -> float:
        """Return the share of the probability that some of them (V,) stand for, by the weights; 0 of no points."""
        return float(self.weights[which].sum() / self.weights.sum()) if which.any() else 0.0


@typechecked
@dataclass(frozen=True, eq=False)
class Verification:
    """Realisations at verification points.

    Attributes
    ----------
    space : GermSpace
        Of the inputs.
    points : VerificationPoints
        Of those that did not fail.
    response : array, shape (V, output, time)
        Their responses.
    asked : int
        How many were computed.
    reason : str
        The most frequent reason of failure, or empty.
    lost : float
        Share of the probability at which realisations fail, by the weights of those that did.

    Examples
    --------
    >>> import chaospy
    >>> import numpy as np
    >>> import uqmbd
    >>> from uqmbd.extend import labels
    >>> speed = uqmbd.RandomVariable("speed", chaospy.Normal(3, 0.2), units="m/s")
    >>> mechanism = uqmbd.Mechanism("stone", uqmbd.Line())
    >>> stone = mechanism.body("stone", mass=1, velocity=speed)
    >>> space = uqmbd.extend.GermSpace.of(mechanism.inputs)
    >>> points = uqmbd.extend.VerificationPoints.drawn(space, 4, seed=0, stream=1)
    >>> response = (3 + 0.2 * points.germs)[:, :, None]
    >>> verified = uqmbd.extend.Verification(space, points, response, asked=4)
    >>> axes = labels(["height"], ["speed"], [1.0])
    >>> chaos = verified.chaos(np.array([[[3.0]], [[0.2]]]), np.array([[0], [1]]), axes)
    >>> len(verified), verified.failures, float(chaos.verification_error().max().round(9))
    (4, 0, 0.0)
    """

    space: GermSpace
    points: VerificationPoints
    response: Array
    asked: Size
    reason: str = ""
    lost: NotNegative = 0.0

    @classmethod
    def of(cls, space: GermSpace, points: VerificationPoints, found: Realisations) -> Verification:
        """Return those of some realisations, at these points, that did not fail.

        Parameters
        ----------
        space : GermSpace
            Of the inputs.
        points : VerificationPoints
            K of them.
        found : Realisations
            At these.
        """
        good = np.flatnonzero(found.good)
        return cls(
            space,
            points[good],
            found.response[good],
            len(points),
            found.most_frequent_reason(),
            points.share(~found.good),
        )

    def __len__(self) -> int:
        return len(self.points)

    def joined(self, other: Verification) -> Verification:
        """Return these realisations and others of the same germ space, each of which counts by its weight.

        Parameters
        ----------
        other : Verification
            Of the same germ space.

        Returns
        -------
        Verification
            Of both.

        Examples
        --------
        >>> import chaospy, numpy as np, uqmbd
        >>> a = uqmbd.RandomVariable("a", chaospy.Uniform(-1, 1))
        >>> mechanism = uqmbd.Mechanism("inputs", uqmbd.Line())
        >>> mechanism.output("a", a)
        >>> space = uqmbd.extend.GermSpace.of(mechanism.inputs)
        >>> points = uqmbd.extend.VerificationPoints.drawn(space, 4, seed=0, stream=1)
        >>> one = uqmbd.extend.Verification(space, points, points.germs[:, :, None], asked=4)
        >>> len(one.joined(one)), one.joined(one).asked
        (8, 8)
        """
        asked = self.asked + other.asked
        both = VerificationPoints(
            np.concatenate([self.points.germs, other.points.germs]),
            np.concatenate([self.points.weights, other.points.weights]),
        )
        response = np.concatenate([self.response, other.response])
        lost = (self.asked * self.lost + other.asked * other.lost) / max(asked, 1)
        return replace(self, points=both, response=response, asked=asked, reason=self.reason or other.reason, lost=lost)

    @property
    def known(self) -> dict[str, Array]:
        """What a surrogate takes of them: arguments by their names; empty where all failed."""
        if not len(self):
            return {}
        return {
            "verification_germs": self.points.germs,
            "verification_response": self.response,
            "verification_weights": self.points.weights,
        }

    @property
    def std(self) -> Array:
        """Standard deviation (output, time) of the inputs' own distribution, by the weights; 0 where all failed."""
        return weighted_std(self.response, self.points.weights)

    @property
    def failures(self) -> int:
        """How many failed: there the response does not exist."""
        return self.asked - len(self)

    @staticmethod
    def failed_share(verified: Sequence[Verification], boxes: Sequence[Share], nodes: Size, failed: Size) -> float:
        """Return the share of the probability at which realisations fail.

        Nodes count alike, verification realisations, half of which lie in the tails, by their weights.

        Parameters
        ----------
        verified : sequence of Verification
            Of each element.
        boxes : sequence of float
            Probabilities of the elements; 1 of the whole.
        nodes, failed : int
            Other realisations, and how many of them failed.

        Raises
        ------
        StudyError
            If there is not one probability for each element.
        """
        if len(verified) != len(boxes):
            raise StudyError(
                f"Verification: {len(verified)} elements have {len(boxes)} probabilities; expected as many."
            )
        asked = sum(one.asked for one in verified)
        lost = sum(share * one.lost for one, share in zip(verified, boxes, strict=True))
        return float((failed + asked * lost) / max(nodes + asked, 1))

    def chaos(self, coefficients: Array, multi_index: Index, labels: Labels) -> PolynomialChaos:
        """Make a verified chaos; where it has fewer times than the labels, of the first ones.

        Parameters
        ----------
        coefficients : array, shape (P, output, T)
            In the units of the outputs.
        multi_index : array of int, shape (P, d)
            Degrees of the terms.
        labels : uqmbd.extend.Labels
            Of the problem.

        Returns
        -------
        PolynomialChaos
            With its stated errors.

        Raises
        ------
        uqmbd.StudyError
            If the coefficients have other axes.
        """
        if coefficients.ndim != 3:
            raise StudyError(
                f"Verification.chaos: coefficients is {shown(coefficients)}; expected the axes (term, output, time)."
            )
        count = coefficients.shape[2]
        if labels.times is not None and count < len(labels.times):
            labels = replace(labels, times=labels.times[:count])
        known = self.known
        if known:
            known["verification_response"] = self.response[:, :, :count]
        return PolynomialChaos(coefficients, multi_index, self.space, labels, **known)
