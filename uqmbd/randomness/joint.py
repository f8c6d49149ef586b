"""The joint distribution of all inputs of a study."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from uqmbd.errors import StudyError
from uqmbd.names import natural_order
from uqmbd.randomness.distributions import AffineDistribution, is_dependent
from uqmbd.randomness.rosenblatt import in_blocks
from uqmbd.randomness.variable import RandomVariable
from uqmbd.typing import Array

__all__ = ["JointInput"]


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
    >>> JointInput.of([uqmbd.RandomVariable(f"x_{k}", chaospy.Normal(0, 1)) for k in (10, 9, 1)]).names
    ('x_1', 'x_9', 'x_10')
    >>> JointInput.of([a, b]).from_uniform(np.array([[0.25, 0.5]]))
    array([[0.5, 1. ]])
    """

    variables: tuple[RandomVariable, ...]

    @classmethod
    def of(cls, variables: Iterable[RandomVariable]) -> JointInput:
        """Order variables by name (of numbered ones the second before the tenth) and complete groups of dependent ones.

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
        return cls(tuple(sorted(seen.values(), key=lambda v: natural_order(v.name))))

    def replaced(self, variables: Iterable[RandomVariable]) -> JointInput:
        """Return the inputs with others of the same names and units in the place of some.

        Raises
        ------
        uqmbd.StudyError
            If one has a name that there is not, other units, or one that depends on others is replaced without them.

        Examples
        --------
        >>> import chaospy, uqmbd
        >>> a = uqmbd.RandomVariable("a", chaospy.Uniform(0, 2)); b = uqmbd.RandomVariable("b", chaospy.Normal(1, 3))
        >>> JointInput.of([a, b]).replaced([uqmbd.RandomVariable("b", chaospy.Normal(1.5, 0.1))]).means
        array([1. , 1.5])
        """
        given = JointInput.of(variables)
        own = {v.name: v for v in self.variables}
        for new in given.variables:
            if new.name not in own:
                known = ", ".join(map(repr, self.names)) or "none"
                raise StudyError(f"there is no input {new.name!r} to be replaced; the inputs are: {known}.")
            old = own[new.name]
            if new.units != old.units:
                raise StudyError(
                    f"the input {new.name!r} is in {old.units or 'no units'!r}, and what is to replace it in "
                    f"{new.units or 'no units'!r}; expected the same units."
                )
            if missing := sorted(set(old.joint.names) - set(given.names)):
                raise StudyError(
                    f"the input {new.name!r} depends on {missing[0]!r} by its distribution, and is to be replaced "
                    "without it; replace all that depend on each other."
                )
        return JointInput.of({**own, **{v.name: v for v in given.variables}}.values())

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
            if is_dependent(group.distribution):
                values[:, columns] = group.transform.inverse(uniform[:, columns])
                continue
            laws = [AffineDistribution.of(v.distribution) for v in group.members()]
            if any(law.mends for law in laws):
                for column, law in zip(columns, laws, strict=True):
                    quantiles = law.quantile(uniform[:, column])
                    values[:, column] = np.rint(quantiles) if law.discrete else quantiles
            elif len(columns) == 1:
                mapped = np.ravel(group.distribution.inv(uniform[:, columns[0]]))
                # chaospy's discrete distributions invert to a continuous number around each integer
                whole = getattr(group.distribution, "interpret_as_integer", False)
                values[:, columns[0]] = np.rint(mapped) if whole else mapped
            else:
                mapped = in_blocks(group.distribution.inv, uniform[:, columns], 0.5)
                single = np.array([law.discrete for law in laws])
                values[:, columns] = np.where(single, np.rint(mapped), mapped)
        return values
