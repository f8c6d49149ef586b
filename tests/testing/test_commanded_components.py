"""Every number of every component that is installed can be a command, where it may jump; the others are refused."""

from __future__ import annotations

import warnings

import numpy as np
import pytest

import uqmbd
from uqmbd import plugins
from uqmbd.testing.components.cases import moving_case

EVERY = [(name, space) for name, component in sorted(plugins.components().items()) for space in component.spaces]
QUICK = [("SpringDamper", "Spatial"), ("SpeedDriver", "Planar"), ("PlaneImpact", "Planar"), ("PointForce", "Line")]
TIMES = np.linspace(0, 0.1, 6)
SHIFT = 0.25


def shift(time, measured):
    return np.full((len(measured), 1), SHIFT)


def marked(name, space):
    marks = () if (name, space.__name__) in QUICK else pytest.mark.slow
    return pytest.param(name, space, id=f"{name}-{space.__name__}", marks=marks)


def motion(name, space, seed, parameter, commanded):
    """Outputs (output, time) of a component in a random pose, one number of which is commanded; None: no motion.

    What is commanded is less by as much as the command adds, so that nothing changes.
    """
    case = moving_case(plugins.component(name), space, {}, np.random.default_rng(seed))
    mechanism, component = case.mechanism, case.component
    for body in mechanism.bodies.values():
        for k, x in enumerate(body.position):
            mechanism.output(f"{body.name} {k}", x, units="m")
    if commanded:
        first = next(iter(mechanism.bodies.values())).position[0]
        measured = {"measured": [first], "commanded": ["shift"], "rate": 40, "function": shift, "initial": SHIFT}
        command = mechanism.add(uqmbd.Controller("loop", **measured)).command()
        value = component.values[parameter]
        more = command - SHIFT
        component.values[parameter] = (value[0] + more, *value[1:]) if isinstance(value, tuple) else value + more
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        try:
            found = uqmbd.simulate(mechanism, TIMES, rtol=1e-9, check=False)
        except (uqmbd.AssemblyError, uqmbd.IntegrationError):
            return None
    return np.array([found[key] for key in mechanism.outputs])


def numbers_of(name, space):
    """Scalars and vectors that a component declares."""
    declared = plugins.component(name).parameters()
    return [key for key, p in declared.items() if p.kind in ("scalar", "vector") and p.fits(space())]


@pytest.mark.parametrize(("name", "space"), [marked(name, space) for name, space in EVERY])
def test_a_command_that_changes_nothing_changes_nothing(name, space):
    compared = refused = 0
    for parameter in numbers_of(name, space):
        for seed in range(4):
            plain = motion(name, space, seed, parameter, commanded=False)
            if plain is None:
                continue
            try:
                commanded = motion(name, space, seed, parameter, commanded=True)
            except uqmbd.StudyError as error:
                # a length, a ratio, a gap: not in forces
                assert "contains a command of a controller. A command jumps" in str(error)
                refused += 1
                break
            np.testing.assert_allclose(commanded, plain, rtol=1e-6, atol=1e-6)
            compared += 1
            break
    if (name, space.__name__) in QUICK:
        assert compared > 0
    assert compared + refused <= len(numbers_of(name, space))
