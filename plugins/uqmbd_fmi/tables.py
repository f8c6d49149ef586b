"""Numbers and structures as C source; equal arrays are written once."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np

__all__ = ["SourceTables", "number", "text"]

WIDTH = 118
"""Maximum length of a line of numbers."""


class SourceTables:
    """C source that grows by arrays; an array with the contents of an earlier array has its name."""

    def __init__(self) -> None:
        self.parts: list[str] = []
        self._names: dict[tuple[str, str], str] = {}

    def doubles(self, values: Any) -> str:
        """Return the name of an array of floating-point numbers; empty arrays have the name NULL."""
        flat = np.asarray(values, dtype=float).ravel()
        return self._array("double", "d", [number(x) for x in flat.tolist()])

    def integers(self, values: Any) -> str:
        """Return the name of an array of whole numbers."""
        flat = np.asarray(values).ravel()
        return self._array("int", "i", [str(int(x)) for x in flat.tolist()])

    def structures(self, kind: str, rows: Sequence[str]) -> str:
        """Return the name of an array of structures of one kind."""
        return self._array(kind, kind[0].lower() + kind[1:3], rows, "\n    ")

    def _array(self, kind: str, prefix: str, items: Sequence[str], between: str = "") -> str:
        if not items:
            return "NULL"
        body = ("," + between).join(items) if between else joined(items)
        name = self._names.get((kind, body))
        if name is None:
            name = f"{prefix}{len(self._names)}"
            self._names[kind, body] = name
            self.parts.append(f"static const {kind} {name}[{len(items)}] = {{\n    {body}}};\n")
        return name

    def source(self) -> str:
        """Return the source of all arrays."""
        return "\n".join(self.parts)


def joined(items: Iterable[str]) -> str:
    """Join numbers by commas, in lines of at most `WIDTH` characters.

    >>> joined(["1.0", "2.0"])
    '1.0, 2.0'
    """
    lines: list[str] = []
    line = ""
    for item in items:
        if line and len(line) + len(item) + 6 > WIDTH:
            lines.append(line)
            line = ""
        line += f", {item}" if line else item
    return ",\n    ".join([*lines, line])


def number(value: float) -> str:
    """Return a number in C; the compiler restores it bit by bit.

    >>> number(0.1), number(float("inf")), number(-float("inf")), number(float("nan")), number(2.0)
    ('0.1', 'INFINITY', '-INFINITY', 'NAN', '2.0')
    """
    if np.isnan(value):
        return "NAN"
    if np.isinf(value):
        return "INFINITY" if value > 0 else "-INFINITY"
    return repr(float(value))


def text(value: str) -> str:
    r"""Return a string in C; characters outside ASCII become octal escape sequences of their UTF-8 bytes.

    >>> text('a"b')
    '"a\\"b"'
    """
    plain = {34: '\\"', 92: "\\\\", 63: "\\?"}
    return '"' + "".join(plain.get(b) or (chr(b) if 32 <= b < 127 else f"\\{b:03o}") for b in value.encode()) + '"'
