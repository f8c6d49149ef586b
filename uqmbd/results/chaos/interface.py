"""Provide the interface of surrogates of outputs.

Length: the module has a single class, whose methods have overloads for each kind of inputs, and examples.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Annotated, Any, overload

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike

from uqmbd.arguments import Bounds, Count, Seed, typechecked
from uqmbd.display import html_of
from uqmbd.errors import StudyError
from uqmbd.results.chaos.labelled import DERIVATIVE, VALUE, Named, labelled_array, points_of, surrogate_statistics
from uqmbd.results.chaos.sampling import affordable, kernel_density, quantiles_of_rows, random_germs, spread_germs
from uqmbd.results.chaos.surrogate_moments import FEWER
from uqmbd.results.chaos.verified import VerifiedSurrogate
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
"""Default number of surrogate samples for quantiles and densities."""


@typechecked
class Surrogate(VerifiedSurrogate):
    """Outputs as low-cost functions of the inputs, with statistics and stated errors.

    Elements contain coefficients, and `readout` computes outputs from the coefficients. Each public subclass defines
    only its parts and additional methods. Other modules use the subclasses as types and call their class methods.
    """

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
            Values of the inputs. A plain array has one column for each input, in order. The other types name the
            inputs. A mapping or a dataset contains numbers, lists of equal length, or xarray arrays. A DataArray has a
            dimension ``input``.
        **values
            Alternatively, inputs by name. xarray arrays with different dimensions are broadcast: all combinations are
            evaluated.

        Returns
        -------
        array, shape (K, O, T), or xarray.DataArray
            Outputs in their units, as an array for a plain array. Other inputs give a labelled array with the
            dimensions of the inputs, ``output`` and ``time``. Lists and unnamed rows have the dimension ``point``;
            single numbers have none. `uqmbd.results.output` selects one output, with its unit.

        Raises
        ------
        StudyError
            If an input is outside its distribution, missing or unknown, or has another unit.

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
        """Return partial derivatives with respect to the inputs.

        Parameters
        ----------
        inputs, **values
            Inputs as for :meth:`evaluate`.

        Returns
        -------
        array, shape (K, d, O, T), or xarray.DataArray
            Derivatives in units of the output per unit of the input. A labelled array has the dimension ``input``
            before ``output``. Each element is differentiated separately. At an edge between elements, the derivative is
            taken in the element that contains the point; it ignores jumps between elements. If outputs jump at a
            marker, the derivative is taken in the segment that contains the time; after the last marker it is NaN. An
            integer input is differentiated as a continuous variable. The derivative is NaN or infinite if one input
            value belongs to many germs, such as at the ends of a tabulated distribution.

        Raises
        ------
        StudyError
            In the cases of :meth:`evaluate`.

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
        """Evaluate a function of points (K, d) at inputs; label the values if the inputs have names."""
        points = points_of(inputs, values, self.labels.inputs)
        if points is None:
            name = next((x.name for x in self.labels.inputs), "input")
            shape = f"(points, {len(self.labels.inputs)})"
            expected = f"expected real numbers in an array {shape}, or by name: {name}=0.5"
            return of(real_numbers("inputs", inputs, expected=expected))
        return labelled_array(of(points.values), points, self.labels, about)

    def sample(self, count: Annotated[int, Bounds(0, 10**9)], seed: Seed) -> tuple[Array, Array]:
        """Draw K independent samples of the inputs from their distribution, and evaluate the outputs at the samples.

        Parameters
        ----------
        count : int
            Number of samples, K.
        seed : int
            Seed of the random numbers.

        Returns
        -------
        inputs : array, shape (K, d)
            Inputs in their units.
        outputs : array, shape (K, O, T)
            Outputs in their units.

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
        """Estimate quantiles (N, O, T) from samples of the surrogate.

        The samples are K points of a scrambled Sobol' sequence of the germs; K is `samples`, rounded up to a power of
        two. Outputs and times are processed in blocks, so that memory does not grow with their number. For one germ,
        the probability of a returned quantile differs from the requested one by less than 2 / K. For several germs,
        this probability has a random error. The standard deviation of this error is at most about the value for
        independent samples, sqrt(p (1 - p) / K), and mostly far less.

        Parameters
        ----------
        probabilities : sequence of float, length N
            Probabilities from 0 to 1.
        samples, seed : int
            Number of surrogate samples, and their seed.

        Returns
        -------
        array, shape (N, O, T)
            Quantiles in the units of the outputs.

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
        if germs.shape[1] == 1:
            germs = np.sort(germs, axis=0)  # samples are then nearly sorted, and counting is faster
        drawn, columns = self._sampler(germs).rows, int(np.prod(self.labels.shape))
        found = quantiles_of_rows(drawn, len(germs), columns, probabilities)
        return found.reshape(len(found), *self.labels.shape)

    def circular(self, *, samples: Count = SAMPLES, seed: Seed = 0) -> dict[str, Array]:
        """Estimate `circular_mean` and `circular_std`, (O, T), of angular outputs from surrogate samples.

        Other outputs have NaN. If no output is an angle, the result is empty. The samples are the same as for
        :meth:`quantiles`.

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
            Values of the output, in its units.
        output : str
            Name of the output.
        time : float, optional
            One of the times, in s.
        samples, seed : int
            As for :meth:`quantiles`.

        Returns
        -------
        array, shape (N,)
            Density, in 1 / units of the output.

        Raises
        ------
        StudyError
            If output or time are unknown, or the output does not vary at this time.

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
            raise StudyError(
                f"Output {output!r} is constant at this time ({self.mean[where]:g}), so it has no density."
            )
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
            Probabilities of the quantiles.
        samples, seed : int
            As for :meth:`quantiles`.

        Returns
        -------
        xarray.Dataset
            Dataset as from :func:`uqmbd.extend.statistics_dataset`, with Sobol' indices of independent inputs. For
            dependent inputs it has `sobol_first_germ` and `sobol_total_germ` (germ, output, time). The dataset contains
            `verification_error` if this error is known, and `circular_mean` and `circular_std` if an output is an
            angle. An aligned surrogate has moments from samples of the surrogate; `std_error_mean` and `std_error_std`
            are their sampling errors. Skewness and kurtosis may be estimated from samples, and a surrogate of very many
            terms may allow fewer samples than requested. The attribute ``samples`` of the variable then states the
            number of samples, and its ``comment`` the reason.

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
        requested, samples = samples, affordable(samples, len(self.multi_index), self.mean.size)
        values = {name: getattr(self, name) for name in ("mean", "std", "variance", "skewness", "kurtosis")}
        values |= {"probability": probabilities, **self.circular(samples=samples, seed=seed)}
        values["quantile"] = self.quantiles(probabilities, samples=samples, seed=seed)
        if independent:
            values |= {"sobol_first": self.sobol_first, "sobol_total": self.sobol_total}
        if self._moments.sampling_errors is not None:
            values["std_error_mean"], values["std_error_std"] = self._moments.sampling_errors
        known = self.verification_germs is not None
        found = surrogate_statistics(
            self.labels,
            values,
            shape_samples=self.shape_samples,
            samples=samples,
            requested=requested,
            terms=len(self.multi_index),
            of_germs=None if independent else (self.germ_names, self.sobol_first_germ, self.sobol_total_germ),
            stated=(self.verification_error(), self.verification_factor()) if known else None,
        )
        reasons = self._why_unknown()
        return reasons_where_missing(found, reasons) if reasons else found

    def _why_unknown(self) -> dict[str, str]:
        """Return reasons why statistics may be NaN at some times, by output; empty for most surrogates."""
        return {}

    def to_xarray(
        self,
        *,
        samples: Annotated[int, Bounds(0, 10**9)] = 0,
        seed: Seed = 0,
        probabilities: Sequence[float] = DEFAULT_PROBABILITIES,
    ) -> xr.Dataset:
        """Return the known statistics of the outputs as labelled data.

        Parameters
        ----------
        samples : int
            Number of additional samples of the surrogate; 0: none.
        seed : int
            Seed of these samples.
        probabilities : sequence of float
            Probabilities of the quantiles.

        Returns
        -------
        xarray.Dataset
            Dataset of :meth:`statistics`: moments, quantiles, Sobol' indices, stated errors. With samples, it also has
            ``response`` (sample, output, time) and ``inputs`` (sample, input), as from :meth:`sample`.

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

    def _repr_html_(self) -> str | None:
        """Return HTML tables for notebooks."""
        return html_of(self)
