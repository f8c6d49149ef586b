"""Mechanism at an operating point: realisations at standard normal variables, with their count and storage.

The module also computes the error of a surrogate of outputs over time.
"""

from __future__ import annotations

import warnings
from collections.abc import Iterable, Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, replace
from typing import Any, ClassVar

import numpy as np
import xarray as xr

import uqmbd
from uqmbd.results import surrogate
from uqmbd.typing import Array, Index
from uqmbd_calibration.inference.blocks import Block

__all__ = ["SearchExhausted", "OperatingPoint", "picked"]


def followed(node: xr.DataTree, outputs: Iterable[str]) -> float:
    """Return the error of a surrogate at its verification realisations, divided by the largest deviation of an output.

    The error is the root mean square over time, for the output with the largest error; infinite if it is unknown.
    """
    worst = 0.0
    for output in outputs:
        chaos = surrogate(node, output)
        if chaos.verification_response is None:
            return np.inf
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            error = np.sqrt(np.mean(uqmbd.extend.errors_over_largest(chaos) ** 2))
        worst = max(worst, float(error) if np.isfinite(error) else np.inf)
    return worst


NARROW = 1e-9
"""Relative width of the distribution that replaces a known value, because methods require a distribution."""


FOLLOWED = 0.05
"""Error of a surrogate, relative to the largest deviation of an output, below which no other method is tried."""


class SearchExhausted(Exception):
    """Error: more realisations are required than remain."""


@dataclass(frozen=True, kw_only=True)
class _NamedPropagator(uqmbd.extend.Propagator):
    """Placeholder for the method of `Study.problem`; the calibration computes realisations without a method."""

    name: ClassVar[str] = "calibration"

    def propagate(self, problem: uqmbd.extend.Problem) -> xr.DataTree:
        """Raise an error, because this class is only a placeholder."""
        raise uqmbd.StudyError(
            f"{problem.label} cannot run as a method of a study; call calibrate(study, record) instead."
        )


class OperatingPoint:
    """Mechanism with known values of some inputs.

    `study`: study at the times of the records; `known`: values of known inputs; `moving`: whether outputs over time are
    needed; `still`: whether scalar outputs are needed; `most`: largest number of realisations; `executor`, `progress`:
    executor of the realisations, and progress display.
    """

    def __init__(
        self,
        study: uqmbd.Study,
        known: Mapping[str, float],
        *,
        moving: bool,
        still: bool,
        most: int,
        executor: Executor | None,
        progress: Any,
    ) -> None:
        self.study, self.known, self.most = study, dict(known), most
        self._executor, self._progress = executor, progress
        requested = study.problem(_NamedPropagator(), executor, progress)
        self._moving = requested if moving else None
        self._still = requested.without_time() if still else None
        self.space = requested.germ_space()
        self._values = {study.mechanism.inputs.names.index(name): value for name, value in known.items()}
        self.points = np.zeros((0, self.space.dimension))
        self.spent = self.failures = 0
        self._over: list[Array] = []
        self._without: list[Array] = []

    @property
    def left(self) -> int:
        """Number of realisations that may still be computed."""
        return self.most - self.spent

    def inputs(self, normals: Array) -> Array:
        """Return the inputs (K, d), in their units, at standard normal variables (K, d)."""
        values = self.space.to_inputs(self.space.from_normal(normals))
        for column, value in self._values.items():
            values[:, column] = value
        return values

    def run(self, normals: Array) -> Index:
        """Compute realisations at standard normal variables (K, d); return their indices (K,).

        Raise SearchExhausted, without any computation, if more than the remaining realisations are required.
        """
        over, without = self._realised(normals)
        self._over.append(over)
        self._without.append(without)
        first = len(self.points)
        self.points = np.concatenate([self.points, normals])
        return np.arange(first, first + len(normals))

    def passing(self, normals: Array, blocks: Sequence[Block]) -> list[Array]:
        """Compute realisations that are counted but not stored; return values (K, n) of each block.

        Raise SearchExhausted under the same condition as `run`.
        """
        over, without = self._realised(normals)
        return [picked(without if block.timeless else over, block) for block in blocks]

    def _realised(self, normals: Array) -> tuple[Array, Array]:
        """Return outputs over time and scalar outputs, each (K, output, time); NaN for failed realisations."""
        if len(normals) > self.left:
            raise SearchExhausted
        inputs = self.inputs(normals)
        found, failed = [], np.zeros(len(normals), dtype=bool)
        for problem in (self._moving, self._still):
            if problem is None:
                found.append(np.zeros((len(normals), 0, 0)))
                continue
            computed = problem.realise(inputs)
            failed |= ~computed.good
            found.append(np.where(computed.good[:, None, None], computed.response, np.nan))
        self.failures += int(np.count_nonzero(failed))
        self.spent += len(normals)
        return found[0], found[1]

    def values(self, rows: Index, blocks: Sequence[Block]) -> list[Array]:
        """Return the values (K, n) of each block for the selected realisations; NaN for failed ones."""
        over, without = np.concatenate(self._over)[rows], np.concatenate(self._without)[rows]
        return [picked(without if block.timeless else over, block) for block in blocks]

    def surrogates(self, methods: Sequence[uqmbd.extend.Propagator], outputs: Sequence[str]) -> list[xr.DataTree]:
        """Return the best surrogate of outputs over time, and the surrogate of scalar outputs by the first method.

        `methods` are tried in order for outputs over time, until the error is small enough; `outputs`: recorded
        outputs over time. Known inputs have a very narrow distribution. The surrogate of outputs over time comes first.
        A surrogate is missing if no output of its kind is needed.
        """
        found: list[xr.DataTree] = []
        if self._moving is not None:
            best, least = None, np.inf
            for method in methods:
                try:
                    node = self._propagated(method)
                except (uqmbd.StudyError, uqmbd.IntegrationError):
                    if best is None:
                        raise
                    # a method can fail after it has computed realisations, for example if it finds no clock
                    self.spent += _expected(method, self.study)
                    continue
                error = followed(node, outputs) if len(methods) > 1 else 0.0
                if best is None or error < least:
                    best, least = node, error
                if least <= FOLLOWED:
                    break
            assert best is not None
            found.append(best)
        if self._still is not None:
            found.append(self._propagated(methods[0], still=True))
        return found

    def _propagated(self, method: uqmbd.extend.Propagator, *, still: bool = False) -> xr.DataTree:
        """Run a method, and count its realisations."""
        inputs = self.study.mechanism.inputs
        if self._values:
            variables = list(inputs.variables)
            for column, value in self._values.items():
                width = NARROW * max(abs(value), abs(float(inputs.means[column])), 1e-30)
                one = variables[column]
                variables[column] = uqmbd.extend.uniform_variable(one.name, value - width, value + width, one.units)
            inputs = type(inputs).of(variables)
        problem = self.study.problem(method, self._executor, self._progress)
        problem = problem.without_time() if still else problem
        node = method.propagate(replace(problem, inputs=inputs, label=f"calibration-{problem.label}"))
        self.spent += int(node.attrs["realisations"])
        return node

    def same(self, other: OperatingPoint) -> bool:
        """Return whether the surrogates of another operating point are valid for this one."""
        first, second = self.study, other.study
        return (
            np.array_equal(first.times, second.times)
            and self.known == other.known
            and (self._moving is None, self._still is None) == (other._moving is None, other._still is None)
            and first.mechanism.inputs.names == second.mechanism.inputs.names
            and first.mechanism.inputs.descriptions == second.mechanism.inputs.descriptions
            and list(first.mechanism.outputs) == list(second.mechanism.outputs)
            and list(first.mechanism.scalars) == list(second.mechanism.scalars)
            and (first.rtol, first.integrator, first.start) == (second.rtol, second.integrator, second.start)
        )


def _expected(method: uqmbd.extend.Propagator, study: uqmbd.Study) -> int:
    """Return the number of realisations that a method is predicted to need."""
    found = method.estimate(study)
    return 0 if found is None else found.realisations


def picked(response: Array, block: Block) -> Array:
    """Return the values (K, n) of a block, from responses (K, output, time)."""
    return np.asarray(response[:, block.row][:, block.columns])
