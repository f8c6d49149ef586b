"""Scalar outputs, which are evaluated at the nodes and projected, because they have no equations of motion."""

from __future__ import annotations

import warnings

import xarray as xr

import uqmbd
from uqmbd.results import Status
from uqmbd.typing import Index

__all__ = ["projected_scalars"]


def projected_scalars(
    propagator: uqmbd.extend.Propagator,
    problem: uqmbd.extend.Problem,
    space: uqmbd.extend.GermSpace,
    terms: Index,
    rule: uqmbd.extend.Quadrature,
    verification: uqmbd.extend.Verification,
    begin: float,
) -> xr.DataTree:
    """Return the node of scalar outputs; raise IntegrationError if too few nodes have values."""
    found = problem.realise(space.to_inputs(rule.nodes))
    psi = space.evaluate(rule.nodes, terms)
    about = (found.status == Status.OK, found.most_frequent_reason(), psi, terms, rule.weights)
    fit = uqmbd.extend.fit_nodes(problem.label, found.response, *about)
    if fit.warning:
        warnings.warn(fit.warning, stacklevel=3)
    chaos = verification.chaos(fit.coefficients, fit.multi_index, problem.labels)
    return problem.node(
        propagator,
        chaos.statistics(),
        realisations=len(rule) + verification.asked,
        wall_time=problem.clock() - begin,
        counters=found.counters,
        children={"chaos": chaos.to_dataset()},
        attrs={
            "failures": fit.failed + verification.failures,
            "failed_share": verification.failed_share([verification], [1.0], len(rule), fit.failed),
            "fit": fit.how or "evaluated at the nodes of the quadrature and projected there",
            "terms": len(fit.multi_index),
            "nodes": len(rule),
            "quadrature": rule.name,
            "verification": len(verification),
        },
    )
