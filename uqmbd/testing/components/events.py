"""Test events with velocity jumps: their speed is the rate of the gap, and impulses act between the bodies."""

from __future__ import annotations

import numpy as np

from uqmbd.testing.components.bench import Bench, own_coordinates
from uqmbd.testing.components.motion import displaced, random_turn, virtual_motions
from uqmbd.typing import Array

__all__ = ["check_events"]


STEP = 1e-5
"""Step of central differences along the motion, s."""


def check_events(bench: Bench, rng: np.random.Generator, *, between: bool) -> None:
    """Check the events of a component at random states; raise AssertionError if a speed is not the rate of its gap.

    For components that act only `between` bodies, a rigid displacement of the whole must not change gaps, speeds and
    the magnitude of the sliding velocity. Impulses must cancel.
    """
    block, space = bench.instance.type, bench.case.mechanism.space
    if not any(e.directions for e in block.events):
        return
    state, parameters = bench.state(rng), bench.parameters(bench.inputs)
    if space.turns:  # quaternions keep their length
        shape = (len(parameters), len(bench.instance.bodies), space.size)
        last = shape[1] * space.size
        parts = (state[x][:, :last].reshape(shape) for x in "qv")
        (_, e), (v, de) = (np.split(x, [space.dimension], axis=2) for x in parts)
        de = de - (e * de).sum(axis=2, keepdims=True) * e
        state["v"][:, :last] = np.concatenate([v, de], axis=2).reshape(len(parameters), last)
    here = _evaluate(bench, state, parameters)
    ahead, behind = (
        {**state, "q": state["q"] + sign * STEP * state["v"], "t": state["t"] + sign * STEP} for sign in (1, -1)
    )
    change = (_evaluate(bench, ahead, parameters)["guard"] - _evaluate(bench, behind, parameters)["guard"]) / (2 * STEP)
    directions = np.cumsum([0, *(len(e.directions) for e in block.events)])
    jumps = [k for k, e in enumerate(block.events) if e.directions]
    for k in jumps if not block.states else ():
        speed = here["speed"][:, directions[k]]
        error = abs(speed - change[:, k]).max()
        assert error < 1e-6 * (1 + abs(change).max()), (
            f"{bench.title}: the speed of event {block.events[k].label!r} is {speed}; central differences of its gap "
            f"give {change[:, k]}. Pass p.rate_of(gap) as the speed of Impact."
        )
    if not between:
        return
    moved, own = {x: state[x].copy() for x in state}, own_coordinates(bench.instance)
    turn, shift = random_turn(space, rng), rng.uniform(-1, 1, space.dimension)
    for row in range(len(parameters)):
        moved["q"][row] = displaced(space, turn, state["q"][row], shift, own)
        moved["v"][row] = displaced(space, turn, state["v"][row], own=own)
        slope = here["slope"][row].reshape(directions[-1], -1)
        power = abs(slope @ virtual_motions(space, state["q"][row], own).T).max()
        assert power < 1e-9 * (1 + abs(slope).max()), (
            f"{bench.title}: the impulses of its events do not cancel: in a rigid motion of all bodies, a speed "
            f"changes by {power:.2g}; expected 0."
        )
    there = _evaluate(bench, moved, parameters)
    for k in jumps:
        first, last = directions[k], directions[k + 1]
        pairs = [
            (x["guard"][:, k], x["speed"][:, first], _length(x["speed"][:, first + 1 : last])) for x in (here, there)
        ]
        for name, a, b in zip(("gap", "speed", "sliding velocity"), *pairs, strict=True):
            assert abs(a - b).max() < 1e-9 * (1 + abs(a).max()), (
                f"{bench.title}: the {name} of event {block.events[k].label!r} changes by {abs(a - b).max():.2g} "
                "when the whole mechanism is translated and rotated; expected no change."
            )


def _length(x: Array) -> Array:
    return np.asarray(np.linalg.norm(x, axis=1))


def _evaluate(bench: Bench, state: dict[str, Array], parameters: Array) -> dict[str, Array]:
    """Return guards (K, event), speeds (K, direction) and slopes (K, direction * coordinate)."""
    block, targets = bench.instance.type, bench.kernel("contact")[1]
    directions = sum(len(e.directions) for e in block.events)
    count = len(parameters)
    found = {
        "guard": np.zeros((count, len(block.events))),
        "speed": np.zeros((count, directions)),
        "slope": np.zeros((count, directions * block.coordinates)),
    }
    for column, (name, *where) in zip(bench.evaluate("contact", state, parameters).T, targets, strict=True):
        if name in found:
            place = where[0] * block.coordinates + where[1] if name == "slope" else where[0]
            found[name][:, place] = column
    return found
