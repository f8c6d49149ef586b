"""Sampled paths of excitations: one path for each realisation and source, for look-up by kernels.

The key of a path is an input of the mechanism.  In the parameters of the blocks, the memory address of the path
replaces the key; `look_up_path` of the driver reads the path there.
"""

from __future__ import annotations

import numpy as np

from uqmbd.dynamics.equations import Model, PathFamily
from uqmbd.errors import StudyError
from uqmbd.mechanism import MEAN_KEY
from uqmbd.typing import Array, Index

__all__ = ["SampledPaths", "numbers_of"]

PATH = np.dtype([("step", "f8"), ("begin", "i8"), ("count", "i8"), ("coefficients", "i8")])
"""Path in memory, as ``Path`` of ``tables.h``."""

DEVIATION = 5e-4
"""Deviation of the next interval from the cubic before a knot, relative to the size of a path.

The path has eight knots in its shortest wavelength, and little power at this wavelength."""

COUNTS = 100.0
"""Least deviation, relative to the tolerance, that affects a step over a knot, as for tables over time."""


class SampledPaths:
    """Paths of K realisations."""

    def __init__(
        self, families: tuple[PathFamily, ...], values: Array, keys: Array | None = None, weights: Array | None = None
    ) -> None:
        self.families = families
        self.values = values
        none = np.zeros((len(values), len(families), 0))
        # terms of combined paths (K, family, M); without terms, the inputs contain the keys
        self.keys, self.weights = none if keys is None else keys, none if weights is None else weights
        self.steps = np.zeros(len(families))  # distance of knots of each family, in units of its argument
        self._memory = np.zeros((len(values), sum(len(x.sources) for x in families)), dtype=PATH)
        self._interval: tuple[float, float] | None = None  # times, s, between which the paths are sampled
        self._coefficients: list[Array] = []  # arrays that must not move while their addresses are in use
        self.failed: dict[int, str] = {}  # reasons of realisations without a path

    def insert(self, parameters: Array) -> None:
        """Write the memory addresses of the paths into the parameters (K, parameter)."""
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
        """Sample the paths between two times in s, unless they already contain this interval.

        Each realisation has a separate interval, so that its path, and the failure of its path, do not depend on
        others.  Equal keys with equal intervals share a path.  Raise the error of the source if no path can be sampled.
        """
        if self._interval is not None and self._interval[0] <= begin and end <= self._interval[1]:
            return
        if self._interval is not None:
            begin, end = min(begin, self._interval[0]), max(end, self._interval[1])
        kept: list[Array] = []
        source = 0
        for k, family in enumerate(self.families):
            memory = self._memory[:, source : source + len(family.sources)]
            memory["count"] = 0
            keys, ends = self.values[:, family.column], family.reach(self.values, begin, end)
            known = np.isfinite(ends).all(axis=1)
            drawn = known & (keys != MEAN_KEY)
            first = ends[known][:1] if known.any() else np.zeros((1, 2))
            # without realisations, the source checks the interval, and states the distance of knots
            self.steps[k] = _sampled(family, keys[:0], *first[0].tolist())[1] if not drawn.any() else self.steps[k]
            intervals, which = np.unique(ends[drawn], axis=0, return_inverse=True)
            for number, (low, high) in enumerate(intervals.tolist()):
                members = np.flatnonzero(drawn)[which.ravel() == number]
                try:
                    if self.keys.shape[2]:
                        own = np.arange(len(members))
                        begins, step, found = _combined(
                            family, self.keys[members, k], self.weights[members, k], low, high
                        )
                    else:
                        some, own = np.unique(keys[members], return_inverse=True)
                        begins, step, found = _sampled(family, some, low, high)
                except StudyError as error:
                    if len(members) == np.count_nonzero(drawn):
                        raise
                    self.failed |= dict.fromkeys(members.tolist(), str(error).rstrip("."))
                    continue
                self.steps[k] = step
                kept.append(found)
                address = (
                    found.ctypes.data + found.strides[0] * own[:, None] + found.strides[1] * np.arange(memory.shape[1])
                )
                part = np.zeros(address.shape, dtype=PATH)
                part["step"], part["begin"], part["count"] = step, round(begins / step), found.shape[2]
                part["coefficients"] = address
                memory[members] = part
            source += len(family.sources)
        self._coefficients, self._interval = kept, (begin, end)

    def select(self, members: Index) -> SampledPaths:
        """Return the paths of the selected realisations; the coefficients are shared."""
        found = SampledPaths(self.families, self.values[members], self.keys[members], self.weights[members])
        found.steps, found._interval, found._coefficients = self.steps.copy(), self._interval, self._coefficients
        found._memory[:] = self._memory[members]
        found.failed = {k: self.failed[m] for k, m in enumerate(members.tolist()) if m in self.failed}
        return found

    def longest_steps(self, rtol: float) -> Array:
        """Return the longest step (K,) in s for which the jumps of third derivatives at knots are negligible."""
        share = min(1.0, (COUNTS * rtol / DEVIATION) ** 0.25)
        found = np.full(len(self.values), np.inf)
        for family, step in zip(self.families, self.steps, strict=True):
            slopes = np.split(family.lines(self.values), 2, axis=1)[0]
            with np.errstate(divide="ignore", invalid="ignore"):
                found = np.fmin(found, share * float(step) / np.abs(slopes).max(axis=1))
        return found


def numbers_of(model: Model, means: Array, times: Array) -> int:
    """Return the number of state and output values of a realisation at times (T,), s, with coefficients of its paths.

    The paths are those at the `means` (input,) of the inputs.
    """
    count = len(times) * (len(model.outputs.names) + model.layout.width)
    for family in model.paths:
        low, high = family.reach(means[None, :], float(times[0]), float(times[-1]))[0].tolist()
        count += len(family.sources) * _sampled(family, np.zeros(0), low, high)[2].shape[2]
    return count


def _combined(family: PathFamily, keys: Array, weights: Array, low: float, high: float) -> tuple[float, float, Array]:
    """Return weighted sums of the paths of keys (K, M), as `_sampled`; one realisation at a time, to limit memory."""
    parts = []
    for own, weight in zip(keys, weights, strict=True):
        used = np.flatnonzero(weight)
        first, step, found = _sampled(family, own[used], low, high)
        total = np.zeros(found.shape[1:])
        for factor, path in zip(weight[used].tolist(), found, strict=True):
            total += factor * path
        parts.append(total)
    return first, step, np.array(parts)


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
    if abs(first / step - round(first / step)) > 1e-6:
        raise StudyError(
            f"excitation {sources[0].name!r}: sample_paths returned the first knot {first:g} and the step {step:g}; "
            "expected a knot that is a multiple of the step."
        )
    last = first + (coefficients.shape[2] - 3) * step
    if not (first <= low and high < last and np.isfinite(coefficients).all()):
        raise StudyError(
            f"excitation {sources[0].name!r}: sample_paths returned coefficients between {first:g} and {last:g}; "
            f"expected finite coefficients from {low:g} to {high:g}."
        )
    return float(first), float(step), coefficients
