"""The collocation propagator."""

from __future__ import annotations

import warnings
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, ClassVar, Literal, get_args

import numpy as np
import xarray as xr
from numpy.typing import NDArray

import uqmbd
from uqmbd.results import PolynomialChaos
from uqmbd_collocation.adaptive import Refinement, Step, refine_dimensions
from uqmbd_collocation.fitting import Fit, projected, regressed
from uqmbd_collocation.runs import Runs

__all__ = ["Collocation"]

Array = NDArray[np.float64]
Index = NDArray[np.int64]

Method = Literal["projection", "regression", "omp", "lars"]
Rule = Literal["gauss", "smolyak", "clenshaw-curtis", "random", "latin-hypercube", "sobol", "halton"]
Terms = Literal["total", "tensor", "hyperbolic"]
Adaptive = Literal["no", "order", "dimension"]

GRIDS = ("gauss", "smolyak", "clenshaw-curtis")
VERIFICATION = 0x7E51F1
"""Enters the seed of the verification points, which must be no points of a design."""


@dataclass(frozen=True, kw_only=True)
class Collocation(uqmbd.Propagator):
    """Polynomial chaos through realisations at chosen points.

    Parameters
    ----------
    order : int
        Highest degree of the polynomials.
    index_set : {"total", "tensor", "hyperbolic"}
        Which products of one-dimensional polynomials: a total degree of at most `order`, each degree, or few
        interactions.
    weights : tuple of float, optional
        Anisotropy: an input (in the order of their names) of weight 2 gets half the order.
    method : {"projection", "regression", "omp", "lars"}
        Pseudo-spectral projection by a quadrature rule; least squares on samples; or sparse regression, in which
        orthogonal matching pursuit or least-angle regression chooses few of the terms.
    rule : str, optional
        Where the realisations are.  For a projection ``gauss`` (tensor product, the default), ``smolyak``,
        ``clenshaw-curtis``, or samples; for a regression ``sobol`` (the default), ``latin-hypercube``, ``halton`` or
        ``random``.
    nodes : tuple of int, optional
        Gauss: nodes of each input, or one number for all; default ``order + 1``.
    level : int, optional
        Smolyak, Clenshaw-Curtis; default: the lowest that suits the order.
    samples : int, optional
        Of a design of samples; default twice the number of terms.
    adaptive : {"no", "order", "dimension"}
        Raise the order from `order` on, or refine a sparse grid input by input, until mean and standard deviation
        change by less than `tolerance`.  Every realisation is used again.
    tolerance : float
        Of a refinement: relative to the largest standard deviation of each output over time.
    max_realisations : int
        Most realisations, verification included.
    transform : {"rosenblatt", "nataf"}
        How dependent inputs become functions of independent germs.
    verify : int
        Realisations at points that no node uses, from which the error of the surrogate is stated; 0: none.
    seed : int
        Of designs and of the verification points.
    label : str, optional
        Name of the results, by default ``collocation``.

    Raises
    ------
    uqmbd.StudyError
        If an option cannot be used.

    Examples
    --------
    >>> Collocation(order=4, label="collocation-4").node_name
    'collocation-4'
    """

    name: ClassVar[str] = "collocation"
    order: int = 3
    index_set: Terms = "total"
    weights: tuple[float, ...] | None = None
    method: Method = "projection"
    rule: Rule | None = None
    nodes: tuple[int, ...] | None = None
    level: int | None = None
    samples: int | None = None
    adaptive: Adaptive = "no"
    tolerance: float = 1e-3
    max_realisations: int = 5000
    transform: Literal["rosenblatt", "nataf"] = "rosenblatt"
    verify: int = 8
    seed: int = 0

    def __post_init__(self) -> None:
        numbers = [("order", 0), ("verify", 0), ("seed", 0), ("max_realisations", 1)]
        numbers += [(n, least) for n, least in (("level", 0), ("samples", 2)) if getattr(self, n) is not None]
        for name, least in numbers:
            value = getattr(self, name)
            if not isinstance(value, int) or isinstance(value, bool) or value < least:
                raise uqmbd.StudyError(f"Collocation: {name} is {value!r}; expected a whole number, {least} or more.")
        for name, kind in (("index_set", Terms), ("method", Method), ("adaptive", Adaptive)):
            _check_choice(name, getattr(self, name), get_args(kind))
        _check_choice("transform", self.transform, ("rosenblatt", "nataf"))
        if self.rule is not None:
            _check_choice("rule", self.rule, get_args(Rule))
        if isinstance(self.nodes, (int, np.integer)):
            object.__setattr__(self, "nodes", (int(self.nodes),))
        if not self.tolerance > 0:
            raise uqmbd.StudyError(f"Collocation: tolerance is {self.tolerance!r}; expected a number above 0.")
        if self.method != "projection" and self.rule in GRIDS:
            raise uqmbd.StudyError(
                f"Collocation: method={self.method!r} fits samples, and rule is {self.rule!r}; use rule='sobol', "
                "'latin-hypercube', 'halton' or 'random', or method='projection'."
            )
        if self.adaptive == "dimension" and (self.method, self.rule) not in (
            ("projection", None),
            ("projection", "smolyak"),
        ):
            raise uqmbd.StudyError(
                "Collocation: adaptive='dimension' refines a sparse grid; leave method and rule as they are by default."
            )
        uses = {"nodes": ("gauss",), "level": ("smolyak", "clenshaw-curtis")}
        for name, rules in uses.items():
            if getattr(self, name) is not None and self._rule not in rules:
                raise uqmbd.StudyError(
                    f"Collocation: {name} is given, but means nothing for rule={self._rule!r}; "
                    f"it is for rule={' or '.join(map(repr, rules))}."
                )
        if self.samples is not None and self._rule in GRIDS:
            raise uqmbd.StudyError(
                f"Collocation: samples is given, but rule={self._rule!r} is a grid; for a grid give nodes or level, "
                "for samples a rule such as 'sobol'."
            )

    @property
    def _rule(self) -> str:
        if self.rule is not None:
            return self.rule
        if self.adaptive == "dimension":
            return "smolyak"
        return "gauss" if self.method == "projection" else "sobol"

    def obstacle(self, study: uqmbd.Study) -> str | None:
        """Say what is in the way: nothing random, or a distribution without moments."""
        if not len(study.mechanism.inputs):
            return "nothing in the mechanism is random"
        try:
            uqmbd.GermSpace.of(study.mechanism.inputs, self.transform)
        except uqmbd.StudyError as error:
            return str(error)
        return None

    def propagate(self, problem: uqmbd.Problem) -> xr.DataTree:
        """Compute realisations, fit, verify, and summarise."""
        from threadpoolctl import threadpool_limits

        if not len(problem.inputs):
            raise uqmbd.StudyError(
                f"{problem.label}: nothing in mechanism {problem.mechanism!r} is random; "
                "declare a uqmbd.RandomVariable, or use uqmbd.simulate."
            )
        space = uqmbd.GermSpace.of(problem.inputs, self.transform)
        # threads on small matrices cost more than they bring, and their number would change the last bits
        with threadpool_limits(limits=1):
            runs = Runs(problem, space)
            points = self._verification_points(space)
            fit, refinement = self._fit(runs, points, problem.label)
            where = runs.at(points)
            good = where[runs.status[where] == 0]
            chaos = PolynomialChaos(
                fit.coefficients,
                fit.multi_index,
                space,
                problem.labels,
                verification_germs=runs.germs[good] if len(good) else None,
                verification_response=runs.response[good] if len(good) else None,
            )
            if len(good) < len(where):
                warnings.warn(
                    f"{problem.label}: {len(where) - len(good)} of {len(where)} verification realisations failed; "
                    "the stated error comes from the others.",
                    stacklevel=2,
                )
            self._warn_of_idle_inputs(chaos, problem.label)
            statistics = chaos.statistics()
        if fit.leave_one_out is not None:
            note = {"long_name": "leave-one-out error of the regression, over the variance of the samples"}
            statistics = statistics.assign(leave_one_out=(problem.labels.dims, fit.leave_one_out, note))
        children = {"chaos": chaos.to_dataset(), "nodes": _nodes(runs, where, fit)}
        if refinement is not None:
            children["refinement"] = _history(refinement.steps)
        status = runs.status
        return problem.node(
            self,
            statistics,
            realisations=len(runs),
            wall_time=runs.wall_time,
            counters=dict(runs.counters),
            children=children,
            attrs={
                "failures": int((status != 0).sum()),
                "fit": fit.how,
                "terms": len(fit.multi_index),
                "nodes": len(runs) - len(where),
                "verification": len(good),
                **({} if refinement is None else {"tolerance_met": str(refinement.met)}),
            },
        )

    def _verification_points(self, space: uqmbd.GermSpace) -> Array:
        if not self.verify:
            return np.zeros((0, space.dimension))
        seed = int(np.random.SeedSequence([self.seed, VERIFICATION]).generate_state(1)[0])
        return uqmbd.monte_carlo_rule(space, self.verify, seed, "sobol").nodes

    def _fit(self, runs: Runs, points: Array, label: str) -> tuple[Fit, Refinement | None]:
        most = self.max_realisations - len(points)
        if self.adaptive == "dimension":
            runs.at(points)
            found = refine_dimensions(runs, self.tolerance, self.max_realisations, label)
            return found.fit, found
        if self.adaptive == "order":
            return self._raise_order(runs, points, label)
        solve, nodes = self._plan(runs, self.order, label)
        if len(nodes) > most:
            raise uqmbd.StudyError(
                f"{label}: {len(nodes)} nodes and {len(points)} verification realisations are more than "
                f"max_realisations = {self.max_realisations}. With {runs.space.dimension} inputs at order {self.order} "
                "use rule='smolyak', method='regression' or 'omp', adaptive='dimension', or allow more."
            )
        # nodes and verification points share their stacks
        runs.at(np.concatenate([nodes, points]))
        return solve(), None

    def _plan(self, runs: Runs, order: int, label: str) -> tuple[Callable[[], Fit], Array]:
        """Say where realisations are needed for an order, and how the chaos is found from them."""
        space = runs.space
        multi_index = uqmbd.index_set(space.dimension, order, self.index_set, self.weights)
        rule = self._rule
        if rule in GRIDS:
            quadrature = self._quadrature(space, order, multi_index)
            return (lambda: projected(runs, quadrature, multi_index, label)), quadrature.nodes
        count = self.samples or max(2 * len(multi_index), 2)
        if rule == "latin-hypercube":
            from scipy.stats import qmc

            uniform = qmc.LatinHypercube(space.dimension, rng=np.random.default_rng(self.seed)).random(count)
            germs = space.from_uniform(np.clip(uniform, 2.0**-54, 1 - 2.0**-53))
            quadrature = uqmbd.Quadrature(germs, np.full(count, 1 / count), 0, f"{count} samples, latin-hypercube")
        else:
            quadrature = uqmbd.monte_carlo_rule(space, count, self.seed, rule)
        if self.method == "projection":
            return (lambda: projected(runs, quadrature, multi_index, label)), quadrature.nodes
        return (lambda: regressed(runs, quadrature.nodes, multi_index, label, self.method)), quadrature.nodes

    def _quadrature(self, space: uqmbd.GermSpace, order: int, multi_index: Index) -> uqmbd.Quadrature:
        if self._rule == "gauss":
            given = self.nodes or (order + 1,)
            counts: Any = given[0] if len(given) == 1 else given
            if self.nodes is None and any(germ.values for germ in space.germs):
                counts = [min(order + 1, germ.values or order + 1) for germ in space.germs]
            return uqmbd.gauss_tensor(space, counts)
        if self._rule == "smolyak":
            return uqmbd.smolyak(space, order if self.level is None else self.level)
        if self.level is not None:
            return uqmbd.clenshaw_curtis(space, self.level)
        degree = int(multi_index.max(initial=0))
        # 2^level + 1 nodes, exact to that degree on uniform germs
        return uqmbd.clenshaw_curtis(space, max(1, int(np.ceil(np.log2(max(2 * degree, 2))))))

    def _raise_order(self, runs: Runs, points: Array, label: str) -> tuple[Fit, Refinement]:
        """Raise the order until mean and standard deviation stand still."""
        steps: list[Step] = []
        best: Fit | None = None
        order, met = self.order, False
        while True:
            solve, nodes = self._plan(runs, order, label)
            wanted = np.concatenate([nodes, points])
            more = len(runs.missing(wanted)) if len(runs) else len(wanted)
            if len(runs) + more > self.max_realisations:
                if best is None:
                    raise uqmbd.StudyError(
                        f"{label}: order {order} needs {more} realisations, more than max_realisations = "
                        f"{self.max_realisations}; start with a lower order, or allow more."
                    )
                warnings.warn(
                    f"{label}: the tolerance {self.tolerance:g} was not met at order {order - 1} with {len(runs)} "
                    f"realisations; order {order} needs {more} more, and max_realisations is {self.max_realisations}.",
                    stacklevel=2,
                )
                break
            runs.at(wanted)
            fit = solve()
            mean, std = _changes(best, fit)
            steps.append(Step(len(runs), len(fit.multi_index), mean, std))
            best = fit
            if max(mean, std) < self.tolerance:
                met = True
                break
            if (runs.status != 0).any():
                break  # the warning of the fit says what happened
            order += 1
        return best, Refinement(best, tuple(steps), met)

    @staticmethod
    def _warn_of_idle_inputs(chaos: PolynomialChaos, label: str) -> None:
        for k, name in enumerate(chaos.germ_names):
            involved = chaos.multi_index[:, k] > 0
            if not involved.any():
                continue
            energy = np.sqrt(np.sum(chaos.coefficients[involved] ** 2, axis=0))
            size = np.abs(chaos.coefficients).max(axis=(0, 2))[:, None]
            if bool((energy <= 1e-13 * size).all()):
                warnings.warn(
                    f"{label}: no output depends on the random input {name!r}; it costs realisations and changes "
                    "nothing. Leave it out, or observe what it changes.",
                    uqmbd.UnusedInputWarning,
                    stacklevel=2,
                )


def _check_choice(name: str, value: object, known: tuple[str, ...]) -> None:
    if value not in known:
        raise uqmbd.StudyError(f"Collocation: {name} is {value!r}; expected one of {', '.join(map(repr, known))}.")


def _changes(before: Fit | None, now: Fit) -> tuple[float, float]:
    """Largest change of mean and standard deviation over the largest standard deviation of each output over time."""
    if before is None:
        return np.inf, np.inf
    std = [np.sqrt(np.sum(f.coefficients[1:] ** 2, axis=0)) for f in (before, now)]
    mean = [f.coefficients[0] for f in (before, now)]
    rounding = 1e-12 * np.abs(mean[1]).max(axis=1) + 1e-300
    scale = np.maximum(std[1].max(axis=1), rounding)[:, None]
    return float((np.abs(mean[1] - mean[0]) / scale).max()), float((np.abs(std[1] - std[0]) / scale).max())


def _nodes(runs: Runs, verification: Index, fit: Fit) -> xr.Dataset:
    """Where the realisations were, and what became of them."""
    labels = runs.problem.labels
    purpose = np.full(len(runs), "fit", dtype="<U12")
    purpose[verification] = "verification"
    data: dict[str, Any] = {
        "inputs": (("node", "input"), runs.values),
        "germs": (("node", "germ"), runs.germs),
        "status": ("node", runs.status.astype(np.int32)),
        "message": ("node", np.array(runs.messages, dtype=str)),
        "purpose": ("node", purpose),
    }
    if fit.weights is not None and len(fit.weights) + len(verification) == len(runs):
        weights = np.zeros(len(runs))
        weights[np.setdiff1d(np.arange(len(runs)), verification)] = fit.weights
        data["weight"] = ("node", weights)
    names = np.array([str(name) for name in runs.space.names])
    return xr.Dataset(data, coords={**labels.input_coords(), "germ": names})


def _history(steps: tuple[Step, ...]) -> xr.Dataset:
    """Return the steps of a refinement."""
    columns = {
        "realisations": [s.realisations for s in steps],
        "terms": [s.terms for s in steps],
        "change_mean": [s.change_mean for s in steps],
        "change_std": [s.change_std for s in steps],
    }
    note = "largest over outputs and times, over the largest standard deviation of the output over time"
    found = xr.Dataset({name: ("step", np.array(values)) for name, values in columns.items()})
    for name in ("change_mean", "change_std"):
        found[name].attrs["comment"] = note
    return found
