"""Germs of all inputs of a study, and maps between germs and inputs.

Each group of dependent inputs has one map, and so does each independent input.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike
from scipy.special import ndtr

from uqmbd.arguments import typechecked
from uqmbd.errors import StudyError
from uqmbd.randomness.distributions import is_dependent
from uqmbd.randomness.germs import Germ
from uqmbd.randomness.index_sets import index_set
from uqmbd.randomness.joint import JointInput
from uqmbd.randomness.space.dependence import dependent_part
from uqmbd.randomness.space.families import independent_part
from uqmbd.randomness.space.storage import from_dataset, to_dataset
from uqmbd.randomness.space.transforms import CorrelatedTransform, Group
from uqmbd.typing import Array, Index

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["TRANSFORMS", "GermSpace"]


def space_parts(inputs: JointInput, transform: str) -> tuple[tuple[Germ, ...], tuple[Group, ...]]:
    """Return the germs of all inputs, in order, and the maps of their groups."""
    germs: dict[int, Germ] = {}
    groups: list[Group] = []
    given = {id(v.joint): v.joint for v in inputs.variables}.values()
    for joint in (part for one in given for part in one.separated):
        columns = tuple(inputs.names.index(name) for name in joint.names)
        if len(columns) > 1 and is_dependent(joint.distribution):
            found, group = dependent_part(joint, columns, transform)
            groups.append(group)
            germs.update(zip(columns, found, strict=True))
            continue
        for place, (column, name) in enumerate(zip(columns, joint.names, strict=True)):
            alone = joint.distribution if len(columns) == 1 else joint.distribution[place]
            germs[column], marginal = independent_part(name, alone)
            groups.append(CorrelatedTransform.single(column, marginal))
    return tuple(germs[k] for k in range(len(inputs))), tuple(groups)


TRANSFORMS = ("rosenblatt", "nataf")
"""Transforms of dependent inputs to independent germs."""


@typechecked
@dataclass(frozen=True, eq=False)
class GermSpace:
    """Independent standard variables of all inputs of a study, their polynomials, and the map to the inputs.

    Parameters
    ----------
    inputs : tuple of str
        Names of the inputs, in the order of the joint distribution.
    germs : tuple of Germ
        Germ of each input.
    groups : tuple of CorrelatedTransform or Rosenblatt
        Maps of the groups of dependent inputs, and of each independent input.

    Notes
    -----
    Results at a point have the same bits for any set of other points in the same call.

    Examples
    --------
    >>> import chaospy, uqmbd
    >>> from uqmbd.randomness import JointInput, index_set
    >>> a = uqmbd.RandomVariable("a", chaospy.Uniform(0, 2)); b = uqmbd.RandomVariable("b", chaospy.Normal(1, 3))
    >>> space = GermSpace.of(JointInput.of([a, b]))
    >>> [germ.family for germ in space.germs], space.independent
    (['legendre', 'hermite'], True)
    >>> space.to_inputs([[0.5, -1.0]])
    array([[ 1.5, -2. ]])
    >>> space.evaluate([[0.5, -1.0]], index_set(2, 1)).round(6)
    array([[ 1.      ,  0.866025, -1.      ]])
    """

    inputs: tuple[str, ...]
    germs: tuple[Germ, ...]
    groups: tuple[Group, ...]

    @classmethod
    def of(cls, inputs: JointInput, transform: str = "rosenblatt") -> GermSpace:
        """Find germs, polynomials and maps for the inputs of a study.

        Independent inputs get polynomials that are orthonormal for their own distribution: Hermite, Legendre, Jacobi or
        Laguerre polynomials if the distribution is one of Askey's scheme. Otherwise a discretised Stieltjes procedure
        on the affinely standardised input computes them. An input becomes a function of a standard normal germ if its
        upper or lower tail is too heavy for polynomials. Examples are lognormal and similar distributions: all
        moments exist, but do not determine the distribution.

        Parameters
        ----------
        inputs : JointInput
            Inputs of the study.
        transform : {"rosenblatt", "nataf"}
            Method that expresses dependent inputs as functions of independent germs.
            ``"rosenblatt"`` uses conditional distributions, in the order in which the joint distribution declares them.
            For (log)normal vectors and Gaussian copulas, the map is analytic, with standard normal germs. Otherwise,
            germs are uniform for a bounded support, and standard normal for an unbounded support.
            ``"nataf"`` uses the marginal distributions and a Gaussian copula, whose correlation gives the inputs the
            correlation of the joint distribution. The map is exact for (log)normal vectors and Gaussian copulas.
            **Any other joint distribution is approximated**: it keeps only its marginals and correlations.

        Returns
        -------
        GermSpace
            A germ for each input.

        Raises
        ------
        uqmbd.StudyError
            If the transform is unknown, or an input has no finite moments.
        """
        if transform not in TRANSFORMS:
            raise StudyError(f"transform is {transform!r}; expected one of {', '.join(TRANSFORMS)}.")
        germs, groups = space_parts(inputs, transform)
        return cls(inputs.names, germs, groups)

    @property
    def dimension(self) -> int:
        """Number of germs."""
        return len(self.germs)

    @property
    def independent(self) -> bool:
        """Whether germ k belongs to input k alone."""
        return all(group.independent for group in self.groups)

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the germs: the name of the input, or ``"b | a"`` (b given a) for a conditional input."""
        return tuple(germ.name for germ in self.germs)

    def to_inputs(self, germs: ArrayLike) -> Array:
        """Map germs to inputs.

        Parameters
        ----------
        germs : array_like, shape (K, d)
            Germ points.

        Returns
        -------
        array, shape (K, d)
            Inputs, in their units.

        Raises
        ------
        uqmbd.StudyError
            If the shape is wrong, or the map was not stored.
        """
        points = self._checked(germs, "germs")
        values = np.empty_like(points)
        for group in self.groups:
            columns = list(group.columns)
            values[:, columns] = group.to_inputs(points[:, columns])
        return values

    def to_germs(self, inputs: ArrayLike) -> Array:
        """Map inputs to germs.

        Parameters
        ----------
        inputs : array_like, shape (K, d)
            Inputs, in their units.

        Returns
        -------
        array, shape (K, d)
            Germ points.

        Raises
        ------
        uqmbd.StudyError
            If an input is outside its support, the shape is wrong, or the map was not stored.
        """
        values = self._checked(inputs, "inputs")
        points = np.empty_like(values)
        for group in self.groups:
            columns = list(group.columns)
            points[:, columns] = group.to_germs(values[:, columns])
            wrong = np.argwhere(~np.isfinite(points[:, columns]))
            if len(wrong):
                row, place = wrong[0]
                # inputs that depend on an invalid input also become NaN: report the first in the order of conditioning
                first = next(k for k in group.order if not np.isfinite(points[row, columns[k]]))
                raise StudyError(self._outside(columns[first], int(row), float(values[row, columns[first]])))
        return points

    def from_uniform(self, u: ArrayLike) -> Array:
        """Map independent uniform numbers, shape (K, d), to germs."""
        uniform = self._checked(u, "uniform numbers")
        values = np.empty_like(uniform)
        for k, germ in enumerate(self.germs):
            values[:, k] = germ.from_uniform(np.ascontiguousarray(uniform[:, k]))
        return values

    def from_normal(self, points: ArrayLike) -> Array:
        """Map independent standard normal variables, shape (K, d), one for each germ, to germs.

        A Hermite germ is the standard normal variable itself; any other germ is its quantile at the same probability.

        Examples
        --------
        >>> import chaospy, uqmbd
        >>> mechanism = uqmbd.Mechanism("fall", uqmbd.Translational(gravity=(0, -9.81)))
        >>> height = uqmbd.RandomVariable("height", chaospy.Uniform(0, 2), units="m")
        >>> stone = mechanism.body("stone", mass=1, position=(0, height))
        >>> space = GermSpace.of(mechanism.inputs)
        >>> space.to_inputs(space.from_normal([[0.0], [1.0]])).round(4).tolist()
        [[1.0], [1.6827]]
        """
        values = self._checked(points, "points").copy()
        for k, germ in enumerate(self.germs):
            if germ.family != "hermite":
                values[:, k] = germ.from_uniform(ndtr(np.ascontiguousarray(values[:, k])))
        return values

    def evaluate(self, germs: ArrayLike, multi_index: ArrayLike) -> Array:
        """Evaluate products of the orthonormal polynomials.

        Parameters
        ----------
        germs : array_like, shape (K, d)
            Germ points.
        multi_index : array_like of int, shape (P, d)
            Degrees of the terms.

        Returns
        -------
        array, shape (K, P)
            Values of the products.

        Raises
        ------
        uqmbd.StudyError
            If a shape does not fit, or a germ has no polynomial of a degree.
        """
        points = self._checked(germs, "germs")
        degrees = self._degrees(multi_index)
        values = np.ones((len(points), len(degrees)))
        for k, germ in enumerate(self.germs):
            terms = np.flatnonzero(degrees[:, k])
            if len(terms):
                degree = degrees[terms, k]
                polynomials = germ.polynomials(np.ascontiguousarray(points[:, k]), int(degree.max()))
                values[:, terms] *= polynomials[:, degree]
        return values

    def evaluate_derivative(self, germs: ArrayLike, multi_index: ArrayLike, germ: int) -> Array:
        """Evaluate derivatives of products of the orthonormal polynomials with respect to one germ.

        Parameters
        ----------
        germs, multi_index
            Germ points and degrees, as for :meth:`evaluate`.
        germ : int
            Number of the germ.

        Returns
        -------
        array, shape (K, P)
            Derivatives of the products.

        Raises
        ------
        uqmbd.StudyError
            If an argument is invalid, as for :meth:`evaluate`.

        Examples
        --------
        >>> import chaospy, uqmbd
        >>> from uqmbd.randomness import JointInput
        >>> variables = [uqmbd.RandomVariable(name, chaospy.Normal(0, 1)) for name in ("a", "b")]
        >>> space = GermSpace.of(JointInput.of(variables))
        >>> space.evaluate_derivative([[0.5, -1.0]], [[0, 0], [1, 1], [2, 0]], 0).round(6)
        array([[ 0.      , -1.      ,  0.707107]])
        """
        points, degrees = self._checked(germs, "germs"), self._degrees(multi_index).copy()
        if not 0 <= germ < self.dimension:
            raise StudyError(
                f"evaluate_derivative: germ is {germ}; expected the number of a germ, from 0 to {self.dimension - 1}."
            )
        own = degrees[:, germ].copy()
        degrees[:, germ] = 0
        values = self.evaluate(points, degrees)
        column = np.ascontiguousarray(points[:, germ])
        return values * self.germs[germ].derivatives(column, int(own.max(initial=0)))[:, own]

    def germ_derivatives(self, germs: ArrayLike) -> Array:
        """Return the derivatives of the germs with respect to the inputs, at germ points.

        Parameters
        ----------
        germs : array_like, shape (K, d)
            Germ points.

        Returns
        -------
        array, shape (K, d, d)
            Derivative of germ j with respect to input i at [:, j, i], in one over the units of the inputs. The
            derivative is infinite if several germ points belong to one input.

        Raises
        ------
        uqmbd.StudyError
            If the shape is wrong, or the map was not stored.

        Examples
        --------
        >>> import chaospy, uqmbd
        >>> from uqmbd.randomness import JointInput
        >>> space = GermSpace.of(JointInput.of([uqmbd.RandomVariable("a", chaospy.Normal(3, 0.5))]))
        >>> space.germ_derivatives([[0.1]]).tolist()
        [[[2.0]]]
        """
        points = self._checked(germs, "germs")
        found = np.zeros((len(points), self.dimension, self.dimension))
        for group in self.groups:
            columns = list(group.columns)
            found[:, np.array(columns)[:, None], columns] = group.germ_derivatives(points[:, columns])
        return found

    def basis(self, order: int, kind: str = "total", weights: Sequence[float] | None = None) -> Index:
        """Return the degrees of the terms of a chaos, shape (P, d), as `uqmbd.extend.index_set`.

        The set excludes degrees that a germ of few values does not have; its basis is complete without them.

        Parameters
        ----------
        order : int
            Highest total degree.
        kind : str
            Kind of the index set, as for `uqmbd.extend.index_set`.
        weights : sequence of float, length d, optional
            Weights of the germs, as for `uqmbd.extend.index_set`.

        Returns
        -------
        array of int, shape (P, d)
            Degrees of the terms; the first row is the mean.
        """
        degrees = index_set(self.dimension, order, kind, weights)
        highest = [order if germ.values is None else germ.values - 1 for germ in self.germs]
        return np.asarray(degrees[(degrees <= highest).all(axis=1)])

    def to_dataset(self) -> xr.Dataset:
        """Return the germ space as arrays and texts, which :meth:`from_dataset` reads.

        The Rosenblatt transform of a general joint distribution is stored as text, and formulas of chaospy evaluate it.
        A transform that contains functions of a user is not stored: :meth:`to_inputs` and :meth:`to_germs` then fail,
        but all other methods work. Recurrence coefficients and affine, lognormal and multivariate normal maps are
        stored exactly. Other quantile functions are tables over the probit scale. The same tables are in use before
        storage, so storage does not change results.

        Examples
        --------
        >>> import chaospy, uqmbd
        >>> from uqmbd.randomness import JointInput
        >>> space = GermSpace.of(JointInput.of([uqmbd.RandomVariable("a", chaospy.Normal(1, 2))]))
        >>> stored = space.to_dataset()
        >>> str(stored["germ_family"].item()), GermSpace.from_dataset(stored).to_inputs([[0.5]]).tolist()
        ('hermite', [[2.0]])
        """
        return to_dataset(self.inputs, self.names, self.germs, self.groups)

    @classmethod
    def from_dataset(cls, dataset: xr.Dataset) -> GermSpace:
        """Return the germ space from a result of :meth:`to_dataset`; ignore other variables in the dataset.

        Raises
        ------
        uqmbd.StudyError
            If a variable is missing.
        """
        return cls(*from_dataset(dataset))

    def _checked(self, array: ArrayLike, what: str) -> Array:
        values = np.asarray(array, dtype=float)
        if values.ndim != 2 or values.shape[1] != self.dimension:
            raise StudyError(f"The {what} have the shape {values.shape}; expected (points, {self.dimension}).")
        return values

    def _degrees(self, multi_index: ArrayLike) -> Index:
        """Return degrees of terms (P, d); raise StudyError for an invalid shape or degree."""
        degrees = np.asarray(multi_index)
        if degrees.ndim != 2 or degrees.shape[1] != self.dimension or (degrees.size and degrees.min() < 0):
            raise StudyError(
                f"The multi-index has the shape {degrees.shape}; expected (terms, {self.dimension}) "
                "with degrees of 0 or more."
            )
        if degrees.dtype.kind not in "iu":
            raise StudyError(f"The multi-index has numbers of the type {degrees.dtype}; expected whole numbers.")
        return degrees

    def _outside(self, column: int, row: int, value: float) -> str:
        described: dict[str, Any] = {}
        for group in self.groups:
            for k, marginal in zip(group.columns, getattr(group, "marginals", ()), strict=False):
                described[str(k)] = marginal.bounds
        low, high = described.get(str(column), (None, None))
        support = "" if low is None else f", which is [{low:.10g}, {high:.10g}]"
        return (
            f"Input {self.inputs[column]!r} is {value:.10g} in row {row}, outside the support of its "
            f"distribution{support}; use a value within the support."
        )
