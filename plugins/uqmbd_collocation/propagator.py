"""The collocation propagator."""

from __future__ import annotations

import warnings
from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import Annotated, Any, ClassVar, Literal

import numpy as np
import xarray as xr

import uqmbd
from uqmbd.results import Status
from uqmbd_collocation.alignment import EventPaths, PhasePaths, align
from uqmbd_collocation.computing import computed
from uqmbd_collocation.elements import collocate_elements
from uqmbd_collocation.plans import Adaptive, Method, Plans, Terms
from uqmbd_collocation.record import nodes_dataset, warn_of_failures, warn_of_idle_inputs
from uqmbd_collocation.refinement import Limits, history
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
        ``clenshaw-curtis``, or samples; for a regression ``sobol`` (the default), ``latin-hypercube``, ``halton``,
        ``random``, or a sampling design of a plugin.
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
    alignment : {"events", "phase"}, optional
        Compare realisations at landmarks instead of at equal times, and expand the times of landmarks and the motion
        between them, in normalised time, separately.  Where the sequence of landmarks is not the same everywhere the
        germ space is split first, into `max_elements` boxes at most; with `elements` it is split by the error, which is
        large there.  Results tell the share of realisations that still have another sequence (``mixed``).

        ``events``, for mechanisms with impacts: outputs at a fixed time jump with the inputs where an event is early or
        late; these do not.

        ``phase``, for motions that turn or swing for long: phases drift apart, and no order follows outputs at a fixed
        time for long; at a quarter of a turn each they stay alike.  It needs a clock, and realisations that run longer,
        until the last has reached the phase of the first; one that fails there, behind the last output time, before it
        has reached the phase has failed.  What turns may turn backwards in some realisations, or swing: these get
        elements of their own.  So do those where the clock stands, which are compared at equal times; a warning tells
        their share (``standing``).  Where there is no clock the method refuses.
    clock : str, optional
        For ``phase``: name of an output, or of a body or joint that has an angle.  An angle that grows is the phase;
        else that of the oscillation, in the plane of value and rate.  Default: what turns in some realisations, else
        what swings in most, the steadier first; the results say which.
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
    order: Annotated[int, uqmbd.Bounds(0)] = 3
    index_set: Terms = "total"
    weights: Annotated[tuple[float, ...], uqmbd.Bounds(0, above=True)] | None = None
    method: Method = "projection"
    rule: str | None = None
    nodes: Annotated[tuple[int, ...], uqmbd.Bounds(1)] | None = None
    level: Annotated[int, uqmbd.Bounds(0)] | None = None
    samples: Annotated[int, uqmbd.Bounds(2)] | None = None
    adaptive: Adaptive = "no"
    tolerance: Annotated[float, uqmbd.Bounds(0, above=True)] = 1e-3
    max_realisations: Annotated[int, uqmbd.Bounds(1)] = 5000
    elements: int | Literal["adaptive"] | None = None
    max_elements: int = 32
    threshold: float = 0.01
    alignment: Literal["events", "phase"] | None = None
    clock: str | None = None
    transform: Literal["rosenblatt", "nataf"] = "rosenblatt"
    verify: Annotated[int, uqmbd.Bounds(0)] = 8
    seed: Annotated[int, uqmbd.Bounds(0)] = 0

    def __post_init__(self) -> None:
        super().__post_init__()
        self._plans(self.node_name)
        if self._limits.elements is not None:
            if self.adaptive != "no":
                raise uqmbd.StudyError(
                    f"Collocation: elements={self.elements!r} contradicts adaptive={self.adaptive!r}; elements are "
                    "refined by splitting, at a fixed order."
                )
            if not self.order:
                raise uqmbd.StudyError(
                    "Collocation: elements are split by their top order; order is 0, expected 1 or more."
                )
        if self.clock is not None and self.alignment != "phase":
            raise uqmbd.StudyError(f"Collocation: clock={self.clock!r} means nothing without alignment='phase'.")
        split, aligned = self.elements is not None, self.alignment is not None
        for name, used, what in (
            ("tolerance", self.adaptive != "no", "adaptive='no'"),
            ("max_elements", split or aligned, "elements=None"),
            ("threshold", split, "elements=None"),
        ):
            if not used and (given := getattr(self, name)) != getattr(Collocation, name):
                text = f"Collocation: {name}={given!r} has no effect with {what}; leave it out, or change the latter."
                warnings.warn(text, uqmbd.StudyWarning, stacklevel=3)

    @property
    def design(self) -> str:
        """The rule, chosen to suit the method if none is given."""
        return self._plans(self.node_name).design

    @property
    def grid(self) -> str:
        """The rule if it is a grid, else empty."""
        return self._plans(self.node_name).grid

    @property
    def _limits(self) -> uqmbd.ElementLimits:
        return uqmbd.ElementLimits(self.elements, self.max_elements, self.threshold)

    def _plans(self, label: str) -> Plans:
        return Plans(label, **{f.name: getattr(self, f.name) for f in fields(Plans) if f.name != "label"})

    def watches(self, mechanism: uqmbd.Mechanism) -> Mapping[str, Any]:
        """Watch the angles of bodies and joints, where a clock is looked for."""
        return uqmbd.watched_angles(mechanism) if self.alignment == "phase" else {}

    def estimate(self, study: uqmbd.Study) -> uqmbd.Estimate:
        """Count realisations, and the memory of their outputs and of the chaos."""
        space = uqmbd.GermSpace.of(study.mechanism.inputs, self.transform)
        values = len(study.mechanism.outputs) * len(study.times) + len(study.mechanism.scalars)
        if self.adaptive != "no":
            most = self.max_realisations
            return uqmbd.Estimate(most, 8 * 3 * most * values, f"{most} realisations", at_most=True)
        planned = self._plans(self.node_name).plan(space, self.order)
        nodes, terms, boxes = len(planned.nodes), len(planned.multi_index), self._limits.computed
        one = (nodes + self.verify) * (3 * values + terms) + 3 * terms * values
        detail = f"{nodes} nodes, {terms} terms" + (f" in each of {boxes} elements" if boxes > 1 else "")
        if self.alignment is not None:
            # nodes are followed longer, most of them twice; nobody knows yet where sequences differ
            detail += ", which are followed longer; more where landmarks differ"
            return uqmbd.Estimate(2 * boxes * nodes + self.verify, 16 * boxes * one, detail)
        return uqmbd.Estimate(boxes * nodes + self.verify, 8 * boxes * one, detail, at_most=self._limits.adaptive)

    def obstacle(self, study: uqmbd.Study) -> str | None:
        """Say what is in the way: nothing random, a distribution without moments, too many nodes, too few samples."""
        if reason := uqmbd.nothing_random(study.mechanism.inputs, study.mechanism.name):
            return reason
        try:
            space = uqmbd.GermSpace.of(study.mechanism.inputs, self.transform)
            if self.clock is not None:
                uqmbd.require_clock(study.problem(self), self.clock)
            if self.alignment == "events":
                study.problem(self).require("segments")
            if self.adaptive != "dimension":
                self._plans(self.node_name).plan(space, self.order).check(space)
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
        space, plans = problem.germ_space(self.transform), self._plans(problem.label)
        if self.alignment is not None and not problem.timeless:
            paths: EventPaths | PhasePaths
            paths = EventPaths(problem) if self.alignment == "events" else PhasePaths(problem, self.clock)
            limits = Limits(self.tolerance, self.max_realisations, problem.rtol)
            return align(self, problem, space, plans, paths, self._limits, limits)
        if self.elements is not None:
            return collocate_elements(self, problem, space, plans, self._limits)
        points = plans.verification_points(space)
        limits = Limits(self.tolerance, self.max_realisations, problem.rtol)
        once = problem if self.adaptive == "no" else announced_once(problem, self.max_realisations)
        runs = Runs(once, space)
        fit, refinement = computed(runs, plans, points, limits)
        if refinement is not None:
            problem.progress.finish(problem.label)
        verification = runs.verification(points)
        warn_of_failures(verification, problem.label)
        chaos = verification.chaos(fit.coefficients, fit.multi_index, problem.labels)
        warn_of_idle_inputs(runs, fit, problem.label)
        # a refinement has words of its own, and samples that are too few look the same
        plain = self.adaptive == "no" and bool(plans.grid)
        suspicions = [one.words() for one in chaos.discontinuities() if plain and one and one.clear]
        if suspicions:
            warnings.warn(f"{problem.label}: {'; '.join(suspicions)}.", stacklevel=2)
        statistics = chaos.statistics()
        if fit.leave_one_out is not None:
            note = {"long_name": "leave-one-out error of the regression, over the variance of the samples"}
            statistics = statistics.assign(leave_one_out=(problem.labels.dims, fit.leave_one_out, note))
        children = {"chaos": chaos.to_dataset(), "nodes": nodes_dataset(runs, runs.at(points), fit)}
        attrs = {
            "failures": int((runs.status != Status.OK).sum()),
            "fit": fit.how,
            "terms": len(fit.multi_index),
            "highest_degree": int(fit.multi_index.max()),
            "nodes": len(np.unique(fit.where)) + fit.failed,
            "verification": len(verification.germs),
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
