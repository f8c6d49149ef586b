"""Germ points of verification realisations, and their weights."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from uqmbd.arguments import Seed, Size, shown, typechecked
from uqmbd.errors import StudyError
from uqmbd.randomness import GermBox, GermSpace, TailMixture
from uqmbd.results import AlignedChaos, PiecewiseChaos
from uqmbd.results.chaos import reference_spread
from uqmbd.typing import Array, Index, Mask

__all__ = ["FEWEST", "VerificationPoints"]


FEWEST = 3
"""Minimum number of verification realisations of an element, for any probability."""

FURTHER = 0.15
"""Number of further verification realisations in inaccurate elements, relative to all realisations so far."""


AMONG, TAKEN = 32, 4
"""Candidate points per verification point for the extremes, and number of points that an extreme represents."""

MOST_AMONG = 8192
"""Maximum number of candidate points for the extremes."""


@typechecked
@dataclass(frozen=True, eq=False)
class VerificationPoints:
    """Germ points of verification realisations, and their weights.

    The points are more often in the tails than the inputs are, because errors of polynomials are largest in the tails.
    Points in the tails have smaller weights, so weighted means refer to the input distribution.

    Attributes
    ----------
    germs : array, shape (V, d)
        Germ points; none of them is a node.
    weights : array, shape (V,)
        Density of the germs, divided by the density of the points; their mean is about 1.

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
        """Draw points; they are the same for every order.

        Parameters
        ----------
        space : GermSpace
            Germ space of the inputs.
        count, seed : int
            Number of points and seed of the random numbers.
        stream : int
            Number of the random stream, which separates these points from the points of the designs of the method.

        Returns
        -------
        VerificationPoints
            Points with their weights.
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
        """Return points of elements, in proportion to their probability, as local germs.

        Parameters
        ----------
        boxes : sequence of GermBox
            Boxes of the elements.
        first : int
            Index of the first of these elements, in the order of computation.
        count : int
            Number of points of each element.
        seed : int
            Seed of the method.
        stream : int
            Number of the random stream for this use.
        """
        found = []
        for number, box in enumerate(boxes, start=first):
            share = max(FEWEST, math.ceil(count * box.probability)) if count else 0
            own = int(np.random.SeedSequence([seed, number]).generate_state(1)[0])
            found.append(cls.drawn(box.local, share, own, stream))
        return found

    @classmethod
    def of_errors(
        cls,
        chaos: PiecewiseChaos | AlignedChaos,
        realisations: Size,
        seed: Seed,
        stream: Seed,
        *,
        most: Size | None = None,
    ) -> list[VerificationPoints]:
        """Return further points of elements, in proportion to their part of the stated error, as local germs.

        Most of the error is in elements that contain a jump or a kink. Few points determine this error poorly.

        Parameters
        ----------
        chaos : PiecewiseChaos or AlignedChaos
            Surrogate with its verification realisations; without these there are no further points.
        realisations : int
            Number of realisations computed so far. :meth:`further` of this number is the maximum of further points.
        seed : int
            Seed of the method.
        stream : int
            Number of the random stream for this use.
        most : int, optional
            Largest number of points that the method can still compute. Default: as many points as `further` allows.

        Returns
        -------
        list of VerificationPoints
            Points of each element; some elements have no points.

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
        >>> [len(points) for points in VerificationPoints.of_errors(chaos, 40, seed=0, stream=1, most=2)]
        [0, 2]
        """
        boxes = [one.box for one in chaos.elements] if isinstance(chaos, AlignedChaos) else chaos.boxes
        germs, response, weights = chaos.verification_germs, chaos.verification_response, chaos.verification_weights
        if germs is None or response is None or weights is None:
            return [cls.drawn(box.local, 0, seed, stream) for box in boxes]
        # an aligned chaos that ends early has no later values
        wrong = np.nan_to_num(chaos.evaluate_germs(germs) - response).reshape(len(germs), -1)
        inside = np.array([box.contains(germs) for box in boxes])
        squares = (inside * weights) @ wrong**2
        total = squares.sum(axis=0)
        shares = np.divide(squares, total, out=np.zeros_like(squares), where=total > 0).mean(axis=1)
        allowed = FURTHER * realisations if most is None else min(FURTHER * realisations, most)
        counts = np.floor(allowed * shares / max(shares.sum(), 1e-300)).astype(int)
        found = []
        for number, (box, count) in enumerate(zip(boxes, counts.tolist(), strict=True)):
            own = int(np.random.SeedSequence([seed, number, 1]).generate_state(1)[0])
            found.append(cls.drawn(box.local, count, own, stream))
        return found

    @staticmethod
    def further(realisations: Size) -> int:
        """Return the maximum number of further points of `of_errors`, for all elements together.

        Parameters
        ----------
        realisations : int
            Number of realisations computed before the further points.

        Returns
        -------
        int
            15 % of the realisations.

        Examples
        --------
        >>> VerificationPoints.further(40)
        6
        """
        return math.floor(FURTHER * realisations)

    @classmethod
    def at_extremes(
        cls,
        space: GermSpace,
        count: Size,
        germs: Array,
        response: Array,
        seed: Seed,
        stream: Seed,
        error: Array | None = None,
    ) -> VerificationPoints:
        """Return two points at which a linear fit of known realisations is extreme, with small weights.

        Events occur first and last at these points. Points in between do not show the start and end times of a jump
        that moves over time.

        The two points are the extremes of 32 candidates for each verification point, and of at most 8,192. `drawn`
        returns the candidates for the same seed and stream.

        Parameters
        ----------
        space : GermSpace
            Germ space of the inputs.
        count : int
            Number of verification points, including the two extremes. The weight of an extreme is about one eighth of
            the weight of another point.
        germs : array, shape (K, d)
            Germ points of known realisations.
        response : array, shape (K, output, time)
            Responses of these realisations.
        seed : int
            Seed of the method.
        stream : int
            Number of the random stream for this use.
        error : array, shape (output, time), optional
            Current error of the surrogate, relative to the standard deviation, as weight of outputs and times. Default:
            equal weights.

        Returns
        -------
        VerificationPoints
            Points with their weights.

        Raises
        ------
        uqmbd.StudyError
            If the numbers of germs and responses differ, or errors have other axes than responses.

        Examples
        --------
        >>> import chaospy, numpy as np, uqmbd
        >>> from uqmbd.randomness import GermSpace, JointInput
        >>> from uqmbd.extend import VerificationPoints
        >>> inputs = [uqmbd.RandomVariable(name, chaospy.Uniform(-1, 1)) for name in ("a", "b")]
        >>> space = GermSpace.of(JointInput.of(inputs))
        >>> germs = VerificationPoints.drawn(space, 14, seed=0, stream=1).germs
        >>> ends = VerificationPoints.at_extremes(space, 16, germs, germs.sum(axis=1)[:, None, None], 0, 2)
        >>> ends.germs.round().tolist(), bool(ends.weights.max() < 0.2)
        ([[1.0, 1.0], [-1.0, -1.0]], True)
        """
        if len(germs) != len(response):
            raise StudyError(
                f"VerificationPoints.at_extremes: {len(response)} responses are given for {len(germs)} germ points; "
                "expected one for each point."
            )
        if error is not None and error.shape != response.shape[1:]:
            raise StudyError(
                f"VerificationPoints.at_extremes: error is {shown(error)}; expected the shape {response.shape[1:]} of "
                "output and time."
            )
        linear = np.eye(space.dimension, dtype=np.int64)
        among = cls.drawn(space, max(TAKEN, min(AMONG * count, MOST_AMONG)), seed, stream)
        order = np.argsort(
            space.evaluate(among.germs, linear) @ _direction(space, germs, response, error), kind="stable"
        )
        # the sign of a direction has no meaning, so the two ends keep the order of the points
        low, high = sorted((order, order[::-1]), key=lambda one: int(one[0]))
        taken = max(1, round(TAKEN * len(among) / (AMONG * max(count, 1))))
        shares = np.array([among.weights[end[:taken]].sum() for end in (low, high)]) / among.weights.sum()
        return cls(among.germs[[low[0], high[0]]], count * shares)

    def __len__(self) -> int:
        return len(self.weights)

    def __getitem__(self, rows: slice | Index | Mask) -> VerificationPoints:
        """Return a selection of the points."""
        return VerificationPoints(self.germs[rows], self.weights[rows])

    def share(self, which: Mask) -> float:
        """Return the probability that selected points (V,) represent, by the weights; 0 for no points."""
        return float(self.weights[which].sum() / self.weights.sum()) if which.any() else 0.0


def _direction(space: GermSpace, germs: Array, response: Array, error: Array | None) -> Array:
    """Return the direction (d,) of the germs in which responses (K, O, T) at germs (K, d) vary most, by a linear fit.

    Responses are divided by their standard deviation, and weighted by the error (O, T) of a surrogate.
    """
    linear = np.eye(space.dimension, dtype=np.int64)
    if not len(germs):
        return np.asarray(linear[:, -1], dtype=float)
    values, basis = (given - given.mean(axis=0) for given in (response, space.evaluate(germs, linear)))
    std = reference_spread(np.sqrt(np.mean(values**2, axis=0)))
    counts = 1.0 if error is None else np.minimum(np.where(np.isfinite(error), error, 1.0), 1.0)
    columns = (values * counts / np.where(std > 0, std, 1.0)).reshape(len(values), -1)
    # fewer points than germs leave slopes undetermined; the regularisation makes these slopes small
    slopes = np.linalg.solve(basis.T @ basis + space.dimension * linear, basis.T @ columns)
    return np.asarray(np.linalg.eigh(slopes @ slopes.T)[1][:, -1])
