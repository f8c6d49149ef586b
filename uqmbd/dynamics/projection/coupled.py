"""The projected index-1 system: accelerations and multipliers of coefficients.

The system ``Psi^T W A_k Psi x = Psi^T W b_k`` couples all coefficients.  It is solved by iteration: the nodal solution,
projected, is nearly right, as it differs by what the truncation leaves out; the remaining defect is reduced with the
nodal preconditioner ``Psi^T W A_k^-1 Psi`` and, where that alone converges slowly, by GMRES [1]_.  Where that takes
more iterations than a factorisation of the assembled system is worth, the latter is used for a while.  The driver does
all that (``coupled.c``); here is what it works on.

References
----------
.. [1] Y. Saad, M. H. Schultz, GMRES: a generalized minimal residual algorithm for solving nonsymmetric linear systems,
   SIAM J. Sci. Stat. Comput. 7 (1986) 856-869.
"""

from __future__ import annotations

import numpy as np

from uqmbd.compiled import CoupledSystems, Dynamics
from uqmbd.dynamics.equations import Model
from uqmbd.dynamics.linear import nodal_systems
from uqmbd.typing import Array

__all__ = ["Coupled"]


DRIFT = 1e-3
"""Relative accuracy of what a step exceeds the constraints by."""


class Coupled:
    """The projected system of a model, with a correction from its last solutions.

    The basis `psi` at the nodes is (K, P), `adjoint` is ``Psi^T W`` (P, K), and `block` holds the parameters of the
    nodes (K, parameter).  The driver solves, and counts, in `systems`.
    """

    def __init__(self, model: Model, psi: Array, adjoint: Array, block: Array) -> None:
        self.layout, self.nodal = model.layout, nodal_systems(model)
        library = self.nodal.library
        outside = None if library is None else library()
        self.systems = CoupledSystems(self.nodal.systems, psi, adjoint, block, outside)

    @property
    def compiled(self) -> bool:
        """Whether a solution is cheap enough for every stage of an explicit step."""
        return self.nodal.compiled

    @property
    def counters(self) -> dict[str, int]:
        """Systems and iterations so far; how often the system was assembled, or GMRES was needed."""
        systems, iterations, direct, krylov = self.systems.counts[:4].tolist()
        return {"systems": systems, "iterations": iterations, "direct": direct, "krylov": krylov}

    def dynamics(self, tolerance: float) -> Dynamics:
        """Return the equations of motion for the explicit integrator.

        Iterations for the accelerations end at a relative change of `tolerance`.
        """
        layout = self.layout
        self.systems.tolerances(tolerance, DRIFT)
        moving = layout.width - 2 * len(layout.frozen) - layout.held
        return self.systems.dynamics(layout.velocities, self.nodal.rated, moving, constrained=bool(layout.rank))

    def solve(self, state: Array, time: float, tolerance: float) -> tuple[Array, Array]:
        """Return accelerations and multipliers (P, size), and rates of the auxiliary states (P, state), at a time in s.

        The state (P, width) holds coefficients.  Iterations for the accelerations end at a relative change of
        `tolerance`; the results are NaN where they do not converge.
        """
        self.systems.tolerances(tolerance, tolerance)
        found, rated = self.systems.rate(time, state)
        rates = np.zeros((len(state), self.layout.states))
        rates[:, self.nodal.rated] = rated
        return found, rates

    def excess(self, state: Array, time: float, tolerance: float) -> tuple[Array, Array]:
        """By what coefficients of coordinates and velocities (P, coordinate) exceed the projected constraints."""
        self.systems.tolerances(tolerance, tolerance)
        return self.systems.excess(time, state)
