"""Relate the stated integration error to the standard deviation of an output, or to its mean."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import xarray as xr

from uqmbd.arguments import OrInfinite, OrNaN, typechecked
from uqmbd.results.statistics import varying
from uqmbd.wording import format_part, format_quantity

__all__ = ["ROUNDING", "IntegrationShare", "integration_shares", "worst_integration_share"]


ROUNDING = "at the level of rounding"
"""Words for a measured error of zero: integrations with different tolerances give the same values."""


@typechecked
@dataclass(frozen=True)
class IntegrationShare:
    """Largest integration error of an output.

    `output`, `units`: name and units of the output; `error`: largest error over time, in these units; NaN if unknown;
    `varies`: whether the output varies by more than this error, see :func:`uqmbd.results.varying` (otherwise the output
    cannot be distinguished from a constant); `share`: error relative to the largest standard deviation of a varying
    output, or to the largest mean of other outputs (0 for 0/0); `reason`: source of the error, or reason why it is
    unknown; may be empty; `timed`: whether the output has times, so that the largest values are over time.

    >>> from uqmbd.results.assessment import IntegrationShare
    >>> one = IntegrationShare("height", "m", error=2e-6, varies=True, share=1e-5)
    >>> one.whole
    'the standard deviation'
    >>> one.words()
    '0.0010 % of the standard deviation'
    """

    output: str
    units: str
    error: OrNaN | OrInfinite
    varies: bool
    share: OrNaN | OrInfinite
    reason: str = ""
    timed: bool = False

    @property
    def whole(self) -> str:
        """Quantity that the share refers to."""
        largest = "largest " if self.timed else ""
        return f"the {largest}standard deviation" if self.varies else f"the {largest}mean"

    def words(self) -> str:
        """Return the share of the error as a short text.

        >>> IntegrationShare("x", "m", 2e-8, True, 2.1e-6).words()
        '0.00021 % of the standard deviation'
        >>> IntegrationShare("x", "m", float("nan"), True, float("nan")).words()
        'unknown'
        >>> IntegrationShare("x", "m", 0.0, True, 0.0).words()
        'at the level of rounding'
        """
        if not np.isfinite(self.share):
            return "unknown"
        return format_part(self.share, self.whole) if self.share else ROUNDING

    def sentence(self) -> str:
        """Return a sentence with the error in the units of the output and its share, or why the error is unknown.

        >>> IntegrationShare("x", "m", 2e-8, True, 2.1e-6).sentence()
        'The integration error is at most 2 × 10⁻⁸ m (0.00021 % of the standard deviation).'
        >>> IntegrationShare("x", "m", 0.0, True, 0.0).sentence()
        'The integration error is at the level of rounding.'
        """
        if not np.isfinite(self.error):
            return f"The integration error is unknown: {self.reason}."
        if not self.error:
            return f"The integration error is {ROUNDING}."
        size = f" ({self.words()})" if np.isfinite(self.share) else ""
        return f"The integration error is at most {format_quantity(self.error, self.units)}{size}."


@typechecked
def integration_shares(statistics: xr.Dataset) -> list[IntegrationShare]:
    """Return the integration errors of all outputs, or an empty list if the statistics do not contain errors.

    `statistics`: statistics of a method.

    >>> from uqmbd.extend import labels, statistics_dataset
    >>> found = statistics_dataset(labels(["x"], [], [0.0, 1.0]), mean=[[3.0, 3.0]], std=[[0.0, 0.5]])
    >>> [one.words() for one in integration_shares(found.assign(integration_error=0.001 * found["std"]))]
    ['0.10 % of the largest standard deviation']
    """
    if "integration_error" not in statistics:
        return []
    stated = statistics["integration_error"]
    reason = str(stated.attrs.get("reason") or stated.attrs.get("comment", ""))
    units = [""] * statistics.sizes["output"]
    if "output_units" in statistics.coords:
        units = [str(unit) for unit in statistics["output_units"].values]
    found = []
    moves, timed = varying(statistics), "time" in statistics["mean"].dims
    known = [statistics[key].values for key in ("integration_error", "std", "mean")]
    for k, name in enumerate(str(value) for value in statistics["output"].values):
        error, std, mean = (_largest(values[k]) for values in known)
        varies = bool(moves[k])
        scale = std if varies else mean
        share = error / scale if scale > 0 else (0.0 if error == 0 else np.nan)
        found.append(IntegrationShare(name, units[k], error, varies, share, reason, timed))
    return found


@typechecked
def worst_integration_share(node: xr.DataTree) -> IntegrationShare | None:
    """Return the largest integration error relative to the scale of its output, or None if no error is stated.

    `node`: node of a method; scalar outputs are included.

    >>> import chaospy
    >>> import uqmbd
    >>> from uqmbd.results.assessment import worst_integration_share
    >>> from uqmbd_montecarlo import MonteCarlo
    >>> mechanism = uqmbd.Mechanism("stone", uqmbd.Line())
    >>> speed = uqmbd.RandomVariable("speed", chaospy.Normal(3, 0.2), units="m/s")
    >>> stone = mechanism.body("stone", mass=1, velocity=speed)
    >>> mechanism.output("height", stone.position[0], units="m")
    >>> tree = uqmbd.Study("throw", mechanism, [0, 1], [MonteCarlo(samples=20, seed=1)]).run()
    >>> worst = worst_integration_share(tree["monte-carlo"])
    >>> worst.output, worst.varies, worst.share < 1e-3
    ('height', True, True)
    """
    parts = [node, *(child for name, child in node.children.items() if name == "scalars")]
    found = [one for part in parts for one in integration_shares(part.children["statistics"].to_dataset())]
    return max(found, key=lambda one: np.nan_to_num(one.share, nan=-1.0), default=None)


def _largest(values: np.ndarray) -> float:
    finite = np.abs(values[np.isfinite(values)])
    return float(finite.max()) if finite.size else np.nan
