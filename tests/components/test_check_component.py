"""The conformance kit finds what it is there to find."""

from __future__ import annotations

from typing import ClassVar

import pytest
import sympy

import uqmbd
from uqmbd.testing import check_component


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
    terms = Sound.terms


class Exemplary(Base):
    """A force that follows a law, with an example of one."""

    bodies: ClassVar[tuple[str, ...]] = ("body_i", "body_j")
    law = uqmbd.Parameter("N", "force over length", kind="option", example=lambda x: 3 * x)

    def terms(self, p):
        yield uqmbd.Potential(p.law(self.offset(p).dot(self.offset(p))))


FAULTS = {
    OneSided: "what it exerts on its bodies does not cancel",
    Elsewhere: "what it exerts on its bodies does not cancel",
    Compass: "its forces change by .* when everything is moved and turned as a whole",
    Anchored: "its reactions do not cancel; a constraint changes if all bodies move as one",
    Impossible: "no state was found at which its constraints hold",
    Idle: "parameter 'rate' .*nothing|parameter 'rate' has no effect",
    Unitless: "Unitless.rate has no units",
    Undescribed: "Undescribed.rate has no description",
    Optional: "parameter 'law' is an option without choices",
}


@pytest.mark.parametrize(("component", "words"), FAULTS.items(), ids=[c.__name__ for c in FAULTS])
def test_faults_are_found(component, words):
    with pytest.raises(AssertionError, match=words):
        check_component(component)


@pytest.mark.parametrize("component", [Sound, Exemplary])
def test_sound_components_pass(component):
    check_component(component)


def test_values_may_be_given():
    check_component(Optional, given={"law": "whatever"})


def test_components_that_act_on_the_world_say_so():
    check_component(OneSided, internal=False)


def test_class_without_docstring():
    bare = type("Bare", (uqmbd.Component,), {"terms": Sound.terms})
    with pytest.raises(AssertionError, match="Bare has no docstring"):
        check_component(bare)
