"""Families of sampled paths of excitations in the equations of a mechanism."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import sympy

from uqmbd.dynamics.equations.block import Instance
from uqmbd.dynamics.equations.layout import ParameterMap
from uqmbd.errors import StudyError
from uqmbd.mechanism import PathSymbol, t
from uqmbd.randomness import RandomVariable
from uqmbd.typing import Array

__all__ = ["PathFamily", "path_families"]


@dataclass(frozen=True)
class PathFamily:
    """Random processes whose paths one input selects together (the key), such as the wind at several points."""

    sources: tuple[Any, ...]
    column: int  # column of the key in the inputs
    parameters: tuple[tuple[int, ...], ...]  # for each source: indices of the model's parameters that select its path
    lines: ParameterMap  # from inputs to slopes, then offsets, of the arguments of all paths, which are linear in time

    def reach(self, values: Array, begin: float, end: float) -> Array:
        """Return the intervals of the arguments (K, 2) for inputs (K, input) between two times, s."""
        slope, offset = np.split(self.lines(values), 2, axis=1)
        ends = np.concatenate([slope * begin + offset, slope * end + offset], axis=1)
        return np.stack([ends.min(axis=1), ends.max(axis=1)], axis=1)


def _addresses(instances: Sequence[Instance], inputs: Sequence[RandomVariable]) -> dict[int, PathSymbol]:
    """Return the paths whose keys are inputs, by the index of the model's parameter that selects the path."""
    found: dict[int, PathSymbol] = {}
    first = 0
    for instance in instances:
        found |= {first + k: path for k, path in instance.paths.items() if path.key in inputs}
        first += len(instance.parameters)
    return found


def path_families(instances: Sequence[Instance], inputs: Sequence[RandomVariable]) -> tuple[PathFamily, ...]:
    """Return the families of paths whose keys are inputs, in the order of the inputs."""
    parameters: dict[PathSymbol, list[int]] = {}
    for k, path in _addresses(instances, inputs).items():
        parameters.setdefault(path, []).append(k)
    arguments: dict[Any, dict[sympy.Expr, None]] = {}
    for instance in instances:
        for coefficient in instance.excitations:
            arguments.setdefault(coefficient.source, {})[coefficient.argument] = None
    found = []
    for column, key in enumerate(inputs):
        paths = sorted((path for path in parameters if path.key == key), key=lambda path: str(path.source.source.name))
        if not paths:
            continue
        names = [path.source.source.name for path in paths]
        if twice := next((name for name in names if names.count(name) > 1), None):
            raise StudyError(f"two different random processes have the name {twice!r}; give each a different name.")
        lines = sorted({x for path in paths for x in arguments[path.source]}, key=str)
        ends = [*(x.diff(t) for x in lines), *(x.subs(t, 0) for x in lines)]
        found.append(
            PathFamily(
                tuple(path.source.source for path in paths),
                column,
                tuple(tuple(parameters[path]) for path in paths),
                ParameterMap.of(ends, inputs),
            )
        )
    return tuple(found)
