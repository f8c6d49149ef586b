"""Fixtures of pytest for the tests of plugins: the checks of `uqmbd.testing`, available without an import.

pytest loads this module in every run of an environment with uqmbd, even if the run does not use uqmbd. The module is
therefore a separate package without options and hooks, which imports uqmbd only when a fixture is used.
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
    "uqmbd_excitation",
    "uqmbd_exporter",
    "uqmbd_integrator",
    "uqmbd_propagator",
    "uqmbd_section",
]


@pytest.fixture(scope="session")
def uqmbd_component() -> Callable[..., None]:
    """Return the check of a component: `uqmbd.testing.check_component`."""
    from uqmbd.testing import check_component

    return check_component


@pytest.fixture(scope="session")
def uqmbd_propagator() -> Callable[..., None]:
    """Return the check of a propagator: `uqmbd.testing.check_propagator`."""
    from uqmbd.testing import check_propagator

    return check_propagator


@pytest.fixture(scope="session")
def uqmbd_integrator() -> Callable[..., None]:
    """Return the check of an integrator: `uqmbd.testing.check_integrator`."""
    from uqmbd.testing import check_integrator

    return check_integrator


@pytest.fixture(scope="session")
def uqmbd_design() -> Callable[..., None]:
    """Return the check of a sampling design: `uqmbd.testing.check_design`."""
    from uqmbd.testing import check_design

    return check_design


@pytest.fixture(scope="session")
def uqmbd_excitation() -> Callable[..., None]:
    """Return the check of an excitation with sampled paths: `uqmbd.testing.check_excitation`."""
    from uqmbd.testing import check_excitation

    return check_excitation


@pytest.fixture(scope="session")
def uqmbd_exporter() -> Callable[..., None]:
    """Return the check of an exporter: `uqmbd.testing.check_exporter`."""
    from uqmbd.testing import check_exporter

    return check_exporter


@pytest.fixture(scope="session")
def uqmbd_command() -> Callable[..., None]:
    """Return the check of a command: `uqmbd.testing.check_command`."""
    from uqmbd.testing import check_command

    return check_command


@pytest.fixture(scope="session")
def uqmbd_section() -> Callable[..., None]:
    """Return the check of a report section: `uqmbd.testing.check_section`."""
    from uqmbd.testing import check_section

    return check_section
