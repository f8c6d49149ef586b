"""Polynomials in place of a surrogate that a page cannot evaluate, such as the model of a plugin."""

from __future__ import annotations

from typing import Any

import numpy as np

from uqmbd.errors import StudyError
from uqmbd.randomness import index_set
from uqmbd.results import PolynomialChaos
from uqmbd.results.chaos import CustomSurrogate, least_squares, random_germs, reference_spread, spread_germs
from uqmbd.typing import Array
from uqmbd.wording import format_percent

__all__ = ["polynomial_of"]

TERMS = 500
"""Maximum number of terms of the polynomials."""

HIGHEST = 16
"""Maximum order of the polynomials."""

CHECKED = 512
"""Number of random germ points for the comparison of polynomials and model."""

GOOD = 1e-4
"""Ratio of difference to standard deviation that is small enough, so that no higher order is tried."""

ALLOWED = 0.01
"""Maximum ratio of difference to standard deviation of an output; above it, the page has no sliders."""


def polynomial_of(chaos: CustomSurrogate) -> tuple[PolynomialChaos, dict[str, Any]]:
    """Return polynomials of the germs that replace a model, with the verification realisations of the model.

    Also return ``model`` (name), ``order``, and ``difference`` from the model, relative to the standard deviation. The
    difference is the root mean square over random germ points, and the largest over outputs and times. The order
    minimises this difference. Raise StudyError if it exceeds 1 %.
    """
    space, shape = chaos.space, chaos.labels.shape
    points = random_germs(space, CHECKED, 1)
    exact = chaos.evaluate_germs(points)
    spread = reference_spread(exact.std(axis=0).reshape(len(chaos.labels.outputs), -1))
    known = (chaos.verification_germs, chaos.verification_response, chaos.verification_weights)
    # a discrete germ with few values has few polynomials
    highest = [HIGHEST if germ.highest_degree is None else germ.highest_degree for germ in space.germs]
    best, least = None, np.inf
    for order in range(1, HIGHEST + 1):
        terms = index_set(space.dimension, order)
        terms = terms[np.all(terms <= highest, axis=1)]
        if len(terms) > TERMS and best is not None:
            break
        germs = spread_germs(space, max(4 * len(terms), CHECKED), 0)
        found = least_squares(chaos.evaluate_germs(germs), space.evaluate(germs, terms)).coefficients
        made = PolynomialChaos(found, terms, space, chaos.labels, *known)
        wrong = _largest(made.evaluate_germs(points) - exact, spread, shape)
        if wrong < least:
            best, least = made, wrong
        if least <= GOOD or wrong > 10 * least:
            break
    if best is None or least > ALLOWED:
        raise StudyError(
            f"The page evaluates polynomials. The polynomials differ from the model {chaos.model.name!r} by up to "
            f"{format_percent(least)} of the standard deviation; at most {format_percent(ALLOWED)} are allowed."
        )
    order = int(best.multi_index.sum(axis=1).max())
    return best, {"model": chaos.model.name, "order": order, "difference": least}


def _largest(difference: Array, spread: Array, shape: tuple[int, ...]) -> float:
    """Return the largest ratio of root mean square differences to a spread (O, T), from differences (K, O, T)."""
    size = np.sqrt((difference**2).mean(axis=0)).reshape(spread.shape)
    return float(np.max(size / np.where(spread > 0, spread, 1.0), initial=0.0))
