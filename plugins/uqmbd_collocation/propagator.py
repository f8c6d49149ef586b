"""The collocation propagator."""

from __future__ import annotations

import warnings
from dataclasses import dataclass
from typing import ClassVar, Literal

import numpy as np
import xarray as xr

import uqmbd
from uqmbd.results import PolynomialChaos, Status
from uqmbd.typing import Array
from uqmbd_collocation.adaptive import refine_dimensions
from uqmbd_collocation.alignment import align_with_events
from uqmbd_collocation.elements import collocate_elements
from uqmbd_collocation.fitting import Fit
from uqmbd_collocation.options import GRIDS, Adaptive, Method, Rule, Terms, Transform, check_options
from uqmbd_collocation.orders import raise_order
from uqmbd_collocation.plans import estimate, plan, verification_points
from uqmbd_collocation.record import nodes_dataset, warn_of_idle_inputs
from uqmbd_collocation.refinement import Limits, Refinement, history
from uqmbd_collocation.runs import Runs, announced_once

__all__ = ["Collocation"]


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
        Gauss: nodes of each input (in the order of their names), or one number for all; default one more than the
        highest degree in it.
    level : int, optional
        Smolyak, Clenshaw-Curtis; default: the lowest that suits the order.
    samples : int, optional
        Of a design of samples; default twice the number of terms; for sparse regression not more than 100, or than
        terms.
    adaptive : {"no", "order", "dimension"}
        Raise the order from `order` on, or refine a sparse grid input by input, until mean and standard deviation
        change by less than `tolerance`, and the verification realisations agree.  No realisation is computed twice.
        Higher orders need all realisations of lower ones again for ``sobol``, ``halton``, ``random`` and (with levels
        that double) ``clenshaw-curtis``, most of them for ``smolyak``; Gauss tensors share their middle nodes only.
    tolerance : float
        Of a refinement: relative to the largest standard deviation of each output over time.
    max_realisations : int
        Most realisations, verification included.
    elements : int or "adaptive", optional
        Split the germ space into so many boxes, or until `threshold` is met, each with a chaos of its own: where the
        response jumps or has a kink (contact, friction, locking).  A split element is computed anew.
    max_elements : int
        Most elements of an adaptive refinement.
    threshold : float
        Of an adaptive refinement: error of the surrogate, over the largest standard deviation of each output over time.
    alignment : {"events"}, optional
        For mechanisms with events (impacts): expand the times of events, and the motion between them in normalised
        time, separately.  Outputs at a fixed time jump with the inputs where an event is early or late; these do not.
        Where the sequence of events is not the same everywhere the germ space is split first, into `max_elements`
        boxes at most.
    transform : {"rosenblatt", "nataf"}
        How dependent inputs become functions of independent germs.
    verify : int
        Realisations at points that no node uses, from which the error of the surrogate is stated; 0: none.  They
        end a refinement, so that after one the stated error is a little more likely to be small than without.
        Eight points hardly see what is rare: for least squares on few samples of normal inputs, which errs in the
        tails, look at the leave-one-out error too.
    seed : int
        Of designs and of the verification points.
    label : str, optional
        Name of the results, by default ``collocation``.

    Raises
    ------
    uqmbd.StudyError
        If an option cannot be used, or options contradict each other.

    Warns
    -----
    UserWarning
        If realisations failed, a tolerance was not met, or a rule is too coarse for the basis.
    uqmbd.UnusedInputWarning
        If no output depends on an input.

    References
    ----------
    D. Xiu, Numerical Methods for Stochastic Computations, Princeton University Press, 2010.

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
    elements: int | Literal["adaptive"] | None = None
    max_elements: int = 32
    threshold: float = 0.01
    alignment: Literal["events"] | None = None
    transform: Transform = "rosenblatt"
    verify: int = 8
    seed: int = 0

    def __post_init__(self) -> None:
        check_options(self)

    @property
    def design(self) -> str:
        """The rule, chosen to suit the method if none is given."""
        if self.rule is not None:
            return self.rule
        if self.adaptive == "dimension":
            return "smolyak"
        return "gauss" if self.method == "projection" else "sobol"

    @property
    def grid(self) -> str:
        """The rule if it is a grid, else empty."""
        return self.design if self.design in GRIDS else ""

    def estimate(self, study: uqmbd.Study) -> uqmbd.Estimate:
        """Count realisations, and the memory of their outputs and of the chaos."""
        return estimate(self, study)

    def obstacle(self, study: uqmbd.Study) -> str | None:
        """Say what is in the way: nothing random, a distribution without moments, too many nodes, too few samples."""
        if not len(study.mechanism.inputs):
            return (
                f"nothing in mechanism {study.mechanism.name!r} is random; declare a uqmbd.RandomVariable, or use "
                "uqmbd.simulate"
            )
        try:
            space = uqmbd.GermSpace.of(study.mechanism.inputs, self.transform)
            if self.alignment is not None:
                study.problem(self).require("segments")
            if self.adaptive != "dimension":
                plan(self, space, self.order, self.node_name).check(space)
        except uqmbd.StudyError as error:
            return str(error)
        return None

    def propagate(self, problem: uqmbd.Problem) -> xr.DataTree:
        """Compute realisations, fit, verify, and summarise.

        Raises
        ------
        uqmbd.StudyError
            If an option does not suit the inputs.
        uqmbd.IntegrationError
            If failures leave too few realisations.
        """
        from threadpoolctl import threadpool_limits

        if not len(problem.inputs):
            raise uqmbd.StudyError(
                f"{problem.label}: nothing in mechanism {problem.mechanism!r} is random; "
                "declare a uqmbd.RandomVariable, or use uqmbd.simulate."
            )
        try:
            space = uqmbd.GermSpace.of(problem.inputs, self.transform)
        except uqmbd.StudyError as error:
            raise uqmbd.StudyError(f"{problem.label}: {error}") from None
        # threads on small matrices cost more than they bring, and their number would change the last bits
        if self.alignment is not None and not problem.timeless:
            with threadpool_limits(limits=1):
                return align_with_events(self, problem, space)
        if self.elements is not None:
            with threadpool_limits(limits=1):
                return collocate_elements(self, problem, space)
        with threadpool_limits(limits=1):
            points = verification_points(space, self.verify, self.seed)
            runs, fit, refinement = self._computed(problem, space, points)
            where = runs.at(points)
            good = where[runs.good(where)]
            if len(good) < len(where):
                warnings.warn(
                    f"{problem.label}: {len(where) - len(good)} of {len(where)} verification realisations failed; the "
                    f"stated error comes from the others. Reason of the failure: {runs.reason(where)}",
                    stacklevel=2,
                )
            chaos = PolynomialChaos(
                fit.coefficients,
                fit.multi_index,
                space,
                problem.labels,
                verification_germs=runs.germs[good] if len(good) else None,
                verification_response=runs.response[good] if len(good) else None,
            )
            warn_of_idle_inputs(runs, fit, problem.label)
            # a refinement has words of its own, and samples that are too few look the same
            plain = self.adaptive == "no" and bool(self.grid)
            suspicions = [one.words() for one in chaos.discontinuities() if plain and one and one.clear]
            if suspicions:
                warnings.warn(f"{problem.label}: {'; '.join(suspicions)}.", stacklevel=2)
            statistics = chaos.statistics()
        if fit.leave_one_out is not None:
            note = {"long_name": "leave-one-out error of the regression, over the variance of the samples"}
            statistics = statistics.assign(leave_one_out=(problem.labels.dims, fit.leave_one_out, note))
        children = {"chaos": chaos.to_dataset(), "nodes": nodes_dataset(runs, where, fit)}
        attrs = {
            "failures": int((runs.status != Status.OK).sum()),
            "fit": fit.how,
            "terms": len(fit.multi_index),
            "highest_degree": int(fit.multi_index.max()),
            "nodes": len(np.unique(fit.where)) + fit.failed,
            "verification": len(good),
        }
        if refinement is not None:
            children["refinement"] = history(refinement.steps)
            attrs["tolerance_met"] = str(refinement.met)
        return problem.node(
            self,
            statistics,
            realisations=len(runs),
            wall_time=runs.wall_time,
            counters=dict(runs.counters),
            children=children,
            attrs=attrs,
        )

    def _computed(
        self, problem: uqmbd.Problem, space: uqmbd.GermSpace, points: Array
    ) -> tuple[Runs, Fit, Refinement | None]:
        """Compute what is needed, and fit."""
        label = problem.label
        if self.adaptive == "no":
            planned, runs = plan(self, space, self.order, label), Runs(problem, space)
            planned.check(space)
            # nodes and verification points share their stacks
            runs.at(np.concatenate([planned.nodes, points]))
            return runs, planned.fit(runs), None
        limits = Limits(self.tolerance, self.max_realisations, problem.rtol)
        runs = Runs(announced_once(problem, self.max_realisations), space)
        if self.adaptive == "dimension":
            found = refine_dimensions(runs, points, limits, label)
        else:
            found = raise_order(runs, points, lambda k: plan(self, space, k, label), self.order, limits, label)
        problem.progress.finish(label)
        return runs, found.fit, found
