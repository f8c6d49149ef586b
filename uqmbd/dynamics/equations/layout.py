"""Layout of arguments, results, states and unknowns, and evaluation of parameters for each realisation."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import accumulate
from typing import Any

import numpy as np
import sympy
from numpy.typing import NDArray

from uqmbd.compiled import Kernel, cached, compile_kernel
from uqmbd.dynamics.equations.expressions import plain
from uqmbd.dynamics.equations.tables import Tables
from uqmbd.typing import Array, Index

__all__ = ["RESULTS", "Kind", "Layout", "ParameterMap", "argument_names", "state_arguments"]


Kind = str

STATE = ("q", "s", "v")
UNKNOWNS = (*STATE, "l", "m")
RATES = ("dq", "ds", "dv")
ARGUMENTS: Mapping[Kind, tuple[str, ...]] = {
    "residual": (*UNKNOWNS, *RATES, "t"),
    "jacobian": (*UNKNOWNS, *RATES, "t", "c"),
    "linear": (*STATE, "l", "dv", "t"),
    "tangent": (*STATE, "l", "dv", "t"),
}
"""Arguments of each kind as letters, in order. The arguments of all other kinds are a state and the time."""

RESULTS: Mapping[Kind, Mapping[str, tuple[str, ...]]] = {
    "position": {"phi": ("row",), "phi_q": ("row", "q"), "cos": ("cos",)},
    "velocity": {"phi_t": ("row",), "d": ("row", "q")},
    "drift": {"phi": ("row",), "psi": ("row",)},
    "initial": {"s": ("state",)},
    "acceleration": {"mass": ("q", "q"), "force": ("q",), "d": ("row", "q"), "gamma": ("row",), "s": ("state",)},
    "energy": {"energy": ("pair",)},
    "contact": {
        "guard": ("event",), "law": ("event", "pair"), "speed": ("direction",), "bias": ("direction",),
        "slope": ("direction", "q"),
    },
    "linear": {
        "v_q": ("q", "q"), "v_s": ("q", "state"), "v_v": ("q", "q"), "v_c": ("q", "excitation"),
        "s_q": ("state", "q"), "s_s": ("state", "state"), "s_v": ("state", "q"), "s_c": ("state", "excitation"),
        "phi_c": ("row", "excitation"), "phi_s": ("row", "state"),
    },
    "tangent": {
        "v_q": ("q", "q"), "v_s": ("q", "state"), "v_v": ("q", "q"), "v_h": ("q", "h"),
        "d_q": ("row", "q"), "d_s": ("row", "state"), "d_v": ("row", "q"), "d_h": ("row", "h"),
        "s_q": ("state", "q"), "s_s": ("state", "state"), "s_v": ("state", "q"), "s_h": ("state", "h"),
    },
}  # fmt: skip
"""Results of kinds with a state as argument: vectors and matrices by name, and the meaning of their indices."""


def argument_names(kind: Kind, coordinates: int, states: int, constraints: int) -> list[tuple[str, int]]:
    """Return the arguments of a kind, without parameters, as letters and indices."""
    counts = dict.fromkeys(("q", "v", "dq", "dv"), coordinates) | dict.fromkeys(("s", "ds"), states)
    counts |= {"l": constraints, "m": constraints, "t": 1, "c": 1}
    return [(letter, k) for letter in ARGUMENTS.get(kind, (*STATE, "t")) for k in range(counts[letter])]


def state_arguments(time: Array | float, *parts: Array) -> Array:
    """Return arguments ``(q, s, v, t, 0)`` of kinds with a state, from states (K, width) or their parts."""
    ends = [0, *accumulate(x.shape[1] for x in parts)]
    found = np.zeros((len(parts[0]), ends[-1] + 2))
    for x, first, end in zip(parts, ends[:-1], ends[1:], strict=True):
        found[:, first:end] = x
    found[:, -2] = time
    return found


@dataclass(frozen=True)
class Layout:
    """Sizes of the whole mechanism, and indices in the unknowns ``y = (q, s, v, lambda, mu)``."""

    coordinates: int
    states: int
    constraints: int
    kept: Index  # independent constraint equations
    # coordinates fixed by a constraint, e.g. of a slider that cannot rotate: not unknowns of the integration
    frozen: Index
    active: Index  # kept equations that freeze no coordinate; their multipliers are in y
    nonholonomic: Index  # equations between velocities without a position equation
    held: int = 0
    """Number of auxiliary states for controller values, constant between samples."""

    @property
    def width(self) -> int:
        """Length of a state: all coordinates, auxiliary states and velocities."""
        return 2 * self.coordinates + self.states

    @property
    def velocities(self) -> int:
        """Index of the first velocity in a state."""
        return self.coordinates + self.states

    @cached_property
    def number(self) -> Index:
        """Index of each constraint equation among the independent equations; -1: dependent."""
        found = np.full(self.constraints, -1, dtype=np.int64)
        found[self.kept] = np.arange(len(self.kept))
        return found

    @cached_property
    def rank(self) -> int:
        """Number of independent constraint equations."""
        return len(self.kept)

    @cached_property
    def independent_holonomic(self) -> Index:
        """Independent position equations."""
        return np.setdiff1d(self.kept, self.nonholonomic)

    @cached_property
    def free(self) -> Index:
        """Coordinates that are unknowns."""
        return np.setdiff1d(np.arange(self.coordinates), self.frozen)

    @cached_property
    def multipliers(self) -> int:
        """Number of constraint equations in the integration."""
        return len(self.active)

    @cached_property
    def differential(self) -> int:
        """Number of unknowns with derivatives in the equations: the first ones of ``y``."""
        return 2 * (self.coordinates - len(self.frozen)) + self.states

    @cached_property
    def unknowns(self) -> int:
        """Length of ``y``."""
        return self.differential + 2 * self.multipliers

    @cached_property
    def slices(self) -> dict[str, slice]:
        """Parts of ``y`` by letter: q, s, v, l, m."""
        n, k, m = self.coordinates - len(self.frozen), self.states, self.multipliers
        ends = np.cumsum([0, n, k, n, m, m])
        return {x: slice(int(a), int(b)) for x, a, b in zip("qsvlm", ends[:-1], ends[1:], strict=True)}

    def split(self, states: Array) -> tuple[Array, Array, Array]:
        """Return coordinates, auxiliary states and velocities of states (..., width)."""
        n, velocities = self.coordinates, self.velocities
        return states[..., :n], states[..., n:velocities], states[..., velocities:]

    def columns(self, kind: Kind) -> dict[tuple[str, int], int]:
        """Return the column of each variable among the arguments of a kind."""
        whole = kind not in ("residual", "jacobian")
        sizes = (self.coordinates, self.constraints) if whole else (len(self.free), self.multipliers)
        names = argument_names(kind, sizes[0], self.states, sizes[1])
        return {name: column for column, name in enumerate(names)}

    def index2_arguments(self, time: float, y: Array, yp: Array, frozen: Array, *more: float) -> Array:
        """Return arguments of residual and Jacobian: ``y``, its rates, time, c if given, zero, frozen values."""
        tail = np.broadcast_to(np.array([time, *more, 0.0]), (len(y), 2 + len(more)))
        return np.concatenate([y, yp[:, : self.differential], tail, frozen], axis=1)


@dataclass(frozen=True)
class ParameterMap:
    """Map from inputs (K, input) to parameters (K, parameter)."""

    constants: Array  # (parameter,): values of the parameters that are plain numbers
    random: NDArray[np.int64]  # indices of parameters that depend on inputs
    kernel: Kernel  # computes the random parameters

    @classmethod
    def of(cls, expressions: Sequence[sympy.Expr], inputs: Sequence[sympy.Symbol]) -> ParameterMap:
        """Compile expressions in random variables or other input symbols."""
        constants = np.zeros(len(expressions))
        random = []
        for k, e in enumerate(expressions):
            if e.is_number:
                constants[k] = float(e)
            else:
                random.append(k)
        symbols = {v: sympy.Symbol(f"_x{i}", real=True) for i, v in enumerate(inputs)}
        local = [plain(expressions[k]).xreplace(symbols) for k in random]

        def make() -> Kernel:
            import symengine as se

            arguments: list[Any] = [se.Symbol(f"_x{i}") for i in range(len(inputs))]
            tables = Tables()
            expressions = tables.applied([tables.converted(e) for e in local])
            return compile_kernel(arguments, expressions, tables=tables.known)

        kernel = cached(("parameters", len(inputs), sympy.srepr(sympy.Tuple(*local))), make) if local else make()
        return cls(constants, np.array(random, dtype=np.int64), kernel)

    def __call__(self, values: Array) -> Array:
        """Evaluate for inputs of shape ``(K, input)``."""
        result = np.repeat(self.constants[None, :], len(values), axis=0)
        if len(self.random):
            result[:, self.random] = self.kernel(np.ascontiguousarray(values))
        return result
