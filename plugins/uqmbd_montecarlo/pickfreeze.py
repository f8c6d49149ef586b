"""Sobol' indices by the pick-freeze method, from pairs of realisations with common inputs, with jackknife intervals."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from math import prod
from typing import Any

import numpy as np

from uqmbd.typing import Array, Index

__all__ = ["PickFreeze", "SobolIndices", "mixed_inputs", "obstacle_of"]


BLOCKS = 64
"""Number of blocks of rows for the jackknife; intervals have the same coverage as with single rows."""

LEVEL = 0.975
"""Probability below the upper end of a 95 % interval."""

BLOCK_NUMBERS = 2_000_000
"""Largest number of values (8 bytes each) in an array for a block of outputs and times."""

_ROUNDING = 32.0 * np.finfo(float).eps


@dataclass(frozen=True, eq=False)
class SobolIndices:
    """Estimates of Sobol' indices and their 95 % intervals, without truncation at 0 and 1; of inputs or of groups."""

    first: Array  # (input, ...)
    total: Array  # (input, ...)
    shared: Array  # (input, ...) total - first: due to interactions
    first_interval: Array  # (2, input, ...) lower and upper ends
    total_interval: Array  # (2, input, ...)
    shared_interval: Array  # (2, input, ...)
    varies: Any = field(kw_only=True)  # (...) whether the response varies by more than rounding errors

    def part(self, members: slice) -> SobolIndices:
        """Return the Sobol' indices of selected inputs."""
        whole = self.first[members], self.total[members], self.shared[members]
        ends = self.first_interval, self.total_interval, self.shared_interval
        return SobolIndices(*whole, *(x[:, members] for x in ends), varies=self.varies)


def obstacle_of(inputs: Any) -> str | None:
    """Return the reason why Sobol' indices are not defined for dependent inputs; None if they are defined.

    Two inputs of a `uqmbd.random_vector` are dependent if one of them changes with the uniform number of the other.
    """
    variables = inputs.variables
    if all(len(v.joint.names) == 1 for v in variables):
        return None
    uniform = np.random.default_rng(0).uniform(0.1, 0.9, (16, len(variables)))
    base = inputs.from_uniform(uniform)
    for k, moved in enumerate(variables):
        other = uniform.copy()
        other[:, k] = 1.0 - other[:, k]
        change = np.abs(inputs.from_uniform(other) - base)
        change[:, k] = 0.0
        moves = change.max(axis=0) > 1e-9 * np.ptp(base, axis=0)
        if moves.any():
            return (
                f"inputs {moved.name!r} and {variables[int(moves.argmax())].name!r} are dependent. For dependent "
                "inputs, pick-freeze estimators give indices of transformed variables, not of the inputs. Use "
                "Collocation(...), which computes such indices under separate names"
            )
    return None


def mixed_inputs(a: Array, b: Array, groups: Sequence[Sequence[int]] | None = None) -> Array:
    """Return the further inputs (G * N, d) of pick-freeze.

    The result contains G copies of a (N, d), one after another; in copy i, the inputs of group i are taken from b (N,
    d). By default each input is a group. a and b are independent samples of independent inputs.
    """
    count, dimension = a.shape
    groups = [[k] for k in range(dimension)] if groups is None else groups
    found = np.tile(a, (len(groups), 1)).reshape(len(groups), count, dimension)
    for k, group in enumerate(groups):
        found[k][:, list(group)] = b[:, list(group)]
    return found.reshape(-1, dimension)


@dataclass(frozen=True, eq=False)
class PickFreeze:
    """Sums of squares over rows of the design, for Sobol' indices; sums over different rows can be merged.

    Let f_A and f_B be the responses to two independent samples, and f_AB the responses to the first sample with input i
    from the second. Jansen's estimators (Computer Physics Communications 117 (1999) 35-43) are S_i = 1 - sum (f_B -
    f_AB)^2 / sum (f_B - f_A)^2; T_i = sum (f_A - f_AB)^2 / sum (f_B - f_A)^2. If an output depends on a single input,
    both estimators are exact for this input and for all others. The estimators do not depend on the mean of the
    response. The design with N (d + 2) realisations is from Saltelli et al., Computer Physics Communications 181 (2010)
    259-270. The intervals are jackknife intervals with Student's t (Efron and Stein, Annals of Statistics 9 (1981)
    586-596). The jackknife omits one block of rows at a time, with all realisations of a row. Rows of a sampling design
    are dependent, so the blocks are its independent replicates. Tests used 200 runs on Ishigami's function (N = 500,
    2000, 10,000) and on a pendulum (N = 200). Jackknife intervals contained 94.4, 94.7, 95.2 and 95.3 % of the indices.
    Bootstrap intervals, which require all rows in memory, contained 94.6, 94.5, 94.7 and 94.3 %.
    """

    sums: Array  # (2 d + 1, blocks, C) of squares over squared `scale`, in each block of rows and each of C columns
    rows: Index  # (blocks,) number of rows in each block
    scale: Array  # (C,) a power of two near the largest difference; 0 if all differences are 0
    largest: Array  # (C,) largest difference
    size: Array  # (C,) largest response
    shape: tuple[int, ...]  # shape of a response

    @classmethod
    def of(cls, index: Index, count: int, a: Array, b: Array, mixed: Array, blocks: int | None = None) -> PickFreeze:
        """Return sums over the rows with the ascending indices `index` (K,), of a design of `count` rows.

        The result does not depend on other rows.

        a and b (K, ...): finite responses, usually (K, output, time); `mixed` (d, K, ...): responses to `mixed_inputs`;
        `blocks`: number of equal, mutually independent parts of all rows; default: independent rows in 64 blocks.
        """
        dimension, columns = len(mixed), prod(a.shape[1:])
        blocks = min(BLOCKS, count) if blocks is None else blocks
        one, two = (x.reshape(len(index), columns) for x in (a, b))
        others = mixed.reshape(dimension, len(index), columns)
        block = index * blocks // count
        used, starts = np.unique(block, return_index=True)
        sums, scale = np.zeros((2 * dimension + 1, blocks, columns)), np.zeros(columns)
        largest, size = np.zeros(columns), np.zeros(columns)
        if len(index):
            size = np.maximum(np.abs(one).max(axis=0), np.abs(two).max(axis=0))
            for part in _parts(columns, (2 * dimension + 1) * len(index)):
                first, second, rest = one[:, part], two[:, part], others[:, :, part]
                differences = np.concatenate([(second - first)[None], second - rest, first - rest])
                largest[part] = np.abs(differences).max(axis=(0, 1))
                scale[part] = np.where(largest[part] > 0, np.ldexp(1.0, np.frexp(largest[part])[1] - 1), 0.0)
                differences /= np.where(scale[part] > 0, scale[part], 1.0)
                sums[:, used, part] = np.add.reduceat(np.square(differences, out=differences), starts, axis=1)
        rows = np.bincount(block, minlength=blocks).astype(np.int64)
        return cls(sums, rows, scale, largest, size, a.shape[1:])

    def merge(self, other: PickFreeze) -> PickFreeze:
        """Return the sums over the rows of both objects."""
        scale = np.maximum(self.scale, other.scale)
        safe = np.where(scale > 0, scale, 1.0)
        sums = self.sums * (self.scale / safe) ** 2 + other.sums * (other.scale / safe) ** 2
        largest, size = np.maximum(self.largest, other.largest), np.maximum(self.size, other.size)
        return PickFreeze(sums, self.rows + other.rows, scale, largest, size, self.shape)

    def indices(self) -> SobolIndices:
        """Return the indices and their intervals.

        If the response varies only by rounding errors, all indices and intervals are 0. Intervals are NaN if only
        one block has rows.
        """
        from scipy.special import stdtrit

        varies = self.largest > _ROUNDING * self.size
        sums = self.sums[:, self.rows > 0]
        whole, count = sums.sum(axis=1, keepdims=True), sums.shape[1]
        estimates = _estimates(whole, varies)
        without = _estimates(np.maximum(whole - sums, 0.0), varies)
        estimates, without = (np.concatenate([x, x[1:] - x[:1]]) for x in (estimates, without))
        spread = np.square(without - without.mean(axis=2, keepdims=True)).sum(axis=2)
        reach = np.full_like(spread, np.nan)
        if count > 1:
            reach = stdtrit(count - 1, LEVEL) * np.sqrt((count - 1) / count * spread)
        estimates = estimates[:, :, 0]
        shape = (estimates.shape[1], *self.shape)
        ends = np.stack([estimates - reach, estimates + reach], axis=1).reshape(3, 2, *shape)
        usable = (varies & (whole[0, 0] > 0)).reshape(self.shape)
        return SobolIndices(*estimates.reshape(3, *shape), *ends, varies=usable)


def _estimates(sums: Array, varies: Any) -> Array:
    """Return first and total indices (2, d, B, C) from sums (2 d + 1, B, C) of squares."""
    base, dimension = sums[0], len(sums) // 2
    usable = (base > 0) & varies
    share = np.divide(sums[1:], base, out=np.zeros_like(sums[1:]), where=usable)
    return np.stack([np.where(usable, 1.0 - share[:dimension], 0.0), share[dimension:]])


def _parts(columns: int, numbers: int) -> Iterator[slice]:
    size = max(1, BLOCK_NUMBERS // numbers)
    return (slice(start, start + size) for start in range(0, columns, size))
