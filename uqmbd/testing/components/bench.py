"""Test fixture of a component: derived equations with random values of all parameters, in random states."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass
from typing import Any

import numpy as np

from uqmbd.compiled import Kernel, cached
from uqmbd.dynamics import Instance, ParameterMap, derive, instances_of
from uqmbd.testing.components.cases import ComponentCase
from uqmbd.testing.components.motion import random_unit
from uqmbd.typing import Array

__all__ = ["REALISATIONS", "Bench", "norm_rows", "own_coordinates", "random_coordinates"]


REALISATIONS = 3


@dataclass(frozen=True)
class Bench:
    """Fixture of a component: equations for several realisations of the parameters."""

    title: str  # title in messages
    case: ComponentCase  # case with the mechanism
    instance: Instance  # the component as a block
    parameters: ParameterMap  # map from inputs to the parameters of the block
    inputs: Array  # (K, input) random

    @classmethod
    def of(cls, title: str, case: ComponentCase, rng: np.random.Generator) -> Bench:
        """Derive the block of the component."""
        instance = instances_of([case.component], case.mechanism.space)[0]
        joint = case.mechanism.inputs
        uniform = rng.uniform(0.05, 0.95, (REALISATIONS, len(joint)))
        inputs = joint.from_uniform(uniform)
        return cls(title, case, instance, ParameterMap.of(instance.parameters, joint.variables), inputs)

    def kernel(self, kind: str) -> tuple[Kernel, list[Any]]:
        """Compile one kind of equations of the block; return the kernel and the meaning of each result."""
        derived = derive(self.instance.type)

        def make() -> tuple[Kernel, list[Any]]:
            equations = derived.equations(kind)
            arguments = [x for *_, x in derived.arguments(kind)] + derived.p
            return derived.kernel(arguments, equations.expressions), equations.targets

        result: tuple[Kernel, list[Any]] = cached(("check", kind, self.instance.type.digest), make)
        return result

    def state(self, rng: np.random.Generator) -> dict[str, Array]:
        """Return random values (K, count) of all variables, by letter; the values need not satisfy the constraints."""
        counts = Counter(letter for letter, *_ in derive(self.instance.type).arguments("jacobian"))
        found = {letter: rng.normal(size=(REALISATIONS, count)) for letter, count in counts.items()}
        found["q"] = random_coordinates(self.instance, rng, REALISATIONS)
        found["c"] = found["c"] ** 2 + 1
        return found

    def evaluate(self, kind: str, state: dict[str, Array], parameters: Array) -> Array:
        """Return the results of one kind of equations, shape (K, result)."""
        letters = dict.fromkeys(letter for letter, *_ in derive(self.instance.type).arguments(kind))
        arguments = np.concatenate([*(state[letter] for letter in letters), parameters], axis=1)
        return self.kernel(kind)[0](np.ascontiguousarray(arguments))


def random_coordinates(instance: Instance, rng: np.random.Generator, count: int) -> Array:
    """Return random coordinates, shape (count, coordinate): poses of bodies, then coordinates of components."""
    space = instance.type.space
    q = rng.uniform(-1, 1, (count, len(instance.bodies), space.size))
    if space.turns:
        q[..., space.dimension :] = random_unit(rng, q[..., space.dimension :].shape)
    return np.concatenate([q.reshape(count, -1), rng.uniform(-1, 1, (count, own_coordinates(instance)))], axis=1)


def own_coordinates(instance: Instance) -> int:
    """Return the number of coordinates of components, which follow those of the bodies."""
    return sum(len(one.q) for one in instance.sets)


def norm_rows(instance: Instance, q: Array) -> Array:
    """Return the gradients of half the squared lengths of all quaternions, shape (body, coordinate)."""
    space, count = instance.type.space, len(instance.bodies)
    rows = np.zeros((count, len(q)))
    for k in range(count if space.turns else 0):
        part = slice(k * space.size + space.dimension, (k + 1) * space.size)
        rows[k, part] = q[part]
    return rows if space.turns else rows[:0]
