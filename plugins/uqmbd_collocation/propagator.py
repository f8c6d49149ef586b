"""Collocation propagator.

Length: a paragraph documents each option.
"""

from __future__ import annotations

import warnings
from collections.abc import Mapping
from dataclasses import dataclass, fields, replace
from functools import partial
from typing import Annotated, Any, ClassVar, Literal

import numpy as np
import xarray as xr

import uqmbd
from uqmbd.typing import Array
from uqmbd_collocation.alignment import EventTrajectories, PhaseTrajectories, align
from uqmbd_collocation.elements import collocate_elements
from uqmbd_collocation.expanded import Expanded
from uqmbd_collocation.families import FAMILIES, Family, expand_families, impossible
from uqmbd_collocation.plain import expand
from uqmbd_collocation.plans import DEFAULT_ORDER, Adaptive, Method, Plans, Terms
from uqmbd_collocation.refinement import Limits
from uqmbd_collocation.runs import announced_once
from uqmbd_collocation.sizing import TOLERANCE, estimated, possible_families, sized
from uqmbd_collocation.two_frequency import expand_series
from uqmbd_collocation.user_expansion import UserExpansion

__all__ = ["Collocation"]


@dataclass(frozen=True, kw_only=True)
class Collocation(uqmbd.extend.Propagator):
    """Compute a polynomial chaos from realisations at chosen points.

    Parameters
    ----------
    order : int, optional
        Highest degree of the polynomials; default 3. If ``rule="smolyak"`` has a `level`, but no `index_set` or
        `weights`, the default is None: the chaos contains all terms that the level resolves.
    index_set : {"total", "tensor", "hyperbolic"}
        Set of multi-indices: the total degree is at most `order`, each degree is at most `order`, or there are few
        interactions.
    weights : tuple of float, optional
        Weight of each input, in the order of the input names. An input of weight 2 gets half the order. With
        `expansion`, `weights` contains the weights of the nodes: an array of shape (K,) with the sum 1.
    method : {"projection", "regression", "omp", "lars"}
        Computation of the coefficients. ``projection`` is pseudo-spectral projection by a quadrature rule. For
        ``smolyak``, it combines small tensor rules, and each of them projects on the terms that it resolves.
        ``regression`` is least squares on samples. ``omp`` and ``lars`` are sparse regression, which selects few terms
        by orthogonal matching pursuit or least-angle regression.
    rule : str, optional
        Rule that chooses the nodes. For a projection: ``gauss`` (the default), ``smolyak``, ``clenshaw-curtis``, or a
        sampling design. ``gauss`` is a tensor product and ``smolyak`` a sparse grid of Gauss rules. ``clenshaw-curtis``
        is a tensor product of nested rules, see `uqmbd.extend.clenshaw_curtis`. For a regression: ``sobol`` (the
        default), ``latin-hypercube``, ``halton``, ``random``, or a design of a plugin.
    nodes : tuple of int, optional
        Number of Gauss nodes of each input, in the order of the input names, or one number for all inputs. Default: one
        more than the highest degree in the input. With `expansion`, `nodes` contains the values of the inputs: an array
        of shape (input, K).
    level : int, optional
        Level of the rule ``smolyak`` or ``clenshaw-curtis``. For ``smolyak``, the sparse grid combines all levels of
        the inputs whose sum is at most `level`. At level l, an input has ``2l + 1`` Gauss nodes and degrees up to
        ``2l``. By default, the grid contains the levels that the terms of the order need, and one more level of each
        single input. For ``clenshaw-curtis``, every input has the same level l. The number of nodes of an input is
        ``2^l + 1`` (level 0: one node), or ``2^(l+1) - 1`` if its distribution is unbounded. By default, each input has
        the lowest level that is exact for products of two terms of uniform inputs.
    samples : int, optional
        Number of points of a sampling design. Default: twice the number of terms. For sparse regression, the default is
        limited to 100, or to the number of terms if there are more than 100 terms.
    adaptive : {"no", "order", "dimension"}
        Refinement: ``order`` raises the order, starting at `order`; ``dimension`` refines a sparse grid input by input.
        The refinement ends when mean and standard deviation change by less than `tolerance`, and the verification
        realisations agree. No realisation is computed twice. For ``sobol``, ``halton`` and ``random``, higher orders
        reuse all realisations of lower orders. Higher orders also reuse all realisations for ``clenshaw-curtis``, whose
        levels double the number of intervals. For ``smolyak``, they reuse most realisations. Gauss tensor rules of
        different orders share only middle nodes.
    tolerance : float
        Tolerance of a refinement, relative to the largest standard deviation of each output over time.
    max_error : float, optional
        Root mean square error at the verification realisations at which a refinement ends, relative to the largest
        standard deviation of each output over time. If given, the refinement ends at this error, and `tolerance` has no
        effect. ``dimension`` then refines the level whose terms have the largest root mean square. Runs with an
        accuracy set this option. Default: None. Not with an `alignment`.
    max_realisations : int
        Largest number of different realisations for each alignment, including verification. A realisation may be
        integrated again, for longer or at more times. This limit counts it once, but ``realisations`` of the results
        counts each integration.
    elements : int or "adaptive", optional
        Number of boxes into which the germ space is divided, each with a separate chaos. ``adaptive`` splits boxes
        until `threshold` is met. Use elements for kinks or jumps (contact, friction, locking). The parts of a split
        element need new realisations.
    max_elements : int
        Largest number of elements of an adaptive refinement.
    threshold : float
        Error of the surrogate at which an adaptive refinement ends, relative to the largest standard deviation of each
        output over time.
    alignment : {"events", "phase", "two-frequency", "auto"} or tuple of str, optional
        Compare realisations at markers instead of at equal times. The times of the markers, and the motion between
        markers in normalised time, are expanded separately. If the sequence of markers differs between realisations,
        the germ space is first divided into at most `max_elements` boxes. With `elements`, the germ space is divided
        according to the error, which is large where the sequence changes. The attribute ``mixed`` of the results states
        the share of realisations whose sequence differs from the sequence of their element.

        ``events``, for mechanisms with impacts: at a given time, outputs are discontinuous in the inputs if event times
        vary. Outputs between the same events are continuous.

        ``phase``, for long rotations and oscillations: phases drift apart, so no order represents outputs at a given
        time for long. Outputs at equal phases, a quarter of a turn apart, stay similar. Alignment by phases needs a
        clock. Integration continues until the slowest realisation has reached the phase of the fastest one. A
        realisation counts as failed if its integration fails after the last output time but before this phase.
        Realisations in which a rotating body turns backwards or swings get separate elements. Realisations in which the
        clock stops also get separate elements; they are compared at equal times, and a warning states their share
        (``standing``).

        ``two-frequency``, for undamped oscillations with one or two frequencies, such as a double pendulum at moderate
        angles, whose realisations share no clock. Each realisation is fitted by a sum of harmonics of the frequencies
        in its spectrum. Frequencies and amplitudes are expanded. The alignment ``two-frequency`` needs no markers, and
        divides the germ space only by `elements`. Other motions (chaotic, damped, with impacts) are rejected with a
        message that states the residual. The attributes ``frequency_1``, ``frequency_2`` (``frequency_units``),
        ``harmonics`` and ``residual`` describe the fit. ``residual`` is the largest residual over nodes and outputs,
        relative to the root mean square of the motion.

        A tuple of ``plain`` (at equal times), ``events``, ``phase`` and ``two-frequency``: at each time, each output
        uses an alignment whose error at the verification realisations is near the smallest error of all alignments. An
        error is near if it is at most 1.25 times the smallest error, plus 5e-4 of the largest standard deviation over
        time. If one alignment satisfies this condition at all times, the output uses it at all times. Otherwise the
        output changes its alignment as seldom as possible, at times at which both alignments differ least.

        If both ``events`` and ``phase`` are named, and the clock is an angle that grows in all nodes, ``events+phase``
        is also tried. The markers of ``events+phase`` are the events, and equal phases that all nodes pass between the
        same events. Other phases are dropped (attributes ``phases_between_events`` and ``phases_dropped``).
        ``events+phase`` suits outputs that depend on both events and phases. Near an event it is not better than
        ``events``.

        ``auto``: all alignments that are possible for the mechanism; ``two-frequency`` is used only if the others leave
        an error above 1 % of the largest standard deviation. The attributes ``alignment``, ``alignment_error`` and
        ``alignment_left_out`` (JSON) state the selected alignments, their error, and the reasons why other alignments
        are impossible.
    clock : str, optional
        Clock of the alignment ``phase``: name of an output, or of a body or joint with an angle. If the angle grows,
        the phase is the angle. Otherwise the phase is the phase of an oscillation between extremes; its amplitude and
        mean may change slowly. Default: an angle that grows in some realisations, otherwise a quantity that oscillates
        in most realisations; the steadiest one is preferred.
    expansion : numpoly.ndpoly, optional
        Polynomials of chaospy in the inputs, in the order of the input names, with `nodes` and `weights` of a
        quadrature of chaospy: ``chaospy.generate_expansion(order, joint)`` and ``chaospy.generate_quadrature(order,
        joint)``. The chaos is the projection on the span of these polynomials, in orthonormal polynomials of the germs.
        With `expansion`, `order` has no effect. Polynomials that are not orthogonal for the distributions of the
        inputs, and rules that are too coarse for the polynomials, give a warning. The method rejects polynomials of
        other distributions.
    transform : {"rosenblatt", "nataf"}
        Transform of dependent inputs to functions of independent germs.
    verify : int
        Number of verification realisations, which determine the stated error of the surrogate; 0: no verification.
        Verification points differ from the nodes. Half of them have the distribution of the inputs; the others have
        densities like squares of polynomials of the inputs, which are large in the tails. The mean square error is
        weighted for the distribution of the inputs (:class:`uqmbd.extend.VerificationPoints`). With eight or more
        realisations, two are at extremes of the outputs, unless elements or an alignment are used. If the stated error
        is then above 10 %, two further points are in gaps between points with large errors. The other points are the
        same for every order. No point affects the coefficients. Verification ends a refinement, after which the stated
        error is slightly more likely to be too small. Sixteen points state the error within a factor of two for nearly
        all seeds. 32 points are so accurate even if the error grows fast in the tails of several inputs. The statistic
        ``verification_factor`` states the factor.
    seed : int
        Seed of sampling designs and of the verification points.
    label : str, optional
        Name of the results. Default: ``collocation``.

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
    tolerance: Annotated[float, uqmbd.extend.Bounds(0, 10**6, above=True)] = TOLERANCE
    max_error: Annotated[float, uqmbd.extend.Bounds(0, 10**6, above=True)] | None = None
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
        self._convert_expansion()
        everything = self.rule == "smolyak" and self.level is not None
        if self.order is None and not (everything and self.index_set == "total" and self.weights is None):
            object.__setattr__(self, "order", DEFAULT_ORDER)
        self._plans(self.node_name)
        if self._limits.elements is not None:
            if self.adaptive != "no":
                raise uqmbd.StudyError(
                    f"Collocation: elements={self.elements!r} contradicts adaptive={self.adaptive!r}, because "
                    "elements have a fixed order and are refined by splitting. Omit one of the two options."
                )
            if self.order == 0 or (self.order is None and self.level == 0):
                raise uqmbd.StudyError(
                    "Collocation: order is 0; expected 1 or more with elements, which are split by their terms of "
                    "highest order."
                )
        if self.clock is not None and "phase" not in self.families:
            raise uqmbd.StudyError(
                f"Collocation: clock={self.clock!r} requires alignment='phase'; omit clock or set alignment."
            )
        self._check_families()
        if self.max_error is not None and (self.adaptive == "no" or self.alignment is not None or not self.verify):
            raise uqmbd.StudyError(
                f"Collocation: max_error={self.max_error:g} ends a refinement by the error of realisations. "
                "It requires adaptive='order' or 'dimension', no alignment, and verify of 1 or more. Omit max_error, "
                "or change these options."
            )
        split, aligned = self.elements is not None, self.alignment not in (None, "two-frequency")
        for name, used, what in (
            ("tolerance", self.adaptive != "no", "adaptive='no'"),
            ("tolerance", self.max_error is None, f"max_error={self.max_error}"),
            ("max_elements", split or aligned, "elements=None"),
            ("threshold", split, "elements=None"),
        ):
            if not used and (given := getattr(self, name)) != getattr(Collocation, name):
                text = (
                    f"Collocation: {name}={given!r} has no effect with {what}. Omit {name}, or change "
                    f"{what.partition('=')[0]}."
                )
                warnings.warn(text, uqmbd.StudyWarning, stacklevel=3)

    def _convert_expansion(self) -> None:
        """Store a given expansion and its rule as plain numbers; `nodes` and `weights` then belong to the expansion."""
        if self.expansion is None:
            for name, what in (("nodes", "a whole number of 1 or more"), ("weights", "a number above 0")):
                if isinstance(given := getattr(self, name), np.ndarray):
                    raise uqmbd.StudyError(
                        f"Collocation: {name} is an array of the shape {given.shape}; expected {what} for each "
                        "input. An array of nodes or weights also requires expansion=."
                    )
            return
        for name, usual in (("order", (None, DEFAULT_ORDER)), ("transform", (Collocation.transform,))):
            if (given := getattr(self, name)) not in usual:
                raise uqmbd.StudyError(
                    f"Collocation: {name}={given!r} cannot be combined with expansion=; omit {name}."
                )
        if isinstance(self.expansion, UserExpansion) and self.nodes is None and self.weights is None:
            return
        object.__setattr__(self, "expansion", UserExpansion.of(self.expansion, self.nodes, self.weights))
        object.__setattr__(self, "nodes", None)
        object.__setattr__(self, "weights", None)

    @property
    def design(self) -> str:
        """Rule of the nodes, with a default for the method."""
        return self._plans(self.node_name).design

    @property
    def grid(self) -> str:
        """Name of the rule if it is a grid; otherwise empty."""
        return self._plans(self.node_name).grid

    @property
    def families(self) -> tuple[Family, ...]:
        """Families that `alignment` names; empty for outputs at equal times."""
        if self.alignment is None:
            return ()
        if self.alignment == "auto":
            return FAMILIES
        return (self.alignment,) if isinstance(self.alignment, str) else tuple(self.alignment)

    def _check_families(self) -> None:
        """Raise StudyError for options that contradict a choice between families."""
        if self.alignment is None or self.alignment in ("events", "phase", "two-frequency"):
            return
        given = f"Collocation: alignment={self.alignment!r}"
        if len(self.families) < 2 or len(set(self.families)) < len(self.families):
            raise uqmbd.StudyError(
                f"{given}; expected a tuple of two or more different families out of "
                f"{', '.join(map(repr, FAMILIES))}. Give a single family as a string, such as alignment='phase'; "
                "alignment=None disables the alignment."
            )
        if not self.verify:
            raise uqmbd.StudyError(
                f"{given} selects families by their errors at verification realisations, but verify is "
                "0; expected 1 or more."
            )
        if self.elements is not None:
            raise uqmbd.StudyError(
                f"{given} contradicts elements={self.elements!r}: elements are refined for one family only. Give a "
                "single family, such as alignment='phase'. If sequences of events or phases differ, families split "
                "automatically into at most max_elements elements."
            )

    @property
    def _limits(self) -> uqmbd.extend.ElementLimits:
        return uqmbd.extend.ElementLimits(self.elements, self.max_elements, self.threshold)

    def _plans(self, label: str) -> Plans:
        return Plans(label, **{f.name: getattr(self, f.name) for f in fields(Plans) if f.name != "label"})

    def watches(self, mechanism: uqmbd.Mechanism) -> Mapping[str, Any]:
        """Return the angles of bodies and joints to observe, if a clock is needed."""
        return uqmbd.extend.watched_angles(mechanism) if "phase" in self.families else {}

    def remarks(self, study: uqmbd.Study) -> tuple[str, ...]:
        """Return a text on the clock at the means of the inputs."""
        problem = study.problem(self)
        if "phase" not in self.families or problem.timeless or not len(study.mechanism.inputs):
            return ()
        return (uqmbd.extend.clock_at_means(problem, self.clock),)

    def estimate(self, study: uqmbd.Study) -> uqmbd.extend.Estimate:
        """Return the numbers of realisations, and the memory of their outputs and of the chaos."""
        space = uqmbd.extend.GermSpace.of(study.mechanism.inputs, self.transform)
        ways = (
            possible_families(study.problem(self), self.families) if self.alignment == "auto" else (self.families, "")
        )
        return estimated(study, space, self._plans(self.node_name), self._limits, *ways)

    def sizing(self, study: uqmbd.Study, accuracy: float | None) -> uqmbd.extend.Sizing | None:
        """Return options for an accuracy: the order; refinements and splits end at the accuracy or their limit."""
        space = uqmbd.extend.GermSpace.of(study.mechanism.inputs, self.transform)
        return sized(
            partial(replace, self),
            space,
            self._plans(self.node_name),
            self._limits,
            Limits(self.tolerance, self.max_realisations, study.rtol, error=self.max_error),
            accuracy,
            aligned=self.alignment is not None,
        )

    def obstacle(self, study: uqmbd.Study) -> str | None:
        """Return why the method cannot compute a study, or None.

        Reasons are: no random input, a distribution without moments, too many nodes, or too few samples.
        """
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
        """Compute realisations, fit, verify, and return statistics.

        Parameters
        ----------
        problem : uqmbd.extend.Problem
            Problem with random inputs.

        Returns
        -------
        xarray.DataTree
            Node of the method.

        Raises
        ------
        uqmbd.StudyError
            If an option does not suit the inputs.
        uqmbd.IntegrationError
            If failures leave too few realisations.
        """
        space, plans = problem.germ_space(self.transform), self._plans(problem.label)
        limits = Limits(self.tolerance, self.max_realisations, problem.rtol, error=self.max_error)
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
