"""Charts of densities show what their figures draw: curves at other points, histograms as steps."""

import numpy as np
import pytest

from tests.report.live.pages import densities_data, inputs_data, scalars_data
from uqmbd import extend, report, results
from uqmbd.report.charts import unpacked
from uqmbd.report.drawing import histogram
from uqmbd.report.figures.kernel_density import density, ends_of


def sampled(label, response):
    """Return the node of a method with samples (S, T) of one output at times 0, 1, ..."""
    axes = extend.labels([("x", "m")], [], np.arange(response.shape[1], dtype=float))
    data = extend.sample_dataset(response[:, None], np.zeros((len(response), 0)), axes)
    statistics = extend.statistics_of_samples(data)
    return results.propagator_node(label, statistics, data, propagator="p", realisations=len(response), wall_time=0.0)


@pytest.fixture
def nodes():
    """Return two methods: one normal, one uniform, wherefore its density jumps, whose spreads grow."""
    rng = np.random.default_rng(0)
    times = np.array([0.5, 1.0, 2.0])
    return {
        "a": sampled("a", 10 + rng.normal(size=(400, 1)) * times),
        "b": sampled("b", 10 + rng.uniform(-1, 1, size=(400, 1)) * times),
    }


def parts(view):
    """Return the places of a view, and its lines by name."""
    return unpacked(view["time"]), {m["label"]: unpacked(m["lines"][0]["values"]) for m in view["methods"]}


def smooth(values):
    """Return the estimate of a density, which goes down to zero at its ends."""
    x, f = density(values, ends=ends_of(values))
    return np.concatenate([x[:1], x, x[-1:]]), np.concatenate([[0.0], f, [0.0]])


def test_curves_are_estimates_of_the_samples(nodes):
    data = densities_data(nodes, "x", [0.0, 2.0])
    figure = report.histograms(nodes, "x", [0.0, 2.0])
    for view, axes in zip(data["views"], figure.axes, strict=True):
        assert view["title"] == axes.get_title("right")
        places, curves = parts(view)
        assert list(curves) == ["histogram of a", "a", "b"] and np.all(np.diff(places) >= 0)
        np.testing.assert_allclose([view["up"]["low"], view["up"]["high"]], axes.get_ylim())
        np.testing.assert_allclose(places[[0, -1]], axes.get_xlim())
        time = float(view["title"].removeprefix("t = ").removesuffix(" s"))
        for name in "ab":
            response = nodes[name]["samples"]["response"].sel(output="x").sel(time=time, method="nearest")
            x, f = smooth(response.values)
            drawn = np.interp(places, x[1:-1], f[1:-1], left=np.nan, right=np.nan)
            ends = np.isin(places, x[[0, -1]])
            np.testing.assert_allclose(curves[name][~ends], drawn[~ends], rtol=1e-6)
            inside = [end for end in x[[0, -1]] if places[0] <= end <= places[-1]]
            for end in inside:
                # zero, and the value from which the curve falls
                found = curves[name][places == end]
                assert found.min() == 0.0
                np.testing.assert_allclose(found.max(), f[1] if end == x[0] else f[-2], rtol=1e-6)
    assert data["seen"] == 1


def test_areas_are_one(nodes):
    places, curves = parts(densities_data({"b": nodes["b"]}, "x", [2.0])["views"][0])
    for name, values in curves.items():
        assert np.trapezoid(np.nan_to_num(values), places) == pytest.approx(1.0, abs=3e-3), name


def test_histograms_are_steps(nodes):
    view = densities_data(nodes["a"], "x", [1.0])["views"][0]
    edges, heights = histogram(nodes["a"]["samples"]["response"].sel(output="x", time=1.0).values, density=True)
    places, curves = parts(view)
    steps = curves["histogram of a"]
    for k, height in enumerate(heights):
        np.testing.assert_allclose(steps[(places > edges[k]) & (places < edges[k + 1])], height, rtol=1e-6)
        np.testing.assert_allclose(
            steps[places == edges[k]][[0, -1]], [heights[k - 1] if k else 0.0, height], rtol=1e-6
        )
    assert view["methods"][0]["filled"] and np.isnan(steps[places > edges[-1]]).all()
    assert (view["units"], view["across"]["units"], view["across"]["name"]) == ("1/m", "m", "x")


def test_a_value_without_spread_is_a_bar():
    data = densities_data(sampled("a", np.full((50, 1), 3.0)), "x")
    places, curves = parts(data["views"][0])
    assert places[0] < 3 < places[-1] and list(curves) == ["histogram of a"] and np.nanmax(curves["histogram of a"]) > 0


def test_inputs_have_their_density_and_show_where_samples_failed():
    rng = np.random.default_rng(0)
    given = np.stack([rng.normal(size=200), rng.uniform(size=200)], axis=1)
    status = np.where(np.arange(200) < 3, 2, 0)
    axes = extend.labels(["x"], [("k", "N/m"), ("m", "kg")], [0.0])
    samples = extend.sample_dataset(np.zeros((200, 1, 1)), given, axes, status=status)
    data = inputs_data(samples)
    for column, (view, drawn) in enumerate(zip(data["views"], report.inputs(samples).axes, strict=True)):
        places, curves = parts(view)
        x, f = smooth(given[:, column])
        inner = (places > x[0]) & (places < x[-1])
        np.testing.assert_allclose(
            curves["kernel density estimate"][inner], np.interp(places, x[1:-1], f[1:-1])[inner], rtol=1e-6
        )
        failed = view["methods"][-1]
        assert failed["label"] == "inputs of failed samples" and np.isnan(curves[failed["label"]]).all()
        np.testing.assert_allclose([x for x, _ in failed["marks"]], np.sort(given[:3, column]), rtol=1e-6)
        np.testing.assert_allclose([view["up"]["low"], view["up"]["high"]], drawn.get_ylim())
    assert [(v["title"], v["across"]["units"], v["units"]) for v in data["views"]] == [
        ("k", "N/m", "m/N"),
        ("m", "kg", "1/kg"),
    ]


def scalar_method(label, values):
    """Return the node of a method with samples of outputs without a time, by name."""
    axes = extend.labels([(name, "Hz") for name in values], [], None)
    data = extend.sample_dataset(np.stack(list(values.values()), axis=1), np.zeros((200, 0)), axes)
    statistics = extend.statistics_of_samples(data)
    inner = results.propagator_node(label, statistics, data, propagator="p", realisations=200, wall_time=0.0)
    outer = sampled(label, np.ones((200, 2)))
    outer["scalars"] = inner
    return outer


def test_outputs_without_a_time_have_their_densities():
    rng = np.random.default_rng(0)
    given = {"a": {"f1": rng.normal(5, 1, 200), "f2": rng.uniform(size=200)}, "b": {"f1": rng.normal(6, 1, 200)}}
    nodes = {label: scalar_method(label, values) for label, values in given.items()}
    data = scalars_data(nodes, "f2")
    assert data["seen"] == 1 and [view["title"] for view in data["views"]] == ["f1", "f2"]
    for view, names in zip(data["views"], ("ab", "a"), strict=True):
        places, curves = parts(view)
        assert list(curves) == ["histogram of a", *names] and view["across"]["units"] == "Hz"
        for name in names:
            x, f = smooth(given[name][view["title"]])
            inner = (places > x[0]) & (places < x[-1])
            drawn = np.interp(places, x[1:-1], f[1:-1])
            np.testing.assert_allclose(curves[name][inner], drawn[inner], rtol=1e-6)
    assert scalars_data({"a": sampled("a", np.ones((5, 2)))}) is None


def test_a_page_of_outputs_without_a_time_has_their_table_and_chart(tmp_path):
    rng = np.random.default_rng(0)
    node = scalar_method("a", {"f1": rng.normal(5, 1, 200)})
    page = report.write_report(results.study_tree([node], study="s", mechanism="m"), tmp_path / "report.html")
    text = page.read_text(encoding="utf-8")
    section = text[text.index("<h2>Scalar outputs") :]
    assert 'data-name="standard deviation"' in section and "could not be drawn" not in text
    assert 'data-alt="Probability densities of f1."' in section
