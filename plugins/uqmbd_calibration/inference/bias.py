"""Bias of an output: model error, as a random function with a prior distribution."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

import uqmbd
from uqmbd.extend import typechecked
from uqmbd.typing import Array
from uqmbd_calibration.records import number, numbers

__all__ = ["Bias"]


@typechecked(values=False)
@dataclass(frozen=True)
class Bias:
    """Unknown error of an output of the model: a constant, or a smooth function of time.

    Parameters
    ----------
    sd : float
        Standard deviation, in the units of the output.
    length : float, optional
        Correlation time, s: the covariance of two times is ``sd**2 exp(-(s - t)**2 / (2 length**2))``.
        Default: the bias is a constant offset of each record.

    Raises
    ------
    uqmbd.StudyError
        If `sd` or `length` is not a positive number.

    Examples
    --------
    >>> Bias(sd=0.5).modes([0.0, 1.0]).tolist()
    [[0.5], [0.5]]
    >>> smooth = Bias(sd=0.5, length=0.2).modes([0.0, 0.1, 0.2])
    >>> (smooth @ smooth.T).round(4).tolist()
    [[0.25, 0.2206, 0.1516], [0.2206, 0.25, 0.2206], [0.1516, 0.2206, 0.25]]
    """

    sd: float
    length: float | None = None

    def __post_init__(self) -> None:
        number(self.sd, "Bias", "sd", positive=True)
        if self.length is not None:
            number(self.length, "Bias", "length", positive=True)

    def modes(self, times: object) -> Array:
        """Return modes of the bias: their sum with standard normal coefficients has the distribution of the bias.

        Parameters
        ----------
        times : array_like, shape (T,)
            Times, s, increasing.

        Returns
        -------
        array, shape (T, k)
            Values of the modes, in the units of the output.

        Raises
        ------
        uqmbd.StudyError
            If a time is not a finite number.
        """
        at = numbers(times, "Bias", "times")
        if not np.isfinite(at).all():
            raise uqmbd.StudyError("Bias: times contains values that are not finite; expected finite times in s.")
        if self.length is None or len(at) < 2:
            return np.full((len(at), 1), float(self.sd))
        # at a spacing of a third of the length, the interpolation error between the points is below 1e-3 sd
        wanted = int(np.ceil(3 * np.ptp(at) / self.length)) + 1
        points = at if wanted >= len(at) else np.linspace(at[0], at[-1], wanted)
        values, vectors = np.linalg.eigh(self._covariance(points, points))
        kept = values > 1e-12 * values[-1]
        return np.asarray(self.sd * self._covariance(at, points) @ vectors[:, kept] / np.sqrt(values[kept]))

    def _covariance(self, first: Array, second: Array) -> Array:
        assert self.length is not None
        return np.asarray(np.exp(-0.5 * ((first[:, None] - second) / self.length) ** 2))
