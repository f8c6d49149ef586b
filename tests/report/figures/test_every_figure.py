"""Every figure function: public, from results to a Matplotlib figure of its own; and every figure as a file."""

from __future__ import annotations

import io
import itertools
import re
import warnings
import xml.etree.ElementTree as ET
from collections.abc import Callable
from pathlib import Path

import chaospy
import numpy as np
import pytest
import xarray as xr
from matplotlib.figure import Figure

import uqmbd
from uqmbd import extend, report, results
from uqmbd_collocation import Collocation
from uqmbd_contact import PlaneImpact
from uqmbd_montecarlo import MonteCarlo

G = 9.81


def ball() -> uqmbd.Study:
    """A ball on a plane, from a height between 0.9 m and 1.1 m; its first impact is known in closed form."""
    mechanism = uqmbd.Mechanism("ball", uqmbd.Translational(gravity=(0, -G)))
    height = uqmbd.RandomVariable("h0", chaospy.Uniform(0.9, 1.1), units="m")
    body = mechanism.body("ball", mass=1, position=(0, height), velocity=(0, 0))
    floor = mechanism.add(PlaneImpact("floor", mechanism.ground, body, (0, 0), (0, 0), (0, 1), restitution=0.8))
    mechanism.output("height", body.position[1], units="m")
    mechanism.output("level", body.position[1] - 1, units="m", over="height")
    mechanism.output("first", floor.event_time("impact", 1), units="s")
    mechanism.require("early", uqmbd.t * height <= 1.1)
    methods = [
        MonteCarlo(samples=60, seed=1),
        Collocation(order=3, alignment="events", label="event-aligned"),
        Collocation(order=1, label="plain-1"),
        Collocation(order=2, label="plain-2"),
        Collocation(order=1, elements=2, label="split"),
    ]
    growth = {"propagators": Collocation(verify=0), "order": [1, 2], "reference": "event-aligned"}
    return uqmbd.Study("ball", mechanism, np.linspace(0, 1.15, 24), methods, convergence=growth)


@pytest.fixture(scope="module")
def study() -> uqmbd.Study:
    """Return the study."""
    return ball()


@pytest.fixture(scope="module")
def tree(study: uqmbd.Study) -> xr.DataTree:
    """Return its results, with what the animation is made of."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", uqmbd.SurrogateWarning)  # plain expansions of a ball that bounces are coarse
        found = study.run()
    found["motion"] = xr.DataTree(report.motion(study, samples=3, frames=8))
    return found


def failing(tree: xr.DataTree) -> xr.DataTree:
    """Plant failures among the samples."""
    node = tree["monte-carlo"].copy(deep=True)
    node["samples"]["status"].values[:5] = 2
    return node


CALLS: dict[str, Callable[[xr.DataTree, uqmbd.Study], Figure]] = {
    "bands": lambda tree, study: report.bands(tree, "height"),
    "coefficient_decay": lambda tree, study: report.coefficient_decay(tree["plain-2"], "height"),
    "convergence": lambda tree, study: report.convergence(tree["monte-carlo"], "height"),
    "differences": lambda tree, study: report.differences(tree, "height"),
    "error_cost": lambda tree, study: report.error_cost(tree["convergence"].to_dataset(), "height"),
    "event_times": lambda tree, study: report.event_times(tree),
    "failure_inputs": lambda tree, study: report.failure_inputs(failing(tree)),
    "histograms": lambda tree, study: report.histograms(tree, "height", [0.3, 1.0]),
    "inputs": lambda tree, study: report.inputs(tree["monte-carlo"]),
    "mechanism": lambda tree, study: report.mechanism(study.mechanism),
    "order_convergence": lambda tree, study: report.order_convergence(
        {label: tree[label] for label in ("plain-1", "plain-2")}, "height"
    ),
    "over_output": lambda tree, study: report.over_output(tree, "level", "height"),
    "poses": lambda tree, study: report.poses(tree["motion"].to_dataset()),
    "scalar_densities": lambda tree, study: report.scalar_densities(tree),
    "sobol_indices": lambda tree, study: report.sobol_indices(tree, "height"),
    "split_pattern": lambda tree, study: report.split_pattern(tree),
    "std_over_time": lambda tree, study: report.std_over_time(tree, "height"),
    "time_history_histogram": lambda tree, study: report.time_history_histogram(tree["monte-carlo"], "height"),
    "violated_by": lambda tree, study: report.violated_by(tree),
    "verification": lambda tree, study: report.verification(tree),
}


def test_none_is_forgotten() -> None:
    """All that is public is drawn here, and is public in uqmbd.report, too."""
    help_to_draw = {
        "Band",
        "Curve",
        "arrange",
        "axes_grid",
        "Chart",
        "ChartGroup",
        "FirstScreen",
        "ReliabilityStatement",
        "chart_figure",
        "chart_html",
        "charts_html",
        "figure_html",
        "series_style",
        "with_units",
        "wrapped",
    }
    no_figures = {"Section", "animate", "installed_sections", "motion", "with_motion", "with_poses", "write_report"}
    notebooks = {"Shown", "load_ipython_extension", "show", "unload_ipython_extension"}
    drawn = set(report.__all__) - no_figures - help_to_draw - notebooks
    assert drawn == set(CALLS)
    assert set(CALLS) <= set(report.__all__)


@pytest.mark.parametrize("name", sorted(CALLS))
def test_it_draws(name: str, tree: xr.DataTree, study: uqmbd.Study) -> None:
    """A figure with axes and something in them, outside pyplot."""
    import matplotlib.pyplot as plt

    before = plt.get_fignums()
    figure = CALLS[name](tree, study)
    assert isinstance(figure, Figure) and figure.axes
    file = io.StringIO()
    figure.savefig(file, format="svg")
    drawn = file.getvalue()
    assert drawn.count("<path") + drawn.count("<image") > 6 and drawn.count("<text") + drawn.count("text_") > 4
    assert plt.get_fignums() == before


@pytest.mark.parametrize("name", sorted(CALLS))
def test_no_text_runs_into_another(name: str, tree: xr.DataTree, study: uqmbd.Study) -> None:
    """Labels, ticks and titles of axes keep clear of each other, as they are written to a page."""
    assert not clashing_texts(CALLS[name](tree, study))


@pytest.mark.thorough
@pytest.mark.parametrize("size, spread", [(1e-7, 1e-8), (0.1, 0.1), (3e4, 800.0), (1e5, 0.01), (2e9, 3e7)])
def test_no_text_runs_into_another_at_any_size(size: float, spread: float) -> None:
    """Labels of the y axis keep clear of wide ticks, and titles of panels of powers of ten."""
    times = np.linspace(0, 2, 21)
    rng = np.random.default_rng(0)
    axes = extend.labels([("force in the pin", "N")], [("stiffness", "N/m")], times)
    nodes = []
    for label in ("mine", "yours"):
        inputs = size + spread * rng.normal(size=(60, 1))
        samples = extend.sample_dataset((inputs + spread * np.sin(times))[:, None], inputs, axes)
        about = extend.statistics_of_samples(samples)
        held = {"samples": samples}
        nodes.append(results.propagator_node(label, about, propagator="p", realisations=60, wall_time=1, children=held))
    tree = results.study_tree(nodes, study="s", mechanism="m")
    name = "force in the pin"
    for figure in (
        *(draw(tree, name) for draw in (report.bands, report.std_over_time, report.histograms, report.differences)),
        *(draw(tree["mine"], name) for draw in (report.convergence, report.time_history_histogram)),
        report.inputs(tree["mine"]),
    ):
        assert not clashing_texts(figure)


def clashing_texts(figure: Figure) -> list[tuple[str, str]]:
    """Return which texts of a figure overlap, once it is written; none of them is cut at the edge."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.text import Text

    from uqmbd.report.drawing.ticks import freeze_ticks

    freeze_ticks(figure)
    canvas = FigureCanvasAgg(figure)
    canvas.draw()
    renderer = canvas.get_renderer()
    texts = [t for a in figure.axes for t in a.get_children() if isinstance(t, Text) and t.get_text().strip()]
    texts += [t for legend in figure.legends for t in legend.get_texts()]
    boxes = [(t.get_text(), t.get_window_extent(renderer).padded(-1)) for t in texts]
    assert all(figure.bbox.padded(1).contains(box.x0, box.y0) for _, box in boxes)
    return [(one, other) for (one, a), (other, b) in itertools.combinations(boxes, 2) if a.overlaps(b)]


def test_event_times_are_those_of_the_closed_form(tree: xr.DataTree) -> None:
    """The first impact of a ball from a uniform height: its mean is known, and so are its ends."""
    from uqmbd.report.figures.timeless import earliest_events

    first, *others = earliest_events(tree["event-aligned"])
    low, high = (np.sqrt(2 * h / G) for h in (0.9, 1.1))
    mean = np.sqrt(2 / G) * (1.1**1.5 - 0.9**1.5) / (1.5 * 0.2)
    assert first.number == 1 and first.share == 1.0
    assert first.times.mean() == pytest.approx(mean, rel=1e-3)
    assert low - 1e-5 < first.times.min() < first.times.max() < high + 1e-5
    # the second comes after 1 + 2 e times as long: for some realisations after the end of the study
    reached = (1.15 / 2.6) ** 2 * G / 2
    assert [event.number for event in others] == [2]
    end = float(tree["event-aligned/statistics"]["time"][-1])
    assert others[0].times.max() <= end
    assert others[0].times.mean() < end
    assert others[0].share == pytest.approx(float(np.clip((reached - 0.9) / 0.2, 0, 1)), abs=0.03)


@pytest.mark.thorough
def test_an_aligned_surrogate_is_used_as_any_other(tree: xr.DataTree, study: uqmbd.Study) -> None:
    """Densities from samples of it, the reader of any surrogate, and an animation by its method."""
    figure = report.histograms(tree["event-aligned"], "height", [0.3])
    drawn = figure.axes[0].lines[0].get_xdata()
    assert drawn.min() < 0.9 - G * 0.3**2 / 2 + 0.01 and drawn.max() > 1.1 - G * 0.3**2 / 2 - 0.01
    surrogate = uqmbd.results.surrogate(tree["event-aligned"], "height")
    after = np.sqrt(2 * 1.0 / G)
    expected = 0.8 * G * after * (0.7 - after) - G * (0.7 - after) ** 2 / 2
    column = int(np.abs(study.times - 0.7).argmin())
    assert study.times[column] == pytest.approx(0.7)
    assert float(surrogate.evaluate([[1.0]])[0, 0, column]) == pytest.approx(expected, abs=1e-4)
    film = report.motion(study, samples=3, frames=5, method="event-aligned")
    assert film.sizes["realisation"] == 4 and np.isfinite(film["pose"].values).all()


@pytest.mark.thorough
def test_every_figure_is_a_file(tree: xr.DataTree, tmp_path: Path) -> None:
    """As many files as images, each a picture that can be read, with names of their own."""
    page = report.write_report(tree, tmp_path / "report.html", folder=tmp_path / "figures").read_text(encoding="utf-8")
    files = sorted((tmp_path / "figures").iterdir())
    # two charts of differences are one figure; the film of the motion and histograms over time are files only
    alone = [file for file in files if file.suffix == ".gif" or file.stem.endswith("time-history-histogram")]
    charts = page.count("data-alt=") - page.count('data-alt="Difference of the standard deviation')
    drawn = bool(re.search(r"<figure[^>]*player", page))  # the mechanism stands in the page itself
    assert drawn and len(files) - len(alone) == page.count("<img ") + charts + drawn and charts > 5
    assert not re.search("could not be (drawn|made)", page)
    for file in files:
        assert file.read_bytes()[:6] in (b"GIF89a", b"<?xml ")
        if file.suffix == ".svg":
            assert ET.parse(file).getroot().tag.endswith("svg")
    names = {file.name for file in files}
    assert {"height-bands.svg", "event-aligned-event-times.svg", "motion.gif", "split-elements.svg"} <= names
    assert "Event times" in page and "no. 1" in page


def test_a_figure_that_cannot_be_drawn_is_reported_and_costs_no_other(tmp_path: Path) -> None:
    """A warning has its name, the folder and the reason; so has one of a film."""
    from uqmbd.report.drawing import write_images

    def fails() -> Figure:
        raise ValueError("no room")

    content = [
        {"rows": [{"name": "first", "draw": fails}]},
        {"name": "second", "draw": Figure},
        {"name": "third", "draw": Figure, "moving": fails},
    ]
    with pytest.warns(UserWarning) as told:
        files = write_images(content, tmp_path)
    assert sorted(file.name for file in files) == ["second.svg", "third.svg"]
    said = [str(one.message) for one in told]
    assert len(said) == 2 and all(str(tmp_path) in one and one.endswith("ValueError: no room") for one in said)
    assert "'first'" in said[0] and "'third'" in said[1]


def test_what_does_not_vary_is_written_without_a_warning(tmp_path: Path) -> None:
    """Outputs without spread have charts that are notes, and figures with axes about the only value."""
    mechanism = uqmbd.Mechanism("free", uqmbd.Line())
    mass = uqmbd.RandomVariable("mass", chaospy.Uniform(1, 2), units="kg")
    body = mechanism.body("body", mass=mass, velocity=1.0)
    mechanism.output("x", body.position[0], units="m")
    methods = [MonteCarlo(samples=30, seed=1), Collocation(order=1)]
    with pytest.warns(uqmbd.UnusedInputWarning):
        tree = uqmbd.Study("free", mechanism, np.linspace(0, 1, 5), methods).run()
    report.write_report(tree, tmp_path / "report.html", folder=tmp_path / "figures")
    assert {"x-bands.svg", "collocation-stated-error.svg"} <= {file.name for file in (tmp_path / "figures").iterdir()}
