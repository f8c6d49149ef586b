"""Checks of studies with random processes."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import sympy

import uqmbd
from uqmbd_processes.process import RandomProcess

__all__ = ["UnusedProcesses"]


class UnusedProcesses:
    """Find random processes that act on a mechanism without an output of the stationary response."""

    def find(self, study: Any) -> Iterator[uqmbd.extend.Finding]:
        """Yield a finding for each component with a process, if no output reads a response."""
        mechanism = study.mechanism
        if any(getattr(x, "declared", None) is not None for o in mechanism.observed() for x in _parts(o.expression)):
            return
        for component in mechanism.components.values():
            symbols = {s for value in component.values.values() for s in _symbols(value)}
            names = {s.source.source.name for s in symbols if _is_process(s)}
            for name in sorted(names):
                place = f"{type(component).__name__} {component.name!r}"
                yield uqmbd.extend.Finding(
                    uqmbd.extend.Severity.WARNING,
                    place,
                    f"{place} contains the random process {name!r}, and no output reads the stationary response",
                    "Record an output such as stationary_std(...)",
                )


def _parts(expression: Any) -> set[Any]:
    """Return the functions in an expression."""
    found: set[Any] = expression.atoms(sympy.Function) if isinstance(expression, sympy.Basic) else set()
    return found


def _symbols(value: Any) -> set[Any]:
    """Return the symbols in a value of a component."""
    if isinstance(value, (sympy.Basic, sympy.MatrixBase)):
        return set(value.free_symbols)
    return {s for part in value for s in _symbols(part)} if isinstance(value, (tuple, list)) else set()


def _is_process(symbol: Any) -> bool:
    return isinstance(getattr(getattr(symbol, "source", None), "source", None), RandomProcess)
