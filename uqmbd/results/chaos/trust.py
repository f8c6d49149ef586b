"""How far a polynomial chaos can be trusted: its stated error and horizon, its decay, and verdicts in words."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import xarray as xr

from uqmbd.errors import StudyError
from uqmbd.results.chaos import decay as decaying
from uqmbd.results.chaos.discontinuity import Discontinuity, find_discontinuities
from uqmbd.results.chaos.expansion import ChaosStatistics
from uqmbd.results.chaos.moments import constant_columns
from uqmbd.results.chaos.stated_error import stated_error
from uqmbd.results.schema import fixed_width
from uqmbd.typing import Array

__all__ = ["ChaosTrust"]


@dataclass(frozen=True, eq=False, repr=False)
class ChaosTrust(ChaosStatistics):
    """What :class:`uqmbd.results.PolynomialChaos` says of its own error."""

    @property
    def top_energy(self) -> Array:
        """Sum of squared coefficients (O, T) of the terms of the top order: what the next order would add, or more."""
        _, edge = decaying.top_order(self.multi_index)
        return np.asarray(np.sum(self.coefficients[edge] ** 2, axis=0))

    @property
    def top_energy_germ(self) -> Array:
        """Parts of :attr:`top_energy` by germ (d, O, T): a term counts by its degrees."""
        _, edge = decaying.top_order(self.multi_index)
        degrees = self.multi_index[edge] / np.maximum(self.multi_index[edge].sum(axis=1, keepdims=True), 1)
        found: Array = np.einsum("pd,p...->d...", degrees, self.coefficients[edge] ** 2)
        return found

    def decay(self) -> xr.Dataset:
        """Build a dataset of how the coefficients fall with the order.

        Returns
        -------
        xarray.Dataset
            `energy` (order, output, time), the sum of squared coefficients of each total degree, and `energy_germ`
            (germ, degree, output, time), that of each degree in a germ, both in squared units; `rate` (output, time),
            by how many decades the remaining standard deviation falls with each order (NaN: cannot be told).
        """
        dims = self.labels.dims
        energy = decaying.energy_of_orders(self.coefficients, self.multi_index)
        by_germ = decaying.energy_of_germs(self.coefficients, self.multi_index)
        constant = constant_columns(self._flat, self.std.ravel()).reshape(self.labels.shape)
        rate = np.where(constant, np.nan, decaying.decay_rate(energy))
        comment = {"comment": "decades of the remaining standard deviation per order, fitted by least squares"}
        return xr.Dataset(
            {
                "energy": (("order", *dims), energy, {"long_name": "sum of squared coefficients"}),
                "energy_germ": (("germ", "degree", *dims), by_germ, {"long_name": "sum of squared coefficients"}),
                "rate": (dims, rate, {"long_name": "decay per order"} | comment),
            },
            coords={
                **self.labels.output_coords(),
                "order": np.arange(len(energy)),
                "germ": ("germ", fixed_width(self.germ_names)),
                "degree": np.arange(by_germ.shape[1]),
            },
        )

    def discontinuities(self) -> tuple[Discontinuity | None, ...]:
        """Suspect each output of a discontinuity or a kink in the germ space, or not (None).

        Suspicious is a stated error of more than 5 % together with coefficients that hardly fall with the order; each
        suspicion names the time and the input. Without verification realisations there is none.

        Returns
        -------
        tuple of Discontinuity or None, length O
        """
        if self.verification_germs is None:
            return (None,) * len(self.labels.outputs)
        return find_discontinuities(self, self._stated_error())

    def verdicts(self, tolerance: float = 0.01) -> tuple[str, ...]:
        """Say for each output, in a sentence, how far the chaos can be trusted.

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
        """
        times, names = self.labels.times, [o.name for o in self.labels.outputs]
        if self.verification_germs is not None:
            rows = self._stated_error()
            seen = self.discontinuities()
            return tuple(
                decaying.verdict_of_error(n, row, times, tolerance) + (f". {one.words()}" if one else "")
                for n, row, one in zip(names, rows, seen, strict=True)
            )
        return tuple(
            decaying.verdict_of_decay(n, self.coefficients[:, k], self.multi_index, self.germ_names, times, tolerance)
            for k, n in enumerate(names)
        )

    def _stated_error(self) -> Array:
        """Return the stated error as (O, T), with T = 1 for outputs without times."""
        if self.verification_germs is None or self.verification_response is None:
            raise StudyError(
                "This chaos has no verification realisations, so it cannot state its error; give the propagator "
                "verify=8, or see 'verdicts' for what the coefficients tell."
            )
        shape = (len(self.labels.outputs), -1)
        surrogate = self.evaluate_germs(self.verification_germs)
        return stated_error(
            surrogate.reshape(len(surrogate), *shape),
            self.verification_response.reshape(len(surrogate), *shape),
            self.coefficients.reshape(len(self.coefficients), *shape),
            self.std.reshape(shape),
        )
