"""The limits of size that ISO 286 gives to a class such as H7 or g6."""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

from uqmbd.errors import StudyError
from uqmbd.names import checked, did_you_mean
from uqmbd.randomness.tolerances.deviations import (
    DEVIATIONS,
    GRADES,
    HOLES_J,
    SHAFTS_J,
    SIZES,
    STANDARD,
    SUBDIVIDED,
    place,
)
from uqmbd.randomness.tolerances.limits import made, require_number

if TYPE_CHECKING:
    import chaospy

__all__ = ["deviations", "iso286"]

UNITS = {"mm": 1.0, "m": 1e3, "um": 1e-3}
"""Millimetres in a unit."""

SMALLEST = 1.0
"""mm; for sizes up to it the standard has exceptions."""

CORRECTED = range(3, 9)
"""Grades for which the standard tabulates the correction of holes: IT3 to IT8."""


@checked
def iso286(
    nominal: float, tolerance_class: str, cpk: float = 1.33, units: str = "mm", inspected: bool = False
) -> chaospy.Distribution:
    """Make the distribution of a size with a tolerance class of ISO 286, such as 30 H7.

    Parameters
    ----------
    nominal : float
        Nominal size, in `units`; more than 1 mm, at most 500 mm.
    tolerance_class : str
        A letter, capital for holes and small for shafts, and a grade: ``"H7"``, ``"g6"``, ``"js9"``.
    cpk : float
        Process capability index, as in `uqmbd.tolerance`.
    units : {"mm", "m", "um"}
        Units of `nominal`, and of what is returned.  A random variable that is made of it is in these units, too.
    inspected : bool
        Whether what lies beyond the limits is sorted out.

    Returns
    -------
    chaospy.Distribution
        As from `uqmbd.tolerance`.

    Raises
    ------
    uqmbd.StudyError
        If the standard gives no such class to the size.

    Notes
    -----
    Limits are those of the tables of ISO 286-1:2010, with the correction of holes K, M, N up to grade 8 and P to ZC up
    to grade 7.  Zones js are half the standard tolerance to either side, without the rounding to whole micrometres
    that some tables of grades 7 to 11 have.  Not given, and refused: sizes up to 1 mm, the letters cd, ef and fg above
    10 mm, and holes K to ZC of grades below 3.

    Examples
    --------
    >>> import uqmbd
    >>> bore = uqmbd.RandomVariable("bore", uqmbd.iso286(0.030, "H7", units="m"), units="m")
    >>> bore.mean, bore.description
    (0.0300105, 'Normal(mu=0.0300105, sigma=2.63158e-06): 0.03 H7 (ISO 286) +2.1e-05/0 m, Cpk 1.33')
    """
    where = f"iso286({nominal!r}, {tolerance_class!r})"
    size = require_number(where, "nominal", nominal)
    if units not in UNITS:
        raise StudyError(f"{where}: units is {units!r}; expected one of {', '.join(map(repr, UNITS))}.")
    if not isinstance(tolerance_class, str):
        raise StudyError(f"{where}: the class is {tolerance_class!r}; expected a text such as 'H7' or 'g6'.")
    per_mm = UNITS[units]
    lower, upper = deviations(where, size * per_mm, tolerance_class)
    low, high = (round(x * 1e-3 / per_mm, 12) for x in (lower, upper))
    ends = "/".join(f"{x:+.12g}" if x else "0" for x in (high, low))
    source = f"{size:.12g} {tolerance_class} (ISO 286) {ends} {units}"
    return made(where, size, high, low, cpk, inspected, source, units)


def deviations(where: str, size: float, tolerance_class: str) -> tuple[float, float]:
    """Return the lower and the upper deviation, micrometres, of a size, mm, in a tolerance class such as ``"H7"``.

    Raise StudyError if the standard gives none; `where` stands before messages.
    """
    letter, grade = _split(where, tolerance_class)
    if not SMALLEST < size <= SIZES[-1]:
        raise StudyError(
            f"{where}: the size is {size:.6g} mm; expected more than {SMALLEST:g} and at most {SIZES[-1]} mm. Sizes in "
            "metres or micrometres go with units='m' or units='um'; of others give the limits: uqmbd.tolerance."
        )
    row = place(size, SIZES)
    width = STANDARD[row][GRADES.index(grade)]
    hole, name = letter.isupper(), letter.lower()
    if name == "js":
        return -width / 2, width / 2
    if name == "j":
        return _j(where, hole, grade, row, width)
    values = DEVIATIONS[name]
    found = values[place(size, SIZES if len(values) == len(SIZES) else SUBDIVIDED)]
    if found is None:
        raise _none(where, f"for {size:.12g} mm")
    if name <= "h":  # away from the nominal size, into clearance
        return (found, found + width) if hole else (-found - width, -found)
    number = GRADES.index(grade) - 1  # of the grades from 1 on
    if not hole:
        lower = 0 if name == "k" and not 4 <= number <= 7 else found
        return lower, lower + width
    upper = _upper_of_hole(where, name, number, row, found)
    return upper - width, upper


def _upper_of_hole(where: str, name: str, number: int, row: int, found: int) -> float:
    """Return the upper deviation of holes K to ZC, corrected by the difference of the standard tolerances."""
    if number < CORRECTED.start:
        raise _none(where, f"of grades below {CORRECTED.start}, as no correction is tabulated")
    up_to = 8 if name in "kmn" else 7
    if row == 0:  # sizes up to 3 mm are not corrected
        return -found
    if number <= up_to:
        if name == "m" and number == 6 and SIZES[row] == 315:  # noqa: PLR2004 - the standard's own exception
            return -9
        column = GRADES.index(str(number))
        return STANDARD[row][column] - STANDARD[row][column - 1] - found
    if name == "k":
        raise _none(where, "of grades above 8 for sizes above 3 mm")
    return 0 if name == "n" else -found


def _j(where: str, hole: bool, grade: str, row: int, width: float) -> tuple[float, float]:
    end = (HOLES_J if hole else SHAFTS_J).get(grade, (None,) * len(SIZES))[row]
    if end is None:
        known = "J6, J7 and J8" if hole else "j5, j6, j7, and j8 up to 3 mm,"
        raise _none(where, f"({known} exist; zones to both sides are {'JS' if hole else 'js'})")
    return (end - width, end) if hole else (end, end + width)


def _split(where: str, tolerance_class: str) -> tuple[str, str]:
    """Return the letter and the grade of a class."""
    parts = re.fullmatch(r"([A-Z]{1,2}|[a-z]{1,2})(\d{1,2})", tolerance_class)
    letter, grade = parts.groups() if parts else ("", "")
    names = (*DEVIATIONS, "j", "js")
    if letter.lower() in names and grade in GRADES:
        return letter, grade
    if parts and letter.lower() in names:
        raise StudyError(f"{where}: there is no grade {grade!r}; grades are {', '.join(GRADES)}.")
    hint = did_you_mean(letter.lower(), names) if parts else ""
    raise StudyError(
        f"{where}: expected a class of ISO 286: a letter, capital for holes and small for shafts, and a grade, such as "
        f"'H7', 'g6' or 'js9'{hint or '.'}"
    )


def _none(where: str, which: str) -> StudyError:
    return StudyError(
        f"{where}: no deviation of this class is known {which}. Give the limits instead: "
        "uqmbd.tolerance(nominal, plus, minus)."
    )
