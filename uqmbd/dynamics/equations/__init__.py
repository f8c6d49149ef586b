"""Derivation and compilation of the equations of a mechanism, and the model that contains them."""

from __future__ import annotations

from uqmbd.dynamics.equations.attached import acting, first_coordinates, links
from uqmbd.dynamics.equations.block import Instance, instances_of
from uqmbd.dynamics.equations.derivation import BlockSymbols, derive
from uqmbd.dynamics.equations.evaluator import Evaluator, Placement
from uqmbd.dynamics.equations.evaluators import FUSED_LIMIT, Blocks, Evaluators, Later, excitations_of
from uqmbd.dynamics.equations.expressions import TIME, plain
from uqmbd.dynamics.equations.layout import Layout, ParameterMap, state_arguments
from uqmbd.dynamics.equations.limits import Limit, impossible, limits_of, signs_of, squares_of
from uqmbd.dynamics.equations.model import Model, Statement, break_times
from uqmbd.dynamics.equations.outputs import OutputMap, angle_counters, output_map
from uqmbd.dynamics.equations.paths import PathFamily, path_families
from uqmbd.dynamics.equations.start_conditions import Conditions, compiled_conditions, inputs_of_conditions
from uqmbd.dynamics.equations.tables import Tables
from uqmbd.dynamics.equations.terms import MechanismTerms, mechanism_terms

__all__ = [
    "FUSED_LIMIT",
    "TIME",
    "Blocks",
    "Conditions",
    "BlockSymbols",
    "Evaluator",
    "Evaluators",
    "Instance",
    "Later",
    "Layout",
    "Limit",
    "MechanismTerms",
    "Model",
    "OutputMap",
    "ParameterMap",
    "PathFamily",
    "Placement",
    "Statement",
    "Tables",
    "acting",
    "angle_counters",
    "break_times",
    "compiled_conditions",
    "derive",
    "excitations_of",
    "first_coordinates",
    "impossible",
    "inputs_of_conditions",
    "instances_of",
    "limits_of",
    "links",
    "mechanism_terms",
    "output_map",
    "path_families",
    "plain",
    "signs_of",
    "squares_of",
    "state_arguments",
]
