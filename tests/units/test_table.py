"""The table of units, and the reader of text, say what pint says."""

import math
from fractions import Fraction

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from uqmbd.units import SPELLINGS, TABLE, Unit, advice_on, read_units
from uqmbd.units.pint_units import unit_of_pint

pint = pytest.importorskip("pint")


@pytest.fixture(scope="module")
def registry():
    return pint.UnitRegistry()


def in_pint(registry, text):
    return unit_of_pint(
        registry.parse_units({"°C": "delta_degC", "degC": "delta_degC", "rev": "revolution"}.get(text, text))
    )


def assert_same(found, expected):
    assert found is not None and expected is not None
    assert found.dimension == expected.dimension
    assert math.isclose(found.factor, expected.factor, rel_tol=1e-12)


def test_every_entry_of_the_table_is_that_of_pint(registry):
    different = {}
    for symbol, unit in TABLE.items():
        expected = in_pint(registry, symbol)
        if expected is None or expected.dimension != unit.dimension or not math.isclose(expected.factor, unit.factor):
            different[symbol] = (unit, expected)
    assert not different
    assert len(TABLE) > 100


def test_every_name_in_words_that_pint_knows_is_the_same_unit(registry):
    known = 0
    for word in SPELLINGS:
        if len(registry.parse_unit_name(word)) != 1:  # pint does not know it, or takes it for two of its units
            continue
        expected = in_pint(registry, word)
        known += 1
        assert_same(read_units(word), expected)
    assert known > 60


ORDINARY = ["m", "mm", "kg", "s", "N", "kN", "rad", "deg", "J", "Hz", "Pa", "W", "min"]


@st.composite
def products(draw):
    """Text of a product of powers, as people write it."""
    text = draw(st.sampled_from(ORDINARY))
    text += draw(st.sampled_from(["", "^2", "**3", "^-1", "^(1/2)", "^1.5"]))
    for _ in range(draw(st.integers(0, 3))):
        text += draw(st.sampled_from([" ", "*", "/", " / ", " * "]))
        text += draw(st.sampled_from(ORDINARY)) + draw(st.sampled_from(["", "^2", "**2", "^-2"]))
    if draw(st.booleans()):
        text += f"/({draw(st.sampled_from(ORDINARY))} {draw(st.sampled_from(ORDINARY))}^2)"
    return text


@settings(deadline=None)
@given(products())
def test_products_are_read_as_pint_reads_them(registry, text):
    assert_same(read_units(text), in_pint(registry, text))
    assert advice_on(text) == ""


@pytest.mark.parametrize(
    ("text", "same"),
    [
        ("m²", "m^2"),
        ("m·s⁻¹", "m/s"),
        ("N·m", "N m"),
        ("kg m^2", "kg*m**2"),
        ("N m s/rad", "N m s"),
        ("1", "rad"),
        ("1/s^2", "s^-2"),
        ("m/N s", "m s/N"),
    ],
)
def test_ways_of_writing_one_unit(text, same):
    assert read_units(text) == read_units(same)
    assert advice_on(text) == advice_on(same) == ""


@pytest.mark.parametrize(
    ("text", "written"),
    [
        ("meter", "m"),
        ("metres", "m"),
        ("Newton", "N"),
        ("Nm", "N m"),
        ("Ns/m", "N s/m"),
        ("kgm^2", "kg m^2"),
        ("sec", "s"),
        ("radians/second", "rad/s"),
        ("degrees", "deg"),
        ("m2", "m^2"),
        ("mm2", "mm^2"),
        ("Kg", "kg"),
        ("[m]", "m"),
        ("-", "1"),
        ("percent", "%"),
    ],
)
def test_other_spellings_are_understood_and_reported(text, written):
    assert f"write '{written}'" in advice_on(text)
    assert read_units(text) == read_units(written)
    assert advice_on(written) == ""


@pytest.mark.parametrize("text", ["apples", "m/", "N (m", "m//s", "^2", "m^", ")", "0 m", "*m", "m m)", "1/0"])
def test_what_is_no_unit_is_reported(text):
    assert "not a known unit" in advice_on(text)
    assert read_units(text) is None


@pytest.mark.parametrize(
    "text",
    [
        "m^(1/0)", "km^9999999", "m^" + "9" * 5000, "m" * 10000, "m" * 199 + "x", "m^(1.5/2)", "(" * 5000, "9" * 400,
        "(nm^30)^99 m", "1/(nm^40)", "m^100", "km^99 km^99", "((km^9)^9)^9", "m," * 5000, "N/m^n" * 2000, "²" * 150,
        "m^-0", "(m/m)^(3/7)",
    ],
)  # fmt: skip
def test_what_is_out_of_range_is_reported_as_any_other_text(text):
    unit, advice = read_units(text), advice_on(text)
    assert (unit is None) == bool(advice) and len(advice) < 400
    assert unit is None or (0 < unit.factor < math.inf and max(map(abs, unit.dimension)) <= 99)


PIECES = [
    "m",
    "km",
    "nm",
    "N",
    "kg",
    " ",
    "*",
    "/",
    "^",
    "**",
    "(",
    ")",
    "(1/2)",
    "-",
    "9",
    "0",
    ".",
    "99",
    "²",
    "⁻",
    "x",
    ",",
]


@settings(deadline=None)
@given(st.lists(st.sampled_from(PIECES), max_size=300).map("".join))
def test_any_text_of_pieces_of_units_is_read_or_reported(text):
    unit, advice = read_units(text), advice_on(text)
    assert unit is None or (0 < unit.factor < math.inf and isinstance(advice, str))


@settings(deadline=None)  # the first one waits for pint
@given(st.text(max_size=12))
def test_any_text_is_read_or_reported(text):
    """No text fails: it has a meaning, advice, or both; without letters and signs there is neither."""
    unit, advice = read_units(text), advice_on(text)
    assert unit is None or (isinstance(unit, Unit) and unit.factor > 0)
    assert unit is not None or advice or not any(character.isalnum() for character in text)


def test_an_exponent_may_be_given_elsewhere():
    """As of the stiffness of a law of contact."""
    for text in ("N/m^n", "N/m**n", "N s/m^p"):
        assert read_units(text) is None and advice_on(text) == ""
    assert "not a known unit" in advice_on("apples^n")
    assert "not a known unit" in advice_on("N/m^apples")


def test_one_or_the_other_is_written_with_a_comma():
    assert read_units("N s/m, N m s/rad") is None and advice_on("N s/m, N m s/rad") == ""
    assert "write 'N m'" in advice_on("N/m, Nm")


def test_nothing_is_stated_by_an_empty_text():
    assert read_units("") is None and advice_on("") == "" and advice_on("  ") == ""


def test_what_is_not_in_the_table_is_asked_of_pint():
    assert "furlong" not in TABLE and "furlong" not in SPELLINGS
    furlong = read_units("furlong/s")
    assert furlong is not None and math.isclose(furlong.factor, 201.168, rel_tol=1e-5)
    assert furlong.dimension == read_units("m/s").dimension
    assert furlong.dimension[0] == Fraction(1)
