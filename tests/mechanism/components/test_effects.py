"""A value that enters nothing is refused: of every component that is installed, with every option, in every space."""

from __future__ import annotations

import itertools

import chaospy
import numpy as np
import pytest
import sympy

import uqmbd
from uqmbd import plugins
from uqmbd.testing import check_component
from uqmbd.testing.components.bench import Bench
from uqmbd.testing.components.cases import ComponentCase
from uqmbd_contact import ContactLaw, PlaneContact, depth, stiffness
from uqmbd_springs import SpringDamper

EVERY = [
    (name, space)
    for name, kind in sorted(plugins.components().items())
    for space in kind.spaces
    if any(not parameter.required for parameter in kind.parameters().values())
]


def ball(space=None):
    mechanism = uqmbd.Mechanism("machine", space or uqmbd.Planar())
    d = mechanism.space.dimension
    return mechanism, mechanism.body("ball", mass=1, inertia={2: 1, 3: (1, 1, 1)}[d], position=(0, 1, 0)[:d])


@pytest.mark.parametrize(
    ("law", "key", "value", "others"),
    [
        ("hertz", "damping", 50, "law='hunt-crossley' or law='kelvin-voigt'"),
        ("linear", "damping", 50, "law='hunt-crossley' or law='kelvin-voigt'"),
        ("linear", "exponent", 2, "law='hunt-crossley'"),
        (ContactLaw(1e5 * depth), "stiffness", 2e4, "law='linear', law='hertz'"),
        (ContactLaw(stiffness * depth), "damping", 1, "law='hunt-crossley'"),
        (ContactLaw(stiffness * depth, friction=0.3), "friction", 0.2, "law='linear'"),
        ("linear", "damping", uqmbd.RandomVariable("c", chaospy.Uniform(40, 60)), "law="),
        ("hertz", "damping", 50 * uqmbd.t, "law="),
    ],
)
def test_a_number_of_another_law_is_refused_and_the_laws_that_have_it_are_named(law, key, value, others):
    mechanism, body = ball()
    with pytest.raises(uqmbd.StudyError) as caught:
        mechanism.add(PlaneContact("floor", mechanism.ground, body, (0, 0), (0, 0), (0, 1), law=law, **{key: value}))
    text = str(caught.value)
    assert text.startswith(f"PlaneContact 'floor': {key} is ") and "it has no effect with law=" in text
    assert others in text and "omit it" in text
    assert not mechanism.components


def test_neutral_values_are_welcome():
    """Zero and the default say nothing; nor is a number without effect only because another one is zero."""
    mechanism, body = ball()
    for number, given in enumerate(
        ({"law": "hertz", "damping": 0}, {"law": "linear", "exponent": 1.5}, {"friction": 0, "slow": 0.01})
    ):
        mechanism.add(PlaneContact(f"floor {number}", mechanism.ground, body, (0, 0), (0, 0), (0, 1), **given))
    ends = (mechanism.ground, body, (0, 0), (0, 0))
    mechanism.add(SpringDamper("damper", *ends, stiffness=0, damping=3, free_length=0.2))
    assert len(mechanism.components) == 4


def test_randomise_passes_over_what_has_no_effect():
    mechanism, body = ball()
    mechanism.add(PlaneContact("floor", mechanism.ground, body, (0, 0), (0, 0), (0, 1), law="linear"))
    with pytest.raises(uqmbd.StudyError, match=r"floor\.exponent has no effect with law='linear'"):
        mechanism.randomise("floor.exponent", relative=0.1)
    found = mechanism.randomise(["floor.stiffness", "floor.exp*"], relative=0.1)
    assert [variable.name for variable in found] == ["floor.stiffness"]


def test_what_prepare_makes_of_a_number_is_an_effect_if_it_is_used():
    class Push(uqmbd.Component):
        """A force whose size `prepare` computes, with one law of two."""

        bodies, spaces = ("body",), (uqmbd.Planar,)
        kind = uqmbd.Parameter("", "kind", kind="option", default="one", choices=("one", "two"))
        half = uqmbd.Parameter("N", "half of the force", default=0)
        second = uqmbd.Parameter("N", "force of the other kind", default=None)

        def prepare(self):
            return {"size": 2 * self.half}

        def terms(self, p):
            yield uqmbd.VirtualWork(p.size if p.kind == "one" else p.second or 5, p.body.velocity[0])

    mechanism, body = ball()
    mechanism.add(Push("fine", body, half=3))
    with pytest.raises(
        uqmbd.StudyError, match="half is 3, but it has no effect with kind='two', so omit it, or choose"
    ):
        mechanism.add(Push("idle", body, half=3, kind="two"))
    with pytest.raises(uqmbd.StudyError, match="second is 4, but it has no effect with kind='one', so omit it, or"):
        mechanism.add(Push("other", body, half=3, second=4))
    mechanism.add(Push("second", body, kind="two", second=4))
    check_component(Push, propagators=(), internal=False, conservative=False)


def test_what_only_a_property_uses_is_welcome():
    class Bolt(uqmbd.Component):
        """A force beside a strength that no term uses, but a property does."""

        bodies, spaces = ("body",), (uqmbd.Planar,)
        force = uqmbd.Parameter("N", "force")
        strength = uqmbd.Parameter("N", "strength", default=1)

        def terms(self, p):
            yield uqmbd.VirtualWork(p.force, p.body.velocity[0])

        @property
        def utilisation(self):
            return self.force / self.strength

    mechanism, body = ball()
    assert mechanism.add(Bolt("bolt", body, force=3, strength=6)).utilisation == sympy.Rational(1, 2)


def number(parameter, space, rng, random):
    """Return a value of a parameter's kind within its range; of a random variable of its name, or of constants."""
    size = 1 if parameter.kind == "scalar" else parameter.size(space)
    if parameter.kind == "rotation":
        size = {1: 0, 2: 1, 3: 4}[space.dimension]
    low = parameter.minimum if np.isfinite(parameter.minimum) else 0.2
    high = parameter.maximum if np.isfinite(parameter.maximum) else low + 1
    entries = []
    for k in range(size):
        value = sympy.Float(rng.uniform(low + 0.3 * (high - low), low + 0.7 * (high - low)))
        if random and k == 0:
            value = value * uqmbd.RandomVariable(parameter.name, chaospy.Uniform(0.95, 1.05))
        entries.append(value)
    return None if not entries else entries[0] if parameter.kind == "scalar" else tuple(entries)


def tried(kind, space, options, optional, rng):
    """Add a component with values of the given optional parameters, which are random; return the case."""
    mechanism = uqmbd.Mechanism("trial", space())
    bodies = []
    for role in kind.bodies:
        pose = {"position": list(rng.uniform(-1, 1, space().dimension))}
        if space().turns:
            pose |= {"inertia": 1.0 if space().dimension == 2 else (2.0, 1.5, 1.0)}
        bodies.append(mechanism.body(role, mass=1.0, com=list(rng.uniform(-0.5, 0.5, space().dimension)), **pose))
    values = dict(options)
    for key, parameter in kind.parameters().items():
        if key in values or not parameter.fits(mechanism.space):
            continue
        if parameter.example is not None and parameter.required:
            values[key] = parameter.example
        elif parameter.required and parameter.kind == "option":
            values[key] = parameter.words[0]
        elif parameter.required or key in optional:
            value = number(parameter, mechanism.space, rng, random=key in optional)
            if value is not None:
                values[key] = value
    made = kind("trial", **dict(zip(kind.bodies, bodies, strict=True)), **values)
    return ComponentCase("trial", mechanism, mechanism.add(made), True)


def changes_something(case, names, rng):
    """Return the names of random variables on which any equation depends, in any of many random states."""
    bench = Bench.of("trial", case, rng)
    found = set()
    for _ in range(200):  # few states are contacts
        if found >= set(names):
            break
        state = bench.state(rng)

        def all_of(inputs, state=state):
            kinds = ("residual", "position", "initial", "contact")
            return np.concatenate([bench.evaluate(k, state, bench.parameters(inputs)) for k in kinds], axis=1)

        before = all_of(bench.inputs)
        for column, name in enumerate(case.mechanism.inputs.names):
            moved = bench.inputs.copy()
            moved[:, column] *= 1.01
            if not np.allclose(all_of(moved), before, rtol=1e-9, atol=0, equal_nan=True):
                found.add(name)
    return found & set(names)


def marked(name, space):
    marks = {("SpringDamper", "Line"): (), ("PlaneContact", "Line"): pytest.mark.thorough}
    mark = marks.get((name, space.__name__), pytest.mark.slow)
    return pytest.param(name, space, id=f"{name}-{space.__name__}", marks=mark)


@pytest.mark.parametrize(("name", "space"), [marked(name, space) for name, space in EVERY])
def test_what_is_refused_changes_no_equation_and_what_is_accepted_changes_one(name, space, monkeypatch):
    """The oracle evaluates the equations: a value without effect leaves residual, positions and events as they are."""
    kind, rng = plugins.component(name), np.random.default_rng(0)
    declared = {k: p for k, p in kind.parameters().items() if p.fits(space())}
    numeric = [k for k, p in declared.items() if not p.required and p.kind not in ("option", "numbers", "rotation")]
    choices = {k: p.words for k, p in declared.items() if p.words}
    for words in itertools.product(*choices.values()):
        options = dict(zip(choices, words, strict=True))
        refused = []
        for key in numeric:
            try:
                tried(kind, space, options, {key}, rng)
            except uqmbd.StudyError as error:
                assert f"{key} is " in str(error) and "no effect" in str(error), str(error)
                refused.append(key)
        accepted = set(numeric) - set(refused)
        if accepted:
            case = tried(kind, space, options, accepted, rng)
            assert changes_something(case, accepted, rng) == accepted & set(case.mechanism.inputs.names)
        if refused:
            with monkeypatch.context() as patched:
                patched.setattr("uqmbd.mechanism.new_component.require_effects", lambda *arguments: None)
                case = tried(kind, space, options, set(numeric), rng)
            assert not changes_something(case, refused, rng)
