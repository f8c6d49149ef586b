"""Evaluators of a mechanism: blocks, placements, and kernels, which are compiled at once or on first use.

Energies, residual and Jacobian, which only some integrators use, are compiled on first use. The expressions of these
functions are transferred as bytes, so that they are identical in the process that built the model and in other
processes.
"""

from __future__ import annotations

import pickle
import threading
from collections.abc import Iterator, Mapping, Sequence
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
from uqmbd.mechanism import AuxiliarySymbol, Controller, ExcitationSymbol, HeldStates, HeldSymbol

__all__ = ["FUSED_LENGTH", "FUSED_LIMIT", "Blocks", "Evaluators", "Later", "excitations_of", "place"]

FUSED_LIMIT = 130
"""Largest number of unknowns for one kernel of residual or Jacobian; above it, compiling takes longer than it saves."""

FUSED_LENGTH = 6000
"""Largest number of operations with named quantities for one Jacobian kernel; a longer one takes seconds to compile."""

LATER = ("residual", "jacobian", "energy", "linear", "tangent")
"""Kinds that are compiled on first use."""

_LOCK = threading.RLock()


@dataclass(frozen=True)
class Blocks:
    """Blocks of a mechanism, one for each instance, and their placements."""

    types: tuple[BlockType, ...]
    places: tuple[Placement, ...]  # with the indices of all constraint equations

    @classmethod
    def of(cls, instances: list[Instance], order: dict[str, int]) -> Blocks:
        """Place instances; `order` contains the first coordinate of each body and component by name."""
        return cls(tuple(i.type for i in instances), tuple(place(instances, order)))

    def evaluator(self, kind: Kind, layout: Layout, parameters: int, *, fuse: bool) -> Evaluator:
        """Compile one kind of equations for blocks with `parameters` parameters.

        With `fuse`, the equations are one kernel, except for a too long Jacobian.
        """
        derivation.debug("compiling equations (%s)", kind)
        places, columns = self.places, layout.columns(kind)
        if kind in ("residual", "jacobian"):
            places = _in_unknowns(places, layout)
            # in y, the columns of q, s, v, l, m equal their indices
            columns = {(x, i + (layout.slices[x].start if x in "qsvlm" else 0)): c for (x, i), c in columns.items()}
            # values of the frozen coordinates follow the zero column
            first = len(columns) + 1
            columns |= {("q", layout.unknowns + i): first + i for i in range(len(layout.frozen))}
        if fuse and (kind not in ("jacobian", "tangent") or self._length <= FUSED_LENGTH):
            return fused(kind, self.types, places, columns, parameters)
        return typed(kind, self.types, places, columns)

    @cached_property
    def _length(self) -> int:
        """Number of operations in Jacobians of blocks with named quantities; other Jacobians are short enough."""
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

    blocks: bytes  # pickled `Blocks`: numerical code seldom needs symbols, which are slow to load
    layout: Layout
    parameters: int
    fuse: bool

    @classmethod
    def of(cls, blocks: Blocks, layout: Layout, parameters: int, *, fuse: bool) -> Later:
        """Store blocks; their parameters include the gravity of the space, which may be random and large."""
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
        """Return an evaluator; compile and store it if necessary."""
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
        """Yield the available kinds."""
        return iter(dict.fromkeys([*self.made, *(LATER if self.later is not None else ())]))

    def __len__(self) -> int:
        """Return the number of available kinds."""
        return len(list(iter(self)))


def place(instances: list[Instance], order: dict[str, int]) -> list[Placement]:
    """Return the global indices of all local variables of blocks; `order`: the first coordinate of each owner."""
    rows = states = cosines = parameters = events = directions = 0
    holders, owners = _first_controller_states(instances), _owners(instances)
    excitations = excitations_of(instances)
    placements = []
    for instance in instances:
        block = instance.type
        q = np.concatenate([np.arange(len(x.q)) + order[x.name] for x in instance.owners] or [np.zeros(0, int)])
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
                    "excitation": np.array([excitations.index(c) for c in instance.excitations], dtype=np.int64),
                    **held,
                },  # fmt: skip
                np.arange(parameters, parameters + block.parameters),
            )
        )
        rows, states = rows + len(block.constraints), states + len(block.states)
        cosines, parameters = cosines + len(block.cosines), parameters + block.parameters
        events, directions = events + len(block.events), directions + along
    return placements


def excitations_of(instances: Sequence[Instance]) -> list[ExcitationSymbol]:
    """Return the coefficients of all excitations, each once, by their names and orders."""
    found = {c for instance in instances for c in instance.excitations}
    return sorted(found, key=lambda c: (c.source.source.name, str(c.argument), c.order))


def _first_controller_states(instances: list[Instance]) -> dict[Controller, int]:
    """Return the index of the first auxiliary state of each controller."""
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
    """Return the index, among the auxiliary states, of a controller value or of a component's state."""
    if isinstance(symbol, HeldSymbol):
        return holders[symbol.owner] + symbol.index
    found = owners.get((id(symbol.component), symbol.state))
    if found is None:
        raise StudyError(f"{symbol}: {symbol.component!r} no longer has a state {symbol.state!r}.")
    return found


def _in_unknowns(places: tuple[Placement, ...], layout: Layout) -> tuple[Placement, ...]:
    """Return placements with letters as rows of ``y``, for residual and Jacobian targets.

    ``y`` contains only multipliers of active equations.  Frozen coordinates follow all unknowns; their velocities are
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
