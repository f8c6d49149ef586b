"""Numbers of a calibration as text, with two digits of their standard deviations."""

from __future__ import annotations

from typing import Any

import numpy as np
import xarray as xr

__all__ = ["interval", "mean_and_deviation"]


def mean_and_deviation(mean: Any, sd: Any) -> str:
    """Return a mean and a standard deviation as text.

    >>> mean_and_deviation(0.549283, 0.000449)
    '0.54928 ± 0.00045'
    """
    width, digits = float(sd), _digits(mean, sd)
    return f"{_number(mean, sd)} ± {width:.2g}" if digits is None else f"{_number(mean, sd)} ± {width:.{digits}f}"


def interval(one: xr.Dataset) -> str:
    """Return the 95 % interval of an input of a summary as text."""
    return f"{_number(one['lower'], one['sd'])} to {_number(one['upper'], one['sd'])}"


def _number(value: Any, sd: Any) -> str:
    """Return a number as text, with two digits of its standard deviation."""
    digits = _digits(value, sd)
    shown = f"{float(value):.6g}" if digits is None else f"{float(value):.{digits}f}"
    return shown.replace("-", "\N{MINUS SIGN}")


def _digits(value: Any, sd: Any) -> int | None:
    """Return the number of decimals; None if there are too many, or the standard deviation is unknown."""
    width = float(sd)
    if not width > 0 or not np.isfinite(width):
        return None
    digits = max(0, 1 - int(np.floor(np.log10(width))))
    return digits if digits <= 9 and abs(float(value)) < 1e7 else None
