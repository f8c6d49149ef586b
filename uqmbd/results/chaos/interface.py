"""Interface of surrogates of outputs.

Length: it is one class, the interface of all surrogates, whose methods have their types for each kind of inputs, and
examples.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import cached_property
from typing import Annotated, Any, overload

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike

from uqmbd.arguments import Bounds, Count, Seed, typechecked
from uqmbd.display import html_of
from uqmbd.errors import StudyError
from uqmbd.results.chaos.boxes import face_mean_squares, rows_of_boxes
from uqmbd.results.chaos.container import SurrogateContainer
from uqmbd.results.chaos.labelled import DERIVATIVE, VALUE, Named, labelled_array, points_of, surrogate_statistics
from uqmbd.results.chaos.sampling import affordable, kernel_density, quantiles_of_rows, random_germs, spread_germs
from uqmbd.results.chaos.stated_error import (
    compute_stated_error,
    factor_words,
    first_above,
    root_mean_square,
    stated_words,
    uncertainty_factor,
    weighted_std,
)
from uqmbd.results.chaos.surrogate_moments import FEWER
from uqmbd.results.schema import (
    DEFAULT_PROBABILITIES,
    output_index,
    real_numbers,
    reasons_where_missing,
    time_index,
    united,
)
from uqmbd.results.statistics import circular_of_blocks
from uqmbd.typing import Array

__all__ = ["SAMPLES", "Surrogate"]

SAMPLES = 16384
"""Samples of the surrogate for quantiles and densities, unless another number is given."""


@typechecked
class Surrogate(SurrogateContainer):
    """Outputs as functions of the inputs that are evaluated at low cost, with their statistics and stated errors.

    Elements hold coefficients, and `readout` says how outputs follow from these.  The five public kinds only say what
    they are made of, and what else can be read of them: others use their names as types, and their class methods.
    """

    @property
    def _remedy(self) -> str:
        """Return what makes the stated error smaller."""
        return "raise the order"

    @overload
    def evaluate(self, inputs: Named) -> xr.DataArray: ...

    @overload
    def evaluate(self, **values: float | ArrayLike | xr.DataArray) -> xr.DataArray: ...

    @overload
    def evaluate(self, inputs: xr.DataArray) -> Any: ...

    @overload
    def evaluate(self, inputs: ArrayLike) -> Array: ...

    def evaluate(self, inputs: Any = None, **values: Any) -> Any:
        """Evaluate at inputs, in their units.

        Parameters
        ----------
        inputs : array_like, shape (K, d), or mapping, pandas.DataFrame, xarray.Dataset or xarray.DataArray
            A plain array has the inputs as columns, in their order.  All else has them by name: a mapping or a dataset
            has numbers, lists of one length, or arrays of xarray; a DataArray a dimension ``input``.
        **values
            Instead: inputs by name.  Arrays of xarray with dimensions of their own are combined with one another.

        Returns
        -------
        array, shape (K, O, T), or xarray.DataArray
            Of a plain array an array, in the units of the outputs.  Else labelled, with the dimensions of the inputs
            (``point`` for lists and rows without a name, none for single numbers), ``output`` and ``time``;
            `uqmbd.results.output` takes one output out, with its unit.

        Raises
        ------
        StudyError
            If an input lies outside its distribution, is missing, unknown, or has another unit.

        Examples
        --------
        >>> import chaospy, uqmbd
        >>> from uqmbd.randomness import GermSpace, JointInput
        >>> from uqmbd.results import PolynomialChaos
        >>> from uqmbd.extend import labels
        >>> space = GermSpace.of(JointInput.of([uqmbd.RandomVariable("k", chaospy.Normal(2, 0.5), units="N/m")]))
        >>> axes = labels([("x", "m")], [("k", "N/m")], [0.0])
        >>> chaos = PolynomialChaos([[[1.0]], [[0.25]]], [[0], [1]], space, axes)
        >>> chaos.evaluate([[3.0]]).tolist()
        [[[1.5]]]
        >>> found = chaos.evaluate(k=[2.0, 3.0])
        >>> found.dims, found.sel(output="x", time=0.0).values.tolist(), found.attrs["units"]
        (('point', 'output', 'time'), [1.0, 1.5], 'm')
        """
        return self._at(inputs, values, self._at_inputs, VALUE)

    def _at_inputs(self, points: Array) -> Array:
        """Evaluate at inputs (K, d): (K, O, T)."""
        return self._evaluate(self.space.to_germs(points))

    @overload
    def gradient(self, inputs: Named) -> xr.DataArray: ...

    @overload
    def gradient(self, **values: float | ArrayLike | xr.DataArray) -> xr.DataArray: ...

    @overload
    def gradient(self, inputs: xr.DataArray) -> Any: ...

    @overload
    def gradient(self, inputs: ArrayLike) -> Array: ...

    def gradient(self, inputs: Any = None, **values: Any) -> Any:
        """Differentiate with respect to the inputs, each while the others are held.

        Parameters
        ----------
        inputs, **values
            As of :meth:`evaluate`.

        Returns
        -------
        array, shape (K, d, O, T), or xarray.DataArray
            In the units of the outputs over those of the inputs; labelled, it has the dimension ``input`` before
            ``output``.  Elements are differentiated each by itself: at an edge that of the element which the point is
            in, and of a jump from one to the next nothing is seen.  Where the outputs jump at a landmark, the
            derivative is that of the segment which the time is in; behind the last landmark it is NaN.  An input of
            whole numbers is differentiated as if it had values between them.  NaN or infinite where one input belongs
            to many germs, as at the ends of a tabulated distribution.

        Raises
        ------
        StudyError
            As of :meth:`evaluate`.

        Examples
        --------
        >>> import chaospy, uqmbd
        >>> from uqmbd.randomness import GermSpace, JointInput
        >>> from uqmbd.results import output, PolynomialChaos
        >>> from uqmbd.extend import labels
        >>> space = GermSpace.of(JointInput.of([uqmbd.RandomVariable("k", chaospy.Normal(2, 0.5), units="N/m")]))
        >>> axes = labels([("x", "m")], [("k", "N/m")], [0.0])
        >>> chaos = PolynomialChaos([[[1.0]], [[0.25]]], [[0], [1]], space, axes)
        >>> chaos.gradient([[3.0]]).tolist()
        [[[[0.5]]]]
        >>> found = output(chaos.gradient(k=3.0), "x", input="k")
        >>> found.item(), found.attrs["units"]
        (0.5, 'm/(N/m)')
        """
        return self._at(inputs, values, self._input_gradient, DERIVATIVE)

    def _input_gradient(self, points: Array) -> Array:
        """Differentiate with respect to the inputs, at inputs (K, d): (K, d, O, T)."""
        germs = self.space.to_germs(points)
        slopes, found = self.space.germ_derivatives(germs), np.zeros((*points.shape, *self.labels.shape))
        for germ in range(points.shape[1]):
            depends = np.flatnonzero(slopes[:, germ].any(axis=0))
            if len(depends):
                own = self._derivative(germs, germ)
                for k in depends:
                    with np.errstate(invalid="ignore"):
                        found[:, k] += own * slopes[:, germ, k].reshape(-1, *(1,) * len(self.labels.shape))
        return found

    def _at(
        self, inputs: Any, values: Mapping[str, Any], of: Callable[[Array], Array], about: Mapping[str, str]
    ) -> Array | xr.DataArray:
        """Evaluate a function of points (K, d) at inputs, with labels where they have some."""
        points = points_of(inputs, values, self.labels.inputs)
        if points is None:
            name = next((x.name for x in self.labels.inputs), "input")
            shape = f"(points, {len(self.labels.inputs)})"
            expected = f"expected real numbers in an array {shape}, or by name: {name}=0.5"
            return of(real_numbers("inputs", inputs, expected=expected))
        return labelled_array(of(points.values), points, self.labels, about)

    def sample(self, count: Annotated[int, Bounds(0, 10**9)], seed: Seed) -> tuple[Array, Array]:
        """Draw independent inputs (K, d) of their distribution, and evaluate the outputs there: (K, O, T).

        Parameters
        ----------
        count : int
            How many, K.
        seed : int
            Of the random numbers.

        Returns
        -------
        inputs : array, shape (K, d)
            In their units.
        outputs : array, shape (K, O, T)
            In their units.

        Examples
        --------
        >>> import chaospy, uqmbd
        >>> from uqmbd.randomness import GermSpace, JointInput
        >>> from uqmbd.results import PolynomialChaos
        >>> from uqmbd.extend import labels
        >>> space = GermSpace.of(JointInput.of([uqmbd.RandomVariable("a", chaospy.Normal(3, 0.2), units="m/s")]))
        >>> axes = labels(["y"], ["a"], [0.0])
        >>> chaos = PolynomialChaos([[[1.0]], [[0.5]]], [[0], [1]], space, axes)  # 1 + 0.5 psi
        >>> inputs, outputs = chaos.sample(100, seed=1)
        >>> inputs.shape, outputs.shape
        ((100, 1), (100, 1, 1))
        """
        germs = random_germs(self.space, count, seed)
        return np.asarray(self.space.to_inputs(germs), dtype=float), self.evaluate_germs(germs)

    def quantiles(
        self, probabilities: Sequence[float] = DEFAULT_PROBABILITIES, *, samples: Count = SAMPLES, seed: Seed = 0
    ) -> Array:
        """Return quantiles (N, O, T) of samples of the surrogate.

        The samples are N points of a scrambled Sobol' sequence of the germs, the next power of two; outputs and times
        go block by block, so that memory does not grow with them.  The probability of what is found differs from that
        asked for by less than 2 / N where there is one germ. With several germs it has a random error. Its standard
        deviation is at most about that of independent samples, sqrt(p (1 - p) / N), and mostly far less.

        Parameters
        ----------
        probabilities : sequence of float, length N
            From 0 to 1.
        samples, seed : int
            Samples of the surrogate, and the number that they begin from.

        Returns
        -------
        array, shape (N, O, T)
            In the units of the outputs.

        Examples
        --------
        >>> import chaospy, uqmbd
        >>> from uqmbd.randomness import GermSpace, JointInput
        >>> from uqmbd.results import PolynomialChaos
        >>> from uqmbd.extend import labels
        >>> space = GermSpace.of(JointInput.of([uqmbd.RandomVariable("a", chaospy.Normal(3, 0.2), units="m/s")]))
        >>> axes = labels(["y"], ["a"], [0.0])
        >>> chaos = PolynomialChaos([[[1.0]], [[0.5]]], [[0], [1]], space, axes)  # 1 + 0.5 psi
        >>> chaos.quantiles([0.5, 0.975]).round(1).ravel().tolist()  # 1 and 1 + 1.96 * 0.5
        [1.0, 2.0]
        """
        germs = spread_germs(self.space, samples, seed)
        columns, single = int(np.prod(self.labels.shape)), germs.shape[1] == 1
        if single:
            germs = np.sort(germs, axis=0)
        drawn = self._sampler(germs).rows
        found = quantiles_of_rows(drawn, len(germs), columns, probabilities, along=single)
        return found.reshape(len(found), *self.labels.shape)

    def circular(self, *, samples: Count = SAMPLES, seed: Seed = 0) -> dict[str, Array]:
        """Return `circular_mean` and `circular_std`, (O, T), of the outputs that are angles, from surrogate samples.

        NaN for other outputs; nothing where no output is an angle. The samples are those of :meth:`quantiles`.

        Parameters
        ----------
        samples, seed : int
            As for :meth:`quantiles`.

        Returns
        -------
        dict of str to array
            In the units of the outputs.

        Examples
        --------
        >>> import math
        >>> import chaospy, uqmbd
        >>> from uqmbd.randomness import GermSpace, JointInput
        >>> from uqmbd.results import PolynomialChaos
        >>> from uqmbd.extend import labels
        >>> space = GermSpace.of(JointInput.of([uqmbd.RandomVariable("a", chaospy.Normal(3, 0.2), units="m/s")]))
        >>> axes = labels([("y", "rad", 2 * math.pi)], ["a"], [0.0])
        >>> chaos = PolynomialChaos([[[1.0]], [[0.5]]], [[0], [1]], space, axes)  # 1 + 0.5 psi
        >>> chaos.circular()["circular_mean"].round(2).tolist()  # rad
        [[1.0]]
        """
        if not np.any(self.labels.turns):
            return {}
        germs = spread_germs(self.space, samples, seed)
        drawn = self._sampler(germs)
        times = int(np.prod(self.labels.shape[1:]))

        def values(output: int, part: slice) -> Array:
            first, last, _ = part.indices(times)
            return drawn.columns(slice(output * times + first, output * times + last))

        return circular_of_blocks(self.labels.shape, len(germs), self.labels.turns, values)

    def density(
        self, values: ArrayLike, output: str, time: float | None = None, *, samples: Count = SAMPLES, seed: Seed = 0
    ) -> Array:
        """Estimate the probability density of an output at one time, by Gaussian kernels over surrogate samples.

        Parameters
        ----------
        values : array_like, shape (N,)
            Where, in the units of the output.
        output : str
        time : float, optional
            One of the times, in s.
        samples, seed : int
            As for :meth:`quantiles`.

        Returns
        -------
        array, shape (N,)
            In one over the units of the output.

        Raises
        ------
        StudyError
            If output or time are unknown, or the output does not vary there.

        Examples
        --------
        >>> import chaospy, uqmbd
        >>> from uqmbd.randomness import GermSpace, JointInput
        >>> from uqmbd.results import PolynomialChaos
        >>> from uqmbd.extend import labels
        >>> space = GermSpace.of(JointInput.of([uqmbd.RandomVariable("a", chaospy.Normal(3, 0.2), units="m/s")]))
        >>> axes = labels(["y"], ["a"], [0.0])
        >>> chaos = PolynomialChaos([[[1.0]], [[0.5]]], [[0], [1]], space, axes)  # 1 + 0.5 psi
        >>> chaos.density([1.0], "y", 0.0).round(2).tolist()  # 0.8 in theory: of the normal distribution
        [0.79]
        """
        where = (output_index(self.labels, output), *time_index(self.labels, time, needed=True))
        if self.std[where] <= 32 * np.finfo(float).eps * abs(self.mean[where]):
            raise StudyError(f"Output {output!r} does not vary there: it is {self.mean[where]:g} and has no density.")
        column = int(np.ravel_multi_index(where, self.labels.shape))
        drawn = self._sampler(spread_germs(self.space, samples, seed))
        return kernel_density(drawn.columns(slice(column, column + 1))[:, 0], values)

    def statistics(
        self, probabilities: Sequence[float] = DEFAULT_PROBABILITIES, *, samples: Count = FEWER, seed: Seed = 0
    ) -> xr.Dataset:
        """Build the dataset `statistics` of a propagator's node.

        Parameters
        ----------
        probabilities : sequence of float
            Of the quantiles.
        samples, seed : int
            As for :meth:`quantiles`.

        Returns
        -------
        xarray.Dataset
            As of :func:`uqmbd.extend.statistics_dataset`, with Sobol' indices of inputs where these are independent;
            else `sobol_first_germ` and `sobol_total_germ` (germ, output, time). With `verification_error` if it is
            known, and `circular_mean` and `circular_std` where an output is an angle. Skewness and kurtosis may be
            those of samples, and a surrogate of very many terms may allow fewer samples than requested. Then the
            attribute ``samples`` of the variable states their number, and its ``comment`` the reason.

        Examples
        --------
        >>> import chaospy, uqmbd
        >>> from uqmbd.randomness import GermSpace, JointInput
        >>> from uqmbd.results import PolynomialChaos
        >>> from uqmbd.extend import labels
        >>> space = GermSpace.of(JointInput.of([uqmbd.RandomVariable("a", chaospy.Normal(3, 0.2), units="m/s")]))
        >>> axes = labels(["y"], ["a"], [0.0])
        >>> chaos = PolynomialChaos([[[1.0]], [[0.5]]], [[0], [1]], space, axes)  # 1 + 0.5 psi
        >>> found = chaos.statistics(samples=256)
        >>> float(found["mean"].item()), float(found["std"].item())
        (1.0, 0.5)
        """
        independent = self.space.independent
        wanted, samples = samples, affordable(samples, len(self.multi_index), self.mean.size)
        values = {name: getattr(self, name) for name in ("mean", "std", "variance", "skewness", "kurtosis")}
        values |= {"probability": probabilities, **self.circular(samples=samples, seed=seed)}
        values["quantile"] = self.quantiles(probabilities, samples=samples, seed=seed)
        if independent:
            values |= {"sobol_first": self.sobol_first, "sobol_total": self.sobol_total}
        known = self.verification_germs is not None
        found = surrogate_statistics(
            self.labels,
            values,
            shape_samples=self.shape_samples,
            samples=samples,
            wanted=wanted,
            terms=len(self.multi_index),
            of_germs=None if independent else (self.germ_names, self.sobol_first_germ, self.sobol_total_germ),
            stated=(self.verification_error(), self.verification_factor()) if known else None,
        )
        reasons = self._why_unknown()
        return reasons_where_missing(found, reasons) if reasons else found

    def _why_unknown(self) -> dict[str, str]:
        """Return why statistics may be NaN at some times, by output; of most surrogates they are not."""
        return {}

    def to_xarray(
        self,
        *,
        samples: Annotated[int, Bounds(0, 10**9)] = 0,
        seed: Seed = 0,
        probabilities: Sequence[float] = DEFAULT_PROBABILITIES,
    ) -> xr.Dataset:
        """Return what is known of the outputs as labelled data.

        Parameters
        ----------
        samples : int
            Samples of the surrogate that are drawn besides; 0: none.
        seed : int
            Of these.
        probabilities : sequence of float
            Of the quantiles.

        Returns
        -------
        xarray.Dataset
            That of :meth:`statistics`: moments, quantiles, Sobol' indices, stated errors.  With samples also
            ``response`` (sample, output, time) and ``inputs`` (sample, input), as of :meth:`sample`.

        Examples
        --------
        >>> import chaospy, uqmbd
        >>> from uqmbd.randomness import GermSpace, JointInput
        >>> from uqmbd.results import PolynomialChaos
        >>> from uqmbd.extend import labels
        >>> space = GermSpace.of(JointInput.of([uqmbd.RandomVariable("k", chaospy.Normal(2, 0.5), units="N/m")]))
        >>> axes = labels([("x", "m")], [("k", "N/m")], [0.0])
        >>> found = PolynomialChaos([[[1.0]], [[0.25]]], [[0], [1]], space, axes).to_xarray(samples=4)
        >>> found["response"].sizes["sample"], found["sobol_total"].item(), found["std"].attrs["units"]
        (4, 1.0, 'm')
        """
        found = self.statistics(probabilities)
        if not samples:
            return found
        inputs, response = self.sample(samples, seed)
        drawn = {
            "response": (("sample", *self.labels.dims), response, {"long_name": "response"}),
            "inputs": (("sample", "input"), inputs, {"long_name": "value of the input"}),
        }
        return united(found.assign(drawn).assign_coords(self.labels.input_coords()))

    def verdicts(self, tolerance: Annotated[float, Bounds(0)] = 0.01) -> tuple[str, ...]:
        """Return a sentence for each output on the accuracy of the surrogate.

        By the stated error where there is verification data; what looks like a discontinuity is named. Else by the
        decay: whether the terms of the top order carry more than a part `tolerance` of the standard deviation, and
        from when on; a small part is no proof.

        Parameters
        ----------
        tolerance : float
            Of the error, or of the top order, relative to the standard deviation.

        Returns
        -------
        tuple of str, length O

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
        rows = zip(self.labels.outputs, errors, factors, self._suspicions(), strict=True)
        return tuple(
            f"{output.name}: {stated_words('surrogate', row, self.labels.times, tolerance, self._remedy)}"
            + factor_words(float(factor[np.nan_to_num(row, nan=-1.0).argmax()]), count)
            + suspicion
            for output, row, factor, suspicion in rows
        )

    def verification_error(self, output: str | None = None, time: float | None = None) -> Array:
        """Return the stated error: that of the surrogate at the verification realisations, over the standard deviation.

        The root mean square over the realisations, each by its weight: they lie in the tails more often than the inputs
        do, and count for less there.  Where the standard deviation is below 1 % of its maximum over time, 1 % of that
        maximum stands in for it. An output that does not vary in the chaos (as at order 0) has the error 1 where the
        realisations differ from its mean.  :meth:`verification_factor` says how well it is known.

        Parameters
        ----------
        output : str, optional
            Default: all.
        time : float, optional
            One of the times, in s. Default: all.

        Returns
        -------
        array, shape (O, T), without the axes that were chosen

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
        """Return by which factor the stated error may be off, shape (O, T): two standard errors, from the scatter.

        Where it exceeds 2, there are too few verification realisations for the error.  What none of them reaches it
        does not know.

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
        """Return the root mean square error (O, T) by the weighted verification realisations, in units of the outputs.

        NaN where the surrogate is not known.

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
        """Return the standard deviation (O, T) of the outputs by the weighted verification realisations.

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
        """Return for each output the first time (s) at which the stated error exceeds a limit; None: at none.

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
            raise StudyError("These outputs have no times, hence no horizon; see 'verification_error'.")
        first = [first_above(row, limit) for row in self._stated_error]
        names = (o.name for o in self.labels.outputs)
        times = self.labels.times
        return {n: None if k is None else float(times[k]) for n, k in zip(names, first, strict=True)}

    @cached_property
    def _stated_error(self) -> Array:
        """The stated error as (O, T), with T = 1 for outputs without times."""
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
        )

    @cached_property
    def _unseen(self) -> Array:
        """Root mean squares (O, T) of errors in thin layers that verification points miss: by faces of elements."""
        if len(self._boxes) < 2:
            return np.zeros(self.labels.shape)
        # the outermost of n Gauss nodes is about 1 / n^2 of the probability away from a face
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

    def _repr_html_(self) -> str | None:
        """Tables, for notebooks."""
        return html_of(self)

    def _suspicions(self) -> tuple[str, ...]:
        """Return sentences on possible causes of the stated error of each output."""
        return ("",) * len(self.labels.outputs)

    def _verdicts_of_decay(self, tolerance: float) -> tuple[str, ...]:
        """Return verdicts from the coefficients."""
        raise StudyError("This chaos has no verification realisations; give the propagator verify=16.")
