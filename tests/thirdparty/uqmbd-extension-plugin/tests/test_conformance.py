"""The whole test suite of this package: what it offers does what uqmbd expects of it."""

from __future__ import annotations

import chaospy

import uqmbd
from uqmbd.testing import check_command, check_component, check_design
from uqmbd_contact import PlaneContact
from uqmbd_extension import Kronecker, lankarani
from uqmbd_extension_commands import Bodies


def test_bodies():
    check_command(Bodies, "uqmbd_extension_commands")


def test_kronecker():
    check_design(Kronecker)


def test_lankarani():
    restitution = uqmbd.RandomVariable("restitution", chaospy.Uniform(0.8, 0.9), units="1")
    # numbers of the contact that the law does not use are left out
    given = {"law": lankarani(restitution, 2.0), "exponent": None, "damping": None}
    check_component(PlaneContact, spaces=(uqmbd.Translational,), given=given, propagators=())
