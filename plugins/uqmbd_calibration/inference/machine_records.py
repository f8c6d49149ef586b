"""Records of one machine at one operating point, and the indices of its inputs among the unknowns."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from uqmbd.typing import Array, Index
from uqmbd_calibration.inference.blocks import Block
from uqmbd_calibration.inference.points import OperatingPoint

__all__ = ["MachineRecords"]


@dataclass(frozen=True, eq=False)
class MachineRecords:
    """Records of one machine at one operating point."""

    point: OperatingPoint  # mechanism at the operating point
    columns: Index  # (d,): index of each input of the study in the vector of unknowns; -1 for a known input
    blocks: tuple[Block, ...]  # measured values

    @property
    def free(self) -> Index:
        """Indices of the unknown inputs."""
        return np.flatnonzero(self.columns >= 0)

    def normals(self, vectors: Array) -> Array:
        """Return the standard normal variables (K, d) of the inputs, from vectors of unknowns (K, N)."""
        found = np.zeros((len(vectors), len(self.columns)))
        found[:, self.free] = vectors[:, self.columns[self.free]]
        return found

    def part(self, rows: list[Index]) -> MachineRecords:
        """Return the records with only the selected values of each block."""
        kept = [(block, r) for block, r in zip(self.blocks, rows, strict=True) if len(r)]
        return replace(self, blocks=tuple(block.part(r) for block, r in kept))
