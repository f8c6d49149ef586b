"""Conformance kit: tests that plugin authors run for their classes.

Every check raises `AssertionError` with a text that states the error, so any test can call a check::

    from uqmbd.testing import check_component

    def test_my_joint():
        check_component(MyJoint)
"""

from __future__ import annotations

from uqmbd.testing.command import check_command
from uqmbd.testing.components import check_component
from uqmbd.testing.design import check_design
from uqmbd.testing.excitation import check_excitation
from uqmbd.testing.exporter import check_exporter
from uqmbd.testing.integrators import check_integrator
from uqmbd.testing.propagators import check_propagator
from uqmbd.testing.section import check_section

__all__ = [
    "check_command",
    "check_component",
    "check_design",
    "check_excitation",
    "check_exporter",
    "check_integrator",
    "check_propagator",
    "check_section",
]
