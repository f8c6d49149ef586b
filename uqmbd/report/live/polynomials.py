"""Polynomials in place of a surrogate that a page cannot evaluate: the model of a plugin."""

from __future__ import annotations

import numpy as np

from uqmbd.errors import StudyError
from uqmbd.randomness import index_set
from uqmbd.results import PolynomialChaos
from uqmbd.results.chaos import CustomSurrogate, least_squares, random_germs, reference_spread, spread_germs
from uqmbd.typing import Array
from uqmbd.wording import format_percent

__all__ = ["polynomial_of"]

TERMS = 500
"""Most terms of the polynomials."""

HIGHEST = 16
"""Highest order that is tried."""

CHECKED = 512
"""Random germ points at which the polynomials are compared with the model."""

GOOD = 1e-4
"""Difference over the standard deviation below which no higher order is tried."""

ALLOWED = 0.01
"""Largest difference over the standard deviation of an output; beyond, the page has no sliders."""


def polynomial_of(chaos: CustomSurrogate) -> PolynomialChaos:
    """Return polynomials of the germs in place of a model, with its verification realisations.

    The order is the one whose largest root mean square difference from the model, at random germ points, over the
    standard deviation, is least. Raise StudyError if that exceeds 1 % at any output and time.
    """
    space, shape = chaos.space, chaos.labels.shape
    points = random_germs(space, CHECKED, 1)
    exact = chaos.evaluate_germs(points)
    spread = reference_spread(exact.std(axis=0).reshape(len(chaos.labels.outputs), -1))
    known = (chaos.verification_germs, chaos.verification_response, chaos.verification_weights)
    # a germ of few values has few polynomials
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
            f"The page evaluates polynomials, and those of the model {chaos.model.name!r} differ from it by up to "
            f"{format_percent(least)} of the standard deviation; at most {format_percent(ALLOWED)} are allowed."
        )
    return best


def _largest(difference: Array, spread: Array, shape: tuple[int, ...]) -> float:
    """Return the largest root mean square of differences (K, O, T) over a spread (O, T)."""
    size = np.sqrt((difference**2).mean(axis=0)).reshape(spread.shape)
    return float(np.max(size / np.where(spread > 0, spread, 1.0), initial=0.0))
