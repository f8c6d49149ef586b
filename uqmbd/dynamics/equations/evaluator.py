"""Evaluators of one kind of equations of a whole mechanism, for any number of realisations.

A *typed* evaluator has one kernel per component type (gather, evaluate, sum); its compilation time does not grow with
the mechanism. A *fused* evaluator has one kernel for the mechanism, and the smallest cost per call.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from uqmbd.compiled import Kernel, PathTable, Program, ProgramWriter, cached, compile_kernel, replaced
from uqmbd.dynamics.equations.block import BlockType
from uqmbd.dynamics.equations.derivation import derive
from uqmbd.dynamics.equations.layout import RESULTS, Kind, argument_names
from uqmbd.mechanism import SplineTable
from uqmbd.typing import Array, Index

__all__ = ["Evaluator", "Placement", "fused", "typed"]


@dataclass(frozen=True)
class Placement:
    """Global indices of the local variables of one instance."""

    # for each local letter ("q", "s", "l", ...): global index of each local variable; -1: dropped
    letters: dict[str, Index]
    parameters: Index  # indices among the parameters of the model
    limit: int = 2**31  # number of unknowns: rows and columns from this index on are not equations


@dataclass(frozen=True)
class _Group:
    """All instances of a type."""

    kernel: Kernel
    gather: Index  # (instance, local argument) into the arguments of the mechanism
    parameters: Index  # (instance, local parameter)


@dataclass(frozen=True)
class Evaluator:
    """Compiled equations of one kind."""

    targets: tuple[Any, ...]  # targets of the results in order, with global indices
    groups: tuple[_Group, ...]
    order: Index | None  # permutation of concatenated results, sorted by target
    starts: Index | None  # first result of each target in this order

    def __call__(self, arguments: Array, parameters: Array) -> Array:
        """Return values (K, target) for arguments (K, argument), ending with zero, and parameters (K, parameter)."""
        return self.program(arguments.shape[1], parameters.shape[1])(arguments, parameters)

    def write(self, writer: ProgramWriter, arguments: Index, parameters: Index) -> Index:
        """Write the evaluation from rows of arguments and model parameters; return the rows of its results."""
        parts = []
        for group in self.groups:
            reads = np.concatenate([arguments[group.gather], parameters[group.parameters]], axis=1)
            parts.append(writer.call(group.kernel, reads).ravel())
        values = np.concatenate([np.zeros(0, dtype=np.int64), *parts])
        if self.order is None or self.starts is None:
            return values
        found = values[self.order[self.starts]]
        ends = np.append(self.starts[1:], len(self.order))
        several = np.flatnonzero(ends - self.starts > 1)
        found[several] = writer.sums([values[self.order[self.starts[k] : ends[k]]].tolist() for k in several])
        return found

    def program(self, arguments: int, parameters: int, passed: range = range(0)) -> Program:
        """Return the program for numbers of arguments and model parameters; arguments in `passed` are also results."""
        key = arguments, parameters, passed
        if key not in self._programs:
            writer, rows = ProgramWriter(arguments + parameters), np.arange(arguments + parameters)
            found = self.write(writer, rows[:arguments], rows[arguments:])
            self._programs[key] = writer.program(np.concatenate([found, rows[passed.start : passed.stop]]))
        return self._programs[key]

    @cached_property
    def _programs(self) -> dict[tuple[int, int, range], Program]:
        """Cached programs by numbers of arguments and parameters, and by additional results."""
        return {}

    @cached_property
    def others(self) -> dict[Any, Any]:
        """Other cached objects derived from the equations, by key."""
        return {}

    @cached_property
    def index(self) -> dict[str, tuple[Index, tuple[Index, ...]]]:
        """For each letter of the targets: the columns of its results, and the indices of its targets."""
        found: dict[str, list[tuple[int, tuple[int, ...]]]] = {}
        for column, target in enumerate(self.targets):
            found.setdefault(target[0], []).append((column, target[1:]))
        return {
            letter: (np.array([c for c, _ in entries]), tuple(np.array([x for _, x in entries], dtype=np.int64).T))
            for letter, entries in found.items()
        }


def _globalise(target: tuple[Any, ...], place: Placement, kind: Kind) -> tuple[Any, ...] | None:
    """Convert a local target to a global target; None if it is dropped."""
    where = place.letters
    if kind == "residual":
        row = where[target[0]][target[1]]
        return None if row < 0 or row >= place.limit else ("r", int(row))
    if kind == "jacobian":
        (a, i), (b, j) = target
        row, column = where[a][i], where[b][j]
        dropped = min(row, column) < 0 or max(row, column) >= place.limit
        return None if dropped else ("J", int(column), int(row))
    name = target[0]
    indices = zip(RESULTS[kind][name], target[1:], strict=True)
    return (name, *(int(i if x == "pair" else where[x][i]) for x, i in indices))


def _arrange(targets: list[tuple[Any, ...] | None]) -> tuple[tuple[Any, ...], Index | None, Index | None]:
    kept = [k for k, x in enumerate(targets) if x is not None]
    order = sorted(kept, key=lambda k: (targets[k], k))
    unique: list[tuple[Any, ...]] = []
    starts: list[int] = []
    for position, k in enumerate(order):
        target = targets[k]
        if target is not None and (not unique or unique[-1] != target):
            unique.append(target)
            starts.append(position)
    if order == list(range(len(targets))) and len(unique) == len(order):
        return tuple(unique), None, None
    return tuple(unique), np.array(order, dtype=np.int64), np.array(starts, dtype=np.int64)


def _type_kernel(block: BlockType, kind: Kind) -> tuple[Kernel, list[tuple[Any, ...]]]:
    def make() -> tuple[Kernel, list[tuple[Any, ...]]]:
        derived = derive(block)
        equations = derived.equations(kind)
        arguments = [x for *_, x in derived.arguments(kind)] + derived.p
        return derived.kernel(arguments, equations.expressions), equations.targets

    result: tuple[Kernel, list[tuple[Any, ...]]] = cached(("typed", kind, block.digest), make)
    return result


def typed(
    kind: Kind, blocks: Sequence[BlockType], places: Sequence[Placement], columns: dict[tuple[str, int], int]
) -> Evaluator:
    """Return an evaluator with one kernel per component type, from types and placements of all instances.

    `columns` contains the argument column of each global variable; dropped variables use the last column, zero.
    """
    members: dict[str, list[int]] = {}
    for i, block in enumerate(blocks):
        members.setdefault(block.digest, []).append(i)
    groups: list[_Group] = []
    targets: list[tuple[Any, ...] | None] = []
    zero = _zero_column(columns)
    for indices in members.values():
        block = blocks[indices[0]]
        kernel, local = _type_kernel(block, kind)
        if not local:
            continue
        arguments = argument_names(kind, block.coordinates, len(block.states), len(block.constraints))
        arguments += [("h", k) for k in range(block.held)]
        gather = [
            [zero if (g := places[i].letters[x][k]) < 0 else columns[_letter(x), int(g)] for x, k in arguments]
            for i in indices
        ]
        parameters = [places[i].parameters for i in indices]
        groups.append(
            _Group(
                kernel,
                np.array(gather, dtype=np.int64).reshape(len(indices), -1),
                np.array(parameters, dtype=np.int64).reshape(len(indices), -1),
            )
        )
        targets += [_globalise(x, places[i], kind) for i in indices for x in local]
    return Evaluator(*_order(targets, groups))


def _letter(letter: str) -> str:
    """Return the global letter of a local argument; controller values are global auxiliary states."""
    return "s" if letter == "h" else letter


def _zero_column(columns: dict[tuple[str, int], int]) -> int:
    """Return the column that is always zero, because it belongs to no variable."""
    used = set(columns.values())
    return next(c for c in range(len(columns) + 1) if c not in used)


def _order(
    targets: list[tuple[Any, ...] | None], groups: list[_Group]
) -> tuple[tuple[Any, ...], tuple[_Group, ...], Index | None, Index | None]:
    unique, order, starts = _arrange(targets)
    return unique, tuple(groups), order, starts


def fused(
    kind: Kind,
    blocks: Sequence[BlockType],
    places: Sequence[Placement],
    columns: dict[tuple[str, int], int],
    parameters: int,
) -> Evaluator:
    """Return an evaluator with one kernel for the whole mechanism; arguments as for `typed`."""
    layout = [
        (b.digest, sorted((k, tuple(map(int, x))) for k, x in p.letters.items()), tuple(map(int, p.parameters)))
        for b, p in zip(blocks, places, strict=True)
    ]

    width = len(columns) + 1

    def make() -> tuple[Kernel, list[tuple[Any, ...]]]:
        import symengine as se

        names = {column: se.Symbol(f"_y{column}") for column in columns.values()}
        sums: dict[tuple[Any, ...], list[Any]] = {}
        tables: dict[str, SplineTable | PathTable] = {}
        for block, place in zip(blocks, places, strict=True):
            derived = derive(block)
            swap = {
                symbol: se.Integer(0) if (g := place.letters[x][k]) < 0 else names[columns[_letter(x), int(g)]]
                for x, k, symbol in derived.arguments(kind)
            }
            swap |= {x: se.Symbol(f"_g{int(k)}") for x, k in zip(derived.p, place.parameters, strict=True)}
            equations = derived.equations(kind)
            tables |= derived.tables.known
            swapped = replaced(equations.expressions, swap)
            for e, local in zip(swapped, equations.targets, strict=True):
                target = _globalise(local, place, kind)
                if target is not None:
                    sums.setdefault(target, []).append(e)
        targets = sorted(sums)
        arguments = [names.get(k, se.Symbol(f"_y{k}")) for k in range(width)]
        arguments += [se.Symbol(f"_g{k}") for k in range(parameters)]
        expressions = [se.Add(*sums[x]) for x in targets]
        return compile_kernel(arguments, expressions, tables=tables), targets

    kernel, targets = cached(("fused", kind, parameters, sorted(columns.items()), layout), make)
    group = _Group(kernel, np.arange(width)[None, :], np.arange(parameters)[None, :])
    return Evaluator(tuple(targets), (group,), None, None)
