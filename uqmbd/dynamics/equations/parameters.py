"""Numbers of a model that depend on the random variables, evaluated once for each realisation."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import sympy
from numpy.typing import NDArray

from uqmbd.compiled import Kernel, cached, compile_kernel
from uqmbd.dynamics.equations.expressions import plain
from uqmbd.dynamics.equations.tables import Tables
from uqmbd.typing import Array

__all__ = ["ParameterMap"]


@dataclass(frozen=True)
class ParameterMap:
    """From inputs ``(K, input)`` to parameters ``(K, parameter)``.

    Attributes
    ----------
    constants : array, shape (parameter,)
        Values of those that are plain numbers.
    random : array of int
        Which parameters depend on inputs.
    kernel : Kernel
        Computes these.
    """

    constants: Array
    random: NDArray[np.int64]
    kernel: Kernel

    @classmethod
    def of(cls, expressions: Sequence[sympy.Expr], inputs: Sequence[sympy.Symbol]) -> ParameterMap:
        """Compile expressions in random variables, or in other symbols that are given as inputs."""
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
