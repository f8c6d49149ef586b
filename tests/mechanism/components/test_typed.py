"""Components that tell their arguments: to `inspect`, to `help`, and, if they are typed, to checkers of types."""

from __future__ import annotations

import inspect
from typing import ClassVar

import pytest

import uqmbd
from uqmbd import plugins
from uqmbd.typing import Quantity, Vector
from uqmbd_joints import Fixed, Gear, Revolute
from uqmbd_springs import SpringDamper

COMPONENTS = [pytest.param(plugins.component(name), id=name) for name in sorted(plugins.components())]


@pytest.mark.parametrize("component", COMPONENTS)
def test_the_signature_tells_what_is_declared(component):
    found = inspect.signature(component).parameters
    for key, parameter in component.parameters().items():
        assert found[key].annotation is parameter
        assert (found[key].default is inspect.Parameter.empty) == (parameter.required and found[key].default != ())
    assert set(component.bodies) <= set(found)


@pytest.mark.parametrize("component", COMPONENTS)
def test_help_tells_units_meaning_and_default_of_every_argument(component):
    text = inspect.getdoc(component)
    section = text.partition("Parameters\n----------\n")[2]
    for key, parameter in component.parameters().items():
        line, _, description = section.partition(f"{key} : ")[2].partition("\n")
        assert f"[{parameter.units}]" in line or not parameter.units
        assert parameter.required or f"default {parameter.default!r}" in line
        words = " ".join(description.split())
        assert words.lower().startswith(" ".join(parameter.description.lower().split()))
    assert text.count("Examples\n--------\n") <= 1


def test_the_signature_has_what_may_be_given_in_the_world():
    assert [*inspect.signature(Fixed).parameters] == [
        "name",
        "body_i",
        "body_j",
        "point_i",
        "point_j",
        "rotation",
        "at",
    ]
    assert {"at", "axis"} <= {*inspect.signature(Revolute).parameters}
    assert not {"at", "axis"} & {*inspect.signature(SpringDamper).parameters}
    carrier = inspect.signature(Gear).parameters["carrier"]
    assert carrier.kind is inspect.Parameter.KEYWORD_ONLY and carrier.default is None


def test_a_section_of_the_author_stays():
    class Weight(uqmbd.Component):
        """A weight.

        Parameters
        ----------
        load : number
            As I say it.
        """

        load = uqmbd.Parameter("N", "a load")

    assert inspect.getdoc(Weight).count("Parameters\n") == 1 and "As I say it." in inspect.getdoc(Weight)
    assert inspect.getdoc(type("Bare", (Weight,), {"__doc__": None})) == inspect.getdoc(Weight)


class Belt(uqmbd.extend.TypedComponent):
    """A belt pulls two pulleys together."""

    bodies = ("driver", "driven")
    driver: uqmbd.extend.NamedFrame
    driven: uqmbd.extend.NamedFrame
    point: uqmbd.Parameter[Vector] = uqmbd.Parameter("m", "a point of the driver", kind="point")
    tension: uqmbd.Parameter[Quantity] = uqmbd.Parameter("N", "tension", default=5)
    label: ClassVar[str] = "flat"

    def terms(self, p):
        offset = p.driven.position - p.driver.point(p.point)
        yield uqmbd.Potential(p.tension * offset.dot(offset) / 2)


def test_a_typed_component_is_one_like_any_other():
    mechanism = uqmbd.Mechanism("belt", uqmbd.Planar())
    wheel = mechanism.body("wheel", mass=1, inertia=1)
    belt = mechanism.add(Belt("belt", mechanism.ground, wheel, (1, 0)))
    assert belt.driver is mechanism.ground and belt.driven is wheel and belt.tension == 5
    assert Belt.signature() == "(name, driver, driven, point, tension=5)"
    with pytest.raises(
        uqmbd.StudyError, match="Belt 'belt': tension cannot be changed after the creation of the component"
    ):
        belt.tension = 6
    mechanism.output("x", wheel.position[0])
    uqmbd.simulate(mechanism, [0, 0.1])


def refused(**namespace):
    annotations = namespace.pop("annotations", {})
    namespace = {
        "bodies": ("body",),
        "__annotations__": {"body": "uqmbd.extend.NamedFrame", **annotations},
        **namespace,
    }
    with pytest.raises(uqmbd.StudyError) as error:
        type("Wrong", (uqmbd.extend.TypedComponent,), namespace)
    return str(error.value)


def test_what_checkers_of_types_would_not_see_is_refused():
    length = uqmbd.Parameter("m", "length")
    with_default = uqmbd.Parameter("m", "length", default=1)
    kind = "uqmbd.Parameter[Quantity]"
    assert "'length' has no type annotation" in refused(length=length)
    assert "'rope' has no type annotation" in refused(bodies=("body", "rope"))
    assert "see the arguments (name, body, mass); expected (name, body)" in refused(annotations={"mass": "float"})
    assert "see the arguments (name, length, body)" in refused(
        __annotations__={"length": kind, "body": "uqmbd.extend.NamedFrame"}, length=length
    )
    assert "'length' has no default, but follows 'radius'" in refused(
        annotations={"radius": kind, "length": kind}, radius=with_default, length=length
    )
    assert "cannot have an optional body as a field" in refused(grounded=("body",))


def test_a_turning_axis_is_optional_to_checkers_and_needed_in_space():
    class Vane(uqmbd.extend.TypedComponent):
        """A vane."""

        body_i: uqmbd.extend.NamedFrame
        body_j: uqmbd.extend.NamedFrame
        gain: uqmbd.Parameter[Quantity] = uqmbd.Parameter("N m/rad", "gain", default=1)
        axis_i: uqmbd.Parameter[Vector] = uqmbd.Parameter("1", "axis", kind="turning_axis", default=())

        def terms(self, p):
            yield uqmbd.VirtualWork(p.gain, p.body_j.angular_velocity[0])

    for space, given in ((uqmbd.Planar, {}), (uqmbd.Planar, {"axis_i": ()}), (uqmbd.Spatial, {"axis_i": (1, 0, 0)})):
        mechanism = uqmbd.Mechanism("turning", space())
        wheel = mechanism.body("wheel", mass=1, inertia=1 if space is uqmbd.Planar else (1, 1, 1))
        mechanism.add(Vane("vane", mechanism.ground, wheel, **given))
    with pytest.raises(uqmbd.StudyError, match="Vane 'other': 'axis_i' is missing"):
        mechanism.add(Vane("other", mechanism.ground, wheel))


BASES = {"plain": uqmbd.Component, "typed": uqmbd.extend.TypedComponent}
ANNOTATIONS = {
    "object": uqmbd.extend.NamedFrame,
    "name": "NamedFrame",
    "dotted": "uqmbd.extend.NamedFrame",
    "quoted": "'NamedFrame'",
}


@pytest.mark.parametrize("base", BASES.values(), ids=BASES)
@pytest.mark.parametrize("kind", ANNOTATIONS.values(), ids=ANNOTATIONS)
def test_an_annotated_body_without_bodies_names_the_remedy(base, kind):
    """The message states the line to write; with that line the class is made."""
    cases = [
        ({"body": kind}, None, "bodies = ('body',)"),
        ({"wheel": kind, "road": kind}, None, "bodies = ('wheel', 'road')"),
        ({"body_i": kind, "body": kind}, None, "bodies = ('body_i', 'body')"),
        ({"hub": kind, "rim": kind}, ("hub",), "bodies = ('hub', 'rim')"),
    ]
    for kinds, bodies, written in cases:
        stated = {} if bodies is None else {"bodies": bodies}
        body = {"__annotations__": kinds, "__doc__": "A part.", "__module__": __name__}
        with pytest.raises(uqmbd.StudyError) as caught:
            type(base)("Part", (base,), {**body, **stated})
        assert written in str(caught.value)
        made = type(base)("Part", (base,), {**body, "bodies": eval(written.partition(" = ")[2])})
        assert made.signature() == f"(name, {', '.join(kinds)})"


def test_an_annotated_body_extends_inherited_bodies():
    class One(uqmbd.Component):
        bodies = ("hub",)

    with pytest.raises(uqmbd.StudyError, match=r"Write bodies = \('hub', 'rim'\)"):

        class Two(One):
            rim: uqmbd.extend.NamedFrame
