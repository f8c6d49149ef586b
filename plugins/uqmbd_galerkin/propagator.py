"""Galerkin propagator."""

from __future__ import annotations

import warnings
from collections.abc import Mapping
from dataclasses import dataclass, fields, replace
from typing import Annotated, Any, ClassVar, Literal

import numpy as np
import xarray as xr

import uqmbd
from uqmbd.results import PolynomialChaos
from uqmbd.typing import Array, Index
from uqmbd_galerkin.aligned import galerkin_in_phase
from uqmbd_galerkin.clock_rates import PILOTS, watched_rates
from uqmbd_galerkin.diagnostics import motion_invariants
from uqmbd_galerkin.elements import galerkin_elements
from uqmbd_galerkin.ending import finished, horizons, no_motion, padded, warn
from uqmbd_galerkin.rules import STREAM, Discretisation, Terms
from uqmbd_galerkin.scalars import projected_scalars

__all__ = ["Galerkin"]


LinearSolver = Literal["auto", "dense", "sparse", "krylov-nodal", "krylov-mean"]


@dataclass(frozen=True, kw_only=True)
class Galerkin(uqmbd.extend.Propagator):
    """Compute the polynomial chaos of the motion by Galerkin projection, with Variational Work.

    Coordinates, velocities and multipliers are expanded in polynomials that are orthonormal for the distribution of the
    inputs. The equations of the coefficients are the Euler-Lagrange equations of the averaged Lagrangian with averaged
    virtual work. The averages are evaluated by quadrature.

    Parameters
    ----------
    order : int
        Highest degree of the polynomials.
    index_set : {"total", "tensor", "hyperbolic"}, optional
        Set of multi-indices: the total degree is at most `order`, each degree is at most `order`, or there are few
        interactions. Default: ``total`` without `elements`, ``tensor`` with `elements`. In an element, a force may
        start at a different time at each node. Only an expansion with as many terms as nodes can represent such a
        force.
    weights : tuple of float, optional
        Weight of each input, in the order of the input names. An input of weight 2 gets half the order.
    nodes : tuple of int, optional
        Number of Gauss nodes of each input, or one number for all inputs. Default: ``order + 1``, or the number of
        values of a discrete input if that is smaller. Tests with more nodes were less accurate for rotating mechanisms.
    rule : str
        Quadrature rule: ``gauss``, ``smolyak``, or the name of a sampling design. The weights of the rule must be
        positive.
    samples : int, optional
        Number of nodes, if the rule is a sampling design.
    level : int, optional
        Level of the rule ``smolyak``.
    elements : int or "adaptive", optional
        Number of boxes into which the germ space is divided, each with a separate expansion. ``adaptive`` splits boxes
        until `threshold` is met. Use elements for responses with kinks or jumps (contact, friction, locking). The parts
        of a split element are integrated from the start time.
    max_elements : int
        Largest number of elements of an adaptive refinement.
    threshold : float
        Error of the surrogate at which an adaptive refinement ends, relative to the largest standard deviation of each
        output over time.
    alignment : {"phase"}, optional
        ``phase``: the phase of a clock is the independent variable, and the time is expanded like the states. Use it if
        realisations rotate or oscillate at different rates: an expansion at equal phases is then accurate, but an
        expansion at equal times fails. Realisations with different initial phases are first integrated to the same
        phase. The clock must run in all realisations, and functions of time must be smooth. Impacts and controllers,
        which act at given times, are not supported. The results have the same form as the results of
        `Collocation(alignment="phase")`.
    clock : str, optional
        Output, body or joint whose angle or oscillation defines the phase. Default: automatic choice.
    transform : {"rosenblatt", "nataf"}
        Transform of dependent inputs to functions of independent germs.
    linear_solver : {"auto", "dense", "sparse", "krylov-nodal", "krylov-mean"}
        Linear solver of the implicit integrator.
    integrator : {"auto", "dop853", "ida"}, optional
        Integrator, as for a study. The integrator must support projected equations. Default: the integrator of the
        study.
    verify : int
        Number of verification realisations, which determine the stated error; 0: no verification. Verification points
        differ from the nodes. Half of the verification realisations have the distribution of the inputs; the others are
        in the tails and have smaller weights (:class:`uqmbd.extend.VerificationPoints`). The statistic
        ``verification_factor`` bounds the uncertainty of the stated error.
    stop_at : float, optional
        Stated error, relative to the standard deviation, at which the run ends. Results up to the end time are stored;
        the attribute ``ends_at`` contains the end time.
    seed : int
        Seed of the verification points, and of a sampling design.
    label : str, optional
        Name of the results. Default: ``galerkin``.

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
    order: Annotated[int, uqmbd.extend.Bounds(0, 1000)] = 3
    index_set: Terms | None = None
    weights: Annotated[tuple[float, ...], uqmbd.extend.Bounds(0, 10**6, above=True)] | None = None
    nodes: Annotated[tuple[int, ...], uqmbd.extend.Bounds(1, 10**6)] | None = None
    rule: str = "gauss"
    samples: Annotated[int, uqmbd.extend.Bounds(0, 10**9)] | None = None
    level: Annotated[int, uqmbd.extend.Bounds(0, 1000)] | None = None
    elements: int | Literal["adaptive"] | None = None
    max_elements: int = 32
    threshold: Annotated[float, uqmbd.extend.Bounds(0, 10**6)] = 0.01
    alignment: Literal["phase"] | None = None
    clock: str | None = None
    transform: Literal["rosenblatt", "nataf"] = "rosenblatt"
    linear_solver: LinearSolver = "auto"
    integrator: Literal["auto", "dop853", "ida"] | None = None
    verify: Annotated[int, uqmbd.extend.Bounds(0, 10**9)] = 16
    stop_at: Annotated[float, uqmbd.extend.Bounds(0, 10**6, above=True)] | None = None
    seed: Annotated[int, uqmbd.extend.Bounds(0)] = 0

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.rule == "smolyak" and self.samples is not None and self.level is None:
            warnings.warn(
                "Galerkin: with rule='smolyak', samples= is deprecated; use level= instead.",
                DeprecationWarning,
                stacklevel=3,
            )
            object.__setattr__(self, "level", self.samples)
            object.__setattr__(self, "samples", None)
        if self.samples == 0:
            raise uqmbd.StudyError("Galerkin: samples is 0; expected a whole number, 1 or more.")
        self._discretisation(self.node_name)
        if self._limits.elements is not None and (self.stop_at is not None or not self.order):
            raise uqmbd.StudyError(
                f"Galerkin: elements={self.elements!r} requires an order of 1 or more and no stop_at; order is "
                f"{self.order}, and stop_at is {self.stop_at!r}."
            )
        self._require_alignable()
        if self.stop_at is not None and not self.verify:
            raise uqmbd.StudyError(
                f"Galerkin: stop_at is {self.stop_at!r}, but verify is 0; expected 1 or more verification "
                "realisations, which determine the error."
            )

    def _require_alignable(self) -> None:
        """Raise StudyError if options contradict the alignment."""
        if self.alignment is None:
            if self.clock is not None:
                raise uqmbd.StudyError(
                    f"Galerkin: clock={self.clock!r} requires alignment='phase'; omit clock or set alignment."
                )
            return
        wrong = {
            "elements": self.elements is not None,
            "stop_at": self.stop_at is not None,
            "linear_solver": self.linear_solver != "auto",
            "integrator": self.integrator not in (None, "auto", "dop853"),
        }
        if any(wrong.values()):
            name = next(x for x, given in wrong.items() if given)
            raise uqmbd.StudyError(
                f"Galerkin: {name}={getattr(self, name)!r} contradicts alignment='phase', which integrates a single "
                f"expansion with DOP853. Omit {name}, or use collocation with alignment='phase'."
            )

    @property
    def products(self) -> Terms:
        """Index set, with a default for the other options."""
        return self._discretisation(self.node_name).products

    @property
    def _limits(self) -> uqmbd.extend.ElementLimits:
        return uqmbd.extend.ElementLimits(self.elements, self.max_elements, self.threshold)

    def _discretisation(self, label: str) -> Discretisation:
        given = {f.name: getattr(self, f.name) for f in fields(Discretisation) if f.name != "label"}
        return Discretisation(label, **given)

    def remarks(self, study: uqmbd.Study) -> tuple[str, ...]:
        """Return a text on the clock at the means of the inputs."""
        problem = study.problem(self)
        if self.alignment is None or problem.timeless or not len(study.mechanism.inputs):
            return ()
        return (uqmbd.extend.clock_at_means(problem, self.clock),)

    def estimate(self, study: uqmbd.Study) -> uqmbd.extend.Estimate:
        """Return the numbers of nodes and terms, and the memory of the states at all nodes and times."""
        space = uqmbd.extend.GermSpace.of(study.mechanism.inputs, self.transform)
        how, boxes = self._discretisation(self.node_name), self._limits.computed
        nodes, terms = how.node_count(space), len(how.basis(space))
        layout, times, outputs = study.problem(self).model.layout, len(study.times), len(study.mechanism.outputs)
        per_node = times * (layout.width + 2 * outputs) + layout.unknowns**2 + 2 * terms
        memory = 8 * (nodes * per_node + terms * times * (2 * layout.width + 2 * outputs))
        # elements are solved one after another, and only their coefficients stay in memory
        memory += 8 * (boxes - 1) * terms * times * outputs
        detail = f"{nodes} nodes, {terms} terms" + (f" in each of {boxes} elements" if boxes > 1 else "")
        verified = self._limits.verified(self.verify, space)
        # the probabilities of parts of a discrete input are unknown
        uncertain = self._limits.uncertain or verified > self._limits.verified(self.verify)
        count = boxes * nodes + verified
        if self.alignment is not None and outputs:
            # the number of times for the clock is still unknown
            pilots = max(self.verify, PILOTS)
            count += pilots
            detail += f", {pilots} realisations that select the clock (repeated if their splines need more times)"
        # coefficients of each output at each time, and some forty statistics and errors
        disk = 8 * (40 + boxes * terms) * (times * outputs + len(study.mechanism.scalars))
        return uqmbd.extend.Estimate(count, memory, detail, at_most=uncertain, disk=disk, together=True)

    def sizing(self, study: uqmbd.Study, accuracy: float | None) -> uqmbd.extend.Sizing | None:
        """Return options for an accuracy by raising the order."""
        given = any(getattr(self, name) is not None for name in ("nodes", "level", "samples", "stop_at"))
        if given or self.elements == "adaptive" or not self.verify:
            return None
        return uqmbd.extend.Sizing(
            option="order",
            at=lambda order: replace(self, order=order),
            least=1,
            falls="steps",
        )

    def watches(self, mechanism: uqmbd.Mechanism) -> Mapping[str, Any]:
        """Return the rates of possible clocks to observe."""
        return watched_rates(mechanism) if self.alignment == "phase" else {}

    def obstacle(self, study: uqmbd.Study) -> str | None:
        """Return the reason why the method cannot compute a study, or None.

        Reasons are: no random input, a distribution without moments, an unsuitable rule, integrator or clock, impacts
        that the expansion cannot represent, or no consistent pose.
        """
        if reason := uqmbd.extend.nothing_random(study.mechanism.inputs, study.mechanism.name):
            return reason
        try:
            space = uqmbd.extend.GermSpace.of(study.mechanism.inputs, self.transform)
            how = self._discretisation(self.node_name)
            terms = how.basis(space)
            rule = how.quadrature(space, terms)
            with warnings.catch_warnings():
                warnings.simplefilter("ignore", uqmbd.RedundantConstraintWarning)
                problem = study.problem(self)
            if self.alignment is not None:
                uqmbd.extend.require_outputs_over_time(problem, f"alignment={self.alignment!r}")
            # scalar outputs are evaluated at the nodes, without a projection of the motion
            if problem.model.outputs.names:
                self.require_integrator(problem)
                ensemble = problem.ensemble(space.to_inputs(rule.nodes))
                how.refuse_impacts(ensemble, terms=len(terms), nodes=len(rule.nodes))
                self._projected(self.node_name, ensemble, space, terms, rule)
                if self.clock is not None:
                    uqmbd.extend.require_clock(problem, self.clock)
        except (uqmbd.StudyError, uqmbd.AssemblyError) as error:
            return str(error).removeprefix(f"{self.node_name}: ")
        return None

    def propagate(self, problem: uqmbd.extend.Problem) -> xr.DataTree:
        """Verify, project, integrate, and return statistics."""
        if self.alignment is not None:
            uqmbd.extend.require_outputs_over_time(problem, f"alignment={self.alignment!r}")
        begin, space, how = problem.clock(), problem.germ_space(self.transform), self._discretisation(problem.label)
        terms = how.basis(space)
        rule = how.quadrature(space, terms)
        if not problem.timeless:
            self.require_integrator(problem)
            if self.alignment is not None and problem.integrator not in ("auto", "dop853") and self.integrator is None:
                raise uqmbd.StudyError(
                    f"{problem.label}: alignment='phase' requires the integrator DOP853, but the integrator of the "
                    f"study is {problem.integrator!r}. Use integrator='dop853', or collocation."
                )
            one = problem.ensemble(space.to_inputs(rule.nodes[:1]))
            how.refuse_impacts(one, terms=len(terms), nodes=len(rule.nodes))
        if self.elements is not None:
            solvers = (self.integrator or problem.integrator, self.linear_solver)
            return galerkin_elements(self, problem, space, self._limits, (how, *solvers, self.verify), begin)
        if not problem.timeless:
            seen = problem if self.alignment is None else problem.watching()
            ensemble = seen.ensemble(space.to_inputs(rule.nodes))
            projected = self._projected(problem.label, ensemble, space, terms, rule)
        points = uqmbd.extend.VerificationPoints.drawn(space, self.verify, self.seed, STREAM)
        with problem.timed("verification"):
            verification = uqmbd.extend.Verification.of(space, points, problem.realise(space.to_inputs(points.germs)))
        if problem.timeless:
            return projected_scalars(self, problem, space, terms, rule, verification, begin)
        if verification.failures:
            warnings.warn(
                f"{problem.label}: {verification.failures} of {self.verify} verification realisations failed. In "
                "part of the support of the inputs, the response does not exist at some times, and an expansion over "
                "the whole support is unreliable. The failed realisations represent about "
                f"{max(verification.lost, 1e-6):.1g} of the probability. Truncate the distributions. Reason: "
                f"{verification.reason}",
                stacklevel=2,
            )

        if self.alignment is not None:
            pilots = uqmbd.extend.monte_carlo_rule(space, max(self.verify, PILOTS), self.seed, "sobol").nodes
            about = (terms, rule, projected, verification, space.to_inputs(pilots), self.clock)
            return galerkin_in_phase(self, problem, space, *about, begin)

        def respond(coefficients: Array, count: int) -> PolynomialChaos:
            nodal = projected.nodal(coefficients[:, :count])
            response = ensemble.outputs(problem.times[:count], nodal)
            return verification.chaos(projected.project(response), terms, problem.labels)

        def watch(coefficients: Array) -> bool:
            return bool(horizons(respond(coefficients, finished(coefficients)), limit, problem.rtol))

        limit = self.stop_at or np.inf
        problem.progress.start(problem.label, len(rule))
        with problem.timed("integration"):
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
            # include times up to the horizon, but no later times
            count = int(np.searchsorted(problem.times, min(stopped.values())))
            if count < 2:
                name = min(stopped, key=lambda key: stopped[key])
                raise uqmbd.IntegrationError(
                    f"{problem.label}: the stated error of {name!r} exceeds stop_at = {limit:g} at the first output "
                    "times, so no usable results remain. Raise the order, or stop_at."
                )
            chaos = respond(found.coefficients, count)
        wall_time = problem.clock() - begin
        problem.progress.advance(problem.label, len(rule))
        problem.progress.finish(problem.label)
        warn(problem, chaos, found.message, stopped, self.order, self.stop_at)
        children = {
            "chaos": chaos.to_dataset(),
            "diagnostics": motion_invariants(projected, problem.times[:count], found.coefficients[:, :count], terms),
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
                "failed_share": verification.failed_share([verification], [1.0], len(rule), 0),
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

    def require_integrator(self, problem: uqmbd.extend.Problem) -> None:
        """Raise StudyError if the integrator does not support projected equations, or their events."""
        remedy = f"Use {type(self).__name__}(integrator=...) or a study with"
        problem.require("projected", self.integrator, remedy)
        # other events only record their time
        if any(directions for *_, directions in problem.model.events):
            problem.require("events", self.integrator, remedy)

    def _projected(
        self,
        label: str,
        ensemble: uqmbd.extend.Ensemble,
        space: uqmbd.extend.GermSpace,
        terms: Index,
        rule: uqmbd.extend.Quadrature,
    ) -> uqmbd.extend.ProjectedEnsemble:
        try:
            found = uqmbd.extend.ProjectedEnsemble(ensemble, space.evaluate(rule.nodes, terms), rule.weights)
        except uqmbd.AssemblyError as error:
            raise no_motion(label, error) from None
        if self.alignment is not None:
            found.require_phase()
        return found
