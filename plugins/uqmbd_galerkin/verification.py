"""Verification realisations beside a run: how wrong the expansion is, while it goes on."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

import uqmbd
from uqmbd.results import PiecewiseChaos, PolynomialChaos, Status
from uqmbd.typing import Array

__all__ = ["Verification", "horizons", "verification_points"]


STREAM = 0x6A1E12
"""Enters the seed of the verification points."""


def verification_points(space: uqmbd.GermSpace, count: int, seed: int) -> Array:
    """Germ points that no node uses, spread like the inputs, shape (count, d)."""
    if not count:
        return np.zeros((0, space.dimension))
    mixed = int(np.random.SeedSequence([seed, STREAM]).generate_state(1)[0])
    return np.asarray(uqmbd.monte_carlo_rule(space, count, mixed, "sobol").nodes)


def horizons(chaos: PolynomialChaos | PiecewiseChaos, limit: float, rtol: float) -> dict[str, float]:
    """Find the first time at which the stated error of an output exceeds a limit; outputs that never do are left out.

    An output that varies by no more than the tolerance of the integration has no error worth a word.

    Parameters
    ----------
    chaos : uqmbd.results.PolynomialChaos or uqmbd.results.PiecewiseChaos
        Without verification data nothing is known, and nothing found.
    limit : float
        Over the standard deviation.
    rtol : float
        Relative tolerance of the integration.

    Returns
    -------
    dict of str to float
        Times in s by the name of the output.
    """
    response = chaos.verification_response
    if response is None:
        return {}
    outputs = chaos.labels.outputs
    size = np.abs(chaos.mean).max(axis=1)
    alike = np.array([size[[o.units == other.units for other in outputs]].max() for o in outputs])
    spread = np.maximum(chaos.std, response.std(axis=0)).max(axis=1)
    loud = spread > rtol * np.maximum(100 * size, alike)
    found = chaos.horizon(limit)
    return {o.name: t for o, some in zip(outputs, loud, strict=True) if some and (t := found[o.name]) is not None}


class Verification:
    """Realisations at verification points, and the error of an expansion against them.

    Parameters
    ----------
    problem : uqmbd.Problem
        Who computes them.
    space : uqmbd.GermSpace
        Of the inputs.
    count, seed : int
        How many, and where.
    """

    def __init__(self, problem: uqmbd.Problem, space: uqmbd.GermSpace, count: int, seed: int) -> None:
        self.problem, self.space = problem, space
        germs = verification_points(space, count, seed)
        self.found = problem.realise(space.to_inputs(germs)) if count else None
        good = np.zeros(0, dtype=np.int64)
        if self.found is not None:
            finite = np.isfinite(self.found.response).all(axis=(1, 2))
            good = np.flatnonzero((self.found.status == Status.OK) & finite)
        self.germs, self.count = germs[good], count
        self.response = None if self.found is None else self.found.response[good]

    @property
    def failures(self) -> int:
        """Verification realisations that failed: there the response does not exist."""
        return self.count - len(self.germs)

    @property
    def reason(self) -> str:
        """Why, in the words of the most frequent one."""
        return self.found.most_frequent_reason() if self.found is not None else ""

    def chaos(self, coefficients: Array, multi_index: NDArray[np.int64], count: int) -> PolynomialChaos:
        """Make the chaos of the first `count` times, verified."""
        labels = self.problem.labels
        if count < len(self.problem.times):
            labels = replace(labels, times=self.problem.times[:count])
        known = self.response is not None and len(self.germs)
        return PolynomialChaos(
            coefficients[:, :, :count],
            multi_index,
            self.space,
            labels,
            verification_germs=self.germs if known else None,
            verification_response=self.response[:, :, :count] if known and self.response is not None else None,
        )
