"""Provide polynomial chaos: outputs as sums of orthonormal polynomials of the germs, with exact statistics."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np
import xarray as xr

from uqmbd.arguments import typechecked
from uqmbd.errors import StudyError
from uqmbd.results.chaos.boxes import checked_weights, degrees, read_surrogate, verification_of
from uqmbd.results.chaos.container import frozen
from uqmbd.results.chaos.decay import decay_dataset, energy_of_germs, energy_of_orders, verdict_of_decay
from uqmbd.results.chaos.discontinuity import Discontinuity, find_discontinuities
from uqmbd.results.chaos.interface import Surrogate
from uqmbd.results.chaos.readouts import Piece, Plain, TermCoefficients
from uqmbd.results.chaos.surrogate_moments import ExactMoments
from uqmbd.results.schema import Labels, check_shape
from uqmbd.typing import Array, Index

if TYPE_CHECKING:
    from uqmbd.randomness import GermSpace

__all__ = ["PolynomialChaos"]


@typechecked
@dataclass(frozen=True, eq=False, repr=False)
class PolynomialChaos(Surrogate):
    r"""Outputs as a sum of orthonormal polynomials of standard random variables (germs), one sum per output and time.

    Mean, variance, skewness, kurtosis and Sobol' indices are computed from the coefficients. Quantiles and densities
    come from samples of the surrogate, which need no run of the mechanism. The object is immutable.

    *Independent inputs*: germ k belongs to input k, and ``sobol_first``, ``sobol_total``, ``sobol_second`` are
    indices of inputs. *Dependent inputs*: a germ such as "b | a" represents the variation of b for a given a. The
    shares of the variance then depend on the order of the inputs and belong to no input, and the three properties raise
    an error. ``sobol_first_germ``, ``sobol_total_germ`` and ``sobol_second_germ`` give the indices of the germs, in the
    order of ``germ_names``. The dataset of statistics contains the indices under these names, with a dimension
    ``germ``. An output that is constant within the rounding of its mean has the indices 0, skewness 0 and kurtosis 3.

    *Memory*: the coefficients need P x O x T x 8 bytes. Variance, indices, and skewness with kurtosis are computed in
    blocks over outputs and times, and need about 20 MB each. For many inputs, skewness and kurtosis also need a table
    of products of polynomials, with 140 bytes for each product during its construction. The table needs 9 MB for 10
    inputs of order 3 (286 terms, 67,000 products for normal inputs). It needs 310 MB for 20 inputs of order 3 (1771
    terms, 2.2 million products). Above 5 million products, skewness and kurtosis are estimated from samples of the
    surrogate. Quantiles need P x 8 bytes for each sample, and 65 MB.

    Parameters
    ----------
    coefficients : array, shape (P, O, T), or (P, O) if the labels have no times
        Coefficients, in the units of the outputs.
    multi_index : array of int, shape (P, d)
        Degree of each polynomial in each germ. Row 0, the mean, is zero.
    space : uqmbd.randomness.GermSpace
        Space of the d germs, with their polynomials and the map between germs and inputs.
    labels : Labels
        Outputs, inputs and times of the axes.
    verification_germs : array, shape (V, d), optional
        Germs of the verification realisations, which did not affect the coefficients.
    verification_response : array, shape (V, O, T), optional
        Outputs of the mechanism at these germs, from which the chaos computes its stated error.
    verification_weights : array, shape (V,), optional
        Weights of the verification realisations, scaled to the sum 1, for germs that are not distributed like the
        inputs. Default: equal weights.

    Raises
    ------
    StudyError
        If shapes or names do not match, or a number is not finite. If `multi_index` repeats a term or does not start
        with the mean.

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
    elements: tuple[TermCoefficients, ...] = field(init=False)

    _kind = Plain

    def __post_init__(self) -> None:
        """Check shapes and numbers, and store read-only copies."""
        from uqmbd.randomness import GermBox

        self._set("coefficients", np.array(self.coefficients, dtype=float))
        self._set("multi_index", _whole(self.multi_index))
        names, terms = tuple(i.name for i in self.labels.inputs), len(self.multi_index)
        if names != tuple(self.space.inputs):
            raise StudyError(
                f"PolynomialChaos: the labels have the inputs {names}, but the germ space has {self.space.inputs}; "
                "expected the same inputs."
            )
        if not names:
            raise StudyError("PolynomialChaos: the germ space has no input; expected at least one.")
        check_shape("coefficients", self.coefficients, (terms, *self.labels.shape), ("term", *self.labels.dims))
        check_shape("multi_index", self.multi_index, (terms, len(names)), ("term", "input"))
        if np.any(self.multi_index < 0) or np.any(self.multi_index[:1] != 0) or not terms:
            raise StudyError(
                "'multi_index' must contain degrees of 0 or more; its first row must contain zeros, for the mean."
            )
        if len(np.unique(self.multi_index, axis=0)) < terms:
            raise StudyError("'multi_index' contains a term twice; expected each term once.")
        _check_finite("coefficients", self.coefficients)
        if (self.verification_germs is None) != (self.verification_response is None):
            raise StudyError(
                "Only one of 'verification_germs' and 'verification_response' is given; expected both or neither."
            )
        if self.verification_germs is not None:
            self._set("verification_germs", np.array(self.verification_germs, dtype=float))
            self._set("verification_response", np.array(self.verification_response, dtype=float))
            count = len(self.verification_germs) if self.verification_germs.ndim else 0
            if not count:
                raise StudyError(
                    "The verification arrays contain no realisation; expected at least one, or no verification arrays."
                )
            for name, shape, dims in (
                ("verification_germs", (count, len(names)), ("verification", "germ")),
                ("verification_response", (count, *self.labels.shape), ("verification", *self.labels.dims)),
            ):
                check_shape(name, getattr(self, name), shape, dims)
                _check_finite(name, getattr(self, name))
        weights = checked_weights(self.verification_weights, self.verification_germs)
        object.__setattr__(self, "verification_weights", weights)
        object.__setattr__(self, "elements", (TermCoefficients(GermBox.whole(self.space), self.coefficients),))

    def __repr__(self) -> str:
        sizes = zip(("terms", *self.labels.dims), self.coefficients.shape, strict=True)
        axes = ", ".join(f"{name}: {size}" for name, size in sizes)
        top = int(self.multi_index.max())
        return f"<{type(self).__name__} of {', '.join(self.germ_names)} up to degree {top} ({axes})>"

    @property
    def variance_germ(self) -> Array:
        """Parts of the variance by germ (d, O, T), with terms divided in proportion to their degrees."""
        return self._moments.by_germ(slice(None))

    def sobol_interaction(self, *names: str) -> Array:
        """Return the Sobol' index of an interaction: the share of the variance due to all these germs together.

        Parameters
        ----------
        *names : str
            Names of different germs (:attr:`germ_names`), or of inputs if these are independent. A single name gives
            its first-order index.

        Returns
        -------
        array, shape (O, T)
            Sobol' index of the interaction.

        Raises
        ------
        StudyError
            If there are no names, or a name is unknown or repeated.

        Examples
        --------
        >>> import chaospy, uqmbd
        >>> from uqmbd.randomness import GermSpace, JointInput
        >>> from uqmbd.results import PolynomialChaos
        >>> from uqmbd.extend import labels
        >>> inputs = [uqmbd.RandomVariable(name, chaospy.Uniform(-1, 1)) for name in "ab"]
        >>> space, axes = GermSpace.of(JointInput.of(inputs)), labels(["y"], ["a", "b"], [0.0])
        >>> chaos = PolynomialChaos([[[1.0]], [[0.3]], [[0.4]], [[1.2]]], [[0, 0], [1, 0], [0, 1], [1, 1]], space, axes)
        >>> chaos.sobol_interaction("a", "b").round(4).tolist()  # 1.44 / 1.69
        [[0.8521]]
        """
        return self._moments.interaction(self._columns(names))

    def marginal(self, *names: str) -> PolynomialChaos:
        """Return the chaos of the conditional expectation of the outputs given some germs, with only their terms.

        For independent inputs, germs have the names of the inputs. The result has the same inputs as this chaos, but
        depends only on the given germs. The result has no verification realisations, because these belong to the whole
        chaos.

        Raises
        ------
        StudyError
            If there are no names, or a name is unknown or repeated.

        Examples
        --------
        >>> import chaospy, uqmbd
        >>> from uqmbd.randomness import GermSpace, JointInput
        >>> from uqmbd.results import PolynomialChaos
        >>> from uqmbd.extend import labels
        >>> inputs = [uqmbd.RandomVariable(name, chaospy.Uniform(-1, 1)) for name in "ab"]
        >>> space, axes = GermSpace.of(JointInput.of(inputs)), labels(["y"], ["a", "b"], [0.0])
        >>> chaos = PolynomialChaos([[[1.0]], [[0.3]], [[0.4]], [[0.0]]], [[0, 0], [1, 0], [0, 1], [1, 1]], space, axes)
        >>> alone = chaos.marginal("a")
        >>> alone.std.tolist(), alone.labels.inputs[0].name
        ([[0.3]], 'a')
        """
        # polynomials are orthonormal, so the expectation over a germ removes every term that contains the germ
        others = np.delete(self.multi_index, self._columns(names), axis=1)
        included = ~np.any(others > 0, axis=1)
        return PolynomialChaos(self.coefficients[included], self.multi_index[included], self.space, self.labels)

    def decay(self) -> xr.Dataset:
        """Build a dataset of the decay of the coefficients with the order.

        Returns
        -------
        xarray.Dataset
            ``energy`` (order, output, time): sum of squared coefficients of each total degree, in squared units.
            ``energy_germ`` (germ, degree, output, time): the same sum for each degree in a germ. ``rate`` (output,
            time): decades by which the remaining standard deviation falls with each order; NaN if unknown.

        Examples
        --------
        >>> import chaospy, uqmbd
        >>> from uqmbd.randomness import GermSpace, JointInput
        >>> from uqmbd.results import PolynomialChaos
        >>> from uqmbd.extend import labels
        >>> inputs = [uqmbd.RandomVariable(name, chaospy.Uniform(-1, 1)) for name in "ab"]
        >>> space, axes = GermSpace.of(JointInput.of(inputs)), labels(["y"], ["a", "b"], [0.0])
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
            rate_note="decrease in decades of the remaining standard deviation per order, fitted by least squares",
        )

    def discontinuities(self) -> tuple[Discontinuity | None, ...]:
        """Return the suspected discontinuity or kink of each output in the germ space, or None.

        An output is suspected if its stated error is above 5 % and its coefficients hardly decrease with the order.
        Each suspected discontinuity names the time and the input. Without verification realisations all entries are
        None.

        Returns
        -------
        tuple of Discontinuity or None, length O
            Suspected discontinuity of each output, or None.

        Examples
        --------
        >>> import chaospy, uqmbd
        >>> from uqmbd.randomness import GermSpace, JointInput
        >>> from uqmbd.results import PolynomialChaos
        >>> from uqmbd.extend import labels
        >>> inputs = [uqmbd.RandomVariable(name, chaospy.Uniform(-1, 1)) for name in "ab"]
        >>> space, axes = GermSpace.of(JointInput.of(inputs)), labels(["y"], ["a", "b"], [0.0])
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

    def to_chaospy(self) -> Any:
        """Convert the chaos to a polynomial of chaospy, e.g. for ``chaospy.E``.

        Returns
        -------
        numpoly.ndpoly
            Polynomials of the shape (O, T), in the units of the outputs. The variables ``q0``, ``q1``, ... are the
            germs in the order of :attr:`germ_names`, not the inputs. ``chaos.space.to_germs(inputs)`` gives their
            values. Germs of normal inputs are standard normal; germs of uniform inputs are uniform on [-1, 1].

        Notes
        -----
        Sums of powers lose digits at high degrees: the loss corresponds to the ratio of the largest summand to the sum.

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

    @property
    def _pieces(self) -> tuple[Piece, ...]:
        return ((self.space, self.multi_index, self.elements[0]),)

    @cached_property
    def _moments(self) -> ExactMoments:
        return ExactMoments(self.space, self.multi_index, self.coefficients)

    def _variables(self, stated: bool) -> dict[str, Any]:
        order = "column k belongs to germ k"
        if not self.space.independent:
            order += "; germ k is not input k, because the inputs are dependent"
        about = {"long_name": "coefficients of the orthonormal polynomials", "comment": "in the units of the outputs"}
        found = {"coefficients": (("term", *self.labels.dims), self.coefficients, about)}
        if stated:
            about = {
                "long_name": "stated error of the surrogate",
                "comment": "root mean square at weighted realisations that are not nodes, divided by the standard "
                "deviation",
            }
            found["verification_error"] = (self.labels.dims, self.verification_error(), about)
        return found | degrees(self.multi_index, order)

    @classmethod
    def _arguments(cls, dataset: xr.Dataset | xr.DataTree) -> dict[str, Any]:
        data, labels, space = read_surrogate(dataset, "chaos", ("coefficients", "multi_index"))
        if "element" in data["coefficients"].dims:
            raise StudyError(
                "This dataset contains a polynomial chaos with elements; use uqmbd.results.PiecewiseChaos, or "
                "chaos_from_dataset."
            )
        return {
            "coefficients": data["coefficients"].transpose("term", *labels.dims).values,
            "multi_index": data["multi_index"].transpose("term", "input").values,
            "space": space,
            "labels": labels,
        } | verification_of(data)

    def _suspicions(self) -> tuple[str, ...]:
        return tuple(f". {one.words()}" if one else "" for one in self.discontinuities())

    def _verdicts_of_decay(self, tolerance: float) -> tuple[str, ...]:
        times, germs = self.labels.times, self.germ_names
        return tuple(
            verdict_of_decay(output.name, self.coefficients[:, k], self.multi_index, germs, times, tolerance)
            for k, output in enumerate(self.labels.outputs)
        )

    def _columns(self, names: tuple[str, ...]) -> list[int]:
        known = self.germ_names
        for k, name in enumerate(names):
            if name not in known or name in names[:k]:
                raise StudyError(
                    f"The germs are {', '.join(names)}; expected different germs out of {', '.join(known)}."
                )
        if not names:
            raise StudyError(f"No germ is given; expected at least one of {', '.join(known)}.")
        return [known.index(name) for name in names]

    def _set(self, name: str, value: Any) -> None:
        object.__setattr__(self, name, frozen(value))


def _whole(values: Any) -> Index:
    given = np.array(values)
    whole = given.astype(np.int64) if given.dtype.kind in "iuf" else np.zeros(0, dtype=np.int64)
    if whole.shape != given.shape or not np.array_equal(whole, given):
        raise StudyError("'multi_index' must contain whole numbers, which are the degrees of the polynomials.")
    return whole


def _check_finite(name: str, array: Array) -> None:
    if not np.isfinite(array).all():
        where = np.argwhere(~np.isfinite(array))[0].tolist()
        raise StudyError(f"'{name}' contains a number that is not finite at {where}; omit failed realisations.")
