"""The evaluators of a mechanism: its blocks, their places, and their kernels, compiled at once or on first use.

Residual and Jacobian, which only some integrators take, and energies are made when somebody asks for them; from
expressions that travelled as bytes, so that they are the same ones in the process that built the model and in others.
"""

from __future__ import annotations

import pickle
import threading
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np

from uqmbd.dynamics.equations.block import BlockType, Instance
from uqmbd.dynamics.equations.derivation import derive
from uqmbd.dynamics.equations.evaluator import Evaluator, Placement, fused, typed
from uqmbd.dynamics.equations.layout import Kind, Layout
from uqmbd.errors import StudyError
from uqmbd.logs import derivation
from uqmbd.mechanism import AuxiliarySymbol, Controller, HeldStates, HeldSymbol

__all__ = ["FUSED_LENGTH", "FUSED_LIMIT", "Blocks", "Evaluators", "Later", "place"]

FUSED_LIMIT = 130
"""Unknowns up to which residual and Jacobian are one kernel: beyond, compilation costs more than it saves."""

FUSED_LENGTH = 6000
"""Operations of named quantities in a Jacobian up to which it is one kernel: beyond, compilation takes seconds."""

LATER = ("residual", "jacobian", "energy")
"""Kinds that are compiled on first use."""

_LOCK = threading.RLock()


@dataclass(frozen=True)
class Blocks:
    """The blocks of a mechanism, one for each instance, and their placements."""

    types: tuple[BlockType, ...]
    places: tuple[Placement, ...]  # with the numbers of all constraint equations

    @classmethod
    def of(cls, instances: list[Instance], order: dict[str, int]) -> Blocks:
        """Place instances; `order` has the index of each body by name."""
        return cls(tuple(i.type for i in instances), tuple(place(instances, order)))

    def evaluator(self, kind: Kind, layout: Layout, parameters: int, *, fuse: bool) -> Evaluator:
        """Compile one kind of equations of blocks with `parameters` parameters.

        With `fuse` they are one kernel, except for a Jacobian that is too long.
        """
        derivation.debug("compiling equations (%s)", kind)
        places, columns = self.places, layout.columns(kind)
        if kind in ("residual", "jacobian"):
            places = _in_unknowns(places, layout)
            # in y the columns of q, s, v, l, m are their own indices
            columns = {(x, i + (layout.slices[x].start if x in "qsvlm" else 0)): c for (x, i), c in columns.items()}
            # behind the zero column stand the values of the frozen coordinates
            first = len(columns) + 1
            columns |= {("q", layout.unknowns + i): first + i for i in range(len(layout.frozen))}
        if fuse and (kind != "jacobian" or self._length <= FUSED_LENGTH):
            return fused(kind, self.types, places, columns, parameters)
        return typed(kind, self.types, places, columns)

    @cached_property
    def _length(self) -> int:
        """Operations in the Jacobians of blocks with named quantities; others are short enough."""
        seen: dict[str, int] = {}
        for block in {b.digest: b for b in self.types if b.quantities}.values():
            known: set[Any] = set()
            waiting = list(derive(block).jacobian().expressions)
            while waiting:
                e = waiting.pop()
                if e not in known:
                    known.add(e)
                    waiting += e.args
            seen[block.digest] = len(known)
        return sum(seen.get(b.digest, 0) for b in self.types)


@dataclass(frozen=True)
class Later:
    """Sources of evaluators that are compiled on first use; the other fields are arguments of `Blocks.evaluator`."""

    blocks: bytes  # `Blocks`, pickled: numerical work seldom needs symbols, which are slow to load
    layout: Layout
    parameters: int
    fuse: bool

    @classmethod
    def of(cls, blocks: Blocks, layout: Layout, parameters: int, *, fuse: bool) -> Later:
        """Store blocks; their parameters contain the gravity of the space, which may be random and large."""
        bare = {id(b): replace(b, space=replace(b.space, gravity=None)) for b in blocks.types}
        kept = Blocks(tuple(bare[id(b)] for b in blocks.types), blocks.places)
        return cls(pickle.dumps(kept), layout, parameters, fuse)

    def evaluator(self, kind: Kind) -> Evaluator:
        """Compile one kind of equations."""
        blocks: Blocks = pickle.loads(self.blocks)  # noqa: S301 - made by `of`, and kept as the model is
        return blocks.evaluator(kind, self.layout, self.parameters, fuse=self.fuse)


class Evaluators(Mapping[Kind, Evaluator]):
    """Evaluators by kind: those already `made`, and those compiled from `later` on first use (None: no others)."""

    def __init__(self, made: Mapping[Kind, Evaluator], later: Later | None = None) -> None:
        self.made, self.later = dict(made), later

    def __getitem__(self, kind: Kind) -> Evaluator:
        """Return an evaluator; one that is compiled now stays."""
        if kind not in self.made:
            if self.later is None or kind not in LATER:
                raise KeyError(kind)
            with _LOCK:
                if kind not in self.made:
                    self.made[kind] = self.later.evaluator(kind)
        return self.made[kind]

    def __contains__(self, kind: object) -> bool:
        """Return whether an evaluator of a kind exists, compiled or not."""
        return kind in self.made or (self.later is not None and kind in LATER)

    def __iter__(self) -> Iterator[Kind]:
        """Yield the kinds that there are."""
        return iter(dict.fromkeys([*self.made, *(LATER if self.later is not None else ())]))

    def __len__(self) -> int:
        """Return how many there are."""
        return len(list(iter(self)))


def place(instances: list[Instance], order: dict[str, int]) -> list[Placement]:
    """Return the global index of every local variable of all blocks; `order` holds the index of each body by name."""
    rows = states = cosines = parameters = events = directions = 0
    holders, owners = _holders(instances), _owners(instances)
    placements = []
    for instance in instances:
        block = instance.type
        size = block.space.size
        q = np.concatenate([np.arange(size) + order[b.name] * size for b in instance.bodies] or [np.zeros(0, int)])
        row = np.arange(rows, rows + len(block.constraints))
        state = np.arange(states, states + len(block.states))
        one = np.zeros(1, dtype=np.int64)
        along = sum(len(e.directions) for e in block.events)
        held = {"h": np.array([_number(h, holders, owners) for h in instance.held])} if instance.held else {}
        placements.append(
            Placement(
                {
                    "q": q,
                    "v": q,
                    "dq": q,
                    "dv": q,
                    "s": state,
                    "ds": state,
                    "l": row,
                    "m": row,
                    "t": one,
                    "c": one,
                    "row": row,
                    "state": state,
                    "cos": np.arange(cosines, cosines + len(block.cosines)),
                    "event": np.arange(events, events + len(block.events)),
                    "direction": np.arange(directions, directions + along),
                    **held,
                },  # fmt: skip
                np.arange(parameters, parameters + block.parameters),
            )
        )
        rows, states = rows + len(block.constraints), states + len(block.states)
        cosines, parameters = cosines + len(block.cosines), parameters + block.parameters
        events, directions = events + len(block.events), directions + along
    return placements


def _holders(instances: list[Instance]) -> dict[Controller, int]:
    """First auxiliary state of each controller."""
    found: dict[Controller, int] = {}
    states = 0
    for instance in instances:
        if isinstance(instance.component, HeldStates):
            found[instance.component.controller] = states
        states += len(instance.type.states)
    return found


def _owners(instances: list[Instance]) -> dict[tuple[int, str], int]:
    """Return the number of each auxiliary state, by the identity of its component and its name."""
    states = [(id(i.component), name) for i in instances for name in i.type.states]
    return {state: k for k, state in enumerate(states)}


def _number(
    symbol: HeldSymbol | AuxiliarySymbol, holders: dict[Controller, int], owners: dict[tuple[int, str], int]
) -> int:
    """Return the number among the auxiliary states of what a controller holds, or of a component's state."""
    if isinstance(symbol, HeldSymbol):
        return holders[symbol.owner] + symbol.index
    found = owners.get((id(symbol.component), symbol.state))
    if found is None:
        raise StudyError(f"{symbol}: {symbol.component!r} has no state {symbol.state!r} any more.")
    return found


def _in_unknowns(places: tuple[Placement, ...], layout: Layout) -> tuple[Placement, ...]:
    """Return placements whose letters are rows of ``y``, as residual and Jacobian targets need them.

    Only multipliers of active equations are in it.  Frozen coordinates come after all unknowns; their velocities are
    dropped.
    """
    slices, n = layout.slices, layout.coordinates
    unknown, held = np.full(n, -1, dtype=np.int64), np.full(n, -1, dtype=np.int64)
    unknown[layout.free] = np.arange(n - len(layout.frozen))
    held[layout.frozen] = layout.unknowns + np.arange(len(layout.frozen))
    number = np.full(layout.constraints, -1, dtype=np.int64)
    number[layout.active] = np.arange(len(layout.active))
    result = []
    for p in places:
        letters = dict(p.letters)
        for letter in ("q", "v", "dq", "dv"):
            letters[letter] = unknown[p.letters[letter]]
        for letter in ("l", "m"):
            letters[letter] = number[p.letters[letter]]
        for letter in "qsvlm":
            index = letters[letter]
            letters[letter] = np.where(index < 0, -1, index + slices[letter].start)
        if "h" in letters:
            letters["h"] = letters["h"] + slices["s"].start
        letters["q"] = np.where(letters["q"] < 0, held[p.letters["q"]], letters["q"])
        result.append(Placement(letters, p.parameters, layout.unknowns))
    return tuple(result)
