"""Data of charts are those of the tree, as many as can be seen; numbers read as elsewhere in the report."""

import hashlib
import re
from importlib.resources import files

import numpy as np
import pytest

from tests.report.live.pages import bands_data
from uqmbd import extend, results
from uqmbd.report.charts import MOST_TIMES, unpacked
from uqmbd.report.live import page_scripts
from uqmbd.wording import format_number

DIGITS = str.maketrans("⁰¹²³⁴⁵⁶⁷⁸⁹", "0123456789")


def made(label, times, mean, std):
    """Return the node of a method with one output."""
    axes = extend.labels([("x", "m")], [], times)
    statistics = extend.statistics_dataset(axes, mean=[mean], std=[std])
    return results.propagator_node(label, statistics, propagator="p", realisations=1, wall_time=0.0)


def values(data, method=0, line=0):
    """Return the values of a line."""
    return unpacked(data["methods"][method]["lines"][line]["values"])


def test_a_peak_among_many_times_is_kept():
    times = np.linspace(0, 1, 20_000)
    std = np.full(20_000, 0.01)
    std[12_345] = 1.0
    data = bands_data({"a": made("a", times, 0 * times, std)}, "x")
    chosen = unpacked(data["time"])
    assert len(chosen) <= MOST_TIMES and data["of"] == 20_000 and chosen[0] == 0 and chosen[-1] == 1
    assert chosen[data["start"]] == times[12_345]


def test_methods_that_end_early_have_no_values_then():
    times = np.linspace(0, 2, 21)
    nodes = {
        "short": made("short", times[:11], times[:11], 0.1 + 0 * times[:11]),
        "long": made("long", times, 2 * times, 0.1 + 0 * times),
    }
    data = bands_data(nodes, "x")
    np.testing.assert_array_equal(unpacked(data["time"]), times)
    np.testing.assert_array_equal(values(data, 0), np.where(times <= 1, times, np.nan))
    np.testing.assert_array_equal(values(data, 1), 2 * times)


def test_one_time_makes_no_chart():
    assert bands_data({"a": made("a", [1.0], [1.0], [0.1])}, "x") is None


def test_distances_of_any_size_are_stored():
    times = np.linspace(0, 1, 3)
    for scale in (1e-60, 1.0, 1e60):
        data = bands_data({"a": made("a", times, 0 * times, np.full(3, scale))}, "x")
        np.testing.assert_allclose(values(data, 0, 2), 1.96 * scale, rtol=1e-6)


@pytest.mark.parametrize("exponent", range(-9, 10, 2))
def test_numbers_read_as_python_writes_them(node, exponent):
    given = [float(v) for v in np.random.default_rng(exponent + 9).normal(size=20) * 10.0**exponent] + [0.0]
    assert node(["numbers.js"], "answer = given.map((v) => formatNumber(v));", given) == [
        format_number(v) for v in given
    ]


def test_a_number_has_the_digits_that_its_spread_needs(node):
    given = [[100000.00012345, 1e-3], [0.5, 0.1], [1.0, 1e-30], [1.23456e-7, 1e-9], [12.5, 0]]
    found = node(["numbers.js"], "answer = given.map(([v, s]) => formatNumber(v, s));", given)
    assert found == ["100000.00012", "0.5", "1", "1.2346 × 10⁻⁷", "12.5"]


def test_errors_have_two_digits_also_where_the_second_is_zero(node):
    given = [0.004, 0.0996, 0.996, 9.96, 12.5, 1234.0, 2e-4, 6.44e-9, 1.5e7, 0.0, None, -0.5]
    expected = ["0.0040", "0.10", "1.0", "10", "13", "1200", "2.0 × 10⁻⁴", "6.4 × 10⁻⁹", "1.5 × 10⁷", "0", "–", "−0.50"]
    assert node(["numbers.js"], "answer = given.map((v) => formatError(v));", given) == expected


def test_a_mean_that_is_zero_but_for_rounding_is_zero(node):
    assert node(["numbers.js"], "answer = given.map((v) => plainNumber(v, 0.01));", [-2.1e-20, 1e-3]) == ["0", "0.001"]


@pytest.mark.parametrize("scale", [1e-12, 1e-5, 0.02, 1.0, 400.0, 3e6])
def test_values_of_one_time_have_the_same_digits_and_zero_is_zero(node, scale):
    """Two more than the first of their spread, all of them; what is rounding has neither sign nor exponent."""
    given = [[scale * v for v in (-1.6e-9, 0.5, 12.25, -3.0)], scale * 0.66]
    found = node(["numbers.js"], "answer = alike(given[0], given[1]);", given)
    assert not found[0].strip("0.")
    read = [float(text.replace("−", "-").replace(" × 10⁻", "e-").translate(DIGITS)) for text in found]
    np.testing.assert_allclose(read, given[0], atol=0.5e-2 * scale)
    if scale > 1e-4:
        assert len({len(text.partition(".")[2]) for text in found}) == 1


def test_ends_of_an_interval_have_one_power_of_ten(node):
    """Of pairs within four decades of each other, at any size, with and without a spread; each is nearly exact."""
    rng = np.random.default_rng(3)
    sizes = 10 ** rng.uniform(-14, 12, 400)
    pairs = np.sort(rng.choice([-1, 1], (400, 1)) * sizes[:, None] * 10 ** rng.uniform(0, 3.9, (400, 2)))
    pairs[0] = 5.917e-5, 4.881e-4
    spreads = [[0.0, np.ptp(pair) / 4][k % 2] for k, pair in enumerate(pairs)]
    lines = "answer = given.map(([pair, s]) => [withSamePower(pair, s), alike(pair, s)]);"
    found = node(["numbers.js"], lines, [[pair.tolist(), spread] for pair, spread in zip(pairs, spreads, strict=True)])
    assert found[0][0] == ["0.5917 × 10⁻⁴", "4.881 × 10⁻⁴"]
    for pair, texts in zip(pairs, found, strict=True):
        for ends in texts:
            parts = [end.replace("−", "-").partition(" × 10") for end in ends]
            assert len({power for number, _, power in parts if float(number)}) <= 1, ends
            read = [
                float(number) * 10.0 ** int((power or "0").replace("⁻", "-").translate(DIGITS))
                for number, _, power in parts
            ]
            np.testing.assert_allclose(read, pair, rtol=6e-4, atol=0.01 * np.ptp(pair))


def test_ticks_that_are_a_step_apart_differ_and_are_exact(node):
    for step in (1e-6, 0.0025, 0.05, 0.25, 2, 50, 2.5e4):
        given = [[k * step for k in range(-3, 4)], step]
        found = node(["numbers.js"], "answer = tickLabels(given[0], given[1]);", given)
        read = [float(text.replace("−", "-")) for text in found]
        np.testing.assert_allclose(read, given[0], rtol=1e-12)
        assert len({len(text.partition(".")[2]) for text in found}) == 1 and found[3].strip("0.") == ""


def test_lines_of_reference_are_drawn_wherever_they_are(node):
    lines = "answer = limitsOf([{ lines: [{ values: [1, 2] }] }], [given]);"
    found = node(["chart_model.js"], lines, {"name": "a", "value": 1e6, "reference": True})
    assert len(found["limits"]) == 1 and not found["beyond"]


@pytest.mark.parametrize("length", [3, 30, 40, 60, 300])
def test_letters_of_an_axis_fit_or_are_cut(node, length):
    """260 pixels have room for 34 letters of 13 pixels, and for 42 of the smallest; of longer words the ends are left."""
    name = "a" * (length - 1) + "b"
    lines = "const { letters, rows } = fitted(given, 260); answer = [letters, rows];"
    letters, (shown,) = node(["chart_options.js"], lines, name)
    assert 10.5 <= letters <= 13 and 0.577 * letters * len(shown) <= 260 + 0.577 * letters * 2 and shown.endswith("b")
    assert (shown == name) == (length <= 42)


@pytest.mark.parametrize(
    "name", ["standard deviation of crank_angle [rad]", "difference of the standard deviation [rad]"]
)
def test_long_names_of_axes_have_two_rows_and_lose_no_letter(node, name):
    """Half a page wide and 146 pixels high: each row fits, and both are the whole name."""
    letters, rows = node(
        ["chart_options.js"], "const { letters, rows } = fitted(given, 146); answer = [letters, rows];", name
    )
    assert " ".join(rows) == name and len(rows) == 2
    assert all(0.577 * letters * len(row) <= 146 for row in rows)


def test_numbers_break_beside_to_and_plus_minus_only(node):
    given = ["5.619 × 10⁻⁵ m", "−1.5 × 10⁻⁴ to 2 N", "0.5 ± 0.1 rad"]
    found = node(["numbers.js"], "answer = given.map(unbroken);", given)
    assert [text.split(" ") for text in found] == [
        ["5.619\u00a0×\u00a010⁻⁵\u00a0m"],
        ["−1.5\u00a0×\u00a010⁻⁴", "to", "2\u00a0N"],
        ["0.5", "±", "0.1\u00a0rad"],
    ]


@pytest.mark.parametrize(("limit", "drawn"), [(2.9, True), (3.1, False), (-1.9, True), (-2.1, False), (0.5, True)])
def test_a_limit_farther_than_twice_the_height_of_the_curves_is_not_drawn(node, limit, drawn):
    lines = 'answer = limitsOf([{ lines: [{ values: [0, null, 1] }] }], [{ name: "a", value: given }]);'
    found = node(["chart_model.js"], lines, limit)
    assert len(found["limits" if drawn else "beyond"]) == 1 and not found["beyond" if drawn else "limits"]


def test_the_vendored_library_is_whole_and_has_its_licence():
    vendor = files("uqmbd.report.live") / "vendor"
    stated = dict(re.findall(r"\| `([\w.]+)` \|.*\| `([0-9a-f]{64})` \|", (vendor / "README.md").read_text("utf-8")))
    assert set(stated) == {"uPlot.iife.min.js", "uPlot.min.css", "three.min.js"}
    for name, digest in stated.items():
        assert hashlib.sha256((vendor / name).read_bytes()).hexdigest() == digest
    scripts = page_scripts()
    assert (
        "Permission is hereby granted" in scripts.uplot
        and "Permission is hereby granted" in scripts.three
        and (vendor / "uPlot.min.css").read_text("utf-8") == scripts.style
    )


def test_scripts_of_the_page_ask_for_nothing_and_make_no_markup():
    scripts = page_scripts()
    for text in (scripts.uplot, scripts.three, scripts.module):
        assert "</script" not in text.lower()
        assert not re.search(r"\beval\(|new Function|\bfetch\(|XMLHttpRequest|WebSocket|import\(|sendBeacon", text)
    assert not re.search(r"innerHTML|outerHTML|insertAdjacent|document\.write|localStorage|cookie", scripts.module)
