"""The joint distribution of all inputs of a study."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from uqmbd.errors import StudyError
from uqmbd.randomness.variable import RandomVariable

__all__ = ["JointInput"]

Array = NDArray[np.float64]

BLOCK = 1024
"""Rows of dependent inputs that are mapped at once."""


@dataclass(frozen=True)
class JointInput:
    """All random variables of a mechanism, in one order, with their joint distribution.

    Variables of one `random_vector` are dependent; all others are independent.

    Parameters
    ----------
    variables : tuple of RandomVariable
        In the order of the columns of every array of inputs.

    Examples
    --------
    >>> import chaospy, numpy as np, uqmbd
    >>> a = uqmbd.RandomVariable("a", chaospy.Uniform(0, 2)); b = uqmbd.RandomVariable("b", chaospy.Normal(1, 3))
    >>> JointInput.of([b, a]).names
    ('a', 'b')
    >>> JointInput.of([a, b]).from_uniform(np.array([[0.25, 0.5]]))
    array([[0.5, 1. ]])
    """

    variables: tuple[RandomVariable, ...]

    @classmethod
    def of(cls, variables: Iterable[RandomVariable]) -> JointInput:
        """Order variables by name and complete groups of dependent ones.

        Raises
        ------
        uqmbd.StudyError
            If two different variables share a name.
        """
        seen: dict[str, RandomVariable] = {}
        for variable in (member for v in variables for member in v.joint.members()):
            other = seen.setdefault(variable.name, variable)
            if other != variable:
                raise StudyError(
                    f"random variable {variable.name!r} exists twice, as {other.description} and as "
                    f"{variable.description}; every random variable needs a name of its own. "
                    "Use one object wherever the same quantity is meant."
                )
        return cls(tuple(sorted(seen.values(), key=lambda v: v.name)))

    @property
    def names(self) -> tuple[str, ...]:
        """The names, in order."""
        return tuple(v.name for v in self.variables)

    @property
    def units(self) -> tuple[str, ...]:
        """The units, in order."""
        return tuple(v.units for v in self.variables)

    @property
    def descriptions(self) -> tuple[str, ...]:
        """The distributions as text, in order."""
        return tuple(v.description for v in self.variables)

    def __len__(self) -> int:
        return len(self.variables)

    @cached_property
    def means(self) -> Array:
        """Expectations, shape ``(input,)``."""
        return np.array([v.mean for v in self.variables], dtype=float)

    def from_uniform(self, uniform: Array) -> Array:
        """Map independent uniform numbers to inputs by the inverse Rosenblatt transform.

        Parameters
        ----------
        uniform : array, shape (sample, input)
            Numbers in the open interval (0, 1).

        Returns
        -------
        array, shape (sample, input)
            Inputs distributed as declared.  More rows after them do not change the bits of the first ones.

        Raises
        ------
        uqmbd.StudyError
            If the array has another shape.
        """
        uniform = np.asarray(uniform, dtype=float)
        if uniform.ndim != 2 or uniform.shape[1] != len(self):
            raise StudyError(f"uniform numbers have shape {uniform.shape}; expected (samples, {len(self)}).")
        values = np.empty_like(uniform)
        for group in {id(v.joint): v.joint for v in self.variables}.values():
            columns = [self.names.index(name) for name in group.names]
            if len(columns) == 1:
                mapped = np.ravel(group.distribution.inv(uniform[:, columns[0]]))
                # chaospy's discrete distributions invert to a continuous number around each integer
                whole = getattr(group.distribution, "interpret_as_integer", False)
                values[:, columns[0]] = np.rint(mapped) if whole else mapped
            else:
                values[:, columns] = _dependent(group.distribution, uniform[:, columns])
        return values


def _dependent(distribution: Any, uniform: Array) -> Array:
    """Map rows in blocks of one size: matrix products round by the shape and the place in it."""
    values = np.empty_like(uniform)
    for first in range(0, len(uniform), BLOCK):
        part = uniform[first : first + BLOCK]
        padded = np.full((BLOCK, uniform.shape[1]), 0.5)
        padded[: len(part)] = part
        mapped = np.asarray(distribution.inv(padded.T), dtype=float)
        values[first : first + BLOCK] = mapped.reshape(uniform.shape[1], -1).T[: len(part)]
    return values
