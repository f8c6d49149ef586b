"""Check of sizes in an MJCF file before MuJoCo expands them, which could take hours, or all memory."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from pathlib import Path

import uqmbd
from uqmbd_models.documents import XmlElement, parse

__all__ = ["require_sizes"]

COPIES = 10_000
"""Largest number of bodies that repeating elements may create; the derivation of more bodies takes too long."""

ENTRIES = 100_000_000
"""Largest number of values of an array, 0.8 GB."""

COUNTS = {
    "flexcomp": ("count",),
    "composite": ("count",),
}
"""Attributes whose product is a number of bodies."""

ARRAYS = {
    "hfield": ("nrow", "ncol"),
    "texture": ("width", "height"),
    "numeric": ("size",),
    "general": ("actdim",),
    "plugin": ("actdim",),
    "user": ("dim",),
}
"""Attributes whose product is a number of values of an array."""

SIZE = "size"
"""Element whose attributes are all sizes."""

BYTES = 16e9
"""Largest amount of memory, bytes."""

EACH = 100_000
"""Largest number of values for each body, joint or keyframe."""

UNITS = {"K": 2.0**10, "M": 2.0**20, "G": 2.0**30, "T": 2.0**40, "P": 2.0**50, "E": 2.0**60}

INCLUDES = {"include": "file", "model": "file"}
"""Elements that name another file of the model."""


def require_sizes(path: str, root: XmlElement) -> None:
    """Raise StudyError if a file, or one that it includes, has sizes that are too large.

    `path`: path of the file; `root`: root of the parsed file. The message states file, line and element.
    """
    _examine(path, root, frozenset((str(Path(path).resolve()),)), 1.0, _SizeCheck())


@dataclass
class _SizeCheck:
    """Results of the check so far."""

    bodies: float = 0.0
    files: dict[str, tuple[XmlElement, float, float]] = field(default_factory=dict)
    """Examined files, by path: root, largest number of copies so far, and number of bodies of each copy."""


def _examine(path: str, root: XmlElement, seen: frozenset[str], copies: float, found: _SizeCheck) -> None:
    """Examine all elements, each with the number of its copies."""
    waiting = [(root, copies)]
    while waiting:
        element, times = waiting.pop()
        where = f"{path}: line {element.line}: <{element.tag}>"
        if element.tag == "replicate":
            times *= max(1.0, _product(element, ("count",)))
            _require(where, "copies of its content", times, COPIES)
        elif element.tag in COUNTS:
            times *= max(1.0, _product(element, COUNTS[element.tag]))
            _require(where, "bodies", times, COPIES)
        elif element.tag == "body":
            found.bodies += times
            _require(where, "bodies in total", found.bodies, COPIES)
        elif element.tag in ARRAYS:
            _require(where, "entries", times * _product(element, ARRAYS[element.tag]), ENTRIES)
        elif element.tag == SIZE:
            for key in element.attrib:
                what, most = ("bytes", BYTES) if key == "memory" else ("entries", ENTRIES)
                most = EACH if key.startswith("nuser_") or key == "nkey" else most
                _require(f"{where}: {key}", what, _product(element, (key,)), most)
        if element.tag in INCLUDES:
            _examine_included(path, element, seen, times, found)
        waiting.extend((inner, times) for inner in element)


def _examine_included(path: str, element: XmlElement, seen: frozenset[str], copies: float, found: _SizeCheck) -> None:
    """Examine an included file of the model; MuJoCo reports a missing file.

    Sizes grow with the copies of a file, so a file is examined again only for more copies. Otherwise, for files that
    include each other twice, the time would double with each level.
    """
    file = Path(path).parent / element.get(INCLUDES[element.tag])
    name = str(file.resolve())
    if not element.get(INCLUDES[element.tag]) or name in seen or not file.is_file():
        return
    if name in found.files:
        root, most, each = found.files[name]
        if copies <= most:
            found.bodies += copies * each
            _require(f"{path}: line {element.line}: <{element.tag}>", "bodies in total", found.bodies, COPIES)
            return
    else:
        root = parse(f"from_mjcf: {file}, which {path} includes", str(file), "mjcf").root
    before = found.bodies
    _examine(str(file), root, seen | {name}, copies, found)
    found.files[name] = root, copies, (found.bodies - before) / copies


def _require(where: str, what: str, found: float, most: float) -> None:
    """Raise StudyError if a size exceeds its limit."""
    if found > most:
        raise uqmbd.StudyError(
            f"{where} requires {found:.4g} {what}; expected at most {most:,.0f}. Use fewer, or delete the element."
        )


def _product(element: XmlElement, keys: tuple[str, ...]) -> float:
    """Return the product of the numbers in attributes; MuJoCo reports values that are not numbers."""
    found = 1.0
    for text in (part for key in keys for part in element.get(key).split()):
        unit = UNITS.get(text[-1:].upper(), 1.0)
        try:
            value = float(text[:-1] if unit > 1 else text) * unit
        except ValueError:
            continue
        found *= value if math.isfinite(value) and value > 0 else 1.0
    return found
