"""Driver of kernels: loops that are compiled ahead of time from ``source/*.c``, independent of any mechanism.

Its structures agree with the C sources in every field. Calls release the interpreter lock.

The driver has parts that most studies do not need, such as the decisions about events. The machine code of a part is
made when a study needs it, because all parts together take three times as long as the others.
"""

from __future__ import annotations

import ctypes
import hashlib
import json
from collections.abc import Sequence
from functools import cache
from importlib.resources import files
from typing import Any

import numpy as np

from uqmbd.compiled.cache import cached
from uqmbd.compiled.native import addresses_of, host, object_code
from uqmbd.compiled.writer import LANES
from uqmbd.typing import Array

__all__ = [
    "ENCOUNTERS",
    "PARTS",
    "POOL",
    "RECORDED",
    "SOURCES",
    "ContactsStruct",
    "ControlStruct",
    "CoupledStruct",
    "MotionStruct",
    "EncountersStruct",
    "EquationsStruct",
    "FittedStruct",
    "ImplicitStruct",
    "PartsStruct",
    "PoolStruct",
    "ProblemStruct",
    "ProgramStruct",
    "RangeStruct",
    "SegmentsStruct",
    "SourceStruct",
    "StepStruct",
    "TableauStruct",
    "TurnsStruct",
    "address",
    "aligned",
    "link",
    "load_driver",
]

SOURCES = 16
"""Maximum number of argument arrays of a program, as in program.h."""

_from_buffer: Any = ctypes.c_char.from_buffer

_INT, _DOUBLE, _POINTER = ctypes.c_int64, ctypes.c_double, ctypes.c_void_p


class StepStruct(ctypes.Structure):
    """``Step`` of program.h."""

    _fields_ = (
        *((name, _POINTER) for name in ("code", "reads", "starts")),
        *((name, _INT) for name in ("count", "inputs", "outputs", "first", "to")),
        *((name, _POINTER) for name in ("method", "context")),
    )


class ProgramStruct(ctypes.Structure):
    """``Program`` of program.h."""

    _fields_ = (("steps", _POINTER), ("count", _INT), ("scratch", _INT))


class SourceStruct(ctypes.Structure):
    """``Source`` of program.h."""

    _fields_ = (("data", _POINTER), *((name, _INT) for name in ("stride", "columns", "divisor", "modulus", "to")))


class TableauStruct(ctypes.Structure):
    """``Tableau`` of dop853.h."""

    _fields_ = tuple((name, _POINTER) for name in ("starts", "index", "weights", "moments", "points"))


class ProblemStruct(ctypes.Structure):
    """``Problem`` of dop853.h."""

    _fields_ = (
        *(
            (name, _INT)
            for name in ("terms", "blocks", "width", "coordinates", "velocities", "parameters", "time", "rows")
        ),
        ("motion", ProgramStruct),
        ("rate", _POINTER),
        *((name, _INT) for name in ("turning", "turn")),
        ("turns", _POINTER),
        ("values", ProgramStruct),
        *((name, ProgramStruct) for name in ("drift", "place", "move")),
        *((name, _POINTER) for name in ("surplus", "residuals")),
        *((name, _INT) for name in ("positions", "equations")),
        ("tableau", _POINTER),
        *((name, _DOUBLE) for name in ("rtol", "moving", "far", "surplus_allowed", "between", "stiff")),
        *((name, _INT) for name in ("patience", "early", "refusals", "attempts", "guarded", "brief", "instants")),
        ("times", _POINTER),
        *((name, _POINTER) for name in ("interval_ends", "interval_longest", "interval_jumps", "contacts", "places")),
        *(("room", _INT), ("implicit", _POINTER), ("control", _POINTER)),
    )


class ImplicitStruct(ctypes.Structure):
    """``Implicit`` of radau.h."""

    _fields_ = (
        ("stages", _INT),
        *((name, _POINTER) for name in ("nodes", "matrix", "inverse", "between", "error")),
        *(("eigenvalue", _DOUBLE), ("tolerance", _DOUBLE), ("iterations", _INT)),
        *(("motion", ProgramStruct), ("solution", _POINTER), ("gradients", ProgramStruct), ("rate", _POINTER)),
        ("multipliers", _INT),
        *((name, _INT) for name in ("states", "size", "entries", "given", "moving")),
        *((name, _POINTER) for name in ("rows", "columns", "inertia", "plain", "stiffness")),
        *((name, _POINTER) for name in ("pivots", "pivot_rows", "pivot_columns")),
        *((name, _POINTER) for name in ("below_starts", "below", "below_rows")),
        *((name, _POINTER) for name in ("beside_starts", "beside", "beside_columns", "targets")),
        *((name, _POINTER) for name in ("along", "across", "alone")),
    )


POOL = (
    *("z", "rate", "parameters"),
    *("now", "begin", "wanted", "tried", "floor", "limit"),
    *("interval", "last_interval", "first", "column", "status", "attempts", "refused", "stiff"),
    *("fresh", "rejected", "allowed", "trusted", "told", "steps", "known", "pause"),
    *("node_times", "nodes", "history", "result", "off", "poor"),
)
"""Arrays of a pool."""

RECORDED = ("path", "path_ends", "path_kept", "path_owner", "recorded")
"""Arrays of a pool with recorded steps."""


class PoolStruct(ctypes.Structure):
    """``Pool`` of dop853.h."""

    _fields_ = tuple((name, _POINTER) for name in (*POOL, *RECORDED, "encounters"))


class ContactsStruct(ctypes.Structure):
    """``Contacts`` of events.h."""

    _fields_ = (
        *(("events", _INT), ("directions", _INT), ("first", _POINTER)),
        *(("guards", ProgramStruct), ("guard", _POINTER), ("contact", ProgramStruct)),
        *((name, _POINTER) for name in ("gap", "law", "speed", "bias", "slope")),
        *(("size", _INT), ("entries", _INT)),
        *((name, _POINTER) for name in ("rows", "columns", "values", "right")),
        *(("factor", ProgramStruct), ("solve", ProgramStruct), ("side", _INT), ("solution", _POINTER)),
    )


ENCOUNTERS = (
    *("mode", "heading", "internal", "resting", "rise", "length", "slow"),
    *("happened", "noted", "mark", "mark_times", "mark_labels", "total", "restarts", "stalled", "clustered", "recent"),
    *("since", "fastest", "coarse", "starting", "turned", "later", "held", "arming"),
)
"""Arrays with events of contacts."""


class EncountersStruct(ctypes.Structure):
    """``Encounters`` of events.h."""

    _fields_ = (
        *((name, _POINTER) for name in ENCOUNTERS),
        *((name, _INT) for name in ("room", "watched", "decides", "reports")),
        *(("window", _DOUBLE), ("together", _DOUBLE)),
    )


class ControlStruct(ctypes.Structure):
    """``Control`` of control.h."""

    _fields_ = (
        *((name, _INT) for name in ("rows", "numbers", "loops", "entries")),
        *((name, _POINTER) for name in ("laws", "asked", "seen", "first", "commands", "direct", "residual")),
        ("poor", _DOUBLE),
        *((name, _POINTER) for name in ("result", "held", "acting", "sampled", "instants", "values", "low", "high")),
        *(("pending", _POINTER), ("places", _INT)),
        *((name, _POINTER) for name in ("instant", "measured", "answers", "answered")),
    )


class CoupledStruct(ctypes.Structure):
    """``Coupled`` of coupled.h."""

    _fields_ = (
        *((name, _INT) for name in ("terms", "nodes", "width", "coordinates", "size", "rates")),
        *((name, _POINTER) for name in ("psi", "adjoint", "work")),
        *((name, _INT) for name in ("rows", "time")),
        *((name, ProgramStruct) for name in ("values", "drift", "factor", "solve")),
        ("outside", _POINTER),
        *((name, _INT) for name in ("right", "guess")),
        *((name, _POINTER) for name in ("solution", "starts", "columns", "entries", "motion", "constraints", "rate")),
        *((name, _DOUBLE) for name in ("tolerance", "tolerance_drift", "worth")),
        *((name, _POINTER) for name in ("gesv", "counts", "correction", "memory", "times", "paces")),
    )


class EquationsStruct(ctypes.Structure):
    """``Equations`` of assembly.h."""

    _fields_ = (
        ("program", ProgramStruct),
        *((name, _INT) for name in ("rows", "equations", "solved", "certain", "unknowns", "entries", "lower")),
        *((name, _POINTER) for name in ("values", "starts", "columns", "from_", "factors")),
        *((name, _POINTER) for name in ("next", "ends", "others", "rows_of")),
        *((name, _POINTER) for name in ("first", "below", "changes", "places", "owners")),
        ("shortest", _DOUBLE),
    )


class TurnsStruct(ctypes.Structure):
    """``Turns`` of assembly.h."""

    _fields_ = (
        *((name, _POINTER) for name in ("coordinates", "free")),
        *((name, _INT) for name in ("bodies", "size", "dimension")),
    )


class SegmentsStruct(ctypes.Structure):
    """``Segments`` of segments.c."""

    _fields_ = (
        *((name, _INT) for name in ("segments", "outputs", "terms", "blocks")),
        *((name, _POINTER) for name in ("edges", "used", "counts", "starts", "coefficients")),
    )


class MotionStruct(ctypes.Structure):
    """``Course`` of parts.c."""

    _fields_ = (
        ("width", _INT),
        *((name, _POINTER) for name in ("owner", "row", "begin", "end", "last", "kept", "states")),
        *((name, _POINTER) for name in ("places", "weights")),
    )


class RangeStruct(ctypes.Structure):
    """``Seen`` of parts.c."""

    _fields_ = (
        *((name, _INT) for name in ("parameters", "inputs", "many")),
        ("outputs", ProgramStruct),
        *((name, _POINTER) for name in ("results", "block", "values")),
    )


PARTS = (
    *("step", "depth", "next", "whole", "beside", "low", "high", "begin", "end", "values", "coefficients"),
    *("error", "most", "least", "highest", "lowest", "mean", "first", "open", "allowed", "known"),
)
"""Arrays with data of parts of steps."""


class PartsStruct(ctypes.Structure):
    """``Parts`` of parts.c."""

    _fields_ = (
        ("course", _POINTER),
        *((name, _INT) for name in ("members", "outputs", "needs")),
        *((name, _POINTER) for name in ("kinds", "columns", "slack", "series", "fine", "weights")),
        ("share", _DOUBLE),
        *((name, _POINTER) for name in PARTS),
    )


class FittedStruct(ctypes.Structure):
    """``Fitted`` of peaks.c."""

    _fields_ = (
        *((name, _INT) for name in ("outputs", "column")),
        *((name, _POINTER) for name in ("values", "coefficients", "begin", "end", "fine", "places")),
    )


_FUNCTIONS: dict[str, tuple[Any, Sequence[Any]]] = {
    "run_program": (None, [_POINTER, _POINTER]),
    "evaluate": (None, [_POINTER, _POINTER, _POINTER, _INT, _INT, _INT, _POINTER, _INT, _POINTER]),
    "largest": (None, [_POINTER, _POINTER, _POINTER, _POINTER, _INT, _INT, _INT, _POINTER, _INT, _POINTER]),
    "advance_workspace": (_INT, [_POINTER]),
    "advance": (_INT, [_POINTER, _POINTER, _POINTER, _INT, _POINTER, _INT]),
    "project": (None, [_POINTER, _POINTER, _POINTER, _INT, _POINTER]),
    "coupled_memory": (_INT, [_POINTER]),
    "coupled_place": (None, [_POINTER, _POINTER]),
    "coupled_rate": (None, [_POINTER, _POINTER, _POINTER]),
    "coupled_excess": (None, [_POINTER, _POINTER, _POINTER]),
    "assembly_memory": (_INT, [_POINTER]),
    "close_poses": (None, [*[_POINTER] * 4, _INT, _INT, _POINTER, _INT, _POINTER, _POINTER]),
    "least_speeds": (None, [*[_POINTER] * 3, _INT, _INT, _POINTER, _POINTER]),
    "segment_edges": (None, [_POINTER, _INT, *[_POINTER] * 3]),
    "segment_values": (None, [_POINTER, *[_INT] * 4, *[_POINTER] * 4, _INT, _DOUBLE, _DOUBLE, _POINTER, _POINTER]),
    "part_states": (None, [_POINTER, _INT, *[_POINTER] * 5]),
    "observe_parts": (None, [_POINTER, _POINTER, _INT, *[_POINTER] * 5]),
    "refine_parts": (_INT, [_POINTER, _INT, _INT]),
    "part_peaks": (None, [_POINTER, _DOUBLE, _INT, *[_POINTER] * 3]),
    "least_so_far": (None, [_POINTER, _INT, _POINTER, _POINTER, _INT, _POINTER, _POINTER]),
    "list_parts": (_INT, [_POINTER, _POINTER]),
    "wave_values": (None, [*[_INT] * 8, *[_POINTER] * 11]),
    "order_statistics": (None, [_POINTER, _INT, _INT, _POINTER, _INT, _POINTER, _POINTER, _POINTER]),
    "sizes": (None, [_POINTER]),
}
"""Result and argument types of the functions."""


_LINKED = {"decisions": "decide_events", "implicit": "attempt_implicit"}
"""Function of a part that other parts of the driver call, through the pointer ``place_of_...`` in ``driver.bc``."""


def _object_code(part: str) -> bytes:
    """Return the object code of a part of the driver for this processor."""
    bitcode = files("uqmbd.compiled").joinpath(f"source/{part}.bc").read_bytes()
    found: bytes = cached(("driver", hashlib.sha256(bitcode).hexdigest(), host().digest), lambda: object_code(bitcode))
    return found


@cache
def _parts() -> dict[str, tuple[str, ...]]:
    """Return the names of the functions of each part that are called from Python."""
    listed = json.loads(files("uqmbd.compiled").joinpath("source/parts.json").read_text(encoding="utf-8"))
    found = {part: tuple(name for name in names if name in _FUNCTIONS) for part, names in listed.items()}
    apart = {name for names in found.values() for name in names}
    return {"driver": tuple(name for name in _FUNCTIONS if name not in apart), **found}


class _Driver:
    """The functions of the driver, as attributes; the first use of a function of a part loads the part."""

    def __init__(self) -> None:
        self._load("driver")
        kinds = (
            *(
                StepStruct,
                ProgramStruct,
                SourceStruct,
                TableauStruct,
                ProblemStruct,
                PoolStruct,
                CoupledStruct,
                ContactsStruct,
                EncountersStruct,
                EquationsStruct,
                TurnsStruct,
            ),
            *(SegmentsStruct, MotionStruct, RangeStruct, PartsStruct, FittedStruct, ImplicitStruct, ControlStruct),
        )
        found = np.zeros(len(kinds), dtype=np.int64)
        self.sizes(address(found))
        assert found.tolist() == [ctypes.sizeof(kind) for kind in kinds], (
            "driver.bc was not compiled from the installed sources"
        )

    def _load(self, part: str) -> None:
        names = _parts()[part]
        pointers = tuple(_pointer(one) for one in _LINKED) if part == "driver" else ()
        places = addresses_of((*names, *pointers), _object_code(part))
        for name, place in zip(names, places, strict=False):
            result, arguments = _FUNCTIONS[name]
            setattr(self, name, ctypes.CFUNCTYPE(result, *arguments)(place))
        for name, place in zip(pointers, places[len(names) :], strict=True):
            setattr(self, name, place)

    def __getattr__(self, name: str) -> Any:
        for part, names in _parts().items():
            if name in names:
                self._load(part)
                return self.__dict__[name]
        raise AttributeError(name)


def _pointer(part: str) -> str:
    """Return the name of the pointer to the function of a part."""
    return f"place_of_{_LINKED[part]}"


@cache
def link(part: str) -> None:
    """Load a part whose function the driver calls; every structure that leads to such calls requests this."""
    (function,) = addresses_of((_LINKED[part],), _object_code(part))
    ctypes.c_void_p.from_address(getattr(load_driver(), _pointer(part))).value = function


@cache
def load_driver() -> Any:
    """Load the driver once for each process."""
    return _Driver()


def address(array: np.ndarray[Any, Any] | None) -> int:
    """Return the address of the data of an array; 0 for None."""
    if array is None:
        return 0
    try:  # five times as fast as `array.ctypes`, which matters for single realisations
        return ctypes.addressof(_from_buffer(array))
    except (TypeError, ValueError):  # the array is empty, read-only, or not contiguous
        return array.ctypes.data


def aligned(rows: int) -> Array:
    """Make a zero work array of vectors, shape (rows, 8), aligned to 64 bytes, as kernels require."""
    room = np.zeros(rows * LANES + LANES)
    first = -(address(room) // 8) % LANES
    return room[first : first + rows * LANES].reshape(rows, LANES)
