"""The Galerkin propagator."""

from __future__ import annotations

import time as clock
import warnings
from dataclasses import dataclass
from typing import Any, ClassVar, Literal, get_args

import numpy as np
import xarray as xr
from numpy.typing import NDArray

import uqmbd
from uqmbd.results import PolynomialChaos
from uqmbd_galerkin.diagnostics import diagnostics
from uqmbd_galerkin.verification import Verification

__all__ = ["Galerkin"]

Array = NDArray[np.float64]
Index = NDArray[np.int64]

Terms = Literal["total", "tensor", "hyperbolic"]
Rule = Literal["gauss", "smolyak", "sobol", "halton", "random"]
LinearSolver = Literal["auto", "dense", "sparse", "krylov-nodal", "krylov-mean"]

DOUBTFUL = 0.1
"""Stated error, over the standard deviation, from which a result is not given without a warning."""

MOST_NODES = 20_000
"""Nodes beyond which the coupled problem is not set up."""


@dataclass(frozen=True, kw_only=True)
class Galerkin(uqmbd.Propagator):
    """Polynomial chaos of the motion itself: the equations of motion of the coefficients, by Variational Work.

    Coordinates, velocities and multipliers are expanded in polynomials that are orthonormal for the inputs; the
    equations of their coefficients are the Euler-Lagrange equations of the averaged Lagrangian with averaged virtual
    work, evaluated by quadrature.

    Parameters
    ----------
    order : int
        Highest degree of the polynomials.
    index_set : {"total", "tensor", "hyperbolic"}
        Which products of one-dimensional polynomials.
    weights : tuple of float, optional
        Anisotropy: an input (in the order of their names) of weight 2 gets half the order.
    nodes : tuple of int, optional
        Gauss nodes of each input, or one number for all; default ``order + 1``, which was measured to be more accurate
        on rotating mechanisms than more.
    rule : {"gauss", "sobol", "halton", "random", "smolyak"}
        Of the quadrature; its weights must be positive.
    samples : int, optional
        Nodes of a rule of samples, or level of ``smolyak``.
    transform : {"rosenblatt", "nataf"}
        How dependent inputs become functions of independent germs.
    linear_solver : {"auto", "dense", "sparse", "krylov-nodal", "krylov-mean"}
        Of the implicit integrator, where it is used.
    integrator : {"auto", "dop853", "ida"}, optional
        As for a study; default: that of the study.
    verify : int
        Realisations at points that no node uses, from which the error is stated; 0: none.
    stop_at : float, optional
        Stated error, over the standard deviation, at which the run ends instead of going on.
    seed : int
        Of the verification points, and of a rule of samples.
    label : str, optional
        Name of the results, by default ``galerkin``.

    Raises
    ------
    uqmbd.StudyError
        If an option cannot be used.

    Examples
    --------
    >>> Galerkin(order=4, label="galerkin-4").node_name
    'galerkin-4'
    """

    name: ClassVar[str] = "galerkin"
    order: int = 3
    index_set: Terms = "total"
    weights: tuple[float, ...] | None = None
    nodes: tuple[int, ...] | None = None
    rule: Rule = "gauss"
    samples: int | None = None
    transform: Literal["rosenblatt", "nataf"] = "rosenblatt"
    linear_solver: LinearSolver = "auto"
    integrator: Literal["auto", "dop853", "ida"] | None = None
    verify: int = 8
    stop_at: float | None = None
    seed: int = 0

    def __post_init__(self) -> None:
        for name, least in (("order", 0), ("verify", 0), ("seed", 0)):
            value = getattr(self, name)
            if not isinstance(value, int) or isinstance(value, bool) or value < least:
                raise uqmbd.StudyError(f"Galerkin: {name} is {value!r}; expected a whole number, {least} or more.")
        choices = (
            ("index_set", get_args(Terms)),
            ("rule", get_args(Rule)),
            ("transform", ("rosenblatt", "nataf")),
            ("linear_solver", get_args(LinearSolver)),
            ("integrator", ("auto", "dop853", "ida", None)),
        )
        for name, known in choices:
            if getattr(self, name) not in known:
                listed = ", ".join(map(repr, known))
                raise uqmbd.StudyError(f"Galerkin: {name} is {getattr(self, name)!r}; expected one of {listed}.")
        if isinstance(self.nodes, (int, np.integer)):
            object.__setattr__(self, "nodes", (int(self.nodes),))
        if self.nodes is not None and self.rule != "gauss":
            raise uqmbd.StudyError(f"Galerkin: nodes is for rule='gauss'; for rule={self.rule!r} give samples.")
        if self.rule != "gauss" and self.samples is None:
            what = "the level" if self.rule == "smolyak" else "how many"
            raise uqmbd.StudyError(f"Galerkin: rule={self.rule!r} needs samples={what}.")
        if self.stop_at is not None and not (self.stop_at > 0 and self.verify):
            raise uqmbd.StudyError(
                f"Galerkin: stop_at is {self.stop_at!r} with verify={self.verify}; expected an error above 0, such as "
                "0.05, and verification realisations that can tell it."
            )

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
        """Verify, project, integrate, and summarise."""
        from threadpoolctl import threadpool_limits

        if not len(problem.inputs):
            raise uqmbd.StudyError(
                f"{problem.label}: nothing in mechanism {problem.mechanism!r} is random; "
                "declare a uqmbd.RandomVariable, or use uqmbd.simulate."
            )
        begin = clock.perf_counter()
        space = uqmbd.GermSpace.of(problem.inputs, self.transform)
        with threadpool_limits(limits=1):
            return self._propagate(problem, space, begin)

    def _propagate(self, problem: uqmbd.Problem, space: uqmbd.GermSpace, begin: float) -> xr.DataTree:
        terms = uqmbd.index_set(space.dimension, self.order, self.index_set, self.weights)
        rule = self._quadrature(problem.label, space, terms)
        verification = Verification(problem, space, self.verify, self.seed)
        if verification.failures:
            warnings.warn(
                f"{problem.label}: {verification.failures} of {self.verify} verification realisations fail, so the "
                "response does not exist, or not for all times, in part of the support of the inputs; an expansion "
                f"over all of it means little. Truncate the distributions. Reason: {verification.reason}",
                stacklevel=3,
            )
        ensemble = problem.ensemble(space.to_inputs(rule.nodes))
        try:
            projected = uqmbd.ProjectedEnsemble(ensemble, space.evaluate(rule.nodes, terms), rule.weights)
        except uqmbd.AssemblyError as error:
            raise uqmbd.AssemblyError(
                f"{problem.label}: {error} An expansion needs a motion at every node: truncate the distributions, or "
                "use Monte Carlo, which counts such samples."
            ) from None

        def respond(coefficients: Array, count: int) -> PolynomialChaos:
            nodal = projected.nodal(coefficients[:, :count])
            response = ensemble.outputs(problem.times[:count], nodal)
            return verification.chaos(projected.project(response), terms, count)

        def watch(coefficients: Array) -> bool:
            count = _finished(coefficients)
            error = respond(coefficients, count).verification_error()[:, -1]
            return bool((error > self.stop_at).any())

        problem.progress.start(problem.label, 1)
        found = projected.integrate(
            problem.times,
            problem.rtol,
            self.integrator or (problem.integrator if problem.integrator in ("auto", "dop853", "ida") else "auto"),
            self.linear_solver,
            watch if self.stop_at is not None else None,
        )
        count = _finished(found.coefficients)
        chaos = respond(found.coefficients, count)
        problem.progress.finish(problem.label)
        self._warn(problem, chaos, found.message, count)
        children = {
            "chaos": chaos.to_dataset(),
            "diagnostics": diagnostics(projected, problem.times[:count], found.coefficients[:, :count], terms),
        }
        failures = {"failures": verification.failures}
        return problem.node(
            self,
            _padded(chaos.statistics(), problem.times),
            realisations=len(rule) + self.verify,
            wall_time=clock.perf_counter() - begin,
            counters=found.counters,
            children=children,
            attrs={
                **failures,
                "terms": len(terms),
                "nodes": len(rule),
                "unknowns": projected.unknowns,
                "quadrature": rule.name,
                "integrated_by": found.integrator,
                "start_corrections": projected.start.corrections,
                "verification": self.verify - verification.failures,
                **({} if count == len(problem.times) else {"ends_at": float(problem.times[count - 1])}),
            },
        )

    def _quadrature(self, label: str, space: uqmbd.GermSpace, terms: Index) -> uqmbd.Quadrature:
        if self.rule == "gauss":
            given = self.nodes or (self.order + 1,)
            counts: Any = given[0] if len(given) == 1 else given
            if self.nodes is None:
                counts = [min(self.order + 1, germ.values or self.order + 1) for germ in space.germs]
            total = int(np.prod(np.broadcast_to(counts, space.dimension), dtype=object))
            if total > MOST_NODES:
                raise uqmbd.StudyError(
                    f"{label}: {total} nodes for {space.dimension} inputs at order {self.order} are too many for a "
                    "coupled problem; lower the order, give weights, or use rule='sobol' with samples=..."
                )
            rule = uqmbd.gauss_tensor(space, counts)
        elif self.rule == "smolyak":
            rule = uqmbd.smolyak(space, int(self.samples or 0))
        else:
            rule = uqmbd.monte_carlo_rule(space, int(self.samples or 1), self.seed, self.rule)
        if not (rule.weights > 0).all():
            raise uqmbd.StudyError(
                f"{label}: the rule ({rule.name}) has negative weights, with which averaged masses can be negative; "
                "use rule='gauss' or samples."
            )
        wrong = uqmbd.gram_error(space, rule, terms)
        if wrong > 0.5:
            raise uqmbd.StudyError(
                f"{label}: the rule ({rule.name}) cannot tell the {len(terms)} terms of the basis apart (their "
                f"products are wrong by {wrong:.2g}); use more nodes, or a lower order."
            )
        return rule

    def _warn(self, problem: uqmbd.Problem, chaos: PolynomialChaos, message: str, count: int) -> None:
        """Say where the result must not be trusted."""
        times, label = problem.times, problem.label
        remedy = "raise the order, use collocation with elements or Monte Carlo, or study a shorter time"
        if message:
            warnings.warn(
                f"{label}: the projected motion ended at t = {times[count - 1]:.6g} s of {times[-1]:g} s; results are "
                f"given up to there. {message} The expansion of order {self.order} may have stopped being valid: "
                f"{remedy}.",
                stacklevel=4,
            )
        elif count < len(times):
            warnings.warn(
                f"{label}: stopped at t = {times[count - 1]:.6g} s of {times[-1]:g} s, where the stated error passed "
                f"stop_at = {self.stop_at:g}; results are given up to there. To go further, {remedy}.",
                stacklevel=4,
            )
        if chaos.verification_germs is None:
            return
        # what varies by the tolerance of the integration only has no error worth a word
        noise = 100 * problem.rtol * np.abs(chaos.mean).max(axis=1)
        quiet = {o.name for o, x, n in zip(problem.labels.outputs, chaos.std.max(axis=1), noise, strict=True) if x <= n}
        horizon = {name: t for name, t in chaos.horizon(DOUBTFUL).items() if t is not None and name not in quiet}
        for name, t in horizon.items():
            warnings.warn(
                f"{label}: the error of {name!r} passes {DOUBTFUL:.0%} of its standard deviation at t = {t:.6g} s; do "
                f"not trust it from there on: {remedy}.",
                stacklevel=4,
            )


def _finished(coefficients: Array) -> int:
    """How many times are computed."""
    good = np.isfinite(coefficients).all(axis=(0, 2))
    return int(np.argmin(good)) if not good.all() else len(good)


def _padded(statistics: xr.Dataset, times: Array) -> xr.Dataset:
    """Statistics at all times, NaN where the motion had ended."""
    if len(statistics["time"]) == len(times):
        return statistics
    attrs = statistics["time"].attrs
    found = statistics.reindex(time=times)
    found["time"].attrs.update(attrs)
    return found
