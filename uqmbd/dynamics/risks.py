"""Predict probabilities of random numbers outside their range, before any realisation.

The probability is exact for affine expressions of one independent variable, else a share of `SAMPLES` points.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
import sympy

from uqmbd.dynamics.equations import Limit, ParameterMap, limits_of, signs_of, squares_of
from uqmbd.errors import Finding, Severity
from uqmbd.mechanism import Mechanism, is_tensor_of_body
from uqmbd.randomness import AffineDistribution, JointInput, RandomVariable
from uqmbd.wording import format_percent

__all__ = ["Risk", "range_findings", "find_risks"]

SAMPLES = 10_000
"""Number of evaluation points for expressions of unknown distribution."""

EXPECTED = 0.05
"""Least expected number of affected realisations for a report; below it, 19 of 20 studies have none."""

OFTEN = 1e-4
"""Least probability for a report on a number that must stay in its range, for any number of realisations."""

EFFECTS = {
    "fail": "these fail",
    "sign": "these realisations succeed, but a force that should hold or damp bodies drives them",
    "square": "these realisations succeed, because only the square of the impossible number is used",
}
"""Consequences for realisations with a number outside its range or with a changed sign."""

NAMED = 4
"""Largest number of quantities, and of inputs, in a sentence."""


@dataclass(frozen=True)
class Risk:
    """Risk that a number leaves its range or changes its sign in some realisations."""

    name: str  # quantity and owner, such as "mass of body 'rod'"
    expected: str  # range of the number, such as "0 or more"
    probability: float  # probability that the number is outside the range
    inputs: tuple[RandomVariable, ...]  # random variables in the number
    fails: bool = True  # whether such realisations fail; realisations with a changed sign run
    squared: bool = False
    """Whether a positive number occurs only in even powers, so that its sign has no effect."""

    def counts(self, realisations: int) -> bool:
        """Return whether the risk is reported for a number of planned realisations."""
        often = (self.fails or self.squared) and self.probability > OFTEN
        return often or self.probability * realisations >= EXPECTED


def find_risks(mechanism: Mechanism) -> tuple[Risk, ...]:
    """Find the numbers of a mechanism with a probability above zero of leaving their range.

    Only numbers with random variables are evaluated. Numbers that depend on time or motion are not examined.
    """
    expressions: list[sympy.Expr] = []
    limits, tensors = limits_of(mechanism, expressions)
    signs, squares = signs_of(mechanism, expressions), squares_of(mechanism, expressions)
    found: list[Risk] = []
    others: list[tuple[Limit, dict[str, bool]]] = []
    kinds: tuple[tuple[tuple[Limit, ...], dict[str, bool]], ...]
    kinds = ((limits, {}), (signs, {"fails": False}), (squares, {"fails": False, "squared": True}))
    for limit, kind in ((limit, kind) for some, kind in kinds for limit in some):
        exact = _exact(limit, expressions[limit.index])
        if exact is None:
            others.append((limit, kind))
        elif exact > 0:
            variables = tuple(sorted(expressions[limit.index].free_symbols, key=str))
            found.append(Risk(limit.name, limit.expected, exact, variables, **kind))
    if not others and not tensors:
        return tuple(found)
    inputs = JointInput.of({v for e in expressions for v in e.free_symbols})
    own = {v.name: v for v in inputs.variables}
    values = ParameterMap.of(expressions, inputs.variables)(inputs.from_uniform(_spread(len(inputs))))
    for limit, kind in others:
        share = float(limit.outside(values[:, limit.index]).mean())
        variables = tuple(own[name] for name, _ in limit.inputs)
        found.append(Risk(limit.name, limit.expected, share, variables, **kind))
    for tensor in tensors:
        share = float((~is_tensor_of_body(tensor.moments(values))).mean())
        about = (f"inertia of body {tensor.body!r}", "that of a body", share)
        found.append(Risk(*about, tuple(own[name] for name, _ in tensor.inputs)))
    return tuple(one for one in found if one.probability > 0)


def range_findings(found: tuple[Risk, ...], realisations: int) -> tuple[Finding, ...]:
    """Return findings on risks expected in a number of realisations, at most one for each entry of `EFFECTS`."""
    groups: dict[str, list[Risk]] = {}
    for one in found:
        if one.counts(realisations):
            groups.setdefault("fail" if one.fails else "square" if one.squared else "sign", []).append(one)
    return tuple(_finding(groups[kind], effect) for kind, effect in EFFECTS.items() if kind in groups)


def _finding(found: list[Risk], effect: str) -> Finding:
    """Return a finding on numbers outside their range: share of realisations, consequences, and advice."""
    parts = []
    ordered = sorted(found, key=lambda x: -x.probability)
    for one in ordered[:NAMED]:
        share = f"in {format_percent(one.probability)} of the realisations"
        if one.fails:
            parts.append(f"the {one.name} is outside of its range ({one.expected}) {share}")
        else:
            wrong, usual = ("negative", "positive") if one.expected == "0 or more" else ("positive", "negative")
            parts.append(f"the {one.name} is {wrong} {share}, and {usual} at the means")
    more = [f"{len(found) - NAMED} similar numbers"] if len(found) > NAMED else []
    inputs = {v.name: f"{v.name} = {v.description}" for one in found for v in one.inputs}
    listed = [*list(inputs.values())[:NAMED], *(["..."] if len(inputs) > NAMED else [])]
    return Finding(
        Severity.WARNING,
        "; ".join([*(one.name for one in ordered[:NAMED]), *more]),
        f"{'; '.join([*parts, *more])}: {effect}. The cause is {', '.join(listed)}",
        "Try a distribution within the range of the quantity, such as chaospy.Trunc(...), chaospy.LogNormal or "
        "chaospy.Gamma",
    )


def _exact(limit: Limit, expression: sympy.Expr) -> float | None:
    """Return the probability that an affine expression of one independent variable is out of range; None for others."""
    variables = expression.free_symbols
    if len(variables) != 1:
        return None
    variable: Any = next(iter(variables))
    if len(variable.joint.names) > 1 or not expression.is_polynomial(variable):
        return None
    coefficients = sympy.Poly(expression, variable).all_coeffs()
    law = AffineDistribution.of(variable.distribution)
    if len(coefficients) != 2 or law.discrete:
        return None
    slope, offset = (float(x) for x in coefficients)
    ends = sorted((end - offset) / slope for end in (limit.minimum, limit.maximum))
    below, above = (float(law.cdf(np.array([end]))[0]) if math.isfinite(end) else float(end > 0) for end in ends)
    return below + 1.0 - above


def _spread(dimension: int) -> np.ndarray:
    """Return points (`SAMPLES`, dimension) of a Latin hypercube, in the middle of their strata."""
    rng = np.random.default_rng(0)
    columns = [rng.permutation(SAMPLES) for _ in range(dimension)]
    return (np.stack(columns, axis=1) + 0.5) / SAMPLES
