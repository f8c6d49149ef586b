"""What is solved: derivation, kernels, model, ensemble, assembly, integration.

The only place that imports scikit-sundae and compiles with SymEngine.
"""

from __future__ import annotations

from uqmbd.dynamics.build import build, kinematic_model
from uqmbd.dynamics.capabilities import INTEGRATORS, Capability, Integrator, capabilities, require, require_for
from uqmbd.dynamics.check import Check, check
from uqmbd.dynamics.checked import checked, off_constraints
from uqmbd.dynamics.contact.contacts import Lens
from uqmbd.dynamics.contact.event_driven import Hybrid
from uqmbd.dynamics.ensemble import Ensemble
from uqmbd.dynamics.equations.model import Layout, Model
from uqmbd.dynamics.equations.terms import MechanismTerms, mechanism_terms
from uqmbd.dynamics.integrate import integrate
from uqmbd.dynamics.integration.prescribed import position_jumps
from uqmbd.dynamics.integration.trajectories import Counters, Trajectories
from uqmbd.dynamics.projection.ensemble import ProjectedEnsemble
from uqmbd.dynamics.projection.integrate import ProjectedTrajectories
from uqmbd.dynamics.statics.equilibrium import Equilibrium, static_equilibria
from uqmbd.dynamics.statics.modes import Modes, linearise
from uqmbd.dynamics.statics.timeless_outputs import ScalarValues, scalars_of

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
