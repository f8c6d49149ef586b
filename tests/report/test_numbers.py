"""Numbers of tables and sentences: the same digits below each other, zero as zero, no number for what has none."""

from __future__ import annotations

import math
import re

import chaospy
import numpy as np
import pytest
import xarray as xr
from hypothesis import assume, given, settings
from hypothesis import strategies as st

import uqmbd
from uqmbd import extend, report, results
from uqmbd.cli.tables import show_summary
from uqmbd.report.sections.about_results.output_words import numbers
from uqmbd.report.view import StudyResult
from uqmbd.wording import format_at_most, format_cells, format_interval, format_interval_ends, format_part
from uqmbd_montecarlo import MonteCarlo


def text_of(page: str) -> str:
    """Return what a page says."""
    return re.sub(r"<(style|script).*?</\1>|<[^>]+>|\N{NO-BREAK SPACE}", " ", page, flags=re.DOTALL)


@pytest.mark.parametrize("exponent", range(-12, 13, 3))
def test_numbers_below_each_other_have_the_same_digits(exponent: int) -> None:
    """And say what they are: to half a unit of the last digit, with the power of ten that all of them share."""
    rng = np.random.default_rng(exponent + 20)
    values = (rng.normal(size=8) * 10.0 ** (exponent + rng.integers(-3, 1, 8))).tolist()
    errors = np.where(rng.uniform(size=8) < 0.5, np.abs(values) * 0.01, math.nan).tolist()
    cells = format_cells(values, "m", errors)
    decimals = {len(cell.number.lstrip("(").partition(".")[2]) for cell in cells}
    assert len(decimals) == 1
    powers = {found[1] for cell in cells if (found := re.search(r"10([⁻⁰¹²³⁴⁵⁶⁷⁸⁹]+)", cell.rest))}
    assert len(powers) <= 1
    power = int("".join("-0123456789"["⁻⁰¹²³⁴⁵⁶⁷⁸⁹".index(c)] for c in powers.pop())) if powers else 0
    unit = 10.0 ** (power - decimals.pop())
    for value, error, cell in zip(values, errors, cells, strict=True):
        read = float(cell.number.lstrip("(").replace("−", "-"))
        assert read * 10.0**power == pytest.approx(value, abs=0.51 * unit)
        assert ("±" in cell.rest) == math.isfinite(error) and cell.rest.endswith("m")


def test_rounding_is_zero_without_a_sign() -> None:
    for noise in (-1.6e-9, 1.6e-9, -0.0):
        assert {cell.number for cell in format_cells([noise, 0.0], scale=0.55)} == {"0.0000"}


@pytest.fixture(scope="module")
def tree() -> xr.DataTree:
    """A method by samples and one that solves for all realisations at once, with a mean that is zero but for rounding."""
    times = np.linspace(0, 2, 5)
    axes = extend.labels([("a", "m/s^2")], [("k", "N/m")], times)
    inputs = np.random.default_rng(2).normal(size=(60, 1))
    response = (inputs - inputs.mean()) * np.ones(5) - 1.6e-9
    samples = extend.sample_dataset(response[:, None], inputs, axes)
    first = extend.statistics_of_samples(samples)
    held = {"samples": samples}
    about = extend.statistics_dataset(axes, mean=np.full((1, 5), -1.6e-9), std=np.ones((1, 5)))
    first, about = (one.assign(integration_error=1e-9 * one["std"]) for one in (first, about))
    nodes = [
        results.propagator_node("counted", first, propagator="p", realisations=60, wall_time=0.3, children=held),
        results.propagator_node("solved", about, propagator="q", realisations=32, wall_time=0.48),
    ]
    nodes[-1].attrs["unknowns"] = 350
    return results.study_tree(nodes, study="s", mechanism="m")


def test_a_page_shows_zero_as_zero(tree: xr.DataTree, tmp_path) -> None:
    text = text_of(report.write_report(tree, tmp_path / "report.html").read_text(encoding="utf-8"))
    assert not re.search(r"1\.6\d* × 10⁻⁹|−0\.0+\b(?!\d)", text)
    assert "below 0.0001 % of the largest standard deviation" in text and not re.search(r"at most below|or less", text)


def test_nothing_failed_is_one_sentence(tree: xr.DataTree, tmp_path) -> None:
    page = report.write_report(tree, tmp_path / "report.html").read_text(encoding="utf-8")
    section = page.partition('<section id="failures">')[2].partition("</section>")[0]
    assert text_of(section).split() == "Failures No realisation failed.".split()
    assert 'class="good"' not in section


def test_what_solves_for_all_at_once_has_no_cost_of_one(tree: xr.DataTree, tmp_path) -> None:
    """Of 60 realisations in 0.3 s each takes 5 ms; a projected system has no such number."""
    page = report.write_report(tree, tmp_path / "report.html").read_text(encoding="utf-8")
    rows = re.findall(r"<tr>.*?</tr>", page.partition('<section id="cost">')[2].partition("</table>")[0], re.DOTALL)
    counted, solved = (" ".join(text_of(row).split()) for row in rows[1:])
    assert counted.endswith(" 5 ms") and solved.endswith(" –")


def test_numbered_inputs_stand_in_the_order_of_their_numbers(tmp_path) -> None:
    """From the study to the page: the tenth comes after the ninth, in tables and figures."""
    roads = [uqmbd.RandomVariable(f"road_{k}", chaospy.Normal(0, 1)) for k in range(1, 13)]
    mechanism = uqmbd.Mechanism("car", uqmbd.Line())
    body = mechanism.body("body", mass=1, position=sum(roads[1:], roads[0]))
    mechanism.output("x", body.position, units="m")
    tree = uqmbd.Study("car", mechanism, [0, 1], [MonteCarlo(samples=20, seed=1)]).run()
    page = report.write_report(tree, tmp_path / "report.html").read_text(encoding="utf-8")
    rows = re.findall(r">(road_[0-9]+)<", page.partition('<section id="inputs">')[2].partition("</table>")[0])
    assert rows == [f"road_{k}" for k in range(1, 13)]
    drawn = [axes.get_xlabel() for axes in report.inputs(tree["monte-carlo"]).axes]
    assert drawn == rows


def test_counters_that_counted_nothing_have_no_line(tree: xr.DataTree, tmp_path) -> None:
    counted = tree.copy(deep=True)
    counted["counted"].attrs["solver_counters"] = '{"steps": 12, "events": 0, "mine": "none"}'
    page = report.write_report(counted, tmp_path / "report.html").read_text(encoding="utf-8")
    text = text_of(page.partition('<section id="cost">')[2].partition("</section>")[0])
    assert "integration steps" in text and "mine" in text and "events" not in text


@settings(max_examples=400, deadline=None)
@given(st.floats(1e-9, 1 - 1e-9), st.floats(1e-9, 1 - 1e-9))
def test_ends_of_an_interval_differ_in_their_digits(one, other):
    """Each is rounded by at most a quarter of the width, is never shown as 0 or 100 %, and the value is between them."""
    low, high = sorted((one, other))
    assume(high - low > 1e-9 * high)
    texts = format_interval_ends(low, high).split(" to ")
    shown = [number_of(text) for text in texts]
    assert len(texts) == 2 and texts[0] != texts[1] and 0 < shown[0] < shown[1] < 1
    for text, exact in zip(shown, (low, high), strict=True):
        assert abs(text - exact) <= max(0.2501 * (high - low), 1e-13)
    value = number_of(format_interval((low + high) / 2, low, high).partition(" (")[0])
    assert shown[0] < value < shown[1]


@settings(max_examples=400, deadline=None)
@given(st.floats(-12, -1), st.floats(0.01, 3.99))
def test_ends_of_an_interval_have_one_power_of_ten(size, decades):
    """A probability, as both of its ends: in per cent, or with one power of ten; a millionth of a per cent is no such."""
    low, high = 10.0**size, min(10.0 ** (size + decades), 0.9)
    value = math.sqrt(low * high)
    assume(high < 1e-4 or low >= 1e-6)
    texts = [*format_interval_ends(low, high).split(" to "), format_interval(value, low, high).partition(" (")[0]]
    assert len({text.partition(" × ")[2] or text[-1] for text in texts}) == 1, texts
    assert [number_of(text) for text in texts] == pytest.approx([low, high, value], rel=0.06)


def test_the_smallest_numbers_are_probabilities():
    for low, high in ((5e-324, 1e-320), (5e-324, 0.5), (2.2e-308, 3e-307), (1e-20, 5e-5)):
        assert [number_of(text) for text in format_interval_ends(low, high).split(" to ")] == pytest.approx(
            [low, high], rel=0.06, abs=1e-323
        )


def test_an_error_above_one_hundred_per_cent_is_a_factor():
    for words in (format_at_most(30.91, "the standard deviation"), format_part(30.91, "the standard deviation")):
        assert "31 times" in words and "the standard deviation" in words and "%" not in words
    for share in (1e-9, 0.3, 1.0):
        assert "%" in format_at_most(share, "x") and "%" in format_part(share, "x")


def number_of(text):
    """The number of a text such as 12.3 % or 1.5 × 10⁻⁷."""
    if text.endswith(" %"):
        return float(text.removesuffix(" %")) / 100
    mantissa, _, power = text.partition(" × 10")
    return float(f"{mantissa}e{power.translate(str.maketrans('⁻⁰¹²³⁴⁵⁶⁷⁸⁹', '-0123456789'))}")


@pytest.mark.parametrize(("samples", "bounded"), [(60, False), (400, True)])
def test_quantiles_are_shown_with_their_stored_intervals(tmp_path, samples: int, bounded: bool) -> None:
    """Below the quantiles at chosen times, and next to those of scalar outputs; an end that is unknown is infinite."""
    speed = uqmbd.RandomVariable("speed", chaospy.Normal(3, 0.2), units="m/s")
    mechanism = uqmbd.Mechanism("throw", uqmbd.Line())
    stone = mechanism.body("stone", mass=1, velocity=speed)
    mechanism.output("height", stone.position[0], units="m")
    mechanism.output("last", uqmbd.final(stone.position[0]), units="m")
    tree = uqmbd.Study("s", mechanism, [1.0, 2.0], [MonteCarlo(samples=samples, seed=1)]).run()
    result = StudyResult.of(tree)
    data = tree["monte-carlo/statistics"].to_dataset().isel(output=0)
    rows = numbers(result.methods["monte-carlo"], "height")
    page = report.write_report(tree, tmp_path / "report.html").read_text(encoding="utf-8")
    read = [float(x.replace("∞", "inf").replace("−", "-")) for x in rows[-1]["within0.025"].split(" to ")]
    stored = data["quantile_interval"].sel(probability=0.025, time=2.0).transpose("bound").values
    assert read == pytest.approx(stored.tolist(), rel=1e-3) and np.isfinite(read[0]) == bounded
    for row in rows:
        for level in ("0.025", "0.5", "0.975"):
            assert f'{row[f"q{level}"]} <span class="soft within">{row[f"within{level}"]}</span>' in page
    ends = tree["monte-carlo/scalars/statistics/quantile_interval"].sel(probability=0.95).isel(output=0)
    low, high = format_cells(ends.transpose("bound").values.tolist(), scale=7.0)
    assert f'm <span class="soft within">{low} to {high}</span>' in page and np.isfinite(float(ends[1])) == bounded


def test_quantiles_of_narrow_distributions_have_digits_that_differ() -> None:
    """The standard deviation is 3e-4 of the mean; four digits would be equal."""
    inputs = np.random.default_rng(1).normal(0.1, 3e-5, (400, 1))
    axes = extend.labels([("x", "m")], [("a", "m")], [0.0, 1.0])
    data = extend.statistics_of_samples(extend.sample_dataset(inputs[:, :, None] * np.ones(2), inputs, axes))
    node = results.propagator_node("mc", data, propagator="p", realisations=400, wall_time=1.0)
    result = StudyResult.of(results.study_tree([node], study="s", mechanism="m"))
    for row in numbers(result.methods["mc"], "x"):
        assert len({row[f"q{level}"] for level in ("0.025", "0.5", "0.975")}) == 3
        for level in ("0.025", "0.5", "0.975"):
            low, high = row[f"within{level}"].split(" to ")
            assert float(low) < float(row[f"q{level}"]) < float(high) and len(low) == len("0.100000")


def test_a_coupled_system_explains_its_realisations(make_chaos, capsys, tmp_path) -> None:
    """The console and the page say what the realisations are; methods of separate realisations have no such sentence."""
    coupled, separate = make_chaos("together", 2), make_chaos("apart", 3)
    coupled.attrs["unknowns"] = 24
    tree = results.study_tree([coupled, separate], study="s", mechanism="m")
    show_summary(tree, files={})
    page = report.write_report(tree, tmp_path / "report.html").read_text(encoding="utf-8")
    for text in (" ".join(capsys.readouterr().out.split()), page):
        assert text.count("together integrates a system of 24 unknowns instead of single realisations. The") == 1
        assert (
            "of realisations of this method counts the nodes of this system, and verification" in text
            and "apart integrates" not in text
        )
