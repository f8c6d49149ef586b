"""Polynomial chaos: a surrogate of a mechanism's outputs, with statistics that say how far to trust them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import xarray as xr

from uqmbd.results.chaos.sampling import basis_values, sample_quantiles, spread_germs
from uqmbd.results.chaos.storage import chaos_arguments, chaos_dataset
from uqmbd.results.chaos.surrogate import SAMPLES
from uqmbd.results.chaos.trust import ChaosTrust
from uqmbd.results.schema import DEFAULT_PROBABILITIES
from uqmbd.results.statistics import circular_of_surrogate
from uqmbd.typing import Array

__all__ = ["PolynomialChaos"]


@dataclass(frozen=True, eq=False, repr=False)
class PolynomialChaos(ChaosTrust):
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
    >>> from uqmbd.randomness.space import GermSpace
    >>> from uqmbd.randomness.joint import JointInput
    >>> from uqmbd.results import labels
    >>> length = uqmbd.RandomVariable("length", chaospy.Normal(0.15, 0.003), units="m")
    >>> space = GermSpace.of(JointInput.of([length]))
    >>> axes = labels([("x", "m")], [("length", "m")], [0.0, 0.5])
    >>> chaos = PolynomialChaos([[[2.0, 2.0]], [[0.0, 0.4]], [[0.0, 0.3]]], [[0], [1], [2]], space, axes)
    >>> chaos.std.tolist(), chaos.sobol_first.round(3).tolist()
    ([[0.0, 0.5]], [[[0.0, 1.0]]])
    >>> chaos.evaluate([[0.153]])[0].round(3).tolist()
    [[2.0, 2.4]]
    """

    def quantiles(
        self, probabilities: Sequence[float] = DEFAULT_PROBABILITIES, *, samples: int = SAMPLES, seed: int = 0
    ) -> Array:
        """Return quantiles (N, O, T) of samples of the surrogate.

        The samples are a scrambled Sobol' sequence of the germs, of the next power of two; outputs and times go block
        by block, so that memory does not grow with them.
        """
        basis = basis_values(self.space, spread_germs(self.space, samples, seed), self.multi_index)
        found = sample_quantiles(basis, self._flat, probabilities)
        return found.reshape(len(found), *self.labels.shape)

    def circular(self, *, samples: int = SAMPLES, seed: int = 0) -> dict[str, Array]:
        """Return `circular_mean` and `circular_std`, (O, T), of the outputs that are angles, from surrogate samples.

        NaN for other outputs; nothing where no output is an angle. The samples are those of :meth:`quantiles`.
        """
        if not np.any(self.labels.turns):
            return {}
        basis = basis_values(self.space, spread_germs(self.space, samples, seed), self.multi_index)
        return circular_of_surrogate(basis, self.coefficients, self.labels.turns)

    def _column(self, germs: Array, where: tuple[int, ...]) -> Array:
        """Evaluate one output at one time at germ points (K, d): (K,)."""
        column = np.moveaxis(self.coefficients, 0, -1)[where]
        return np.asarray(basis_values(self.space, germs, self.multi_index) @ column)

    def marginal(self, *names: str) -> PolynomialChaos:
        """Return the chaos of the expectation of the outputs given some germs: only their terms are kept.

        Where inputs are independent the names are theirs. The result takes the same inputs as this one, and does not
        depend on the others. It has no verification: that was of the whole.

        Raises
        ------
        StudyError
            If a name is unknown or given twice, or there is none.
        """
        others = np.delete(self.multi_index, self._columns(names), axis=1)
        kept = ~np.any(others > 0, axis=1)
        return PolynomialChaos(self.coefficients[kept], self.multi_index[kept], self.space, self.labels)

    def to_dataset(self) -> xr.Dataset:
        """Build the dataset `chaos` of a propagator's node; see :meth:`from_dataset`."""
        return chaos_dataset(self)

    @classmethod
    def from_dataset(cls, dataset: xr.Dataset | xr.DataTree) -> PolynomialChaos:
        """Make a chaos from the dataset `chaos` of a result, without the mechanism.

        Raises
        ------
        StudyError
            If it is no such dataset.
        """
        return cls(**chaos_arguments(dataset))
