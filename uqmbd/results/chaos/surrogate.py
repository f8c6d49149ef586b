"""What a surrogate of outputs does, whether it is one polynomial chaos or one for each element of the germ space."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike

from uqmbd.display import html_of
from uqmbd.errors import StudyError
from uqmbd.results.chaos.sampling import affordable, kernel_density, random_germs, spread_germs
from uqmbd.results.chaos.stated_error import first_above
from uqmbd.results.schema import DEFAULT_PROBABILITIES, Labels, fixed_width, statistics_dataset
from uqmbd.typing import Array

if TYPE_CHECKING:
    from uqmbd.randomness import GermSpace

__all__ = ["FEWER", "SAMPLES", "ChaosInterface"]


SAMPLES = 16384
"""Samples of the surrogate for quantiles and densities, unless another number is given."""

FEWER = 8192
"""The same for quantiles of all outputs at all times together."""


class ChaosInterface:
    """What :class:`uqmbd.results.PolynomialChaos` and :class:`uqmbd.results.PiecewiseChaos` have in common."""

    if TYPE_CHECKING:
        labels: Labels

        @property
        def space(self) -> GermSpace:
            """The germs, their polynomials, and the map between germs and inputs."""

        @property
        def verification_germs(self) -> Array | None:
            """Germ points (V, d) that did not enter the coefficients."""

        @property
        def mean(self) -> Array:
            """Expectation, shape (O, T)."""

        @property
        def std(self) -> Array:
            """Standard deviation, shape (O, T)."""

        @property
        def variance(self) -> Array:
            """Variance, shape (O, T)."""

        @property
        def skewness(self) -> Array:
            """Third standardised moment, shape (O, T)."""

        @property
        def kurtosis(self) -> Array:
            """Fourth standardised moment, shape (O, T)."""

        @property
        def shape_samples(self) -> int:
            """Samples of the surrogate from which skewness and kurtosis are; 0: they are exact."""

        @property
        def sobol_first_germ(self) -> Array:
            """First-order indices, shape (germ, O, T)."""

        @property
        def sobol_total_germ(self) -> Array:
            """Total indices, shape (germ, O, T)."""

        def evaluate_germs(self, germs: ArrayLike) -> Array:
            """Evaluate at germ points (K, d): (K, O, T)."""

        def quantiles(
            self, probabilities: Sequence[float] = DEFAULT_PROBABILITIES, *, samples: int = SAMPLES, seed: int = 0
        ) -> Array:
            """Return quantiles (N, O, T)."""

        def circular(self, *, samples: int = SAMPLES, seed: int = 0) -> dict[str, Array]:
            """Return statistics of directions, (O, T)."""

        def _stated_error(self) -> Array:
            """Return the stated error as (O, T)."""

        def _column(self, germs: Array, where: tuple[int, ...]) -> Array:
            """Evaluate one output at one time at germ points (K, d): (K,)."""

    @property
    def germ_names(self) -> tuple[str, ...]:
        """Names of the germs: those of the inputs where these are independent."""
        return tuple(self.space.names)

    @cached_property
    def sobol_first(self) -> Array:
        """First-order Sobol' indices, shape (input, O, T): the share of the variance that one input alone explains."""
        return self._by_input("sobol_first")

    @cached_property
    def sobol_total(self) -> Array:
        """Total Sobol' indices, shape (input, O, T): the share of the variance that vanishes with an input."""
        return self._by_input("sobol_total")

    @cached_property
    def sobol_second(self) -> Array:
        """Sobol' indices of pairs, shape (input, input, O, T): symmetric, 0 on the diagonal."""
        return self._by_input("sobol_second")

    def evaluate(self, inputs: ArrayLike) -> Array:
        """Evaluate at inputs (K, d), in their units: (K, O, T), in the units of the outputs.

        Raises
        ------
        StudyError
            If an input lies outside its distribution.
        """
        return self.evaluate_germs(self.space.to_germs(np.asarray(inputs, dtype=float)))

    def sample(self, count: int, seed: int) -> tuple[Array, Array]:
        """Draw inputs (K, d) as they are distributed, independently, and evaluate at them: (K, O, T)."""
        germs = random_germs(self.space, count, seed)
        return np.asarray(self.space.to_inputs(germs), dtype=float), self.evaluate_germs(germs)

    def density(
        self, values: ArrayLike, output: str, time: float | None = None, *, samples: int = SAMPLES, seed: int = 0
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
        """
        where = (self._output(output), *self._time(time, needed=True))
        if self.std[where] <= 32 * np.finfo(float).eps * abs(self.mean[where]):
            raise StudyError(f"Output {output!r} does not vary there: it is {self.mean[where]:g} and has no density.")
        germs = spread_germs(self.space, samples, seed)
        return kernel_density(self._column(germs, where), values)

    def statistics(
        self, probabilities: Sequence[float] = DEFAULT_PROBABILITIES, *, samples: int = FEWER, seed: int = 0
    ) -> xr.Dataset:
        """Build the dataset `statistics` of a propagator's node.

        Returns
        -------
        xarray.Dataset
            As of :func:`uqmbd.results.statistics_dataset`, with Sobol' indices of inputs where these are independent;
            else `sobol_first_germ` and `sobol_total_germ` (germ, output, time). With `verification_error` if it is
            known, and `circular_mean` and `circular_std` where an output is an angle.  Where skewness and kurtosis are
            those of samples, or a surrogate of very many terms allows fewer samples than are asked for, the attribute
            ``samples`` of the variable says how many there are, and its ``comment`` why.
        """
        independent = self.space.independent
        wanted, samples = samples, affordable(samples, self._terms, self.mean.size)
        found = statistics_dataset(
            self.labels,
            mean=self.mean,
            std=self.std,
            variance=self.variance,
            skewness=self.skewness,
            kurtosis=self.kurtosis,
            quantile=self.quantiles(probabilities, samples=samples, seed=seed),
            probability=probabilities,
            sobol_first=self.sobol_first if independent else None,
            sobol_total=self.sobol_total if independent else None,
            **self.circular(samples=samples, seed=seed),
        )
        if self.shape_samples:
            for name in ("skewness", "kurtosis"):
                found[name].attrs |= {
                    "samples": self.shape_samples,
                    "comment": f"{found[name].attrs['comment']}; of {self.shape_samples} samples of the surrogate",
                }
        if samples < wanted:
            found["quantile"].attrs |= {
                "samples": samples,
                "comment": f"of {samples} samples of the surrogate: its {self._terms} terms allow no more",
            }
        if not independent:
            note = {"comment": "of germs: inputs depend on one another, so no share belongs to an input"}
            dims = ("germ", *self.labels.dims)
            found = found.assign(
                sobol_first_germ=(dims, self.sobol_first_germ, {"long_name": "first-order Sobol' index"} | note),
                sobol_total_germ=(dims, self.sobol_total_germ, {"long_name": "total Sobol' index"} | note),
            ).assign_coords(germ=("germ", fixed_width(self.germ_names)))
        if self.verification_germs is not None:
            note = {"long_name": "stated error of the surrogate, over the standard deviation"}
            found = found.assign(verification_error=(self.labels.dims, self.verification_error(), note))
        return found

    def verification_error(self, output: str | None = None, time: float | None = None) -> Array:
        """Return the stated error: that of the surrogate at the verification realisations, over the standard deviation.

        The root mean square over the realisations; where the standard deviation is below 1 % of its maximum over
        time, 1 % of that maximum stands in for it. An output that does not vary in the chaos (as at order 0) has the
        error 1 where the realisations differ from its mean.

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
        """
        found = self._stated_error().reshape(self.labels.shape)
        row = slice(None) if output is None else self._output(output)
        return np.asarray(found[(row, *self._time(time))])

    def horizon(self, limit: float = 0.01) -> dict[str, float | None]:
        """Return for each output the first time (s) at which the stated error exceeds a limit; None: at none."""
        if self.labels.times is None:
            raise StudyError("These outputs have no times, hence no horizon; see 'verification_error'.")
        first = [first_above(row, limit) for row in self._stated_error()]
        names = (o.name for o in self.labels.outputs)
        times = self.labels.times
        return {n: None if k is None else float(times[k]) for n, k in zip(names, first, strict=True)}

    def _repr_html_(self) -> str | None:
        """Tables, for notebooks."""
        return html_of(self)

    @property
    def _terms(self) -> int:
        """Terms that are evaluated for a sample."""
        return len(getattr(self, "multi_index", ()))

    def _by_input(self, name: str) -> Array:
        if not self.space.independent:
            raise StudyError(
                f"'{name}' has no meaning here: inputs depend on one another, so that shares of the variance belong to "
                f"the germs {', '.join(self.germ_names)}. Use '{name}_germ', in that order."
            )
        found: Array = getattr(self, f"{name}_germ")
        return found

    def _columns(self, names: tuple[str, ...]) -> list[int]:
        known = self.germ_names
        for k, name in enumerate(names):
            if name not in known or name in names[:k]:
                raise StudyError(f"Different germs are expected, of {', '.join(known)}; {', '.join(names)} was given.")
        if not names:
            raise StudyError(f"At least one germ is expected, of {', '.join(known)}; none was given.")
        return [known.index(name) for name in names]

    def _output(self, name: str) -> int:
        names = [o.name for o in self.labels.outputs]
        if name not in names:
            raise StudyError(f"There is no output {name!r}; there are {', '.join(names)}.")
        return names.index(name)

    def _time(self, time: float | None, *, needed: bool = False) -> tuple[int, ...]:
        """Return the index of a time, or nothing where none is asked for."""
        times = self.labels.times
        if times is None:
            if time is not None:
                raise StudyError(f"These outputs have no times; time = {time!r} was given.")
            return ()
        if time is None:
            if needed:
                raise StudyError(f"A time is needed, from {times[0]:g} s to {times[-1]:g} s.")
            return ()
        nearest = int(np.abs(times - time).argmin())
        if abs(times[nearest] - time) > 1e-9 * max(1.0, abs(float(times[-1] - times[0]))):
            raise StudyError(f"Time {time!r} s is none of the times; the nearest is {times[nearest]:g} s.")
        return (nearest,)
