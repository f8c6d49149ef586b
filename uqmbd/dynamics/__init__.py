"""What is solved: derivation, kernels, model, ensemble, assembly, integration.

The only place that imports scikit-sundae and compiles with SymEngine.
"""

from __future__ import annotations

from uqmbd.dynamics.build import build, kinematic_model
from uqmbd.dynamics.capabilities import INTEGRATORS, Capability, Integrator, capabilities, require, require_for
from uqmbd.dynamics.check import Check, check
from uqmbd.dynamics.checked import checked, off_constraints
from uqmbd.dynamics.contact import Hybrid, Lens
from uqmbd.dynamics.ensemble import Ensemble
from uqmbd.dynamics.equations import Layout, MechanismTerms, Model, mechanism_terms
from uqmbd.dynamics.integrate import integrate
from uqmbd.dynamics.integration import Counters, Trajectories, position_jumps
from uqmbd.dynamics.projection import ProjectedEnsemble, ProjectedTrajectories
from uqmbd.dynamics.statics import Equilibrium, Modes, ScalarValues, linearise, scalars_of, static_equilibria

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
