"""What notebooks show: well-formed HTML with everything that a mechanism, a study or a chaos consists of."""

from __future__ import annotations

import base64
import builtins
import re
import sys
import types
from html.parser import HTMLParser
from xml.etree import ElementTree

import chaospy
import numpy as np
import pytest
import scipy.stats
import xarray as xr

import uqmbd
from uqmbd import extend, report, results
from uqmbd.progress import Lines, Notebook, Silent, choose_receiver
from uqmbd.results import PolynomialChaos
from uqmbd_collocation import Collocation
from uqmbd_joints import Revolute
from uqmbd_montecarlo import MonteCarlo

from .test_hostile_names import HOSTILE

VOID = {"img", "br", "meta"}


class Page(HTMLParser):
    """Parses strictly: every element that opens closes, in order."""

    def __init__(self, text):
        super().__init__()
        self.open, self.texts, self.images, self.heads = [], [], [], 0
        self.feed(text)
        assert self.open == []

    def handle_starttag(self, tag, attrs):
        if tag == "img":
            self.images.append(dict(attrs))
        self.heads += tag == "th"
        if tag not in VOID:
            self.open.append(tag)

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        self.texts.append(data)


@pytest.fixture(scope="module")
def study():
    length = uqmbd.RandomVariable("length", chaospy.Normal(1, 0.05), units="m")
    mechanism = uqmbd.Mechanism("<script>pendulum", uqmbd.Planar(gravity=(0, -9.81)))
    rod = mechanism.body("rod & bob", mass=2, inertia=1.0 * length**2, position=(length / 2, 0))
    mechanism.add(Revolute("pivot", mechanism.ground, rod, (0, 0), (-length / 2, 0)))
    mechanism.output("tip", rod.point((length / 2, 0))[1], units="m")
    return uqmbd.Study("swing", mechanism, np.linspace(0, 1, 5), [MonteCarlo(samples=20, seed=1), Collocation(order=2)])


def test_mechanism(study):
    page = Page(study.mechanism._repr_html_())
    for text in (
        "rod & bob",
        "pivot",
        "Revolute",
        "ground, rod & bob",
        "Normal(mu=1, sigma=0.05)",
        "tip",
        "length/2, 0",
    ):
        assert text in page.texts, text
    assert not any("<script>" in text for text in ("".join(page.texts).split("<script>pendulum")))
    (image,) = page.images
    assert image["src"].startswith("data:image/svg+xml") and "pendulum" in image["alt"]


def test_unfinished_mechanisms_show_themselves():
    empty = uqmbd.Mechanism("empty", uqmbd.Spatial())
    assert Page(empty._repr_html_()).images == []
    empty.body("one", mass=1, inertia=(1, 1, 1))
    assert len(Page(empty._repr_html_()).images) == 1


def test_study(study):
    page = Page(study._repr_html_())
    for text in ("swing – study", "5, from 0 s to 1 s", "monte-carlo", "MonteCarlo", "samples=20, seed=1", "order=2"):
        assert text in page.texts, text
    assert "rod & bob" in page.texts


def test_chaos(study):
    node = study.propagate(study.propagators[1])
    chaos = PolynomialChaos.from_dataset(node["chaos"])
    page = Page(chaos._repr_html_())
    assert "Order 2, 3 terms." in page.texts and "Outputs at t = 1 s" in page.texts
    assert f"{float(node['statistics']['std'][0, -1]):.4g}" in page.texts
    assert set(chaos.verdicts()) <= set(page.texts)


STATIC = re.compile(r"<script.*?</script>", re.DOTALL)


def charts(html):
    """Count the charts of an output, and check that each has a picture that stands without scripts."""
    still = STATIC.sub("", html)
    assert html.count('<figure class="charted"><img src="data:image/svg+xml') == still.count("<figure")
    assert all(image["src"].startswith("data:image/") for image in Page(still).images)
    return still.count('<figure class="charted">')


def test_studies_and_chaoses_have_charts(study):
    assert charts(study._repr_html_()) == 1
    tree = study.propagate(study.propagators[1])
    assert charts(PolynomialChaos.from_dataset(tree["chaos"])._repr_html_()) == 1
    assert charts(report.show(study).html) == 1 and charts(report.show(study.mechanism).html) == 0


def test_a_study_that_cannot_move_says_so(study):
    mechanism = uqmbd.Mechanism("m", uqmbd.Translational())
    stone = mechanism.body("stone", mass=1)
    mechanism.output("x", uqmbd.t / (uqmbd.t - 0.5) + stone.position[0])
    page = Page(uqmbd.Study("s", mechanism, [0.0, 0.5, 1.0], [])._repr_html_())
    assert "The motion at the means of the inputs cannot be drawn" in "".join(page.texts)
    large = study.with_times(np.linspace(0, 1, 60_000))
    assert "The study is large" in large._repr_html_() and charts(large._repr_html_()) == 0


def test_results_are_shown(study):
    tree = study.run()
    shown = report.show(tree)
    assert charts(shown.html) == 1 and shown._repr_html_() == shown.html
    for text in ("swing – results", "monte-carlo", "collocation", "20"):
        assert text in Page(shown.html).texts, text
    assert charts(report.show(tree["collocation"], ["tip"]).html) == 1
    assert charts(report.show(tree, []).html) == 0
    for given, said in (([tree, ["tap"]], "'tap'"), ([tree, "tip"], "'tip'"), ([study, ["tip"]], "only results have")):
        with pytest.raises(uqmbd.StudyError, match=said):
            report.show(*given)
    with pytest.raises(uqmbd.StudyError, match="a float; expected the result"):
        report.show(1.0)
    with pytest.raises(uqmbd.StudyError, match="no result of a method"):
        report.show(xr.DataTree())


def test_a_result_shows_the_first_screen_of_its_report(study, tmp_path):
    """Results, main contributors, reliability and the recommended method are those of the page, word for word."""
    tree, problem = report.with_motion(study.run(), study)
    assert not problem
    shown = report.show(tree).html
    written = report.write_report(tree, tmp_path / "report.html").read_text(encoding="utf-8")
    screen = written[written.index('<section id="summary"') : written.index("<nav ")]
    said = [
        re.sub("<[^>]*>", " ", part) for part in re.findall("<t[dh].*?</t[dh]>|<li>.*?</li>", STATIC.sub("", screen))
    ]
    words = [" ".join(text.replace("\N{NO-BREAK SPACE}", " ").split()) for text in said]
    assert len(words) > 10
    text = " ".join(re.sub("<[^>]*>", " ", STATIC.sub("", shown)).replace("\N{NO-BREAK SPACE}", " ").split())
    assert [one for one in words if one not in text] == []
    still = STATIC.sub("", shown)
    assert '<svg class="still"' in still and not re.search(r'(?:src|href)="(?!data:|#)', still)


NAMES = [*HOSTILE.values(), "crank length"]


@pytest.mark.parametrize("name", NAMES, ids=range(len(NAMES)))
def test_a_random_variable_shows_its_name_units_and_density(name):
    variable = uqmbd.RandomVariable(name, scipy.stats.norm(0.15, 0.003), units="N*m")
    page = Page(variable._repr_html_())
    assert f"{name} – random variable" in "".join(page.texts) and "N·m" in page.texts
    assert "Normal(mu=0.15, sigma=0.003)" in page.texts and "0.1500 N·m" in page.texts
    (image,) = page.images
    assert image["src"].startswith("data:image/svg+xml;base64,") and image["alt"].startswith(f"Density of {name}: ")
    assert ElementTree.fromstring(base64.b64decode(image["src"].partition(",")[2])).tag.endswith("svg")


DISTRIBUTIONS = {
    "normal": (chaospy.Normal(-3, 1e-4), scipy.stats.norm(-3, 1e-4)),
    "uniform": (chaospy.Uniform(1e5, 3e5), scipy.stats.uniform(1e5, 2e5)),
    "gamma": (scipy.stats.gamma(3, scale=2.0), scipy.stats.gamma(3, scale=2.0)),
    "weibull": (scipy.stats.weibull_min(1.5, scale=7.0), scipy.stats.weibull_min(1.5, scale=7.0)),
    "discrete": (chaospy.Binomial(40, 0.3), scipy.stats.binom(40, 0.3)),
    "dependent": (chaospy.MvNormal([5.0], [[4.0]]), scipy.stats.norm(5, 2)),
}


def number_of(text):
    """Read a number with a power of ten."""
    superscripts = str.maketrans("⁻⁰¹²³⁴⁵⁶⁷⁸⁹", "-0123456789")
    return float(text.replace("\N{MINUS SIGN}", "-").replace(" × 10", "e").translate(superscripts))


@pytest.mark.parametrize("name", DISTRIBUTIONS)
def test_the_interval_is_that_of_scipy(name):
    given, known = DISTRIBUTIONS[name]
    variable = uqmbd.random_vector([name], given)[0] if name == "dependent" else uqmbd.RandomVariable(name, given)
    (image,) = Page(variable._repr_html_()).images
    words = image["alt"].removeprefix(f"Density of {name}: mean ").removesuffix(".")
    mean, low, high = map(number_of, words.replace(", 95 % of the values from ", " to ").split(" to "))
    width = known.ppf(0.975) - known.ppf(0.025)
    np.testing.assert_allclose(
        [mean, low, high], [known.mean(), *known.ppf([0.025, 0.975])], rtol=0, atol=0.005 * width
    )


def test_a_variable_that_depends_on_another_one_is_drawn_from_realisations():
    """Of Y = X + e, X uniform in [1, 2]: the ends of the interval are within three standard errors."""
    first = chaospy.Uniform(1, 2)
    _, second = uqmbd.random_vector(["x", "y"], chaospy.J(first, chaospy.Normal(first, 0.1)))
    (image,) = Page(second._repr_html_()).images
    low, high = map(float, re.search(r"from (\S+) to (\S+)\.$", image["alt"]).groups())
    drawn = np.random.default_rng(5).uniform(1, 2, 400_000) + np.random.default_rng(6).normal(0, 0.1, 400_000)
    np.testing.assert_allclose([low, high], np.quantile(drawn, [0.025, 0.975]), atol=0.03)


def test_what_went_wrong_is_shown(study):
    tree = study.run()
    tree.attrs["failed"] = '{"galerkin": "no <memory>"}'
    assert "galerkin has no results: no <memory>" in Page(report.show(tree).html).texts


def test_a_session_that_asks_for_it_shows_results_by_themselves(study):
    known = {}
    formatter = types.SimpleNamespace(for_type=known.__setitem__, pop=known.pop)
    session = types.SimpleNamespace(display_formatter=types.SimpleNamespace(formatters={"text/html": formatter}))
    report.load_ipython_extension(session)
    tree = study.run()
    assert known[xr.DataTree](tree) == report.show(tree).html
    other = xr.DataTree(xr.Dataset({"a": 1}))
    assert "uqmbd-cell" not in known[xr.DataTree](other) and "xarray" in known[xr.DataTree](other)
    report.unload_ipython_extension(session)
    assert not known


class Display:
    """Stands for IPython.display: remembers what each cell output showed."""

    def __init__(self):
        self.shown = []

    def display(self, content, display_id):
        assert display_id is True
        index = len(self.shown)
        self.shown.append([content])
        return types.SimpleNamespace(update=self.shown[index].append)

    def HTML(self, text):
        Page(text)
        return text


@pytest.fixture
def display(monkeypatch):
    """A notebook: IPython with a kernel."""
    made = Display()
    shell = types.SimpleNamespace(kernel=object())
    monkeypatch.setitem(sys.modules, "IPython", types.SimpleNamespace(get_ipython=lambda: shell))
    monkeypatch.setitem(sys.modules, "IPython.display", made)
    return made


def test_a_notebook_shows_progress_by_itself(study, display):
    study.run()
    assert len(display.shown) == 1
    first = display.shown[0]
    assert "monte-carlo" in first[0] and "20" in first[0]
    last = re.sub("<[^>]*>", "", display.shown[0][-1])
    assert re.search("monte-carlo +━+ +20 ", last), last


def test_rich_itself_shows_nothing(study, display, monkeypatch):
    """In a notebook rich shows by itself what it prints: the table would stand there once for each of its changes."""
    shell = type("ZMQInteractiveShell", (), {"kernel": object()})()
    monkeypatch.setattr(builtins, "get_ipython", lambda: shell, raising=False)
    shown = []
    monkeypatch.setattr("rich.jupyter.display", lambda *given: shown.append(given))
    Notebook().start("a", 10)
    assert len(display.shown) == 1 and not shown


def test_a_bar_changes_in_place_and_not_too_often(display):
    now = [0.0]
    bar = Notebook(clock=lambda: now[0])
    bar.start("a & b", 1000)
    for _ in range(1000):
        now[0] += 0.01
        bar.advance("a & b")
    bar.finish("a & b")
    bar.advance("stranger")
    (changes,) = display.shown
    assert 40 <= len(changes) <= 60 and re.search("━ *1000 +10", re.sub("<[^>]*>", "", changes[-1]))


def test_scripts_choose(study, capsys, monkeypatch):
    monkeypatch.delitem(sys.modules, "IPython", raising=False)
    study.propagate(study.propagators[0])
    assert capsys.readouterr().err == ""
    study.propagate(study.propagators[0], progress=True)
    assert "monte-carlo: 0 of 20" in capsys.readouterr().err
    assert isinstance(choose_receiver(None), Silent) and isinstance(choose_receiver(False), Silent)
    lines = Lines(sys.stderr)
    assert choose_receiver(lines) is lines


def test_a_terminal_with_ipython_is_no_notebook(monkeypatch):
    monkeypatch.setitem(sys.modules, "IPython", types.SimpleNamespace(get_ipython=lambda: types.SimpleNamespace()))
    assert isinstance(choose_receiver(None), Silent)


def test_results_of_one_time_show_densities_and_others_what_is_over_another_output():
    def tree(times):
        axes = extend.labels([("x", "m"), ("y", "N")], ["k"], times)
        k = np.random.default_rng(0).normal(1, 0.1, (40, 1))
        response = np.stack([k * np.sin(5 * np.array(times)), k * np.cos(5 * np.array(times))], axis=1)
        samples = extend.sample_dataset(response, k, axes)
        statistics = extend.statistics_of_samples(samples)
        node = results.propagator_node("a", statistics, samples=samples, propagator="p", realisations=40, wall_time=0.0)
        return results.study_tree([node], study="s", mechanism="m", attrs={"over": '{"y": "x"}'})

    still = report.show(tree([0.5])).html
    assert still.count('<figure class="charted"') == 2 and "at the only time" in still and "Not drawn" not in still
    moving = report.show(tree(list(np.linspace(0, 1, 21)))).html
    assert moving.count('<figure class="charted"') == 3
    assert '<figure class="charted" data-alt="y over x.">' in moving and 'src=""' not in moving


def test_the_picture_of_a_mechanism_names_what_it_shows_and_says_if_it_is_not_assembled():
    """Bodies and components have their names beside them; Matplotlib is not asked."""
    mechanism = uqmbd.Mechanism("pair <1>", uqmbd.Planar())
    rods = [mechanism.body(f"rod & {k}", mass=1, inertia=1, position=(k + 0.5, 0)) for k in range(2)]
    mechanism.add(Revolute("pivot", mechanism.ground, rods[0], (0, 0), (-0.5, 0)))
    mechanism.add(Revolute("elbow", *rods, (0.5, 0), (-0.5, 0)))
    told = drawn_texts(mechanism)
    assert {"rod & 0", "rod & 1", "pivot", "elbow"} <= set(told) and not any("assembled" in text for text in told)
    mechanism.add(Revolute("far", mechanism.ground, rods[1], (9, 0), (0.5, 0)))
    assert "as defined, because it cannot be assembled" in drawn_texts(mechanism)


def drawn_texts(mechanism):
    (image,) = Page(report.notebook.mechanism_html(mechanism)).images
    source = base64.b64decode(image["src"].removeprefix("data:image/svg+xml;base64,"))
    return [element.text for element in ElementTree.fromstring(source).iter() if element.tag.endswith("text")]
