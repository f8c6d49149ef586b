"""Unknowns: a standard normal variable for each input, each bias coefficient, and each noise level."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from uqmbd.typing import Array

__all__ = ["LEVEL_SPREAD", "Level", "UnknownInput", "Unknowns"]


LEVEL_SPREAD = 3.0
"""Standard deviation of the logarithm of an unknown noise level: a factor of about twenty up and down."""


@dataclass(frozen=True)
class UnknownInput:
    """Unknown input of all machines or of one machine."""

    name: str  # ``stiffness``, or ``stiffness[rig 2]`` for one machine
    input: int  # index of the input in the study
    machine: str = ""  # name of the machine; empty for all machines


@dataclass(frozen=True)
class Level:
    """Unknown noise level with a lognormal prior."""

    # output, units: output with this noise, and its units
    output: str
    units: str
    median: float  # a tenth of the standard deviation of the recorded values

    @property
    def name(self) -> str:
        """Name of the level in the results."""
        return f"noise[{self.output}]"


@dataclass(frozen=True)
class Unknowns:
    """Vector of all unknowns as independent standard normal variables: inputs, coefficients, noise levels."""

    inputs: tuple[UnknownInput, ...]
    coefficients: int
    levels: tuple[Level, ...]

    @property
    def dimension(self) -> int:
        """Length of the vector."""
        return len(self.inputs) + self.coefficients + len(self.levels)

    @property
    def first_level(self) -> int:
        """Index of the first level."""
        return len(self.inputs) + self.coefficients

    def noise(self, vectors: Array) -> Array:
        """Return the noise levels (K, level), in the units of their outputs."""
        medians = np.array([level.median for level in self.levels])
        return np.asarray(medians * np.exp(LEVEL_SPREAD * vectors[:, self.first_level :]))
