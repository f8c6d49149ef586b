"""Polynomial chaos over the parameters of a mechanism, averaged over common sampled paths of its random processes.

Every path is combined with the same nodes of the parameters (common random numbers). The response to one path is a
smooth function of the parameters. The coefficients of all paths give the split of the variance (Le Maitre and Knio,
Reliability Engineering and System Safety 135 (2015) 107-124).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Any, ClassVar

import numpy as np
import xarray as xr
from numpy.typing import NDArray

import uqmbd

__all__ = ["CommonPaths", "statistics_of_paths"]

Array = NDArray[np.float64]

BATCH = 4096
"""Largest number of realisations in memory at once."""

SPARE = 2
"""Nodes for each term of the basis, if a Gauss rule would need more."""

POINTS = 8
"""Number of verification points of the parameters."""

LEVEL = 0.975
"""Upper probability of 95 % intervals."""


@dataclass(frozen=True, kw_only=True)
class CommonPaths(uqmbd.extend.Propagator):
    r"""Polynomial chaos over the parameters, averaged over common paths of random processes.

    The method needs fewer realisations than Monte Carlo if the parameters have much influence: the statistics over the
    parameters have no sampling error. All other errors decrease as one over the root of `paths`.

    Parameters
    ----------
    order : int
        Total degree of the polynomials.
    paths : int
        Number of paths of each process.
    seed : int
        Seed of the paths and of the verification points.
    label : str, optional
        Name of the results. Default: ``common-paths``.

    Raises
    ------
    uqmbd.StudyError
        In a run, if the outputs do not depend on sampled paths, or if the mechanism has no other random variables.
    uqmbd.IntegrationError
        In a run, if more than half of the paths have a failed realisation.

    Notes
    -----
    Let :math:`c_k(\omega)` be the coefficients of the orthonormal polynomials for a path :math:`\omega`. The variance
    due to parameters alone is :math:`\sum_{k>0} E[c_k]^2`, that due to paths alone is :math:`\mathrm{Var}\,c_0`, and
    that of interactions is :math:`\sum_{k>0} \mathrm{Var}\,c_k`. The estimators are without bias. The standard errors
    and intervals are those of a jackknife over the paths. The stated error is that of the polynomials at random
    parameters, for the same paths. Paths with a failed realisation are omitted, and counted.

    Examples
    --------
    >>> import chaospy, uqmbd
    >>> from uqmbd_processes import CommonPaths, RandomProcess, exponential_covariance
    >>> from uqmbd_springs import PointForce, SpringDamper
    >>> gust = RandomProcess("gust", covariance=exponential_covariance(3.0, 0.5), units="N", cutoff=4.0)
    >>> stiffness = uqmbd.RandomVariable("stiffness", chaospy.Uniform(30, 40), units="N/m")
    >>> mechanism = uqmbd.Mechanism("oscillator", uqmbd.Line())
    >>> body = mechanism.body("body", mass=1, position=1)
    >>> spring = SpringDamper("spring", mechanism.ground, body, 0, 0, stiffness, damping=2.4, free_length=1)
    >>> parts = mechanism.add(spring), mechanism.add(PointForce("push", body, 0, gust()))
    >>> mechanism.output("position", body.position[0], units="m")
    >>> study = uqmbd.Study("wind", mechanism, [0.0, 2.0, 4.0], [CommonPaths(order=2, paths=16)])
    >>> share = study.run()["common-paths/statistics"]["variance_share"].sel(origin="paths", output="position")
    >>> bool(share[-1] > 0.5)
    True
    """

    name: ClassVar[str] = "common-paths"
    accepts_keys: ClassVar[bool] = True

    order: Annotated[int, uqmbd.extend.Bounds(0)] = 3
    paths: Annotated[int, uqmbd.extend.Bounds(2)] = 64
    seed: Annotated[int, uqmbd.extend.Bounds(0)] = 0

    def obstacle(self, study: Any) -> str | None:
        """Return the obstacle: no sampled paths, or no other random variables."""
        return _obstacle(study.mechanism.inputs)

    def estimate(self, study: Any) -> uqmbd.extend.Estimate | None:
        """Return the number of realisations, and the memory of coefficients and responses."""
        inputs = study.mechanism.inputs
        if _obstacle(inputs):
            return None
        space, terms, rule = self._rule(inputs)
        count = (len(rule.nodes) + POINTS) * self.paths
        values = max(len(study.mechanism.outputs), 1) * len(study.times)
        memory = 8 * values * (self.paths * len(terms) + max(BATCH, len(rule.nodes)))
        return uqmbd.extend.Estimate(count, memory, f"coefficients of {self.paths} paths")

    def _rule(self, inputs: uqmbd.extend.JointInput) -> tuple[Any, Any, uqmbd.extend.Quadrature]:
        """Return the germs of the parameters, the degrees of the terms (P, d), and the nodes."""
        parameters = uqmbd.extend.JointInput.of(v for v in inputs.variables if not v.is_key)
        space = uqmbd.extend.GermSpace.of(parameters)
        terms = uqmbd.extend.index_set(space.dimension, self.order)
        if (self.order + 1) ** space.dimension <= SPARE * len(terms):
            return space, terms, uqmbd.extend.gauss_tensor(space, self.order + 1)
        count = SPARE * len(terms) + 1
        return space, terms, uqmbd.extend.monte_carlo_rule(space, count, self.seed, "latin-hypercube")

    def propagate(self, problem: uqmbd.extend.Problem) -> xr.DataTree:
        """Compute the response to all paths at all nodes, and return statistics."""
        if reason := _obstacle(problem.inputs):
            raise uqmbd.StudyError(f"{problem.label}: {reason}.")
        space, terms, rule = self._rule(problem.inputs)
        generator = np.random.default_rng(self.seed)
        keys = generator.uniform(size=(self.paths, sum(v.is_key for v in problem.inputs.variables)))
        test = uqmbd.extend.monte_carlo_rule(space, POINTS, self.seed + 1, "latin-hypercube").nodes
        nodes = np.concatenate([rule.nodes, test])
        fitted, tested = slice(0, len(rule.nodes)), slice(len(rule.nodes), None)
        psi = space.evaluate(nodes, terms)
        inverse = np.linalg.pinv(psi[fitted])  # for a Gauss rule this is the projection
        found = _Paths(problem, space.to_inputs(nodes), keys)
        coefficients, errors = [], []
        for response in found:
            fit = np.tensordot(inverse, response[fitted], axes=1)
            coefficients.append(fit)
            deviation = response[tested] - np.tensordot(psi[tested], fit, axes=1)
            errors.append(np.square(deviation).mean(axis=0))
        if 2 * len(coefficients) < self.paths or len(coefficients) < 2:
            raise uqmbd.IntegrationError(
                f"{problem.label}: {self.paths - len(coefficients)} of {self.paths} paths have a failed realisation; "
                f"most frequent reason: {found.reason}"
            )
        with problem.timed("error estimation"):
            statistics = statistics_of_paths(problem.labels, np.array(coefficients), np.array(errors))
        return problem.node(
            self, statistics, realisations=found.count, counters=found.counters, attrs={"failures": found.failures}
        )


class _Paths:
    """Responses (node, output, time) to one path after another; paths with a failed realisation are omitted."""

    def __init__(self, problem: uqmbd.extend.Problem, parameters: Array, keys: Array) -> None:
        self.problem, self.parameters, self.keys = problem, parameters, keys
        self.count = self.failures = 0
        self.reason = ""
        self.counters: dict[str, float] = {}

    def __iter__(self) -> Any:
        nodes = len(self.parameters)
        key = np.array([v.is_key for v in self.problem.inputs.variables])
        each = max(1, BATCH // nodes)
        for first in range(0, len(self.keys), each):
            block = self.keys[first : first + each]
            values = np.empty((len(block) * nodes, len(key)))
            values[:, key] = np.repeat(block, nodes, axis=0)
            values[:, ~key] = np.tile(self.parameters, (len(block), 1))
            found = self.problem.realise(values)
            self.count += len(values)
            self.failures += found.failures
            self.reason = self.reason or found.most_frequent_reason()
            self.counters = {k: self.counters.get(k, 0) + x for k, x in found.counters.items()} | {
                k: x for k, x in self.counters.items() if k not in found.counters
            }
            response = found.response.reshape(len(block), nodes, *found.response.shape[1:])
            good = found.good.reshape(len(block), nodes).all(axis=1)
            yield from (response[k] for k in np.flatnonzero(good))


def _obstacle(inputs: uqmbd.extend.JointInput) -> str | None:
    keys = [v.name for v in inputs.variables if v.is_key]
    if not keys:
        return "the outputs do not depend on sampled paths of random processes; use Collocation or MonteCarlo"
    if len(keys) == len(inputs):
        return "the mechanism has no random variables but its random processes; use MonteCarlo"
    return None


def statistics_of_paths(labels: uqmbd.extend.Labels, c: Array, errors: Array) -> xr.Dataset:
    """Return the statistics of coefficients (path, term, output, time) and mean square errors (path, output, time)."""
    from scipy.special import stdtrit

    count = len(c)
    total, squares = c.sum(axis=0), np.square(c - c.mean(axis=0)).sum(axis=0)
    mean, parts = _parts(total, squares, count)
    without = []
    for one in c:
        # the sum of squares about the mean without one path
        rest = squares - np.square(one - total / count) * count / (count - 1)
        without.append(_parts(total - one, rest, count - 1)[1])
    left = np.array(without)  # (path, origin, output, time)

    def error(values: Array) -> Array:
        return np.asarray(np.sqrt((count - 1) / count * np.square(values - values.mean(axis=0)).sum(axis=0)))

    with np.errstate(all="ignore"):
        std = np.sqrt(np.maximum(parts.sum(axis=0), 0.0))
        error_std = error(np.sqrt(np.maximum(left.sum(axis=1), 0.0)))
        shares, left_shares = parts / parts.sum(axis=0), left / left.sum(axis=1, keepdims=True)
    shares = np.where(std > 0, shares, 0.0)
    reach = stdtrit(count - 1, LEVEL) * np.nan_to_num(error(left_shares))
    found = uqmbd.extend.statistics_dataset(
        labels,
        mean=mean,
        std=std,
        std_error_mean=np.sqrt(squares[0] / (count - 1) / count),
        std_error_std=np.nan_to_num(error_std),
        stated_error=uqmbd.extend.StatedError(
            np.sqrt(errors.mean(axis=0)), "absolute", "error of the polynomials", remedy="increase order"
        ),
    )
    dims = ("origin", *labels.dims)
    return found.assign_coords(origin=["parameters", "paths", "both"]).assign(
        variance_share=(dims, shares),
        variance_share_interval=(("bound", *dims), np.stack([shares - reach, shares + reach])),
    )


def _parts(total: Array, squares: Array, count: int) -> tuple[Array, Array]:
    """Return the mean, and the variances due to parameters, paths and both (3, output, time), without bias."""
    mean, variance = total / count, squares / (count - 1)
    alone = np.square(mean[1:]) - variance[1:] / count
    return mean[0], np.stack([alone.sum(axis=0), variance[0], variance[1:].sum(axis=0)])
