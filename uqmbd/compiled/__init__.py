"""Compilation of kernels for eight realisations at once, and the store of compiled code."""

from __future__ import annotations

from uqmbd.compiled.assembly import EquationPrograms, Gradients, RotationCoordinates
from uqmbd.compiled.cache import cache_folder, cached, source_digest
from uqmbd.compiled.coupled import CoupledSystems, NodalSystems
from uqmbd.compiled.emission import Operation
from uqmbd.compiled.encounters import ContactPrograms, ControlLaws, Encounters, Happening, SampledControl, Touching
from uqmbd.compiled.explicit import (
    ORDER,
    STAGES,
    Constraints,
    Dynamics,
    ExplicitOptions,
    ExplicitStatus,
    IntegrationState,
    InterpolatedState,
    tableau,
)
from uqmbd.compiled.kernel import Kernel
from uqmbd.compiled.kernels import compilations, compile_kernel, compile_operations, replaced
from uqmbd.compiled.native import Target, addresses_of, host, object_code
from uqmbd.compiled.programs import Columns, Program, ProgramPart, ProgramWriter
from uqmbd.compiled.radau import ContactEntries, ImplicitEquations
from uqmbd.compiled.ranks import order_statistics
from uqmbd.compiled.recording import (
    FINE,
    PLACES,
    SERIES,
    FittedPolynomials,
    Need,
    PartTable,
    RecordedSteps,
    StepHistory,
)
from uqmbd.compiled.segments import SegmentTable, sum_harmonics
from uqmbd.compiled.store import Store
from uqmbd.compiled.tables import PATHS, PathTable
from uqmbd.compiled.writer import LANES

__all__ = [
    "FINE",
    "LANES",
    "ORDER",
    "PATHS",
    "PLACES",
    "PathTable",
    "SERIES",
    "STAGES",
    "Columns",
    "ContactEntries",
    "Constraints",
    "ContactPrograms",
    "ControlLaws",
    "CoupledSystems",
    "StepHistory",
    "Dynamics",
    "Encounters",
    "Happening",
    "EquationPrograms",
    "FittedPolynomials",
    "Gradients",
    "ImplicitEquations",
    "Kernel",
    "ExplicitOptions",
    "Need",
    "NodalSystems",
    "Operation",
    "ProgramPart",
    "PartTable",
    "RecordedSteps",
    "Program",
    "IntegrationState",
    "SampledControl",
    "SegmentTable",
    "ExplicitStatus",
    "InterpolatedState",
    "Store",
    "Target",
    "Touching",
    "RotationCoordinates",
    "ProgramWriter",
    "addresses_of",
    "cache_folder",
    "cached",
    "compilations",
    "compile_kernel",
    "compile_operations",
    "tableau",
    "host",
    "object_code",
    "order_statistics",
    "replaced",
    "source_digest",
    "sum_harmonics",
]
