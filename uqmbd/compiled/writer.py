"""LLVM IR of one straight-line function, as text.

The text is written directly: `llvmlite.ir` does the same and checks types as well, but takes 12 to 17 us for an
operation; this module takes 1.1 to 1.6 us (measured, 4,000 operations). LLVM checks the text anyway. Equal operations
on equal values are written once.
"""

from __future__ import annotations

import itertools
import struct
from collections.abc import Sequence

from uqmbd.compiled.tables import IntervalTable, table_constants

__all__ = ["LANES", "Masks", "FunctionWriter"]

LANES = 8
"""Realisations in a row."""

LONG = 800
"""Lines from which a function is written for the processor's own vectors, in a loop over the parts of a row.

Whole rows are up to 1.3 times faster in short functions, where operations wait for each other. In long functions they
are no faster, since values leave the registers, and take twice as long to compile."""

BLOCK = 400
"""Lines of a block: the time that LLVM takes to schedule a block grows faster than its length.

Blocks halve the compile time of the longest functions, with code of the same speed (measured)."""


class FunctionWriter:
    """The body of one function: its lines, in which KIND and MASK stand for the types of vectors.

    Whether these are whole rows is known only when all is written.
    """

    def __init__(self) -> None:
        self.lines: list[str] = []
        self.called: dict[str, int] = {}  # number of arguments of each function of the C library
        self.intrinsics: dict[str, int] = {}
        self.tables: dict[str, IntervalTable] = {}
        self._room = 0  # vectors that are passed to the function that looks up tables, and taken from it
        self._known: dict[str, str] = {}

    def made(self, operation: str) -> str:
        """Return the name of the value of an operation, which is written once."""
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
        """Return a mask: where a comparison holds, by its name in LLVM."""
        return self.made(f"fcmp {how} KIND {a}, {b}")

    def select(self, mask: str, a: str, b: str) -> str:
        """Return `a` where the mask holds, else `b`."""
        return self.made(f"select MASK {mask}, KIND {a}, KIND {b}")

    def intrinsic(self, name: str, *values: str) -> str:
        """Return the value of a function that LLVM has."""
        self.intrinsics[name] = len(values)
        listed = ", ".join(f"KIND {x}" for x in values)
        return self.made(f"call KIND @llvm.{name}.vWIDTHf64({listed})")

    def call(self, name: str, *values: str) -> str:
        """Call a function of the C library in each lane."""
        self.called[name] = len(values)
        listed = ", ".join(f"KIND {x}" for x in values)
        return self.made(f"call KIND @lanes.{name}({listed})")

    def look_up(self, name: str, table: IntervalTable, values: Sequence[str]) -> list[str]:
        """Return the numbers of a table at an argument, which terms follow where it has any."""
        knots, terms, numbers = len(table.edges), table.rows.shape[1] - 1, table.rows.shape[2]
        self.tables[name] = table
        self._room = max(self._room, len(values), numbers)
        found = [f"%looked{len(self.lines)}.{k}" for k in range(numbers)]
        for k, value in enumerate(values):
            place = self.made(f"getelementptr KIND, ptr %asked, i64 {k}")
            self.lines.append(f"store KIND {value}, ptr {place}")
        self.lines.append(
            f"call void @look_up(ptr @edges.{name}, ptr @rows.{name}, i64 {knots}, i64 {terms}, i64 {numbers}, "
            f"double {_double(table.period)}, i64 WIDTH, ptr %asked, ptr %answered)"
        )
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
        """Return the LLVM module of the function, for a processor that computes `native` lanes at once."""
        width = native if len(self.lines) > LONG else LANES
        whole = width == LANES
        x, y = ("x", "y") if whole else ("rows", "results")
        parts = []
        for function, count in self.intrinsics.items():
            parts.append(f"declare KIND @llvm.{function}.vWIDTHf64({', '.join(['KIND'] * count)})\n")
        parts += [self._lanes(function, count, width) for function, count in self.called.items()]
        if self.tables:
            parts.append("declare void @look_up(ptr, ptr, i64, i64, i64, double, i64, ptr, ptr) nounwind\n")
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
        """Return the lines, cut into blocks by branches that LLVM must believe in."""
        edges = [0]
        for k, line in enumerate(self.lines, 1):
            # not between a product and the sum that it may be contracted with
            if k - edges[-1] >= BLOCK and len(self.lines) - k >= BLOCK and " = fmul" not in line:
                edges.append(k)
        found = ["%never = icmp eq ptr %x, null\n"] if len(edges) > 1 else []
        for k, (begin, end) in enumerate(itertools.pairwise([*edges, len(self.lines)])):
            found += [f"br i1 %never, label %end, label %block{k}\nblock{k}:\n"] if k else []
            found += ["\n".join(self.lines[begin:end]), "\n"]
        return found

    @staticmethod
    def _lanes(name: str, count: int, width: int) -> str:
        """Write a function of vectors that calls one of the C library in each lane."""
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
    """Truth values by name, and the values that may not be real numbers, whose comparisons may be undefined."""

    def __init__(self) -> None:
        # for each mask the mask of where it is certainly false; None: its negation
        self.surely_false: dict[str, str | None] = {}
        # values that may not be real numbers
        self.partial: set[str] = set()

    def __contains__(self, name: str) -> bool:
        return name in self.surely_false

    def noted(self, name: str, false: str | None = None) -> str:
        """Note a mask, and where it surely does not hold unless that is wherever it does not hold."""
        self.surely_false[name] = false
        return name

    def defined(self, *names: str) -> bool:
        """Return whether masks hold, or surely do not, everywhere."""
        return all(self.surely_false[name] is None for name in names)

    def false(self, w: FunctionWriter, name: str) -> str:
        """Return where a mask surely does not hold."""
        return self.surely_false[name] or w.made(f"xor MASK {name}, splat (i1 true)")


def _double(value: float) -> str:
    """Write a number to the bit."""
    return f"0x{struct.pack('>d', value).hex().upper()}"
