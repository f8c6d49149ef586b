"""Dynamics: derivation of the equations, kernels, model, ensemble, assembly, integration.

Only this package imports scikit-sundae. `uqmbd.compiled` compiles the SymEngine expressions that it derives.
"""

from __future__ import annotations

from uqmbd.dynamics.assembly import positions
from uqmbd.dynamics.code_key import compute_code_key
from uqmbd.dynamics.contents import content_key
from uqmbd.dynamics.drawn_pose import moves
from uqmbd.dynamics.ensemble import Ensemble, referenced
from uqmbd.dynamics.equations import (
    BlockSymbols,
    Instance,
    Layout,
    MechanismTerms,
    Model,
    ParameterMap,
    derive,
    instances_of,
    mechanism_terms,
)
from uqmbd.dynamics.integration import Counters, Segment, SegmentedMotion, Trajectories, off_constraints, position_jumps
from uqmbd.dynamics.integrators import (
    Capabilities,
    Capability,
    Ida,
    Integrator,
    ProjectedEnsemble,
    built_in_names,
    capabilities_of,
    integrate,
    integrator_class,
    integrators,
    require,
    require_for,
)
from uqmbd.dynamics.margins import MarginValues, margins_of
from uqmbd.dynamics.mechanism_check import Check, check
from uqmbd.dynamics.model_building import build, constraining, kinematic_model
from uqmbd.dynamics.observation import undetermined_contacts
from uqmbd.dynamics.portable import MotionCommand, PortableMotion, motion_refusal, motion_source
from uqmbd.dynamics.projection import PhaseMotion, ProjectedTrajectories
from uqmbd.dynamics.risks import Risk, find_risks, range_findings
from uqmbd.dynamics.sampled_paths import numbers_of
from uqmbd.dynamics.statics import (
    Equilibrium,
    Modes,
    ScalarMap,
    ScalarValues,
    has_dry_friction,
    linearise,
    linearise_steady,
    ranges_by_friction,
    scalars_of,
    static_equilibria,
    steady_motions,
)
from uqmbd.dynamics.summaries import running_minimum

__all__ = [
    "Capabilities",
    "Capability",
    "Check",
    "Counters",
    "BlockSymbols",
    "Ensemble",
    "Equilibrium",
    "Instance",
    "Ida",
    "Integrator",
    "Layout",
    "MarginValues",
    "MechanismTerms",
    "Model",
    "Modes",
    "ParameterMap",
    "PhaseMotion",
    "MotionCommand",
    "PortableMotion",
    "motion_refusal",
    "motion_source",
    "ProjectedEnsemble",
    "ProjectedTrajectories",
    "Risk",
    "ScalarMap",
    "ScalarValues",
    "Segment",
    "SegmentedMotion",
    "Trajectories",
    "build",
    "built_in_names",
    "capabilities_of",
    "check",
    "compute_code_key",
    "content_key",
    "constraining",
    "derive",
    "instances_of",
    "integrate",
    "integrator_class",
    "numbers_of",
    "integrators",
    "kinematic_model",
    "linearise",
    "linearise_steady",
    "margins_of",
    "mechanism_terms",
    "moves",
    "off_constraints",
    "position_jumps",
    "positions",
    "range_findings",
    "referenced",
    "require",
    "require_for",
    "find_risks",
    "running_minimum",
    "scalars_of",
    "has_dry_friction",
    "ranges_by_friction",
    "static_equilibria",
    "steady_motions",
    "undetermined_contacts",
]
