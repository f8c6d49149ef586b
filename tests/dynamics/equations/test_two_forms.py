"""One kernel for the whole mechanism, or one for each component type: the same numbers."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

import uqmbd
from uqmbd import plugins
from uqmbd.dynamics import Ensemble, build
from uqmbd.testing.components.cases import component_cases

EVERY = [(name, space) for name, component in sorted(plugins.components().items()) for space in component.spaces]


# a joint, one with an auxiliary state, a force of the space, one with quantities, a turn that is counted
REPRESENTATIVES = ("Revolute", "TorsionSpringDamper", "SpringDamper", "PlaneContact", "RotationDriver")


def marked(name, space):
    """Every component in the plane, or in its first space, and some in every space; all others are slow."""
    spaces = plugins.component(name).spaces
    first = uqmbd.Planar if uqmbd.Planar in spaces else spaces[0]
    few = name in REPRESENTATIVES or space is first
    return pytest.param(name, space, id=f"{name}-{space.__name__}", marks=() if few else pytest.mark.slow)


@pytest.mark.thorough
@pytest.mark.parametrize(("name", "space"), [marked(name, space) for name, space in EVERY])
def test_fused_equals_typed(name, space):
    for seed in range(5):
        rng = np.random.default_rng(seed)
        case = next(itertools.islice(component_cases(plugins.component(name), space, {}, rng), 1, None))
        try:
            fused, typed = (build(case.mechanism, fuse=fuse) for fuse in (True, False))
        except uqmbd.AssemblyError:  # a random pose from which there is no way to an assembled one
            continue
        break
    else:
        pytest.fail("no random pose could be assembled")
    inputs = case.mechanism.inputs
    values = inputs.from_uniform(rng.uniform(0.1, 0.9, (3, len(inputs))))
    y, rates = rng.normal(size=(2, 3, fused.layout.unknowns))
    assert typed.layout.unknowns == fused.layout.unknowns
    one, two = Ensemble(fused, values), Ensemble(typed, values)
    assert one.residual(0.3, y, rates) == pytest.approx(two.residual(0.3, y, rates), rel=1e-11, abs=1e-11)
    assert all(np.array_equal(a, b) for a, b in zip(fused.pattern, typed.pattern, strict=True))
    exact, other = (e.jacobian(0.3, y, rates, 2.0) for e in (one, two))
    assert exact == pytest.approx(other, rel=1e-11, abs=1e-11)
