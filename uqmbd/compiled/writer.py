"""LLVM IR of one straight-line function, as text.

This module writes text in 1.1 to 1.6 us per operation; `llvmlite.ir`, which also checks types, takes 12 to 17 us
(measured with 4,000 operations). LLVM checks the text in both cases. Equal operations on equal values are written once.
"""

from __future__ import annotations

import itertools
import struct
from collections.abc import Sequence

from uqmbd.compiled.tables import PATH_NUMBERS, IntervalTable, PathTable, table_constants

__all__ = ["LANES", "Masks", "FunctionWriter"]

LANES = 8
"""Number of realisations in a row."""

LONG = 800
"""Minimum number of lines of a function with the native vectors of the processor, in a loop over the parts of a row.

Whole rows are up to 1.3 times faster in short functions, because operations wait for each other. In long functions they
are not faster, because values leave the registers, and their compilation takes twice as long."""

BLOCK = 400
"""Number of lines of a block: the scheduling time of LLVM grows faster than the length of a block.

Blocks halve the compile time of the longest functions, with code of the same speed (measured)."""


class FunctionWriter:
    """Body of one function: lines with KIND and MASK as placeholders of vector types.

    The vector types, whole rows or parts, are chosen after all lines are written.
    """

    def __init__(self) -> None:
        self.lines: list[str] = []
        self.called: dict[str, int] = {}  # number of arguments of each function of the C library
        self.intrinsics: dict[str, int] = {}
        self.tables: dict[str, IntervalTable] = {}
        self._paths = False  # whether sampled paths are looked up
        self._room = 0  # number of vectors that are passed to and from the lookup function
        self._known: dict[str, str] = {}

    def made(self, operation: str) -> str:
        """Return the name of the value of an operation; equal operations are written once."""
        name = self._known.get(operation)
        if name is None:
            name = self._known[operation] = f"%v{len(self._known)}"
            self.lines.append(f"{name} = {operation}")
        return name

    def load(self, row: int) -> str:
        """Return the value of an argument."""
        place = self.made(f"getelementptr <{LANES} x double>, ptr %x, i64 {row}")
        return self.made(f"load KIND, ptr {place}, align ALIGNMENT")

    def store(self, row: int, value: str) -> None:
        """Write a result."""
        place = self.made(f"getelementptr <{LANES} x double>, ptr %y, i64 {row}")
        self.lines.append(f"store KIND {value}, ptr {place}, align ALIGNMENT")

    def number(self, value: float) -> str:
        """Return a constant."""
        return f"splat (double {_double(value)})"

    def add(self, a: str, b: str) -> str:
        """Return ``a + b``."""
        return self.made(f"fadd contract KIND {a}, {b}")

    def subtract(self, a: str, b: str) -> str:
        """Return ``a - b``."""
        return self.made(f"fsub contract KIND {a}, {b}")

    def multiply(self, a: str, b: str) -> str:
        """Return ``a b``."""
        a, b = sorted((a, b))
        return self.made(f"fmul contract KIND {a}, {b}")

    def divide(self, a: str, b: str) -> str:
        """Return ``a / b``."""
        return self.made(f"fdiv contract KIND {a}, {b}")

    def negate(self, a: str) -> str:
        """Return ``-a``."""
        return self.made(f"fneg contract KIND {a}")

    def compare(self, how: str, a: str, b: str) -> str:
        """Return the mask of a comparison, by its name in LLVM."""
        return self.made(f"fcmp {how} KIND {a}, {b}")

    def select(self, mask: str, a: str, b: str) -> str:
        """Return `a` where the mask is true, else `b`."""
        return self.made(f"select MASK {mask}, KIND {a}, KIND {b}")

    def intrinsic(self, name: str, *values: str) -> str:
        """Return the value of an LLVM intrinsic."""
        self.intrinsics[name] = len(values)
        listed = ", ".join(f"KIND {x}" for x in values)
        return self.made(f"call KIND @llvm.{name}.vWIDTHf64({listed})")

    def call(self, name: str, *values: str) -> str:
        """Call a function of the C library in each lane."""
        self.called[name] = len(values)
        listed = ", ".join(f"KIND {x}" for x in values)
        return self.made(f"call KIND @lanes.{name}({listed})")

    def look_up(self, name: str, table: IntervalTable | PathTable, values: Sequence[str]) -> list[str]:
        """Return the numbers of a table at an argument, optionally with further terms."""
        if isinstance(table, PathTable):
            self._paths, numbers = True, PATH_NUMBERS
            call = "look_up_path(i64 WIDTH, ptr %asked, ptr %answered)"
        else:
            knots, terms, numbers = len(table.edges), table.rows.shape[1] - 1, table.rows.shape[2]
            self.tables[name] = table
            call = (
                f"look_up(ptr @edges.{name}, ptr @rows.{name}, i64 {knots}, i64 {terms}, i64 {numbers}, "
                f"double {_double(table.period)}, i64 WIDTH, ptr %asked, ptr %answered)"
            )
        self._room = max(self._room, len(values), numbers)
        found = [f"%looked{len(self.lines)}.{k}" for k in range(numbers)]
        for k, value in enumerate(values):
            place = self.made(f"getelementptr KIND, ptr %asked, i64 {k}")
            self.lines.append(f"store KIND {value}, ptr {place}")
        self.lines.append(f"call void @{call}")
        for k, value in enumerate(found):
            place = self.made(f"getelementptr KIND, ptr %answered, i64 {k}")
            self.lines.append(f"{value} = load KIND, ptr {place}")
        return found

    def power(self, base: str, exponent: int) -> str:
        """Return a positive integer power, by multiplications."""
        result, square = "", base
        while exponent:
            if exponent & 1:
                result = self.multiply(result, square) if result else square
            exponent >>= 1
            if exponent:
                square = self.multiply(square, square)
        return result

    def text(self, name: str, native: int) -> str:
        """Return the LLVM module of the function for a processor with `native` lanes."""
        width = native if len(self.lines) > LONG else LANES
        whole = width == LANES
        x, y = ("x", "y") if whole else ("rows", "results")
        parts = []
        for function, count in self.intrinsics.items():
            parts.append(f"declare KIND @llvm.{function}.vWIDTHf64({', '.join(['KIND'] * count)})\n")
        parts += [self._lanes(function, count, width) for function, count in self.called.items()]
        if self.tables:
            parts.append("declare void @look_up(ptr, ptr, i64, i64, i64, double, i64, ptr, ptr) nounwind\n")
        if self._paths:
            parts.append("declare void @look_up_path(i64, ptr, ptr) nounwind\n")
        parts.append(f"define void @{name}(ptr noalias %{x}, ptr noalias %{y}) nounwind {{\n")
        if self._room:
            parts += [f"%{room} = alloca [{self._room} x KIND]\n" for room in ("asked", "answered")]
        if not whole:
            parts.append(
                "br label %part\npart:\n%lane = phi i64 [ 0, %0 ], [ %next, %last ]\n"
                "%x = getelementptr double, ptr %rows, i64 %lane\n%y = getelementptr double, ptr %results, i64 %lane\n"
            )
        parts += self._blocks()
        if not whole:
            parts.append(
                f"br label %last\nlast:\n%next = add i64 %lane, WIDTH\n%more = icmp ult i64 %next, {LANES}\n"
                "br i1 %more, label %part, label %end\n"
            )
        else:
            parts.append("br label %end\n")
        text = "".join([*parts, "end:\nret void\n}\n"])
        for token, meant in (
            ("KIND", f"<{width} x double>"),
            ("MASK", f"<{width} x i1>"),
            ("ALIGNMENT", str(8 * width)),
            ("WIDTH", str(width)),
        ):
            text = text.replace(token, meant)
        return text + "".join(table_constants(*entry) for entry in self.tables.items())

    def _blocks(self) -> list[str]:
        """Return the lines, split into basic blocks by branches that LLVM cannot remove."""
        edges = [0]
        for k, line in enumerate(self.lines, 1):
            # do not split between a product and a sum, which may be contracted
            if k - edges[-1] >= BLOCK and len(self.lines) - k >= BLOCK and " = fmul" not in line:
                edges.append(k)
        found = ["%never = icmp eq ptr %x, null\n"] if len(edges) > 1 else []
        for k, (begin, end) in enumerate(itertools.pairwise([*edges, len(self.lines)])):
            found += [f"br i1 %never, label %end, label %block{k}\nblock{k}:\n"] if k else []
            found += ["\n".join(self.lines[begin:end]), "\n"]
        return found

    @staticmethod
    def _lanes(name: str, count: int, width: int) -> str:
        """Write a vector function that calls a C library function in each lane."""
        lines = [f"declare double @{name}({', '.join(['double'] * count)}) nounwind"]
        names = [f"%a{k}" for k in range(count)]
        listed = ", ".join(f"KIND {a}" for a in names)
        lines.append(f"define internal KIND @lanes.{name}({listed}) noinline nounwind {{")
        result = "poison"
        for lane in range(width):
            lines += [f"{a}.{lane} = extractelement KIND {a}, i32 {lane}" for a in names]
            lines.append(f"%f{lane} = call double @{name}({', '.join(f'double {a}.{lane}' for a in names)}) nounwind")
            lines.append(f"%r{lane} = insertelement KIND {result}, double %f{lane}, i32 {lane}")
            result = f"%r{lane}"
        return "\n".join([*lines, f"ret KIND {result}", "}", ""])


class Masks:
    """Names of masks; for comparisons of values that may not be real, also the masks where they are certainly false."""

    def __init__(self) -> None:
        # for each mask, the mask of lanes in which it is certainly false; None: its negation
        self.surely_false: dict[str, str | None] = {}
        # values that may not be real numbers
        self.partial: set[str] = set()

    def __contains__(self, name: str) -> bool:
        return name in self.surely_false

    def noted(self, name: str, false: str | None = None) -> str:
        """Record a mask, and the mask of lanes in which it is certainly false, if it differs from the negation."""
        self.surely_false[name] = false
        return name

    def defined(self, *names: str) -> bool:
        """Return whether masks are defined, true or false, everywhere."""
        return all(self.surely_false[name] is None for name in names)

    def false(self, w: FunctionWriter, name: str) -> str:
        """Return the mask of lanes in which another mask is certainly false."""
        return self.surely_false[name] or w.made(f"xor MASK {name}, splat (i1 true)")


def _double(value: float) -> str:
    """Write a number exactly."""
    return f"0x{struct.pack('>d', value).hex().upper()}"
