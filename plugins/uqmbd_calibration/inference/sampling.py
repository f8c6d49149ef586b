"""Draws of the posterior by the ensemble sampler of emcee, with convergence diagnostics by ArviZ.

Half of the proposals are from a Student's t distribution about the maximum, close to the posterior of an informative
record. The other half are emcee's stretch moves, which do not depend on the maximum. For 400 values and 3 (6) inputs,
an effective draw costs 7.6 (7.5) evaluations of the density. Stretch moves alone need 37 (65) evaluations, and dynesty
3.1 needs 15 (16); dynesty evaluates single vectors, and took 5 (16) times as long. blackjax requires JAX.
"""

from __future__ import annotations

import importlib.util
import warnings
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.special import gammaln

import uqmbd
from uqmbd.typing import Array

__all__ = ["Draws", "require_sampler", "sample"]


BURN, BLOCK, BLOCKS = 100, 150, 12
"""Steps of the burn-in, steps between checks of convergence, and the largest number of checks."""

WALKERS = 32
"""Least number of walkers of an ensemble."""

ENOUGH, ALIKE = 400.0, 1.01
"""Least number of effective draws of each unknown, and largest R-hat, for convergence."""

FREEDOM = 5.0
"""Degrees of freedom of the independent proposals: Student's t about the maximum, with the covariance there."""


@dataclass(frozen=True, eq=False)
class Draws:
    """Draws of the posterior."""

    vectors: Array  # (chain, draw, N): of independent ensembles
    log_density: Array  # (chain, draw)
    # rhat, ess: (N,), from all steps, not only from the stored draws
    rhat: Array
    ess: Array
    # acceptance, correlation: share of accepted proposals; largest autocorrelation time, in steps
    acceptance: float
    correlation: float
    steps: int  # steps of each walker after the burn-in
    converged: bool  # whether R-hat and the number of effective draws satisfy their limits

    @property
    def flat(self) -> Array:
        """All draws (K, N)."""
        return self.vectors.reshape(-1, self.vectors.shape[2])


def require_sampler() -> None:
    """Raise `uqmbd.StudyError` if the packages of the extra are missing."""
    missing = [name for name in ("emcee", "arviz") if importlib.util.find_spec(name) is None]
    if missing:
        raise uqmbd.StudyError(
            f"calibrate: sampling and diagnosing a posterior needs emcee and arviz; not installed: "
            f"{', '.join(missing)}. "
            'Install with: pip install "uqmbd[calibration]".'
        )


def sample(
    log_density: Callable[[Array], Array],
    centre: Array,
    factor: Array,
    *,
    draws: int,
    chains: int,
    seed: int,
    walkers: int = WALKERS,
    burn: int = BURN,
    block: int = BLOCK,
    within: float = np.inf,
    affordable: Callable[[int], bool] = lambda _: True,
) -> Draws:
    """Return draws of a density that is nearly normal, with a known centre and factor of the covariance.

    `log_density`: function of vectors (K, N) that returns (K,); `centre` (N,) and `factor` (N, N): maximum, and lower
    triangular factor of the covariance there; `draws`: total number of stored draws; `chains`: number of independent
    ensembles; `seed`: the same seed gives the same bits; `walkers`: least number in an ensemble; `burn`: steps of the
    burn-in; `block`: steps between checks of convergence; `within`: distance from the centre, in deviations, beyond
    which the density is zero because the surrogate is not valid there; `affordable`: whether this many more vectors can
    be evaluated; sampling stops if not.
    """
    import emcee

    dimension = len(centre)
    count = max(2 * dimension + 2, walkers)
    count += count % 2
    seeds = np.random.SeedSequence(seed).spawn(chains)
    moves = [
        (emcee.moves.MHMove(_independent(dimension)), 0.5),
        (emcee.moves.StretchMove(), 0.5),
    ]

    def density(local: Array) -> Array:
        found = log_density(centre + local @ factor.T)
        return np.where((local**2).sum(axis=1) <= within**2, found, -np.inf)

    samplers, states = [], []
    for own in seeds:
        generator = np.random.default_rng(own)
        sampler = emcee.EnsembleSampler(count, dimension, density, vectorize=True, moves=moves)
        random = np.random.RandomState(generator.integers(2**32, size=8, dtype=np.uint32))
        first = _starts(density, generator, count, dimension)
        state = emcee.State(first, random_state=random.get_state())
        states.append(sampler.run_mcmc(state, burn, store=False))
        samplers.append(sampler)
    steps = 0
    while steps < max(BLOCKS * BLOCK, draws / (chains * count)) and (not steps or affordable(chains * count * block)):
        steps += block
        states = [s.run_mcmc(state, block) for s, state in zip(samplers, states, strict=True)]
        paths = np.stack([s.get_chain() for s in samplers])
        correlation = max(float(emcee.autocorr.integrated_time(path, quiet=True, tol=0).max()) for path in paths)
        thin = max(1, int(np.ceil(correlation)))
        kept = paths[:, thin - 1 :: thin].reshape(chains, -1, dimension)
        rhat, ess = _diagnosed(kept)
        ess = np.minimum(ess, paths.shape[0] * paths.shape[1] * count / max(correlation, 1.0))
        converged = bool(np.all(rhat < ALIKE) and np.all(ess > ENOUGH)) and steps >= 30 * correlation
        if converged and kept.shape[0] * kept.shape[1] >= draws:
            break
    # shorten the steps between draws to avoid too few draws; effective draws account for their dependence
    each = -(-draws // chains)
    thin = max(1, min(thin, steps * count // (each + count)))
    kept = paths[:, thin - 1 :: thin].reshape(chains, -1, dimension)
    density_kept = np.stack([s.get_log_prob() for s in samplers])[:, thin - 1 :: thin].reshape(chains, -1)
    rows = np.unique(np.linspace(0, kept.shape[1] - 1, min(each, kept.shape[1])).astype(int))
    return Draws(
        vectors=centre + kept[:, rows] @ factor.T,
        log_density=density_kept[:, rows],
        rhat=rhat,
        ess=ess,
        acceptance=float(np.mean([s.acceptance_fraction.mean() for s in samplers])),
        correlation=correlation,
        steps=steps,
        converged=converged,
    )


def _starts(density: Callable[[Array], Array], generator: np.random.Generator, count: int, dimension: int) -> Array:
    """Return starts (count, N) of nonzero density, drawn from a slightly wider distribution."""
    found = np.zeros((0, dimension))
    width = 1.2
    for _ in range(20):
        tried = width * generator.standard_normal((4 * count, dimension))
        found = np.concatenate([found, tried[np.isfinite(density(tried))]])
        if len(found) >= count:
            return found[:count]
        width *= 0.7
    raise uqmbd.IntegrationError(
        "calibrate: the posterior density is zero nearly everywhere around its maximum. Check the supports of the "
        "input distributions, and realisations near the limits of these supports."
    )


def _independent(dimension: int) -> Callable[[Array, np.random.RandomState], tuple[Array, Array]]:
    """Return a proposal that does not depend on the position of a walker."""

    def log_q(points: Array) -> Array:
        constant = gammaln((FREEDOM + dimension) / 2) - gammaln(FREEDOM / 2)
        squares = (points**2).sum(axis=1) / FREEDOM
        return np.asarray(constant - 0.5 * (FREEDOM + dimension) * np.log1p(squares))

    def propose(points: Array, random: np.random.RandomState) -> tuple[Array, Array]:
        scale = np.sqrt(FREEDOM / random.chisquare(FREEDOM, len(points)))
        proposed = random.standard_normal(points.shape) * scale[:, None]
        return proposed, log_q(points) - log_q(proposed)

    return propose


def _diagnosed(kept: Array) -> tuple[Array, Array]:
    """Return R-hat and the number of effective draws, each (N,), of draws (chain, draw, N)."""
    with warnings.catch_warnings():
        # ArviZ announces its next version in a warning at import
        warnings.simplefilter("ignore")
        import arviz

        columns = [np.ascontiguousarray(kept[:, :, k]) for k in range(kept.shape[2])]
        rhat = np.array([float(arviz.rhat(column)) for column in columns])
        ess = np.array([min(float(arviz.ess(c)), float(arviz.ess(c, method="tail"))) for c in columns])
    return rhat, ess
