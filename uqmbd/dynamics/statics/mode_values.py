"""Outputs of modes: frequencies, damping ratios, and mode shapes of quantities of the pose."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from uqmbd.dynamics.batch import Batch
from uqmbd.dynamics.equations import OutputMap
from uqmbd.dynamics.observation import observe
from uqmbd.dynamics.statics.modes import Modes
from uqmbd.mechanism import ModeShape, Output, ScalarSymbol
from uqmbd.typing import Array

__all__ = ["ModeMap", "ModeValue", "mode_map"]


EQUAL = 1e-7
"""Relative difference of frequencies that count as equal."""

STILL = 1e-9
"""Change of a quantity, relative to the largest possible change in a mode, that counts as zero."""

SAME = 1e-5
"""Allowed relative variation of a ratio along a steady motion or between modes of equal frequency."""

WORDS = {"frequency": "eigenfrequency", "damping_ratio": "damping ratio", "shape": "mode"}


@dataclass(frozen=True)
class ModeValue:
    """Scalar quantity of a mode."""

    quantity: str  # "frequency", "damping_ratio" or "shape"
    number: int  # number of the mode, from 1, among oscillating modes
    pose: str  # "equilibrium", "start" or "steady"
    moved: tuple[int, int] = (0, 0)  # shape: indices of quantity and reference among the moving quantities
    part: str = "real"  # shape: "real" or "imaginary"
    name: str = ""  # name in the user's expression


@dataclass(frozen=True)
class ModeMap:
    """Compiled scalar quantities of modes."""

    values: tuple[ModeValue, ...]  # in order
    moving: OutputMap  # quantities in mode shapes, with their derivatives

    @property
    def poses(self) -> frozenset[str]:
        """Poses of the linearisations."""
        return frozenset(value.pose for value in self.values)

    def evaluate(
        self, value: ModeValue, batch: Batch, modes: Modes, states: Sequence[tuple[Array, Array]]
    ) -> tuple[Array, list[str]]:
        """Return a quantity of a mode of K realisations about its pose (K,), and the reasons for NaN.

        The arguments `states` are states (S, width) and times (S,), s after the start, of each realisation.
        """
        places, reasons = _places(modes, value)
        if value.quantity != "shape":
            every = np.asarray(getattr(modes, value.quantity))
            found = [row[p] if p >= 0 else np.nan for row, p in zip(every, places.tolist(), strict=True)]
            return np.array(found, dtype=float), reasons
        result = np.full(len(places), np.nan)
        owner = np.repeat(np.arange(len(states)), [len(after) for _, after in states])
        flat, after = (np.concatenate([s[i] for s in states]) for i in (0, 1))
        gradients = self._gradients(batch, flat, batch.model.time + after, owner)
        for k, place in enumerate(places.tolist()):
            if not reasons[k]:
                ratio = _ratio(modes.eigenvalues[k], modes.shapes[k], place, gradients[owner == k][:, value.moved])
                if isinstance(ratio, str):
                    reasons[k] = f"{value.name}: {ratio}"
                else:
                    result[k] = ratio.real if value.part == "real" else ratio.imag
        return result, reasons

    def _gradients(self, batch: Batch, states: Array, times: Array, owner: NDArray[np.int64]) -> Array:
        """Return the derivatives of moving quantities by all coordinates, shape (S, quantity, coordinate)."""
        count, n = len(self.moving.names), batch.model.layout.coordinates
        found = observe(batch, self.moving, states, times, owner)[:, count:]
        return np.asarray(found.reshape(len(states), count, 2, n)[:, :, 0])


def mode_map(symbols: Sequence[ScalarSymbol | ModeShape], compiled: Callable[[Sequence[Output]], OutputMap]) -> ModeMap:
    """Compile frequencies, damping ratios and shapes of modes.

    The function `compiled` compiles outputs with their derivatives.
    """
    moving = sorted({e for x in symbols if isinstance(x, ModeShape) for e in x.moved}, key=str)
    values = []
    for x in symbols:
        if isinstance(x, ModeShape):
            quantity, over = (moving.index(e) for e in x.moved)
            values.append(ModeValue("shape", x.number, x.at, (quantity, over), x.part, str(x)))
        else:
            values.append(ModeValue(x.quantity, x.number, x.at, name=str(x)))
    return ModeMap(tuple(values), compiled([Output(str(e), e, "") for e in moving]))


def _places(modes: Modes, value: ModeValue) -> tuple[NDArray[np.int64], list[str]]:
    """Return the index of the mode with a number among oscillating modes, (K,), and reasons for its absence (-1)."""
    swinging = modes.eigenvalues.imag > 0  # False for NaN, in realisations with fewer modes
    chosen = swinging & (np.cumsum(swinging, axis=1) == value.number)
    known = swinging.sum(axis=1)
    real, size = modes.eigenvalues.real, np.abs(modes.eigenvalues)
    growing = ((modes.eigenvalues.imag == 0) & (real > 1e-6 * np.nanmax(size, axis=1, initial=0.0)[:, None])).sum(
        axis=1
    )
    reasons = [
        ""
        if n >= value.number
        else f"the mechanism has no {WORDS[value.quantity]} {value.number}: {n} of its modes oscillate; rigid-body "
        "modes, and modes that decay or grow without oscillation, have no number"
        + (f"; {g} of its modes grow without oscillation, so that it is unstable there" if g else "")
        for n, g in zip(known.tolist(), growing.tolist(), strict=True)
    ]
    return np.where(known >= value.number, np.argmax(chosen, axis=1) if chosen.size else 0, -1), reasons


def _ratio(
    eigenvalues: NDArray[np.complex128], shapes: NDArray[np.complex128], place: int, gradients: Array
) -> complex | str:
    """Return the ratio of two quantities in the mode `place` of one realisation, or the reason for its absence.

    The arguments are eigenvalues (mode,), shapes (time, mode, coordinate), and gradients of quantity and reference
    (time, 2, coordinate).
    """
    if not np.isfinite(gradients).all():
        return "a quantity has no derivative by the coordinates in this pose"
    own = eigenvalues[place]
    equal = np.flatnonzero(np.abs(eigenvalues - own) <= EQUAL * np.abs(own))
    equal = np.array([place, *equal[equal != place]])
    moved = np.einsum("tic,tmc->tim", gradients, shapes[:, equal])
    most = np.linalg.norm(gradients, axis=2)[:, :, None] * np.linalg.norm(shapes[:, equal], axis=2)[:, None, :]
    moved = np.where(np.abs(moved) <= STILL * most, 0.0, moved)
    quantity, over = moved[:, 0], moved[:, 1]
    if not over.any(axis=1).all():
        return "the reference does not move in this mode, so that the ratio is not finite"
    if len(equal) > 1:
        leading = np.argmax(np.abs(over), axis=1)[:, None]
        found = np.take_along_axis(quantity, leading, 1) / np.take_along_axis(over, leading, 1)
        wrong = np.abs(quantity - found * over) > SAME * np.maximum(np.abs(quantity), np.abs(found * over))
        if wrong.any():
            return (
                f"{len(equal)} of its modes have this frequency, and any linear combination of them is a mode, so that "
                "the ratio is not determined"
            )
        ratios = found[:, 0]
    else:
        ratios = quantity[:, 0] / over[:, 0]
    if np.abs(ratios - ratios[0]).max() > SAME * np.abs(ratios).max():
        return (
            "it changes during the steady motion; use a quantity that remains constant, such as an angle between "
            "bodies or a distance"
        )
    return complex(ratios[0])
