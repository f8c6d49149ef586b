"""Cheap studies whose outputs are known functions of the inputs, and a propagator that trains a surrogate."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

import chaospy
import numpy as np
import pytest
import sympy

import uqmbd
from uqmbd.extend import project
from uqmbd.randomness import GermSpace, index_set
from uqmbd.randomness.quadrature.rules import gauss_tensor
from uqmbd.results import PolynomialChaos


def resting(outputs: dict[str, sympy.Expr | None], times: Sequence[float] = (0.0, 1.0)) -> uqmbd.Study:
    """A study of a body that rests, with outputs that are functions of random variables, or (None) its fixed place."""
    mechanism = uqmbd.Mechanism("rest", uqmbd.Translational(gravity=(0, 0)))
    stone = mechanism.body("stone", mass=1, position=(2.5, 0), velocity=(0, 0))
    for name, expression in outputs.items():
        mechanism.output(name, stone.position[0] if expression is None else expression)
    return uqmbd.Study("rest", mechanism, times)


@dataclass(frozen=True, kw_only=True)
class Quadrature(uqmbd.extend.Propagator):
    """Pseudo-spectral projection on a tensor Gauss rule: the least that gives a chaos."""

    name: ClassVar[str] = "quadrature"
    order: int = 1
    nodes: int = 4
    chaos: bool = True

    def fit(self, problem: uqmbd.extend.Problem) -> tuple[PolynomialChaos, uqmbd.extend.Realisations]:
        space = GermSpace.of(problem.inputs)
        rule = gauss_tensor(space, self.nodes)
        found = problem.realise(space.to_inputs(rule.nodes))
        index = index_set(len(problem.inputs), self.order)
        coefficients = project(found.response, space.evaluate(rule.nodes, index), rule.weights)
        return PolynomialChaos(coefficients, index, space, problem.labels), found

    def propagate(self, problem):
        chaos, found = self.fit(problem)
        return problem.node(
            self,
            chaos.statistics(samples=256),
            realisations=len(found.status),
            wall_time=found.wall_time,
            counters=found.counters,
            children={"chaos": chaos.to_dataset()} if self.chaos else {},
        )


@pytest.fixture(scope="session")
def curved() -> uqmbd.Study:
    """Outputs: one that is skewed and has an interaction, one that is linear, and one that does not vary."""
    a = uqmbd.RandomVariable("a", chaospy.Normal(1.0, 0.2))
    b = uqmbd.RandomVariable("b", chaospy.Uniform(-1.0, 1.0))
    return resting({"skewed": sympy.exp(a) + a * b / 2, "linear": 3 + a - b, "fixed": None})


@pytest.fixture(scope="session")
def curved_truth() -> dict[str, tuple[float, float]]:
    """Means and standard deviations, by a Gauss rule that is exact to rounding."""
    x, w = np.polynomial.hermite_e.hermegauss(40)
    y, v = np.polynomial.legendre.leggauss(5)
    a, b, weight = 1 + 0.2 * x[:, None], y[None], np.outer(w / w.sum(), v / 2)
    truth = {}
    for name, values in {"skewed": np.exp(a) + a * b / 2, "linear": 3 + a - b}.items():
        mean = float((weight * values).sum())
        truth[name] = (mean, float(np.sqrt((weight * (values - mean) ** 2).sum())))
    return truth
