"""The conformance kit finds what it is there to find."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
import pytest
import sympy
import xarray as xr

import uqmbd
from uqmbd.testing import check_component
from uqmbd.testing.components.methods import check_studies
from uqmbd_collocation import Collocation
from uqmbd_montecarlo import MonteCarlo


class Base(uqmbd.Component):
    """Something between two points, to be spoilt."""

    spaces = (uqmbd.Planar,)
    point_i = uqmbd.Parameter("m", "end, frame of body i", kind="point")
    point_j = uqmbd.Parameter("m", "end, frame of body j", kind="point")

    def offset(self, p):
        return p.body_j.point(p.point_j) - p.body_i.point(p.point_i)


class Sound(Base):
    """A spring of stiffness one."""

    def terms(self, p):
        yield uqmbd.Potential(self.offset(p).dot(self.offset(p)) / 2)


class OneSided(Base):
    """A force on body j without a reaction."""

    def terms(self, p):
        yield uqmbd.VirtualWork(-self.offset(p), p.body_j.point_velocity(p.point_j))


class Elsewhere(Base):
    """A force whose reaction acts at another point: the moments do not cancel."""

    def terms(self, p):
        velocity = p.body_j.point_velocity(p.point_j) - p.body_i.point_velocity((3, 4))
        yield uqmbd.VirtualWork(-self.offset(p), velocity)


class Compass(Base):
    """A force that knows where north is: action equals reaction, but not in every direction of the whole."""

    def terms(self, p):
        offset = self.offset(p)
        yield uqmbd.VirtualWork(
            -offset * p.body_j.rotation[0, 0], offset.jacobian(list(p.body_j.q)) * sympy.zeros(4, 1)
        )
        yield uqmbd.VirtualWork(-offset * p.body_i.velocity[0], self.rate(p))

    def rate(self, p):
        return p.body_j.point_velocity(p.point_j) - p.body_i.point_velocity(p.point_i)


class Anchored(Base):
    """A constraint between two bodies that holds one of them to the world."""

    def terms(self, p):
        yield uqmbd.Constraint(p.body_j.point(p.point_j)[0] + p.body_i.point(p.point_i)[0], "place")


class Impossible(Base):
    """A distance whose square is negative."""

    def terms(self, p):
        yield uqmbd.Constraint(self.offset(p).dot(self.offset(p)) + 1, "length")


class Idle(Base):
    """A spring with a parameter that it never uses."""

    rate = uqmbd.Parameter("N/m", "spring rate")
    terms = Sound.terms


class IdleExample(Base):
    """A spring with a parameter that it never uses, and for which one value is tried."""

    rate = uqmbd.Parameter("N/m", "spring rate", default=1, example=2)
    terms = Sound.terms


class Endless(Base):
    """A force that is infinite."""

    def terms(self, p):
        yield uqmbd.VirtualWork(1 / sympy.Max(0, -self.offset(p).dot(self.offset(p))), self.offset(p)[0])


class Unitless(Base):
    """A spring whose rate has no units."""

    rate = uqmbd.Parameter("", "spring rate")
    terms = Sound.terms


class Undescribed(Base):
    """A spring whose rate nobody explains."""

    rate = uqmbd.Parameter("N/m")
    terms = Sound.terms


class Optional(Base):
    """A force that follows a law."""

    law = uqmbd.Parameter("N", "force over length", kind="option")

    def terms(self, p):
        d = self.offset(p)
        yield uqmbd.Potential(d.dot(d) / (1 if p.law == "soft" else 2))


class Ratchet(Base):
    """A spring whose length counts ways in either direction alike."""

    def rate(self, p):
        velocity = p.body_j.point_velocity(p.point_j) - p.body_i.point_velocity(p.point_i)
        return (velocity.T * self.offset(p))[0]

    def start(self, p):
        return self.offset(p).dot(self.offset(p)) / 2

    def terms(self, p):
        way = p.state("way")
        yield uqmbd.Auxiliary(way, self.rate(p) + self.rate(p) ** 2, self.start(p))
        yield uqmbd.Potential(10 * way**2)


class Escapement(Ratchet):
    """A constraint on such a length."""

    def terms(self, p):
        way = p.state("way")
        yield uqmbd.Auxiliary(way, self.rate(p) + self.rate(p) ** 2, self.start(p))
        yield uqmbd.Constraint(way - 1, "way")


class Clockwork(Ratchet):
    """A spring that is wound up by a clock, which may do work."""

    def terms(self, p):
        wound = p.state("wound")
        yield uqmbd.Auxiliary(wound, self.rate(p) + 1, self.start(p))
        yield uqmbd.Potential(wound**2 / 2)


class Exemplary(Base):
    """A force that follows a law, with an example of one."""

    bodies: ClassVar[tuple[str, ...]] = ("body_i", "body_j")
    law = uqmbd.Parameter("N", "force over length", kind="option", example=lambda x: 3 * x)

    def terms(self, p):
        yield uqmbd.Potential(p.law(self.offset(p).dot(self.offset(p))))


FAULTS = {
    OneSided: "its forces and torques on the bodies do not cancel",
    Elsewhere: "its forces and torques on the bodies do not cancel",
    Compass: "its forces change by .* when the whole mechanism is translated and rotated",
    Anchored: "its reactions do not cancel: a rigid motion of all bodies changes a constraint",
    Impossible: "the check found no state that satisfies its constraints",
    IdleExample: "no term contains the declared parameter 'rate'",
    Idle: "no term contains the declared parameter 'rate'",
    Unitless: "Unitless.rate has no units",
    Undescribed: "Undescribed.rate has no description",
    Ratchet: "energy is not conserved: a potential contributes a power of",
    Escapement: "energy is not conserved: constraint 0 contributes a power of",
    Optional: "parameter 'law' is an option without declared choices",
}


@pytest.mark.thorough
@pytest.mark.parametrize(("component", "words"), FAULTS.items(), ids=[c.__name__ for c in FAULTS])
def test_faults_are_found(component, words):
    with pytest.raises(AssertionError, match=words):
        check_component(component)


@pytest.mark.thorough
@pytest.mark.parametrize("component", [Sound, Exemplary, Clockwork])
def test_sound_components_pass(component):
    check_component(component)


def test_values_may_be_given():
    check_component(Optional, given={"law": "whatever"}, propagators=())


@pytest.mark.thorough
def test_values_for_what_there_is_not_are_reported():
    with pytest.raises(AssertionError, match="the argument 'given' contains 'lw'; expected parameters of Optional"):
        check_component(Optional, given={"lw": "whatever"}, propagators=())


@pytest.mark.thorough
def test_what_is_no_mistake_says_so():
    check_component(Ratchet, conservative=False, propagators=["collocation", MonteCarlo(samples=10)])


def studied(component, *propagators):
    check_studies(component, uqmbd.Planar, {}, np.random.default_rng(1), propagators)


def test_energy_along_a_motion():
    with pytest.raises(AssertionError, match=r"energy is not conserved: it changes by .* J of .* J in 0.1 s"):
        studied(Ratchet, "collocation")


@dataclass(frozen=True, kw_only=True)
class Biased(Collocation):
    """A method with another mean than others."""

    def propagate(self, problem):
        node = super().propagate(problem)
        statistics = node["statistics"].to_dataset()
        return node.assign(statistics=xr.DataTree(statistics.assign(mean=statistics["mean"] + statistics["std"])))


@dataclass(frozen=True, kw_only=True)
class Helpless(Collocation):
    """A method that cannot do this."""

    def propagate(self, problem):
        raise KeyError("point_i")


@pytest.mark.thorough
def test_methods_that_disagree():
    with pytest.raises(
        AssertionError,
        match="Sound in Planar space, in a study with Biased.*: the mean of .* at .* is .*; the reference method Coll.* gives",
    ):
        studied(Sound, "collocation", Biased(order=1, verify=2, label="biased"))


def test_method_that_fails():
    with pytest.raises(AssertionError, match="Sound in Planar space, in a study with Helpless.*: it raised KeyError"):
        studied(Sound, Helpless())


@pytest.mark.thorough
def test_component_without_a_possible_motion():
    with pytest.raises(
        AssertionError,
        match="the check found no random pose, out of 20, that can be assembled and that moves: .*length",
    ):
        studied(Impossible, "collocation")


def test_components_that_act_on_the_world_say_so():
    check_component(OneSided, internal=False, propagators=())


def test_class_without_docstring():
    bare = type("Bare", (uqmbd.Component,), {"terms": Sound.terms})
    with pytest.raises(AssertionError, match="Bare has no docstring"):
        check_component(bare)


class Needle(Base):
    """A needle that tells its angle against north as if it were that between the bodies."""

    spaces = (uqmbd.Planar,)

    def motion(self):
        x, y = self.attached["body_j"].direction((1, 0))
        return {"angle": uqmbd.extend.JointAngle(x, y)}

    def terms(self, p):
        yield uqmbd.Potential(self.offset(p).dot(self.offset(p)))


class Tachometer(Needle):
    """The angle between the bodies, with a rate that is that of one of them."""

    def motion(self):
        body = self.attached["body_j"]
        cosine, sine = uqmbd.extend.relative_quaternion(self.attached["body_i"].quaternion, body.quaternion)
        rate = 2 * (body.q[2] * body.v[3] - body.q[3] * body.v[2])
        return {"angle": uqmbd.extend.JointAngle(cosine, sine, half=True, signed=True, rate=rate)}


class Talker(Needle):
    """What its motion says is no coordinate of its bodies."""

    def motion(self):
        return {"displacement": uqmbd.extend.JointDisplacement(uqmbd.t)}


class Sundial(Needle):
    """The angle between the bodies, as it should be told."""

    def motion(self):
        return {"angle": self.joint_angle()}


@pytest.mark.parametrize(
    ("component", "words"),
    [
        (Needle, "its angle changes by"),
        (Tachometer, "the declared rate of its angle is"),
        (Talker, "displacement 'displacement' contains t; expected coordinates of the bodies"),
    ],
)
def test_motion_that_is_reported_wrongly_is_found(component, words):
    with pytest.raises((AssertionError, uqmbd.StudyError), match=words):
        check_component(component, propagators=())


def test_motion_that_is_reported_well_passes():
    check_component(Sundial, propagators=())


def magnet(units="N m^2", law=None, **parameter):
    """Two poles that attract each other, with a mistake."""

    class Magnet(Base):
        """Attract two points."""

        strength = uqmbd.Parameter(units, "force times the square of a distance", minimum=0, **parameter)

        def terms(self, p):
            d = p.let("distance", sympy.sqrt(self.offset(p).dot(self.offset(p))))
            yield uqmbd.VirtualWork(-p.strength * (law(d) if law else 1 / (d + 0.1) ** 2), p.rate_of(d))

    return Magnet


def test_units_of_a_parameter_that_fit_its_terms_pass():
    check_component(magnet(), propagators=())
    check_component(magnet("N/m^1.5", lambda d: d ** sympy.Rational(3, 2)), propagators=())


MISTAKES = {
    "another dimension": (magnet("N/m"), r"Magnet in Planar space, .*: force times velocity of a VirtualWork: .* declared units are W.* strength in N/m"),
    "no units": (magnet("Newton square"), "Magnet.strength: units is 'Newton square', which is not a known unit"),
    "a root of a negative number": (magnet("N", lambda d: sympy.sqrt(0.01 - d / (d + 0.1))), "a term is not finite .* outside its domain"),
}  # fmt: skip


@pytest.mark.parametrize(("component", "words"), MISTAKES.values(), ids=MISTAKES)
def test_a_mistake_in_units_or_ranges_is_reported_as_such(component, words):
    with pytest.raises(AssertionError, match=words):
        check_component(component, propagators=())
