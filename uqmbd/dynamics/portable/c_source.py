"""C source of kernels, programs and tables, for programs that run without uqmbd.

Kernels are translated from their LLVM IR, which has few operations (`uqmbd/compiled/writer.py`).
"""

from __future__ import annotations

import re
import struct
import zlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from importlib.resources import files
from typing import Any

import numpy as np

from uqmbd.compiled import PLACES, EquationPrograms, Kernel, ProgramPart, RotationCoordinates, tableau
from uqmbd.errors import StudyError

__all__ = ["SourceWriter", "driver_sources"]

PARTS = (
    "program",
    "tables",
    "contacts",
    "events",
    "projection",
    "lanes",
    "control",
    "turning",
    "attempt",
    "radau",
    "brief",
    "dense",
    "coulomb",
    "reserves",
    "collisions",
    "lasting",
    "limits",
    "decisions",
    "several",
    "dop853",
    "assembly",
)
"""Sources of the driver that an integration needs, in the order of their inclusion."""

HEADERS = ("program", "tables", "control", "events", "radau", "dop853", "group", "assembly")
"""Headers of these source files, without the header of vectors, which ``single_lane.h`` replaces."""

DECIDING = ("coulomb", "reserves", "collisions", "lasting", "limits", "decisions", "several")
"""Sources that only motions with contacts need; without contacts, ``undecided.c`` replaces them."""

_BINARY = {"fadd": "+", "fsub": "-", "fmul": "*", "fdiv": "/"}

_COMPARED = {"olt": "<", "ole": "<=", "ogt": ">", "oge": ">=", "oeq": "==", "une": "!="}

_INTRINSICS = {"maximum": "larger_number", "minimum": "smaller_number"}

_CONNECTED = {"and": "&", "or": "|", "xor": "^"}

HELPERS = """/* Largest and smallest numbers; NaN if one of them is NaN. */
#define HELPER static inline __attribute__((unused))
HELPER double larger_number(double a, double b) { return isnan(a) || isnan(b) ? NAN : a > b ? a : b; }
HELPER double smaller_number(double a, double b) { return isnan(a) || isnan(b) ? NAN : a < b ? a : b; }
"""


def driver_sources(*, contacts: bool) -> dict[str, str]:
    """Return the sources and headers of the driver for one realisation, by file name, with decisions about contacts."""
    folder, own = files("uqmbd.compiled").joinpath("source"), files("uqmbd.dynamics.portable")
    parts = [name for name in PARTS if contacts or name not in DECIDING]
    found = {
        name: folder.joinpath(name).read_text(encoding="utf-8")
        for name in (*(f"{name}.c" for name in parts), *(f"{name}.h" for name in HEADERS))
    }
    more = "waiting.c" if contacts else "undecided.c"
    found |= {name: own.joinpath(name).read_text(encoding="utf-8") for name in (more, "waiting.h")}
    found["vectors.h"] = own.joinpath("single_lane.h").read_text(encoding="utf-8")
    parts.insert(parts.index("assembly") if contacts else parts.index("dop853"), more.removesuffix(".c"))
    unit = "".join(f'#include "{name}.c"\n' for name in parts)
    return {**found, "driver.c": f"/* One translation unit. */\n{unit}"}


@dataclass
class _KernelBody:
    """Operations of kernels that differ only in the places of some arguments.

    `reads`: places of the arguments of the first kernel, in the order of the text. `moved`: indices in `reads` of the
    arguments that other kernels read from other places, all at the same distance; empty for a single kernel.
    """

    name: str
    part: int
    text: str
    reads: tuple[int, ...]
    moved: frozenset[int] = frozenset()


class SourceWriter:
    """C source that grows by kernels, tables and structures of the driver; equal contents are written once."""

    def __init__(self) -> None:
        self.parts = [HELPERS]
        self._names: dict[tuple[str, str], str] = {}
        self._kernels: dict[str, str] = {}
        self._bodies: dict[str, _KernelBody] = {}

    def integers(self, values: Any) -> str:
        """Return the name of a table of integers; NULL if it is empty."""
        return self._table("int64_t", [str(int(x)) for x in np.asarray(values).ravel().tolist()])

    def numbers(self, values: Any) -> str:
        """Return the name of a table of floating-point numbers; NULL if it is empty."""
        return self._table("double", [_number(float(x)) for x in np.asarray(values, dtype=float).ravel().tolist()])

    def texts(self, values: Sequence[str]) -> str:
        """Return the name of a table of texts of ASCII characters; NULL if it is empty."""
        return self._table("char *const", [_text(x) for x in values])

    def _table(self, kind: str, items: list[str]) -> str:
        if not items:
            return "NULL"
        body = ",\n    ".join(", ".join(items[k : k + 8]) for k in range(0, len(items), 8))
        name = self._names.get((kind, body))
        if name is None:
            name = self._names[kind, body] = f"t{len(self._names)}"
            self.parts.append(f"static const {kind} {name}[{len(items)}] = {{\n    {body}}};\n")
        return name

    def kernel(self, kernel: Kernel) -> str:
        """Return the name of the function of a kernel; raise StudyError if it looks up sampled paths."""
        if not kernel.code:
            return "NULL"
        if kernel.name not in self._kernels:
            name = f"k{len(self._kernels)}"
            source = zlib.decompress(kernel.source).decode()
            self._kernels[kernel.name] = self._add(name, _operations(source, self._constants(source)))
        return self._kernels[kernel.name]

    def _add(self, name: str, text: str) -> str:
        """Add a kernel and return its function; projections of positions and velocities share operations."""
        reads = tuple(map(int, _READ.findall(text)))
        form = _READ.sub("x[]", text)
        body = self._bodies.setdefault(form, _KernelBody(name, len(self.parts), text, reads))
        apart = {k: b - a for k, (a, b) in enumerate(zip(body.reads, reads, strict=True)) if a != b}
        if not apart and body.name != name:
            return body.name
        if len(set(apart.values())) != 1 or body.moved not in (frozenset(), frozenset(apart)):
            self.parts.append(_function(name, text))
            return name
        if not body.moved:
            body.moved = frozenset(apart)
            self.parts[body.part] = _shared(body) + _function(body.name, f"    shared_{body.name}(x, x, y);")
        distance = next(iter(apart.values()))
        self.parts.append(_function(name, f"    shared_{body.name}(x, x + {distance}, y);"))
        return name

    def _constants(self, source: str) -> dict[str, str]:
        """Return the names of the tables in C by their names in the source of a kernel."""
        return {
            name: self.numbers(np.frombuffer(bytes.fromhex(content.replace("\\", ""))))
            for name, content in _CONSTANT.findall(source)
        }

    def program(self, part: ProgramPart) -> str:
        """Return the value of a structure `Program`; raise StudyError if a step is a method of the driver."""
        rows = []
        for s in part.steps:
            if s.method:
                raise StudyError("the mechanism is too large for a compiled elimination")
            inputs, outputs, code = 0, 1, "NULL"
            if s.kernel is not None:
                inputs, outputs, code = s.kernel.inputs, s.kernel.outputs, self.kernel(s.kernel)
            reads = "NULL" if s.reads is None else self.integers(s.reads)
            starts = "NULL" if s.starts is None else self.integers(s.starts)
            rows.append(f"{{{code}, {reads}, {starts}, {s.count}, {inputs}, {outputs}, {s.first}, {s.to}, NULL, NULL}}")
        return f"{{{self._table('Step', rows)}, {len(rows)}, {part.scratch}}}"

    def equations(self, of: EquationPrograms) -> tuple[str, int]:
        """Return the value of a structure `Equations`, and its memory in vectors."""
        tables = of._tables
        names = {name: self.numbers(x) if name == "factors" else self.integers(x) for name, x in tables.items()}
        lower, entries, solved = len(tables["below"]), len(of.gradients.rows), len(of.solved)
        sizes = (of.program.rows, len(of.values), solved, of.certain, of.unknowns, entries, lower)
        order = "values starts columns from_ factors next ends others rows_of first below changes places owners".split()
        memory = of.program.rows + entries + 3 * len(of.values) + lower + 2 * solved + 3 * of.unknowns
        listed = ", ".join([*map(str, sizes), *(names[name] for name in order), _number(of.shortest)])
        return f"{{{self.program(of.program.part)}, {listed}}}", memory

    def turns(self, of: RotationCoordinates) -> str:
        """Return the value of a structure `Turns`."""
        bodies, size = of.coordinates.shape
        tables = f"{self.integers(of.coordinates)}, {self.integers(of.free)}"
        return f"{{{tables}, {bodies if size else 0}, {size}, {of.dimension}}}"

    def tableau(self) -> str:
        """Return the value of a structure `Tableau`."""
        _, (starts, index, *numbers) = tableau()
        tables = (self.integers(starts), self.integers(index), *map(self.numbers, numbers))
        return f"{{{', '.join(tables)}}}"

    def recorded_places(self) -> str:
        """Return the name of the table of places in a step at which states are recorded."""
        return self.numbers(PLACES)

    def source(self) -> str:
        """Return the source of all kernels and tables."""
        return "\n".join(self.parts)


def _number(value: float) -> str:
    if np.isnan(value):
        return "NAN"
    if np.isinf(value):
        return "INFINITY" if value > 0 else "-INFINITY"
    return repr(value)


def _text(value: str) -> str:
    """Return a string literal in C; characters outside ASCII are octal sequences of UTF-8."""
    plain = {34: '\\"', 92: "\\\\", 63: "\\?"}
    return '"' + "".join(plain.get(b) or (chr(b) if 32 <= b < 127 else f"\\{b:03o}") for b in value.encode()) + '"'


_TYPED = re.compile(r"<\d+ x (?:double|i1)> (%[\w.]+|splat \((?:double|i1) [^)]*\))")
"""Operand with its type."""

_OPERAND = re.compile(r"%[\w.]+|splat \((?:double|i1) [^)]*\)")


_CONSTANT = re.compile(r'^@(\S+) = private constant \[\d+ x i8\] c"([^"]*)"', re.MULTILINE)
"""Name and bytes of a table of numbers."""

_LOOKUP = re.compile(
    r"call void @look_up\(ptr @(\S+), ptr @(\S+), i64 (\d+), i64 (\d+), i64 (\d+), double (\S+), i64 \d+, "
    r"ptr %asked, ptr %answered\)"
)
"""Lookup of a table: its edges and rows, numbers of knots, terms and results, and its period."""


def _value(operand: str) -> str:
    """Return an operand in C."""
    if operand.startswith("%"):
        return operand[1:].replace(".", "_")
    text = operand[operand.index("(") + 1 : -1].split()[1]
    if text in ("true", "false"):
        return "1" if text == "true" else "0"
    found = _real(text)
    return f"({found})" if found.startswith("-") else found


def _real(text: str) -> str:
    """Return a number of LLVM, in hexadecimal digits of its bits, in C."""
    (number,) = struct.unpack(">d", bytes.fromhex(text[2:]))
    return _number(number)


_READ = re.compile(r"\bx\[(\d+)\]")
"""Place of an argument that a kernel reads."""


def _function(name: str, text: str) -> str:
    """Return the function of a kernel with these operations."""
    return "\n".join(
        [
            f"static void {name}(const V *arguments, V *results) {{",
            "    const double *x = (const double *)arguments;",
            "    double *y = (double *)results;",
            "    (void)x;",
            text,
            "}",
            "",
        ]
    )


def _shared(body: _KernelBody) -> str:
    """Return the function that several kernels call; each kernel passes the address of its moved arguments."""
    places = iter(range(len(body.reads)))
    text = _READ.sub(lambda found: f"{'z' if next(places) in body.moved else 'x'}[{found[1]}]", body.text)
    head = f"static void shared_{body.name}(const double *x, const double *z, double *y)"
    return f"{head} {{\n    (void)x;\n{text}\n}}\n\n"


def _operations(source: str, constants: Mapping[str, str]) -> str:
    """Translate the LLVM IR of a kernel to operations in C; `constants` are the names of its tables in C."""
    if "@look_up_path" in source:
        raise StudyError("an expression looks up a sampled path")
    room = 0
    body, addresses = list[tuple[str, str, str]](), dict[str, str]()  # type, result and text of each operation
    inside = False
    for line in source.splitlines():
        if line.startswith("define void"):
            inside = True
            continue
        if not inside or line.startswith(("br ", "ret ", "}")) or line.endswith(":"):
            inside = inside and not line.startswith("}")
            continue
        if found := _LOOKUP.match(line):
            edges, rows, knots, terms, numbers, period = found.groups()
            room = max(room, 1 + int(terms), int(numbers))
            listed = f"{constants[edges]}, {constants[rows]}, {knots}, {terms}, {numbers}, {_real(period)}"
            body.append(("", "", f"look_up({listed}, 1, asked, answered)"))
            continue
        if line.startswith("store "):
            value, place = _TYPED.findall(line)[0], line[line.index("ptr %") + 5 :].split(",")[0]
            body.append(("", addresses[place], _value(value)))
            continue
        target, _, operation = line.partition(" = ")
        if not target.startswith(("%v", "%looked")):
            continue  # the loop over the parts of a row
        result, word = _value(target), operation.split()[0]
        if word == "getelementptr":
            of, row = operation[operation.index("ptr %") + 5 :].split(", i64 ")
            addresses[result] = f"{of}[{row}]"
        elif word == "load":
            place = operation[operation.index("ptr %") + 5 :].split(",")[0]
            body.append(("const double ", result, addresses[place]))
        else:
            kind, text = _translated(word, operation)
            body.append((f"const {kind} ", result, text))
    return "\n".join(
        [
            *([f"    double asked[{room}], answered[{room}];"] if room else []),
            *(f"    {kind}{result}{' = ' if result else ''}{text};" for kind, result, text in _used(body)),
        ]
    )


def _used(body: Sequence[tuple[str, str, str]]) -> list[tuple[str, str, str]]:
    """Return the operations on which a result depends."""
    needed, found = set[str](), list[tuple[str, str, str]]()
    for kind, result, text in reversed(body):
        if not kind or result in needed:
            needed |= set(re.findall(r"v\d+|looked\d+_\d+", text))
            found.append((kind, result, text))
    return found[::-1]


def _translated(word: str, operation: str) -> tuple[str, str]:
    """Return the type and the C text of an operation of LLVM."""
    if word == "call":
        called = operation[operation.index("@") + 1 : operation.index("(")]
        listed = ", ".join(_value(x) for x in _TYPED.findall(operation[operation.index("(") :]))
        function = called.split(".")[1]
        return "double", f"{_INTRINSICS.get(function, function)}({listed})"
    if word == "select":
        mask, yes, no = (_value(x) for x in _TYPED.findall(operation))
        return "double", f"{mask} ? {yes} : {no}"
    values = [_value(x) for x in _OPERAND.findall(operation)]
    if word in _BINARY:
        return "double", f"{values[0]} {_BINARY[word]} {values[1]}"
    if word == "fneg":
        return "double", f"-{values[0]}"
    if word == "fcmp":
        how = operation.split()[1]
        if how == "one":
            return "int", f"{values[0]} < {values[1]} || {values[0]} > {values[1]}"
        return "int", f"{values[0]} {_COMPARED[how]} {values[1]}"
    return "int", f"{values[0]} {_CONNECTED[word]} {values[1]}"
