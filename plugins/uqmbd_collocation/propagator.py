"""The collocation propagator."""

from __future__ import annotations

import warnings
from collections.abc import Mapping
from dataclasses import dataclass, fields, replace
from typing import Annotated, Any, ClassVar, Literal

import numpy as np
import xarray as xr

import uqmbd
from uqmbd.typing import Array
from uqmbd_collocation.alignment import EventTrajectories, PhaseTrajectories, align
from uqmbd_collocation.elements import collocate_elements, with_further
from uqmbd_collocation.expanded import Expanded
from uqmbd_collocation.families import FAMILIES, Family, expand_families, impossible
from uqmbd_collocation.plain import expand
from uqmbd_collocation.plans import DEFAULT_ORDER, Adaptive, Method, Plans, Terms
from uqmbd_collocation.refinement import Limits
from uqmbd_collocation.runs import announced_once
from uqmbd_collocation.two_frequency import expand_series
from uqmbd_collocation.user_expansion import UserExpansion

__all__ = ["Collocation"]

FEW = 40
"""Numbers of each output at each time in the results, besides coefficients: statistics and errors."""

BOUND = 10.0
"""Accuracy over the tolerance of its refinement. The bound from few verification realisations is larger than the change
that ends the refinement."""


@dataclass(frozen=True, kw_only=True)
class Collocation(uqmbd.extend.Propagator):
    """Polynomial chaos through realisations at chosen points.

    Parameters
    ----------
    order : int, optional
        Highest degree of the polynomials; default 3.  With a `level` of ``smolyak``, and neither `index_set` nor
        `weights`, the default is None: all terms that the level resolves.
    index_set : {"total", "tensor", "hyperbolic"}
        Which products of one-dimensional polynomials: a total degree of at most `order`, each degree, or few
        interactions.
    weights : tuple of float, optional
        Anisotropy: an input (in the order of their names) of weight 2 gets half the order.  With `expansion`: array,
        shape (K,), weights of the nodes, of sum 1.
    method : {"projection", "regression", "omp", "lars"}
        Pseudo-spectral projection by a quadrature rule (``smolyak``: by many small tensor rules, each on the terms that
        it resolves); least squares on samples; or sparse regression, in which orthogonal matching pursuit or
        least-angle regression chooses few of the terms.
    rule : str, optional
        Where the realisations are.  For a projection ``gauss`` (tensor product, the default), ``smolyak``,
        ``clenshaw-curtis``, or samples; for a regression ``sobol`` (the default), ``latin-hypercube``, ``halton``,
        ``random``, or a sampling design of a plugin.
    nodes : tuple of int, optional
        Gauss: nodes of each input (in the order of their names), or one number for all; default one more than the
        highest degree in it.  With `expansion`: array, shape (input, K), values of the inputs.
    level : int, optional
        Smolyak: sum of the levels of all inputs; at level l an input has ``2 l + 1`` Gauss nodes and degrees up to
        ``2 l``.  Default: the levels that the terms of the order need, and one more of each input alone.
        Clenshaw-Curtis: default: the lowest that suits the order.
    samples : int, optional
        Of a design of samples; default twice the number of terms; for sparse regression not more than 100, or than
        terms.
    adaptive : {"no", "order", "dimension"}
        Raise the order from `order` on, or refine a sparse grid input by input. The refinement ends when mean and
        standard deviation change by less than `tolerance`, and the verification realisations agree. No realisation is
        computed twice. Higher orders reuse all realisations of lower ones for ``sobol``, ``halton``, ``random`` and
        (with levels that double) ``clenshaw-curtis``, and most for ``smolyak``. Gauss tensors share middle nodes only.
    tolerance : float
        Of a refinement: relative to the largest standard deviation of each output over time.
    max_realisations : int
        Most different realisations of each alignment, verification included. A realisation that is integrated again,
        for longer or at more times, counts once here, but again in ``realisations`` of the results.
    elements : int or "adaptive", optional
        Split the germ space into so many boxes, or until `threshold` is met, each with a separate chaos. This suits
        responses that jump or have a kink (contact, friction, locking). A split element is computed anew.
    max_elements : int
        Most elements of an adaptive refinement.
    threshold : float
        Of an adaptive refinement: error of the surrogate, over the largest standard deviation of each output over time.
    alignment : {"events", "phase", "two-frequency", "auto"} or tuple of str, optional
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

        ``two-frequency``, for motions that swing with one or two frequencies and do not die down, as a double pendulum
        at moderate angles: there is no clock that all share.  Each realisation is a sum of harmonics of its own
        frequencies, which are found by its spectrum, and fitted; frequencies and amplitudes are expanded.  It needs no
        landmarks, and splits the germ space by `elements` only.  Motions that are no such sums (chaotic, damped, with
        impacts) are refused, with what is left of them; the attributes ``frequency_1``, ``frequency_2``
        (``frequency_units``), ``harmonics`` and ``residual`` (largest over nodes and outputs, over the root mean square
        of the motion) tell the fit.

        A tuple of ``plain`` (at equal times), ``events``, ``phase`` and ``two-frequency``: at each time, each output
        takes one whose error at the verification realisations is near the smallest: at most 1.25 times as large, plus
        9e-4 of the largest standard deviation over time.  An output has one alignment at all times if one satisfies
        this; otherwise it changes as seldom as possible, at times at which both alignments differ least.

        Where both ``events`` and ``phase`` are named, and the clock is an angle that grows in all nodes,
        ``events+phase`` is one more: events are landmarks, and between them equal phases that all nodes pass between
        the same events; others are dropped (attributes ``phases_between_events`` and ``phases_dropped``).  It suits
        outputs that depend on both; near an event it is no better than events.

        ``auto``: of all that are possible for the mechanism; of ``two-frequency`` only if the others leave an error
        above 1 % of the largest standard deviation.  The attributes ``alignment``, ``alignment_error`` and
        ``alignment_left_out`` (JSON) state the choice and its error, and why others are impossible.
    clock : str, optional
        For ``phase``, alone or among others: name of an output, or of a body or joint that has an angle.  An angle that
        grows is the phase; else that of the oscillation, from extreme to extreme, whose size and middle may change
        slowly.  Default: what turns in some realisations, else what swings in most, the steadier first; the results say
        which.
    expansion : numpoly.ndpoly, optional
        Polynomials of chaospy, of the inputs in the order of their names, with `nodes` and `weights` of a rule of
        chaospy: ``chaospy.generate_expansion(order, joint)`` and ``chaospy.generate_quadrature(order, joint)``.  The
        chaos is the projection on what they span, in orthonormal polynomials of the germs.  `order` has no meaning
        then.  A warning reports polynomials that are not orthogonal for the distributions of the inputs, and a rule
        that is too coarse for them; polynomials of other distributions are refused.
    transform : {"rosenblatt", "nataf"}
        How dependent inputs become functions of independent germs.
    verify : int
        Realisations at points that no node uses, from which the error of the surrogate is stated; 0: none.  Half of
        them are spread like the inputs, half like squares of polynomials of these, which are large in the tails; the
        mean square error is weighted for the inputs' own distribution (:class:`uqmbd.extend.VerificationPoints`).
        The points are the same for every order, and never enter coefficients.  They end a refinement, so that after
        one the stated error is a little more likely to be small than without. Sixteen state the error to within a
        factor of two for nearly all seeds. 32 do so even if the error grows fast in the tails of several inputs. The
        statistic ``verification_factor`` states the factor; verdicts name outputs for which it is more than two.
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
    uqmbd.SurrogateWarning
        If the stated error of an output is large at some times.

    References
    ----------
    D. Xiu, Numerical Methods for Stochastic Computations, Princeton University Press, 2010.

    Examples
    --------
    >>> Collocation(order=4, label="collocation-4").node_name
    'collocation-4'
    """

    name: ClassVar[str] = "collocation"
    order: Annotated[int, uqmbd.extend.Bounds(0, 1000)] | None = None
    index_set: Terms = "total"
    weights: Annotated[tuple[float, ...], uqmbd.extend.Bounds(0, 10**6, above=True)] | Array | None = None
    method: Method = "projection"
    rule: str | None = None
    nodes: Annotated[tuple[int, ...], uqmbd.extend.Bounds(1, 10**6)] | Array | None = None
    level: Annotated[int, uqmbd.extend.Bounds(0, 1000)] | None = None
    samples: Annotated[int, uqmbd.extend.Bounds(2, 10**9)] | None = None
    adaptive: Adaptive = "no"
    tolerance: Annotated[float, uqmbd.extend.Bounds(0, 10**6, above=True)] = 1e-3
    max_realisations: Annotated[int, uqmbd.extend.Bounds(1, 10**9)] = 5000
    elements: int | Literal["adaptive"] | None = None
    max_elements: int = 32
    threshold: Annotated[float, uqmbd.extend.Bounds(0, 10**6)] = 0.01
    alignment: Literal["events", "phase", "two-frequency", "auto"] | tuple[Family, ...] | None = None
    clock: str | None = None
    expansion: Any = None
    transform: Literal["rosenblatt", "nataf"] = "rosenblatt"
    verify: Annotated[int, uqmbd.extend.Bounds(0, 10**9)] = 16
    seed: Annotated[int, uqmbd.extend.Bounds(0)] = 0

    def __post_init__(self) -> None:
        super().__post_init__()
        self._take_expansion()
        everything = self.rule == "smolyak" and self.level is not None
        if self.order is None and not (everything and self.index_set == "total" and self.weights is None):
            object.__setattr__(self, "order", DEFAULT_ORDER)
        self._plans(self.node_name)
        if self._limits.elements is not None:
            if self.adaptive != "no":
                raise uqmbd.StudyError(
                    f"Collocation: elements={self.elements!r} contradicts adaptive={self.adaptive!r}; elements are "
                    "refined by splitting, at a fixed order."
                )
            if self.order == 0 or (self.order is None and self.level == 0):
                raise uqmbd.StudyError(
                    "Collocation: elements are split by their top order; order is 0, expected 1 or more."
                )
        if self.clock is not None and "phase" not in self.families:
            raise uqmbd.StudyError(f"Collocation: clock={self.clock!r} means nothing without alignment='phase'.")
        self._check_families()
        split, aligned = self.elements is not None, self.alignment not in (None, "two-frequency")
        for name, used, what in (
            ("tolerance", self.adaptive != "no", "adaptive='no'"),
            ("max_elements", split or aligned, "elements=None"),
            ("threshold", split, "elements=None"),
        ):
            if not used and (given := getattr(self, name)) != getattr(Collocation, name):
                text = f"Collocation: {name}={given!r} has no effect with {what}; leave it out, or change the latter."
                warnings.warn(text, uqmbd.StudyWarning, stacklevel=3)

    def _take_expansion(self) -> None:
        """Store a given expansion with its rule, as plain numbers; `nodes` and `weights` then belong to it."""
        if self.expansion is None:
            for name, what in (("nodes", "a whole number of 1 or more"), ("weights", "a number above 0")):
                if isinstance(given := getattr(self, name), np.ndarray):
                    raise uqmbd.StudyError(
                        f"Collocation: {name} is an array of the shape {given.shape}; expected {what} for each input, "
                        "or its expansion: expansion=."
                    )
            return
        for name, usual in (("order", (None, DEFAULT_ORDER)), ("transform", (Collocation.transform,))):
            if (given := getattr(self, name)) not in usual:
                raise uqmbd.StudyError(f"Collocation: {name}={given!r} means nothing with expansion=; leave it out.")
        if isinstance(self.expansion, UserExpansion) and self.nodes is None and self.weights is None:
            return
        object.__setattr__(self, "expansion", UserExpansion.of(self.expansion, self.nodes, self.weights))
        object.__setattr__(self, "nodes", None)
        object.__setattr__(self, "weights", None)

    @property
    def design(self) -> str:
        """The rule, chosen to suit the method if none is given."""
        return self._plans(self.node_name).design

    @property
    def grid(self) -> str:
        """The rule if it is a grid, else empty."""
        return self._plans(self.node_name).grid

    @property
    def families(self) -> tuple[Family, ...]:
        """The ways to expand that `alignment` names; none: at equal times, as ever."""
        if self.alignment is None:
            return ()
        if self.alignment == "auto":
            return FAMILIES
        return (self.alignment,) if isinstance(self.alignment, str) else tuple(self.alignment)

    def _check_families(self) -> None:
        """Refuse options that contradict a choice between families."""
        if self.alignment is None or self.alignment in ("events", "phase", "two-frequency"):
            return
        given = f"Collocation: alignment={self.alignment!r}"
        if len(self.families) < 2 or len(set(self.families)) < len(self.families):
            raise uqmbd.StudyError(
                f"{given}; a tuple names two or more different families, of {', '.join(map(repr, FAMILIES))}. One is "
                "given as a word, as alignment='phase', and plain is alignment=None."
            )
        if not self.verify:
            raise uqmbd.StudyError(
                f"{given} chooses by the error at verification realisations, and verify is 0; expected 1 or more."
            )
        if self.elements is not None:
            raise uqmbd.StudyError(
                f"{given} contradicts elements={self.elements!r}: elements are refined for one family; name it, as "
                "alignment='phase'. Where sequences of landmarks differ families split by themselves, into "
                "max_elements boxes at most."
            )

    @property
    def _limits(self) -> uqmbd.extend.ElementLimits:
        return uqmbd.extend.ElementLimits(self.elements, self.max_elements, self.threshold)

    def _plans(self, label: str) -> Plans:
        return Plans(label, **{f.name: getattr(self, f.name) for f in fields(Plans) if f.name != "label"})

    def watches(self, mechanism: uqmbd.Mechanism) -> Mapping[str, Any]:
        """Watch the angles of bodies and joints, where a clock is looked for."""
        return uqmbd.extend.watched_angles(mechanism) if "phase" in self.families else {}

    def remarks(self, study: uqmbd.Study) -> tuple[str, ...]:
        """Return the clock at the means of the inputs, as text."""
        problem = study.problem(self)
        if "phase" not in self.families or problem.timeless or not len(study.mechanism.inputs):
            return ()
        return (uqmbd.extend.clock_at_means(problem, self.clock),)

    def estimate(self, study: uqmbd.Study) -> uqmbd.extend.Estimate:
        """Count realisations, and the memory of their outputs and of the chaos."""
        space = uqmbd.extend.GermSpace.of(study.mechanism.inputs, self.transform)
        values = len(study.mechanism.outputs) * len(study.times) + len(study.mechanism.scalars)
        ways, left_out = self._possible(study)
        if self.adaptive != "no":
            most = self.max_realisations * len(ways)
            return uqmbd.extend.Estimate(
                most, 8 * 3 * most * values, f"{most} realisations{left_out}", at_most=True, disk=8 * FEW * values
            )
        planned = self._plans(self.node_name).plan(space, self.order)
        nodes, terms, boxes = len(planned.nodes), len(planned.multi_index), self._limits.computed
        one = (nodes + self.verify) * (3 * values + terms) + 3 * terms * values
        disk = 8 * values * (FEW + boxes * terms)
        detail = f"{nodes} nodes, {terms} terms" + (f" in each of {boxes} elements" if boxes > 1 else "")
        if ways != ("plain",):
            # nodes are followed longer, most of them twice; nobody knows yet where sequences differ
            detail += ", which are followed longer; more where landmarks differ"
            aligned = [name for name in ways if name != "plain"]
            # a plain chaos reads those that are followed for a clock
            alone = nodes if "plain" in ways and "phase" not in ways else 0
            count = 2 * boxes * nodes * len(aligned) + alone + self.verify
            detail += f"; families {', '.join(ways)}" if len(ways) > 1 else ""
            return uqmbd.extend.Estimate(count, 16 * boxes * one * len(ways), detail + left_out, disk=disk)
        count = boxes * nodes + self._limits.verified(self.verify)
        further = bool(self.verify) and boxes > 1  # where elements are wrong, which is not known before
        most, uncertain = with_further(count) if further else count, self._limits.uncertain or further
        return uqmbd.extend.Estimate(most, 8 * boxes * one, detail, at_most=uncertain, disk=disk)

    def sizing(self, study: uqmbd.Study, accuracy: float | None) -> uqmbd.extend.Sizing | None:
        """Raise the order; a refinement is bounded by its realisations, and ends at the accuracy."""
        if self.adaptive != "no":
            tolerance = self.tolerance if accuracy is None else accuracy / BOUND
            space = uqmbd.extend.GermSpace.of(study.mechanism.inputs, self.transform)
            return uqmbd.extend.Sizing(
                option="max_realisations",
                at=lambda most: replace(self, max_realisations=most, tolerance=tolerance),
                least=len(self._plans(self.node_name).first_nodes(space)) + self.verify,
                falls="itself",
                also=("tolerance",),
                bound=self.max_realisations,
            )
        given = any(getattr(self, name) is not None for name in ("nodes", "level", "samples", "expansion"))
        if given or self.elements == "adaptive" or not self.verify:
            return None
        return uqmbd.extend.Sizing(
            option="order",
            at=lambda order: replace(self, order=order),
            least=1,
            falls="steps",
        )

    def _possible(self, study: uqmbd.Study) -> tuple[tuple[Family, ...], str]:
        """Return the possible families, and messages on the omitted ones."""
        ways = self.families or FAMILIES[:1]
        if self.alignment != "auto":
            return ways, ""
        reasons = {name: impossible(study.problem(self), name) for name in ways}
        said = "; ".join(f"left out: {name}, {why}" for name, why in reasons.items() if why)
        return tuple(name for name in ways if not reasons[name]), f"; {said}" if said else ""

    def obstacle(self, study: uqmbd.Study) -> str | None:
        """Return the obstacle: nothing random, a distribution without moments, too many nodes, too few samples."""
        if reason := uqmbd.extend.nothing_random(study.mechanism.inputs, study.mechanism.name):
            return reason
        try:
            space = uqmbd.extend.GermSpace.of(study.mechanism.inputs, self.transform)
            if self.families:
                uqmbd.extend.require_outputs_over_time(study.problem(self), f"alignment={self.alignment!r}")
            if self.clock is not None:
                uqmbd.extend.require_clock(study.problem(self), self.clock)
            ways = () if self.alignment == "auto" else self.families
            if why := next(filter(None, (impossible(study.problem(self), name) for name in ways)), ""):
                return why
            if self.adaptive != "dimension":
                self._plans(self.node_name).plan(space, self.order).check(space)
        except uqmbd.StudyError as error:
            return str(error)
        return None

    def propagate(self, problem: uqmbd.extend.Problem) -> xr.DataTree:
        """Compute realisations, fit, verify, and summarise.

        Raises
        ------
        uqmbd.StudyError
            If an option does not suit the inputs.
        uqmbd.IntegrationError
            If failures leave too few realisations.
        """
        space, plans = problem.germ_space(self.transform), self._plans(problem.label)
        limits = Limits(self.tolerance, self.max_realisations, problem.rtol)
        begin = problem.clock()
        if self.families:
            uqmbd.extend.require_outputs_over_time(problem, f"alignment={self.alignment!r}")
        if self.families and not problem.timeless:
            with problem.timed("fitting"):
                found = self._aligned(problem, space, plans, limits)
            problem.progress.finish(problem.label)
            return found.node(self, problem, problem.clock() - begin)
        if self.elements is not None:
            return collocate_elements(self, problem, space, plans, self._limits)
        once = problem if self.adaptive == "no" else announced_once(problem, self.max_realisations)
        with problem.timed("fitting"):
            found, wall_time = expand(once, space, plans, limits)
        if self.adaptive != "no":
            problem.progress.finish(problem.label)
        return found.node(self, problem, wall_time)

    def _aligned(
        self, problem: uqmbd.extend.Problem, space: uqmbd.extend.GermSpace, plans: Plans, limits: Limits
    ) -> Expanded:
        about = (self._limits, limits)
        if len(self.families) > 1:
            wanted = self.alignment != "auto"
            return expand_families(problem, space, plans, *about, self.families, self.clock, wanted=wanted)
        (family,) = self.families
        if family == "two-frequency":
            return expand_series(problem, space, plans, *about)
        paths = EventTrajectories(problem) if family == "events" else PhaseTrajectories(problem, self.clock)
        return align(problem, space, plans, paths, *about)
