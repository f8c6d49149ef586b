"""Sampled paths of excitations: one path for each realisation and source, for look-up by kernels.

The key of a path is an input of the mechanism.  In the parameters of the blocks, the address of the path replaces the
key; `look_up_path` of the driver reads the path there.
"""

from __future__ import annotations

import numpy as np

from uqmbd.dynamics.equations import PathFamily
from uqmbd.errors import StudyError
from uqmbd.mechanism import MEAN_KEY
from uqmbd.typing import Array, Index

__all__ = ["SampledPaths"]

PATH = np.dtype([("step", "f8"), ("begin", "i8"), ("count", "i8"), ("coefficients", "i8")])
"""Path in memory, as ``Path`` of ``tables.h``."""

DEVIATION = 5e-4
"""Deviation of the next interval from the cubic before a knot, relative to the size of a path.

The path has eight knots in its shortest wavelength, and little power at this wavelength."""

COUNTS = 100.0
"""Deviation, relative to the tolerance, that matters to a step over a knot, as for tables over time."""


class SampledPaths:
    """Paths of K realisations."""

    def __init__(self, families: tuple[PathFamily, ...], values: Array) -> None:
        self.families = families
        self.values = values
        self.steps = np.zeros(len(families))  # distance of knots of each family, in units of its argument
        self._memory = np.zeros((len(values), sum(len(x.sources) for x in families)), dtype=PATH)
        self._interval: tuple[float, float] | None = None  # times, s, that the paths reach
        self._kept: list[Array] = []  # coefficients, which must not move while their addresses are in use

    def insert(self, parameters: Array) -> None:
        """Write the addresses of the paths into the parameters (K, parameter)."""
        size, base = self._memory.itemsize, self._memory.ctypes.data
        address = base + size * np.arange(self._memory.size, dtype=np.int64).reshape(self._memory.shape)
        source = 0
        for family in self.families:
            silent = self.values[:, family.column] == MEAN_KEY
            for columns in family.parameters:
                where = np.where(silent, 0.0, address[:, source].astype(float))
                parameters[:, list(columns)] = where[:, None]
                source += 1

    def reach(self, begin: float, end: float) -> None:
        """Sample the paths between two times, s, unless they reach that far already."""
        if self._interval is not None and self._interval[0] <= begin and end <= self._interval[1]:
            return
        if self._interval is not None:
            begin, end = min(begin, self._interval[0]), max(end, self._interval[1])
        kept: list[Array] = []
        source = 0
        for k, family in enumerate(self.families):
            keys = np.ascontiguousarray(self.values[:, family.column])
            low, high = family.reach(self.values, begin, end)
            first, step, found = _sampled(family, keys, low, high)
            self.steps[k] = step
            for column in range(len(family.sources)):
                memory, rows = self._memory[:, source], found[:, column]
                memory["step"], memory["begin"], memory["count"] = step, round(first / step), rows.shape[1]
                memory["coefficients"] = rows.ctypes.data + rows.strides[0] * np.arange(len(rows))
                source += 1
            kept.append(found)
        self._kept, self._interval = kept, (begin, end)

    def select(self, members: Index) -> SampledPaths:
        """Return the paths of some realisations; the coefficients are shared."""
        found = SampledPaths(self.families, self.values[members])
        found.steps, found._interval, found._kept = self.steps.copy(), self._interval, self._kept
        found._memory[:] = self._memory[members]
        return found

    def longest_steps(self, rtol: float) -> Array:
        """Return the longest step (K,), s, for which the jumps of third derivatives at knots are negligible."""
        share = min(1.0, (COUNTS * rtol / DEVIATION) ** 0.25)
        found = np.full(len(self.values), np.inf)
        for family, step in zip(self.families, self.steps, strict=True):
            slopes = np.split(family.lines(self.values), 2, axis=1)[0]
            with np.errstate(divide="ignore", invalid="ignore"):
                found = np.fmin(found, share * float(step) / np.abs(slopes).max(axis=1))
        return found


def _sampled(family: PathFamily, keys: Array, low: float, high: float) -> tuple[float, float, Array]:
    """Return the first knot, the distance of knots and the coefficients (K, source, n); raise if they are invalid."""
    sources = family.sources
    first, step, found = sources[0].sample_paths(sources, keys, low, high)
    coefficients = np.ascontiguousarray(found, dtype=float)
    if coefficients.ndim != 3 or coefficients.shape[:2] != (len(keys), len(sources)) or not step > 0:
        raise StudyError(
            f"excitation {sources[0].name!r}: sample_paths returned the step {step!r} and coefficients of shape "
            f"{coefficients.shape}; expected a positive step and the shape ({len(keys)}, {len(sources)}, n)."
        )
    last = first + (coefficients.shape[2] - 3) * step
    if not (first <= low and high < last and np.isfinite(coefficients).all()):
        raise StudyError(
            f"excitation {sources[0].name!r}: sample_paths returned coefficients between {first:g} and {last:g}; "
            f"expected finite coefficients from {low:g} to {high:g}."
        )
    return float(first), float(step), coefficients
