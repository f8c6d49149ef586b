"""Check the random inputs of a study: their existence, their use, and the existence of moments."""

from __future__ import annotations

import warnings
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import sympy

from uqmbd.arguments import typechecked
from uqmbd.isolation import ERRORS_AND_EXITS, Isolated
from uqmbd.mechanism import StateSymbol, as_symbolic, random_variables, t
from uqmbd.propagation.execution import Kind, compute_chunk
from uqmbd.randomness import JointInput, RandomVariable, exists, moment_orders
from uqmbd.results.schema import InputInfo, with_reasons
from uqmbd.status import Status
from uqmbd.typing import Array

if TYPE_CHECKING:
    import xarray as xr

    from uqmbd.dynamics import Model
    from uqmbd.mechanism import Mechanism

__all__ = [
    "POINTS",
    "Existence",
    "affordable",
    "existence_of",
    "grows",
    "input_info",
    "unused_inputs",
    "nothing_random",
]


@typechecked
def nothing_random(inputs: JointInput, mechanism: str) -> str | None:
    """Return a message that a method without random inputs cannot run; None if there are random inputs.

    Parameters
    ----------
    inputs : JointInput
        Inputs of the mechanism.
    mechanism : str
        Name of the mechanism.

    Examples
    --------
    >>> import uqmbd
    >>> mechanism = uqmbd.Mechanism("stone", uqmbd.Line())
    >>> print(uqmbd.extend.nothing_random(mechanism.inputs, mechanism.name))
    mechanism 'stone' has no random variables; declare a uqmbd.RandomVariable, or use uqmbd.simulate
    """
    if len(inputs):
        return None
    return f"mechanism {mechanism!r} has no random variables; declare a uqmbd.RandomVariable, or use uqmbd.simulate"


def input_info(variable: RandomVariable) -> InputInfo:
    """Return the labels of a random variable in results."""
    return InputInfo(variable.name, variable.units, variable.description, variable.is_key)


AT_LEAST = 8
"""Number of realisations that are always affordable: together they take hardly more time than a single one."""

SHARE = 20
"""Ratio of the planned realisations of a method to the largest affordable number, above `AT_LEAST` realisations."""

POINTS = 6
"""Number of further points at which an input without effect at the first point is changed: events may be rare."""

FAR = 1e-6
"""Probability of the two extreme quantiles that replace the first two values: rare events often occur there."""

SAME = 1e-12
"""Relative difference up to which outputs are equal, with respect to their largest value over time."""


def affordable(inputs: int, planned: int) -> bool:
    """Return whether the number of planned realisations justifies the search for unused inputs.

    >>> affordable(7, 10), affordable(20, 400), affordable(20, 420)
    (True, False, True)
    """
    return 0 < inputs < max(AT_LEAST, planned // SHARE)


def unused_inputs(model: Model, inputs: JointInput, times: Array, rtol: float, integrator: str) -> tuple[str, ...]:
    """Return the names of inputs on which no output (over time or scalar) and no requirement depends.

    Each input is changed separately at one point. Inputs without effect are then changed at `POINTS` further points.
    Failed realisations count as different, so the function does not report such an input.
    """
    size, everything = len(inputs), list(range(len(inputs)))
    kind: Kind = "outputs" if model.outputs.names else "scalars" if model.scalars is not None else "requirements"

    def unchanged(candidates: list[int], points: Array, others: Array) -> list[int]:
        """Return the inputs whose change from `points` (K, input) to `others` has no effect at any point."""
        rows = [points]
        for k in candidates:
            moved = points.copy()
            moved[:, k] = others[:, k]
            rows.append(moved)
        chunk = compute_chunk(model, inputs.from_uniform(np.concatenate(rows)), times, rtol, integrator, kind)
        seen, status = [chunk.response], chunk.status
        if chunk.scalars is not None:
            seen.append(chunk.scalars.values[:, :, None])
            status = np.maximum(status, np.where(chunk.scalars.status == Status.CENSORED, 0, chunk.scalars.status))
        if chunk.margins is not None:
            seen.append(chunk.margins.values[:, :, None])
            status = np.maximum(status, chunk.margins.status)
        first, *changed = np.arange(len(status)).reshape(len(rows), len(points))
        return [
            k
            for k, row in zip(candidates, changed, strict=True)
            if not status[first].any() and not status[row].any() and all(_same(x[first], x[row]) for x in seen)
        ]

    found: list[int] = []
    with Isolated(*ERRORS_AND_EXITS), warnings.catch_warnings():
        # the methods report these warnings
        warnings.simplefilter("ignore")
        candidates = unchanged(everything, np.full((1, size), 0.3819660113), np.full((1, size), 0.7236067977))
        if candidates:
            points, others = np.random.default_rng(0).uniform(0.01, 0.99, (2, POINTS, size))
            others[:2] = [[FAR], [1 - FAR]]
            found = unchanged(candidates, points, others)
    return tuple(inputs.names[k] for k in found)


def _same(one: Array, other: Array) -> bool:
    """Return whether outputs (K, output, T) agree except for rounding; outputs that occur in neither also agree."""
    if not one.size:
        return True
    with np.errstate(invalid="ignore"):
        largest = np.abs(one).max(axis=-1, keepdims=True)
        return bool(
            ((np.abs(other - one) <= SAME * largest) | (np.isnan(one) & np.isnan(other)) | (one == other)).all()
        )


NEEDS = {
    "mean": 1, "std": 2, "variance": 2, "std_error_mean": 2, "variance_reduction": 2,
    "skewness": 3, "kurtosis": 4, "std_error_std": 4, "variance_reduction_std": 4,
}  # fmt: skip
"""Statistic -> order of the moment that it requires; Sobol' indices require the variance."""

BOUNDED: tuple[type[sympy.Basic], ...] = (
    sympy.sin, sympy.cos, sympy.tanh, sympy.atan, sympy.acot, sympy.asin, sympy.acos, sympy.atan2, sympy.erf,
    sympy.sign, sympy.Heaviside,
)  # fmt: skip
"""Functions with bounded values for every argument."""

NAMED = 4
"""Maximum number of outputs in a sentence."""


@dataclass(frozen=True)
class Existence:
    """Orders up to which the moments of outputs exist."""

    orders: Mapping[str, float]  # output -> order below which its moments are finite; no entry if all are finite
    causes: Mapping[str, str]  # output -> name of the input with the heavy tail
    descriptions: Mapping[str, str]  # input -> its distribution as text

    def without(self, names: Collection[str]) -> Existence:
        """Return the orders for the case that the named inputs have other distributions with existing moments."""
        kept = [output for output, cause in self.causes.items() if cause not in names]
        return Existence({x: self.orders[x] for x in kept}, {x: self.causes[x] for x in kept}, self.descriptions)

    def applied(self, statistics: xr.Dataset) -> tuple[xr.Dataset, tuple[str, ...]]:
        """Return statistics with NaN for moments that do not exist, and a sentence for each responsible input."""
        names = [str(name) for name in statistics["output"].values]
        orders = np.array([self.orders.get(name, np.inf) for name in names])
        if not np.isfinite(orders).any():
            return statistics, ()
        kept = statistics.copy()
        for variable in statistics.data_vars:
            needed = 2 if str(variable).startswith("sobol_") else NEEDS.get(str(variable))
            if needed is None or "output" not in statistics[variable].dims:
                continue
            missing = [name for name, order in zip(names, orders, strict=True) if not exists(needed, order)]
            if missing:
                values = statistics[variable]
                note = f"does not exist for {', '.join(missing)}: {_blamed(self.causes[n] for n in missing)}"
                kept[variable] = values.where(~values["output"].isin(missing))
                comment = "; ".join(filter(None, (values.attrs.get("comment", ""), note)))
                kept[variable].attrs = {**values.attrs, "comment": comment}
                reasons = {name: f"it does not exist: {_blamed([self.causes[name]])}" for name in missing}
                kept[variable] = with_reasons(kept[variable], reasons)
        return kept, self.sentences(names)

    def sentences(self, names: Sequence[str]) -> tuple[str, ...]:
        """List the non-existent moments of these outputs, one sentence for each responsible input."""
        causes = dict.fromkeys(self.causes[name] for name in names if name in self.orders)
        return tuple(self._sentence(cause, names) for cause in causes)

    def _sentence(self, cause: str, names: Sequence[str]) -> str:
        hit = [name for name in names if self.causes.get(name) == cause]
        order = self.orders[hit[0]]
        words = ("mean", "standard deviation", "skewness", "kurtosis")
        missing = [word for k, word in enumerate(words, start=1) if not exists(k, order)]
        listed = ", ".join(map(repr, hit[:NAMED])) + (f" and {len(hit) - NAMED} more" if len(hit) > NAMED else "")
        which = " and ".join(filter(None, (", ".join(missing[:-1]), missing[-1])))
        outputs, verb = "output" if len(hit) == 1 else "outputs", "does" if len(missing) == 1 else "do"
        return (
            f"the {which} of {outputs} {listed} {verb} not exist, unless the output is a bounded function of input "
            f"{cause!r}: moments of {self.descriptions[cause]} are infinite from order {order:.3g} on. These results "
            "are NaN, and so are errors that depend on them; quantiles are valid. For finite moments, truncate the "
            "input: chaospy.Trunc(distribution, lower, upper)"
        )


def existence_of(mechanism: Mechanism) -> Existence:
    """Find the outputs with non-existent moments.

    The check assumes that every output grows at most linearly with every input that affects the motion. Exceptions are
    expressions that are bounded for every motion: orientations and bounded functions. An input that affects no motion
    is checked for the outputs that contain it.
    """
    inputs = mechanism.inputs
    heavy = {name: order for name, order in moment_orders(inputs.variables).items() if not exists(4, order)}
    if not heavy:
        return Existence({}, {}, {})
    moving = {v.name for v in mechanism.moving_inputs()}
    orders: dict[str, float] = {}
    causes: dict[str, str] = {}
    for output in (*mechanism.outputs.values(), *mechanism.scalars.values()):
        own = {v.name for v in random_variables(output.expression) if grows(output.expression, v)}
        reached = own | (moving if grows(output.expression) else set())
        found = sorted((heavy[name], name) for name in reached & heavy.keys())
        if found:
            orders[output.name], causes[output.name] = found[0]
    return Existence(orders, causes, dict(zip(inputs.names, inputs.descriptions, strict=True)))


def grows(expression: Any, variable: RandomVariable | None = None) -> bool:
    """Return whether an expression may be unbounded as a function of a random variable, or (None) of the motion."""
    value = as_symbolic(expression)
    if isinstance(value, BOUNDED) or not value.free_symbols or value == t:
        return False
    if isinstance(value, RandomVariable):
        return value == variable
    if isinstance(value, StateSymbol):
        space = getattr(value.owner, "space", None)  # coordinates of components have no space
        turning = value.quantity == "q" and space is not None and value.index >= space.dimension
        return variable is None and not turning
    if isinstance(value, (sympy.Add, sympy.Mul, sympy.Max, sympy.Min, sympy.Abs)):
        return any(grows(part, variable) for part in value.args)
    if isinstance(value, sympy.Pow) and value.exp.is_number and value.exp.is_nonnegative:
        return grows(value.base, variable)
    return value.has(variable) if variable is not None else bool(value.free_symbols - random_variables(value))


def _blamed(causes: Any) -> str:
    return "heavy tail of " + ", ".join(dict.fromkeys(causes))
