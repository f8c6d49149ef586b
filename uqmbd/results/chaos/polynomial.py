"""Polynomial chaos: outputs as sums of orthonormal polynomials of the germs, with what their coefficients tell.

Length: it is one class, whose public methods have examples.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
import xarray as xr

from uqmbd.errors import StudyError
from uqmbd.results.chaos.boxes import checked_weights
from uqmbd.results.chaos.decay import (
    decay_dataset,
    energy_of_germs,
    energy_of_orders,
    top_order,
    verdict_of_decay,
)
from uqmbd.results.chaos.discontinuity import Discontinuity, find_discontinuities
from uqmbd.results.chaos.interface import FEWER, Samples, Surrogate, frozen
from uqmbd.results.chaos.sampling import affordable, basis_derivatives, basis_values, sampled_shape
from uqmbd.results.chaos.storage import chaos_arguments, chaos_dataset
from uqmbd.results.chaos.terms import (
    first_order_masks,
    interaction_mask,
    second_order_masks,
    shape_route,
    skewness_kurtosis,
    standard_deviation,
    total_order_masks,
    variance_shares,
)
from uqmbd.results.schema import Labels, check_shape
from uqmbd.threads import one_thread
from uqmbd.typing import Array, Index, Mask

if TYPE_CHECKING:
    from uqmbd.randomness import GermSpace

__all__ = ["PolynomialChaos"]


@dataclass(frozen=True, eq=False, repr=False)
class PolynomialChaos(Surrogate):
    r"""Outputs as a sum of orthonormal polynomials of standard random variables (germs), one sum per output and time.

    Mean, variance, skewness, kurtosis and Sobol' indices come straight from the coefficients; quantiles and densities
    come from samples of the surrogate, which cost no run of the mechanism. It never changes.

    *Independent inputs*: germ k belongs to input k, and ``sobol_first``, ``sobol_total``, ``sobol_second`` are
    indices of inputs. *Dependent inputs*: a germ as "b | a" stands for what b adds once a is known, so the shares of
    the variance depend on the order of the inputs and belong to no input. Then those three raise an error,
    ``sobol_first_germ``, ``sobol_total_germ`` and ``sobol_second_germ`` give the indices of the germs (in the order of
    ``germ_names``), and the dataset of statistics has them under these names, with a dimension ``germ``. An output
    that does not vary, or by rounding of its mean only, has the indices 0, the skewness 0 and the kurtosis 3.

    *Memory* beyond the coefficients, P x O x T x 8 bytes: some 20 MB for each of variance, indices, and skewness with
    kurtosis, which go block by block over outputs and times. For many inputs the last need a table of products of
    polynomials, 140 bytes for each while it is made: 10 inputs of order 3 (286 terms, 67,000 products for normal
    inputs) 9 MB, 20 inputs of order 3 (1771 terms, 2.2 million products) 310 MB; instead of more than 5 million
    products samples of the surrogate are taken. Quantiles take P x 8 bytes for each sample, and 65 MB.

    Parameters
    ----------
    coefficients : array, shape (P, O, T), or (P, O) if the labels have no times
        In the units of the outputs.
    multi_index : array of int, shape (P, d)
        Degree of each polynomial in each germ; row 0, the mean, is all zeros.
    space : uqmbd.randomness.GermSpace
        The d germs, their polynomials, and the map between germs and inputs.
    labels : Labels
        Meaning of the axes.
    verification_germs : array, shape (V, d), optional
        Germ points that did not enter the coefficients.
    verification_response : array, shape (V, O, T), optional
        What the mechanism did there; with it the chaos tells its own error.
    verification_weights : array, shape (V,), optional
        What each counts, where they are not spread like the inputs; default: all the same.  They are made to sum to 1.

    Raises
    ------
    StudyError
        If shapes or names do not fit, a number is not finite, or a term is missing its meaning.

    References
    ----------
    B. Sudret, Reliability Engineering and System Safety 93 (2008) 964-979 (indices from coefficients);
    O. P. Le Maitre and O. M. Knio, Spectral Methods for Uncertainty Quantification, Springer, 2010.

    Examples
    --------
    >>> import chaospy, numpy as np, uqmbd
    >>> from uqmbd.randomness import GermSpace
    >>> from uqmbd.randomness.joint import JointInput
    >>> from uqmbd.extend import labels
    >>> length = uqmbd.RandomVariable("length", chaospy.Normal(0.15, 0.003), units="m")
    >>> space = GermSpace.of(JointInput.of([length]))
    >>> axes = labels([("x", "m")], [("length", "m")], [0.0, 0.5])
    >>> chaos = PolynomialChaos([[[2.0, 2.0]], [[0.0, 0.4]], [[0.0, 0.3]]], [[0], [1], [2]], space, axes)
    >>> chaos.std.tolist(), chaos.sobol_first.round(3).tolist()
    ([[0.0, 0.5]], [[[0.0, 1.0]]])
    >>> chaos.evaluate([[0.153]])[0].round(3).tolist()
    [[2.0, 2.4]]
    """

    coefficients: Array
    multi_index: Index
    space: GermSpace
    labels: Labels
    verification_germs: Array | None = None
    verification_response: Array | None = None
    verification_weights: Array | None = None

    def __post_init__(self) -> None:
        """Check shapes and numbers, and keep copies that nobody can change."""
        self._set("coefficients", np.array(self.coefficients, dtype=float))
        self._set("multi_index", _whole(self.multi_index))
        names, terms = tuple(i.name for i in self.labels.inputs), len(self.multi_index)
        if names != tuple(self.space.inputs):
            raise StudyError(
                f"Labels and germ space must have the same inputs; {names} and {self.space.inputs} differ."
            )
        if not names:
            raise StudyError("A chaos needs at least one input; there is none.")
        check_shape("coefficients", self.coefficients, (terms, *self.labels.shape), ("term", *self.labels.dims))
        check_shape("multi_index", self.multi_index, (terms, len(names)), ("term", "input"))
        if np.any(self.multi_index < 0) or np.any(self.multi_index[:1] != 0) or not terms:
            raise StudyError("'multi_index' must hold degrees, none negative, and start with the mean, a row of zeros.")
        if len(np.unique(self.multi_index, axis=0)) < terms:
            raise StudyError("'multi_index' must not hold a term twice.")
        _check_finite("coefficients", self.coefficients)
        if (self.verification_germs is None) != (self.verification_response is None):
            raise StudyError(
                "'verification_germs' and 'verification_response' belong together; one of them is missing."
            )
        if self.verification_germs is not None:
            self._set("verification_germs", np.array(self.verification_germs, dtype=float))
            self._set("verification_response", np.array(self.verification_response, dtype=float))
            count = len(self.verification_germs) if self.verification_germs.ndim else 0
            if not count:
                raise StudyError("Verification needs at least one realisation; leave both arrays out if there is none.")
            for name, shape, dims in (
                ("verification_germs", (count, len(names)), ("verification", "germ")),
                ("verification_response", (count, *self.labels.shape), ("verification", *self.labels.dims)),
            ):
                check_shape(name, getattr(self, name), shape, dims)
                _check_finite(name, getattr(self, name))
        object.__setattr__(
            self, "verification_weights", checked_weights(self.verification_weights, self.verification_germs)
        )

    def __repr__(self) -> str:
        sizes = zip(("terms", *self.labels.dims), self.coefficients.shape, strict=True)
        axes = ", ".join(f"{name}: {size}" for name, size in sizes)
        top = int(self.multi_index.max())
        return f"<{type(self).__name__} of {', '.join(self.germ_names)} up to degree {top} ({axes})>"

    @cached_property
    def mean(self) -> Array:
        """Expectation, shape (O, T), in the units of the outputs."""
        return np.asarray(self.coefficients[0])

    @cached_property
    def std(self) -> Array:
        """Standard deviation, shape (O, T), in the units of the outputs."""
        return self._shaped(standard_deviation(self._flat))

    @cached_property
    def shape_samples(self) -> int:
        """Samples of the surrogate from which skewness and kurtosis are; 0: they are exact."""
        exact = self._shape_route != "samples"
        return 0 if exact else affordable(FEWER, len(self.multi_index), self._flat.shape[1])

    @cached_property
    def sobol_first_germ(self) -> Array:
        """First-order Sobol' indices of the germs, shape (germ, O, T), in the order of :attr:`germ_names`."""
        return self._shares(first_order_masks(self.multi_index))

    @cached_property
    def sobol_total_germ(self) -> Array:
        """Total Sobol' indices of the germs, shape (germ, O, T)."""
        return self._shares(total_order_masks(self.multi_index))

    @cached_property
    def sobol_second_germ(self) -> Array:
        """Sobol' indices of pairs of germs, shape (germ, germ, O, T): symmetric, 0 on the diagonal."""
        count = len(self.germ_names)
        rows, columns = np.triu_indices(count, 1)
        found = np.zeros((count, count, *self.labels.shape))
        found[rows, columns] = found[columns, rows] = self._shares(second_order_masks(self.multi_index))
        return frozen(found)

    def sobol_interaction(self, *names: str) -> Array:
        """Return the Sobol' index of an interaction: the share of the variance that needs all these germs together.

        Parameters
        ----------
        *names : str
            Of different germs (:attr:`germ_names`; of inputs where these are independent). One alone: its first-order
            index.

        Returns
        -------
        array, shape (O, T)

        Raises
        ------
        StudyError
            If a name is unknown or given twice, or there is none.

        Examples
        --------
        >>> import chaospy
        >>> import uqmbd
        >>> from uqmbd.results import PolynomialChaos
        >>> from uqmbd.extend import labels
        >>> a = uqmbd.RandomVariable("a", chaospy.Uniform(-1, 1))
        >>> b = uqmbd.RandomVariable("b", chaospy.Uniform(-1, 1))
        >>> mechanism = uqmbd.Mechanism("inputs", uqmbd.Line())
        >>> mechanism.output("sum", a + b)
        >>> space, axes = uqmbd.extend.GermSpace.of(mechanism.inputs), labels(["y"], ["a", "b"], [0.0])
        >>> chaos = PolynomialChaos([[[1.0]], [[0.3]], [[0.4]], [[1.2]]], [[0, 0], [1, 0], [0, 1], [1, 1]], space, axes)
        >>> chaos.sobol_interaction("a", "b").round(4).tolist()  # 1.44 / 1.69
        [[0.8521]]
        """
        return np.asarray(self._shares(interaction_mask(self.multi_index, self._columns(names))[None])[0])

    def marginal(self, *names: str) -> PolynomialChaos:
        """Return the chaos of the expectation of the outputs given some germs: only their terms are kept.

        Where inputs are independent the names are theirs. The result takes the same inputs as this one, and does not
        depend on the others. It has no verification: that was of the whole.

        Raises
        ------
        StudyError
            If a name is unknown or given twice, or there is none.

        Examples
        --------
        >>> import chaospy
        >>> import uqmbd
        >>> from uqmbd.results import PolynomialChaos
        >>> from uqmbd.extend import labels
        >>> a = uqmbd.RandomVariable("a", chaospy.Uniform(-1, 1))
        >>> b = uqmbd.RandomVariable("b", chaospy.Uniform(-1, 1))
        >>> mechanism = uqmbd.Mechanism("inputs", uqmbd.Line())
        >>> mechanism.output("sum", a + b)
        >>> space, axes = uqmbd.extend.GermSpace.of(mechanism.inputs), labels(["y"], ["a", "b"], [0.0])
        >>> chaos = PolynomialChaos([[[1.0]], [[0.3]], [[0.4]], [[0.0]]], [[0, 0], [1, 0], [0, 1], [1, 1]], space, axes)
        >>> alone = chaos.marginal("a")
        >>> alone.std.tolist(), alone.labels.inputs[0].name
        ([[0.3]], 'a')
        """
        others = np.delete(self.multi_index, self._columns(names), axis=1)
        kept = ~np.any(others > 0, axis=1)
        return PolynomialChaos(self.coefficients[kept], self.multi_index[kept], self.space, self.labels)

    @property
    def top_energy(self) -> Array:
        """Sum of squared coefficients (O, T) of the terms of the top order: what the next order would add, or more."""
        _, edge = top_order(self.multi_index)
        return np.asarray(np.sum(self.coefficients[edge] ** 2, axis=0))

    @property
    def top_energy_germ(self) -> Array:
        """Parts of :attr:`top_energy` by germ (d, O, T): a term counts by its degrees."""
        _, edge = top_order(self.multi_index)
        degrees = self.multi_index[edge] / np.maximum(self.multi_index[edge].sum(axis=1, keepdims=True), 1)
        found: Array = np.einsum("pd,p...->d...", degrees, self.coefficients[edge] ** 2)
        return found

    @property
    def variance_germ(self) -> Array:
        """Parts of the variance by germ (d, O, T): a term counts by its degrees."""
        degrees = self.multi_index / np.maximum(self.multi_index.sum(axis=1, keepdims=True), 1)
        found: Array = np.einsum("pd,p...->d...", degrees, self.coefficients**2)
        return found

    def decay(self) -> xr.Dataset:
        """Build a dataset of how the coefficients fall with the order.

        Returns
        -------
        xarray.Dataset
            `energy` (order, output, time), the sum of squared coefficients of each total degree, and `energy_germ`
            (germ, degree, output, time), that of each degree in a germ, both in squared units; `rate` (output, time),
            by how many decades the remaining standard deviation falls with each order (NaN: cannot be told).

        Examples
        --------
        >>> import chaospy
        >>> import uqmbd
        >>> from uqmbd.results import PolynomialChaos
        >>> from uqmbd.extend import labels
        >>> a = uqmbd.RandomVariable("a", chaospy.Uniform(-1, 1))
        >>> b = uqmbd.RandomVariable("b", chaospy.Uniform(-1, 1))
        >>> mechanism = uqmbd.Mechanism("inputs", uqmbd.Line())
        >>> mechanism.output("sum", a + b)
        >>> space, axes = uqmbd.extend.GermSpace.of(mechanism.inputs), labels(["y"], ["a", "b"], [0.0])
        >>> chaos = PolynomialChaos([[[1.0]], [[0.3]], [[0.4]], [[0.0]]], [[0, 0], [1, 0], [0, 1], [1, 1]], space, axes)
        >>> found = chaos.decay()
        >>> sorted(found.data_vars)
        ['energy', 'energy_germ', 'rate']
        """
        return decay_dataset(
            self.labels,
            self.germ_names,
            energy_of_orders(self.coefficients, self.multi_index),
            energy_of_germs(self.coefficients, self.multi_index),
            self._constant,
            energy_note="sum of squared coefficients",
            rate_note="decades of the remaining standard deviation per order, fitted by least squares",
        )

    def discontinuities(self) -> tuple[Discontinuity | None, ...]:
        """Suspect each output of a discontinuity or a kink in the germ space, or not (None).

        Suspicious is a stated error of more than 5 % together with coefficients that hardly fall with the order; each
        suspicion names the time and the input. Without verification realisations there is none.

        Returns
        -------
        tuple of Discontinuity or None, length O

        Examples
        --------
        >>> import chaospy
        >>> import uqmbd
        >>> from uqmbd.results import PolynomialChaos
        >>> from uqmbd.extend import labels
        >>> a = uqmbd.RandomVariable("a", chaospy.Uniform(-1, 1))
        >>> b = uqmbd.RandomVariable("b", chaospy.Uniform(-1, 1))
        >>> mechanism = uqmbd.Mechanism("inputs", uqmbd.Line())
        >>> mechanism.output("sum", a + b)
        >>> space, axes = uqmbd.extend.GermSpace.of(mechanism.inputs), labels(["y"], ["a", "b"], [0.0])
        >>> chaos = PolynomialChaos([[[1.0]], [[0.3]], [[0.4]], [[0.0]]], [[0, 0], [1, 0], [0, 1], [1, 1]], space, axes)
        >>> chaos.discontinuities()  # none is suspected
        (None,)
        """
        if self.verification_germs is None:
            return (None,) * len(self.labels.outputs)
        return find_discontinuities(
            self,
            self._stated_error,
            energy_of_orders(self.coefficients, self.multi_index),
            self.top_energy_germ,
            int(self.multi_index.max(initial=0)),
        )

    def to_dataset(self) -> xr.Dataset:
        """Build the dataset `chaos` of a propagator's node; see :meth:`from_dataset`.

        Examples
        --------
        >>> import chaospy
        >>> import uqmbd
        >>> from uqmbd.results import PolynomialChaos
        >>> from uqmbd.extend import labels
        >>> a = uqmbd.RandomVariable("a", chaospy.Uniform(-1, 1))
        >>> b = uqmbd.RandomVariable("b", chaospy.Uniform(-1, 1))
        >>> mechanism = uqmbd.Mechanism("inputs", uqmbd.Line())
        >>> mechanism.output("sum", a + b)
        >>> space, axes = uqmbd.extend.GermSpace.of(mechanism.inputs), labels(["y"], ["a", "b"], [0.0])
        >>> chaos = PolynomialChaos([[[1.0]], [[0.3]], [[0.4]], [[0.0]]], [[0, 0], [1, 0], [0, 1], [1, 1]], space, axes)
        >>> chaos.to_dataset()["coefficients"].sizes["term"]
        4
        """
        return chaos_dataset(self, self.coefficients)

    def to_chaospy(self) -> Any:
        """Return it as a polynomial of chaospy, e.g. for ``chaospy.E``.

        Returns
        -------
        numpoly.ndpoly
            Of the shape (O, T), in the units of the outputs.  Its variables ``q0``, ``q1``, ... are the germs in the
            order of :attr:`germ_names`, not the inputs: ``chaos.space.to_germs(inputs)`` are their values.  Germs of
            normal inputs are standard normal, those of uniform ones uniform on [-1, 1].

        Notes
        -----
        Sums of powers lose digits where the degree is high: as many as the largest summand is larger than the value.

        Examples
        --------
        >>> import chaospy, uqmbd
        >>> from uqmbd.randomness import GermSpace, JointInput
        >>> from uqmbd.extend import labels
        >>> space = GermSpace.of(JointInput.of([uqmbd.RandomVariable("k", chaospy.Normal(10, 2))]))
        >>> chaos = PolynomialChaos([[[1.0]], [[0.5]]], [[0], [1]], space, labels(["x"], ["k"], [0.0]))
        >>> chaos.to_chaospy()
        polynomial([[0.5*q0+1.0]])
        """
        from uqmbd.randomness import as_numpoly

        return as_numpoly(self.space.germs, self.multi_index, self.coefficients)

    @classmethod
    def from_dataset(cls, dataset: xr.Dataset | xr.DataTree) -> PolynomialChaos:
        """Make a chaos from the dataset `chaos` of a result, without the mechanism.

        Raises
        ------
        StudyError
            If it is no such dataset.

        Examples
        --------
        >>> import chaospy
        >>> import uqmbd
        >>> from uqmbd.results import PolynomialChaos
        >>> from uqmbd.extend import labels
        >>> a = uqmbd.RandomVariable("a", chaospy.Uniform(-1, 1))
        >>> b = uqmbd.RandomVariable("b", chaospy.Uniform(-1, 1))
        >>> mechanism = uqmbd.Mechanism("inputs", uqmbd.Line())
        >>> mechanism.output("sum", a + b)
        >>> space, axes = uqmbd.extend.GermSpace.of(mechanism.inputs), labels(["y"], ["a", "b"], [0.0])
        >>> chaos = PolynomialChaos([[[1.0]], [[0.3]], [[0.4]], [[0.0]]], [[0, 0], [1, 0], [0, 1], [1, 1]], space, axes)
        >>> again = PolynomialChaos.from_dataset(chaos.to_dataset())
        >>> bool((again.coefficients == chaos.coefficients).all())
        True
        """
        return cls(**chaos_arguments(dataset))

    def _evaluate(self, germs: Array) -> Array:
        with one_thread():
            found: Array = basis_values(self.space, germs, self.multi_index) @ self._flat
        return found.reshape(len(germs), *self.labels.shape)

    def _derivative(self, germs: Array, germ: int) -> Array:
        with one_thread():
            found: Array = basis_derivatives(self.space, germs, self.multi_index, germ) @ self._flat
        return found.reshape(len(germs), *self.labels.shape)

    def _sampler(self, germs: Array) -> Samples:
        basis, flat = basis_values(self.space, germs, self.multi_index), self._flat
        return Samples(
            lambda part: np.asarray(basis @ flat[:, part]),
            lambda part: np.asarray(np.ascontiguousarray(flat[:, part].T) @ basis.T),
        )

    @property
    def _flat(self) -> Array:
        """Coefficients as (P, C)."""
        return self.coefficients.reshape(len(self.coefficients), -1)

    @property
    def _summands(self) -> int:
        return len(self.coefficients)

    @cached_property
    def _shape_route(self) -> str:
        return shape_route(self._flat, self.multi_index, self.space.germs)

    @cached_property
    def _shape_moments(self) -> tuple[Array, Array]:
        if self.shape_samples:
            std = np.where(self._constant, 0.0, self.std).ravel()
            skewness, kurtosis = sampled_shape(self.space, self._flat, self.multi_index, std, self.shape_samples)
        else:
            route = self._shape_route
            skewness, kurtosis = skewness_kurtosis(self._flat, self.multi_index, self.space.germs, route)
        return self._shaped(skewness), self._shaped(kurtosis)

    def _suspicions(self) -> tuple[str, ...]:
        return tuple(f". {one.words()}" if one else "" for one in self.discontinuities())

    def _verdicts_of_decay(self, tolerance: float) -> tuple[str, ...]:
        times, germs = self.labels.times, self.germ_names
        return tuple(
            verdict_of_decay(output.name, self.coefficients[:, k], self.multi_index, germs, times, tolerance)
            for k, output in enumerate(self.labels.outputs)
        )

    def _shares(self, masks: Mask) -> Array:
        found = variance_shares(self._flat, masks, self.std.ravel())
        return frozen(found.reshape(len(masks), *self.labels.shape))

    def _shaped(self, columns: Array) -> Array:
        return frozen(columns.reshape(self.labels.shape))

    def _set(self, name: str, value: Any) -> None:
        object.__setattr__(self, name, frozen(value))


def _whole(values: Any) -> Index:
    given = np.array(values)
    whole = given.astype(np.int64) if given.dtype.kind in "iuf" else np.zeros(0, dtype=np.int64)
    if whole.shape != given.shape or not np.array_equal(whole, given):
        raise StudyError("'multi_index' must hold whole numbers, the degrees of the polynomials.")
    return whole


def _check_finite(name: str, array: Array) -> None:
    if not np.isfinite(array).all():
        where = np.argwhere(~np.isfinite(array))[0].tolist()
        raise StudyError(f"'{name}' holds a number that is not finite at {where}; leave failed realisations out.")
