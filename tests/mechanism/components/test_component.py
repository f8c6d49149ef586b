"""Components: what may be added, and what a message says of what may not."""

from __future__ import annotations

from typing import ClassVar

import chaospy
import numpy as np
import pytest
import sympy

import uqmbd
from uqmbd.compiled import compile_kernel
from uqmbd.dynamics.equations.block import instances_of
from uqmbd.dynamics.equations.derivation import derive
from uqmbd_drivers import RotationDriver
from uqmbd_joints import Distance, Fixed, Prismatic, Revolute
from uqmbd_springs import PointForce, SpringDamper, Torque, TorsionSpringDamper

LENGTH = uqmbd.RandomVariable("length", chaospy.Uniform(0.9, 1.1), units="m")


class Gadget(uqmbd.Component):
    """A plugin's component that does no checks of its own and computes with what it is given."""

    bodies: ClassVar[tuple[str, ...]] = ("body",)
    point = uqmbd.Parameter("m", "where it is", kind="point")
    rate = uqmbd.Parameter("N/m", "how stiff it is", default=1)
    axis = uqmbd.Parameter("1", "where to", kind="axis", default=(1, 0))
    turn = uqmbd.Parameter("1", "how it is turned", kind="rotation", default=None)
    mode = uqmbd.Parameter("", "what it does", kind="option", default="push", choices=("push", "pull"))

    def prepare(self):
        return {"twice": 2 * self.rate, "moved": [x + 1 for x in self.point]}

    def terms(self, p):
        yield uqmbd.Potential(p.twice * p.body.point(p.point)[0])


NONSENSE = {
    "a text": ("abc", "point is the text 'abc'; expected 2 numbers (where it is, m)"),
    "texts": (("1", "2"), "which contains the text '1'"),
    "None": (None, "point is missing; expected 2 numbers"),
    "complex": ((1j, 0), "which contains 1j, which is not real"),
    "too few": (1, "point has 1 number, expected 2 (where it is, m)"),
    "too many": ((1, 2, 3), "point has 3 numbers, expected 2 (where it is, m); it is (1, 2, 3)"),
    "a matrix": (np.eye(2), "which is nested"),
    "ragged": ((1, (2,)), "point is (1, (2,)), which is nested"),
    "a truth": ((True, 0), "which contains True"),
    "a function": ((len, 0), "not a number or an expression"),
    "a class": ((int, 0), "which contains the class int"),
    "a condition": ((sympy.Symbol("x") > 0, 0), "which is a StrictGreaterThan"),
    "not finite": ((np.nan, 0), "which is not finite"),
    "a set": ({1, 2}, "point has 1 number, expected 2"),
    "a stranger": ((sympy.Symbol("a"), 0), "the symbol a, which is neither a random variable"),
    "another t": ((sympy.Symbol("t"), 0), "time is uqmbd.t"),
}


def refused(make, *words):
    with pytest.raises(uqmbd.StudyError) as caught:
        make()
    for word in words:
        assert word in str(caught.value), f"{word!r} not in {caught.value}"


@pytest.mark.parametrize(("value", "words"), NONSENSE.values(), ids=NONSENSE)
def test_nonsense_in_a_plugins_parameter_is_a_study_error(plane, value, words):
    refused(lambda: plane.add(Gadget("g", plane.bodies["rod"], point=value)), "Gadget 'g'", "point", words)
    assert not plane.components


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({"rate": "hard"}, "rate is the text 'hard'; expected a number (how stiff it is, N/m)"),
        ({"rate": (1, 2)}, "rate has 2 numbers, expected 1"),
        ({"rate": [[1, 2], [3, 4]]}, "which is nested"),
        ({"rate": None}, "rate is missing; expected a number"),
        ({"rate": {}}, "which is not a number or an expression"),
        ({"axis": (0, 0)}, "axis: the vector (0, 0) has length zero"),
        ({"axis": (0, 0, 1)}, "axis has 3 numbers, expected 2"),
        ({"turn": (1, 0, 0, 0)}, "turn has 4 numbers, expected 1 (how it is turned, 1: the angle in rad)"),
        ({"turn": "left"}, "turn is the text 'left'"),
        ({"mode": "hold"}, "mode is the text 'hold'; expected one of 'push', 'pull'"),
        ({"mode": np.zeros(2)}, "expected one of 'push', 'pull'"),
    ],
)
def test_what_is_wrong_with_a_value(plane, given, words):
    refused(lambda: plane.add(Gadget("g", plane.bodies["rod"], point=(0, 0), **given)), "Gadget 'g'", words)


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda rod: Revolute(), "name"),
        (lambda rod: Revolute("A"), "'body_i' is missing; give a body or mechanism.ground"),
        (lambda rod: Revolute("A", rod), "'body_j' is missing"),
        (lambda rod: Revolute("A", rod, rod, pointi=(0, 0)), "the class has no argument 'pointi'; did you mean 'point_i'? Usage: Revolute(name, body_i"),
        (lambda rod: Revolute("A", rod, rod, body_j=rod), "'body_j' is given twice"),
        (lambda rod: Revolute("A", *[rod] * 9), "10 positional arguments are given; expected at most 7"),
        (lambda rod: Revolute(rod, rod), "expected a string as the first argument"),
    ],
)  # fmt: skip
def test_arguments(plane, make, words):
    with pytest.raises((uqmbd.StudyError, TypeError)) as caught:
        make(plane.bodies["rod"])
    assert words in str(caught.value)


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda g, rod: Revolute("A", g, rod), ["'point_i' is missing (joint point, frame of body i, m)", "Usage: "]),
        (lambda g, rod: Revolute("A", g, rod, (0, 0), (0, 0, 0)), ["point_j has 3 numbers, expected 2"]),
        (lambda g, rod: Revolute("A", g, rod, (0, 0), (0, 0), (0, 0, 1)), ["axis_i is given", "omit it"]),
        (lambda g, rod: Revolute("A", g, None, (0, 0), (0, 0)), ["body_j is None; expected a body", "ground, rod"]),
        (lambda g, rod: Revolute("A", g, "rod", (0, 0), (0, 0)), ["body_j is the text 'rod'; expected a body"]),
        (lambda g, rod: Revolute("A", rod, rod, (0, 0), (0, 0)), ["body_i and body_j are the same body 'rod'"]),
        (lambda g, rod: Revolute("A", g, g, (0, 0), (0, 0)), ["body_i and body_j are the ground", "no effect"]),
        (lambda g, rod: PointForce("F", g, (0, 0), (1, 0)), ["body is the ground", "no effect", "bodies of 'machine'"]),
        (lambda g, rod: Torque("T", rod, torque=1, frame="top"), ["frame is the text 'top'", "'world', 'body'"]),
        (lambda g, rod: Torque("T", rod, torque=(0, 0, 1)), ["torque has 3 numbers, expected 1 (the torque, N m)"]),
        (lambda g, rod: Prismatic("P", g, rod, (0, 0), (0, 0), (0, 0), (1, 0)), ["axis_i: the vector", "has length zero"]),
        (lambda g, rod: PointForce("F", rod, (0, 0), (rod.acceleration[0], 0)), ["depends on rod.x''", "may depend on"]),
        (lambda g, rod: Revolute, ["is the class Revolute", "expected an object, e.g. Revolute(name, body_i"]),
        (lambda g, rod: rod, ["the argument of add() is <body 'rod'>", "expected a component"]),
        (lambda g, rod: None, ["the argument of add() is None"]),
    ],
)  # fmt: skip
def test_what_cannot_be_added(plane, make, words):
    refused(lambda: plane.add(make(plane.ground, plane.bodies["rod"])), *words)
    assert not plane.components


@pytest.mark.parametrize("kind", [RotationDriver, TorsionSpringDamper, Torque])
def test_rotations_make_no_sense_for_point_masses(kind):
    mechanism = uqmbd.Mechanism("points", uqmbd.Translational())
    bodies = [mechanism.body("a", mass=1), mechanism.body("b", mass=1)][: len(kind.bodies)]
    refused(lambda: mechanism.add(kind("c", *bodies, 1)), "does not support Translational space", "Spatial, Planar")


def test_relative_rotation_is_none_of_a_point_masses(plane):
    mechanism = uqmbd.Mechanism("points", uqmbd.Translational())
    a, b = mechanism.body("a", mass=1), mechanism.body("b", mass=1)
    refused(lambda: mechanism.add(Fixed("F", a, b, (0, 0), (0, 0), rotation=1)), "rotation is given", "do not rotate")
    mechanism.add(Fixed("F", a, b, (0, 0), (0, 0)))


def test_bodies_and_grounds_of_other_mechanisms(plane):
    other = uqmbd.Mechanism("other", uqmbd.Planar())
    rod, stranger = plane.bodies["rod"], other.body("rod", mass=1, inertia=1)
    refused(lambda: plane.add(Distance("D", plane.ground, stranger, (0, 0), (0, 0), 1)), "of another mechanism")
    refused(lambda: plane.add(Distance("D", other.ground, rod, (0, 0), (0, 0), 1)), "ground of another mechanism")
    force = (1.0 * stranger.velocity[0], 0)
    refused(
        lambda: plane.add(PointForce("F", rod, (0, 0), force)),
        "this body 'rod' belongs to another mechanism than 'machine'",
    )


def test_reactions_are_for_outputs(plane):
    rod = plane.bodies["rod"]
    pivot = plane.add(Revolute("pivot", plane.ground, rod, (0, 0), (0, 0)))
    refused(lambda: plane.add(PointForce("F", rod, (0, 0), pivot.reaction_force)), "depends on pivot.reaction_force[0]")


def test_names_are_shared_by_bodies_and_components(plane):
    rod = plane.bodies["rod"]
    force = plane.add(PointForce("F", rod, (0, 0), (1, 0)))
    refused(lambda: plane.add(force), "has already been added to mechanism 'machine'")
    refused(lambda: plane.add(PointForce("F", rod, (0, 0), (1, 0))), "the PointForce 'F' has the same name")
    refused(lambda: plane.add(PointForce("rod", rod, (0, 0), (1, 0))), "the body 'rod' has the same name")
    refused(lambda: plane.body("F", mass=1, inertia=1), "the PointForce 'F' has the same name")


def test_add_returns_the_component_with_its_values(plane):
    rod = plane.bodies["rod"]
    spring = SpringDamper("S", plane.ground, rod, (0, 0), [1, 0], stiffness=2 * LENGTH)
    assert plane.add(spring) is spring
    assert spring.stiffness == 2 * LENGTH and spring.damping == 0 and tuple(spring.point_j) == (1, 0)
    assert plane.inputs.names == ("length",)


def test_values_in_states_and_time_are_laws(plane):
    rod = plane.bodies["rod"]
    law = (-3 * rod.velocity[0] + sympy.sin(uqmbd.t), 1.0 * LENGTH * rod.angular_velocity)
    assert plane.add(PointForce("F", rod, (0, 0), law)).force == law


def test_choice_may_be_anything_that_compares_oddly(plane):
    """An array compares entry by entry, which must not escape as numpy's error."""
    refused(lambda: plane.add(Torque("T", plane.bodies["rod"], 1, frame=np.zeros(3))), "expected one of")


def test_parameter_reads_as_its_declaration_on_the_class():
    assert Revolute.point_i.units == "m" and Revolute.parameters()["point_i"] is Revolute.point_i


class Guide(uqmbd.Component):
    """A spring and damper to a curved guide, and a point held on another one, written out or with named quantities."""

    bodies = ("body",)
    stiffness = uqmbd.Parameter("N/m", "spring rate")
    named = uqmbd.Parameter("", "whether long expressions have names", kind="option", default=True)

    def terms(self, p):
        """Yield the same terms in either way."""
        x, z = p.body.point((0.1, 0.2))[0], p.body.point((0.1, 0.2))[1]
        gap = sympy.sqrt(z**2 + (x - p.time) ** 2 + 1)
        rate = sum(gap.diff(a) * b for a, b in zip(p.body.q, p.body.v, strict=True)) + gap.diff(p.time)
        if p.named:
            gap = p.let("gap", gap)
            half = p.let("half the gap", gap / 2)
            gap, rate = 2 * half, 2 * p.rate_of(half)
        yield uqmbd.Potential(p.stiffness * gap**3)
        yield uqmbd.VirtualWork(-rate * gap, rate)
        yield uqmbd.Constraint(gap - x - 1)
        state = p.state("memory")
        yield uqmbd.Auxiliary(state, rate - state, gap)


def evaluated(named, kind):
    """Results of one kind at a fixed random state, by target."""
    mechanism = uqmbd.Mechanism("guided", uqmbd.Planar())
    body = mechanism.body("ball", mass=1, inertia=1, position=(1, 1), angle=0.3)
    mechanism.add(Guide("guide", body, 3, named=named))
    block = instances_of(mechanism.all_components(), mechanism.space)[-1].type
    derived = derive(block)
    arguments = [x for *_, x in derived.arguments(kind)] + derived.p
    values = np.random.default_rng(3).uniform(0.2, 0.8, len(arguments))
    equations = derived.equations(kind)
    return dict(
        zip(equations.targets, compile_kernel(arguments, equations.expressions)(values[None, :])[0], strict=True)
    )


@pytest.mark.parametrize("kind", ["residual", "jacobian", "acceleration", "position", "velocity"])
def test_named_quantities_change_nothing(kind):
    """What is derived through named quantities equals what is derived from the expressions written out."""
    plain, named = evaluated(False, kind), evaluated(True, kind)
    for target in plain.keys() | named.keys():
        assert named.get(target, 0) == pytest.approx(plain.get(target, 0), rel=1e-12, abs=1e-12), target


def test_named_quantities_are_written_out_for_other_derivations():
    """`mechanism_terms` knows no names."""
    mechanism = uqmbd.Mechanism("guided", uqmbd.Planar())
    body = mechanism.body("ball", mass=1, inertia=1, position=(1, 1))
    mechanism.add(Guide("guide", body, 3))
    terms = uqmbd.extend.mechanism_terms(mechanism)
    known = {*terms.coordinates, *terms.velocities, *terms.states, uqmbd.t}
    for e in [*terms.potential, *terms.constraints, *terms.rates, *(x for w in terms.work for x in w)]:
        assert e.free_symbols <= known


def test_a_named_quantity_is_not_differentiated_in_ignorance():
    """SymPy would take it for a constant."""

    class Wrong(uqmbd.Component):
        bodies = ("body",)

        def terms(self, p):
            gap = p.let("gap", p.body.position[0] ** 2)
            yield uqmbd.Potential((3 * gap**2).diff(p.body.q[0]))

    mechanism = uqmbd.Mechanism("wrong", uqmbd.Planar())
    mechanism.add(Wrong("wrong", mechanism.body("ball", mass=1, inertia=1)))
    with pytest.raises(uqmbd.StudyError, match=r"'gap' is a quantity of let\(\).*Use rate_of\(\)"):
        instances_of(mechanism.all_components(), mechanism.space)


class Scalar(uqmbd.Component):
    """A plugin's component whose point is declared as a single number by mistake."""

    bodies: ClassVar[tuple[str, ...]] = ("body",)
    where = uqmbd.Parameter("m", "where it is")

    def terms(self, p):
        yield uqmbd.Potential(p.body.point(p.where)[0])


def test_a_single_number_is_no_point(plane):
    made = Scalar("scalar", plane.bodies["rod"], where=2)
    words = "expected 2 numbers", "If it is a parameter of a component, declare it with kind='point'"
    plane.add(made)
    refused(lambda: instances_of([made], plane.space), *words)
    refused(
        lambda: plane.bodies["rod"].point((1, 2, 3)), "expected 2 numbers, one for each axis of the body", "(1, 2, 3)"
    )
    refused(
        lambda: plane.bodies["rod"].direction(1), "expected 2 numbers, one for each axis of the body", "kind='vector'"
    )


ROOT = sympy.sqrt(1 - 2 * LENGTH)


@pytest.mark.parametrize(
    ("pose", "words"),
    [
        ({"angle": -sympy.asin(2 * LENGTH)}, "body 'bar': its given pose is nan at .*: angle = -asin.*; length = 1"),
        ({"position": (0, ROOT)}, r"body 'bar': its given pose is nan at .*: y = sqrt\(1 - 2\*length\); length = 1"),
        ({"velocity": (ROOT, 0)}, "body 'bar': its velocity is nan at .*: velocity = sqrt.*; length = 1"),
    ],
)
def test_what_is_not_finite_at_the_means_is_named(pose, words):
    mechanism = uqmbd.Mechanism("flat", uqmbd.Planar())
    bar = mechanism.body("bar", mass=1, inertia=1, **pose)
    mechanism.output("turned", bar.angle)
    with pytest.raises(uqmbd.StudyError, match=f"mechanism 'flat': {words}"):
        uqmbd.simulate(mechanism, [0, 1])


def test_parameter_of_a_component_that_is_not_finite_at_the_means_is_named():
    mechanism = uqmbd.Mechanism("flat", uqmbd.Planar())
    bar = mechanism.body("bar", mass=1, inertia=1)
    mechanism.add(SpringDamper("spring", mechanism.ground, bar, (0, 1), (0, 0), stiffness=ROOT, free_length=1))
    mechanism.output("x", bar.position[0])
    with pytest.raises(
        uqmbd.StudyError, match="SpringDamper 'spring': its parameter 'stiffness' is nan at .*length = 1"
    ):
        uqmbd.simulate(mechanism, [0, 1])


def test_a_component_without_a_name_says_how_it_is_made():
    with pytest.raises(uqmbd.StudyError, match=r"SpringDamper: the name is missing. Usage: SpringDamper\(name, body_i"):
        SpringDamper()
