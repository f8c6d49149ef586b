"""Limits of size of ISO 286 for a class such as H7 or g6.

The tables of ISO 286-1:2010 are for sizes up to 500 mm, in micrometres. The standard prescribes these rounded values.
"""

from __future__ import annotations

import re
from typing import TYPE_CHECKING

from uqmbd.arguments import typechecked
from uqmbd.errors import StudyError
from uqmbd.names import checked, did_you_mean
from uqmbd.randomness.tolerances.limits import made, require_number

if TYPE_CHECKING:
    import chaospy

__all__ = ["DEVIATIONS", "GRADES", "SIZES", "STANDARD", "SUBDIVIDED", "deviations", "iso286", "place"]

SIZES = (3, 6, 10, 18, 30, 50, 80, 120, 180, 250, 315, 400, 500)
"""Ends of the ranges of size, mm; each end belongs to the range below it."""

SUBDIVIDED = (
    3, 6, 10, 14, 18, 24, 30, 40, 50, 65, 80, 100, 120, 140, 160, 180, 200, 225, 250, 280, 315, 355, 400, 450, 500,
)  # fmt: skip
"""Ends of the finer ranges, mm."""

GRADES = ("01", "0", *(str(k) for k in range(1, 19)))
"""Standard tolerance grades, in the order of `STANDARD`."""

STANDARD = (
    (0.3, 0.5, 0.8, 1.2, 2, 3, 4, 6, 10, 14, 25, 40, 60, 100, 140, 250, 400, 600, 1000, 1400),
    (0.4, 0.6, 1, 1.5, 2.5, 4, 5, 8, 12, 18, 30, 48, 75, 120, 180, 300, 480, 750, 1200, 1800),
    (0.4, 0.6, 1, 1.5, 2.5, 4, 6, 9, 15, 22, 36, 58, 90, 150, 220, 360, 580, 900, 1500, 2200),
    (0.5, 0.8, 1.2, 2, 3, 5, 8, 11, 18, 27, 43, 70, 110, 180, 270, 430, 700, 1100, 1800, 2700),
    (0.6, 1, 1.5, 2.5, 4, 6, 9, 13, 21, 33, 52, 84, 130, 210, 330, 520, 840, 1300, 2100, 3300),
    (0.6, 1, 1.5, 2.5, 4, 7, 11, 16, 25, 39, 62, 100, 160, 250, 390, 620, 1000, 1600, 2500, 3900),
    (0.8, 1.2, 2, 3, 5, 8, 13, 19, 30, 46, 74, 120, 190, 300, 460, 740, 1200, 1900, 3000, 4600),
    (1, 1.5, 2.5, 4, 6, 10, 15, 22, 35, 54, 87, 140, 220, 350, 540, 870, 1400, 2200, 3500, 5400),
    (1.2, 2, 3.5, 5, 8, 12, 18, 25, 40, 63, 100, 160, 250, 400, 630, 1000, 1600, 2500, 4000, 6300),
    (2, 3, 4.5, 7, 10, 14, 20, 29, 46, 72, 115, 185, 290, 460, 720, 1150, 1850, 2900, 4600, 7200),
    (2.5, 4, 6, 8, 12, 16, 23, 32, 52, 81, 130, 210, 320, 520, 810, 1300, 2100, 3200, 5200, 8100),
    (3, 5, 7, 9, 13, 18, 25, 36, 57, 89, 140, 230, 360, 570, 890, 1400, 2300, 3600, 5700, 8900),
    (4, 6, 8, 10, 15, 20, 27, 40, 63, 97, 155, 250, 400, 630, 970, 1550, 2500, 4000, 6300, 9700),
)
"""Standard tolerances, micrometres, with a row for each of `SIZES` and a column for each of `GRADES`."""

DEVIATIONS: dict[str, tuple[int | None, ...]] = {
    "a": (270, 270, 280, 290, 290, 300, 300, 310, 320, 340, 360, 380, 410, 460, 520, 580, 660, 740, 820, 920, 1050,
          1200, 1350, 1500, 1650),
    "b": (140, 140, 150, 150, 150, 160, 160, 170, 180, 190, 200, 220, 240, 260, 280, 310, 340, 380, 420, 480, 540, 600,
          680, 760, 840),
    "c": (60, 70, 80, 95, 95, 110, 110, 120, 130, 140, 150, 170, 180, 200, 210, 230, 240, 260, 280, 300, 330, 360, 400,
          440, 480),
    "cd": (34, 46, 56, None, None, None, None, None, None, None, None, None, None),
    "d": (20, 30, 40, 50, 65, 80, 100, 120, 145, 170, 190, 210, 230),
    "e": (14, 20, 25, 32, 40, 50, 60, 72, 85, 100, 110, 125, 135),
    "ef": (10, 14, 18, None, None, None, None, None, None, None, None, None, None),
    "f": (6, 10, 13, 16, 20, 25, 30, 36, 43, 50, 56, 62, 68),
    "fg": (4, 6, 8, None, None, None, None, None, None, None, None, None, None),
    "g": (2, 4, 5, 6, 7, 9, 10, 12, 14, 15, 17, 18, 20),
    "h": (0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0),
    "k": (0, 1, 1, 1, 2, 2, 2, 3, 3, 4, 4, 4, 5),
    "m": (2, 4, 6, 7, 8, 9, 11, 13, 15, 17, 20, 21, 23),
    "n": (4, 8, 10, 12, 15, 17, 20, 23, 27, 31, 34, 37, 40),
    "p": (6, 12, 15, 18, 22, 26, 32, 37, 43, 50, 56, 62, 68),
    "r": (10, 15, 19, 23, 23, 28, 28, 34, 34, 41, 43, 51, 54, 63, 65, 68, 77, 80, 84, 94, 98, 108, 114, 126, 132),
    "s": (14, 19, 23, 28, 28, 35, 35, 43, 43, 53, 59, 71, 79, 92, 100, 108, 122, 130, 140, 158, 170, 190, 208, 232,
          252),
    "t": (None, None, None, None, None, None, 41, 48, 54, 66, 75, 91, 104, 122, 134, 146, 166, 180, 196, 218, 240, 268,
          294, 330, 360),
    "u": (18, 23, 28, 33, 33, 41, 48, 60, 70, 87, 102, 124, 144, 170, 190, 210, 236, 258, 284, 315, 350, 390, 435, 490,
          540),
    "v": (None, None, None, None, 39, 47, 55, 68, 81, 102, 120, 146, 172, 202, 228, 252, 284, 310, 340, 385, 425, 475,
          530, 595, 660),
    "x": (20, 28, 34, 40, 45, 54, 64, 80, 97, 122, 146, 178, 210, 248, 280, 310, 350, 385, 425, 475, 525, 590, 660,
          740, 820),
    "y": (None, None, None, None, None, 63, 75, 94, 114, 144, 174, 214, 254, 300, 340, 380, 425, 470, 520, 580, 650,
          730, 820, 920, 1000),
    "z": (26, 35, 42, 50, 60, 73, 88, 112, 136, 172, 210, 258, 310, 365, 415, 465, 520, 575, 640, 710, 790, 900, 1000,
          1100, 1250),
    "za": (32, 42, 52, 64, 77, 98, 118, 148, 180, 226, 274, 335, 400, 470, 535, 600, 670, 740, 820, 920, 1000, 1150,
           1300, 1450, 1600),
    "zb": (40, 50, 67, 90, 108, 136, 160, 200, 242, 300, 360, 445, 525, 620, 700, 780, 880, 960, 1050, 1200, 1300,
           1500, 1650, 1850, 2100),
    "zc": (60, 80, 97, 130, 150, 188, 218, 274, 325, 405, 480, 585, 690, 800, 900, 1000, 1150, 1250, 1350, 1550, 1700,
           1900, 2100, 2400, 2600),
}  # fmt: skip
"""Distance of the zone of a letter from the nominal size, by `SIZES` or `SUBDIVIDED`; None if it does not exist."""

SHAFTS_J: dict[str, tuple[int | None, ...]] = {
    "5": (-2, -2, -2, -3, -4, -5, -7, -9, -11, -13, -16, -18, -20),
    "6": (-2, -2, -2, -3, -4, -5, -7, -9, -11, -13, -16, -18, -20),
    "7": (-4, -4, -5, -6, -8, -10, -12, -15, -18, -21, -26, -28, -32),
    "8": (-6, None, None, None, None, None, None, None, None, None, None, None, None),
}
"""Lower deviations of shafts j, by grade."""

HOLES_J: dict[str, tuple[int | None, ...]] = {
    "6": (2, 5, 5, 6, 8, 10, 13, 16, 18, 22, 25, 29, 33),
    "7": (4, 6, 8, 10, 12, 14, 18, 22, 26, 30, 36, 39, 43),
    "8": (6, 10, 12, 15, 20, 24, 28, 34, 41, 47, 55, 60, 66),
}
"""Upper deviations of holes J, by grade."""


def place(size: float, ends: tuple[int, ...]) -> int:
    """Return the index of the range to which a size, mm, belongs."""
    return next(k for k, end in enumerate(ends) if size <= end)


UNITS = {"mm": 1.0, "m": 1e3, "um": 1e-3}
"""Length of each unit, mm."""

SMALLEST = 1.0
"""Size, mm, up to which the standard has exceptions."""

CORRECTED = range(3, 9)
"""Grades for which the standard tabulates the correction of holes: IT3 to IT8."""


@typechecked
@checked
def iso286(
    nominal: float, tolerance_class: str, cpk: float = 1.33, units: str = "mm", inspected: bool = False
) -> chaospy.Distribution:
    """Return the distribution of a size with a tolerance class of ISO 286, such as 30 H7.

    Parameters
    ----------
    nominal : float
        Nominal size, in `units`; above 1 mm, at most 500 mm.
    tolerance_class : str
        Letter (capital for holes, small for shafts) and grade, such as ``"H7"``, ``"g6"`` or ``"js9"``.
    cpk : float
        Process capability index, as for `uqmbd.tolerance`.
    units : {"mm", "m", "um"}
        Units of `nominal` and of the returned distribution, and thus of a random variable with this distribution.
    inspected : bool
        Whether parts beyond the limits are rejected.

    Returns
    -------
    chaospy.Distribution
        Distribution of the size, as from `uqmbd.tolerance`.

    Raises
    ------
    uqmbd.StudyError
        If the standard has no such class for the size.

    Notes
    -----
    Limits come from the tables of ISO 286-1:2010. These limits include the correction of holes K, M, N up to grade 8
    and P to ZC up to grade 7. Zones js extend half the standard tolerance to either side, without the rounding to whole
    micrometres in some tables of grades 7 to 11. The function rejects sizes up to 1 mm and holes K to ZC of grades
    below 3. It also rejects the letters cd, ef and fg above 10 mm.

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
        raise StudyError(f"{where}: the class is {tolerance_class!r}; expected a string such as 'H7' or 'g6'.")
    per_mm = UNITS[units]
    lower, upper = deviations(where, size * per_mm, tolerance_class)
    low, high = (round(x * 1e-3 / per_mm, 12) for x in (lower, upper))
    ends = "/".join(f"{x:+.12g}" if x else "0" for x in (high, low))
    source = f"{size:.12g} {tolerance_class} (ISO 286) {ends} {units}"
    return made(where, size, high, low, cpk, inspected, source, units)


def deviations(where: str, size: float, tolerance_class: str) -> tuple[float, float]:
    """Return the lower and the upper deviation, micrometres, of a size, mm, in a tolerance class such as ``"H7"``.

    Raise StudyError if the standard has no such class; `where` begins messages.
    """
    letter, grade = _split(where, tolerance_class)
    if not SMALLEST < size <= SIZES[-1]:
        raise StudyError(
            f"{where}: the size is {size:.6g} mm; expected more than {SMALLEST:g} and at most {SIZES[-1]} mm. For "
            "sizes in metres or micrometres, use units='m' or units='um'. For other sizes, define the limits with "
            "uqmbd.tolerance."
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
    if name <= "h":  # away from the nominal size, towards clearance
        return (found, found + width) if hole else (-found - width, -found)
    number = GRADES.index(grade) - 1  # grades from 1 on
    if not hole:
        lower = 0 if name == "k" and not 4 <= number <= 7 else found
        return lower, lower + width
    upper = _upper_of_hole(where, name, number, row, found)
    return upper - width, upper


def _upper_of_hole(where: str, name: str, number: int, row: int, found: int) -> float:
    """Return the upper deviation of holes K to ZC, corrected by the difference of the standard tolerances."""
    if number < CORRECTED.start:
        raise _none(where, f"for grades below {CORRECTED.start}, because no correction is tabulated")
    up_to = 8 if name in "kmn" else 7
    if row == 0:  # sizes up to 3 mm are not corrected
        return -found
    if number <= up_to:
        if name == "m" and number == 6 and SIZES[row] == 315:  # noqa: PLR2004 - the standard's own exception
            return -9
        column = GRADES.index(str(number))
        return STANDARD[row][column] - STANDARD[row][column - 1] - found
    if name == "k":
        raise _none(where, "for grades above 8 and sizes above 3 mm")
    return 0 if name == "n" else -found


def _j(where: str, hole: bool, grade: str, row: int, width: float) -> tuple[float, float]:
    end = (HOLES_J if hole else SHAFTS_J).get(grade, (None,) * len(SIZES))[row]
    if end is None:
        known = "J6, J7 and J8" if hole else "j5, j6, j7, and j8 up to 3 mm,"
        raise _none(where, f"({known} exist; symmetric zones have the letters {'JS' if hole else 'js'})")
    return (end - width, end) if hole else (end, end + width)


def _split(where: str, tolerance_class: str) -> tuple[str, str]:
    """Return the letter and the grade of a class."""
    parts = re.fullmatch(r"([A-Z]{1,2}|[a-z]{1,2})(\d{1,2})", tolerance_class)
    letter, grade = parts.groups() if parts else ("", "")
    names = (*DEVIATIONS, "j", "js")
    if letter.lower() in names and grade in GRADES:
        return letter, grade
    if parts and letter.lower() in names:
        raise StudyError(f"{where}: the grade is {grade!r}; expected one of {', '.join(GRADES)}.")
    hint = did_you_mean(letter.lower(), names) if parts else ""
    raise StudyError(
        f"{where}: expected a tolerance class of ISO 286: a letter (upper case for holes, lower case for shafts) and "
        f"a grade, such as 'H7', 'g6' or 'js9'{hint or '.'}"
    )


def _none(where: str, which: str) -> StudyError:
    return StudyError(
        f"{where}: the tables contain no deviation of this class {which}. Define the limits instead: "
        "uqmbd.tolerance(nominal, plus, minus)."
    )
