"""Format numbers, durations, counts, and positions in files, as text for readers."""

from __future__ import annotations

import math
import re
import traceback
from collections.abc import Sequence
from decimal import Decimal
from pathlib import Path
from typing import NamedTuple

__all__ = [
    "FACTOR",
    "Cell",
    "format_at_most",
    "format_cells",
    "format_count",
    "format_duration",
    "format_factor",
    "format_integer",
    "format_number",
    "format_part",
    "format_percent",
    "format_power",
    "format_quantity",
    "format_share",
    "minus",
    "place_of",
    "power_of_ten",
    "reciprocal_units",
    "typeset_units",
]

_POWER = re.compile(r"(?:\^|\*\*)(?:\((-?\d+)\)|(-?\d+)(?![\d.]))")
_SIGN = re.compile(r"\s*([*·⋅×/])\s*")
_SPACE = re.compile(r"(?<=[^\s,])\s+")
_JOINING = re.compile(r"[\s/·()]")
LIBRARIES = ("uqmbd", "sympy", "numpy", "scipy", "chaospy")
"""Packages whose lines in a traceback do not help users to find their mistake."""

SMALLEST_SHARE = 1e-6
"""Least relative error with a stated value; smaller errors are stated as below this value, because of rounding."""

FACTOR = 1.05
"""Least relative error that is stated as a factor; a smaller factor, rounded to two digits, would be 1."""

SMALLEST_IN_PER_CENT = 1e-6
"""Probability below which a power of ten is used, even next to a probability in per cent, to avoid many zeros."""

_SUPERSCRIPTS = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")


ROUNDED = 0.0005
"""Excess of a Sobol' index over its limits that counts as rounding."""


def format_number(value: float, error: float | None = None) -> str:
    """Return a number as text with four digits, or with as many digits as its standard error allows.

    `error` is the standard error, shown with two digits.

    >>> format_number(0.150123), format_number(-1.5e-7), format_number(0.0)
    ('0.1501', '−1.5 × 10⁻⁷', '0')
    >>> format_number(0.150123, 0.00134), format_number(151234.0, 120.0)
    ('0.1501 ± 0.0013', '(1.5123 ± 0.0012) × 10⁵')
    >>> format_number(33080.0, 3816.0)
    '(3.31 ± 0.38) × 10⁴'
    """
    if not math.isfinite(value):
        return "unknown" if math.isnan(value) else ("∞" if value > 0 else "−∞")
    if error is None or not math.isfinite(error) or error <= 0.0 or error < 1e-12 * abs(value):
        exponent = math.floor(math.log10(abs(value))) if value else 0
        if -3 <= exponent < 5:
            return minus(f"{value:.4g}" if exponent < 4 else f"{value:.0f}")
        mantissa = f"{value / 10.0**exponent:.4g}" if exponent > -300 else f"{value:.3e}".split("e")[0]
        return f"{minus(mantissa)} × {format_power(exponent)}"
    exponent = math.floor(math.log10(max(abs(value), error)))
    # without a power of ten, all digits must be significant: 33080 ± 3816 has too many digits
    scale = 0 if -3 <= exponent < 5 and error < 99.5 else exponent
    decimals = max(0, scale - math.floor(math.log10(error)) + 1)
    text = f"{minus(f'{value / 10.0**scale:.{decimals}f}')} ± {error / 10.0**scale:.{decimals}f}"
    return f"({text}) × {format_power(scale)}" if scale else text


def power_of_ten(size: float) -> int:
    """Return the exponent of ten for the display of numbers of a given size; 0 if the numbers are short without it.

    >>> [power_of_ten(size) for size in (0.0, 0.0012, 0.00098, 99999.0, 123456.0)]
    [0, 0, -4, 0, 5]
    """
    exponent = math.floor(math.log10(size)) if size > 0 and math.isfinite(size) else 0
    return 0 if -3 <= exponent < 5 else exponent


def format_power(power: int) -> str:
    """Return a power of ten as text; an empty text for the exponent 0.

    >>> format_power(-4), format_power(12), format_power(0)
    ('10⁻⁴', '10¹²', '')
    """
    return f"10{str(power).translate(_SUPERSCRIPTS)}" if power else ""


def format_quantity(value: float, units: str, error: float | None = None) -> str:
    """Return a number, formatted by :func:`format_number`, and its units, formatted by :func:`typeset_units`.

    >>> format_quantity(0.150123, "m", 0.00134), format_quantity(2.0, "1"), format_quantity(float("nan"), "m")
    ('0.1501 ± 0.0013 m', '2', 'unknown')
    >>> format_quantity(9.81, "m/s^2")
    '9.81 m/s²'
    """
    text, shown = format_number(value, error), typeset_units(units)
    return f"{text} {shown}" if shown and not math.isnan(value) else text


class Cell(NamedTuple):
    """Number in a table, in two parts for separate alignment: the number, and its error and units."""

    number: str
    rest: str

    def __str__(self) -> str:
        """Return both parts."""
        return f"{self.number} {self.rest}".strip()


def format_cells(
    values: Sequence[float], units: str = "", errors: Sequence[float] = (), scale: float = 0.0
) -> list[Cell]:
    """Return the cells of a column with numbers of one quantity, with equal numbers of decimals.

    `errors` are standard errors, or NaN if there is none. `scale` is the size of the quantity, if it exceeds the
    values. The smallest error determines the number of digits. Without errors, the largest number has four digits.
    The largest number has at most six digits.

    >>> [str(cell) for cell in format_cells([0.46485, 0.4653], "m", [0.00048, float("nan")])]
    ['0.46485 ± 0.00048 m', '0.46530 m']
    >>> [cell.number for cell in format_cells([12.3456, -1.6e-9, float("nan")])]
    ['12.35', '0.00', 'unknown']
    >>> [str(cell) for cell in format_cells([1.234e-7, 2e-8], "m")]
    ['1.234 × 10⁻⁷ m', '0.200 × 10⁻⁷ m']
    """
    given = [*errors, *[math.nan] * (len(values) - len(errors))]
    pairs = [
        (v, e if e > max(0.0, 1e-12 * abs(v)) and math.isfinite(e) else 0.0) for v, e in zip(values, given, strict=True)
    ]
    known = [(v, e) for v, e in pairs if math.isfinite(v)]
    size = max([max(abs(v), e) for v, e in known] + [scale if math.isfinite(scale) else 0.0], default=0.0)
    largest = math.floor(math.log10(size)) if size > 0 else 0
    power = power_of_ten(size) if all(e < 99.5 for _, e in known) else largest
    places = [1 - math.floor(math.log10(e)) if e else 3 - largest for _, e in known]
    decimals = min(max([0, *(place + power for place in places)]), max(6 - largest + power, 0))
    tail = f"× {format_power(power)}" if power else ""
    found = []
    for value, error in pairs:
        if not math.isfinite(value):
            found.append(Cell(format_number(value), ""))
            continue
        text = f"{value / 10.0**power:.{decimals}f}"
        text = minus(text) if float(text) else text.lstrip("-")
        about = f"± {error / 10.0**power:.{decimals}f}" if error else ""
        if power and error:
            text, about = f"({text}", f"{about})"
        found.append(Cell(text, " ".join(filter(None, (about, tail, typeset_units(units))))))
    return found


def typeset_units(units: str) -> str:
    """Return units for display: powers as superscripts, products with a dot or a thin space, nothing for "1".

    Reports, figures and tables on the terminal show units in this form. A thin space does not break, and a text
    with a per cent sign ("% of std") keeps its spaces.

    >>> [typeset_units(u) for u in ("m/s^2", "kg*m**2", "s^-1", "m^(1/2)", "1", "")]
    ['m/s²', 'kg·m²', 's⁻¹', 'm^(1/2)', '', '']
    >>> [typeset_units(u).replace("\N{NARROW NO-BREAK SPACE}", "_") for u in ("N m", "kg m^2 / s", "N/m, N m/rad")]
    ['N_m', 'kg_m²/s', 'N/m, N_m/rad']
    """
    if units.strip() == "1":
        return ""
    raised = _POWER.sub(lambda found: (found[1] or found[2]).translate(_SUPERSCRIPTS), units.strip())
    text = _SIGN.sub(lambda found: "/" if found[1] == "/" else "·", raised)
    return text if "%" in text else _SPACE.sub("\N{NARROW NO-BREAK SPACE}", text)


def reciprocal_units(units: str) -> str:
    """Return the units of a density over a quantity: the reciprocal of its units, typeset.

    >>> [reciprocal_units(u) for u in ("m", "m/s^2", "1/s", "N*m", "kg*m^2/s", "1")]
    ['1/m', 's²/m', 's', '1/(N·m)', '1/(kg·m²/s)', '']
    """
    text = typeset_units(units)
    if not text:
        return ""
    over, slash, under = text.partition("/")
    if slash and not _JOINING.search(over + under):
        return under if over == "1" else f"{under}/{over}"
    return f"1/({text})" if _JOINING.search(text) else f"1/{text}"


def format_duration(seconds: float, rough: bool = False) -> str:
    """Return a duration in s as text.

    `rough` is used for a running clock: it shows tenths of a second at most, and whole seconds from 10 s on.

    >>> [format_duration(s) for s in (0.0123, 4.56, 75.0, 7300.0, float("nan"))]
    ['12 ms', '4.6 s', '1 min 15 s', '2 h 1 min', 'unknown']
    >>> [format_duration(s) for s in (0.00041, 4e-6, 0.0)]
    ['0.41 ms', 'below 0.01 ms', '0 ms']
    >>> [format_duration(s, rough=True) for s in (0.0123, 4.0, 12.3)]
    ['0.0 s', '4 s', '12 s']
    """
    if not math.isfinite(seconds):
        return "unknown"
    if 0 < seconds < 0.00095 and not rough:
        return f"{1000 * seconds:.2f} ms" if seconds >= 1e-5 else "below 0.01 ms"
    if seconds < 1 and not rough:
        return f"{1000 * seconds:.0f} ms"
    if seconds < 60:
        return f"{seconds:.{0 if rough and (seconds >= 10 or seconds == int(seconds)) else 1}f} s"
    minutes, rest = divmod(round(seconds), 60)
    return f"{minutes} min {rest} s" if minutes < 60 else f"{minutes // 60} h {minutes % 60} min"


def format_integer(number: float) -> str:
    """Return a whole number as text, in groups of three digits if it has at least five digits.

    >>> format_integer(1234), format_integer(1234567).replace(" ", "_")
    ('1234', '1_234_567')
    """
    text = f"{round(number):,}" if abs(number) >= 10000 else f"{round(number)}"
    return minus(text.replace(",", "\N{NARROW NO-BREAK SPACE}"))


def format_count(number: int, one: str, many: str | None = None) -> str:
    """Return a number of objects as text, with the singular or plural of the noun.

    >>> format_count(1, "sample"), format_count(3, "body", "bodies")
    ('1 sample', '3 bodies')
    """
    return f"{format_integer(number)} {one if number == 1 else many or one + 's'}"


def format_factor(factor: float) -> str:
    """Return a factor as text, with two digits, or as a whole number from 10 on.

    >>> [format_factor(x) for x in (1.0, 6.63, 9.97, 118.6)]
    ['1', '6.6', '10', '119']
    """
    return f"{factor:.0f}" if factor >= 9.95 else f"{factor:.2g}"


def format_percent(share: float, unknown: str = "–") -> str:
    """Return a relative error in per cent as text, with two digits; return `unknown` if it is not finite.

    >>> [format_percent(x) for x in (0.0123, 0.08, 0.1204, 1.7, 2e-9, 0.0, float("nan"))]
    ['1.2 %', '8.0 %', '12 %', '170 %', 'below 0.0001 %', '0 %', '–']
    """
    if not math.isfinite(share):
        return unknown
    if share == 0:
        return "0 %"
    if share < SMALLEST_SHARE:
        return "below 0.0001 %"
    return f"{f'{100 * share:#.2g}'.rstrip('.')} %" if share < 0.995 else f"{100 * share:.0f} %"


def format_at_most(share: float, whole: str) -> str:
    """Return a bound of an error relative to `whole` as text, in per cent, or as a factor above one.

    >>> [format_at_most(x, "the range") for x in (0.0123, 2e-9, 0.0, float("nan"))]
    ['at most 1.2 % of the range', 'below 0.0001 % of the range', 'at most 0 % of the range',
     'an unknown part of the range']
    >>> format_at_most(30.9, "the range")
    'larger than the range, up to 31 times as large'
    """
    if FACTOR <= share < math.inf:
        return f"larger than {whole}, up to {format_factor(share)} times as large"
    text = format_percent(share, "an unknown part")
    return f"{'at most ' if math.isfinite(share) and not 0 < share < SMALLEST_SHARE else ''}{text} of {whole}"


def format_part(share: float, whole: str) -> str:
    """Return an error relative to `whole` as text, in per cent, or as a factor above one.

    >>> [format_part(x, "the range") for x in (0.0123, 1.0, 30.9, float("nan"))]
    ['1.2 % of the range', '100 % of the range', '31 times the range', '– of the range']
    """
    above = FACTOR <= share < math.inf
    return f"{format_factor(share)} times {whole}" if above else f"{format_percent(share)} of {whole}"


def format_share(share: float) -> str:
    """Return a share in per cent as text.

    >>> [format_share(x) for x in (0.5, 0.0123, 1e-5, float("nan"))]
    ['50 %', '1.2 %', '0 %', '–']
    """
    if not math.isfinite(share):
        return "–"
    return f"{100 * share:.0f} %" if share >= 0.0995 else (f"{100 * share:.1f} %" if share >= 0.0005 else "0 %")


def format_index(value: float, lower: float = math.nan, upper: float = math.nan) -> str:
    """Return a Sobol' index as text.

    For an estimate below 0 or above 100 %, the text states the nearest limit, then the estimate and its 95 % interval.


    >>> format_index(0.42), format_index(1.08)
    ('42 %', '100 % (estimate 108 %, limited by sampling error)')
    >>> format_index(1.08, 0.9, 1.26)
    '100 % (estimate 108 %, 95 % interval 90 % to 126 %, limited by sampling error)'
    >>> format_index(-0.03, -0.1, 0.04)
    '0 % (estimate −3 %, 95 % interval −10 % to 4 %, limited by sampling error)'
    """
    nearest = min(max(value, 0.0), 1.0)
    if not math.isfinite(value) or abs(value - nearest) < ROUNDED:
        return format_share(nearest if math.isfinite(value) else value)
    estimate, low, high = (minus(f"{100 * x:.{1 if abs(x) < 0.0095 else 0}f} %") for x in (value, lower, upper))
    within = f", 95 % interval {low} to {high}" if math.isfinite(lower) and math.isfinite(upper) else ""
    return f"{format_share(nearest)} (estimate {estimate}{within}, limited by sampling error)"


def format_probability(value: float, width: float = 0.0, largest: float = 0.0) -> str:
    """Return a probability as text, with at least two digits.

    More digits distinguish the probability from 1, or resolve `width`: the width of an interval whose ends must differ
    in the text. `largest` is the upper end of the interval. The text uses the same power of ten as the text of the
    upper end, or per cent if that text does.

    >>> [format_probability(p) for p in (0.0, 2.834e-2, 5.97e-3, 3.2e-7, 0.9912, 0.999995, 1.0, float("nan"))]
    ['0', '2.8 %', '0.60 %', '3.2 × 10⁻⁷', '99.1 %', '99.9995 %', '100 %', 'not known']
    >>> format_probability(0.18, 0.0005), format_probability(3.204e-7, 1e-9)
    ('18.00 %', '3.204 × 10⁻⁷')
    >>> format_probability(5.917e-5, largest=8e-4), format_probability(3.2e-7, largest=4.9e-5)
    ('0.0059 %', '0.032 × 10⁻⁵')
    """
    if not math.isfinite(value):
        return "not known"
    if value in (0.0, 1.0):
        return f"{100 * value:.0f} %" if value else "0"
    # decimals in per cent, with a rounding error of at most a quarter of the width
    resolved = math.ceil(-math.log10(50 * width) - 1e-9) if width > 0 else 0
    size = math.floor(math.log10(100 * value))
    if value < 1e-4 and (largest < 1e-4 or value < SMALLEST_IN_PER_CENT):
        alike = value if largest >= 1e-4 or value < 1e-4 * largest else max(value, largest)
        own, exponent = (int(f"{one:.1e}".split("e")[1]) for one in (value, alike))
        decimals = min(max(1 - own + exponent, resolved + 2 + exponent), 12)
        mantissa = f"{Decimal(value).scaleb(-exponent):.{decimals}f}"
        return f"{mantissa.removesuffix('.0')} × {format_power(exponent)}"
    digits = 2 if value < 0.9 else 3 if value < 0.999 else 4
    apart = math.ceil(-math.log10(100 * (1 - value))) if value > 0.999 else 0
    return f"{100 * value:.{min(max(digits - 1 - size, resolved, apart, 0), 12)}f} %"


def format_interval(value: float, lower: float, upper: float) -> str:
    """Return a probability with its interval as text.

    >>> format_interval(0.02, 0.012, 0.031), format_interval(0.0, 0.0, 0.00597), format_interval(0.1, 0.0, 1.0)
    ('2.0 % (1.2 % to 3.1 %)', '0 (at most 0.60 %)', '10 % (may be anything)')
    >>> format_interval(0.18, 0.1798, 0.1803)
    '18.00 % (17.98 % to 18.03 %)'
    """
    if lower <= 0 and upper >= 1 and not math.isfinite(value):
        return "not known"
    text = format_probability(value, resolved_width(lower, upper), min(max(upper, 0.0), 1.0))
    return f"{text} ({format_interval_ends(lower, upper)})"


def format_interval_ends(lower: float, upper: float) -> str:
    """Return the interval of a probability as text, with enough digits to distinguish its ends.

    >>> format_interval_ends(0.012, 0.031), format_interval_ends(0.0, 0.00597), format_interval_ends(0.0, 1.0)
    ('1.2 % to 3.1 %', 'at most 0.60 %', 'may be anything')
    >>> format_interval_ends(4.2e-6, 8.8e-5), format_interval_ends(4.2e-6, 8.8e-4)
    ('0.42 × 10⁻⁵ to 8.8 × 10⁻⁵', '0.00042 % to 0.088 %')
    """
    if lower <= 0 and upper >= 1:
        return "may be anything"
    if lower <= 0:
        return f"at most {format_probability(upper)}"
    if upper >= 1:
        return f"at least {format_probability(lower)}"
    width = resolved_width(lower, upper)
    return f"{format_probability(lower, width, upper)} to {format_probability(upper, width)}"


def resolved_width(lower: float, upper: float) -> float:
    """Return the width that digits must resolve; 0 if the interval is one-sided or its width is a rounding error."""
    width = upper - lower
    return width if lower > 0 and upper < 1 and width > 1e-12 * upper else 0.0


def minus(text: str) -> str:
    """Replace hyphens in a text by minus signs."""
    return text.replace("-", "−")


def place_of(error: BaseException) -> str:
    """Return the file and line of an error as a part of a sentence; for a library, the line that calls the library."""
    frames = list(traceback.walk_tb(error.__traceback__))[1:]
    theirs = [x for x in frames if x[0].f_globals.get("__name__", "").partition(".")[0] not in LIBRARIES]
    if not frames:
        return ""
    frame, line = (theirs or frames)[-1]
    return f" ({Path(frame.f_code.co_filename).name}, line {line})"
