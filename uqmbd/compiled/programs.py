"""Programs: sequences of kernels and sums on a work array with rows of eight numbers."""

from __future__ import annotations

import ctypes
import itertools
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import cached_property, partial
from typing import Any

import numpy as np

from uqmbd.compiled import driver as c
from uqmbd.compiled.driver import address, aligned, load_driver
from uqmbd.compiled.kernel import Kernel
from uqmbd.typing import Array, Index

__all__ = ["Addressed", "Columns", "ProgramPart", "Program", "ProgramStep", "ProgramWriter"]


@dataclass(frozen=True)
class ProgramStep:
    """Step of a program: a kernel for `count` instances, a method of the driver, or (without either) sums of rows."""

    kernel: Kernel | None
    count: int
    # rows of all arguments of all instances, or of all terms; None: arguments are in consecutive rows from `first`
    reads: Index | None
    starts: Index | None  # first term of each sum, and the end
    first: int
    to: int  # row of the first result
    method: int = 0  # address of a function of the driver; 0: none
    context: int = 0  # address of its context; 0: none


@dataclass(frozen=True)
class Columns:
    """Arguments in the columns of an array (N, column); state k uses row ``k // divisor % N``."""

    data: Array
    divisor: int = 1


class Addressed:
    """Data with a cached `structure` of addresses in this process, which pickles omit."""

    def __getstate__(self) -> dict[str, Any]:
        """Return the state without the addresses."""
        return {key: value for key, value in self.__dict__.items() if key != "structure"}


@dataclass(frozen=True)
class ProgramPart(Addressed):
    """A sequence of steps on a work array."""

    steps: tuple[ProgramStep, ...]
    scratch: int  # first row of gathered arguments

    @property
    def operations(self) -> int:
        """Return the number of row operations of the steps, including copies of arguments."""
        kernels = sum(s.count * s.kernel.operations for s in self.steps if s.kernel is not None)
        return kernels + sum(len(s.reads) for s in self.steps if s.reads is not None)

    @cached_property
    def structure(self) -> c.ProgramStruct:
        """Return the C structure of the steps for the driver."""
        table = self._table()
        found = c.ProgramStruct(ctypes.addressof(table), len(self.steps), self.scratch)
        # the structure stores only the address of its table; two threads may both make a structure, so each structure
        # holds a reference to its own table
        found.kept = table
        return found

    def _table(self) -> Any:
        rows = []
        for s in self.steps:
            code, inputs, outputs = (0, 0, 1)
            if s.kernel is not None:
                code, inputs, outputs = s.kernel.address, s.kernel.inputs, s.kernel.outputs
            tables = address(s.reads), address(s.starts)
            rows.append(c.StepStruct(code, *tables, s.count, inputs, outputs, s.first, s.to, s.method, s.context))
        return (c.StepStruct * max(1, len(rows)))(*rows)


class ProgramWriter:
    """Writer of programs with a common work array; its first `inputs` rows are the arguments."""

    def __init__(self, inputs: int) -> None:
        self.inputs, self.rows = inputs, inputs
        self.widest = 1
        self.steps: list[ProgramStep] = []

    def call(self, kernel: Kernel, reads: Index) -> Index:
        """Call a kernel for arguments in rows `reads` (instance, argument); return the rows of the results."""
        count = len(reads)
        to, self.rows = self.rows, self.rows + count * kernel.outputs
        if count and kernel.outputs:
            flat = np.ascontiguousarray(reads, dtype=np.int64).ravel()
            first = int(flat[0]) if len(flat) else 0
            table = None if np.array_equal(flat, np.arange(first, first + len(flat))) else flat
            self.widest = max(self.widest, kernel.inputs)
            self.steps.append(ProgramStep(kernel, count, table, None, first, to))
        return np.arange(to, self.rows, dtype=np.int64).reshape(count, kernel.outputs)

    def room(self, rows: int) -> Index:
        """Reserve rows for the caller."""
        to, self.rows = self.rows, self.rows + rows
        return np.arange(to, self.rows, dtype=np.int64)

    def sums(self, terms: Sequence[Sequence[int]]) -> Index:
        """Add up rows; return the rows of the sums. An empty sum is zero."""
        to, self.rows = self.rows, self.rows + len(terms)
        starts = np.array([0, *itertools.accumulate(map(len, terms))], dtype=np.int64)
        reads = np.array([x for sum_ in terms for x in sum_] or [0], dtype=np.int64)
        if terms:
            self.steps.append(ProgramStep(None, len(terms), reads, starts, 0, to))
        return np.arange(to, self.rows, dtype=np.int64)

    @property
    def size(self) -> int:
        """Return the number of rows of the work array, including rows of gathered arguments."""
        return self.rows + self.widest

    def part(self, begin: int = 0, end: int | None = None) -> ProgramPart:
        """Return the selected steps as a part; no rows may be added afterwards."""
        return ProgramPart(tuple(self.steps[begin:end]), self.rows)

    def program(self, results: Index) -> Program:
        """Make a program of all steps, with the rows of its results."""
        results = np.ascontiguousarray(results, dtype=np.int64).ravel()
        return Program(self.part(), self.inputs, self.size, results)


@dataclass(frozen=True)
class Program:
    """Program: steps, and the rows of their results."""

    part: ProgramPart
    inputs: int  # number of arguments, in the first rows
    rows: int  # number of rows of the work array
    results: Index = field(repr=False)  # rows of the results

    def __call__(self, *sources: Array | Columns, count: int | None = None, out: Array | None = None) -> Array:
        """Return the results (K, result), in `out` if given.

        The sources are arrays (K, argument) or `Columns`; their columns are joined in order. `count` is K, and is
        required if no source is an array with K rows.
        """
        table, kept, count = self.sources(sources, count)
        if out is None:
            out = np.empty((count, len(self.results)))
        if count and len(self.results):
            work, structure = aligned(self.rows), self.part.structure
            load_driver().evaluate(
                ctypes.addressof(structure),
                address(work),
                address(table),
                len(table),
                0,
                count,
                address(self.results),
                len(self.results),
                address(out),
            )
        return out

    def bound(self, *sources: Array | Columns, out: Array) -> Callable[[], object]:
        """Return a function that evaluates the current arguments into `out` (K, result), with little overhead.

        The arrays are as for `__call__`, of type float64 with contiguous columns; they must not move in memory.
        """
        table, kept, count = self.sources(sources, None)
        given = [x.data if isinstance(x, Columns) else x for x in sources]
        if not (
            out.flags.c_contiguous
            and all(np.shares_memory(x, y) or not x.size for x, y in zip(given, kept, strict=True))
        ):
            raise ValueError(
                "a bound program expects float64 arguments in contiguous columns, and a C-contiguous array of results"
            )
        work, evaluate, structure = aligned(self.rows), load_driver().evaluate, self.part.structure
        call = partial(
            evaluate,
            *(ctypes.addressof(structure), address(work), address(table), len(table), 0, count),
            *(address(self.results), len(self.results), address(out)),
        )
        vars(call)["kept"] = (self, structure, table, kept, work, sources, out)
        return call

    def largest(self, *sources: Array | Columns, states: int, count: int | None = None) -> Array:
        """Return the largest magnitudes of the results over groups of `states` states, shape (K / states, result)."""
        table, kept, count = self.sources(sources, count)
        out = np.zeros((count // states, len(self.results)))
        if count and len(self.results):
            work, most, structure = aligned(self.rows), aligned(len(self.results)), self.part.structure
            load_driver().largest(
                ctypes.addressof(structure),
                address(work),
                address(most),
                address(table),
                len(table),
                states,
                count,
                address(self.results),
                len(self.results),
                address(out),
            )
        return out

    def sources(self, sources: Sequence[Array | Columns], count: int | None) -> tuple[Index, list[Array], int]:
        """Return the arguments for the driver: a table, the arrays that it points to, and the number of states."""
        rows, kept, to = list[tuple[int, ...]](), list[Array](), 0
        for source in sources:
            data, divisor = (source.data, source.divisor) if isinstance(source, Columns) else (source, 1)
            data = np.asarray(data, dtype=float)
            data = data[:, None] if data.ndim == 1 else data
            length, width = data.shape
            if width > 1 and data.strides[1] != data.itemsize:
                data = np.ascontiguousarray(data)
            kept.append(data)
            if count is None:
                count = length
            if not width:
                continue
            if count % max(1, length * divisor) if isinstance(source, Columns) else length not in (1, count):
                each = f", each for {divisor} states in a row" if isinstance(source, Columns) else ""
                raise ValueError(f"the program runs for {count} states, but {length} rows of arguments are given{each}")
            # a table of integers with the fields of a `SourceStruct` takes half the time of structures
            rows.append((address(data), data.strides[0] // data.itemsize, width, divisor, max(1, length), to))
            to += width
        assert len(rows) <= c.SOURCES, "the driver accepts no more arrays at once"
        if to != self.inputs:
            raise ValueError(f"the program has {self.inputs} arguments, but {to} are given")
        return np.array(rows, dtype=np.int64), kept, count or 0
