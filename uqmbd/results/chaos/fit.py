"""Compute coefficients of a polynomial chaos from realisations by quadrature or by least squares."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from uqmbd.arguments import shown, typechecked
from uqmbd.errors import StudyError
from uqmbd.threads import one_thread
from uqmbd.typing import Array

__all__ = ["LeastSquares", "NodeRegression", "least_squares", "project", "regress_on_nodes"]


_WORST_CONDITION = 1e12
"""Largest accepted condition number of the basis at the samples; above it, coefficients lose most of their digits."""
_WORST_OF_NODES = 1e4
"""Largest accepted condition number of the basis at the remaining nodes of a quadrature."""


@typechecked
def project(response: ArrayLike, psi: ArrayLike, weights: ArrayLike) -> Array:
    """Project realisations at the nodes of a quadrature onto an orthonormal basis (pseudo-spectral projection).

    The projection is exact if the quadrature integrates every product of the response and a basis polynomial. The
    result is bitwise identical for any number of threads.

    Parameters
    ----------
    response : array_like, shape (K, O, T) or (K, ...)
        Response at each of the K nodes, in the units of the outputs.
    psi : array_like, shape (K, P)
        The P basis polynomials at the nodes.
    weights : array_like, shape (K,)
        Weights of the nodes; they may be negative (sparse grids).

    Returns
    -------
    array, shape (P, O, T) or (P, ...)
        Coefficients, in the units of the outputs.

    Raises
    ------
    StudyError
        If shapes do not match, or a number is not finite: one failed node affects every coefficient.

    References
    ----------
    D. Xiu, Numerical Methods for Stochastic Computations, Princeton University Press, 2010, section 7.3.

    Examples
    --------
    >>> import numpy as np
    >>> nodes, weights = np.array([-1.0, 1.0]), np.array([0.5, 0.5])  # Gauss rule of the standard normal
    >>> project((3.0 + 2.0 * nodes)[:, None, None], np.stack([nodes**0, nodes], axis=1), weights)[:, 0, 0].tolist()
    [3.0, 2.0]
    """
    values, basis = _checked(response, psi)
    rule = np.asarray(weights, dtype=float)
    if rule.shape != (len(basis),):
        raise StudyError(
            f"'weights' has the shape {rule.shape}; expected one number for each of the {len(basis)} nodes."
        )
    _check_finite("weights", rule)
    with one_thread():
        found: Array = (basis * rule[:, None]).T @ values.reshape(len(basis), -1)
    return found.reshape(basis.shape[1], *values.shape[1:])


@dataclass(frozen=True, eq=False)
class LeastSquares:
    """Coefficients by regression, with measures of their quality.

    Attributes
    ----------
    coefficients : array, shape (P, ...)
        In the units of the outputs.
    leave_one_out : array, shape (...)
        Corrected leave-one-out error relative to the variance of the samples: 0 is perfect, 1 no better than the
        mean. The error is infinite if a sample cannot be left out (as many terms as samples), and 0 if all samples are
        equal.
    condition : float
        Condition number of the basis at the samples.

    Examples
    --------
    >>> import numpy as np
    >>> from uqmbd.extend import least_squares
    >>> x = np.linspace(-1, 1, 9)
    >>> found = least_squares(1 + 2 * x, np.stack([np.ones(9), x], axis=1))
    >>> found.coefficients.round(6).tolist(), bool(found.leave_one_out < 1e-12), found.condition < 2
    ([1.0, 2.0], True, True)
    """

    coefficients: Array
    leave_one_out: Array
    condition: float


@typechecked
def least_squares(response: ArrayLike, psi: ArrayLike) -> LeastSquares:
    r"""Fit a basis to realisations by ordinary least squares.

    The leave-one-out error needs no further fits. With the diagonal :math:`h` of the hat matrix, the residual of an
    omitted sample is :math:`r_k / (1 - h_k)` (PRESS). The mean square of these residuals over the sample variance is
    multiplied by :math:`\frac{K}{K-P} \left(1 + \operatorname{tr}(\Psi^T \Psi)^{-1}\right)`. This factor corrects for
    few samples [1]_ (after Chapelle, Vapnik and Bengio). The result is bitwise identical for any number of threads.

    Parameters
    ----------
    response : array_like, shape (K, O, T) or (K, ...)
        Response of each of the K samples, in the units of the outputs.
    psi : array_like, shape (K, P)
        The P basis polynomials at the samples, P <= K.

    Returns
    -------
    LeastSquares
        Coefficients, their leave-one-out error, and the condition number of the basis.

    Raises
    ------
    StudyError
        If the basis has more terms than there are samples, or the samples cannot distinguish its terms. If shapes do
        not match, or a number is not finite.

    References
    ----------
    .. [1] G. Blatman and B. Sudret, Journal of Computational Physics 230 (2011) 2345-2367.

    Examples
    --------
    >>> import numpy as np
    >>> x = np.array([-1.0, 0.0, 1.0, 2.0])
    >>> fit = least_squares(1.0 + 3.0 * x, np.stack([x**0, x], axis=1))
    >>> fit.coefficients.round(12).tolist(), bool(fit.leave_one_out < 1e-20), round(fit.condition, 3)
    ([1.0, 3.0], True, 1.618)
    """
    values, basis = _checked(response, psi)
    count, terms = basis.shape
    if terms > count:
        raise StudyError(
            f"Regression needs at least as many samples as terms, but there are {terms} terms and {count} samples. "
            "Use about twice as many samples as terms, a lower order, or sparse regression."
        )
    import scipy.linalg

    with one_thread():
        q, r = np.linalg.qr(basis)
        singular = np.linalg.svd(r, compute_uv=False)
        condition = float(singular[0] / singular[-1]) if singular[-1] > 0 else float("inf")
        if not condition < _WORST_CONDITION:
            raise StudyError(
                f"The {count} samples do not determine the {terms} terms: the condition number is {condition:.1e}, "
                f"expected below {_WORST_CONDITION:.0e}. Use more or different samples, or a lower order."
            )
        flat = values.reshape(count, -1)
        # subtract the mean of the samples, so that a small spread about a large mean loses no digits
        centre = flat.mean(axis=0)
        deviations = flat - centre
        inner = scipy.linalg.solve_triangular(r, np.concatenate([q.T @ deviations, q.sum(axis=0)[:, None]], axis=1))
        coefficients = inner[:, :-1] + inner[:, -1:] * centre
        outside = deviations - basis @ inner[:, :-1] + (1.0 - basis @ inner[:, -1:]) * centre
        inverse = scipy.linalg.solve_triangular(r, np.eye(terms))
    error = _leave_one_out(flat, deviations, outside, np.sum(q * q, axis=1), float(np.sum(inverse * inverse)), terms)
    shape = values.shape[1:]
    return LeastSquares(coefficients.reshape(terms, *shape), error.reshape(shape), condition)


@dataclass(frozen=True, eq=False)
class NodeRegression:
    """Coefficients from the successful nodes of a quadrature.

    Attributes
    ----------
    coefficients : array, shape (P, ...)
        In the units of the outputs.
    multi_index : array of int, shape (P, d)
        Degrees of the terms that the nodes determine.

    Examples
    --------
    >>> import numpy as np
    >>> from uqmbd.extend import regress_on_nodes
    >>> x = np.array([-0.8, 0.0, 0.8])
    >>> psi = np.stack([np.ones(3), x, x**2 - 0.5], axis=1)
    >>> found = regress_on_nodes(1 + 2 * x, psi, np.array([[0], [1], [2]]))
    >>> found.coefficients.round(6).tolist(), found.multi_index.ravel().tolist()
    ([1.0, 2.0, 0.0], [0, 1, 2])
    """

    coefficients: Array
    multi_index: NDArray[np.int64]


@typechecked
def regress_on_nodes(
    response: ArrayLike, psi: ArrayLike, multi_index: ArrayLike, weights: ArrayLike | None = None
) -> NodeRegression | None:
    """Fit a basis to the successful nodes of a quadrature by weighted least squares, if other nodes failed.

    If the nodes do not determine all terms, the fit omits terms of the highest total degrees. In a tensor rule, all
    nodes of one coordinate often fail. If all weights are positive, they are the weights of the fit. Otherwise the
    weight of a node is the inverse sum of squares of the basis there, as for a Gauss node [1]_.

    Parameters
    ----------
    response : array_like, shape (K, O, T) or (K, ...)
        Response at each of the K successful nodes, in the units of the outputs.
    psi : array_like, shape (K, P)
        The P basis polynomials at these nodes.
    multi_index : array_like of int, shape (P, d)
        Degrees of the basis polynomials.
    weights : array_like, shape (K,), optional
        Weights of the successful nodes.

    Returns
    -------
    NodeRegression or None
        Fitted coefficients and their terms. None if the nodes determine no terms except the mean.

    Raises
    ------
    uqmbd.StudyError
        If shapes do not match.

    References
    ----------
    .. [1] A. Cohen and G. Migliorati, SMAI Journal of Computational Mathematics 3 (2017) 181-203.

    Examples
    --------
    In a Gauss rule of three nodes for the standard normal, one node failed; the other two determine a line.

    >>> import numpy as np
    >>> x = np.array([0.0, 3.0**0.5])
    >>> psi = np.stack([x**0, x, (x**2 - 1) / 2**0.5], axis=1)
    >>> found = regress_on_nodes(1.0 + 2.0 * x, psi, [[0], [1], [2]], [2 / 3, 1 / 6])
    >>> found.coefficients.round(12).tolist(), found.multi_index.tolist()
    ([1.0, 2.0], [[0], [1]])
    """
    values, basis = _checked(response, psi)
    index, rule = np.asarray(multi_index), None if weights is None else np.asarray(weights, dtype=float)
    whole = index.dtype.kind in "iu" and index.ndim == 2 and 0 < len(index) == basis.shape[1]
    if not whole or (rule is not None and rule.shape != (len(basis),)):
        raise StudyError(
            f"regress_on_nodes: multi_index is {shown(index)} and weights is {shown(rule)}; expected whole degrees of "
            f"{basis.shape[1]} terms, shape (P, d), and a weight for each of {len(basis)} nodes, or None."
        )
    degrees = index.sum(axis=1)
    top = int(degrees.max())
    # accept a mean alone only if no higher term was requested
    for highest in range(top, min(0, top - 1), -1):
        included = degrees <= highest
        part = basis[:, included]
        counted = rule if rule is not None and bool((rule > 0).all()) else 1 / np.sum(part**2, axis=1)
        if part.shape[1] > len(part) or not np.linalg.cond(part * np.sqrt(counted)[:, None]) < _WORST_OF_NODES:
            continue
        root = np.sqrt(counted / counted.sum())[:, None]
        flat = values.reshape(len(values), -1)
        # subtract the weighted mean (first term), so that a small spread about a large mean loses no digits
        centre = root[:, 0] ** 2 @ flat
        coefficients = least_squares((flat - centre) * root, part * root).coefficients.copy()
        coefficients[0] += centre
        return NodeRegression(coefficients.reshape(len(coefficients), *values.shape[1:]), index[included])
    return None


def _leave_one_out(
    values: Array, deviations: Array, residual: Array, leverage: Array, trace: float, terms: int
) -> Array:
    """Return the corrected relative error (C,) from residuals (K, C), leverages (K,) and tr(inverse information)."""
    count = len(values)
    total = np.sum(deviations**2, axis=0)
    rounding = 32.0 * np.finfo(float).eps * np.abs(values).max(axis=0)
    agree = np.sqrt(total / count) <= rounding
    free = 1.0 - leverage
    if count == terms or np.any(free < 1e-12):
        return np.where(agree, 0.0, np.inf)
    press = np.sum((residual / free[:, None]) ** 2, axis=0)
    correction = count / (count - terms) * (1.0 + trace)
    return np.where(agree, 0.0, correction * press / np.where(agree, 1.0, total))


def _checked(response: ArrayLike, psi: ArrayLike) -> tuple[Array, Array]:
    values, basis = np.asarray(response, dtype=float), np.asarray(psi, dtype=float)
    if basis.ndim != 2 or values.ndim == 0 or len(values) != len(basis) or 0 in basis.shape:
        raise StudyError(
            f"'response' has the shape {values.shape}, and 'psi' has the shape {basis.shape}; expected (K, ...) and "
            "(K, P), with one row for each realisation."
        )
    _check_finite("psi", basis)
    _check_finite("response", values)
    return values, basis


def _check_finite(name: str, values: Array) -> None:
    rows = np.isfinite(values.reshape(len(values), -1)).all(axis=1)
    if not rows.all():
        raise StudyError(
            f"'{name}' contains a number that is not finite in row {int(np.argmin(rows))}. Omit failed realisations "
            "from a regression; a quadrature needs all of its nodes."
        )
