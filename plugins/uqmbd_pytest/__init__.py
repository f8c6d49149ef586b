"""Fixtures of pytest for the tests of plugins: the checks of `uqmbd.testing`, which need no import.

pytest loads this module in every run where uqmbd is installed, also in those that have nothing to do with it.  So it is
a package of its own, which imports nothing of uqmbd before a fixture is used, and has no options and no hooks.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest

if TYPE_CHECKING:
    from collections.abc import Callable

__all__ = [
    "uqmbd_command",
    "uqmbd_component",
    "uqmbd_design",
    "uqmbd_integrator",
    "uqmbd_propagator",
    "uqmbd_section",
]


@pytest.fixture(scope="session")
def uqmbd_component() -> Callable[..., None]:
    """Check a component: `uqmbd.testing.check_component`."""
    from uqmbd.testing import check_component

    return check_component


@pytest.fixture(scope="session")
def uqmbd_propagator() -> Callable[..., None]:
    """Check a propagator: `uqmbd.testing.check_propagator`."""
    from uqmbd.testing import check_propagator

    return check_propagator


@pytest.fixture(scope="session")
def uqmbd_integrator() -> Callable[..., None]:
    """Check an integrator: `uqmbd.testing.check_integrator`."""
    from uqmbd.testing import check_integrator

    return check_integrator


@pytest.fixture(scope="session")
def uqmbd_design() -> Callable[..., None]:
    """Check a sampling design: `uqmbd.testing.check_design`."""
    from uqmbd.testing import check_design

    return check_design


@pytest.fixture(scope="session")
def uqmbd_command() -> Callable[..., None]:
    """Check a command: `uqmbd.testing.check_command`."""
    from uqmbd.testing import check_command

    return check_command


@pytest.fixture(scope="session")
def uqmbd_section() -> Callable[..., None]:
    """Check a section of the report: `uqmbd.testing.check_section`."""
    from uqmbd.testing import check_section

    return check_section
