"""Surrogates whose model is an object of a plugin."""

from __future__ import annotations

import chaospy
import numpy as np
import pytest
import xarray as xr
from hypothesis import given, settings
from hypothesis import strategies as st

import uqmbd
from uqmbd.extend import CustomSurrogate, GermSpace, labels
from uqmbd.report import write_report
from uqmbd.report.live.polynomials import polynomial_of
from uqmbd.results import ComposedChaos, PolynomialChaos, load, propagator_node, save, study_tree, surrogate, validate
from uqmbd.results.chaos import absent_surrogate, surrogate_parts
from uqmbd.results.requirements.surrogates import sampled_requirements


class Formula:
    """Outputs ``(a + c b^2) (1, t)`` of inputs a and b, and ``a b t``."""

    name = "formula"

    def __init__(self, factor, times):
        self.factor, self.times = factor, times

    def evaluate(self, inputs):
        a, b = inputs.T[:, :, None]
        return np.stack([(a + self.factor * b**2) * (1 + self.times), a * b * self.times], axis=1)

    def gradient(self, inputs):
        a, b = inputs.T[:, :, None]
        one, t = np.ones_like(self.times), self.times
        by_a = np.stack([(1 + t) * np.ones_like(a), b * t], axis=1)
        by_b = np.stack([2 * self.factor * b * (1 + t), a * t], axis=1)
        return np.stack([by_a * one, by_b * one], axis=1)

    def arrays(self):
        return {"factor": np.array(self.factor), "times": self.times}

    @classmethod
    def from_arrays(cls, arrays):
        return cls(float(arrays["factor"]), arrays["times"])


class Silent(Formula):
    gradient = None
    name = "silent"


TIMES = np.array([0.0, 0.5, 2.0])
AXES = labels([("x", "m"), ("y", "N")], [("a", "m"), ("b", "kg")], TIMES)


def space():
    inputs = [
        uqmbd.RandomVariable("a", chaospy.Normal(1, 0.2), units="m"),
        uqmbd.RandomVariable("b", chaospy.Uniform(1, 3), units="kg"),
    ]
    mechanism = uqmbd.Mechanism("inputs", uqmbd.Line())
    for one in inputs:
        mechanism.output(one.name, one)
    return GermSpace.of(mechanism.inputs)


SPACE = space()


@settings(max_examples=15)
@given(
    factor=st.floats(-3, 3),
    outputs=st.lists(st.integers(0, 1), min_size=1, max_size=2, unique=True).map(sorted),
    times=st.lists(st.integers(0, 2), min_size=1, max_size=3, unique=True).map(sorted),
)
def test_a_part_of_a_stored_surrogate_is_that_of_the_model(factor, outputs, times):
    """Of any outputs and times, stored and read again, to the bit; and so are its gradients."""
    model = Formula(factor, TIMES)
    chaos = CustomSurrogate(model, SPACE, AXES)
    points = np.array([[0.8, 1.5], [1.3, 2.9]])
    part = CustomSurrogate.from_dataset(chaos.selected(outputs, times).to_dataset())
    expected = model.evaluate(points)[:, outputs][:, :, times]
    np.testing.assert_array_equal(part.evaluate(points), expected)
    np.testing.assert_array_equal(part.gradient(points), model.gradient(points)[:, :, outputs][..., times])
    again = CustomSurrogate.from_dataset(part.selected([0], [len(times) - 1]).to_dataset())
    np.testing.assert_array_equal(again.evaluate(points), expected[:, :1, -1:])


def test_moments_and_indices_are_those_of_the_closed_form():
    """x = a + b^2 / 2 of independent inputs: their variances add up."""
    chaos = CustomSurrogate(Formula(0.5, TIMES), SPACE, AXES)
    moments = [chaospy.Uniform(1, 3).mom(k) for k in (2, 4)]
    of_a, of_b = 0.04, 0.25 * (moments[1] - moments[0] ** 2)
    scale = 1 + TIMES
    np.testing.assert_allclose(chaos.mean[0], (1 + moments[0] / 2) * scale, rtol=1e-4)
    np.testing.assert_allclose(chaos.std[0], np.sqrt(of_a + of_b) * scale, rtol=1e-3)
    shares = np.array([of_a, of_b]) / (of_a + of_b)
    np.testing.assert_allclose(chaos.sobol_first[:, 0], shares[:, None] * np.ones(3), atol=5e-3)
    statistics = chaos.statistics(samples=512)
    assert {"quantile", "sobol_total", "skewness"} <= set(statistics)


def test_an_error_is_that_at_the_verification_realisations():
    germs = np.random.default_rng(1).normal(size=(8, 2)) * [1.0, 0.2]
    response = Formula(0.5, TIMES).evaluate(SPACE.to_inputs(germs)) + 0.1
    chaos = CustomSurrogate(Formula(0.5, TIMES), SPACE, AXES, germs, response)
    np.testing.assert_allclose(chaos.verification_rms(), 0.1)
    np.testing.assert_allclose(chaos.verification_error()[0], 0.1 / chaos.std[0])
    assert all("order" not in words for words in chaos.verdicts())


def test_probabilities_without_verification_are_not_known():
    """A million samples of a model give a wrong probability as precisely as a right one."""
    from uqmbd.extend import Requirement

    chaos = CustomSurrogate(Formula(0.5, TIMES), SPACE, AXES)
    both = [Requirement(name, name, "x > 0", over_time=True) for name in ("x", "y")]
    end = chaos.selected(times=[2])
    found = sampled_requirements(both, np.array([False, False]), lambda k: end, chaos)
    assert found["interval"].values.tolist() == [[0, 1]] * 3


def test_a_surrogate_in_a_node_is_stored(tmp_path):
    chaos = CustomSurrogate(Formula(0.5, TIMES), SPACE, AXES)
    about = {"propagator": "p", "realisations": 3, "wall_time": 0.0}
    node = propagator_node("p", chaos.statistics(samples=64), children=chaos.to_datasets(), **about)
    validate(node)
    again = load(save(node, tmp_path / "node.nc"))
    points = np.array([[0.8, 1.5]])
    for output, row in (("x", 0), ("y", 1)):
        found = surrogate(again, output, times=[1]).evaluate(points)
        np.testing.assert_array_equal(found[:, 0, 0], chaos.evaluate(points)[:, row, 1])


def test_a_composed_surrogate_may_have_a_part_that_is_a_model():
    times = np.array([0.0, 1.0])
    model = CustomSurrogate(Formula(0.5, times), space(), labels(["x", "y"], ["a", "b"], times))
    flat = np.zeros((1, 1, 2))
    part = PolynomialChaos(flat, [[0, 0]], space(), labels(["z"], ["a", "b"], times))
    whole = ComposedChaos({"model": model, "flat": part}, ("x", "y", "z"))
    node = propagator_node(
        "mine", whole.statistics(), propagator="p", realisations=8, wall_time=0.0, children=whole.to_datasets()
    )
    tree = study_tree([node], study="s", mechanism="m")
    validate(tree)
    inputs = [[0.8, 1.5]]
    assert np.array_equal(surrogate(tree["mine"]).evaluate(inputs), whole.evaluate(inputs))


class Mistaken(Formula):
    """Returns what its test asks for."""

    name = "mistaken"
    returned = None

    def evaluate(self, inputs):
        return self.returned(super().evaluate(inputs))


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda x: x[:, :, 0], "expected real numbers"),
        (lambda x: x[:, :1], "expected real numbers"),
        (lambda x: x + 1j, "expected real numbers"),
        (lambda x: x[:-1], "expected real numbers"),
        (lambda x: np.where(x > 0, np.nan, x), "not finite"),
    ],
)
def test_what_a_model_returns_is_checked(change, words):
    model = Mistaken(0.5, TIMES)
    model.returned = change
    with pytest.raises(uqmbd.StudyError, match=f"'mistaken'.*{words}"):
        CustomSurrogate(model, SPACE, AXES).evaluate([[1.0, 2.0], [1.1, 2.0]])


def test_a_model_without_a_gradient_says_so():
    chaos = CustomSurrogate(Silent(0.5, TIMES), SPACE, AXES)
    with pytest.raises(uqmbd.StudyError, match="no gradient"):
        chaos.gradient([[1.0, 2.0]])
    with pytest.raises(uqmbd.StudyError, match="7"):
        chaos.evaluate([[1.0, 7.0]])


def test_a_model_of_no_installed_plugin_is_named():
    data = CustomSurrogate(Formula(0.5, TIMES), SPACE, AXES).to_dataset().assign_attrs(model="elsewhere")
    with pytest.raises(uqmbd.StudyError, match="'elsewhere'.*uqmbd_surrogates"):
        CustomSurrogate.from_dataset(data)


def test_arrays_that_are_no_numbers_are_refused():
    model = Formula(0.5, TIMES)
    model.arrays = lambda: {"x": np.array([{}])}
    with pytest.raises(uqmbd.StudyError, match="real numbers by names"):
        CustomSurrogate(model, SPACE, AXES).to_dataset()


def test_a_page_evaluates_polynomials_in_place_of_a_model():
    """Those of a polynomial are exact; those of a step are too far from it."""
    chaos = CustomSurrogate(Formula(0.5, TIMES), SPACE, AXES)
    germs = np.random.default_rng(2).normal(size=(20, 2)) * [1.0, 0.3]
    made, about = polynomial_of(chaos)
    np.testing.assert_allclose(made.evaluate_germs(germs), chaos.evaluate_germs(germs), atol=1e-9)
    assert (about["model"], about["order"]) == ("formula", 2) and about["difference"] < 1e-9
    step = Mistaken(0.5, TIMES)
    step.returned = lambda x: np.sign(x - 3.0)
    with pytest.raises(uqmbd.StudyError, match="page evaluates polynomials"):
        polynomial_of(CustomSurrogate(step, SPACE, AXES))


def test_the_page_says_that_sliders_use_polynomials(tmp_path):
    """The report names the model, the order and the largest difference; a method with polynomials needs no words."""
    chaos = CustomSurrogate(Formula(0.5, TIMES), SPACE, AXES)
    about = {"propagator": "p", "realisations": 3, "wall_time": 0.0}
    node = propagator_node("p", chaos.statistics(samples=64), children=chaos.to_datasets(), **about)
    page = write_report(study_tree([node], study="s", mechanism="m"), tmp_path / "r.html", sections=[]).read_text()
    assert "evaluates polynomials that are fitted to the stored surrogate" in page
    assert "A page cannot evaluate the model &#39;formula&#39;. The sliders evaluate polynomials of order 2" in page
    plain = polynomial_of(chaos)[0]
    node = propagator_node("p", chaos.statistics(samples=64), children=plain.to_datasets(), **about)
    page = write_report(study_tree([node], study="s", mechanism="m"), tmp_path / "r.html", sections=[]).read_text()
    assert "The page evaluates the stored surrogate" in page and "cannot evaluate the model" not in page


def test_a_chart_of_distributions_samples_a_model():
    """Densities of a model are drawn at the stored times, like those of any surrogate."""
    from uqmbd.report.figures.distributions import of_surrogate

    chaos = CustomSurrogate(Formula(0.5, TIMES), SPACE, AXES)
    about = {"propagator": "p", "realisations": 3, "wall_time": 0.0}
    node = propagator_node("p", chaos.statistics(samples=64), children=chaos.to_datasets(), **about)
    drawn = of_surrogate(node, "x", np.array([0.4, 2.0]))
    assert drawn["time"].values.tolist() == [0.5, 2.0]
    np.testing.assert_allclose(drawn.mean("sample"), chaos.mean[0, 1:], rtol=2e-2)
    np.testing.assert_allclose(drawn.std("sample"), chaos.std[0, 1:], rtol=5e-2)


class Arrays:
    """A model that consists of any arrays: outputs are a, and the time."""

    name = "arrays"

    def __init__(self, held):
        self.held = held

    def evaluate(self, inputs):
        return inputs[:, :1, None] + np.array([[0.0], [1.0]]) * TIMES

    def arrays(self):
        return self.held

    @classmethod
    def from_arrays(cls, arrays):
        return cls(dict(arrays))


names = st.one_of(
    st.sampled_from(["w", "w_0", "w_0_0", "w_1", "x", "output", "time", "input", "Ω", "verification", "term"]),
    st.from_regex(r"[a-z_][a-z0-9_]{0,3}", fullmatch=True),
)
held = st.dictionaries(names, st.tuples(st.sampled_from("fiu?"), st.lists(st.integers(0, 3), max_size=3)), max_size=6)


@pytest.mark.thorough
@settings(max_examples=30, deadline=None)
@given(asked=held)
def test_arrays_of_any_names_and_shapes_are_stored(asked, tmp_path_factory):
    """To the bit: an array may have the name of an axis of another one."""
    draw = np.random.default_rng(len(asked))
    kinds = {"f": np.float64, "i": np.int32, "u": np.uint8, "?": np.bool_}
    model = Arrays({name: draw.integers(0, 2, size).astype(kinds[kind]) for name, (kind, size) in asked.items()})
    chaos = CustomSurrogate(model, SPACE, AXES)
    node = propagator_node("mine", chaos.statistics(samples=64), propagator="p", realisations=1, wall_time=0.0,
                           children=chaos.to_datasets())  # fmt: skip
    path = tmp_path_factory.mktemp("arrays") / "results.nc"
    save(node, path)
    for found in (CustomSurrogate.from_dataset(chaos.selected(times=[1]).to_dataset()), surrogate(load(path))):
        assert found.model.held.keys() == model.held.keys()
        for name, value in model.held.items():
            again = found.model.held[name]
            assert again.shape == value.shape
            np.testing.assert_array_equal(again, value)


def multiple(factor, name):
    class Multiple(Arrays):
        def evaluate(self, inputs):
            return factor * inputs[:, :1, None] + 0 * np.array([[0.0], [1.0]]) * TIMES

    Multiple.name = name
    return Multiple


def test_a_selection_has_the_model_of_the_whole_whatever_has_its_name_by_now():
    first = CustomSurrogate(multiple(1.0, "same name")({}), SPACE, AXES)
    CustomSurrogate(multiple(1.0, "same name")({}), SPACE, AXES)  # the same code again, as by a second import
    with pytest.warns(uqmbd.StudyWarning, match="replaces another class with the name 'same name'"):
        second = CustomSurrogate(multiple(10.0, "same name")({}), SPACE, AXES)
    for chaos, factor in ((first, 1.0), (second, 10.0), (first, 1.0)):
        part = chaos.selected([1], [2]).selected([0], [0])
        assert part.model is chaos.model
        assert part.evaluate([[0.9, 2.0]]).ravel() == pytest.approx([0.9 * factor])
    assert CustomSurrogate.from_dataset(first.to_dataset()).evaluate([[0.9, 2.0]]).max() == pytest.approx(9.0)


def test_the_name_of_a_class_of_a_plugin_is_taken(monkeypatch):
    monkeypatch.setattr("uqmbd.results.storage.models.surrogates", lambda: {"taken": multiple(1.0, "taken")})
    with pytest.raises(uqmbd.StudyError, match="the name of Arrays is 'taken', which .* registers for another class"):
        CustomSurrogate(type("Arrays", (Arrays,), {"name": "taken"})({}), SPACE, AXES)


def test_without_terms_and_verification_messages_name_the_arguments():
    chaos = CustomSurrogate(Formula(0.5, TIMES), SPACE, AXES)
    for call in (chaos.verdicts, chaos.verification_error, chaos.verification_std, chaos.horizon):
        with pytest.raises(uqmbd.StudyError, match="pass verification_germs and verification_response"):
            call()
    for name in ("top_energy", "top_energy_germ"):
        with pytest.raises(uqmbd.StudyError, match="has no polynomial terms"):
            getattr(chaos, name)
    germs = np.random.default_rng(1).normal(size=(2, 2)) * [1.0, 0.2]
    response = Formula(0.5, TIMES).evaluate(SPACE.to_inputs(germs)) + np.array([0.1, 5.0])[:, None, None]
    words = CustomSurrogate(Formula(0.5, TIMES), SPACE, AXES, germs, response).verdicts()
    assert all("verify" not in one and "pass more verification_germs" in one for one in words), words


def test_an_absent_model_of_a_part_is_reported():
    """Also where outputs have surrogates of different kinds."""
    chaos = CustomSurrogate(multiple(1.0, "absent")({}), SPACE, AXES)
    data = chaos.to_dataset().assign_attrs(model="not installed")
    children = {"composed": xr.DataTree(children={"part": xr.DataTree(children={"surrogate": xr.DataTree(data)})})}
    node = xr.DataTree(name="mine", children=children)
    assert "not installed" in absent_surrogate(node)
    assert surrogate_parts(node) == {}
    with pytest.raises(uqmbd.StudyError, match="no installed plugin registers"):
        surrogate(node)
