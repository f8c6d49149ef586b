"""Accumulate directions of samples chunk by chunk, in memory independent of the number of samples."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from uqmbd.arguments import Size, shown, typechecked
from uqmbd.errors import StudyError
from uqmbd.results.statistics.circular import ROUNDING
from uqmbd.typing import Array

__all__ = ["CircularMoments"]


@typechecked
@dataclass(frozen=True, eq=False)
class CircularMoments:
    """Sums of sine and of 1 - cosine of angles from a reference, which can be merged with sums of other samples.

    Attributes
    ----------
    count : int
        Number of samples.
    turns : array, shape (O,)
        Length of a full turn in the units of each output; 0 if the output is no angle and is ignored.
    reference : array, shape (A, ...)
        Angle near the samples, rad, for each of the A angular outputs, so that small deviations lose no digits.
    sine, lack : array, shape (A, ...)
        Sums of the sine, and of 1 minus the cosine, of the angles relative to their reference.

    Examples
    --------
    >>> turns = np.array([360.0])
    >>> parts = (CircularMoments.of(np.array([[[x]]]), turns) for x in (350.0, 20.0))
    >>> next(parts).merge(next(parts)).statistics()["circular_mean"].round(9).tolist()
    [[5.0]]
    """

    count: Size
    turns: Array
    reference: Array
    sine: Array
    lack: Array

    @classmethod
    def of(cls, response: Array, turns: Array) -> CircularMoments:
        """Sum over finite samples, shape (S, O, ...), in the units of the outputs; S may be zero.

        Parameters
        ----------
        response : array, shape (S, O, ...)
            Samples; rows that are not finite are ignored.
        turns : array, shape (O,)
            Length of a turn of each output, in its units.

        Returns
        -------
        CircularMoments
            Sums over these samples.

        Raises
        ------
        uqmbd.StudyError
            If shapes do not match.
        """
        if response.ndim < 2 or turns.shape != response.shape[1:2]:
            raise StudyError(
                f"CircularMoments.of: response is {shown(response)} and turns is {shown(turns)}; expected samples of "
                "each output, shape (S, O, ...), and a turn of each output, shape (O,)."
            )
        angular = np.flatnonzero(turns)
        angles = response[:, angular] * (2.0 * np.pi / turns[angular]).reshape(-1, *[1] * (response.ndim - 2))
        if not len(angles):
            zero = np.zeros(angles.shape[1:])
            return cls(0, turns, zero, zero, zero)
        half = (angles - angles[0]) / 2.0
        sine = np.sin(half)
        double = 2.0 * sine
        lack = (double * sine).sum(axis=0)
        return cls(len(angles), turns, angles[0], (double * np.cos(half)).sum(axis=0), lack)

    def merge(self, other: CircularMoments) -> CircularMoments:
        """Return the sums over the samples of both objects."""
        if not self.count or not other.count:
            return other if not self.count else self
        shift = other.reference - self.reference
        sine, cosine, n = np.sin(shift), np.cos(shift), other.count
        turned_sine = other.sine * cosine + (n - other.lack) * sine
        turned_lack = 2.0 * n * np.sin(shift / 2.0) ** 2 + other.lack * cosine + other.sine * sine
        return CircularMoments(
            self.count + n, self.turns, self.reference, self.sine + turned_sine, self.lack + turned_lack
        )

    def statistics(self) -> dict[str, Array]:
        """Return circular mean and standard deviation.

        Returns
        -------
        dict of str to numpy.ndarray
            ``circular_mean`` and ``circular_std``, shape (O, ...), in the units of the outputs, as from
            `circular_mean` and `circular_std`. Other outputs have NaN. The result is empty if no output is an angle.
        """
        angular = np.flatnonzero(self.turns)
        if not len(angular):
            return {}
        sine, lack = self.sine / self.count, self.lack / self.count
        length = np.hypot(1.0 - lack, sine)
        cancels = length <= ROUNDING
        # 1 - length, computed without the loss of digits of the difference
        short = np.clip((2.0 * lack - lack**2 - sine**2) / (1.0 + length), 0.0, 1.0 - ROUNDING)
        angle = self.reference + np.arctan2(sine, 1.0 - lack)
        angle -= 2.0 * np.pi * np.round(angle / (2.0 * np.pi))
        mean = np.where(cancels, np.nan, np.where(angle <= -np.pi, np.pi, angle))
        std = np.where(cancels, np.inf, np.sqrt(-2.0 * np.log1p(-short)))
        radians = (2.0 * np.pi / self.turns[angular]).reshape(-1, *[1] * (mean.ndim - 1))
        found = {}
        for name, value in (("circular_mean", mean), ("circular_std", std + 0.0)):
            found[name] = np.full((len(self.turns), *mean.shape[1:]), np.nan)
            found[name][angular] = value / radians
        return found
