"""Every component type that is installed, in every space it supports: whoever adds one has it tested here."""

from __future__ import annotations

import numpy as np
import pytest

import uqmbd
from uqmbd import plugins
from uqmbd.testing import check_component
from uqmbd.testing.components.methods import check_studies

SEPARATE = ("FlexibleModes",)
"""Components whose rows of numbers depend on each other, so that the check needs them: tests of their packages."""

EVERY = [
    (name, space)
    for name, component in sorted(plugins.components().items())
    for space in component.spaces
    if name not in SEPARATE
]


# One force with a potential, one joint, one with an auxiliary state: with every method that is installed.
REPRESENTATIVES = [("SpringDamper", "Spatial"), ("Revolute", "Planar"), ("TorsionSpringDamper", "Planar")]


QUICK = [*REPRESENTATIVES, ("Distance", "Translational"), ("RotationDriver", "Planar"), ("PlaneImpact", "Planar")]


def marked(name, space):
    """By default some of each kind; each component in its first space takes longer, and in all others longer still."""
    first = plugins.components()[name].spaces[0] is space
    marks = () if (name, space.__name__) in QUICK else pytest.mark.thorough if first else pytest.mark.slow
    return pytest.param(name, space, id=f"{name}-{space.__name__}", marks=marks)


# Contacts share their laws, each of which is tried with a sphere on a plane.
CONTACTS = ("ClearanceJoint", "RoadContact", "SphereContact")


@pytest.mark.parametrize(("name", "space"), [marked(name, space) for name, space in EVERY])
def test_component(name, space):
    given = {"law": "hunt-crossley"} if name in CONTACTS else {}
    check_component(plugins.component(name), spaces=(space,), given=given, propagators=())


@pytest.mark.slow
@pytest.mark.parametrize("name", CONTACTS)
def test_every_contact_with_every_law(name):
    check_component(plugins.component(name), propagators=())


def studied(name, space):
    check_studies(plugins.component(name), space, {}, np.random.default_rng(5))


@pytest.mark.thorough
@pytest.mark.parametrize(("name", "space"), REPRESENTATIVES)
def test_component_with_every_propagator(name, space):
    studied(name, getattr(uqmbd, space))


@pytest.mark.slow
@pytest.mark.parametrize(("name", "space"), EVERY, ids=[f"{name}-{space.__name__}" for name, space in EVERY])
def test_every_component_with_every_propagator(name, space):
    studied(name, space)
