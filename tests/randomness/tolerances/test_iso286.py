"""Classes of ISO 286 against printed tables, the formulas of the standard, and what its correction of holes is for."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

import uqmbd
from uqmbd.randomness.tolerances.classes import DEVIATIONS, GRADES, SIZES, STANDARD, SUBDIVIDED, deviations, place

PRINTED = {
    # shafts, JIS B 0401 (1999) as printed by Sumitomo Electric Hardmetal
    5: "b9 -170 -140, c9 -100 -70, d8 -48 -30, e7 -32 -20, e8 -38 -20, e9 -50 -20, f6 -18 -10, f7 -22 -10, f8 -28 -10, "
    "g5 -9 -4, g6 -12 -4, h5 -5 0, h6 -8 0, h7 -12 0, h8 -18 0, h9 -30 0, js5 -2.5 2.5, js6 -4 4, k5 1 6, k6 1 9, "
    "m5 4 9, m6 4 12, n6 8 16, p6 12 20, r6 15 23, s6 19 27, u6 23 31, x6 28 36",
    20: "b9 -212 -160, c9 -162 -110, d8 -98 -65, d9 -117 -65, e7 -61 -40, f6 -33 -20, g5 -16 -7, k5 2 11, k6 2 15, "
    "m6 8 21, n6 15 28, p6 22 35, r6 28 41, s6 35 48, u6 41 54, x6 54 67",
    30: "t6 41 54, u6 48 61, x6 64 77, "
    # holes, JIS B 0401 (1999) as printed by a maker of tools
    "D8 65 98, D9 65 117, E7 40 61, E8 40 73, F6 20 33, F7 20 41, F8 20 53, G6 7 20, G7 7 28, H6 0 13, H7 0 21, "
    "H8 0 33, H9 0 52, H10 0 84, JS6 -6.5 6.5, K6 -11 2, K7 -15 6, M6 -17 -4, M7 -21 0, N6 -24 -11, N7 -28 -7, "
    "P6 -31 -18, P7 -35 -14, R7 -41 -20, S7 -48 -27, T7 -54 -33, U7 -61 -40, X7 -77 -56",
    60: "b9 -264 -190, c9 -214 -140, d9 -174 -100, r6 41 60, s6 53 72, t6 66 85, u6 87 106",
    70: "b9 -274 -200, c9 -224 -150, r6 43 62, s6 59 78, R7 -62 -32",
    # holes as printed by DME
    2: "H11 0 60, H12 0 100, H13 0 140, J6 -4 2, J7 -6 4, J8 -8 6, K6 -6 0, K7 -10 0, K8 -14 0, M6 -8 -2, M7 -12 -2, "
    "N6 -10 -4, N7 -14 -4, N8 -18 -4, R7 -20 -10, JS6 -3 3, JS9 -12.5 12.5",
    10: "J6 -4 5, J7 -7 8, K6 -7 2, K8 -16 6, M7 -15 0, N8 -25 -3, R7 -28 -13, JS8 -11 11",
    14: "J6 -5 6, J7 -8 10, J8 -12 15, K6 -9 2, K7 -12 6, K8 -19 8, M6 -15 -4, M8 -25 2, N6 -20 -9, N8 -30 -3, R7 -34 -16",
    50: "J7 -11 14, K6 -13 3, K8 -27 12, M6 -20 -4, M7 -25 0, M8 -34 5, N6 -28 -12, N7 -33 -8, N8 -42 -3, R7 -50 -25",
    90: "J6 -6 16, K7 -25 10, K8 -38 16, M6 -28 -6, M8 -48 6, N6 -38 -16, N8 -58 -4, R7 -73 -38",
    150: "J8 -22 41, K6 -21 4, K8 -43 20, M6 -33 -8, M7 -40 0, N7 -52 -12, N8 -67 -4, R7 -90 -50",
    240: "J6 -7 22, K7 -33 13, K8 -50 22, M6 -37 -8, M8 -63 9, N6 -51 -22, N8 -77 -5, R7 -113 -67, JS9 -57.5 57.5",
    # widths of keyways, DIN 6885
    8: "N9 -36 0, P9 -51 -15, JS9 -18 18, D10 40 98",
    16: "N9 -43 0, P9 -61 -18",
    # corrections of ISO 286-2:1988 in its corrigendum of 2006, and the exception for M6
    320: "A13 1200 2090",
    100: "E8 72 126",
    29: "R10 -112 -28",
    300: "f9 -186 -56, M6 -41 -9, M7 -52 0",
}
"""Micrometres, lower and upper deviation, for nominal sizes in millimetres."""


@pytest.mark.parametrize("size", PRINTED)
def test_the_deviations_are_those_of_printed_tables(size):
    for entry in PRINTED[size].split(", "):
        name, lower, upper = entry.split()
        assert deviations("here", size, name) == (float(lower), float(upper)), (size, name)


def _mean_size(ends: tuple[int, ...], row: int) -> float:
    return math.sqrt((ends[row - 1] if row else 1) * ends[row])


def test_standard_tolerances_follow_the_formula_of_the_standard():
    """Multiples of ``i = 0.45 D^(1/3) + 0.001 D``, rounded; the first range departs by decision, the finest grades are rounded up."""
    multiples = {"5": 7, "6": 10, "7": 16, "8": 25, "9": 40, "10": 64, "11": 100, "12": 160, "13": 250, "14": 400}
    multiples |= {"15": 640, "16": 1000, "17": 1600, "18": 2500}
    for row in range(1, len(SIZES)):
        size = _mean_size(SIZES, row)
        unit = 0.45 * size ** (1 / 3) + 0.001 * size
        for grade, multiple in multiples.items():
            assert STANDARD[row][GRADES.index(grade)] == pytest.approx(multiple * unit, rel=0.045, abs=0.7)
        for grade, formula in {"01": 0.3 + 0.008 * size, "0": 0.5 + 0.012 * size, "1": 0.8 + 0.02 * size}.items():
            assert STANDARD[row][GRADES.index(grade)] == pytest.approx(formula, rel=0.3)


FORMULAS = {
    "a": lambda d, it: 265 + 1.3 * d if d < 120 else 3.5 * d,
    "b": lambda d, it: 140 + 0.85 * d if d < 160 else 1.8 * d,
    "d": lambda d, it: 16 * d**0.44,
    "e": lambda d, it: 11 * d**0.41,
    "f": lambda d, it: 5.5 * d**0.41,
    "g": lambda d, it: 2.5 * d**0.34,
    "k": lambda d, it: 0.6 * d ** (1 / 3),
    "m": lambda d, it: it(7) - it(6),
    "n": lambda d, it: 5 * d**0.34,
    "p": lambda d, it: it(7) + 2.5,
    "s": lambda d, it: it(8) + 2.5 if d < 50 else it(7) + 0.4 * d,
    "t": lambda d, it: it(7) + 0.63 * d,
    "u": lambda d, it: it(7) + d,
    "v": lambda d, it: it(7) + 1.25 * d,
    "x": lambda d, it: it(7) + 1.6 * d,
    "y": lambda d, it: it(7) + 2 * d,
    "z": lambda d, it: it(7) + 2.5 * d,
    "za": lambda d, it: it(8) + 3.15 * d,
    "zb": lambda d, it: it(9) + 4 * d,
    "zc": lambda d, it: it(10) + 5 * d,
}
"""Table 7 of ISO 286-1:1988; small sizes of p and of t to zc depart from them, by decision."""


@pytest.mark.parametrize("letter", FORMULAS)
def test_fundamental_deviations_follow_the_formulas_of_the_standard(letter):
    values = DEVIATIONS[letter]
    ends = SIZES if len(values) == len(SIZES) else SUBDIVIDED
    compared = 0
    for row, value in enumerate(values):
        if value is None or (letter >= "t" and ends[row] <= 30) or (letter == "p" and row == 0):
            continue
        widths = STANDARD[place(ends[row], SIZES)]
        expected = FORMULAS[letter](_mean_size(ends, row), lambda n, w=widths: w[GRADES.index(str(n))])
        assert value == pytest.approx(expected, rel=0.05, abs=2.6), (letter, ends[row])
        compared += 1
    assert compared >= 12


def test_in_betweens_are_geometric_means():
    for letter, (below, above) in {"cd": "cd", "ef": "ef", "fg": "fg", "r": "ps"}.items():
        for size in SUBDIVIDED:
            near, far = (_at(x, size) for x in (below, above))
            found = _at(letter, size)
            if found is not None:
                assert found == pytest.approx(math.sqrt(near * far), rel=0.03, abs=1.1), (letter, size)


def _at(letter: str, size: float) -> int | None:
    values = DEVIATIONS[letter]
    return values[place(size, SIZES if len(values) == len(SIZES) else SUBDIVIDED)]


@given(st.floats(3.001, 500), st.sampled_from(["k", "m", "n", *(x for x in DEVIATIONS if x >= "p")]), st.integers(4, 8))
def test_fits_are_the_same_from_the_hole_and_from_the_shaft(size, letter, grade):
    """What the correction is for: H7/p6 and P7/h6 have the same clearances."""
    assume(_at(letter, size) is not None)
    assume(grade <= 7 or letter in "mn")  # P to ZC are corrected to grade 7; shafts k are others beyond it
    assume(grade > 4 or letter != "k")
    assume(not (letter == "m" and grade == 6 and 250 < size <= 315))  # the standard's exception

    def clearances(hole, shaft):
        (low, high), (least, most) = deviations("here", size, hole), deviations("here", size, shaft)
        return low - most, high - least

    from_the_hole = clearances(f"H{grade}", f"{letter}{grade - 1}")
    assert from_the_hole == pytest.approx(clearances(f"{letter.upper()}{grade}", f"h{grade - 1}"))


@given(
    st.floats(1.001, 500),
    st.sampled_from([*DEVIATIONS, "js", "j"]),
    st.sampled_from(GRADES),
    st.booleans(),
)
def test_every_zone_is_as_wide_as_its_grade_or_refused_by_name(size, letter, grade, hole):
    name = (letter.upper() if hole else letter) + grade
    try:
        lower, upper = deviations("here", size, name)
    except uqmbd.StudyError as error:
        assert "contain no deviation of this class" in str(error)
    else:
        assert upper - lower == pytest.approx(STANDARD[place(size, SIZES)][GRADES.index(grade)], abs=1e-9)


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        ((30, "q6"), "expected a tolerance class of ISO 286"),
        ((30, "Hh7"), "expected a tolerance class of ISO 286"),
        ((30, "H19"), "the grade is '19'"),
        ((30, 7), "expected a text"),
        ((0.03, "H7"), "units='m'"),
        ((1, "H7"), "more than 1"),
        ((501, "H7"), "at most 500"),
        ((20, "t6"), "contain no deviation of this class"),
        ((14, "v6"), "contain no deviation of this class"),
        ((20, "K9"), "above 8"),
        ((20, "N2"), "below 3"),
        ((12, "ef7"), "contain no deviation of this class"),
        ((20, "j8"), "j5, j6, j7"),
        ((True, "H7"), "nominal is True; expected a number"),
        ((30, "H7", 0), "cpk is 0"),
        ((30, "H7", 1.33, "inch"), "units is 'inch'"),
    ],
)
def test_what_the_standard_does_not_give_is_refused(arguments, said):
    with pytest.raises(uqmbd.StudyError, match=said):
        uqmbd.iso286(*arguments)


def test_units_are_those_that_are_given_and_no_others():
    """Nothing is converted: a size in mm is no random variable in m."""
    for units, factor in {"m": 1e-3, "mm": 1.0, "um": 1e3}.items():
        variable = uqmbd.RandomVariable("d", uqmbd.iso286(30 * factor, "g6", units=units))
        assert variable.units == units
        assert variable.mean == pytest.approx((30 - 0.0135) * factor, rel=1e-14)
        found = uqmbd.extend.stated_tolerance(variable.distribution)
        assert (found.lower, found.upper) == pytest.approx(((30 - 0.020) * factor, (30 - 0.007) * factor), rel=1e-14)
    with pytest.raises(uqmbd.StudyError, match="is in mm"):
        uqmbd.RandomVariable("d", uqmbd.iso286(30, "g6"), units="m")
    assert uqmbd.RandomVariable("d", uqmbd.iso286(30, "g6"), units="mm").units == "mm"
    assert np.isclose(uqmbd.RandomVariable("d", 1e-3 * uqmbd.iso286(30, "g6"), units="m").mean, 0.0299865)
