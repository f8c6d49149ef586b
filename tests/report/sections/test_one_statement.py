"""No page contradicts itself: whatever the numbers are, each output of each method has one statement, everywhere."""

from __future__ import annotations

import contextlib
import io
import re
from pathlib import Path

import chaospy
import numpy as np
import pytest
import xarray as xr
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from rich.console import Console

from uqmbd import RandomVariable, extend, report, results
from uqmbd.cli.compare import show_comparison
from uqmbd.cli.tables import show_summary
from uqmbd.randomness import GermSpace, JointInput
from uqmbd.report.overview.answers import ANSWERS
from uqmbd.report.view import StudyResult
from uqmbd.results import assessment
from uqmbd.wording import format_at_most, format_percent

TIMES = np.linspace(0, 2, 6)
SPACE = GermSpace.of(JointInput.of([RandomVariable("k", chaospy.Uniform(-1, 1))]))
WORST = ("differs", "under-resolved", "too few samples")


def chaos_node(label: str, scale: np.ndarray, error: np.ndarray, order: int, cost: float) -> xr.DataTree:
    """Return a chaos of random decay, whose stated error at each output and time is given."""
    names = [f"y{k}" for k in range(len(scale))]
    axes = extend.labels([(name, "m") for name in names], ["k"], TIMES)
    coefficients = np.stack([scale * 0 + 1.0, *(scale / 4**n for n in range(order))])
    chaos = results.PolynomialChaos(coefficients, np.arange(order + 1)[:, None], SPACE, axes)
    germs = np.array([[-0.5], [0.5]])
    response = chaos.evaluate_germs(germs) + error * np.maximum(chaos.std, 0.01 * chaos.std.max(axis=1, keepdims=True))
    chaos = results.PolynomialChaos(
        coefficients, chaos.multi_index, SPACE, axes, verification_germs=germs, verification_response=response
    )
    return results.propagator_node(
        label,
        chaos.statistics(samples=64),
        propagator="collocation",
        realisations=order + 3,
        wall_time=cost,
        children={"chaos": chaos.to_dataset()},
    )


def sampled_node(label: str, scale: np.ndarray, count: int, seed: int, cost: float) -> xr.DataTree:
    axes = extend.labels([(f"y{k}", "m") for k in range(len(scale))], ["k"], TIMES)
    x = np.random.default_rng(seed).uniform(-1, 1, count)
    data = extend.sample_dataset(1 + x[:, None, None] * scale * 3**0.5, x[:, None], axes)
    statistics = extend.statistics_of_samples(data)
    return results.propagator_node(
        label, statistics, data, propagator="monte-carlo", realisations=count, wall_time=cost,
        options={"samples": count, "sampling": "random"},
    )  # fmt: skip


@st.composite
def trees(draw: st.DrawFn) -> xr.DataTree:
    outputs = draw(st.integers(1, 3))
    sizes = st.sampled_from([0.0, 1e-15, 1e-3, 1.0])
    scale = np.array([draw(sizes) for _ in range(outputs)])[:, None] * np.linspace(0.1, 1, len(TIMES))
    nodes = []
    for k in range(draw(st.integers(1, 3))):
        error = 10.0 ** np.array(draw(st.lists(st.floats(-6, 0.3), min_size=6, max_size=6)))
        other = draw(st.sampled_from([1.0, 1.0, 1.3]))
        cost = draw(st.floats(0.1, 100))
        nodes.append(chaos_node(f"chaos-{k}", other * scale, error, draw(st.integers(1, 4)), cost))
    if draw(st.booleans()):
        count = draw(st.sampled_from([10, 60, 1000]))
        nodes.append(sampled_node("mc", scale, count, draw(st.integers(0, 99)), draw(st.floats(0.1, 100))))
    return results.study_tree(nodes, study="s", mechanism="m")


def console_of(tree: xr.DataTree, folder: Path, monkeypatch: pytest.MonkeyPatch) -> tuple[str, str]:
    """Return what a run prints at its end, and what `uqmbd compare` prints: lines are not wrapped."""
    said = []
    for module, show in (
        ("uqmbd.cli.tables", lambda: show_summary(tree, files={})),
        ("uqmbd.cli.compare.compare", lambda: show_comparison([results.save(tree, folder / "results.nc")])),
    ):
        wide, plain = Console(file=io.StringIO(), width=2000, highlight=False), io.StringIO()
        monkeypatch.setattr(f"{module}.console", lambda wide=wide: wide)
        with contextlib.redirect_stdout(plain):
            show()
        said.append(wide.file.getvalue() + plain.getvalue())
    return said[0], said[1]


def check_that_all_say_the_same(tree: xr.DataTree, folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The console, `uqmbd compare`, the first screen and notebooks print what `assess` returns, word for word."""
    found, data = results.assess(tree), tree["comparison"].to_dataset()
    if len(data["method"]) < 2:
        with contextlib.redirect_stdout(io.StringIO()) as plain:
            show_summary(tree, files={})
        console, compared = " ".join(plain.getvalue().split()), ""
    else:
        console, compared = console_of(tree, folder, monkeypatch)
    notebook = text_of(report.show(tree, []).html).replace("\N{NO-BREAK SPACE}", " ")
    first = ANSWERS.content(StudyResult.of(tree))
    if any(one.population for one in found.reliability):  # outputs of a method and level share a line
        assert {line["level"] for line in first["reliability"]} <= {one.level for one in found.reliability}
    else:
        words = ("level", "sign", "word", "name", "reason")
        stated = [{word: getattr(one, word) for word in words} for one in found.reliability]
        assert first["reliability"] == stated[: len(first["reliability"])]
    assert first["next"]["words"] == found.recommendation
    shown = found.reliability[:5] if compared else []  # of a single method the console wraps its lines
    for one in shown:
        (line,) = [line for line in console.splitlines() if one.reason in line and f" {one.name} " in line]
        assert line.startswith(f"{one.sign} {one.word} ")
    for one in found.reliability:
        assert one.reason in notebook
    for sentence in (*found.recommendation, *found.reasons):
        assert " ".join(sentence.split()) in " ".join(console.split()) and " ".join(sentence.split()) in notebook
    if not compared:
        return
    # labels of `uqmbd compare` begin with the letter of the file
    lettered = re.compile(r"\b(chaos-\d|mc)\b")
    for sentence in (*found.recommendation, *found.reasons):
        assert lettered.sub(r"A \1", sentence) in compared
    for one in found.judgements:
        if one.method != found.reference:
            assert lettered.sub(r"A \1", one.text) in compared


def text_of(fragment: str) -> str:
    fragment = re.sub(r"<(style|script).*?</\1>", "", fragment, flags=re.S)
    return re.sub(r"\s+", " ", re.sub(r"<[^>]*>", " ", fragment)).replace("&#39;", "'")


def table(page: str, label: str) -> list[list[str]]:
    """Return the cells of a table by its label."""
    found = re.search(rf'aria-label="{label}"><table[^>]*>.*?<tbody>(.*?)</tbody>', page, flags=re.S)
    rows = re.findall(r"<tr>(.*?)</tr>", found.group(1), flags=re.S) if found else []
    return [
        [text_of(cell).strip() for cell in re.findall(r"<t[hd][^>]*>(.*?)</t[hd]>", row, flags=re.S)] for row in rows
    ]


@pytest.mark.thorough
@settings(max_examples=5, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(tree=trees())
def test_no_page_contradicts_itself(tree: xr.DataTree, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    check_that_all_say_the_same(tree, tmp_path, monkeypatch)
    page = report.write_report(tree, tmp_path / "report.html").read_text(encoding="utf-8")
    page = page.replace("\N{NO-BREAK SPACE}", " ")
    data = tree["comparison"].to_dataset()
    said = {(one.method, one.output): one.text for one in results.assess(tree).judgements}
    verdict = {
        (str(m), str(o)): (str(data["verdict_kind"].sel({"method": m, "output": o}).item()),
                           str(data["verdict"].sel({"method": m, "output": o}).item()))
        for m in data["method"].values for o in data["output"].values
    }  # fmt: skip
    assert said == {key: text for key, (_, text) in verdict.items()}

    # the list of verdicts, and that of the surrogates, have the statement and no other
    for output, method, text in table(page, "Verdicts"):
        assert text == verdict[method, output][1]
    trust = page.split('<section id="trust">')[1].split("</section>")[0]
    for caption, items in re.findall(
        r'<p class="caption">([^<]*) \(order[^<]*:</p>\s*<ul>(.*?)</ul>', trust, flags=re.S
    ):
        for item in re.findall(r"<li>(.*?)</li>", items, flags=re.S):
            output, _, text = text_of(item).strip().partition(": ")
            # of methods that are compared each verdict stands once among the sections: others lead there
            assert text.startswith(verdict[caption, output][1]) == (len(data["method"]) == 1)
    if len(data["method"]) > 1:
        listed = {(method, output): text for output, method, text in table(page, "Verdicts")}
        assert listed == {key: text for key, (_, text) in verdict.items()}
        assert 'href="#comparison"' in trust

    # numbers are the same wherever they stand
    shown = {(row[1], row[0]): row[5] for row in table(page, "Errors of the surrogates")}
    for (method, output), (kind, text) in verdict.items():
        largest = float(data["stated_error_max"].sel({"method": method, "output": output}))
        if kind == "no spread":
            assert text == "does not vary beyond the integration error"
            assert shown.get((method, output), "no spread") == "no spread"
            continue
        if (method, output) in shown:
            assert shown[method, output] == format_percent(largest)
        assert "does not vary" not in text
        # what is worst comes first: an error above the limit is said before that the method agrees
        if kind == "agrees":
            assert text.index("stated error of the") < text.index("agrees with")
            assert not any(word in text for word in WORST)
        else:
            assert "agrees" not in text
    if len(data["method"]) < 2:
        return
    first = page.split('<section id="summary"')[1].split("<nav")[0]
    lead = text_of(re.findall(r"<p>(.*?)</p>", first.split('id="next-head"')[1], flags=re.S)[0]).strip()
    assert lead == " ".join(data.attrs["recommendation"].split("\n")[0].split())
    recommended = re.match(r"Use (?!none:)(.*?):", lead)
    assert recommended or lead.startswith(
        ("No method is recommended", "No other", "No output varies", "Reduce rtol", "chaos")
    )
    for method in re.split(", | or ", recommended.group(1)) if recommended else ():
        assert not any(kind in WORST for (m, _), (kind, _) in verdict.items() if m == method)
        errors = data["stated_error_max"].sel({"method": method}).values
        assert format_at_most(float(errors.max()), "the standard deviation") in lead
    assert "to within" not in text_of(page)
    # what is to be believed follows from the verdict and the largest stated error of the most trusted method
    trusted = (results.assessment.recommended(data) or (data.attrs["reference"],))[0]
    levels = []
    for level, line in re.findall(r'<li><span class="sign level-(\d)">(.*?)</li>', first, flags=re.S):
        output = re.search("<strong>(.*?)</strong>", line).group(1)
        kind, _ = verdict[trusted, output]
        error = float(data["stated_error_max"].sel({"method": trusted, "output": output}))
        if kind == "no spread":
            assert level == "3" and "does not vary" in line
            continue
        levels.append(level)
        assert format_at_most(error, "the standard deviation") in text_of(line)
        assert (level == "2") <= (kind not in WORST and error <= 0.05) and (level == "0") >= (error > 0.1)
        assert ("agrees with" in line) <= (kind in ("agrees", "reference"))
    assert levels == sorted(levels)


@pytest.mark.slow
@settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(tree=trees())
def test_all_print_the_assessment(tree: xr.DataTree, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    check_that_all_say_the_same(tree, tmp_path, monkeypatch)


@pytest.mark.thorough
def test_the_console_says_the_same(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The table of `uqmbd compare` holds the statements of the comparison."""
    scale = np.ones((2, 6))
    nodes = [sampled_node("mc", scale, 1000, 1, 9.0), chaos_node("pce", scale, np.full(6, 0.03), 2, 1.0)]
    tree = results.study_tree(nodes, study="s", mechanism="m")
    path = results.save(tree, tmp_path / "results.nc")
    wide = Console(file=io.StringIO(), width=1000, highlight=False)
    monkeypatch.setattr("uqmbd.cli.compare.compare.console", lambda: wide)
    with contextlib.redirect_stdout(io.StringIO()):
        show_comparison([path])
    own = assessment.own_statements(tree["pce"])[0]
    assert own.startswith("stated error of the surrogate above 1 % of the standard deviation from 0 s on, 3.0 % at 0 s")
    assert f"{own}; agrees with A mc" in wide.file.getvalue()
    assert tree["comparison"]["verdict"].sel({"method": "pce"}).values[0].startswith(f"{own}; agrees with mc")
