"""Outputs without a time: no equations of motion to project, so they are evaluated at the nodes and projected there."""

from __future__ import annotations

import time as clock
import warnings

import numpy as np
import xarray as xr
from numpy.typing import NDArray

import uqmbd
from uqmbd.results import least_squares, project
from uqmbd_galerkin.verification import Verification

__all__ = ["projected_scalars"]

Index = NDArray[np.int64]

HOW = "evaluated at the nodes of the quadrature and projected there"
MOST_FAILURES = 0.5
"""Share of nodes without a value beyond which there is nothing to fit."""


def projected_scalars(
    propagator: uqmbd.Propagator,
    problem: uqmbd.Problem,
    space: uqmbd.GermSpace,
    terms: Index,
    rule: uqmbd.Quadrature,
    verification: Verification,
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
    verification : Verification
        Realisations that no node uses.
    begin : float
        When the work began, on the clock ``time.perf_counter``.

    Raises
    ------
    uqmbd.IntegrationError
        If too few nodes have values.
    """
    found = problem.realise(space.to_inputs(rule.nodes))
    psi = space.evaluate(rule.nodes, terms)
    good = np.flatnonzero(found.status == 0)
    failed = len(rule) - len(good)
    how = HOW
    if not failed:
        coefficients = project(found.response, psi, rule.weights)
    else:
        reason = found.most_frequent_reason()
        if len(good) < len(terms) or failed > MOST_FAILURES * len(rule):
            raise uqmbd.IntegrationError(
                f"{problem.label}: {failed} of {len(rule)} nodes failed; the others are too few for {len(terms)} "
                f"terms. Truncate the distributions, or use Monte Carlo. Reason of the failure: {reason}"
            )
        how = f"regression on the {len(good)} of {len(rule)} nodes that did not fail"
        warnings.warn(
            f"{problem.label}: {failed} of {len(rule)} nodes failed, so that the quadrature does not hold: {how}. "
            f"Reason of the failure: {reason}",
            stacklevel=4,
        )
        root = np.sqrt(rule.weights[good] / rule.weights[good].sum())[:, None]
        coefficients = least_squares(found.response[good] * root[:, :, None], psi[good] * root).coefficients
    chaos = verification.chaos(coefficients, terms, len(problem.times))
    return problem.node(
        propagator,
        chaos.statistics(),
        realisations=len(rule) + verification.count,
        wall_time=clock.perf_counter() - begin,
        counters=found.counters,
        children={"chaos": chaos.to_dataset()},
        attrs={
            "failures": failed + verification.failures,
            "fit": how,
            "terms": len(terms),
            "nodes": len(rule),
            "quadrature": rule.name,
            "verification": verification.count - verification.failures,
        },
    )
