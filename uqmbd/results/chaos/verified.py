"""Stated errors of a surrogate, from verification realisations, and verdicts on its accuracy."""

from __future__ import annotations

from functools import cached_property
from typing import Annotated

import numpy as np

from uqmbd.arguments import Bounds, typechecked
from uqmbd.errors import StudyError
from uqmbd.results.chaos.boxes import face_mean_squares, rows_of_boxes
from uqmbd.results.chaos.container import SurrogateContainer
from uqmbd.results.chaos.stated_error import (
    compute_stated_error,
    factor_words,
    first_above,
    root_mean_square,
    stated_words,
    uncertainty_factor,
    weighted_std,
)
from uqmbd.results.schema import output_index, time_index
from uqmbd.typing import Array

__all__ = ["VerifiedSurrogate"]


@typechecked
class VerifiedSurrogate(SurrogateContainer):
    """Surrogate with errors stated from realisations that no fit uses; `Surrogate` adds values and statistics."""

    @property
    def _advice(self) -> str:
        """Advice for an uncertain stated error."""
        return "raise verify"

    @property
    def _remedy(self) -> str:
        """Advice on how to reduce the stated error."""
        return "raise the order"

    def verdicts(self, tolerance: Annotated[float, Bounds(0)] = 0.01) -> tuple[str, ...]:
        """Return a sentence for each output on the accuracy of the surrogate.

        With verification data, the sentences state the stated error and name suspected discontinuities. Otherwise they
        describe the decay of the coefficients: whether the top-order terms contribute more than a fraction `tolerance`
        of the standard deviation, and from which time on. A small contribution is no proof of accuracy.

        Parameters
        ----------
        tolerance : float
            Limit of the error, or of the top-order contribution, relative to the standard deviation.

        Returns
        -------
        tuple of str, length O
            Sentences, one for each output.

        Examples
        --------
        >>> import chaospy, uqmbd
        >>> from uqmbd.randomness import GermSpace, JointInput
        >>> from uqmbd.results import PolynomialChaos
        >>> from uqmbd.extend import labels
        >>> space = GermSpace.of(JointInput.of([uqmbd.RandomVariable("a", chaospy.Normal(3, 0.2), units="m/s")]))
        >>> axes = labels(["y"], ["a"], [0.0])
        >>> chaos = PolynomialChaos([[[1.0]], [[0.5]]], [[0], [1]], space, axes)  # 1 + 0.5 psi
        >>> verdict, = chaos.verdicts()
        >>> print(verdict.partition(":")[0])
        order 1 is not enough for y at any time
        """
        if self.verification_germs is None:
            return self._verdicts_of_decay(tolerance)
        errors = self._stated_error
        factors, count = self.verification_factor().reshape(errors.shape), len(self.verification_germs)
        spread = self.std.reshape(errors.shape)
        rows = zip(self.labels.outputs, errors, spread, factors, self._suspicions(), strict=True)
        return tuple(
            f"{output.name}: {stated_words('surrogate', row, self.labels.times, tolerance, self._remedy, std)}"
            + factor_words(float(factor[np.nan_to_num(row, nan=-1.0).argmax()]), count, self._advice)
            + suspicion
            for output, row, std, factor, suspicion in rows
        )

    def verification_error(self, output: str | None = None, time: float | None = None) -> Array:
        """Return the stated error: the error at the verification realisations, relative to the standard deviation.

        The stated error is the weighted root mean square over the realisations. Verification realisations are more
        frequent in the tails than the inputs, and have smaller weights in the tails. If the standard deviation is below
        1 % of its maximum over time, the error is relative to 1 % of that maximum. An output that is constant in the
        surrogate (as at order 0) has the error 1 if the realisations differ from its mean. :meth:`verification_factor`
        returns the uncertainty factor of this error.

        Parameters
        ----------
        output : str, optional
            Name of the output. Default: all.
        time : float, optional
            One of the times, in s. Default: all.

        Returns
        -------
        array, shape (O, T), without the axes of a selected output or time
            Stated errors.

        Raises
        ------
        StudyError
            If there is no verification data, or output or time are unknown.

        Examples
        --------
        >>> import chaospy, uqmbd
        >>> from uqmbd.randomness import GermSpace, JointInput
        >>> from uqmbd.results import PolynomialChaos
        >>> from uqmbd.extend import labels
        >>> space = GermSpace.of(JointInput.of([uqmbd.RandomVariable("k", chaospy.Normal(2, 0.5))]))
        >>> seen = {"verification_germs": [[-1.0], [1.0]], "verification_response": [[[0.5]], [[1.6]]]}
        >>> chaos = PolynomialChaos([[[1.0]], [[0.5]]], [[0], [1]], space, labels(["x"], ["k"], [0.0]), **seen)
        >>> chaos.verification_error().round(4).tolist()  # 0.1 at one of two, over 0.5
        [[0.1414]]
        """
        found = self._stated_error.reshape(self.labels.shape)
        row = slice(None) if output is None else output_index(self.labels, output)
        return np.array(found[(row, *time_index(self.labels, time))])

    def verification_factor(self) -> Array:
        """Return the uncertainty factor of the stated error, shape (O, T): two standard errors, from the scatter.

        If the factor exceeds 2, there are too few verification realisations. The factor does not include errors that
        occur in no verification realisation.

        Examples
        --------
        >>> import chaospy, uqmbd
        >>> from uqmbd.randomness import GermSpace, JointInput
        >>> from uqmbd.results import PolynomialChaos
        >>> from uqmbd.extend import labels
        >>> space = GermSpace.of(JointInput.of([uqmbd.RandomVariable("k", chaospy.Normal(2, 0.5))]))
        >>> seen = {"verification_germs": [[-1.0], [1.0]], "verification_response": [[[0.5]], [[1.6]]]}
        >>> chaos = PolynomialChaos([[[1.0]], [[0.5]]], [[0], [1]], space, labels(["x"], ["k"], [0.0]), **seen)
        >>> chaos.verification_factor().round(2).tolist()  # two realisations know little
        [[2.72]]
        """
        germs, response, weights = self._verified
        return uncertainty_factor(self.evaluate_germs(germs) - response, weights)

    def verification_rms(self) -> Array:
        """Return the root mean square error (O, T) at the weighted verification realisations, in units of the outputs.

        The error is NaN where the surrogate is NaN.

        Examples
        --------
        >>> import chaospy, uqmbd
        >>> from uqmbd.randomness import GermSpace, JointInput
        >>> from uqmbd.results import PolynomialChaos
        >>> from uqmbd.extend import labels
        >>> space = GermSpace.of(JointInput.of([uqmbd.RandomVariable("k", chaospy.Normal(2, 0.5))]))
        >>> seen = {"verification_germs": [[-1.0], [1.0]], "verification_response": [[[0.5]], [[1.6]]]}
        >>> chaos = PolynomialChaos([[[1.0]], [[0.5]]], [[0], [1]], space, labels(["x"], ["k"], [0.0]), **seen)
        >>> chaos.verification_rms().round(4).tolist()
        [[0.0707]]
        """
        germs, response, weights = self._verified
        return np.asarray(np.maximum(root_mean_square(self.evaluate_germs(germs) - response, weights), self._unseen))

    def verification_std(self) -> Array:
        """Return the standard deviation (O, T) of the outputs of the weighted verification realisations.

        Examples
        --------
        >>> import chaospy, uqmbd
        >>> from uqmbd.randomness import GermSpace, JointInput
        >>> from uqmbd.results import PolynomialChaos
        >>> from uqmbd.extend import labels
        >>> space = GermSpace.of(JointInput.of([uqmbd.RandomVariable("k", chaospy.Normal(2, 0.5))]))
        >>> seen = {"verification_germs": [[-1.0], [1.0]], "verification_response": [[[0.5]], [[1.6]]]}
        >>> chaos = PolynomialChaos([[[1.0]], [[0.5]]], [[0], [1]], space, labels(["x"], ["k"], [0.0]), **seen)
        >>> chaos.verification_std().round(4).tolist()
        [[0.55]]
        """
        _, response, weights = self._verified
        return weighted_std(response, weights)

    def horizon(self, limit: Annotated[float, Bounds(0)] = 0.01) -> dict[str, float | None]:
        """Return the first time (s) at which the stated error of each output exceeds a limit; None if it never does.

        Raises
        ------
        StudyError
            If the outputs have no times, or there is no verification data.

        Examples
        --------
        >>> import chaospy, uqmbd
        >>> from uqmbd.randomness import GermSpace, JointInput
        >>> from uqmbd.results import PolynomialChaos
        >>> from uqmbd.extend import labels
        >>> space = GermSpace.of(JointInput.of([uqmbd.RandomVariable("k", chaospy.Normal(2, 0.5))]))
        >>> seen = {"verification_germs": [[-1.0], [1.0]], "verification_response": [[[0.5]], [[1.6]]]}
        >>> chaos = PolynomialChaos([[[1.0]], [[0.5]]], [[0], [1]], space, labels(["x"], ["k"], [0.0]), **seen)
        >>> chaos.horizon(limit=0.1), chaos.horizon(limit=0.2)
        ({'x': 0.0}, {'x': None})
        """
        if self.labels.times is None:
            raise StudyError("Scalar outputs have no times and therefore no horizon; use 'verification_error'.")
        first = [first_above(row, limit) for row in self._stated_error]
        names = (o.name for o in self.labels.outputs)
        times = self.labels.times
        return {n: None if k is None else float(times[k]) for n, k in zip(names, first, strict=True)}

    @cached_property
    def _stated_error(self) -> Array:
        """Stated error (O, T), with T = 1 for outputs without times."""
        germs, response, weights = self._verified
        shape = (len(self.labels.outputs), -1)
        surrogate = self.evaluate_germs(germs)
        return compute_stated_error(
            surrogate.reshape(len(surrogate), *shape),
            response.reshape(len(surrogate), *shape),
            self.mean.reshape(shape),
            self.std.reshape(shape),
            weights,
            terms=self._moments.summands,
            unseen=self._unseen.reshape(shape),
            times=self.labels.times,
        )

    @cached_property
    def _unseen(self) -> Array:
        """Root mean square errors (O, T) in thin layers of the germ space that verification points miss."""
        return self._missed_at_faces()

    def _missed_at_faces(self) -> Array:
        """Return root mean square errors (O, T) in thin layers of the germ space between elements."""
        if len(self._boxes) < 2:
            return np.zeros(self.labels.shape)
        # the probability between a face and the outermost of n Gauss nodes is about 1 / n^2
        known = np.full(len(self._boxes), (int(self.multi_index.max()) + 1) ** 2)
        if self.verification_germs is not None:
            known = np.maximum(known, [len(rows) for rows in rows_of_boxes(self._boxes, self.verification_germs)])
        return np.sqrt(face_mean_squares(self._boxes, self._evaluate, known.tolist()))

    @property
    def _verified(self) -> tuple[Array, Array, Array]:
        """Germ points, responses and weights of the verification realisations."""
        found = self.verification_germs, self.verification_response, self.verification_weights
        if found[0] is None or found[1] is None or found[2] is None:
            raise StudyError(
                "This chaos has no verification realisations, so it cannot state its error; give the propagator "
                "verify=16, or see 'verdicts' for the decay of the coefficients."
            )
        return found[0], found[1], found[2]

    def _suspicions(self) -> tuple[str, ...]:
        """Return sentences on possible causes of the stated error of each output."""
        return ("",) * len(self.labels.outputs)

    def _verdicts_of_decay(self, tolerance: float) -> tuple[str, ...]:
        """Return a verdict on each output from the decay of the coefficients."""
        raise StudyError("This chaos has no verification realisations; give the propagator verify=16.")
