"""LLVM IR of one straight-line function, as text.

The text is written directly: `llvmlite.ir` does the same and checks types on the way, but takes 12 to 17 us for an
operation where this takes 1.1 to 1.6 (measured, 4,000 operations), and LLVM checks the text anyway.  Equal operations
on equal values are written once.
"""

from __future__ import annotations

import struct
from collections.abc import Sequence

from uqmbd.compiled.tables import Table, table_constants

__all__ = ["LANES", "Writer"]

LANES = 8
"""Realisations in a row."""


class Writer:
    """The body of one function.

    Parameters
    ----------
    width : int
        Lanes that are computed at once.
    """

    def __init__(self, width: int) -> None:
        self.kind = f"<{width} x double>"
        self.mask = f"<{width} x i1>"
        self.width = width
        self.lines: list[str] = []
        self.called: dict[str, int] = {}  # number of arguments of each function of the C library
        self.intrinsics: dict[str, int] = {}
        self.tables: dict[str, Table] = {}
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
        return self.made(f"load {self.kind}, ptr {place}, align {8 * self.width}")

    def store(self, row: int, value: str) -> None:
        """Write a result."""
        place = self.made(f"getelementptr <{LANES} x double>, ptr %y, i64 {row}")
        self.lines.append(f"store {self.kind} {value}, ptr {place}, align {8 * self.width}")

    def number(self, value: float) -> str:
        """Return a constant."""
        return f"splat (double {_double(value)})"

    def add(self, a: str, b: str) -> str:
        """Return ``a + b``."""
        return self.made(f"fadd contract {self.kind} {a}, {b}")

    def subtract(self, a: str, b: str) -> str:
        """Return ``a - b``."""
        return self.made(f"fsub contract {self.kind} {a}, {b}")

    def multiply(self, a: str, b: str) -> str:
        """Return ``a b``."""
        a, b = sorted((a, b))
        return self.made(f"fmul contract {self.kind} {a}, {b}")

    def divide(self, a: str, b: str) -> str:
        """Return ``a / b``."""
        return self.made(f"fdiv contract {self.kind} {a}, {b}")

    def negate(self, a: str) -> str:
        """Return ``-a``."""
        return self.made(f"fneg contract {self.kind} {a}")

    def compare(self, how: str, a: str, b: str) -> str:
        """Return a mask: where a comparison holds, by its name in LLVM."""
        return self.made(f"fcmp {how} {self.kind} {a}, {b}")

    def select(self, mask: str, a: str, b: str) -> str:
        """Return `a` where the mask holds, else `b`."""
        return self.made(f"select {self.mask} {mask}, {self.kind} {a}, {self.kind} {b}")

    def intrinsic(self, name: str, *values: str) -> str:
        """Return the value of a function that LLVM has."""
        self.intrinsics[name] = len(values)
        listed = ", ".join(f"{self.kind} {x}" for x in values)
        return self.made(f"call {self.kind} @llvm.{name}.v{self.width}f64({listed})")

    def call(self, name: str, *values: str) -> str:
        """Call a function of the C library in each lane."""
        self.called[name] = len(values)
        listed = ", ".join(f"{self.kind} {x}" for x in values)
        return self.made(f"call {self.kind} @lanes.{name}({listed})")

    def look_up(self, name: str, table: Table, values: Sequence[str]) -> list[str]:
        """Return the numbers of a table at an argument, which terms follow where it has any."""
        knots, terms, numbers = len(table.edges), table.rows.shape[1] - 1, table.rows.shape[2]
        self.tables[name] = table
        self._room = max(self._room, len(values), numbers)
        found = [f"%looked{len(self.lines)}.{k}" for k in range(numbers)]
        for k, value in enumerate(values):
            place = self.made(f"getelementptr {self.kind}, ptr %asked, i64 {k}")
            self.lines.append(f"store {self.kind} {value}, ptr {place}")
        self.lines.append(
            f"call void @look_up(ptr @edges.{name}, ptr @rows.{name}, i64 {knots}, i64 {terms}, i64 {numbers}, "
            f"double {_double(table.period)}, i64 {self.width}, ptr %asked, ptr %answered)"
        )
        for k, value in enumerate(found):
            place = self.made(f"getelementptr {self.kind}, ptr %answered, i64 {k}")
            self.lines.append(f"{value} = load {self.kind}, ptr {place}")
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

    def text(self, name: str) -> str:
        """Return the module of the function, of this name."""
        whole = self.width == LANES
        x, y = ("x", "y") if whole else ("rows", "results")
        parts = []
        for function, count in self.intrinsics.items():
            listed = ", ".join([self.kind] * count)
            parts.append(f"declare {self.kind} @llvm.{function}.v{self.width}f64({listed})\n")
        parts += map(self._lanes, self.called.items())
        parts += [table_constants(*entry) for entry in self.tables.items()]
        if self.tables:
            parts.append("declare void @look_up(ptr, ptr, i64, i64, i64, double, i64, ptr, ptr) nounwind\n")
        parts.append(f"define void @{name}(ptr noalias %{x}, ptr noalias %{y}) nounwind {{\n")
        if self._room:
            parts += [f"%{room} = alloca [{self._room} x {self.kind}]\n" for room in ("asked", "answered")]
        if not whole:
            parts.append(
                "br label %part\npart:\n%lane = phi i64 [ 0, %0 ], [ %next, %part ]\n"
                "%x = getelementptr double, ptr %rows, i64 %lane\n%y = getelementptr double, ptr %results, i64 %lane\n"
            )
        parts.append("\n".join(self.lines))
        if not whole:
            parts.append(
                f"\n%next = add i64 %lane, {self.width}\n%more = icmp ult i64 %next, {LANES}\n"
                "br i1 %more, label %part, label %end\nend:"
            )
        return "".join([*parts, "\nret void\n}\n"])

    def _lanes(self, function: tuple[str, int]) -> str:
        """Write a function of vectors that calls one of the C library in each lane."""
        name, count = function
        lines = [f"declare double @{name}({', '.join(['double'] * count)}) nounwind"]
        names = [f"%a{k}" for k in range(count)]
        listed = ", ".join(f"{self.kind} {a}" for a in names)
        lines.append(f"define internal {self.kind} @lanes.{name}({listed}) noinline nounwind {{")
        result = "poison"
        for lane in range(self.width):
            lines += [f"{a}.{lane} = extractelement {self.kind} {a}, i32 {lane}" for a in names]
            lines.append(f"%f{lane} = call double @{name}({', '.join(f'double {a}.{lane}' for a in names)}) nounwind")
            lines.append(f"%r{lane} = insertelement {self.kind} {result}, double %f{lane}, i32 {lane}")
            result = f"%r{lane}"
        return "\n".join([*lines, f"ret {self.kind} {result}", "}", ""])


def _double(value: float) -> str:
    """Write a number to the bit."""
    return f"0x{struct.pack('>d', value).hex().upper()}"
