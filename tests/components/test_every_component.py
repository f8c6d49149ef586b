"""Every component type that is installed, in every space it supports: whoever adds one has it tested here."""

from __future__ import annotations

import pytest

from uqmbd import plugins
from uqmbd.testing import check_component

EVERY = [(name, space) for name, component in sorted(plugins.components().items()) for space in component.spaces]


@pytest.mark.parametrize(("name", "space"), EVERY, ids=[f"{name}-{space.__name__}" for name, space in EVERY])
def test_component(name, space):
    check_component(plugins.component(name), spaces=(space,))
