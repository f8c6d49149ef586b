"""One machine at one operating point: its records, and the places of its inputs among the unknowns."""

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

    point: OperatingPoint  # the mechanism
    columns: Index  # (d,): for each input of the study where it stands in the vector of unknowns; -1: it is known
    blocks: tuple[Block, ...]  # what was measured

    @property
    def free(self) -> Index:
        """Places of the unknown inputs."""
        return np.flatnonzero(self.columns >= 0)

    def normals(self, vectors: Array) -> Array:
        """Return the standard normal variables (K, d) of the inputs, from vectors of unknowns."""
        found = np.zeros((len(vectors), len(self.columns)))
        found[:, self.free] = vectors[:, self.columns[self.free]]
        return found

    def part(self, rows: list[Index]) -> MachineRecords:
        """Return the case of some values of each block."""
        kept = [(block, r) for block, r in zip(self.blocks, rows, strict=True) if len(r)]
        return replace(self, blocks=tuple(block.part(r) for block, r in kept))
