"""What is solved: derivation, kernels, model, ensemble, assembly, integration.

The only place that imports scikit-sundae and compiles with SymEngine.
"""

from __future__ import annotations

from uqmbd.dynamics.build import build, kinematic_model
from uqmbd.dynamics.capabilities import INTEGRATORS, Capability, Integrator, capabilities, require, require_for
from uqmbd.dynamics.check import Check, check
from uqmbd.dynamics.checked import checked, off_constraints
from uqmbd.dynamics.contacts import Lens
from uqmbd.dynamics.ensemble import Ensemble
from uqmbd.dynamics.hybrid import Hybrid
from uqmbd.dynamics.integration import integrate
from uqmbd.dynamics.linearisation import Modes, linearise
from uqmbd.dynamics.model import Layout, Model
from uqmbd.dynamics.prescribed import position_jumps
from uqmbd.dynamics.projected import ProjectedEnsemble
from uqmbd.dynamics.projected_integration import ProjectedTrajectories
from uqmbd.dynamics.scalars import ScalarValues, scalars_of
from uqmbd.dynamics.statics import Equilibrium, static_equilibria
from uqmbd.dynamics.terms import MechanismTerms, mechanism_terms
from uqmbd.dynamics.trajectories import Counters, Trajectories

__all__ = [
    "Capability",
    "Check",
    "Counters",
    "Ensemble",
    "Equilibrium",
    "Hybrid",
    "INTEGRATORS",
    "Integrator",
    "Layout",
    "Lens",
    "MechanismTerms",
    "Model",
    "Modes",
    "ProjectedEnsemble",
    "ProjectedTrajectories",
    "ScalarValues",
    "Trajectories",
    "build",
    "capabilities",
    "check",
    "checked",
    "integrate",
    "kinematic_model",
    "linearise",
    "mechanism_terms",
    "off_constraints",
    "position_jumps",
    "require",
    "require_for",
    "scalars_of",
    "static_equilibria",
]
