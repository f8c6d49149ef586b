"""What is solved: derivation, kernels, model, ensemble, assembly, integration.

The only place that imports scikit-sundae and compiles with SymEngine.
"""

from __future__ import annotations

from uqmbd.dynamics.build import build, kinematic_model
from uqmbd.dynamics.check import Check, check
from uqmbd.dynamics.ensemble import Ensemble
from uqmbd.dynamics.equations import Layout, MechanismTerms, Model, mechanism_terms
from uqmbd.dynamics.integration import (
    Counters,
    Segment,
    SegmentedMotion,
    Trajectories,
    off_constraints,
    position_jumps,
)
from uqmbd.dynamics.integrators import (
    Capability,
    Integrator,
    ProjectedEnsemble,
    built_in_names,
    declares,
    integrate,
    integrator_class,
    integrators,
    require,
    require_for,
)
from uqmbd.dynamics.projection import ProjectedTrajectories
from uqmbd.dynamics.statics import Equilibrium, Modes, ScalarValues, linearise, scalars_of, static_equilibria

__all__ = [
    "Capability",
    "Check",
    "Counters",
    "Ensemble",
    "Equilibrium",
    "Integrator",
    "Layout",
    "MechanismTerms",
    "Model",
    "Modes",
    "ProjectedEnsemble",
    "ProjectedTrajectories",
    "ScalarValues",
    "Segment",
    "SegmentedMotion",
    "Trajectories",
    "build",
    "built_in_names",
    "check",
    "declares",
    "integrate",
    "integrator_class",
    "integrators",
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
