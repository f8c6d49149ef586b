"""State of a calibration: cases, their realisations, and the surrogates that the realisations correct."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from typing import Any

import numpy as np

import uqmbd
from uqmbd.typing import Array
from uqmbd_calibration.inference.blocks import FREEDOM
from uqmbd_calibration.inference.climbing import REACH, climb
from uqmbd_calibration.inference.correcting import CorrectedPredictions, corrected, enough, tangent
from uqmbd_calibration.inference.machine_records import MachineRecords
from uqmbd_calibration.inference.points import SearchExhausted
from uqmbd_calibration.inference.posterior import Posterior, Predictor
from uqmbd_calibration.inference.sampling import Draws, sample
from uqmbd_calibration.inference.searching import spread_over_prior
from uqmbd_calibration.inference.unknowns import Unknowns

__all__ = ["CHECKED", "CalibrationState", "peak_of"]


CHECKED = 24
"""Number of draws that are computed on the mechanism at once."""

STACK, BURNED, STEPS = 64, 10, 25
"""Walkers on the mechanism, steps of the burn-in, and steps between checks of convergence."""

WIDER = 1.3
"""Ratio of the widths of the distribution of correcting realisations and of the posterior."""

NEAR, FOLLOWED = 1.5, 6
"""Largest change of a converged maximum, in deviations of the posterior, and largest number of corrections."""


@dataclass(eq=False)
class CalibrationState:
    """Cases, their realisations and corrected surrogates."""

    unknowns: Unknowns
    cases: tuple[MachineRecords, ...]
    base: tuple[Predictor, ...]
    variances: tuple[list[Array], ...]
    predictors: list[Predictor] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.predictors = list(self.base)

    @property
    def target(self) -> Posterior:
        """Posterior density by the current surrogates."""
        return Posterior(self.unknowns, self.cases, tuple(self.predictors))

    def affordable(self, count: int) -> bool:
        """Return whether enough realisations remain to compute this number of vectors on the mechanism."""
        wanted: dict[int, int] = {}
        for case in self.cases:
            wanted[id(case.point)] = wanted.get(id(case.point), 0) + count
        return all(case.point.left >= wanted[id(case.point)] for case in self.cases)

    def run(self, vectors: Array) -> list[list[Array]]:
        """Compute vectors (K, N) on the mechanism; return values (K, n) of each block of each case."""
        found = []
        for case in self.cases:
            rows = case.point.run(case.normals(vectors))
            found.append(case.point.values(rows, case.blocks))
        return found

    def shift(self, vector: Array, real: list[list[Array]]) -> None:
        """Set the predictions to the base plus a constant, so that they are exact at a vector (N,)."""
        for k, case in enumerate(self.cases):
            free, at = case.free, case.normals(vector[None])
            nothing = np.zeros(len(free)), np.eye(len(free))
            self.predictors[k] = corrected(
                self.base[k], at, real[k], free, at[0, free], nothing[1], lambda left: np.zeros(len(left))
            )

    def tangent(self, k: int, vector: Array, scale: Array, values: list[Array]) -> None:
        """Correct the base of a case, so that it has the values and slopes of the mechanism at a vector.

        ``values`` (1 + f, n) of each block are realisations at the vector, and with each unknown input moved by one
        divided by its ``scale`` (f,).
        """
        case = self.cases[k]
        centre = case.normals(vector[None])[0, case.free]
        self.predictors[k] = tangent(
            self.base[k], case.normals(vector[None])[0], values, case.free, centre, np.diag(scale)
        )

    def explore(self, peak: Array, factor: Array, count: int, seed: int) -> bool:
        """Compute realisations from a slightly wider posterior; return whether any were computed."""
        while count >= CHECKED // 3 and not self.affordable(count + CHECKED):
            count -= 1
        if not self.affordable(count + CHECKED):
            return False
        local = spread_over_prior(len(peak), count, seed)
        self.run(peak + WIDER * local @ factor.T)
        return True

    def follow(self, peak: Array, factor: Array, seeds: Iterator[int], *, explored: bool) -> tuple[Array, Array]:
        """Correct the surrogate about a maximum; repeat this about each new maximum until the maximum converges."""
        inputs = max(len(case.free) for case in self.cases)
        count = max(CHECKED, enough(inputs))
        for _ in range(FOLLOWED):
            if not explored and not self.explore(peak, factor, count, next(seeds)):
                break
            explored, count = False, max(CHECKED // 2, enough(inputs, 1))
            then, factor = self.refit(peak, factor, 1)
            step = np.linalg.norm(np.linalg.solve(factor, then - peak))
            peak = then
            if step < NEAR:
                break
        return self.refit(peak, factor)

    def refit(self, peak: Array, factor: Array, times: int = 2) -> tuple[Array, Array]:
        """Fit corrections to all realisations about a maximum; return the new maximum and covariance factor.

        The posterior determines the weights of realisations and the coordinates. The fit is therefore repeated once if
        realisations surround the posterior.
        """
        if not any(len(case.point.points) for case in self.cases):
            return peak_of(self.target, peak)
        for _ in range(times):
            covariance = factor @ factor.T
            for k, case in enumerate(self.cases):
                own = case.columns[case.free]
                local = np.linalg.inv(np.linalg.cholesky(covariance[np.ix_(own, own)]))
                rows = np.arange(len(case.point.points))
                values = case.point.values(rows, case.blocks)
                centre = case.normals(peak[None])[0, case.free]
                self.predictors[k] = corrected(
                    self.base[k], case.point.points, values, case.free, centre, local, self._measure(k, peak)
                )
            peak, factor = peak_of(self.target, peak)
        return peak, factor

    def draw(self, peak: Array, factor: Array, *, draws: int, chains: int, seed: int) -> Draws:
        """Draw from the posterior of the mechanism: each ensemble proposes stacks of realisations."""

        def real(case: MachineRecords) -> Predictor:
            return lambda normals: case.point.passing(normals, case.blocks)

        target = Posterior(self.unknowns, self.cases, tuple(real(case) for case in self.cases))
        first = chains * STACK * (4 + BURNED + 1 + STEPS)
        if not self.affordable(first):
            spent = max(case.point.spent for case in self.cases)
            raise uqmbd.StudyError(
                f"calibrate: on='mechanism' needs at least {spent + first} realisations, with {chains} chains of "
                f"{STACK} walkers. Increase realisations, e.g. to {2 * (spent + first)}, or use on='surrogate'."
            )
        about: dict[str, Any] = {"draws": draws, "chains": chains, "seed": seed}
        steps: dict[str, Any] = {"walkers": STACK, "burn": BURNED, "block": STEPS, "affordable": self.affordable}
        try:
            return sample(target.log_density, peak, factor, **about, **steps)
        except SearchExhausted:
            raise uqmbd.StudyError(
                "calibrate: the chains could not start within the allowed realisations, because many realisations "
                "failed. Increase realisations, or check the input distributions."
            ) from None

    def _measure(self, k: int, peak: Array) -> Callable[[Array], Array]:
        """Return a function that converts errors (K, N) of a case to squared errors (K,) of the log-likelihood.

        If values are far from all predictions, as for a wrong model, the product of error and misfit is the main part.
        """
        case, sigma, misfit = self.cases[k], [], []
        predicted = self.predictors[k](case.normals(peak[None]))
        for block, values in zip(case.blocks, predicted, strict=True):
            level = block.sigma(self.unknowns, peak[None])
            rest = block.misfit(values, peak[None])
            sigma.append(np.full(len(block.values), level[0]))
            misfit.append((rest - block.bias(rest, level))[0])
        scale, away = np.concatenate(sigma), np.concatenate(misfit) / np.concatenate(sigma)
        if case.blocks[0].robust:
            away = away / (1 + away**2 / FREEDOM)

        def measure(errors: Array) -> Array:
            scaled = errors / scale
            return np.asarray((scaled**2).sum(axis=1) + (scaled @ away) ** 2)

        return measure

    @property
    def degree(self) -> int | None:
        """Highest degree of the corrections."""
        degrees = [p.degree for p in self.predictors if isinstance(p, CorrectedPredictions)]
        return max(degrees, default=None)


def peak_of(target: Posterior, start: Array) -> tuple[Array, Array]:
    """Return the maximum near a start (N,), and a lower triangular factor of the covariance (N, N) there."""
    found = climb(target, start[None])
    for _ in range(2):
        # the step is a part of the posterior's width: rounding errors and the curvature then have small effects
        deviation = np.sqrt(np.diag(np.linalg.inv(found.hessian[0])))[: len(target.unknowns.inputs)]
        # a record that contradicts the prior has its maximum beyond the initial limit of the search
        reach = 10 * REACH if np.abs(found.vectors).max() >= REACH else REACH
        found = climb(target, found.vectors, difference=np.clip(0.1 * deviation, 1e-7, 1e-2), reach=reach)
    covariance = np.linalg.inv(found.hessian[0])
    return found.vectors[0], np.asarray(np.linalg.cholesky(0.5 * (covariance + covariance.T)))
