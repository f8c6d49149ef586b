"""Verification realisations, which give the error of a chaos at germ points that are not among its nodes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from uqmbd.arguments import NotNegative, Share, Size, shown, typechecked
from uqmbd.errors import StudyError
from uqmbd.propagation.chaos.verification_points import VerificationPoints
from uqmbd.propagation.execution import Realisations
from uqmbd.randomness import GermSpace
from uqmbd.results import PolynomialChaos
from uqmbd.results.chaos import weighted_std
from uqmbd.results.schema import Labels
from uqmbd.typing import Array, Index

__all__ = ["Verification"]


@typechecked
@dataclass(frozen=True, eq=False)
class Verification:
    """Realisations at verification points.

    Attributes
    ----------
    space : GermSpace
        Germ space of the inputs.
    points : VerificationPoints
        Points of the successful realisations.
    response : array, shape (V, output, time)
        Responses at these points.
    asked : int
        Number of computed realisations.
    reason : str
        Most frequent reason of failure; otherwise empty.
    lost : float
        Probability of a failure, estimated with the weights of the failed realisations.

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
        """Return the successful realisations at these points.

        Parameters
        ----------
        space : GermSpace
            Germ space of the inputs.
        points : VerificationPoints
            All K points.
        found : Realisations
            Realisations at these points.
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
        """Join these and further realisations of the same germ space, each with its weight.

        Parameters
        ----------
        other : Verification
            Further verification realisations of the same germ space.

        Returns
        -------
        Verification
            All verification realisations.

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
        requested = self.asked + other.asked
        both = VerificationPoints(
            np.concatenate([self.points.germs, other.points.germs]),
            np.concatenate([self.points.weights, other.points.weights]),
        )
        response = np.concatenate([self.response, other.response])
        lost = (self.asked * self.lost + other.asked * other.lost) / max(requested, 1)
        return replace(
            self, points=both, response=response, asked=requested, reason=self.reason or other.reason, lost=lost
        )

    @property
    def known(self) -> dict[str, Array]:
        """Return the verification arguments of a surrogate by name; empty if all realisations failed."""
        if not len(self):
            return {}
        return {
            "verification_germs": self.points.germs,
            "verification_response": self.response,
            "verification_weights": self.points.weights,
        }

    @property
    def std(self) -> Array:
        """Return the weighted standard deviation (output, time) for the input distribution; 0 if all failed."""
        return weighted_std(self.response, self.points.weights)

    @property
    def failures(self) -> int:
        """Return the number of failed realisations, which have no response."""
        return self.asked - len(self)

    @staticmethod
    def failed_share(verified: Sequence[Verification], boxes: Sequence[Share], nodes: Size, failed: Size) -> float:
        """Return the weighted share of failed realisations.

        All nodes have the same weight. Verification realisations, half of which are in the tails, have separate
        weights.

        Parameters
        ----------
        verified : sequence of Verification
            Verification realisations of each element.
        boxes : sequence of float
            Probabilities of the elements; 1 for the whole germ space.
        nodes, failed : int
            Number of other realisations, and number of failures among them.

        Raises
        ------
        StudyError
            If the numbers of probabilities and elements differ.
        """
        if len(verified) != len(boxes):
            raise StudyError(
                f"Verification: {len(boxes)} probabilities are given for {len(verified)} elements; "
                "expected one for each element."
            )
        requested = sum(one.asked for one in verified)
        lost = sum(share * one.lost for one, share in zip(verified, boxes, strict=True))
        return float((failed + requested * lost) / max(nodes + requested, 1))

    def chaos(self, coefficients: Array, multi_index: Index, labels: Labels) -> PolynomialChaos:
        """Make a verified chaos; if it has fewer times than the labels, it uses the first times of the labels.

        Parameters
        ----------
        coefficients : array, shape (P, output, T)
            Coefficients, in the units of the outputs.
        multi_index : array of int, shape (P, d)
            Degrees of the terms.
        labels : uqmbd.extend.Labels
            Labels of the problem.

        Returns
        -------
        PolynomialChaos
            Chaos with its stated errors.

        Raises
        ------
        uqmbd.StudyError
            If the coefficients have another shape.
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
