"""An integration whose end is far off says where it is and what moves the fastest, while it runs; clocks are those of tests."""

from __future__ import annotations

import itertools
import re

import numpy as np
import pytest

import uqmbd
from uqmbd.dynamics import build
from uqmbd.dynamics.integration import slow_progress
from uqmbd.dynamics.integration.slow_progress import Pace, fastest_body
from uqmbd_springs import SpringDamper


def two_bodies(space=uqmbd.Planar, speed=3.0):
    mechanism = uqmbd.Mechanism("pair", space())
    turns = (
        {"inertia": 1 if space is uqmbd.Planar else (1, 1, 1)} if space not in (uqmbd.Line, uqmbd.Translational) else {}
    )
    d = space.dimension
    mechanism.body("slow", mass=1, velocity=(0.5,) * d, **turns)
    mechanism.body("quick", mass=1, position=(1,) * d, velocity=(speed,) + (0,) * (d - 1), **turns)
    mechanism.output("x", mechanism.bodies["slow"].position[0])
    return mechanism


def watched(end=10.0):
    """A watch with a clock that is set by hand, and what it has said."""
    said, clock = [], [0.0]
    return Pace(build(two_bodies()), 0.0, end, now=lambda: clock[0], say=said.append), clock, said


STATE = np.arange(12.0)


def test_who_gets_on_says_nothing():
    pace, clock, said = watched()
    for instant in range(1, 100):
        clock[0] = float(instant)
        if pace.due:
            pace.check(instant / 10, STATE, instant)
    assert not said


def test_who_does_not_says_it_first_after_a_few_seconds_then_ever_more_seldom():
    pace, clock, said = watched()
    looked = []
    for instant in range(1, 400):
        clock[0] = float(instant)
        if pace.due:
            looked.append(instant)
            pace.check(1e-6 * instant, STATE, 1000 * instant)
    assert looked == [5, 20, 80, 320] and len(said) == 4
    # 1e-6 s of the motion in each second of the clock
    assert "t = 5e-06 s of 10 s" in said[0] and "after 5 s" in said[0] and "5000 steps" in said[0]
    assert re.search(r"steps since the last check, of 1e-09 s each; at this rate the rest would take", said[0])


def test_who_stands_still_says_it():
    pace, clock, said = watched()
    clock[0] = 6.0
    pace.check(0.0, STATE, 10**6)
    assert "it makes no progress" in said[0] and "0 %" in said[0]


@pytest.mark.parametrize("space", [uqmbd.Line, uqmbd.Translational, uqmbd.Planar, uqmbd.Spatial])
@pytest.mark.parametrize("speed", [3.0, 1e-3])
def test_the_fastest_body_is_the_fastest(space, speed):
    mechanism = two_bodies(space, speed)
    model = build(mechanism)
    d = space.dimension
    size, first = model.size, model.layout.velocities
    state = np.zeros(model.layout.width)
    state[first : first + d] = 0.5
    state[first + size] = speed
    name, said = fastest_body(model, state)
    away = {"slow": 0.5 * d**0.5, "quick": speed}
    assert name == f"Body {max(away, key=away.get)!r}"
    assert float(said.split()[0]) == pytest.approx(max(away.values()), rel=1e-2)


@pytest.mark.parametrize("integrator", ["dop853", "ida"])
def test_a_stiff_mechanism_says_it_while_it_runs(integrator, monkeypatch, capsys, caplog):
    """Each look at this clock is five seconds later, and the motion is a million times as long as its periods."""
    ticks = itertools.count()
    monkeypatch.setattr(
        slow_progress.Pace.__init__, "__kwdefaults__", {"now": lambda: 5.0 * next(ticks), "say": slow_progress.tell}
    )
    mechanism = uqmbd.Mechanism("stiff", uqmbd.Line())
    hammer = mechanism.body("hammer", mass=1, position=1.1)
    anvil = mechanism.body("anvil", mass=1, position=2, velocity=0.01)
    mechanism.add(SpringDamper("spring", mechanism.ground, hammer, 0, 0, 1e8, free_length=1))
    mechanism.output("x", hammer.position[0])
    mechanism.output("y", anvil.position[0])
    with pytest.raises(uqmbd.IntegrationError):
        uqmbd.simulate(mechanism, [0, 1e5], integrator=integrator)
    told = capsys.readouterr().err
    assert "Note: mechanism 'stiff': after" in told and "Body 'hammer' moves the fastest" in told


def test_two_looks_at_different_realisations_are_no_pace():
    pace, clock, said = watched()
    for instant, which in ((6.0, 8), (12.0, 0), (18.0, 5)):
        clock[0] = instant
        pace.check(0.0, STATE, 10, which)
    assert not said
    clock[0] = 40.0
    pace.check(0.0, STATE, 20, 5)
    assert len(said) == 1
