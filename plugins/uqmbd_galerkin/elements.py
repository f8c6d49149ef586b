"""Multi-element Galerkin: the equations of motion projected within each box of the germ space, solved one by one."""

from __future__ import annotations

import json
import math
import warnings
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

import uqmbd
from uqmbd.results import PolynomialChaos, Status
from uqmbd.typing import Array, Index
from uqmbd_galerkin.ending import DOUBTFUL, finished, padded
from uqmbd_galerkin.rules import basis, quadrature
from uqmbd_galerkin.scalars import expand
from uqmbd_galerkin.verification import horizons, verification_points

if TYPE_CHECKING:
    from uqmbd_galerkin.propagator import Galerkin

__all__ = ["galerkin_elements", "solve_element"]


FEWEST = 3
"""Verification realisations that every element gets, however improbable."""


def solve_element(
    model: Any,
    values: Array,
    psi: Array,
    weights: Array,
    times: Array,
    rtol: float,
    integrator: str,
    linear_solver: str,
) -> dict[str, NDArray[Any]]:
    """Solve the projected equations of one element; for workers.

    Parameters
    ----------
    model
        Equations and outputs.
    values : array, shape (K, input)
        Inputs at the nodes.
    psi : array, shape (K, P)
        The local basis there.
    weights : array, shape (K,)
        Of the nodes.
    times : array, shape (T,)
        s.
    rtol : float
        Relative tolerance.
    integrator, linear_solver : str
        As for `uqmbd.ProjectedEnsemble.integrate`.

    Returns
    -------
    dict
        ``coefficients`` (P, O, T) of the outputs, with fewer times where the motion ended early; texts ``message``,
        ``integrator``, ``counters`` (JSON); the number of ``unknowns``.
    """
    ensemble = uqmbd.Ensemble(model, values)
    projected = uqmbd.ProjectedEnsemble(ensemble, psi, weights)
    found = projected.integrate(times, rtol, integrator, linear_solver)
    count = finished(found.coefficients)
    response = ensemble.outputs(times[:count], projected.nodal(found.coefficients[:, :count]))
    return {
        "coefficients": projected.project(response),
        "message": np.array(found.message),
        "integrator": np.array(found.integrator),
        "counters": np.array(json.dumps({k: float(v) for k, v in found.counters.items()})),
        "unknowns": np.array(projected.unknowns),
    }


@dataclass
class _Elements:
    """All elements that were computed, replaced ones too, in that order."""

    options: Galerkin
    problem: uqmbd.Problem
    nodes: list[int] = field(default_factory=list)
    verified: list[tuple[int, int]] = field(default_factory=list)
    messages: list[str] = field(default_factory=list)
    integrators: list[str] = field(default_factory=list)
    counters: Counter[str] = field(default_factory=Counter)
    failed: list[int] = field(default_factory=list)
    unknowns: int = 0
    terms: int = 0

    def compute(self, boxes: Sequence[uqmbd.GermBox]) -> list[PolynomialChaos]:
        """Solve each box, and compute the verification realisations of all together."""
        options, problem = self.options, self.problem
        how = (options.integrator or problem.integrator, options.linear_solver)
        points, bases, tasks = [], [], []
        for number, box in enumerate(boxes, start=len(self.nodes)):
            terms = basis(options, box.local)
            rule = quadrature(options, problem.label, box.local, terms)
            psi = box.local.evaluate(rule.nodes, terms)
            tasks.append((box.space.to_inputs(rule.nodes), psi, rule.weights, problem.times, problem.rtol, *how))
            count = max(FEWEST, math.ceil(options.verify * box.probability)) if options.verify else 0
            seed = int(np.random.SeedSequence([options.seed, number]).generate_state(1)[0])
            points.append(verification_points(box.local, count, seed))
            bases.append(terms)
        together = np.concatenate(points)
        known = problem.realise(boxes[0].space.to_inputs(together)) if len(together) else None
        chaoses, start = [], 0
        results = self._values(bases, tasks) if problem.timeless else problem.run(solve_element, tasks)
        for box, germs, terms, task in zip(boxes, points, bases, tasks, strict=True):
            try:
                found = next(results)
            except uqmbd.AssemblyError as error:
                raise uqmbd.AssemblyError(
                    f"{problem.label}: {str(error).rstrip('.')}. An expansion needs a motion at every node: truncate "
                    "the distributions, or use Monte Carlo, which counts such samples."
                ) from None
            count = found["coefficients"].shape[2]
            labels = problem.labels
            labels = labels if count == len(problem.times) else replace(labels, times=problem.times[:count])
            good, response = np.zeros(0, dtype=np.int64), None
            if known is not None:
                own = slice(start, start + len(germs))
                fine = np.isfinite(known.response[own]).all(axis=(1, 2)) & (known.status[own] == Status.OK)
                good = np.flatnonzero(fine)
                response = known.response[own][good][:, :, :count]
            start += len(germs)
            chaoses.append(
                PolynomialChaos(
                    found["coefficients"],
                    found.get("terms", terms),
                    box.local,
                    labels,
                    verification_germs=germs[good] if len(good) else None,
                    verification_response=response if len(good) else None,
                )
            )
            self.nodes.append(len(task[2]))
            self.verified.append((len(good), len(germs)))
            self.messages.append(str(found["message"]))
            self.integrators.append(str(found["integrator"]))
            self.counters.update(json.loads(str(found["counters"])))
            self.unknowns = max(self.unknowns, int(found["unknowns"]))
            self.terms = max(self.terms, found["coefficients"].shape[0])
            self.failed.append(int(found.get("failed", 0)))
            problem.progress.advance(problem.label)
        return chaoses

    def _values(self, bases: list[Index], tasks: list[tuple[Any, ...]]) -> Iterator[dict[str, NDArray[Any]]]:
        """Expand outputs without a time, which no equations of motion give, from realisations at the nodes."""
        found = self.problem.realise(np.concatenate([task[0] for task in tasks]))
        counters, start = found.counters, 0
        for terms, (values, psi, weights, *_) in zip(bases, tasks, strict=True):
            own = slice(start, start + len(values))
            start += len(values)
            part = expand(
                self.problem.label,
                found.response[own],
                found.status[own],
                found.most_frequent_reason(),
                psi,
                terms,
                weights,
            )
            yield {
                "coefficients": part.coefficients,
                "terms": part.terms,
                "failed": np.array(part.failed),
                "message": np.array(found.most_frequent_reason() if part.failed else ""),
                "integrator": np.array(""),
                "counters": np.array(json.dumps({k: float(v) for k, v in counters.items()})),
                "unknowns": np.array(0),
            }
            counters = {}


def galerkin_elements(options: Galerkin, problem: uqmbd.Problem, space: uqmbd.GermSpace, begin: float) -> xr.DataTree:
    """Split the germ space where it is needed, and summarise.

    Parameters
    ----------
    options : Galerkin
        The propagator.
    problem : uqmbd.Problem
        What to compute.
    space : uqmbd.GermSpace
        Of the inputs.
    begin : float
        When the work began, on the problem's clock.
    """
    limits = uqmbd.ElementLimits(options.elements or 1, options.max_elements, options.threshold)
    quiet = replace(problem, progress=_Quiet(problem.progress))
    problem.progress.start(problem.label, 2 * limits.count - 1)
    work = _Elements(options, quiet)
    refined = uqmbd.refine_elements(space, work.compute, limits, label=problem.label, rtol=problem.rtol)
    problem.progress.finish(problem.label)
    chaos = refined.chaos
    assert chaos.labels.times is not None
    count = len(chaos.labels.times)
    kept = refined.kept
    failures = sum(work.verified[k][1] - work.verified[k][0] for k in kept)
    without = sum(work.failed[k] for k in kept)
    if without:
        reason = next(work.messages[k] for k in kept if work.failed[k])
        warnings.warn(
            f"{problem.label}: {without} of {sum(work.nodes[k] for k in kept)} nodes failed, so that the quadrature of "
            f"their elements does not hold; there the others are fitted by regression. Reason of the failure: {reason}",
            stacklevel=3,
        )
    remedy = "allow more elements, raise the order, use collocation with elements, or study a shorter time"
    if count < len(problem.times):
        reason = next((work.messages[k] for k in kept if work.messages[k]), "")
        warnings.warn(
            f"{problem.label}: the projected motion of an element ended, results are given up to "
            f"t = {chaos.labels.times[-1]:.6g} s of {problem.times[-1]:g} s: {reason} To go further, {remedy}.",
            stacklevel=3,
        )
    doubtful = horizons(chaos, DOUBTFUL, problem.rtol)
    if doubtful:
        listed = ", ".join(f"{name!r} from t = {time:.6g} s on" for name, time in doubtful.items())
        warnings.warn(
            f"{problem.label}: the stated error passes {DOUBTFUL:.0%} of the standard deviation with {len(kept)} "
            f"elements, in {listed}; do not trust it from there on: {remedy}.",
            stacklevel=3,
        )
    return problem.node(
        options,
        padded(chaos.statistics(), problem.times),
        realisations=sum(work.nodes) + sum(total for _, total in work.verified),
        wall_time=problem.clock() - begin,
        counters=dict(work.counters),
        children={"chaos": chaos.to_dataset(), "elements": refined.steps},
        attrs={
            "failures": failures + without,
            "terms": work.terms,
            "nodes": sum(work.nodes[k] for k in kept),
            "unknowns": work.unknowns,
            "quadrature": f"{work.nodes[0]} nodes in each of {len(kept)} elements",
            **(
                {}
                if problem.timeless
                else {"integrated_by": ", ".join(dict.fromkeys(work.integrators[k] for k in kept))}
            ),
            "verification": sum(work.verified[k][0] for k in kept),
            "elements": len(kept),
            "elements_computed": refined.computed,
            "threshold_met": str(refined.met),
            **({} if count == len(problem.times) else {"ends_at": float(problem.times[count - 1])}),
        },
    )


@dataclass
class _Quiet:
    """Progress of elements alone: what single realisations tell is left out."""

    inner: uqmbd.Progress
    depth: int = 0

    def start(self, label: str, total: int) -> None:
        """Say nothing until the realisations are done."""
        self.depth += 1

    def advance(self, label: str, count: int = 1) -> None:
        """Pass on what is no realisation."""
        if not self.depth:
            self.inner.advance(label, count)

    def finish(self, label: str) -> None:
        """Listen again."""
        self.depth -= 1
