"""Joint moments of samples and a control variate, accumulated during the run."""

from __future__ import annotations

from typing import Any, Protocol

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from uqmbd.typing import Array, Mask
from uqmbd_montecarlo.control import FOLDS, Controlled, controlled_statistics, fold_of, variables
from uqmbd_montecarlo.jointmoments import JointMoments

__all__ = ["ROUNDING", "Control", "ControlledSums"]


ROUNDING = 32.0 * np.finfo(float).eps
"""Relative difference below which numbers are equal."""


class Control(Protocol):
    """Control variate of `ControlledSums`; arrays (C,) are over outputs and times."""

    words: str  # name in messages
    centre: Array  # origin of the values; defined only after the first values
    unit: Array  # unit of the values; defined only after the first values

    @property
    def useful(self) -> Mask:
        """Mask (C,) of the outputs and times at which the control varies; defined only after all values."""

    def standardised(self, first: int, count: int) -> Array:
        """Return (value - centre) / unit, shape (count, C), at samples from index `first` on."""


class ControlledSums:
    """Moments of samples and of a control at the samples, with memory independent of their number."""

    def __init__(self, control: Control, samples: int) -> None:
        self._control, self._samples = control, samples
        self._shift: Array | None = None
        self._folds: list[JointMoments | None] = [None] * FOLDS

    def add(self, first: int, response: Array, fine: NDArray[np.bool_]) -> None:
        """Add samples from index `first` on: responses (K, output, time), and the mask (K,) of successful samples."""
        surrogate = self._control.standardised(first, len(fine))
        found = (response.reshape(len(fine), -1) - self._control.centre) / self._control.unit
        if self._shift is None:
            # a shift near the mean preserves digits; the estimates do not depend on the shift
            self._shift = found[fine].mean(axis=0) if fine.any() else np.zeros(found.shape[1])
        gathered = variables(found - self._shift, surrogate, fine)
        of_fold = fold_of(np.arange(first, first + len(fine)), self._samples)
        for k in np.unique(of_fold).tolist():
            part, before = JointMoments.of(gathered[of_fold == k]), self._folds[k]
            self._folds[k] = part if before is None else before.merge(part)

    def left(self) -> float:
        """Return the share of the variances of mean and deviation that a control with a known mean leaves.

        The share is the mean over both statistics, and all outputs and times that vary; it is 1 if no output varies.
        """
        found = self._found(None)
        deviation = np.sqrt(np.maximum(found.variance, 0.0)) * self._control.unit
        varies = deviation > ROUNDING * np.abs(self._reference_values + self._control.unit * found.mean)
        if not varies.any():
            return 1.0
        shares = [1.0 / of[varies] for of in (found.reduction_mean, found.reduction_variance)]
        return float(np.clip(np.mean(shares), 0.0, 1.0))

    @property
    def _reference_values(self) -> Array:
        """Reference values that are subtracted from the outputs, in units of the outputs."""
        shift = 0.0 if self._shift is None else self._shift
        return self._control.centre + self._control.unit * shift

    def _found(self, further: JointMoments | None) -> Controlled:
        return controlled_statistics([fold for fold in self._folds if fold is not None], further)

    def apply(self, statistics: xr.Dataset, further: JointMoments | None = None) -> xr.Dataset:
        """Return statistics with controlled estimates of mean and deviation, and with variance reductions.

        Statistics do not change if the control or the output does not vary. The standard deviation does not change if
        the controlled estimate is not positive. `further`: moments of the control alone, if its expectation is unknown;
        see `controlled_statistics`.
        """
        found = self._found(further)
        mean, std = statistics["mean"].values, statistics["std"].values
        useful = self._control.useful.reshape(mean.shape) & (std > ROUNDING * np.abs(mean))

        def shaped(values: Array, otherwise: Any, where: NDArray[np.bool_]) -> Array:
            return np.where(where, values.reshape(mean.shape), otherwise)

        unit, centre = self._control.unit, self._reference_values
        positive = useful & (found.variance > 0).reshape(mean.shape)
        deviation = np.sqrt(np.where(found.variance > 0, found.variance, 1.0))
        controlled_std = shaped(unit * deviation, std, positive)
        replaced = {
            "mean": shaped(centre + unit * found.mean, mean, useful),
            "std": controlled_std,
            "variance": controlled_std**2,
        }
        # scale errors as for samples, so that 1.96 standard errors cover 95 %
        deviation_alone = np.where(std > 0, std, 1.0).ravel()
        for name, error, alone, where in (
            ("std_error_mean", unit * found.error_mean, unit * found.alone_mean, useful),
            (
                "std_error_std",
                unit * found.error_variance / (2 * deviation),
                unit**2 * found.alone_variance / (2 * deviation_alone),
                positive,
            ),
        ):
            wide = statistics[name].values
            factor = np.divide(wide.ravel(), alone, out=np.ones(wide.size), where=alone > 0)
            replaced[name] = shaped(error * np.maximum(factor, 1.0), wide, where)
        note = {"comment": f"estimated from samples, with {self._control.words} as control variate"}
        dims = statistics["mean"].dims
        reductions = {
            "variance_reduction": ("mean", shaped(found.reduction_mean, 1.0, useful)),
            "variance_reduction_std": ("standard deviation", shaped(found.reduction_variance, 1.0, positive)),
        }
        changed = {
            name: (dims, value, {**statistics[name].attrs, **({} if "error" in name else note)})
            for name, value in replaced.items()
        }
        about = (
            "variance of the estimate without control, divided by the variance with control; 1 where the output does "
            "not vary"
        )
        added = {
            name: (dims, value, {"long_name": f"variance reduction of the {what}", "comment": about})
            for name, (what, value) in reductions.items()
        }
        result = statistics.assign(changed | added)
        for name in ("skewness", "kurtosis", "quantile", "smallest", "largest"):
            if name not in statistics:
                continue
            kept = statistics[name].attrs.get("comment", "")
            result[name].attrs["comment"] = f"{kept}; from the samples alone, without the control".lstrip("; ")
        return result
