"""uqmbd: how uncertainty in lengths, masses, stiffnesses and loads spreads through a multi-body mechanism.

A study script describes a mechanism and its random variables once; every propagator runs on that one description and
the results come back as xarray data that can be laid side by side.  Everything below is loaded when it is first used,
so that ``import uqmbd`` costs next to nothing.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

from uqmbd.version import __version__

# name -> the module that defines it; the modules themselves are private, these names are the public interface
_WHERE = {
    "Mechanism": "uqmbd.mechanism",
    "Spatial": "uqmbd.mechanism",
    "Planar": "uqmbd.mechanism",
    "Translational": "uqmbd.mechanism",
    "Component": "uqmbd.mechanism",
    "Parameter": "uqmbd.mechanism",
    "Event": "uqmbd.mechanism",
    "Impact": "uqmbd.mechanism",
    "Kinetic": "uqmbd.mechanism",
    "Potential": "uqmbd.mechanism",
    "VirtualWork": "uqmbd.mechanism",
    "Constraint": "uqmbd.mechanism",
    "Auxiliary": "uqmbd.mechanism",
    "Separation": "uqmbd.mechanism",
    "Upright": "uqmbd.mechanism",
    "Local": "uqmbd.mechanism",
    "Frame": "uqmbd.mechanism",
    "aligned": "uqmbd.mechanism",
    "at_equilibrium": "uqmbd.mechanism",
    "damping_ratio": "uqmbd.mechanism",
    "eigenfrequency": "uqmbd.mechanism",
    "counted_angle": "uqmbd.mechanism",
    "half_angle": "uqmbd.mechanism",
    "joint_frames": "uqmbd.mechanism",
    "law_at": "uqmbd.mechanism",
    "law_values": "uqmbd.mechanism",
    "nominal": "uqmbd.mechanism",
    "quaternion_product": "uqmbd.mechanism",
    "relative_quaternion": "uqmbd.mechanism",
    "smallest_rotation": "uqmbd.mechanism",
    "perpendiculars": "uqmbd.mechanism",
    "t": "uqmbd.mechanism",
    "step": "uqmbd.mechanism",
    "RandomVariable": "uqmbd.randomness",
    "random_vector": "uqmbd.randomness",
    "GermBox": "uqmbd.randomness",
    "GermSpace": "uqmbd.randomness",
    "History": "uqmbd.propagation",
    "Quadrature": "uqmbd.randomness",
    "clenshaw_curtis": "uqmbd.randomness",
    "combination_coefficients": "uqmbd.randomness",
    "gauss_tensor": "uqmbd.randomness",
    "gram_error": "uqmbd.randomness",
    "index_set": "uqmbd.randomness",
    "monte_carlo_rule": "uqmbd.randomness",
    "smolyak": "uqmbd.randomness",
    "sparse_rule": "uqmbd.randomness",
    "simulate": "uqmbd.propagation",
    "static_equilibrium": "uqmbd.propagation",
    "eigenfrequencies": "uqmbd.propagation",
    "check": "uqmbd.dynamics",
    "Counters": "uqmbd.dynamics",
    "Ensemble": "uqmbd.dynamics",
    "Integrator": "uqmbd.dynamics",
    "MechanismTerms": "uqmbd.dynamics",
    "ProjectedEnsemble": "uqmbd.dynamics",
    "ProjectedTrajectories": "uqmbd.dynamics",
    "Segment": "uqmbd.dynamics",
    "SegmentedMotion": "uqmbd.dynamics",
    "Trajectories": "uqmbd.dynamics",
    "mechanism_terms": "uqmbd.dynamics",
    "ElementLimits": "uqmbd.propagation",
    "ElementRefinement": "uqmbd.propagation",
    "refine_elements": "uqmbd.propagation",
    "Estimate": "uqmbd.propagation",
    "Study": "uqmbd.propagation",
    "Propagator": "uqmbd.propagation",
    "Problem": "uqmbd.propagation",
    "Progress": "uqmbd.propagation",
    "Realisations": "uqmbd.propagation",
    "hookimpl": "uqmbd.plugins",
    "AssemblyError": "uqmbd.errors",
    "IntegrationError": "uqmbd.errors",
    "MethodFailedWarning": "uqmbd.errors",
    "PluginWarning": "uqmbd.errors",
    "RedundantConstraintWarning": "uqmbd.errors",
    "StudyError": "uqmbd.errors",
    "StudyWarning": "uqmbd.errors",
    "UnusedInputWarning": "uqmbd.errors",
    "UqmbdError": "uqmbd.errors",
}

# modules whose names are public, too
_MODULES = ("report", "results", "testing")

if TYPE_CHECKING:
    from uqmbd import report as report
    from uqmbd import results as results
    from uqmbd import testing as testing
    from uqmbd.dynamics import Counters as Counters
    from uqmbd.dynamics import Ensemble as Ensemble
    from uqmbd.dynamics import Integrator as Integrator
    from uqmbd.dynamics import MechanismTerms as MechanismTerms
    from uqmbd.dynamics import ProjectedEnsemble as ProjectedEnsemble
    from uqmbd.dynamics import ProjectedTrajectories as ProjectedTrajectories
    from uqmbd.dynamics import Segment as Segment
    from uqmbd.dynamics import SegmentedMotion as SegmentedMotion
    from uqmbd.dynamics import Trajectories as Trajectories
    from uqmbd.dynamics import check as check
    from uqmbd.dynamics import mechanism_terms as mechanism_terms
    from uqmbd.errors import AssemblyError as AssemblyError
    from uqmbd.errors import IntegrationError as IntegrationError
    from uqmbd.errors import MethodFailedWarning as MethodFailedWarning
    from uqmbd.errors import PluginWarning as PluginWarning
    from uqmbd.errors import RedundantConstraintWarning as RedundantConstraintWarning
    from uqmbd.errors import StudyError as StudyError
    from uqmbd.errors import StudyWarning as StudyWarning
    from uqmbd.errors import UnusedInputWarning as UnusedInputWarning
    from uqmbd.errors import UqmbdError as UqmbdError
    from uqmbd.mechanism import Auxiliary as Auxiliary
    from uqmbd.mechanism import Component as Component
    from uqmbd.mechanism import Constraint as Constraint
    from uqmbd.mechanism import Event as Event
    from uqmbd.mechanism import Frame as Frame
    from uqmbd.mechanism import Impact as Impact
    from uqmbd.mechanism import Kinetic as Kinetic
    from uqmbd.mechanism import Local as Local
    from uqmbd.mechanism import Mechanism as Mechanism
    from uqmbd.mechanism import Parameter as Parameter
    from uqmbd.mechanism import Planar as Planar
    from uqmbd.mechanism import Potential as Potential
    from uqmbd.mechanism import Separation as Separation
    from uqmbd.mechanism import Spatial as Spatial
    from uqmbd.mechanism import Translational as Translational
    from uqmbd.mechanism import Upright as Upright
    from uqmbd.mechanism import VirtualWork as VirtualWork
    from uqmbd.mechanism import aligned as aligned
    from uqmbd.mechanism import at_equilibrium as at_equilibrium
    from uqmbd.mechanism import counted_angle as counted_angle
    from uqmbd.mechanism import damping_ratio as damping_ratio
    from uqmbd.mechanism import eigenfrequency as eigenfrequency
    from uqmbd.mechanism import half_angle as half_angle
    from uqmbd.mechanism import joint_frames as joint_frames
    from uqmbd.mechanism import law_at as law_at
    from uqmbd.mechanism import law_values as law_values
    from uqmbd.mechanism import nominal as nominal
    from uqmbd.mechanism import perpendiculars as perpendiculars
    from uqmbd.mechanism import quaternion_product as quaternion_product
    from uqmbd.mechanism import relative_quaternion as relative_quaternion
    from uqmbd.mechanism import smallest_rotation as smallest_rotation
    from uqmbd.mechanism import step as step
    from uqmbd.mechanism import t as t
    from uqmbd.plugins import hookimpl as hookimpl
    from uqmbd.propagation import ElementLimits as ElementLimits
    from uqmbd.propagation import ElementRefinement as ElementRefinement
    from uqmbd.propagation import Estimate as Estimate
    from uqmbd.propagation import History as History
    from uqmbd.propagation import Problem as Problem
    from uqmbd.propagation import Progress as Progress
    from uqmbd.propagation import Propagator as Propagator
    from uqmbd.propagation import Realisations as Realisations
    from uqmbd.propagation import Study as Study
    from uqmbd.propagation import eigenfrequencies as eigenfrequencies
    from uqmbd.propagation import refine_elements as refine_elements
    from uqmbd.propagation import simulate as simulate
    from uqmbd.propagation import static_equilibrium as static_equilibrium
    from uqmbd.randomness import GermBox as GermBox
    from uqmbd.randomness import GermSpace as GermSpace
    from uqmbd.randomness import Quadrature as Quadrature
    from uqmbd.randomness import RandomVariable as RandomVariable
    from uqmbd.randomness import clenshaw_curtis as clenshaw_curtis
    from uqmbd.randomness import combination_coefficients as combination_coefficients
    from uqmbd.randomness import gauss_tensor as gauss_tensor
    from uqmbd.randomness import gram_error as gram_error
    from uqmbd.randomness import index_set as index_set
    from uqmbd.randomness import monte_carlo_rule as monte_carlo_rule
    from uqmbd.randomness import random_vector as random_vector
    from uqmbd.randomness import smolyak as smolyak
    from uqmbd.randomness import sparse_rule as sparse_rule

__all__ = [*sorted(_WHERE), *_MODULES, "__version__"]


def __getattr__(name: str) -> Any:  # noqa: ANN401 - whatever the public name stands for
    if name in _WHERE:
        value = getattr(importlib.import_module(_WHERE[name]), name)
        globals()[name] = value
        return value
    if name in _MODULES:
        return importlib.import_module(f"uqmbd.{name}")
    raise AttributeError(f"module 'uqmbd' has no attribute {name!r}")


def __dir__() -> list[str]:
    return __all__
