"""Kernels: compiled functions of rows of eight realisations."""

from __future__ import annotations

import ctypes
import hashlib
import zlib
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from uqmbd.compiled import driver as c
from uqmbd.compiled.cache import cached
from uqmbd.compiled.driver import address, aligned, load_driver
from uqmbd.compiled.native import addresses_of, host, lacking, object_code
from uqmbd.typing import Array

__all__ = ["Kernel", "compiled"]


def compiled(source: str) -> tuple[str, bytes]:
    """Compile LLVM IR with a function called ``KERNEL``; return the new name and the object code.

    The name is the digest of the source and of this processor.
    """
    name = f"k{hashlib.sha256((host().digest + source).encode()).hexdigest()[:40]}"
    return name, object_code(source.replace("@KERNEL(", f"@{name}(", 1))


@dataclass(frozen=True)
class Kernel:
    """Compiled function ``void kernel(const V *x, V *y)`` of rows ``V`` of eight realisations."""

    code: bytes  # object code; empty for a kernel without operations
    name: str  # name of the function
    inputs: int  # number of arguments
    outputs: int  # number of results
    needs: str = ""  # required processor features as text (`Target.needs`)
    operations: int = 0  # number of operations; a function of the C library counts as several
    source: bytes = b""  # compressed LLVM IR, which other processors compile again

    def __getstate__(self) -> dict[str, Any]:
        """Return the state without addresses, which each process determines separately."""
        return {key: value for key, value in self.__dict__.items() if key not in ("_native", "address")}

    @cached_property
    def address(self) -> int:
        """Return the address of the function, loaded at first use; 0 for a kernel without operations.

        If this processor lacks a required feature, the code is compiled again, once on each machine.
        """
        if not self.code:
            return 0
        load_driver()  # the driver contains functions that kernels call, and must be loaded first
        name, code = self.name, self.code
        if lacking(self.needs):
            name, code = cached(("kernel", name), lambda: compiled(zlib.decompress(self.source).decode()))
        return addresses_of([name], code)[0]

    def __call__(self, arguments: Array, out: Array | None = None) -> Array:
        """Evaluate arguments (..., inputs); return results (..., outputs), in C-contiguous `out` if given."""
        rows = np.ascontiguousarray(arguments, dtype=float)
        if rows.shape[-1] != self.inputs:
            raise ValueError(f"the kernel has {self.inputs} arguments, but {rows.shape[-1]} are given")
        if out is None:
            out = np.empty((*rows.shape[:-1], self.outputs))
        if out.shape != (*rows.shape[:-1], self.outputs) or out.dtype != float or not out.flags.c_contiguous:
            raise ValueError(
                f"out has the shape {out.shape} and type {out.dtype}; expected C-contiguous float64 (..., "
                f"{self.outputs})"
            )
        if not self.code:
            out[...] = 0.0
        elif out.size:
            program, results, step = self._native
            count = out.size // self.outputs
            source = c.SourceStruct(address(rows), self.inputs, self.inputs, 1, count, 0)
            work = aligned(self.inputs + self.outputs)
            load_driver().evaluate(
                *(ctypes.addressof(program), address(work), ctypes.addressof(source), 1, 0, count),
                *(address(results), self.outputs, address(out)),
            )
            del step  # the program points to this object, which another thread may have replaced
        return out

    @cached_property
    def _native(self) -> tuple[c.ProgramStruct, Any, c.StepStruct]:
        step = c.StepStruct(self.address, 0, 0, 1, self.inputs, self.outputs, 0, self.inputs)
        results = np.arange(self.inputs, self.inputs + self.outputs)
        return c.ProgramStruct(ctypes.addressof(step), 1, 0), results, step
