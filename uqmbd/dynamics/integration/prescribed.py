"""Jumps of prescribed functions of time."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import sympy
from numpy.typing import NDArray

from uqmbd.dynamics.assembly import named
from uqmbd.dynamics.batch import Batch
from uqmbd.dynamics.equations import ParameterMap, plain, state_arguments
from uqmbd.dynamics.integration.functions_of_time import sample_functions
from uqmbd.mechanism import Component, flatten, t
from uqmbd.randomness import RandomVariable
from uqmbd.typing import Array

__all__ = ["Prescribed", "instant", "jumped", "position_jumps", "prescribed_by"]


INSTANT = 1e-12
"""Offset of the instants right before and right after a time, relative to the larger of 1 s and the time."""
NEXT = 1e3
"""Distance from a jump, in offsets `INSTANT`, at which an equation must be finite on both sides."""
POSES = 3
"""Number of poses at which an equation is evaluated before and after; at a single pose, values may agree by chance."""
LEAST = 1e-9
"""Jump, relative to the size of the mechanism, that counts as rounding for every tolerance."""
ROUNDING = 1e-14
"""Jump, relative to the largest coordinate, that counts as rounding in every mechanism."""


@dataclass(frozen=True)
class Prescribed:
    """Parameters of constraining components that are functions of time."""

    owners: tuple[str, ...]  # component of each parameter
    names: tuple[str, ...]  # name of each parameter
    units: tuple[str, ...]  # units of each parameter
    functions: ParameterMap  # values of the parameters, from inputs and time

    def jumps(self, owner: str, values: Array, before: float, after: float) -> str:
        """Return a message on parameters of a component that jump between two times in s, for inputs (input,)."""
        moments = np.array([[*values, before], [*values, after]])
        change = np.diff(self.functions(moments), axis=0)[0]
        found = [
            f"its {name} by {size:.6g} {units}".rstrip()
            for name, of, units, size in zip(self.names, self.owners, self.units, change, strict=True)
            if of == owner and abs(size) > LEAST
        ]
        return " and ".join(found)


def prescribed_by(components: Sequence[Component], inputs: Sequence[RandomVariable]) -> Prescribed:
    """Find the parameters of components that depend only on time and random variables."""
    known = {t, *inputs}
    about: list[tuple[str, str, str]] = []
    expressions: list[sympy.Expr] = []
    for component in components:
        for name, parameter in component.parameters().items():
            entries = flatten(component.values.get(name)) if parameter.kind != "option" else []
            for k, entry in enumerate(entries):
                symbols: set[Any] = getattr(entry, "free_symbols", set())
                if t in symbols and symbols <= known:
                    label = name if len(entries) == 1 else f"{name}[{k}]"
                    about.append((component.name, label, parameter.units))
                    expressions.append(plain(entry))
    owners, names, units = zip(*about, strict=True) if about else ((), (), ())
    return Prescribed(tuple(owners), tuple(names), tuple(units), ParameterMap.of(expressions, [*inputs, t]))


def instant(time: float) -> float:
    """Return the offset in s of the instants right before and right after a time."""
    return INSTANT * max(1.0, abs(time))


def jumped(sooner: Array, before: Array, after: Array, later: Array) -> Array:
    """Return jumps of equations from values right before and after a time, and at twice this distance.

    A fast quantity without a jump moves twice as far in twice the time.  An equation with only a change of sign has no
    jump.
    """
    return np.asarray(
        np.minimum(np.abs(2 * (after - before) - (later - sooner)), np.abs(2 * (after + before) - (later + sooner)))
    )


def position_jumps(ensemble: Batch, times: Array, rtol: float) -> dict[int, str]:
    """Find realisations in which a constraint, and so a position, jumps within the output times.

    Return a message with time, component and size of the jump for each of these realisations.  An equation jumps if its
    values right before and right after a break time differ by more than the sign.  The constraints of the model depend
    on time.  The tolerance is relative to the size of the mechanism.
    """
    model = ensemble.model
    breaks = ensemble.breaks
    if model.timed is not None:  # jumps at times known only from sampling
        seen = sample_functions(model.timed, ensemble.values, breaks, times, rtol).jumps
        breaks = np.concatenate([breaks, np.tile(seen, (len(ensemble), 1))], axis=1)
    if not breaks.size:
        return {}
    begin, end = float(times[0]), float(times[-1])
    ok, gradients = ensemble.start.ok, ensemble.gradient_lengths
    found: dict[int, str] = {}
    for column in breaks.T:
        some = np.flatnonzero(ok & (column >= begin) & (column <= end))
        some = some[[int(k) not in found for k in some]] if len(some) else some
        if len(some):
            # ignore jumps outside the output times
            delta = INSTANT * np.maximum(1.0, np.abs(column[some]))
            sides, about = (
                np.clip(column[some] + far * np.array([[-2], [-1], [1], [2]]) * delta, begin, end)
                for far in (1.0, NEXT)
            )
            # next to a pole every function is steep: the integrator reports its values that are not finite
            steep = ~np.isfinite(_equation_jumps(ensemble, some, about))
            jumps = np.where(steep, 0.0, _equation_jumps(ensemble, some, sides)) / gradients[some]
            noise = ROUNDING * np.maximum(1.0, np.abs(ensemble.start.q[some]).max(axis=1, initial=0.0))
            wrong = jumps > np.maximum(max(rtol, LEAST) * min(1.0, model.length), noise)[:, None]
            for row in np.flatnonzero(wrong.any(axis=1)):
                equations = np.flatnonzero(wrong[row])
                found[int(some[row])] = _jump(ensemble, int(some[row]), sides[1:3, row], column[some[row]], equations)
    return found


def _equation_jumps(ensemble: Batch, members: NDArray[np.int64], sides: Array) -> Array:
    """Return jumps of equations, (K, equation), from two times before and two after: `sides` (4, K), s."""
    model, start = ensemble.model, ensemble.start
    found = np.zeros((len(members), model.layout.constraints))
    states = np.concatenate([start.q, start.s, np.zeros_like(start.v)], axis=1)[members]
    shifts = np.random.default_rng(0).uniform(-0.3, 0.3, (POSES, states.shape[1]))
    for shift in shifts:
        values = [
            model.evaluate("drift", state_arguments(time, states + shift), ensemble.block[members])["phi"]
            for time in sides
        ]
        found = np.maximum(found, jumped(*values))
    return found


def _jump(ensemble: Batch, member: int, sides: Array, time: float, equations: NDArray[np.int64]) -> str:
    """Return a message on the jumping quantities."""
    model = ensemble.model
    owners = dict.fromkeys(model.owners[k] for k in equations)
    parts = []
    for owner in owners:
        by = model.prescribed.jumps(owner, ensemble.values[member], *sides) if model.prescribed is not None else ""
        parts.append(f"{owner!r} ({by})" if by else repr(owner))
    return (
        f"at t = {time:.6g} s a position jumps that is prescribed by {', '.join(parts)}. The equations "
        f"{named(model, equations)} then require bodies to be in two places at once. Expected a continuous function "
        "of time, such as uqmbd.step between two positions, or a prescribed speed"
    )
