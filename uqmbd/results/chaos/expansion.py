"""A polynomial chaos as far as its coefficients tell: values, moments and Sobol' indices."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from uqmbd.errors import StudyError
from uqmbd.results.chaos.moments import constant_columns, shape_route, skewness_kurtosis, standard_deviation
from uqmbd.results.chaos.sampling import affordable, basis_values, sampled_shape
from uqmbd.results.chaos.sobol import (
    first_order_masks,
    interaction_mask,
    second_order_masks,
    total_order_masks,
    variance_shares,
)
from uqmbd.results.chaos.surrogate import FEWER, ChaosInterface
from uqmbd.results.schema import Labels
from uqmbd.threads import one_thread
from uqmbd.typing import Array, Index

if TYPE_CHECKING:
    from uqmbd.randomness import GermSpace

__all__ = ["ChaosStatistics"]

_Kind = TypeVar("_Kind", bound=np.generic)


@dataclass(frozen=True, eq=False, repr=False)
class ChaosStatistics(ChaosInterface):
    """The data of :class:`uqmbd.results.PolynomialChaos`, and what follows from them without a sample."""

    coefficients: Array
    multi_index: Index
    space: GermSpace
    labels: Labels
    verification_germs: Array | None = None
    verification_response: Array | None = None

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
        _check_shape("coefficients", self.coefficients, (terms, *self.labels.shape), ("term", *self.labels.dims))
        _check_shape("multi_index", self.multi_index, (terms, len(names)), ("term", "input"))
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
                _check_shape(name, getattr(self, name), shape, dims)
                _check_finite(name, getattr(self, name))

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
    def variance(self) -> Array:
        """Variance, shape (O, T): the sum of the squares of all coefficients but the mean."""
        return _frozen(self.std**2)

    @property
    def skewness(self) -> Array:
        """Third standardised moment, shape (O, T); 0 where an output does not vary.

        Of samples of the surrogate, where exact ones need too many operations (:attr:`shape_samples`).
        """
        return self._shape_moments[0]

    @property
    def kurtosis(self) -> Array:
        """Fourth standardised moment, shape (O, T), not the excess: 3 for a normal, and where it does not vary."""
        return self._shape_moments[1]

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
        return _frozen(found)

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
        """
        return np.asarray(self._shares(interaction_mask(self.multi_index, self._columns(names))[None])[0])

    def evaluate_germs(self, germs: ArrayLike) -> Array:
        """Evaluate at germ points (K, d): (K, O, T), in the units of the outputs."""
        points = np.asarray(germs, dtype=float)
        if points.ndim != 2 or points.shape[1] != self.multi_index.shape[1]:
            raise StudyError(f"Points must have the shape (K, {self.multi_index.shape[1]}); {points.shape} was given.")
        with one_thread():
            found: Array = basis_values(self.space, points, self.multi_index) @ self._flat
        return found.reshape(len(points), *self.labels.shape)

    @property
    def _flat(self) -> Array:
        """Coefficients as (P, C)."""
        return self.coefficients.reshape(len(self.coefficients), -1)

    @cached_property
    def shape_samples(self) -> int:
        """Samples of the surrogate from which skewness and kurtosis are; 0: they are exact."""
        exact = self._shape_route != "samples"
        return 0 if exact else affordable(FEWER, len(self.multi_index), self._flat.shape[1])

    @cached_property
    def _shape_route(self) -> str:
        return shape_route(self._flat, self.multi_index, self.space.germs)

    @cached_property
    def _shape_moments(self) -> tuple[Array, Array]:
        if self.shape_samples:
            std = np.where(constant_columns(self._flat, self.std.ravel()), 0.0, self.std.ravel())
            skewness, kurtosis = sampled_shape(self.space, self._flat, self.multi_index, std, self.shape_samples)
        else:
            route = self._shape_route
            skewness, kurtosis = skewness_kurtosis(self._flat, self.multi_index, self.space.germs, route)
        return self._shaped(skewness), self._shaped(kurtosis)

    def _shares(self, masks: NDArray[np.bool_]) -> Array:
        found = variance_shares(self._flat, masks, self.std.ravel())
        return _frozen(found.reshape(len(masks), *self.labels.shape))

    def _shaped(self, columns: Array) -> Array:
        return _frozen(columns.reshape(self.labels.shape))

    def _set(self, name: str, value: Any) -> None:
        object.__setattr__(self, name, _frozen(value))


def _frozen(array: NDArray[_Kind]) -> NDArray[_Kind]:
    array.setflags(write=False)
    return array


def _whole(values: Any) -> Index:
    given = np.array(values)
    whole = given.astype(np.int64) if given.dtype.kind in "iuf" else np.zeros(0, dtype=np.int64)
    if whole.shape != given.shape or not np.array_equal(whole, given):
        raise StudyError("'multi_index' must hold whole numbers, the degrees of the polynomials.")
    return whole


def _check_shape(name: str, array: NDArray[Any], expected: tuple[int, ...], dims: tuple[str, ...]) -> None:
    if array.shape != expected:
        raise StudyError(f"'{name}' must have the shape ({', '.join(dims)}) = {expected}; {array.shape} was given.")


def _check_finite(name: str, array: Array) -> None:
    if not np.isfinite(array).all():
        where = np.argwhere(~np.isfinite(array))[0].tolist()
        raise StudyError(f"'{name}' holds a number that is not finite at {where}; leave failed realisations out.")
