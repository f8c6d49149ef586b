"""Implicit steps of the driver: Radau IIA methods, and the sparse systems of their iterations.

References
----------
.. [1] E. Hairer, G. Wanner, Solving Ordinary Differential Equations II, 2nd ed., Springer 1996, IV.5 and IV.8.
.. [2] E. Hairer, G. Wanner, Stiff differential equations solved by Radau methods, J. Comput. Appl. Math. 111 (1999)
   93-111.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache, cached_property

import numpy as np

from uqmbd.compiled import driver as c
from uqmbd.compiled.driver import address
from uqmbd.compiled.programs import Addressed, ProgramPart
from uqmbd.typing import Array, Index

__all__ = ["ContactEntries", "ImplicitEquations", "RadauMethod", "radau_method"]

TOLERANCE = 0.003
"""Largest error of the stages due to the iteration, in tolerances of the step."""
ITERATIONS = 8
"""Largest number of iterations of a step."""


MATRICES = (0.0, 1 / 3, 2 / 3, 1.0)
"""Parts of a step at which matrices are evaluated; matrices at the stages are interpolated."""


@dataclass(frozen=True)
class RadauMethod:
    """Coefficients of a Radau IIA method with 3 or 5 stages, of order 5 or 9."""

    nodes: Array  # (stage,): times of the stages, as parts of a step
    matrix: Array  # (stage, stage): A
    inverse: Array  # (stage, stage): inverse of A
    between: Array  # (stage, 3): weights of the matrices of a step at its stages
    # (stage,): weights of the stages in the error estimate; the rate at the start has the weight 1 / `eigenvalue`
    error: Array
    eigenvalue: float  # real eigenvalue of the inverse of A


@cache
def radau_method(stages: int) -> RadauMethod:
    """Return the method with 3 or 5 stages.

    The nodes are the roots of ``d^(s-1)/dx^(s-1) [x^(s-1) (x - 1)^s]``.

    >>> radau_method(3).nodes.round(12).tolist()  # (4 -+ sqrt(6)) / 10 and 1
    [0.155051025722, 0.644948974278, 1.0]
    """
    from numpy.polynomial import Polynomial

    s, powers = stages, np.arange(1, stages + 1)
    nodes = np.sort((Polynomial([0, 1]) ** (s - 1) * Polynomial([-1, 1]) ** s).deriv(s - 1).roots().real)
    nodes[-1] = 1.0
    vandermonde = nodes[:, None] ** (powers - 1)
    matrix = (nodes[:, None] ** powers / powers) @ np.linalg.inv(vandermonde)
    inverse = np.linalg.inv(matrix)
    values = np.linalg.eigvals(inverse)
    eigenvalue = float(values[np.argmin(np.abs(values.imag))].real)
    # the embedded formula uses the rate at the start with the weight 1 / eigenvalue, and has the order `stages`
    right = 1 / powers
    right[0] -= 1 / eigenvalue
    error = np.linalg.solve(matrix.T, np.linalg.solve(vandermonde.T, right) - matrix[-1])
    at = np.array(MATRICES)
    between = np.stack(
        [np.prod([(nodes - y) / (x - y) for y in at if y != x], axis=0) for x in at], axis=1
    )  # Lagrange's polynomials
    arrays = [np.ascontiguousarray(x) for x in (nodes, matrix, inverse, between, error)]
    return RadauMethod(arrays[0], arrays[1], arrays[2], arrays[3], arrays[4], eigenvalue)


@dataclass(frozen=True)
class ContactEntries:
    """Entries of persistent contacts in the systems: an equation and a force for each direction."""

    along: Index  # (direction, coordinate): index of each entry of the equations among the given entries; -1: zero
    across: Index  # (direction, coordinate): index of each entry of the forces among the given entries; -1: zero
    alone: Index  # (direction,): index of each entry on the diagonal among the given entries


@dataclass(frozen=True)
class ImplicitEquations(Addressed):
    """Derivatives of the equations of motion, and elimination of the systems of an iteration (radau.h).

    Rows refer to the work array of `Dynamics`; row -1 of `inertia` is one.
    """

    stages: int
    motion: ProgramPart  # maps a state to accelerations and multipliers
    solution: Index  # (coordinate + multiplier,): rows of accelerations and multipliers
    gradients: ProgramPart  # derivatives, after the motion
    rate: Index  # (width,): rows of the rate
    multipliers: int  # number of multipliers
    states: int  # number of auxiliary states
    size: int  # number of unknowns: velocities, auxiliary states, multipliers
    entries: int  # number of entries of a matrix, with fill
    moving: int  # number of given entries with inertia, which are the first ones
    rows: Index  # (given,): rows of the given entries, which are the first entries
    columns: Index  # (given,): columns of the given entries
    inertia: Index  # (given,): rows of the values that are multiplied by eta
    plain: Index  # (given,): rows of the values that are added
    stiffness: Index  # (given,): rows of the values that are divided by eta
    pivots: Index  # (size,): entries in the order of elimination
    pivot_rows: Index  # (size,): rows of these entries
    pivot_columns: Index  # (size,): columns of these entries
    below_starts: Index  # (size + 1,): first of the entries below each pivot, and the end
    below: Index  # entries below pivots
    below_rows: Index  # rows of these entries
    beside_starts: Index  # (size + 1,): first of the entries next to each pivot, and the end
    beside: Index  # entries next to pivots
    beside_columns: Index  # columns of these entries
    targets: Index  # for each entry below a pivot and each entry next to it: entry that changes
    contacts: ContactEntries | None = None

    @property
    def matrix_operations(self) -> int:
        """Return the number of row operations of the matrices of a step."""
        return len(MATRICES) * (self.motion.operations + self.gradients.operations)

    @property
    def factor_operations(self) -> int:
        """Return the number of row operations of the factorisation of a step."""
        blocks = self.size + len(self.below) + len(self.targets)
        return self.stages**3 * blocks + len(MATRICES) * len(self.rows)

    @property
    def solution_operations(self) -> int:
        """Return the number of row operations of the solutions of an iteration."""
        blocks = self.size + len(self.below) + len(self.beside)
        return self.stages**2 * blocks + self.stages * self.moving

    @cached_property
    def structure(self) -> c.ImplicitStruct:
        """Return the C structure for the driver."""
        c.link("implicit")
        method, parts = radau_method(self.stages), (self.motion.structure, self.gradients.structure)
        coefficients = (method.nodes, method.matrix, method.inverse, method.between, method.error)
        touching = self.contacts
        contacts: tuple[Index | None, ...] = (None,) * 3
        if touching is not None:
            contacts = (touching.along, touching.across, touching.alone)
        found = c.ImplicitStruct(
            *(self.stages, *map(address, coefficients)),
            *(method.eigenvalue, TOLERANCE, ITERATIONS),
            *(parts[0], address(self.solution), parts[1], address(self.rate)),
            self.multipliers,
            *(self.states, self.size, self.entries, len(self.rows), self.moving),
            *map(address, (self.rows, self.columns, self.inertia, self.plain, self.stiffness)),
            *map(address, (self.pivots, self.pivot_rows, self.pivot_columns)),
            *map(address, (self.below_starts, self.below, self.below_rows)),
            *map(address, (self.beside_starts, self.beside, self.beside_columns, self.targets)),
            *map(address, contacts),
        )
        found.kept = method, parts
        return found
