"""Outputs without a time: no equations of motion to project, so they are evaluated at the nodes and projected there."""

from __future__ import annotations

import warnings
from dataclasses import dataclass

import numpy as np
import xarray as xr

import uqmbd
from uqmbd.results import Status, project, regress_on_nodes
from uqmbd.typing import Array, Index

__all__ = ["Expansion", "expand", "projected_scalars"]


MOST_FAILURES = 0.5
"""Share of nodes without a value beyond which there is nothing to fit: their region is no exception."""


@dataclass(frozen=True, eq=False)
class Expansion:
    """Coefficients of outputs without a time, and how they were found.

    Attributes
    ----------
    coefficients : array, shape (P, O, 1)
        In the units of the outputs.
    terms : array of int, shape (P, d)
        Degrees.
    failed : int
        Nodes without a value.
    how : str
        In words.
    """

    coefficients: Array
    terms: Index
    failed: int
    how: str


def expand(
    label: str, response: Array, status: Index, reason: str, psi: Array, terms: Index, weights: Array
) -> Expansion:
    """Project values at nodes; where nodes have none (an event that does not happen) fit the others.

    Parameters
    ----------
    label : str
        Of the propagator.
    response : array, shape (K, O, 1)
        Values at the nodes.
    status : array of int, shape (K,)
        0 where there is a value.
    reason : str
        Why there is none, in the words of the most frequent failure.
    psi : array, shape (K, P)
        The basis at the nodes.
    terms : array of int, shape (P, d)
        Its degrees.
    weights : array, shape (K,)
        Of the nodes.

    Raises
    ------
    uqmbd.IntegrationError
        If too few nodes have values.
    """
    good = np.flatnonzero(status == Status.OK)
    failed = len(status) - len(good)
    if not failed:
        how = "evaluated at the nodes of the quadrature and projected there"
        return Expansion(project(response, psi, weights), terms, 0, how)
    found = None
    if failed <= MOST_FAILURES * len(status):
        found = regress_on_nodes(response[good], psi[good], terms, weights[good])
    if found is None:
        raise uqmbd.IntegrationError(
            f"{label}: {failed} of {len(status)} nodes failed; the others are too few for {len(terms)} terms. Truncate "
            f"the distributions, or use Monte Carlo. Reason of the failure: {reason}"
        )
    kept = found.multi_index
    fewer = "" if len(kept) == len(terms) else f", {len(kept)} of {len(terms)} terms"
    how = f"regression on the {len(good)} of {len(status)} nodes that did not fail{fewer}"
    return Expansion(found.coefficients, kept, failed, how)


def projected_scalars(
    propagator: uqmbd.Propagator,
    problem: uqmbd.Problem,
    space: uqmbd.GermSpace,
    terms: Index,
    rule: uqmbd.Quadrature,
    verification: uqmbd.Verification,
    begin: float,
) -> xr.DataTree:
    """Expand the outputs without a time.

    Parameters
    ----------
    propagator : uqmbd.Propagator
        The method at work.
    problem : uqmbd.Problem
        Of the outputs without a time.
    space, terms, rule
        Inputs, basis and quadrature of the expansion of the motion.
    verification : uqmbd.Verification
        Realisations that no node uses.
    begin : float
        When the work began, on the problem's clock.

    Raises
    ------
    uqmbd.IntegrationError
        If too few nodes have values.
    """
    found = problem.realise(space.to_inputs(rule.nodes))
    psi = space.evaluate(rule.nodes, terms)
    reason = found.most_frequent_reason()
    fit = expand(problem.label, found.response, found.status, reason, psi, terms, rule.weights)
    if fit.failed:
        warnings.warn(
            f"{problem.label}: {fit.failed} of {len(rule)} nodes failed, so that the quadrature does not hold: "
            f"{fit.how}. Reason of the failure: {reason}",
            stacklevel=3,
        )
    chaos = verification.chaos(fit.coefficients, fit.terms, problem.labels)
    return problem.node(
        propagator,
        chaos.statistics(),
        realisations=len(rule) + verification.asked,
        wall_time=problem.clock() - begin,
        counters=found.counters,
        children={"chaos": chaos.to_dataset()},
        attrs={
            "failures": fit.failed + verification.failures,
            "fit": fit.how,
            "terms": len(fit.terms),
            "nodes": len(rule),
            "quadrature": rule.name,
            "verification": len(verification.germs),
        },
    )
