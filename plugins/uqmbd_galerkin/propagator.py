"""The Galerkin propagator."""

from __future__ import annotations

import warnings
from dataclasses import dataclass
from typing import Any, ClassVar, Literal, get_args

import numpy as np
import xarray as xr

import uqmbd
from uqmbd.results import PolynomialChaos
from uqmbd.typing import Array, Index
from uqmbd_galerkin.diagnostics import diagnostics
from uqmbd_galerkin.elements import galerkin_elements
from uqmbd_galerkin.ending import finished, padded, warn
from uqmbd_galerkin.impacts import refuse_impacts
from uqmbd_galerkin.rules import basis, estimate, quadrature
from uqmbd_galerkin.scalars import projected_scalars
from uqmbd_galerkin.verification import Verification, horizons

__all__ = ["Galerkin"]


Terms = Literal["total", "tensor", "hyperbolic"]
Rule = Literal["gauss", "smolyak", "sobol", "halton", "random"]
LinearSolver = Literal["auto", "dense", "sparse", "krylov-nodal", "krylov-mean"]


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
    index_set : {"total", "tensor", "hyperbolic"}, optional
        Which products of one-dimensional polynomials.  Default: those of a total degree of at most `order`; with
        `elements` all products (``tensor``).  There a force may set in at each node at another time, which an expansion
        only follows that has as many terms as nodes: with fewer it drags the others along.
    weights : tuple of float, optional
        Anisotropy: an input (in the order of their names) of weight 2 gets half the order.
    nodes : tuple of int, optional
        Gauss nodes of each input, or one number for all; default ``order + 1``, which was measured to be more accurate
        on rotating mechanisms than more.
    rule : {"gauss", "sobol", "halton", "random", "smolyak"}
        Of the quadrature; its weights must be positive.
    samples : int, optional
        Nodes of a rule of samples.
    level : int, optional
        Of ``smolyak``.
    elements : int or "adaptive", optional
        Split the germ space into so many boxes, or until `threshold` is met, each with an expansion of its own: where
        the response has a kink or jumps (contact, friction, locking).  A split element starts again at the beginning.
    max_elements : int
        Most elements of an adaptive refinement.
    threshold : float
        Of an adaptive refinement: error of the surrogate, over the largest standard deviation of each output over time.
    transform : {"rosenblatt", "nataf"}
        How dependent inputs become functions of independent germs.
    linear_solver : {"auto", "dense", "sparse", "krylov-nodal", "krylov-mean"}
        Of the implicit integrator, where it is used.
    integrator : {"auto", "dop853", "ida"}, optional
        As for a study; default: that of the study, which must be able to integrate projected equations.
    verify : int
        Realisations at points that no node uses, from which the error is stated; 0: none.
    stop_at : float, optional
        Stated error, over the standard deviation, at which the run ends instead of going on; results up to that horizon
        are kept, and the attribute ``ends_at`` says where they end.
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
    index_set: Terms | None = None
    weights: tuple[float, ...] | None = None
    nodes: tuple[int, ...] | None = None
    rule: Rule = "gauss"
    samples: int | None = None
    level: int | None = None
    elements: int | Literal["adaptive"] | None = None
    max_elements: int = 32
    threshold: float = 0.01
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
            ("index_set", (*get_args(Terms), None)),
            ("rule", get_args(Rule)),
            ("transform", ("rosenblatt", "nataf")),
            ("linear_solver", get_args(LinearSolver)),
            ("integrator", ("auto", "dop853", "ida", None)),
        )
        for name, known in choices:
            if getattr(self, name) not in known:
                listed = ", ".join(map(repr, known))
                raise uqmbd.StudyError(f"Galerkin: {name} is {getattr(self, name)!r}; expected one of {listed}.")
        if self.nodes is not None:
            given: Any = self.nodes  # as anybody may have given it
            if isinstance(given, (int, np.integer)):
                given = (int(given),)
            elif not isinstance(given, (tuple, list)):
                given = (None,)
            if not given or not all(isinstance(x, (int, np.integer)) and x > 0 for x in given):
                raise uqmbd.StudyError(
                    f"Galerkin: nodes is {self.nodes!r}; expected a number of Gauss nodes above 0, or one per input."
                )
            object.__setattr__(self, "nodes", tuple(int(x) for x in given))
        if self.rule == "smolyak" and self.samples is not None and self.level is None:
            warnings.warn(
                "Galerkin: samples= as the level of rule='smolyak' is deprecated; give level=.",
                DeprecationWarning,
                stacklevel=3,
            )
            object.__setattr__(self, "level", self.samples)
            object.__setattr__(self, "samples", None)
        if self.level is not None:
            if self.rule != "smolyak" or self.samples is not None:
                raise uqmbd.StudyError(
                    f"Galerkin: level is {self.level!r}, for rule='smolyak' without samples; rule is {self.rule!r}, "
                    f"samples {self.samples!r}."
                )
            if isinstance(self.level, bool) or not isinstance(self.level, (int, np.integer)) or self.level < 0:
                raise uqmbd.StudyError(f"Galerkin: level is {self.level!r}; expected a whole number, 0 or more.")
        if self.samples is not None and not (isinstance(self.samples, (int, np.integer)) and self.samples > 0):
            raise uqmbd.StudyError(f"Galerkin: samples is {self.samples!r}; expected a whole number above 0.")
        if self.samples is not None and self.rule == "gauss":
            raise uqmbd.StudyError(
                "Galerkin: samples is given, but rule='gauss' is a grid; give nodes, or a rule of samples, as 'sobol'."
            )
        if self.weights is not None:
            each: Any = self.weights if isinstance(self.weights, (tuple, list)) else (None,)
            if not each or not all(isinstance(x, (int, float, np.number)) and x > 0 for x in each):
                raise uqmbd.StudyError(
                    f"Galerkin: weights is {self.weights!r}; expected one positive number for each input."
                )
        if self.nodes is not None and self.rule != "gauss":
            other = "level" if self.rule == "smolyak" else "samples"
            raise uqmbd.StudyError(f"Galerkin: nodes is for rule='gauss'; for rule={self.rule!r} give {other}.")
        if self.rule == "smolyak" and self.level is None:
            raise uqmbd.StudyError("Galerkin: rule='smolyak' needs level=.")
        if self.rule not in ("gauss", "smolyak") and self.samples is None:
            raise uqmbd.StudyError(f"Galerkin: rule={self.rule!r} needs samples=how many.")
        uqmbd.ElementLimits("adaptive" if self.elements is None else self.elements, self.max_elements, self.threshold)
        if self.elements is not None:
            if self.stop_at is not None or not self.order:
                raise uqmbd.StudyError(
                    f"Galerkin: elements={self.elements!r} needs an order of 1 or more, and cannot be combined with "
                    f"stop_at; order is {self.order}, stop_at {self.stop_at!r}."
                )
        usable = isinstance(self.stop_at, (int, float, np.number)) and not isinstance(self.stop_at, bool)
        if self.stop_at is not None and not (usable and 0 < self.stop_at < np.inf and self.verify):
            raise uqmbd.StudyError(
                f"Galerkin: stop_at is {self.stop_at!r} with verify={self.verify}; expected an error above 0, such as "
                "0.05, and verification realisations that can tell it."
            )

    def estimate(self, study: uqmbd.Study) -> uqmbd.Estimate:
        """Count nodes and terms, and the memory of what is known at all nodes and times."""
        return estimate(self, study)

    def obstacle(self, study: uqmbd.Study) -> str | None:
        """Say what is in the way: nothing random, a distribution without moments, a rule that does not fit, no pose."""
        if not len(study.mechanism.inputs):
            return (
                f"nothing in mechanism {study.mechanism.name!r} is random; declare a uqmbd.RandomVariable, or use "
                "uqmbd.simulate"
            )
        try:
            space = uqmbd.GermSpace.of(study.mechanism.inputs, self.transform)
            terms = basis(self, space)
            rule = quadrature(self, self.node_name, space, terms)
            with warnings.catch_warnings():
                warnings.simplefilter("ignore", uqmbd.RedundantConstraintWarning)
                problem = study.problem(self)
            # outputs without a time are evaluated at the nodes: the motion is not projected for them
            if problem.model.outputs.names:
                self.require_integrator(problem)
                ensemble = problem.ensemble(space.to_inputs(rule.nodes))
                refuse_impacts(self, ensemble, terms=len(terms), nodes=len(rule.nodes))
                self._projected(self.node_name, ensemble, space, terms, rule)
        except (uqmbd.StudyError, uqmbd.AssemblyError) as error:
            return str(error).removeprefix(f"{self.node_name}: ")
        return None

    def propagate(self, problem: uqmbd.Problem) -> xr.DataTree:
        """Verify, project, integrate, and summarise."""
        from threadpoolctl import threadpool_limits

        if not len(problem.inputs):
            raise uqmbd.StudyError(
                f"{problem.label}: nothing in mechanism {problem.mechanism!r} is random; "
                "declare a uqmbd.RandomVariable, or use uqmbd.simulate."
            )
        begin = problem.clock()
        try:
            space = uqmbd.GermSpace.of(problem.inputs, self.transform)
        except uqmbd.StudyError as error:
            raise uqmbd.StudyError(f"{problem.label}: {error}") from None
        with threadpool_limits(limits=1):
            return self._propagate(problem, space, begin)

    def _propagate(self, problem: uqmbd.Problem, space: uqmbd.GermSpace, begin: float) -> xr.DataTree:
        terms = basis(self, space)
        rule = quadrature(self, problem.label, space, terms)
        if not problem.timeless:
            self.require_integrator(problem)
            one = problem.ensemble(space.to_inputs(rule.nodes[:1]))
            refuse_impacts(self, one, terms=len(terms), nodes=len(rule.nodes))
        if self.elements is not None:
            return galerkin_elements(self, problem, space, begin)
        if problem.timeless:
            verification = Verification(problem, space, self.verify, self.seed)
            return projected_scalars(self, problem, space, terms, rule, verification, begin)
        ensemble = problem.ensemble(space.to_inputs(rule.nodes))
        projected = self._projected(problem.label, ensemble, space, terms, rule)
        verification = Verification(problem, space, self.verify, self.seed)
        if verification.failures:
            warnings.warn(
                f"{problem.label}: {verification.failures} of {self.verify} verification realisations fail, so the "
                "response does not exist, or not for all times, in part of the support of the inputs; an expansion "
                f"over all of it means little. Truncate the distributions. Reason: {verification.reason}",
                stacklevel=3,
            )

        def respond(coefficients: Array, count: int) -> PolynomialChaos:
            nodal = projected.nodal(coefficients[:, :count])
            response = ensemble.outputs(problem.times[:count], nodal)
            return verification.chaos(projected.project(response), terms, count)

        def watch(coefficients: Array) -> bool:
            return bool(horizons(respond(coefficients, finished(coefficients)), limit, problem.rtol))

        limit = self.stop_at or np.inf
        problem.progress.start(problem.label, 1)
        found = projected.integrate(
            problem.times,
            problem.rtol,
            self.integrator or problem.integrator,
            self.linear_solver,
            watch if self.stop_at is not None else None,
        )
        count = finished(found.coefficients)
        chaos = respond(found.coefficients, count)
        stopped = horizons(chaos, limit, problem.rtol)
        if stopped:
            # up to the horizon, and not beyond
            count = int(np.searchsorted(problem.times, min(stopped.values())))
            if count < 2:
                name = min(stopped, key=lambda key: stopped[key])
                raise uqmbd.IntegrationError(
                    f"{problem.label}: the stated error of {name!r} passes stop_at = {limit:g} at the first times "
                    "already; nothing usable is left. Raise the order, or stop_at."
                )
            chaos = respond(found.coefficients, count)
        wall_time = problem.clock() - begin
        problem.progress.finish(problem.label)
        warn(problem, chaos, found.message, stopped, self.order, self.stop_at)
        children = {
            "chaos": chaos.to_dataset(),
            "diagnostics": diagnostics(projected, problem.times[:count], found.coefficients[:, :count], terms),
        }
        return problem.node(
            self,
            padded(chaos.statistics(), problem.times),
            realisations=len(rule) + self.verify,
            wall_time=wall_time,
            counters=found.counters,
            children=children,
            attrs={
                "failures": verification.failures,
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

    def require_integrator(self, problem: uqmbd.Problem) -> None:
        """Raise where the integrator cannot integrate projected equations, or not across the events that there are."""
        remedy = f"Use {type(self).__name__}(integrator=...) or a study with"
        problem.require("projected", self.integrator, remedy)
        # other events only note when they happen
        if any(directions for *_, directions in problem.model.events):
            problem.require("events", self.integrator, remedy)

    @property
    def products(self) -> Terms:
        """The index set, chosen to suit if none is given."""
        return self.index_set or ("total" if self.elements is None else "tensor")

    def _projected(
        self, label: str, ensemble: uqmbd.Ensemble, space: uqmbd.GermSpace, terms: Index, rule: uqmbd.Quadrature
    ) -> uqmbd.ProjectedEnsemble:
        try:
            return uqmbd.ProjectedEnsemble(ensemble, space.evaluate(rule.nodes, terms), rule.weights)
        except uqmbd.AssemblyError as error:
            raise uqmbd.AssemblyError(
                f"{label}: {str(error).rstrip('.')}. An expansion needs a motion at every node: truncate the "
                "distributions, or use Monte Carlo, which counts such samples."
            ) from None
