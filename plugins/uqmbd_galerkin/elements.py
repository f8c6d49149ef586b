"""Multi-element Galerkin: projected equations of motion in each box of the germ space, solved separately."""

from __future__ import annotations

import json
import warnings
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

import uqmbd
from uqmbd.results import PolynomialChaos, Status
from uqmbd.typing import Array, Index
from uqmbd_galerkin.ending import finished, no_motion, padded
from uqmbd_galerkin.rules import STREAM, Discretisation

__all__ = ["galerkin_elements", "solve_element"]


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
    """Solve the projected equations of one element in a worker.

    `psi` (K, P): local basis at the inputs (K, input). The result contains ``coefficients`` (P, O, T) of the outputs,
    at fewer times if the motion ended early. Further entries are the texts ``message``, ``integrator`` and ``counters``
    (JSON), and the number of ``unknowns``.
    """
    ensemble = uqmbd.extend.Ensemble(model, values)
    projected = uqmbd.extend.ProjectedEnsemble(ensemble, psi, weights)
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
class _GalerkinElements:
    """All computed elements in order of computation, including replaced ones."""

    problem: uqmbd.extend.Problem
    discretisation: Discretisation
    integrator: str
    linear_solver: str
    verify: int
    nodes: list[int] = field(default_factory=list)
    verified: list[uqmbd.extend.Verification] = field(default_factory=list)
    messages: list[str] = field(default_factory=list)
    integrators: list[str] = field(default_factory=list)
    counters: Counter[str] = field(default_factory=Counter)
    failed: list[int] = field(default_factory=list)
    unknowns: int = 0
    terms: int = 0

    def compute(self, boxes: Sequence[uqmbd.extend.GermBox]) -> list[PolynomialChaos]:
        """Solve each box, compute the verification realisations of all boxes together, and return the fits."""
        problem = self.problem
        how = (problem.times, problem.rtol, self.integrator, self.linear_solver)
        points = uqmbd.extend.VerificationPoints.of_elements(
            boxes, len(self.nodes), self.verify, self.discretisation.seed, STREAM
        )
        bases, tasks = [], []
        for box in boxes:
            terms = self.discretisation.basis(box.local)
            rule = self.discretisation.quadrature(box.local, terms)
            psi = box.local.evaluate(rule.nodes, terms)
            tasks.append((box.space.to_inputs(rule.nodes), psi, rule.weights, *how))
            bases.append(terms)
        known = problem.realise(boxes[0].space.to_inputs(np.concatenate([own.germs for own in points])))
        chaoses, start = [], 0
        results = self._values(bases, tasks) if problem.timeless else problem.run(solve_element, tasks)
        if not problem.timeless:  # realisations at nodes report their progress separately
            problem.progress.start(problem.label, sum(len(task[2]) for task in tasks))
        for box, own, terms, task in zip(boxes, points, bases, tasks, strict=True):
            try:
                found = next(results)
            except uqmbd.AssemblyError as error:
                raise no_motion(problem.label, error) from None
            verified = uqmbd.extend.Verification.of(box.local, own, known[start : start + len(own)])
            start += len(own)
            chaoses.append(verified.chaos(found["coefficients"], found.get("terms", terms), problem.labels))
            self.nodes.append(len(task[2]))
            self.verified.append(verified)
            self.messages.append(str(found["message"]))
            self.integrators.append(str(found["integrator"]))
            self.counters.update(json.loads(str(found["counters"])))
            self.unknowns = max(self.unknowns, int(found["unknowns"]))
            self.terms = max(self.terms, found["coefficients"].shape[0])
            self.failed.append(int(found.get("failed", 0)))
            if not problem.timeless:
                problem.progress.advance(problem.label, len(task[2]))
        return chaoses

    def _values(self, bases: list[Index], tasks: list[tuple[Any, ...]]) -> Iterator[dict[str, NDArray[Any]]]:
        """Expand scalar outputs, which have no equations of motion, from realisations at the nodes."""
        found = self.problem.realise(np.concatenate([task[0] for task in tasks]))
        counters, start = found.counters, 0
        for terms, (values, psi, weights, *_) in zip(bases, tasks, strict=True):
            own = slice(start, start + len(values))
            start += len(values)
            reason = found.most_frequent_reason()
            about = (found.status[own] == Status.OK, reason, psi, terms, weights)
            part = uqmbd.extend.fit_nodes(self.problem.label, found.response[own], *about)
            yield {
                "coefficients": part.coefficients,
                "terms": part.multi_index,
                "failed": np.array(part.failed),
                "message": np.array(reason if part.failed else ""),
                "integrator": np.array(""),
                "counters": np.array(json.dumps({k: float(v) for k, v in counters.items()})),
                "unknowns": np.array(0),
            }
            counters = {}


def galerkin_elements(
    propagator: uqmbd.extend.Propagator,
    problem: uqmbd.extend.Problem,
    space: uqmbd.extend.GermSpace,
    limits: uqmbd.extend.ElementLimits,
    how: tuple[Discretisation, str, str, int],
    begin: float,
) -> xr.DataTree:
    """Split the germ space where the error requires it, and return the node.

    `how`: basis and quadrature, integrator, linear solver, and number of verification realisations.
    """
    work = _GalerkinElements(problem, *how)
    refined = uqmbd.extend.refine_elements(space, work.compute, limits, label=problem.label, rtol=problem.rtol)
    problem.progress.finish(problem.label)
    chaos = refined.chaos
    assert chaos.labels.times is not None
    count = len(chaos.labels.times)
    kept = refined.kept
    failures = sum(work.verified[k].failures for k in kept)
    without = sum(work.failed[k] for k in kept)
    if without:
        reason = next(work.messages[k] for k in kept if work.failed[k])
        warnings.warn(
            f"{problem.label}: {without} of {sum(work.nodes[k] for k in kept)} nodes failed. Elements with failed "
            "nodes cannot use quadrature; they are fitted to their successful nodes by regression. Reason of the "
            f"failure: {reason}",
            stacklevel=3,
        )
    remedy = "or use collocation with elements, to obtain later times; or end the study at this time"
    if count < len(problem.times):
        reason = next((work.messages[k] for k in kept if work.messages[k]), "")
        warnings.warn(
            f"{problem.label}: the integration of an element ended early; results end at t = "
            f"{chaos.labels.times[-1]:.6g} s of {problem.times[-1]:g} s. Reason: {reason} "
            f"Increase max_elements, raise the order, {remedy}.",
            stacklevel=3,
        )
    return problem.node(
        propagator,
        padded(chaos.statistics(), problem.times),
        realisations=sum(work.nodes) + sum(one.asked for one in work.verified),
        wall_time=problem.clock() - begin,
        counters=dict(work.counters),
        children={"chaos": chaos.to_dataset(), "elements": refined.steps},
        attrs={
            "failures": failures + without,
            "failed_share": uqmbd.extend.Verification.failed_share(
                [work.verified[k] for k in kept],
                [box.probability for box in chaos.boxes],
                sum(work.nodes[k] for k in kept),
                without,
            ),
            "terms": work.terms,
            "nodes": sum(work.nodes[k] for k in kept),
            "unknowns": work.unknowns,
            "quadrature": f"{work.nodes[0]} nodes in each of {len(kept)} elements",
            **(
                {}
                if problem.timeless
                else {"integrated_by": ", ".join(dict.fromkeys(work.integrators[k] for k in kept))}
            ),
            "verification": sum(len(work.verified[k]) for k in kept),
            "elements": len(kept),
            "elements_computed": refined.computed,
            "threshold_met": str(refined.met),
            **({} if count == len(problem.times) else {"ends_at": float(problem.times[count - 1])}),
        },
    )
