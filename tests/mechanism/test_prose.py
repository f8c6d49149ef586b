"""Descriptions and labels are for people: whatever they say, the program does the same."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

import uqmbd
from uqmbd import plugins
from uqmbd.dynamics import build
from uqmbd.mechanism.skeleton import collect_skeleton
from uqmbd.report.mechanisms.body_poses import drawn_pose
from uqmbd.testing.components.cases import component_cases


def every():
    """Every component in the plane, where it has one; some in space as well, where all others are slow."""
    for name in sorted(plugins.components()):
        spaces = plugins.component(name).spaces
        quick = uqmbd.Planar if uqmbd.Planar in spaces else spaces[0]
        for space in dict.fromkeys((quick, spaces[-1])):
            marks = () if space is quick or name in ("Revolute", "PlaneContact") else pytest.mark.slow
            yield pytest.param(name, space, id=f"{name}-{space.__name__}", marks=marks)


def reworded(component):
    """The same component, with other words for everything that has some."""

    def terms(self, p):
        for term in component.terms(self, p):
            worded = isinstance(term, (uqmbd.Constraint, uqmbd.Upright))
            yield dataclasses.replace(term, label=f"unit quaternion {len(term.label)}") if worded else term

    words = {
        key: dataclasses.replace(parameter, description="body axes, frame of body i")
        for key, parameter in component.parameters().items()
    }
    return type(component.__name__, (component,), {"terms": terms, **words})


def known(component, space):
    """What is derived, assembled and drawn of a component, without words."""
    case = next(component_cases(component, space, {}, np.random.default_rng(3)))
    mechanism = case.mechanism
    marks = [(m.kind, m.body, m.component, m.role, str(m.local), str(m.radius)) for m in collect_skeleton(mechanism)]
    pose = drawn_pose(mechanism).to_dataset()
    model = build(mechanism)
    symbols = pose["component_symbol"].values.tolist() if "component_symbol" in pose else []
    layout = model.layout
    return marks, symbols, pose["pose"].values, layout.kept, layout.active, model.norms


@pytest.mark.thorough
@pytest.mark.parametrize(("name", "space"), list(every()))
def test_other_words_change_nothing(name, space):
    component = plugins.component(name)
    first, second = known(component, space), known(reworded(component), space)
    assert first[:2] == second[:2]
    for one, other in zip(first[2:], second[2:], strict=True):
        np.testing.assert_array_equal(one, other)


def test_a_parameter_says_in_which_frame_it_is():
    class Hook(uqmbd.Component):
        bodies = ("body_i", "body_j")
        eye = uqmbd.Parameter("m", "a point", kind="point", body="body_j")
        pull = uqmbd.Parameter("N", "a force", kind="vector", axes="body")
        push = uqmbd.Parameter("N", "a force", kind="vector")

        def terms(self, p):
            yield uqmbd.VirtualWork(p.pull, p.body_j.point_velocity(p.eye))

    mechanism = uqmbd.Mechanism("hooked", uqmbd.Planar())
    one, two = (mechanism.body(name, mass=1, inertia=1) for name in ("one", "two"))
    mechanism.add(Hook("hook", one, two, (1, 2), (3, 4), (5, 6)))
    found = {m.role: m.body for m in collect_skeleton(mechanism) if m.component == "hook"}
    assert found == {"eye": "two", "pull": "one", "push": "ground"}


def test_names_of_parameters_change_nothing():
    """Where a parameter says to which body and point it belongs, it may have any name."""

    class Wheel(uqmbd.Component):
        bodies = ("body_i", "body_j")
        point_i = uqmbd.Parameter("m", "the hub", kind="point", body="body_j")
        axis_i = uqmbd.Parameter("1", "the shaft", kind="axis", body="body_j")
        radius_j = uqmbd.Parameter("m", "of nothing that is drawn")
        size = uqmbd.Parameter("m", "of the wheel", about="point_i")

        def terms(self, p):
            yield uqmbd.Potential(p.body_j.point(p.point_i)[0] ** 2)

    mechanism = uqmbd.Mechanism("rolling", uqmbd.Spatial())
    inertia = (1, 1, 1)
    one = mechanism.body("one", mass=1, inertia=inertia)
    two = mechanism.body("two", mass=1, inertia=inertia, position=(1, 0, 0), quaternion=(0, 0, 0, 1))
    mechanism.add(Wheel("wheel", one, two, (1, 2, 3), radius_j=5, size=7, axis=(1, 0, 0)))
    found = {m.role: (m.body, m.radius) for m in collect_skeleton(mechanism) if m.component == "wheel"}
    assert found == {"point_i": ("two", 7), "axis_i": ("two", 0)}
    assert [float(x) for x in mechanism.components["wheel"].values["axis_i"]] == [-1, 0, 0]


def test_where_no_radius_says_its_point_the_endings_do():
    class Balls(uqmbd.Component):
        point_i = uqmbd.Parameter("m", "a centre", kind="point")
        point_j = uqmbd.Parameter("m", "a centre", kind="point")
        radius_i = uqmbd.Parameter("m", "of the first ball")
        radius = uqmbd.Parameter("m", "of the last ball")

        def terms(self, p):
            yield uqmbd.Potential(p.body_j.point(p.point_j)[0] ** 2)

    mechanism = uqmbd.Mechanism("rolling", uqmbd.Spatial())
    one, two = (mechanism.body(name, mass=1, inertia=(1, 1, 1)) for name in ("one", "two"))
    mechanism.add(Balls("balls", one, two, (1, 2, 3), (0, 0, 1), radius_i=5, radius=7))
    found = {m.role: (m.body, m.radius) for m in collect_skeleton(mechanism) if m.component == "balls"}
    assert found == {"point_i": ("one", 5), "point_j": ("two", 7)}


@pytest.mark.parametrize("stated", [{"body": "body_k"}, {"about": "nowhere"}])
def test_a_parameter_belongs_to_what_there_is(stated):
    word, value = next(iter(stated.items()))
    with pytest.raises(
        uqmbd.StudyError, match=f"Stray: parameter 'reach': {word} is '{value}'; expected 'body_i', 'bo"
    ):

        class Stray(uqmbd.Component):
            body_i = uqmbd.Parameter("m", "a point", kind="point")
            body_j = uqmbd.Parameter("m", "a point", kind="point")
            reach = uqmbd.Parameter("m", "a length", **stated)


def test_axes_belong_to_vectors_only():
    with pytest.raises(uqmbd.StudyError, match="axes='body' applies only to vectors and moments"):
        uqmbd.Parameter("m", "a point", kind="point", axes="body")


def test_a_symbol_that_does_not_exist_is_refused():
    with pytest.raises(uqmbd.StudyError, match=r"Bolt: symbol is 'bolt'; expected one of 'ball', .*'weld'"):

        class Bolt(uqmbd.Component):
            symbol = "bolt"
