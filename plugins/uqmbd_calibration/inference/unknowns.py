"""Unknowns: a standard normal variable for each input, each coefficient of a bias, and each noise level."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from uqmbd.typing import Array

__all__ = ["LEVEL_SPREAD", "Level", "UnknownInput", "Unknowns"]


LEVEL_SPREAD = 3.0
"""Standard deviation of the logarithm of an unknown noise level: a factor of twenty up and down."""


@dataclass(frozen=True)
class UnknownInput:
    """An unknown input, of all machines or of one."""

    name: str  # ``stiffness``, or ``stiffness[rig 2]`` of one machine
    input: int  # which of the inputs of the study
    machine: str = ""  # empty: of all


@dataclass(frozen=True)
class Level:
    """A noise level that is to be found: lognormal a priori."""

    # output, units: whose noise
    output: str
    units: str
    median: float  # a tenth of the spread of the recorded values

    @property
    def name(self) -> str:
        """Name in the results."""
        return f"noise[{self.output}]"


@dataclass(frozen=True)
class Unknowns:
    """All that is unknown, as one vector of independent standard normal variables: inputs, coefficients, levels."""

    inputs: tuple[UnknownInput, ...]
    coefficients: int
    levels: tuple[Level, ...]

    @property
    def dimension(self) -> int:
        """Length of the vector."""
        return len(self.inputs) + self.coefficients + len(self.levels)

    @property
    def first_level(self) -> int:
        """Place of the first level."""
        return len(self.inputs) + self.coefficients

    def noise(self, vectors: Array) -> Array:
        """Return the noise levels (K, level), in the units of their outputs."""
        medians = np.array([level.median for level in self.levels])
        return np.asarray(medians * np.exp(LEVEL_SPREAD * vectors[:, self.first_level :]))
