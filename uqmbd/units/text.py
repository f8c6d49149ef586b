"""Reading of units from text, and advice on other spellings."""

from __future__ import annotations

import difflib
import functools
import math
import re
from collections.abc import Callable
from fractions import Fraction

from uqmbd.units.names import SPELLINGS, TABLE
from uqmbd.units.pint_units import unit_from_name
from uqmbd.units.unit import Unit

__all__ = ["advice_on", "read_units", "same_units", "spelling"]

EXAMPLES = "'m', 'N m', 'kg m^2', 'rad/s', or '1' for a pure number"

LONGEST = 200
"""Largest number of characters of units; a longer text is probably not units, and takes long to read."""

LARGEST = 99
"""Largest absolute value of an exponent of a base quantity."""

_RAISED = str.maketrans("⁰¹²³⁴⁵⁶⁷⁸⁹⁻⁺", "0123456789-+")
_NUMBER = r"[-+]?\d+(?:\.\d+)?(?:/\d+)?"
_PART = re.compile(
    rf"""\s*(?:
        (?:\*\*|\^)\s*(?:(?P<power>[-+]?\d+(?:\.\d+)?)|\(\s*(?P<fraction>{_NUMBER})\s*\))
      | (?P<raised>[⁺⁻]?[⁰¹²³⁴⁵⁶⁷⁸⁹]+)
      | (?P<times>[*·⋅×])
      | (?P<over>/)
      | (?P<open>\()
      | (?P<close>\))
      | (?<![^\W\d])(?P<number>\d+(?:\.\d+)?)
      | (?P<name>°C|[^\W\d]+|[°%‰])
    )\s*""",
    re.VERBOSE,
)
_OPEN = re.compile(r"(?<=[^\W\d])\s*(?:\*\*|\^)\s*[a-z]\b")
_NAME = re.compile(r"°C|[^\W\d]+|[°%‰]")


class _Unreadable(Exception):
    """A text is not a product of powers, or contains an unknown name."""


def read_units(text: str) -> Unit | None:
    """Return the unit that a text denotes; None if it is unknown or empty.

    The text consists of symbols of units with products (``N m``, ``N*m``, ``N·m``), quotients and powers (``^2``,
    ``**2``, ``²``, ``^(1/2)``). Products and quotients are read from left to right: ``m/N s`` is ``(m/N) s``. The text
    may also contain names in words. Alternatives with commas, such as ``N/m, N m/rad``, and units with a variable
    exponent, such as ``N/m^n``, are unknown.
    """
    return _read(text)[0]


def same_units(one: str, other: str) -> bool:
    """Return whether two texts denote the same units.

    Parameters
    ----------
    one, other : str
        Units, such as ``"m/s^2"``.

    Returns
    -------
    bool
        False for different or unknown units.

    Examples
    --------
    >>> import uqmbd
    >>> uqmbd.extend.same_units("m/s^2", "m s^-2"), uqmbd.extend.same_units("m", "mm")
    (True, False)
    """
    found = read_units(one)
    return found is not None and found == read_units(other)


def advice_on(text: str) -> str:
    """Return advice on the spelling of units, as the end of a sentence; empty if they are spelled correctly."""
    return _read(text)[1]


def spelling(where: str, units: str) -> str:
    """Return a message on misspelt units of the object `where`; empty if they are spelled correctly.

    >>> spelling("output 'x'", "meter")
    "output 'x': units is 'meter'; write 'm'."
    """
    advice = advice_on(units)
    shown = repr(units) if len(units) <= LONGEST else f"{units[:20]!r}..."
    return f"{where}: units is {shown}{',' if advice.startswith('which') else ';'} {advice}." if advice else ""


@functools.lru_cache(maxsize=1024)
def _read(text: str) -> tuple[Unit | None, str]:
    """Return the unit in a text, or None; also return advice on the spelling, or an empty text."""
    if not text.strip():
        return None, ""
    if len(text) > LONGEST:
        return None, f"which has {len(text)} characters; write units in at most {LONGEST}, such as {EXAMPLES}"
    if found := TABLE.get(text):
        return found, ""
    if "," in text:  # alternative units, for example of a coefficient of a force or a moment
        return None, next((advice for part in text.split(",") if (advice := _read(part)[1])), "")
    if (plain := _OPEN.sub("", text)) != text:  # a variable power, for example the exponent of a contact law
        return None, _read(plain)[1] and _unknown(text)
    if text.strip() in ("-", "[-]", "–", "--"):
        return Unit(), "write '1' for a pure number"
    try:
        return _product(text, TABLE.get), ""
    except _Unreadable:
        pass
    bare = text.strip().strip("[]") if text.strip().startswith("[") else text
    better = _NAME.sub(lambda found: _symbol(found[0]), re.sub(r"(?<=[A-Za-z])([2-9])\b", r"^\1", bare))
    if better != text:
        try:
            return _product(better, TABLE.get), f"write {better.strip()!r}"
        except _Unreadable:
            pass
    try:
        return _product(text, lambda name: TABLE.get(name) or unit_from_name(name)), ""
    except _Unreadable:
        return None, _unknown(text)


def _unknown(text: str) -> str:
    wrong = [name for name in _NAME.findall(text) if name not in TABLE]
    near = [
        x
        for name in wrong[:1]
        if len(name) > 3
        for x in difflib.get_close_matches(name.casefold(), [*SPELLINGS, *TABLE], 1, 0.8)
    ]
    meant = f"; is {SPELLINGS.get(near[0], near[0])!r} meant? Write" if near else "; write"
    return f"which is not a known unit{meant} units such as {EXAMPLES}, or omit them"


def _symbol(name: str) -> str:
    """Return the symbol of a unit in words, or the split symbols of joined units; otherwise return the name."""
    if name in TABLE:
        return name
    if symbol := SPELLINGS.get(name.casefold(), "") or " ".join(_split(name)):
        return symbol
    same = [symbol for symbol in TABLE if len(name) > 1 and symbol.casefold() == name.casefold()]
    return same[0] if len(same) == 1 else name


@functools.lru_cache(maxsize=1024)
def _split(name: str) -> tuple[str, ...]:
    """Split ``Nm`` or ``kgm`` into the longest possible symbols; empty if the name does not consist of symbols."""
    for length in range(len(name), 0, -1):
        if name[:length] in _JOINED:
            rest = _split(name[length:]) if length < len(name) else ()
            if rest or length == len(name):
                return (name[:length], *rest)
    return ()


_JOINED = ("N", "kN", "kg", "m", "mm", "s", "rad", "Pa", "W", "J")
"""Symbols that users often join without a space."""


def _product(text: str, unit_of: Callable[[str], Unit | None]) -> Unit:
    """Return the unit of a product, quotient or power, read from left to right; raise for numbers out of range."""
    try:
        found = _multiplied(text, unit_of)
    except (ArithmeticError, ValueError):  # an exponent such as 1/0, or a factor out of the range of 64-bit numbers
        raise _Unreadable from None
    if not 0 < found.factor < math.inf or any(abs(power) > LARGEST for power in found.dimension):
        raise _Unreadable
    return found


def _multiplied(text: str, unit_of: Callable[[str], Unit | None]) -> Unit:
    stack: list[tuple[Unit, int]] = []
    whole, sign, last, waiting = Unit(), 1, None, True
    place = 0

    def closed(value: Unit, last: Unit | None, sign: int) -> Unit:
        return value if last is None else value * last ** Fraction(sign)

    while place < len(text):
        found = _PART.match(text, place)
        if found is None:
            raise _Unreadable
        place, kind, word = found.end(), found.lastgroup, found[found.lastgroup or 0]
        if kind in ("power", "fraction", "raised"):
            if last is None or waiting:
                raise _Unreadable
            last = last ** Fraction(word.translate(_RAISED) if kind == "raised" else word)
            whole, last, sign = closed(whole, last, sign), Unit(), 1
        elif kind in ("times", "over"):
            if waiting:
                raise _Unreadable
            whole, last = closed(whole, last, sign), None
            sign, waiting = (-1 if kind == "over" else 1), True
        elif kind == "close":
            if not stack or waiting:
                raise _Unreadable
            inner = closed(whole, last, sign)
            (whole, sign), last = stack.pop(), inner
        else:
            if not waiting:
                whole, last, sign = closed(whole, last, sign), None, 1
            if kind == "open":
                stack.append((whole, sign))
                whole, sign, last, waiting = Unit(), 1, None, True
                continue
            unit = Unit(factor=float(word)) if kind == "number" else unit_of(word)
            if unit is None or not unit.factor:
                raise _Unreadable
            last, waiting = unit, False
    if stack or waiting:
        raise _Unreadable
    return closed(whole, last, sign)
