"""Compute coefficients from realisations at quadrature nodes: projection, or regression if nodes failed."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from uqmbd.arguments import Size, typechecked
from uqmbd.errors import IntegrationError
from uqmbd.results.chaos import project, regress_on_nodes
from uqmbd.typing import Array, Index, Mask

__all__ = ["NodeFit", "fit_nodes"]


MOST_FAILURES = 0.5
"""Share of failed nodes above which no fit is possible: the region of failure is then not an exception."""


@typechecked
@dataclass(frozen=True, eq=False)
class NodeFit:
    """Coefficients, and the method of their computation.

    Attributes
    ----------
    coefficients : array, shape (P, O, T)
        Coefficients, in the units of the outputs.
    multi_index : array of int, shape (P, d)
        Degrees of the terms.
    how : str
        Method of the fit, as text; empty for a projection.
    failed : int
        Number of failed nodes; the fit excludes them.
    warning : str
        Warning about the coefficients, or empty.

    Examples
    --------
    >>> import numpy as np
    >>> import uqmbd
    >>> fit = uqmbd.extend.NodeFit(np.array([[[3.0]], [[0.2]]]), np.array([[0], [1]]))
    >>> len(fit.coefficients), fit.failed, fit.how
    (2, 0, '')
    """

    coefficients: Array
    multi_index: Index
    how: str = ""
    failed: Size = 0
    warning: str = ""


@typechecked
def fit_nodes(
    label: str, response: Array, good: Mask, reason: str, psi: Array, multi_index: Index, weights: Array | None
) -> NodeFit:
    """Project the responses at nodes; if some nodes failed, fit the successful nodes by regression.

    If the successful nodes do not determine all terms, fewer terms are fitted; see `uqmbd.extend.regress_on_nodes`.

    Parameters
    ----------
    label : str
        Label of the propagator.
    response : array, shape (K, O, T)
        Responses at the nodes.
    good : array of bool, shape (K,)
        Whether each node succeeded.
    reason : str
        Reason of the failures.
    psi : array, shape (K, P)
        Values of the basis polynomials at the nodes.
    multi_index : array of int, shape (P, d)
        Degrees of the basis polynomials.
    weights : array, shape (K,), optional
        Weights of the nodes. None: use a regression in every case.

    Returns
    -------
    NodeFit
        Coefficients, and a warning about them if necessary.

    Raises
    ------
    uqmbd.IntegrationError
        If too few nodes succeeded.

    Examples
    --------
    >>> import chaospy
    >>> import numpy as np
    >>> import uqmbd
    >>> speed = uqmbd.RandomVariable("speed", chaospy.Normal(3, 0.2), units="m/s")
    >>> mechanism = uqmbd.Mechanism("stone", uqmbd.Line())
    >>> stone = mechanism.body("stone", mass=1, velocity=speed)
    >>> space = uqmbd.extend.GermSpace.of(mechanism.inputs)
    >>> rule = uqmbd.extend.gauss_tensor(space, 3)
    >>> terms = space.basis(1)
    >>> psi = space.evaluate(rule.nodes, terms)
    >>> response = (3 + 0.2 * rule.nodes)[:, :, None]  # of one output at one time
    >>> good = np.ones(3, dtype=bool)
    >>> fit = uqmbd.extend.fit_nodes("mine", response, good, "", psi, terms, rule.weights)
    >>> fit.coefficients.ravel().round(6).tolist(), fit.failed
    ([3.0, 0.2], 0)
    """
    count, terms, left = len(good), len(multi_index), int(np.count_nonzero(good))
    failed = count - left
    if not failed and weights is not None:
        return NodeFit(project(response, psi, weights), multi_index)
    if failed > MOST_FAILURES * count:
        raise IntegrationError(
            f"{label}: {failed} of {count} nodes failed. Truncate the distributions to exclude failures. Reason of "
            f"the failure: {reason}"
        )
    counted = weights[good] if weights is not None and (weights > 0).all() else None
    found = regress_on_nodes(response[good], psi[good], multi_index, counted)
    if found is None:
        raise IntegrationError(
            f"{label}: {failed} of {count} nodes failed; the {left} successful nodes cannot determine the {terms} "
            "terms of the basis, or fewer terms. Use more nodes, or truncate the distributions to exclude failures. "
            f"Reason of the failure: {reason}"
        )
    fitted = found.multi_index
    fewer = "" if len(fitted) == terms else f", which determine {len(fitted)} of the {terms} terms"
    warning = (
        f"{label}: {failed} of {count} nodes failed, so the method replaced the quadrature by a regression on the "
        f"{left} successful nodes{fewer}. In the region of failure the chaos is an extrapolation. Reason of the "
        f"failure: {reason}"
    )
    how = f"regression on the {left} of {count} nodes that did not fail"
    how += "" if len(fitted) == terms else f", {len(fitted)} of {terms} terms"
    return NodeFit(found.coefficients, fitted, how, failed, warning)
